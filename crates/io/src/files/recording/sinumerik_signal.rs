//! Signals of Sinumerik controls by their names: high-frequency data of Sinumerik Edge (`DES_POS|1`) and signals of the
//! trace of Sinumerik Operate (`/Nck/!SD/nckServoDataActCurr32 [u1, 7]`).
//!
//! Names, descriptions and units of the high-frequency data are those of the page "Which HF data can be collected via
//! SINUMERIK Connector?" of Siemens,
//! <https://docs.industrial-operations-x.siemens.cloud/r/de-de/1.0.0/sinumerik-connector/faq/which-hf-data-can-be-collected-via-sinumerik-connector>;
//! it also relates `cmdContrPos` to `DES_POS`. Names and descriptions of the signals of the trace are those of the export
//! `Tav23362_2140_frenata_15_4_26_EmgTest.xml` in <https://github.com/hailongchenn/sinumerik-trace-viewer>, in which
//! position, velocity and acceleration of a rotary axis agree in degrees, 1/min and degrees per s².

use super::found_column::{ColumnUnit, FoundColumn, UnitSource};
use super::unit::Channel;

/// Number of the cycle of the position controller.
pub(super) const CYCLE: &str = "CYCLE";

/// Returns the meaning of a high-frequency signal `NAME|AXIS` of Sinumerik Edge, or `CYCLE`.
pub(super) fn edge_signal(number: usize, header: &str) -> Option<FoundColumn> {
    let mut column = FoundColumn::unknown(number, header, "");
    if header == CYCLE {
        (column.channel, column.unit) = (Some(Channel::Time), Some(ColumnUnit(UnitSource::Samples)));
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
        "CURRENT" => (
            Some(Channel::Current),
            Some(ColumnUnit(UnitSource::Si(Channel::Current))),
            "current of the motor",
        ),
        "TORQUE" => (
            Some(Channel::Torque),
            Some(ColumnUnit::by_kind("N.m", "N.m")),
            "torque of the motor; with CURRENT it tells the torque constant, without it the current",
        ),
        "VEL_FFW" => (
            Some(Channel::VelocityFeedforward),
            Some(ColumnUnit(UnitSource::AxisSpeed)),
            "velocity feedforward",
        ),
        "TORQUE_FFW" => {
            let unit = ColumnUnit(UnitSource::Si(Channel::TorqueFeedforward));
            (Some(Channel::TorqueFeedforward), Some(unit), "torque or force feedforward")
        }
        "CTRL_POS" => (None, None, "setpoint behind the filters of the position controller, PSEC is DES_POS"),
        "CTRL_DIFF" | "CTRL_DIFF2" | "CONT_DEV" => (None, None, "an error or a deviation"),
        "CMD_SPEED" => (None, None, "a setpoint of the speed"),
        "LOAD" | "POWER" => (None, None, "a load or a power"),
        _ => return None,
    };
    (column.channel, column.unit) = (channel, unit);
    column.is_secondary = matches!(name, "ENC1_POS" | "ENC2_POS");
    column.reason = format!("{name} of Sinumerik: {what}");
    Some(column)
}

/// Returns the meaning of a signal of the trace: `/Nck/!SD/NAME [u1, AXIS]`.
pub(super) fn trace_signal(number: usize, header: &str) -> Option<FoundColumn> {
    let path = header.trim().trim_start_matches('+');
    if !path.starts_with("/Nck/") && !path.starts_with("/Channel/") {
        return None;
    }
    let mut column = FoundColumn::unknown(number, header, "");
    let (_, name) = path.rsplit_once('/')?;
    let (name, address) = name.split_once('[').map_or((name, None), |(name, rest)| (name, Some(rest)));
    let name = name.trim();
    column.axis = address.and_then(|address| {
        let address = address.trim_end().trim_end_matches(']');
        let axis = address.rsplit([' ', ',', ';']).next()?;
        axis.bytes()
            .all(|byte| byte.is_ascii_digit())
            .then(|| axis.to_owned())
            .filter(|axis| !axis.is_empty())
    });
    let bare = name.strip_suffix("64").or_else(|| name.strip_suffix("32")).unwrap_or(name);
    let length = || Some(ColumnUnit::by_kind("mm", "deg"));
    let (channel, unit, what) = match bare {
        "nckServoDataCmdPos1stEnc" | "nckServoDataCmdPos2ndEnc" => {
            (Some(Channel::Psec), length(), "position setpoint")
        }
        "cmdContrPos" => {
            (Some(Channel::Psec), length(), "position setpoint, if there is none of the servo data")
        }
        "nckServoDataActPos1stEnc" => (Some(Channel::Position), length(), "position of measuring system 1"),
        "nckServoDataActPos2ndEnc" => (Some(Channel::Position), length(), "position of measuring system 2"),
        "measPos1" => (
            Some(Channel::Position),
            length(),
            "position of measuring system 1, if there is none of the servo data",
        ),
        "measPos2" => (
            Some(Channel::Position),
            length(),
            "position of measuring system 2, if there is none of the servo data",
        ),
        "nckServoDataActCurr" => (
            Some(Channel::Current),
            Some(ColumnUnit(UnitSource::Si(Channel::Current))),
            "torque-producing current",
        ),
        "nckServoDataActVelMot" | "nckServoDataActVelMotorSide" => (
            None,
            None,
            "speed of the motor; its unit is not in the file: map it by --column 'velocity=COLUMN[UNIT]'",
        ),
        "nckServoDataCmdTorque" | "nckServoDataCmdVelCtrlIn" | "nckServoDataCmdAccCtrlIn" => {
            (None, None, "a setpoint that is not read")
        }
        "nckServoDataFlwErr" | "nckServoDataContDev" | "nckServoDataCtrlDev" | "measPosDev" => {
            (None, None, "an error or a deviation")
        }
        _ => (None, None, "no signal that is read"),
    };
    (column.channel, column.unit) = (channel, unit);
    column.is_secondary = matches!(bare, "cmdContrPos" | "measPos1" | "measPos2");
    column.reason = format!("{name} of Sinumerik: {what}");
    Some(column)
}
