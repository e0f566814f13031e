//! Feedback of the active goals, at a rate in the time of the node's clock.

use std::sync::Arc;

use tokio::sync::watch;

use super::setpoints::JointComparison;
use crate::ros::axes::SampleFrame;
use crate::ros::topics::Output;
use crate::validation::GoalId;
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::messages::unique_identifier_msgs::msg::UUID;
use virtual_axes_io::messages::{FeedbackMessage, FollowJointTrajectoryFeedback, duration, header};

/// Goal whose motion is active or waiting.
#[derive(Debug, Clone)]
pub struct RunningGoal {
    /// Identifier of the goal.
    pub id: GoalId,
    /// Identifier of its motion.
    pub motion: MotionId,
    /// Indices of its joints in the machine, in the order of the goal.
    pub indices: Vec<usize>,
}

/// Returns the number of position cycles between feedback messages at `rate`, Hz, at least 1; `period` is Tsp, ns.
pub fn feedback_period(rate: f64, period: Nanoseconds) -> i64 {
    ((1.0 / (rate * seconds(period))).round() as i64).max(1)
}

/// Output of the feedback of the active goals.
pub struct FeedbackOutput {
    /// Active goals, and some that have ended.
    pub goals: watch::Receiver<Arc<[RunningGoal]>>,
    /// Output `_action/feedback`.
    pub output: Output<FeedbackMessage>,
    /// Names of the joints of the machine, with prefix.
    pub joints: Vec<String>,
    /// Number of position cycles between messages.
    pub every: i64,
}

impl FeedbackOutput {
    /// Publishes the feedback that is due at a frame; `velocities` are the setpoint velocities of all axes, m/s or
    /// rad/s.
    pub async fn publish(&self, frame: &SampleFrame, velocities: &[f64]) {
        if frame.instant % self.every != 0 {
            return;
        }
        let goals = Arc::clone(&self.goals.borrow());
        for &(motion, start) in frame.motions.iter().filter(|(_, start)| *start <= frame.time) {
            if let Some(goal) = goals.iter().find(|goal| goal.motion == motion) {
                self.output.send(message(goal, start, frame, velocities, &self.joints)).await;
            }
        }
    }
}

fn message(
    goal: &RunningGoal,
    start: Nanoseconds,
    frame: &SampleFrame,
    velocities: &[f64],
    joints: &[String],
) -> FeedbackMessage {
    let mut compared = JointComparison::new(frame, velocities, goal.indices.iter().copied());
    let elapsed = duration(frame.time - start);
    for point in [&mut compared.desired, &mut compared.actual, &mut compared.error] {
        point.time_from_start = elapsed.clone();
    }
    FeedbackMessage {
        goal_id: UUID { uuid: goal.id },
        feedback: FollowJointTrajectoryFeedback {
            header: header(frame.time),
            joint_names: goal.indices.iter().filter_map(|&index| joints.get(index).cloned()).collect(),
            desired: compared.desired,
            actual: compared.actual,
            error: compared.error,
            ..FollowJointTrajectoryFeedback::default()
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::units::MILLISECOND_NS;

    #[test]
    fn feedback_period_is_rounded_and_at_least_one_cycle() {
        let tsp = 6 * MILLISECOND_NS;
        assert_eq!(feedback_period(20.0, tsp), 8);
        assert_eq!(feedback_period(1e6, tsp), 1);
    }
}
