//! How far a motion may stray, as `control_msgs/FollowJointTrajectory` asks for it.
//!
//! With e the synchronized tracking error of an axis at position instant k, the errors are
//!
//! ```text
//! position e[k]    velocity (e[k] − e[k−1])/Tsp    acceleration (e[k] − 2 e[k−1] + e[k−2])/Tsp²
//! ```

use crate::machine::AxisSample;
use crate::units::{Nanoseconds, seconds};

/// Largest error of a joint that is allowed; none is any.
///
/// Errors are against the setpoints as they reach the position controller, so that the pure delay is
/// no error.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tolerance {
    /// m or rad.
    pub position: Option<f64>,
    /// m/s or rad/s.
    pub velocity: Option<f64>,
    /// m/s² or rad/s².
    pub acceleration: Option<f64>,
}

/// What a motion has to keep.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tolerances {
    /// While it is under way, one for each joint of the trajectory, in its order.
    pub path: Vec<Tolerance>,
    /// At its end, likewise.
    pub goal: Vec<Tolerance>,
    /// How long after its end, extended by the pure delay, the axes may take to get there, ns; none: as
    /// long as they need.
    pub goal_time: Option<Nanoseconds>,
}

/// What an error is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// m or rad.
    Position,
    /// m/s or rad/s.
    Velocity,
    /// m/s² or rad/s².
    Acceleration,
}

/// A tolerance that was not kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Violation {
    /// Place of the axis in the machine.
    pub place: usize,
    /// What of it.
    pub quantity: Quantity,
    /// The error, with its sign: asked for less there.
    pub error: f64,
    /// What was allowed.
    pub limit: f64,
}

/// The errors of one axis at the last three position instants, the newest first.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Errors([f64; 3]);

impl Errors {
    /// Takes the next instant in.
    pub fn note(&mut self, sample: &AxisSample) {
        let [newest, before, _] = self.0;
        self.0 = [sample.synchronized_tracking_error(), newest, before];
    }

    /// Of the axis at `place`, the first quantity that is not within `tolerance`; `period` is Tsp, ns.
    pub fn violation(&self, place: usize, tolerance: &Tolerance, period: Nanoseconds) -> Option<Violation> {
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
            (error.abs() > limit).then_some(Violation { place, quantity, error, limit })
        })
    }
}

/// The first violation among the axes at `places`, one tolerance each.
pub(super) fn first_violation(
    places: &[usize],
    tolerances: &[Tolerance],
    errors: &[Errors],
    period: Nanoseconds,
) -> Option<Violation> {
    places
        .iter()
        .zip(tolerances)
        .find_map(|(&place, tolerance)| errors.get(place)?.violation(place, tolerance, period))
}
