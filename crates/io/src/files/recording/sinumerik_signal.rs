//! Signals of Sinumerik controls by their names: high-frequency data of Sinumerik Edge (`DES_POS|1`).
//!
//! Names, descriptions and units of the high-frequency data are those of the page "Which HF data can be collected via
//! SINUMERIK Connector?" of Siemens,
//! <https://docs.industrial-operations-x.siemens.cloud/r/de-de/1.0.0/sinumerik-connector/faq/which-hf-data-can-be-collected-via-sinumerik-connector>.

use super::found_column::{ColumnUnit, FoundColumn};
use super::unit::Channel;

/// Number of the cycle of the position controller.
pub(super) const CYCLE: &str = "CYCLE";

/// Returns the meaning of a high-frequency signal `NAME|AXIS` of Sinumerik Edge, or `CYCLE`.
pub(super) fn edge_signal(number: usize, header: &str) -> Option<FoundColumn> {
    let mut column = FoundColumn::unknown(number, header, "");
    if header == CYCLE {
        (column.channel, column.unit) = (Some(Channel::Time), Some(ColumnUnit::samples()));
        column.is_secondary = true;
        column.reason = "CYCLE of Sinumerik: number of the position cycle".to_owned();
        return Some(column);
    }
    let (name, axis) = header.split_once('|')?;
    if axis.is_empty() || !axis.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    column.axis = Some(axis.to_owned());
    let length = || Some(ColumnUnit::by_kind("mm", "deg"));
    let (channel, unit, what) = match name {
        "DES_POS" => (Some(Channel::Psec), length(), "position setpoint after the fine interpolator"),
        "ENC_POS" => (Some(Channel::Position), length(), "position of the active encoder"),
        "ENC1_POS" => (Some(Channel::Position), length(), "position of encoder 1, if there is no ENC_POS"),
        "ENC2_POS" => (Some(Channel::Position), length(), "position of encoder 2, if there is no ENC_POS"),
        "CURRENT" => (Some(Channel::Current), Some(ColumnUnit::si(Channel::Current)), "current of the motor"),
        "TORQUE" => (
            Some(Channel::Current),
            Some(ColumnUnit::by_kind("N.m", "N.m")),
            "torque, if there is no CURRENT",
        ),
        "VEL_FFW" => {
            (Some(Channel::VelocityFeedforward), Some(ColumnUnit::axis_speed()), "velocity feedforward")
        }
        "TORQUE_FFW" => {
            let unit = ColumnUnit::si(Channel::TorqueFeedforward);
            (Some(Channel::TorqueFeedforward), Some(unit), "torque or force feedforward")
        }
        "CTRL_POS" => (None, None, "setpoint behind the filters of the position controller, PSEC is DES_POS"),
        "CTRL_DIFF" | "CTRL_DIFF2" | "CONT_DEV" => (None, None, "an error or a deviation"),
        "CMD_SPEED" => (None, None, "a setpoint of the speed"),
        "LOAD" | "POWER" => (None, None, "a load or a power"),
        _ => return None,
    };
    (column.channel, column.unit) = (channel, unit);
    column.is_secondary = matches!(name, "ENC1_POS" | "ENC2_POS" | "TORQUE");
    column.reason = format!("{name} of Sinumerik: {what}");
    Some(column)
}
