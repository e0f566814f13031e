//! Arguments that several commands share.

pub mod axis;
pub mod output_arguments;
pub mod trial_arguments;
pub mod variant;
