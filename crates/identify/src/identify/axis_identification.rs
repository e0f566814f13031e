//! Complete identification of one axis: recordings, identification, validation, summary.

use std::cmp::Reverse;
use std::io;

use thiserror::Error;
use virtual_axes_core::config::{AxisConfig, ConfigError, ParameterKind, Parameters, Periods};
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::units::MILLISECOND_NS;

use super::experiment::CurrentLogging;
use super::recorded_feedforward::recorded_feedforward;
use super::summary::IdentificationSummary;
use super::validate::validate_with;
use super::{
    Agreement, FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, IdentifiedValue,
    identify_with_transmission, invalid_agreement, update_parameters,
};
use crate::recording::{Conditioning, ConditioningError, Finding, RawRecording, Signals, condition};

/// Error of the identification of an axis.
#[derive(Debug, Error)]
pub enum AxisIdentificationError {
    /// Recording that is not plausible for the axis.
    #[error(transparent)]
    Conditioning(#[from] ConditioningError),
    /// Recordings that determine no parameter.
    #[error("no parameter of {axis} could be identified{findings}")]
    NoResult {
        /// Name of the axis.
        axis: String,
        /// Findings, each on a line of its own after a line feed.
        findings: String,
    },
    /// Invalid parameters of the initial machine.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Error of the interrupt check.
    #[error(transparent)]
    Interrupted(#[from] io::Error),
    /// Validation recording that cannot be compared.
    #[error(transparent)]
    Validation(#[from] MachineError),
}

/// Recording after conditioning, with its active feedforward and findings.
#[derive(Debug)]
pub struct ConditionedRecording {
    /// Conditioned signals.
    pub signals: Signals,
    /// Active feedforward as given or inferred.
    pub feedforward: Option<FeedforwardMode>,
    /// Findings of reading and conditioning.
    pub findings: Vec<Finding>,
}

impl ConditionedRecording {
    /// Conditions the recording `raw` of `axis`, which was read with `findings`; `feedforward` is the active feedforward if
    /// it was given.
    ///
    /// # Errors
    /// [`AxisIdentificationError`] if the recording is not plausible.
    pub fn new(
        (raw, mut findings): (&RawRecording, Vec<Finding>),
        (axis, periods): (&AxisConfig, &Periods),
        conditioning: &Conditioning,
        feedforward: Option<FeedforwardMode>,
    ) -> Result<Self, AxisIdentificationError> {
        let (signals, more) = condition(raw, axis, periods, conditioning)?;
        findings.extend(more);
        Ok(ConditionedRecording { signals, feedforward, findings })
    }

    /// Conditions the recording `raw` of `axis` with both encoders, which was read with `findings`, without its setpoints.
    /// The lag of the current is that of the options, 0 by default.
    ///
    /// # Errors
    /// [`AxisIdentificationError`] if the recording is not plausible.
    pub fn of_both_encoders(
        (raw, mut findings): (RawRecording, Vec<Finding>),
        (axis, periods): (&AxisConfig, &Periods),
        conditioning: &Conditioning,
    ) -> Result<Self, AxisIdentificationError> {
        // An elastic axis lags behind its setpoints in another way than a rigid one.
        let raw = RawRecording { psec: None, velocity_feedforward: None, torque_feedforward: None, ..raw };
        let current_lag = conditioning.current_lag.or(Some(0.0));
        let conditioning = Conditioning { current_lag, ..*conditioning };
        let (signals, more) = condition(&raw, axis, periods, &conditioning)?;
        findings.extend(more);
        Ok(ConditionedRecording { signals, feedforward: None, findings })
    }

    /// Converts the recording to the input of the identification.
    pub fn input(&self) -> IdentificationInput<'_> {
        IdentificationInput { signals: &self.signals, feedforward: self.feedforward }
    }
}

/// Comparison of the identified axis with a validation recording.
#[derive(Debug)]
pub struct AxisValidation {
    /// Validation recording.
    pub recorded: ConditionedRecording,
    /// Deviations between simulation and recording.
    pub agreement: Agreement,
}

impl AxisValidation {
    /// Compares the identified axis with the recording. An unknown feedforward is the one with the
    /// smaller residual; `joint` is the logging of the current after a joint fit.
    fn new(
        mut recorded: ConditionedRecording,
        axis: &AxisConfig,
        periods: &Periods,
        joint: Option<CurrentLogging>,
    ) -> Result<Self, AxisIdentificationError> {
        let has_setpoints = recorded.signals.spans.iter().any(|span| span.psec.is_some());
        if recorded.feedforward.is_none() && has_setpoints {
            let mut best: Option<(f64, FeedforwardMode)> = None;
            for mode in FeedforwardMode::ALL {
                recorded.feedforward = Some(mode);
                let baseline = validate_with(&recorded.input(), (axis, periods), joint)?.baseline;
                let residual = baseline.map_or(f64::INFINITY, |baseline| baseline.model);
                if best.is_none_or(|(least, _)| residual < least) {
                    best = Some((residual, mode));
                }
            }
            recorded.feedforward = best.map(|(_, mode)| mode);
            let what = format!(
                "{}: feedforward {} is assumed: the identified axis deviates least with it",
                recorded.signals.name,
                recorded.feedforward.map_or("none", FeedforwardMode::name)
            );
            recorded.findings.push(Finding::note("feedforward-inferred", what));
        }
        let agreement = validate_with(&recorded.input(), (axis, periods), joint)?;
        Ok(AxisValidation { recorded, agreement })
    }
}

/// Recordings of an axis by their use.
#[derive(Debug, Default)]
pub struct AxisRecordings {
    /// Recordings for the parameters of the rigid axis.
    pub identification: Vec<ConditionedRecording>,
    /// Recordings with both encoders, for the elastic transmission.
    pub transmission: Vec<ConditionedRecording>,
    /// Recordings to compare the identified axis with.
    pub validation: Vec<ConditionedRecording>,
}

/// Identification of an axis with its validation and summary.
#[derive(Debug)]
pub struct AxisIdentification {
    /// Recordings that were used for the identification.
    pub recordings: Vec<ConditionedRecording>,
    /// Result of the identification.
    pub identification: Identification,
    /// Recordings with both encoders.
    pub transmissions: Vec<ConditionedRecording>,
    /// Validation results.
    pub validations: Vec<AxisValidation>,
    /// Figures of the output.
    pub summary: IdentificationSummary,
    /// Parameters of the machine with the identified values; those of the initial machine if they are invalid.
    pub identified: Parameters,
}

impl AxisIdentification {
    /// Identifies the axis `index` of the machine `parameters` and compares it with the recordings for the validation.
    /// `start` is called with the name of each part before it starts.
    ///
    /// # Errors
    /// [`AxisIdentificationError`] if no parameter is determined, or of `start`.
    pub fn new(
        (parameters, index): (&Parameters, usize),
        recordings: AxisRecordings,
        options: &IdentificationOptions,
        start: impl Fn(&str) -> io::Result<()>,
    ) -> Result<Self, AxisIdentificationError> {
        let AxisRecordings { identification: recordings, transmission: transmissions, validation: others } =
            recordings;
        let config = parameters.machine_config()?;
        let (axis, periods) = (&config.axes()[index], config.periods());
        start(&format!("identifying {}", axis.name()))?;
        let inputs: Vec<IdentificationInput<'_>> =
            recordings.iter().map(ConditionedRecording::input).collect();
        let both: Vec<&Signals> = transmissions.iter().map(|recorded| &recorded.signals).collect();
        let identification = identify_with_transmission(&inputs, &both, axis, &periods, options);
        let of_files =
            recordings.iter().chain(&transmissions).chain(&others).flat_map(|recorded| &recorded.findings);
        // The same file can be given twice.
        let mut findings: Vec<Finding> = Vec::new();
        for finding in of_files.chain(&identification.findings) {
            if !findings.contains(finding) {
                findings.push(finding.clone());
            }
        }
        findings.sort_by_key(|finding| Reverse(finding.severity));
        let values = identification.values(parameters, axis.name());
        let is_any = values.iter().any(|value| is_determined(value, parameters, &periods));
        if !is_any && identification.transmission.is_none() {
            let lines = findings.iter().map(|finding| format!("\n{}", finding.line()));
            let axis = axis.name().to_owned();
            return Err(AxisIdentificationError::NoResult { axis, findings: lines.collect() });
        }
        let mut identified = parameters.clone();
        let updated = update_parameters(&mut identified, axis.name(), &values);
        if let Err(error) = updated.and_then(|()| identified.machine_config().map(drop)) {
            // The values are shown, with the reason why they cannot be used.
            let remedy = "check the recordings and the initial machine";
            findings.insert(0, Finding::invalid("rejected", error.to_string(), remedy));
            identified = parameters.clone();
        }
        // Values rounded to the digits of the machine file.
        let updated = identified.machine_config()?;

        start(&format!("validating {}", axis.name()))?;
        let joint = identification.periods.map(|_| identification.current_logging());
        let validations = others.into_iter().map(|mut recorded| {
            // Recordings of one machine usually have the same feedforward.
            let known = identification.active_feedforward.first().copied();
            let is_common = identification.active_feedforward.iter().all(|mode| Some(*mode) == known);
            let own = recorded_feedforward(&recorded.signals);
            recorded.feedforward = recorded.feedforward.or(own).or(known.filter(|_| is_common));
            AxisValidation::new(recorded, &updated.axes()[index], &updated.periods(), joint)
        });
        let validations: Vec<AxisValidation> = validations.collect::<Result<_, AxisIdentificationError>>()?;
        for AxisValidation { recorded, agreement } in &validations {
            let inferred = recorded.findings.iter().filter(|finding| !findings.contains(finding));
            findings.extend(inferred.cloned().collect::<Vec<_>>());
            findings.extend(invalid_agreement(&recorded.signals.name, agreement, &updated.axes()[index]));
        }
        findings.sort_by_key(|finding| Reverse(finding.severity));
        let validated: Vec<(IdentificationInput<'_>, &Agreement)> =
            validations.iter().map(|v| (v.recorded.input(), &v.agreement)).collect();
        let summary = IdentificationSummary::new(
            config.name(),
            (&inputs, &both),
            &identification,
            values,
            &validated,
            findings,
        );
        Ok(AxisIdentification { recordings, identification, transmissions, validations, summary, identified })
    }
}

/// Returns true if the recordings determine a value: false for a delay whose interval is its whole range.
fn is_determined(value: &IdentifiedValue, parameters: &Parameters, periods: &Periods) -> bool {
    let Some([low, high]) = value.interval else { return true };
    // Delays are tried in steps of a position cycle, which may not reach the longest one.
    let step = periods.position as f64 / MILLISECOND_NS as f64;
    match parameters.definition(&value.key).map(|definition| definition.kind) {
        Some(ParameterKind::Number { min, max }) => low > min || high + step <= max,
        _ => true,
    }
}
