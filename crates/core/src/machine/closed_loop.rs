//! Closed loop of an axis from setpoint to position, as an impulse response.

use std::sync::Arc;

use crate::config::{
    AxisConfig, FrictionConfig, GravityConfig, LimitsConfig, MachineConfig, Periods,
    PositionControllerConfig, TransmissionConfig,
};
use crate::design::{DesignError, ImpulseResponse, require_stable};

use super::prediction::prediction_model;
use super::{AxisError, Machine, MachineError, MachineParameters, design_controller, deviating_plant_model};

/// Size of the impulse and movement of the setpoint per cycle, m or rad: far from the limits of motor and controllers.
const IMPULSE: f64 = 1e-6;
/// Cycles before the impulse beyond the preview of the controller.
const LEAD: usize = 8;
/// Longest response, position cycles.
const LONGEST: usize = 4096;
/// Value, relative to the largest, below which the end of the response is left out.
const NEGLIGIBLE: f64 = 1e-9;

/// Computes the response of the sampled position to an impulse of the setpoint of one position cycle (PSEC): the linear
/// closed loop of the axis with its controllers, feedforward, delays and the deviation of its plant.
///
/// The axis is simulated without friction, gravity, backlash and limits. The impulse is added to a slow motion, at which the
/// fallback controller is not active, and the response to the motion alone is subtracted. The response is dimensionless
/// and begins before the impulse if the controller has a preview.
///
/// # Errors
/// [`AxisError`] if the axis cannot be built, or if its closed loop is unstable or takes longer than 4096 cycles to settle.
pub fn closed_loop_response(axis: &AxisConfig, periods: &Periods) -> Result<ImpulseResponse, AxisError> {
    if !matches!(axis.position_loop.controller, PositionControllerConfig::Cascade) {
        let controller = design_controller(axis, &prediction_model(axis, periods)?)?;
        require_stable(&deviating_plant_model(axis, periods)?, controller, false)?;
    }
    let linear = linear_axis(axis);
    let parameters = MachineParameters::new(&MachineConfig::from_axis(linear, *periods));
    let parameters = parameters.map(Arc::new).map_err(|error| match error {
        MachineError::Axis { source, .. } => source,
        MachineError::AnotherMachine => DesignError::NoPoles.into(),
    })?;
    let preview = Machine::new(Arc::clone(&parameters)).preview_length();
    let impulse = LEAD + preview;
    let count = impulse + LONGEST;
    let ramp: Vec<f64> = (0..count + preview).map(|k| k as f64 * IMPULSE).collect();
    let mut with_impulse = ramp.clone();
    with_impulse[impulse] += IMPULSE;
    let simulate = |psec: &[f64]| -> Vec<f64> {
        let mut machine = Machine::new(Arc::clone(&parameters));
        let cycle = |k: usize| {
            machine.advance(&psec[k..=k], &psec[k + 1..=k + preview]);
            machine.axis(0).sample().position
        };
        (0..count).map(cycle).collect()
    };
    let (base, moved) = (simulate(&ramp), simulate(&with_impulse));
    let response: Vec<f64> = base.iter().zip(moved).map(|(base, moved)| (moved - base) / IMPULSE).collect();
    let largest = response.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let is_kept = |value: &f64| value.abs() > NEGLIGIBLE * largest || value.is_nan();
    let (Some(first), Some(last)) = (response.iter().position(is_kept), response.iter().rposition(is_kept))
    else {
        return Err(DesignError::NotSettling { cycles: LONGEST }.into());
    };
    if last + LEAD >= count || !largest.is_finite() {
        return Err(DesignError::NotSettling { cycles: LONGEST }.into());
    }
    Ok(ImpulseResponse::new(first as i64 - impulse as i64, response[first..=last].to_vec()))
}

/// Returns the axis without friction, gravity, backlash, compensations and limits.
fn linear_axis(axis: &AxisConfig) -> AxisConfig {
    let mut linear = axis.clone();
    linear.friction = FrictionConfig { a: 0.0, c: 0.0, i0: 0.0, ..axis.friction };
    linear.gravity = GravityConfig { weight: 0.0, tilt: 0.0, ..axis.gravity };
    linear.feedforward.friction = 0.0;
    // An axis in contact.
    linear.transmission =
        axis.transmission.map(|t| TransmissionConfig { backlash: 0.0, load_friction: 0.0, ..t });
    linear.position_loop.backlash_compensation.width = 0.0;
    let unlimited = f64::INFINITY;
    linear.limits = LimitsConfig { travel_min: -unlimited, travel_max: unlimited, ..axis.limits };
    linear
}
