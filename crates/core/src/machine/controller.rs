//! The position controller of an axis, as its configuration asks for it.

use crate::config::{AxisConfig, AxisKind, FeedforwardConfig, GpcConfig, Periods, PositionControllerConfig};
use crate::control::{Guard, PositionController, Rst, Transfer};
use crate::design::{DesignError, GpcTuning, PredictionModel, Weight, accept, gpc};
use crate::units::{DEGREE, MILLISECOND_NS, Nanoseconds, seconds};

use super::AxisError;
use super::prediction::prediction_model;

/// Standstill of the setpoint after which an axis under a controller with integral action is held: a controller
/// with a bandwidth worth its name has finished a move by then.
pub const REST_AFTER: Nanoseconds = 200 * MILLISECOND_NS;

/// Error with which an axis may rest, m.
const REST_ERROR_LINEAR: f64 = 1e-6;
/// Error with which an axis may rest, rad: half a thousandth of a degree.
const REST_ERROR_ROTARY: f64 = 0.5e-3 * DEGREE;
/// How long what a controller leaves behind takes to fade, where it would be a bump.
const TRANSFER: Nanoseconds = 300 * MILLISECOND_NS;

impl From<&GpcConfig> for GpcTuning {
    fn from(config: &GpcConfig) -> Self {
        let weight = config.lambda.map_or(Weight::Relative(config.lambda_rel), Weight::Absolute);
        GpcTuning { n1: config.n1, n2: config.n2, nu: config.nu, weight }
    }
}

/// The position controller of an axis by its polynomials, on the model that it is designed for; the cascade
/// as what it is inside the loop, proportional.
///
/// # Errors
/// [`DesignError`] if the configuration makes no controller.
pub fn designed(axis: &AxisConfig, model: &PredictionModel) -> Result<Rst, DesignError> {
    match &axis.position_loop.controller {
        PositionControllerConfig::Cascade => Ok(Rst::proportional(axis.position_loop.gain)?),
        PositionControllerConfig::Gpc(config) => gpc(model, &GpcTuning::from(config)),
        PositionControllerConfig::Rst(config) => {
            Ok(Rst::new(&config.r, &config.s, &config.t, config.t_first)?)
        }
    }
}

/// The controller and its name as in `position_loop.controller`.
pub(super) fn position_controller(
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<(PositionController, &'static str), AxisError> {
    let (gain, period) = (axis.position_loop.gain, seconds(periods.position));
    let transfer = Transfer {
        step: axis.limits.acceleration * period / axis.transmission_ratio,
        periods: (TRANSFER / periods.position) as u32,
    };
    let name = match &axis.position_loop.controller {
        PositionControllerConfig::Cascade => {
            return Ok((PositionController::proportional(gain, transfer), "cascade"));
        }
        PositionControllerConfig::Gpc(_) => "gpc",
        PositionControllerConfig::Rst(_) => "rst",
    };
    let model = prediction_model(axis, periods)?;
    let rst = accept(&model, designed(axis, &model)?, axis.position_loop.allow_unstable)?;
    let rest_error = match axis.kind {
        AxisKind::Linear => REST_ERROR_LINEAR,
        AxisKind::Rotary => REST_ERROR_ROTARY,
    };
    let guard = Guard {
        gain,
        period,
        rest_after: (REST_AFTER / periods.position) as u32,
        rest_error: rest_error / axis.transmission_ratio,
    };
    Ok((PositionController::rst(rst, guard, transfer), name))
}

/// The feedforward of the axis: velocity and torque are the cascade's, an RST controller has it in T.
pub(super) fn feedforward(axis: &AxisConfig) -> FeedforwardConfig {
    match axis.position_loop.controller {
        PositionControllerConfig::Cascade => axis.feedforward,
        _ => FeedforwardConfig { velocity: 0.0, torque: 0.0, ..axis.feedforward },
    }
}
