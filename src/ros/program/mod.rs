//! Action `~/run_program`: a part program is interpreted and planned in a thread of its own while it runs, and its motion
//! is appended to the timeline in chunks.

mod feedback;
mod figures;
mod goals;
mod planning;
mod source;

pub use feedback::{ProgramFeedbackOutput, RunningProgram};
pub use figures::{ProgramMonitor, ProgramRunFigures};
pub use goals::{ProgramGoalEvent, ProgramGoals};
