//! Execution of the requests `~/stop`, `~/reset`, `~/feed_hold` and `~/cycle_start`.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};

use crate::ros::axes::Command;
use virtual_axes_core::trajectory::{
    JointLimits, MotionId, Start, Trajectory, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::Nanoseconds;

/// Returns the error message of a request that arrives during the shutdown.
fn shutting_down<E>(_: E) -> String {
    "the node is shutting down".to_owned()
}

/// Executes the request `~/stop`.
pub(super) async fn stop_axes(
    commands: mpsc::Sender<Command>,
    id: MotionId,
    stop: Option<Arc<Trajectory>>,
) -> Result<String, String> {
    let trajectory = stop.ok_or("this machine has no joint to stop")?;
    commands.send(Command::Stop(id, trajectory)).await.map_err(shutting_down)?;
    Ok("stopping every axis within its limits".to_owned())
}

/// Executes the request `~/reset`.
pub(super) async fn reset_axes(commands: mpsc::Sender<Command>) -> Result<String, String> {
    let (done, is_done) = oneshot::channel();
    commands.send(Command::Reset(done)).await.map_err(shutting_down)?;
    is_done.await.map_err(shutting_down)?;
    Ok("at rest at home".to_owned())
}

/// Executes the requests `~/feed_hold` and `~/cycle_start`.
pub(super) async fn set_feed_hold(commands: mpsc::Sender<Command>, is_held: bool) -> Result<String, String> {
    commands.send(Command::SetFeedHold(is_held)).await.map_err(shutting_down)?;
    let message =
        if is_held { "feed hold: trajectories stop on their path" } else { "trajectories continue" };
    Ok(message.to_owned())
}

/// Creates the controlled stop of every joint; `None` if the machine has no joint.
pub(super) fn stop_of_all_joints(
    joints: &[JointLimits],
    period: Nanoseconds,
    max_points: usize,
) -> Option<Arc<Trajectory>> {
    let context = ValidationContext { joints, period, max_points, allow_nonzero_end_velocity: false };
    Trajectory::new(TrajectoryRequest::new(Start::Now, Vec::new()), &context).ok().map(Arc::new)
}
