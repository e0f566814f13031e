//! Feedback of the active part program, at a rate in the time of the node's clock.

use std::sync::Arc;

use tokio::sync::watch;

use crate::ros::axes::SampleFrame;
use crate::ros::topics::Output;
use crate::validation::GoalId;
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_io::messages::unique_identifier_msgs::msg::UUID;
use virtual_axes_io::messages::{FeedbackMessage, RunProgramFeedback, header};

/// Goal whose program is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunningProgram {
    /// Identifier of the goal.
    pub id: GoalId,
    /// Identifier of its motion.
    pub motion: MotionId,
}

/// Output of the feedback of the active part program.
pub struct ProgramFeedbackOutput {
    /// Newest goals, including some that have ended.
    pub programs: watch::Receiver<Arc<[RunningProgram]>>,
    /// Output `_action/feedback`.
    pub output: Output<FeedbackMessage<RunProgramFeedback>>,
    /// Names of the joints of the machine, with prefix.
    pub joints: Vec<String>,
    /// Number of position cycles between messages.
    pub every: i64,
}

impl ProgramFeedbackOutput {
    /// Publishes the feedback that is due at a frame.
    pub async fn publish(&self, frame: &SampleFrame) {
        let Some(program) = frame.program.filter(|_| frame.instant % self.every == 0) else { return };
        let goals = Arc::clone(&self.programs.borrow());
        let Some(goal) = goals.iter().find(|goal| goal.motion == program.motion) else { return };
        let errors = frame.samples.iter().map(|sample| sample.delay_compensated_following_error());
        let feedback = RunProgramFeedback {
            header: header(frame.time),
            line: u32::try_from(program.place.line).unwrap_or(u32::MAX),
            path_position: program.place.path_position,
            feed: program.place.path_rate,
            programmed_feed: program.place.programmed_feed,
            feed_override: frame.feed_rate,
            contour_error: program.contour_error,
            name: self.joints.clone(),
            synchronized_tracking_error: errors.collect(),
        };
        self.output.send(FeedbackMessage { goal_id: UUID { uuid: goal.id }, feedback }).await;
    }
}
