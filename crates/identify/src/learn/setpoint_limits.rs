//! Limits of compensated setpoints.

use std::fmt;

use virtual_axes_core::config::{AxisConfig, AxisKind, AxisUnits};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::trajectory::limits::TRAVEL_TOLERANCE;
use virtual_axes_core::units::Rounded;

/// Relative tolerance of acceleration and velocity, for rounding.
const TOLERANCE: f64 = 1e-6;

/// Limited quantity of setpoints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetpointQuantity {
    /// Position.
    Position,
    /// First difference over the position cycle.
    Velocity,
    /// Second difference over the position cycle.
    Acceleration,
}

/// Compensated setpoint beyond a limit of its axis.
#[derive(Debug, Clone, PartialEq)]
pub struct SetpointExcess {
    /// Name of the axis.
    pub axis: String,
    /// Kind of the axis.
    pub kind: AxisKind,
    /// Time from the start, s.
    pub time: f64,
    /// Quantity.
    pub quantity: SetpointQuantity,
    /// Value, m or rad and s.
    pub value: f64,
    /// Limit in the same unit, with the allowed excess: that of the axis, or the largest value of the programmed setpoints
    /// if it is larger.
    pub limit: f64,
}

impl fmt::Display for SetpointExcess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SetpointExcess { axis, kind, time, quantity, value, limit } = self;
        let (name, power) = match quantity {
            SetpointQuantity::Position => ("position", ""),
            SetpointQuantity::Velocity => ("velocity", "/s"),
            SetpointQuantity::Acceleration => ("acceleration", "/s²"),
        };
        let unit = AxisUnits::for_kind(*kind).si_name;
        let (value, limit, time) = (Rounded(*value), Rounded(*limit), Rounded(*time));
        write!(
            f,
            "axis {axis}, {time} s: the {name} of the compensated setpoints is {value} {unit}{power}; the limit is \
             {limit} {unit}{power}"
        )
    }
}

/// Returns the first setpoint of `psec` (m or rad, every `period` s) beyond the limits of `axis`.
///
/// The limit of velocity or acceleration is the largest value of the `programmed` setpoints if these exceed it. The
/// acceleration may exceed that of the axis by `acceleration_excess`, relative to it: planned motions use all of it.
pub(super) fn first_excess(
    axis: &AxisConfig,
    psec: &[f64],
    programmed: &[f64],
    period: f64,
    acceleration_excess: f64,
) -> Option<SetpointExcess> {
    let limits = &axis.limits;
    let excess = |k: usize, quantity, value, limit| SetpointExcess {
        axis: axis.name().to_owned(),
        kind: axis.kind(),
        time: k as f64 * period,
        quantity,
        value,
        limit,
    };
    let joint = JointLimits::from_axis(axis);
    let outside = psec.iter().position(|&x| !joint.is_within_travel(x)).map(|k| {
        let limit = if psec[k] < limits.travel_min - TRAVEL_TOLERANCE {
            limits.travel_min
        } else {
            limits.travel_max
        };
        excess(k, SetpointQuantity::Position, psec[k], limit)
    });
    let of_order = |order: usize, own: f64, quantity| {
        let largest = differences(programmed, order, period).fold(own, |most, (_, value)| most.max(value));
        let beyond = differences(psec, order, period)
            .find(|(_, value)| *value > largest * (1.0 + TOLERANCE) || value.is_nan());
        beyond.map(|(k, value)| excess(k, quantity, value, largest))
    };
    outside.or_else(|| of_order(1, limits.velocity, SetpointQuantity::Velocity)).or_else(|| {
        let allowed = limits.acceleration * (1.0 + acceleration_excess);
        of_order(2, allowed, SetpointQuantity::Acceleration)
    })
}

/// Returns index and absolute value of the first or second differences.
fn differences(psec: &[f64], order: usize, period: f64) -> impl Iterator<Item = (usize, f64)> {
    let at = move |k: usize| match order {
        1 => (psec[k] - psec[k - 1]) / period,
        _ => (psec[k] - 2.0 * psec[k - 1] + psec[k - 2]) / (period * period),
    };
    (order..psec.len()).map(move |k| (k, at(k).abs()))
}
