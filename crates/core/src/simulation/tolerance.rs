//! Path tolerance and goal tolerance of a motion, as defined by the action
//! `control_msgs/FollowJointTrajectory`.
//!
//! With e the delay-compensated following error of an axis at position cycle k, the errors are
//!
//! ```text
//! position e[k]    velocity (e[k] − e[k−1])/Tsp    acceleration (e[k] − 2 e[k−1] + e[k−2])/Tsp²
//! ```

use crate::machine::AxisSample;
use crate::units::{Nanoseconds, seconds};

/// Largest allowed errors of a joint; `None` disables a tolerance.
///
/// The errors are relative to the setpoints at the input of the position controller, so the pure delay
/// is not an error.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tolerance {
    /// Position tolerance, m or rad.
    pub position: Option<f64>,
    /// Velocity tolerance, m/s or rad/s.
    pub velocity: Option<f64>,
    /// Acceleration tolerance, m/s² or rad/s².
    pub acceleration: Option<f64>,
}

/// Path tolerances, goal tolerances and goal time tolerance of a motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tolerances {
    /// Path tolerances during the motion, one per joint of the trajectory, in its order.
    pub path: Vec<Tolerance>,
    /// Goal tolerances at the end of the motion, one per joint of the trajectory, in its order.
    pub goal: Vec<Tolerance>,
    /// Goal time tolerance, ns: time allowed after the end of the trajectory plus the pure delay to
    /// reach the goal tolerances; `None` is unlimited.
    pub goal_time: Option<Nanoseconds>,
}

/// Quantity of a violated tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Position, m or rad.
    Position,
    /// Velocity, m/s or rad/s.
    Velocity,
    /// Acceleration, m/s² or rad/s².
    Acceleration,
}

/// Violation of a tolerance by one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToleranceViolation {
    /// Index of the axis in the machine.
    pub axis_index: usize,
    /// Violated quantity.
    pub quantity: Quantity,
    /// Error, setpoint − actual value.
    pub error: f64,
    /// Tolerance.
    pub limit: f64,
}

/// Delay-compensated following errors of one axis at the last three position cycles, newest first.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ErrorHistory([f64; 3]);

impl ErrorHistory {
    /// Adds the error of the next instant.
    pub fn push(&mut self, sample: &AxisSample) {
        let [newest, before, _] = self.0;
        self.0 = [sample.delay_compensated_following_error(), newest, before];
    }

    /// Returns the first violation of `tolerance` by the axis with index `axis_index`; `period` is Tsp, ns.
    pub fn violation(
        &self,
        axis_index: usize,
        tolerance: &Tolerance,
        period: Nanoseconds,
    ) -> Option<ToleranceViolation> {
        let [newest, before, earlier] = self.0;
        let tsp = seconds(period);
        [
            (Quantity::Position, newest, tolerance.position),
            (Quantity::Velocity, (newest - before) / tsp, tolerance.velocity),
            (Quantity::Acceleration, (newest - 2.0 * before + earlier) / tsp.powi(2), tolerance.acceleration),
        ]
        .into_iter()
        .find_map(|(quantity, error, limit)| {
            let limit = limit?;
            (error.abs() > limit).then_some(ToleranceViolation { axis_index, quantity, error, limit })
        })
    }
}

/// Returns the first violation by the axes `axis_indices`, with one tolerance per axis.
pub(super) fn first_violation(
    axis_indices: &[usize],
    tolerances: &[Tolerance],
    errors: &[ErrorHistory],
    period: Nanoseconds,
) -> Option<ToleranceViolation> {
    axis_indices
        .iter()
        .zip(tolerances)
        .find_map(|(&axis, tolerance)| errors.get(axis)?.violation(axis, tolerance, period))
}
