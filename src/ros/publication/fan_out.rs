//! Publication of each frame on the topics.

use std::sync::Arc;

use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use tokio::sync::mpsc;

use super::program_feedback::ProgramFeedbackOutput;
use super::setpoints::{SetpointVelocities, controller_state};
use super::tool::ToolOutput;
use super::trajectory_feedback::FeedbackOutput;
use crate::ros::axes::SampleFrame;
use crate::ros::topics::Output;
use virtual_axes_io::messages::{DriveStates, JointTrajectoryControllerState, MotorCurrents, Sampled, stamp};

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
    pub clock: Option<Output<Clock>>,
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
                clock.send(Clock { clock: stamp(frame.time) }).await;
            }
            if !frame.is_published {
                continue;
            }
            let is_due = frame.instant % self.every == 0;
            if let Some(tool) = &self.tool {
                tool.update(&frame, is_due).await;
            }
            if is_due {
                let (time, samples, joints) = (frame.time, &frame.samples, &self.joints);
                self.joint_states.send_if_used(|| JointState::of(time, samples, joints)).await;
                self.motor_currents.send_if_used(|| MotorCurrents::of(time, samples, joints)).await;
                self.drive_states.send_if_used(|| DriveStates::of(time, samples, joints)).await;
                self.controller_state.send_if_used(|| controller_state(&frame, velocities, joints)).await;
            }
            self.feedback.publish(&frame, velocities).await;
            self.program.publish(&frame).await;
        }
    }
}
