//! Result of `virtual_axes identify`.

use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::identify::{Agreement, Identification};

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
    /// Recordings that were used for the identification.
    pub recordings: Vec<ConditionedRecording>,
    /// Result of the identification.
    pub identification: Identification,
    /// Validation results.
    pub validations: Vec<AxisValidation>,
    /// Figures of the output.
    pub summary: IdentificationSummary,
}
