//! Points and feeds of a program that can be changed, and the text with changed ones.

mod changed_program;
mod line_start;
mod program_model;

pub(super) use changed_program::ChangedProgram;
pub(super) use program_model::{Changes, ExtraPoints, ProgramModel};
