//! Publication of each frame on the topics, and of the diagnostics.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use tokio::sync::{mpsc, watch};
use tracing::warn;

use super::action::FeedbackOutput;
use super::axes_interface::SampleFrame;
use super::clock::ClockOutput;
use super::convert;
use super::diagnostics::Diagnostics;
use super::health::Health;
use super::outputs::Output;
use super::program::ProgramFeedbackOutput;
use super::recorder::RecordingStatus;
use super::setpoints::{SetpointVelocities, controller_state};
use super::tool::ToolOutput;
use virtual_axes_io::messages::{DriveStates, JointTrajectoryControllerState, MotorCurrents};

/// Period of `/diagnostics` (REP-107).
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

/// Outputs of the frames.
pub struct FanOut {
    /// Output `joint_states`.
    pub joint_states: Output<JointState>,
    /// Output `~/motor_currents`.
    pub motor_currents: Output<MotorCurrents>,
    /// Output `~/drive_states`.
    pub drive_states: Output<DriveStates>,
    /// Output `~/controller_state`.
    pub controller_state: Output<JointTrajectoryControllerState>,
    /// Feedback of the action.
    pub feedback: FeedbackOutput,
    /// Feedback of the part program.
    pub program: ProgramFeedbackOutput,
    /// Pose and paths of the tool, if the machine has joints that move it.
    pub tool: Option<ToolOutput>,
    /// Output `/clock`, in `fast`.
    pub clock: Option<ClockOutput>,
    /// Names of the joints, with prefix.
    pub joints: Vec<String>,
    /// Number of position cycles between publications.
    pub every: i64,
}

impl FanOut {
    /// Publishes the frames until their sender is dropped.
    pub async fn run(self, mut frames: mpsc::Receiver<Arc<SampleFrame>>) {
        let mut setpoints = SetpointVelocities::default();
        while let Some(frame) = frames.recv().await {
            let velocities = setpoints.update(&frame);
            if let Some(clock) = &self.clock {
                clock.send(frame.time).await;
            }
            if !frame.is_published {
                continue;
            }
            let is_due = frame.instant % self.every == 0;
            if let Some(tool) = &self.tool {
                tool.update(&frame, is_due).await;
            }
            if is_due {
                if self.joint_states.has_subscriptions() {
                    self.joint_states.send(convert::joint_state(&frame, &self.joints)).await;
                }
                if self.motor_currents.has_subscriptions() {
                    self.motor_currents.send(convert::motor_currents(&frame, &self.joints)).await;
                }
                if self.drive_states.has_subscriptions() {
                    self.drive_states.send(convert::drive_states(&frame, &self.joints)).await;
                }
                if self.controller_state.has_subscriptions() {
                    self.controller_state.send(controller_state(&frame, velocities, &self.joints)).await;
                }
            }
            self.feedback.publish(&frame, velocities).await;
            self.program.publish(&frame).await;
        }
    }
}

/// Publishes the diagnostics once per second, with the events since the previous message, and logs axes that leave
/// their travel limits.
pub async fn publish_diagnostics(
    text: Diagnostics,
    output: Output<DiagnosticArray>,
    health: watch::Receiver<Health>,
    dropped: Arc<AtomicU64>,
    mut recording: Option<RecordingStatus>,
) {
    let mut timer = tokio::time::interval(DIAGNOSTICS_PERIOD);
    let (mut before, mut dropped_before) = (Health::default(), 0);
    let mut outside: Vec<&str> = Vec::new();
    loop {
        timer.tick().await;
        let now = health.borrow().clone();
        let dropped_now = dropped.load(Ordering::Relaxed);
        let mut message = text.message(now.time, &before, &now, (dropped_before, dropped_now));
        message.status.extend(recording.as_mut().map(|status| status.message(&text.node, &text.machine)));
        output.send(message).await;
        let left = text.outside_travel_limits(&before, &now);
        left.iter()
            .filter(|joint| !outside.contains(joint))
            .for_each(|joint| warn!("{joint} has left its travel limits"));
        outside = left;
        (before, dropped_before) = (now, dropped_now);
    }
}
