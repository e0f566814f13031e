//! How goals fare, at a rate of the node's clock.

use std::sync::Arc;

use tokio::sync::watch;

use super::{GoalId, uuid};
use crate::ros::outputs::Output;
use crate::ros::pace::Frame;
use crate::ros::setpoints::Comparison;
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::messages::{FeedbackMessage, FollowJointTrajectoryFeedback, duration, header};

/// A goal that the axes follow or will follow.
#[derive(Debug, Clone)]
pub struct Running {
    /// Which one.
    pub id: GoalId,
    /// Its motion.
    pub motion: MotionId,
    /// Its joints, in its order, as places in the machine.
    pub places: Vec<usize>,
}

/// Position instants from one feedback to the next at `rate` Hz; `period` is Tsp, ns.
pub fn feedback_period(rate: f64, period: Nanoseconds) -> i64 {
    ((1.0 / (rate * seconds(period))).round() as i64).max(1)
}

/// Publishes the feedback of the goals that run.
pub struct Feedback {
    /// Those goals, and some that are over.
    pub goals: watch::Receiver<Arc<[Running]>>,
    /// `_action/feedback`.
    pub output: Output<FeedbackMessage>,
    /// Joints of the machine, with prefix.
    pub joints: Vec<String>,
    /// Position instants from one message of a goal to the next.
    pub every: i64,
}

impl Feedback {
    /// Publishes what is due at a frame; `velocities` are those of the setpoints, one per axis.
    pub async fn frame(&self, frame: &Frame, velocities: &[f64]) {
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
    goal: &Running,
    start: Nanoseconds,
    frame: &Frame,
    velocities: &[f64],
    joints: &[String],
) -> FeedbackMessage {
    let mut compared = Comparison::of(frame, velocities, goal.places.iter().copied());
    let elapsed = duration(frame.time - start);
    for point in [&mut compared.desired, &mut compared.actual, &mut compared.error] {
        point.time_from_start = elapsed.clone();
    }
    FeedbackMessage {
        goal_id: uuid(goal.id),
        feedback: FollowJointTrajectoryFeedback {
            header: header(frame.time),
            joint_names: goal.places.iter().filter_map(|&place| joints.get(place).cloned()).collect(),
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
    fn feedback_comes_at_the_nearest_whole_number_of_periods_and_at_most_once_in_one() {
        let tsp = 6 * MILLISECOND_NS;
        assert_eq!(feedback_period(20.0, tsp), 8);
        assert_eq!(feedback_period(1e6, tsp), 1);
    }
}
