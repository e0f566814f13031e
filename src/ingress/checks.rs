//! The checks of trajectories that need no state of the axes.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::parameters::LiveNodeParameters;
use virtual_axes_core::trajectory::{Context, JointLimits, Rejection, Trajectory};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages;
use virtual_axes_io::messages::trajectory_msgs::msg::JointTrajectory;

/// The checks of a trajectory that need no state of the axes.
pub struct Checks {
    /// Joints that trajectories may name, with their limits.
    pub joints: Vec<JointLimits>,
    /// Tsp, ns.
    pub period: Nanoseconds,
    /// Largest number of points.
    pub max_points: usize,
    /// Parameters of the node that can be set.
    pub live: Arc<LiveNodeParameters>,
}

impl Checks {
    /// A message as a trajectory that can be offered to the axes.
    ///
    /// # Errors
    /// The first fault found.
    pub fn check(&self, message: &JointTrajectory) -> Result<Trajectory, Rejection> {
        let request = messages::request(message, self.max_points)?;
        let context = Context {
            joints: &self.joints,
            period: self.period,
            max_points: self.max_points,
            allow_nonzero_end_velocity: self.live.allow_nonzero_end_velocity.load(Ordering::Relaxed),
        };
        Trajectory::new(request, &context)
    }
}
