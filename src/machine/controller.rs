//! The position controller of an axis, as its configuration asks for it.

use crate::config::{AxisConfig, FeedforwardConfig, GpcConfig, Periods, PositionControllerConfig};
use crate::control::{Hold, PositionController, Rst};
use crate::design::{DesignError, GpcTuning, Weight, gpc};
use crate::units::{MILLISECOND_NS, Nanoseconds};

use super::AxisError;
use super::prediction::prediction_model;

/// Standstill of the set-point after which an axis is held: a controller with a bandwidth worth its name
/// has finished a move by then.
const HOLD_AFTER: Nanoseconds = 200 * MILLISECOND_NS;

impl From<&GpcConfig> for GpcTuning {
    fn from(config: &GpcConfig) -> Self {
        let weight = config.lambda.map_or(Weight::Relative(config.lambda_rel), Weight::Absolute);
        GpcTuning { n1: config.n1, n2: config.n2, nu: config.nu, weight }
    }
}

/// The controller and its name as in `position_loop.controller`.
pub(super) fn position_controller(
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<(PositionController, &'static str), AxisError> {
    let gain = axis.position_loop.gain;
    let (rst, name) = match &axis.position_loop.controller {
        PositionControllerConfig::Cascade => {
            return Ok((PositionController::Proportional { gain }, "cascade"));
        }
        PositionControllerConfig::Gpc(config) => {
            (gpc(&prediction_model(axis, periods)?, &GpcTuning::from(config))?, "gpc")
        }
        PositionControllerConfig::Rst(config) => {
            let rst = Rst::new(&config.r, &config.s, &config.t, config.t_first);
            (rst.map_err(DesignError::from)?, "rst")
        }
    };
    let after = (HOLD_AFTER / periods.position) as u32;
    let hold = rst.has_integral_action().then_some(Hold { gain, after });
    Ok((PositionController::Rst { rst, hold }, name))
}

/// The feedforward of the axis: velocity and torque are the cascade's, an RST controller has it in T.
pub(super) fn feedforward(axis: &AxisConfig) -> FeedforwardConfig {
    match axis.position_loop.controller {
        PositionControllerConfig::Cascade => axis.feedforward,
        _ => FeedforwardConfig { velocity: 0.0, torque: 0.0, ..axis.feedforward },
    }
}
