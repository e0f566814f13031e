//! Result of `virtual_axes identify`.

use virtual_axes_core::config::AxisConfig;
use virtual_axes_identify::identify::{Agreement, Identification, IdentifiedValue};
use virtual_axes_identify::recording::Finding;

use crate::recordings::ConditionedRecording;

/// Comparison of the identified axis with a validation recording.
#[derive(Debug)]
pub struct AxisValidation {
    /// Validation recording.
    pub recorded: ConditionedRecording,
    /// Deviations between simulation and recording.
    pub agreement: Agreement,
}

/// Result of the command.
#[derive(Debug)]
pub struct IdentificationResult {
    /// Machine name.
    pub machine: String,
    /// Initial axis.
    pub axis: AxisConfig,
    /// Recordings that were used for the identification.
    pub recordings: Vec<ConditionedRecording>,
    /// Result of the identification.
    pub identification: Identification,
    /// Identified parameters of the machine file.
    pub values: Vec<IdentifiedValue>,
    /// Validation results.
    pub validations: Vec<AxisValidation>,
    /// Findings of reading, identification and validation, sorted by decreasing severity.
    pub findings: Vec<Finding>,
}
