//! Validation of `JointTrajectory` messages that does not depend on the state of the axes.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::parameters::LiveNodeParameters;
use virtual_axes_core::trajectory::{JointLimits, Rejection, Trajectory, ValidationContext};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages;
use virtual_axes_io::messages::trajectory_msgs::msg::JointTrajectory;

/// Validator of `JointTrajectory` messages, independent of the state of the axes.
pub struct TrajectoryValidator {
    /// Limits of the joints, in the order of the machine.
    pub joints: Vec<JointLimits>,
    /// Position cycle Tsp, ns.
    pub period: Nanoseconds,
    /// Largest number of points of one trajectory.
    pub max_points: usize,
    /// True if trajectories are interpolated between their points.
    pub interpolates: bool,
    /// Node parameters that can be set at run time.
    pub live: Arc<LiveNodeParameters>,
}

impl TrajectoryValidator {
    /// Validates a message and returns the trajectory to be submitted.
    ///
    /// # Errors
    /// [`Rejection`] for the first violation found: NaN, wrong sizes, unknown joints, times, travel limits,
    /// speed; see [`Trajectory::new`].
    pub fn validate(&self, message: &JointTrajectory) -> Result<Trajectory, Rejection> {
        let mut request = messages::request(message, self.max_points)?;
        if !self.interpolates {
            request = request.without_interpolation();
        }
        let context = ValidationContext {
            joints: &self.joints,
            period: self.period,
            max_points: self.max_points,
            allow_nonzero_end_velocity: self.live.allow_nonzero_end_velocity.load(Ordering::Relaxed),
        };
        Trajectory::new(request, &context)
    }
}
