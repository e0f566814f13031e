//! Warnings on parameters of an axis that are valid but implausible.

use virtual_axes_core::config::{AxisConfig, AxisUnits, Periods, PositionControllerConfig};
use virtual_axes_core::design::{DesignError, check_stable, has_stable_poles};
use virtual_axes_core::machine::{AxisError, design_controller, prediction_model};
use virtual_axes_core::units::Rounded;

/// Returns all warnings on an axis.
pub fn all(axis: &AxisConfig, periods: &Periods) -> Vec<String> {
    loops(axis, periods).into_iter().chain(motor_speed(axis)).collect()
}

/// Returns warnings on gains of 0; without these, on a loop that is unstable by the linear model.
pub fn loops(axis: &AxisConfig, periods: &Periods) -> Vec<String> {
    let name = axis.name();
    let is_cascade = axis.position_loop.controller == PositionControllerConfig::Cascade;
    let gains = [
        ("position", axis.position_loop.gain, is_cascade),
        ("velocity", axis.velocity_loop.gain, true),
        ("current", axis.current_loop.gain, true),
    ];
    let zero = gains.into_iter().filter(|(_, gain, is_used)| *gain == 0.0 && *is_used);
    let zero: Vec<String> = zero
        .map(|(quantity, ..)| format!("{quantity}_loop.gain of {name} is 0: no {quantity} control"))
        .collect();
    if !zero.is_empty() {
        return zero;
    }
    let unstable = match prediction_model(axis, periods) {
        Err(AxisError::Design(DesignError::UnstableInnerLoops(_))) => {
            Some(format!("the inner loops of {name} are unstable"))
        }
        Ok(model) if !has_stable_poles(&model) => Some(format!("the inner loops of {name} are unstable")),
        Ok(model) => {
            let stability = design_controller(axis, &model).and_then(|rst| check_stable(&model, &rst));
            match stability {
                Err(DesignError::Unstable { .. }) => Some(format!("the position loop of {name} is unstable")),
                Err(_) => Some(format!(
                    "the poles of the position loop of {name} cannot be computed; it can be unstable"
                )),
                Ok(()) => None,
            }
        }
        Err(_) => None,
    };
    unstable.into_iter().collect()
}

/// Returns a warning if the velocity limit exceeds the maximum speed of the motor at the axis.
fn motor_speed(axis: &AxisConfig) -> Option<String> {
    let AxisUnits { speed, speed_name, speed_key, .. } = AxisUnits::for_kind(axis.kind());
    let (limit, motor) = (axis.limits.velocity, axis.motor.max_speed * axis.transmission_ratio.abs());
    (limit > motor * (1.0 + 1e-9)).then(|| {
        format!(
            "{}.limits.velocity_{speed_key} = {} {speed_name} exceeds {} {speed_name}, the maximum speed of its motor",
            axis.name(),
            Rounded(limit / speed),
            Rounded(motor / speed)
        )
    })
}
