//! Part programs simulated without a node: their setpoints, and the lines with the largest errors.

mod corners;
mod extent;
mod operations;
mod setpoints;
mod survey;
mod worst_lines;

pub use corners::BoundedCorners;
pub use operations::{
    LineEnergy, OperationFigures, OperationMeter, OperationSummary, ProgramEnergy, ProgramTimes, ToolFigures,
};
pub use setpoints::{OverrideSchedule, PartProgramOptions, PartProgramSource, ProgramTrack};
pub use survey::ProgramSurvey;
pub use worst_lines::{
    Cause, CycleError, LineErrors, ProgramFigures, ProgrammedErrors, WorstLine, line_texts,
};
