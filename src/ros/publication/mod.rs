//! Publication: messages of each frame, feedback of goals, diagnostics, and `/rosout`.

mod diagnostics;
mod fan_out;
mod process_memory;
mod program_feedback;
mod rosout;
mod setpoints;
mod tool;
mod trajectory_feedback;

pub use diagnostics::{Diagnostics, publish_diagnostics};
pub use fan_out::FanOut;
pub use program_feedback::{ProgramFeedbackOutput, RunningProgram};
pub use rosout::{QUEUE as ROSOUT_QUEUE, Rosout};
pub use tool::ToolOutput;
pub use trajectory_feedback::{FeedbackOutput, RunningGoal, feedback_period};
