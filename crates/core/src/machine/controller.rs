//! Position controller and feedforward of an axis, created from its configuration.

use crate::config::{AxisConfig, AxisKind, FeedforwardConfig, GpcConfig, Periods, PositionControllerConfig};
use crate::control::{BumplessTransfer, FallbackController, PositionController, Rst};
use crate::design::{ControlWeight, DesignError, GpcTuning, PredictionModel, gpc, require_stable};
use crate::units::{DEGREE, MILLISECOND_NS, Nanoseconds, seconds};

use super::AxisError;
use super::prediction::prediction_model;

/// Standstill of the setpoint after which the fallback controller replaces an RST controller with integral action.
/// Controllers of usual bandwidth complete a move within this time.
pub const FALLBACK_DELAY: Nanoseconds = 200 * MILLISECOND_NS;

/// Following error within which a linear axis may stay at standstill, m.
const STANDSTILL_TOLERANCE_LINEAR: f64 = 1e-6;
/// Following error within which a rotary axis may stay at standstill, rad (0.5 mdeg).
const STANDSTILL_TOLERANCE_ROTARY: f64 = 0.5e-3 * DEGREE;
/// Duration of a bumpless transfer between two position controllers.
const TRANSFER_DURATION: Nanoseconds = 300 * MILLISECOND_NS;

impl From<&GpcConfig> for GpcTuning {
    fn from(config: &GpcConfig) -> Self {
        let weight =
            config.lambda.map_or(ControlWeight::Relative(config.lambda_rel), ControlWeight::Absolute);
        GpcTuning { n1: config.n1, n2: config.n2, nu: config.nu, weight }
    }
}

/// Designs the position controller of an axis in RST form on its prediction model (Prévost section 5).
///
/// The cascade is returned as its proportional position controller.
///
/// # Errors
/// [`DesignError`] if the configuration does not give a controller.
pub fn design_controller(axis: &AxisConfig, model: &PredictionModel) -> Result<Rst, DesignError> {
    match &axis.position_loop.controller {
        PositionControllerConfig::Cascade => Ok(Rst::proportional(axis.position_loop.gain)?),
        PositionControllerConfig::Gpc(config) => gpc(model, &GpcTuning::from(config)),
        PositionControllerConfig::Rst(config) => {
            Ok(Rst::new(&config.r, &config.s, &config.t, config.t_first)?)
        }
    }
}

/// Creates the position controller of an axis.
pub(super) fn create_position_controller(
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<PositionController, AxisError> {
    let (gain, period) = (axis.position_loop.gain, seconds(periods.position));
    let transfer = BumplessTransfer {
        max_step: axis.limits.acceleration * period / axis.transmission_ratio,
        cycles: (TRANSFER_DURATION / periods.position) as u32,
    };
    if axis.position_loop.controller == PositionControllerConfig::Cascade {
        return Ok(PositionController::proportional(gain, transfer));
    }
    let model = prediction_model(axis, periods)?;
    let rst = require_stable(&model, design_controller(axis, &model)?, axis.position_loop.allow_unstable)?;
    let standstill_tolerance = match axis.kind {
        AxisKind::Linear => STANDSTILL_TOLERANCE_LINEAR,
        AxisKind::Rotary => STANDSTILL_TOLERANCE_ROTARY,
    };
    let fallback = FallbackController {
        gain,
        period,
        standstill_cycles: (FALLBACK_DELAY / periods.position) as u32,
        standstill_tolerance: standstill_tolerance / axis.transmission_ratio,
    };
    Ok(PositionController::rst(rst, fallback, transfer))
}

/// Returns the feedforward weights of an axis: VFFW and TFFW apply to the cascade only, an RST controller contains its
/// feedforward in T.
pub(super) fn feedforward_config(axis: &AxisConfig) -> FeedforwardConfig {
    match axis.position_loop.controller {
        PositionControllerConfig::Cascade => axis.feedforward,
        _ => FeedforwardConfig { velocity: 0.0, torque: 0.0, ..axis.feedforward },
    }
}
