//! Arguments that several commands share.

pub mod axis;
pub mod log_arguments;
pub mod output_arguments;
pub mod trial_arguments;
pub mod variant;
