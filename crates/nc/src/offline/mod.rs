//! Part programs simulated without a node: their setpoints, and the lines with the largest errors.

mod setpoints;
mod worst_lines;

pub use setpoints::{
    OverrideSchedule, PartProgramOptions, PartProgramSource, ProgramTrack, TrackPoint, parse_m_code,
};
pub use worst_lines::{Cause, CycleError, LineErrors, ProgramFigures, WorstLine};
