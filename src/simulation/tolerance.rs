//! How far a motion may stray, as `control_msgs/FollowJointTrajectory` asks for it.

use crate::units::Nanoseconds;

/// Largest error of a joint that is allowed; none is any.
///
/// Errors are against the set-points as they reach the position controller, so that the pure delay is
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
