//! Serializable summary of an identification, for JSON, text and pages.
//!
//! Values have the units of their keys. `position_unit`, `velocity_unit` and `speed_unit` are the units of the
//! quantities that depend on the kind of the axis.

mod steps;
mod transmission;

use serde::Serialize;

use super::feedforward::FeedforwardFit;
use super::feedforward_mode::FeedforwardMode;
use super::identification::Identification;
use super::options::IdentificationInput;
use super::segments::SegmentKind;
use super::validate::{Agreement, ExperimentComparison, ResidualStatistics};
use super::values::IdentifiedValue;
use crate::recording::{Finding, Signals};
pub use steps::{
    Change, DelaySummary, DirectionsSummary, Estimate, FrictionSummary, GravitySummary, InertiaSummary,
    LawCoefficients, LawSummary, LevelSummary, LineSummary, PreslidingSummary, RefinementSummary,
    RestSummary, SpeedSummary,
};
pub use transmission::{IntervalSummary, TransmissionSummary};
use virtual_axes_core::config::{AxisKind, AxisUnits};
use virtual_axes_core::units::MILLISECOND;

/// Summary of an identification: recordings, values, results of the steps, agreement and findings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IdentificationSummary {
    /// Name of the initial machine.
    pub machine: String,
    /// Name of the axis.
    pub axis: String,
    /// Kind of the axis.
    #[serde(skip)]
    pub kind: AxisKind,
    /// Unit of position residuals.
    pub position_unit: &'static str,
    /// Unit of velocity residuals.
    pub velocity_unit: &'static str,
    /// Unit of speeds in the friction law.
    pub speed_unit: &'static str,
    /// Recordings that were used for the identification.
    pub recordings: Vec<RecordingSummary>,
    /// Identified parameters of the machine file.
    pub values: Vec<IdentifiedValue>,
    /// Friction law and friction currents.
    pub friction: Option<FrictionSummary>,
    /// Inertia by Prévost eq. 5 and by the refinement.
    pub inertia: Option<InertiaSummary>,
    /// Presliding; none if it was not identified.
    pub presliding: Option<PreslidingSummary>,
    /// Elastic transmission; none without recordings of both encoders.
    pub transmission: Option<TransmissionSummary>,
    /// Recordings with both encoders.
    pub transmission_recordings: Vec<RecordingSummary>,
    /// Gravity.
    pub gravity: Option<GravitySummary>,
    /// Regressions of the feedforward weights.
    pub feedforward: FeedforwardFit,
    /// Delays α, β, γ.
    pub delays: Vec<DelaySummary>,
    /// Closed-loop refinement.
    pub refinement: Option<RefinementSummary>,
    /// Agreement of the identified axis with each recording.
    pub agreement: Vec<AgreementSummary>,
    /// Agreement of the identified axis with each validation recording.
    pub validation: Vec<ValidationSummary>,
    /// Findings of reading, identification and validation.
    pub findings: Vec<Finding>,
}

impl IdentificationSummary {
    /// Summarizes an identification.
    ///
    /// `recordings` are the inputs of the identification, those for the rigid axis and those with both encoders, `values` its [values](Identification::values),
    /// `validations` the other recordings with their agreement, `findings` all findings in the order of output.
    pub fn new(
        machine: &str,
        (recordings, both_encoders): (&[IdentificationInput<'_>], &[&Signals]),
        identification: &Identification,
        values: Vec<IdentifiedValue>,
        validations: &[(IdentificationInput<'_>, &Agreement)],
        findings: Vec<Finding>,
    ) -> Self {
        let (axis, found) = (&identification.initial, identification);
        let kind = axis.kind();
        let AxisUnits {
            error: position,
            length: velocity,
            error_key: position_unit,
            speed_name: speed_unit,
            ..
        } = axis.units();
        let residuals = |agreement| ResidualSummary::new(agreement, position, velocity);
        let all = found.agreements.iter().map(Some).chain(std::iter::repeat(None));
        IdentificationSummary {
            machine: machine.to_owned(),
            axis: axis.name().to_owned(),
            kind,
            position_unit,
            velocity_unit: if kind == AxisKind::Linear { "mm/s" } else { "deg/s" },
            speed_unit,
            recordings: recordings
                .iter()
                .zip(all)
                .map(|(input, a)| RecordingSummary::new(input, a))
                .collect(),
            values,
            friction: found
                .friction
                .as_ref()
                .map(|friction| FrictionSummary::new(friction, &found.steady.levels, axis.units().speed)),
            inertia: InertiaSummary::new(found),
            presliding: found.presliding.as_ref().map(|fit| PreslidingSummary::new(fit, kind)),
            transmission: found.transmission.as_ref().map(|fit| TransmissionSummary::new(fit, kind)),
            transmission_recordings: both_encoders
                .iter()
                .map(|signals| {
                    RecordingSummary::new(&IdentificationInput { signals, feedforward: None }, None)
                })
                .collect(),
            gravity: found.gravity.as_ref().map(GravitySummary::new),
            feedforward: found.feedforward.clone(),
            delays: found.delays.iter().map(|fit| DelaySummary::new(fit, position)).collect(),
            refinement: found.refinement.as_ref().map(|r| RefinementSummary::new(r, position)),
            agreement: recordings
                .iter()
                .zip(&found.agreements)
                .map(|(input, agreement)| AgreementSummary {
                    name: input.signals.name.clone(),
                    residuals: residuals(agreement),
                })
                .collect(),
            validation: validations
                .iter()
                .map(|(input, agreement)| ValidationSummary {
                    recording: RecordingSummary::new(input, Some(agreement)),
                    residuals: residuals(agreement),
                })
                .collect(),
            findings,
        }
    }
}

/// Properties of a conditioned recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingSummary {
    /// Name, usually the file name.
    pub name: String,
    /// Duration from the first to the last sample, s.
    pub duration_s: f64,
    /// Number of samples.
    pub samples: usize,
    /// Number of sections between gaps.
    pub spans: usize,
    /// Sampling period, ms.
    pub period_ms: f64,
    /// Cut-off frequency of the filter, Hz.
    pub cutoff_hz: f64,
    /// Compensated lag of the recorded current, ms.
    pub current_lag_ms: f64,
    /// Active feedforward of each part, without repetitions; empty if it was not determined.
    pub feedforward: Vec<FeedforwardMode>,
    /// Durations of standstill, constant velocity and acceleration, s.
    #[serde(skip)]
    pub segments_s: [f64; 3],
}

impl RecordingSummary {
    fn new(input: &IdentificationInput<'_>, agreement: Option<&Agreement>) -> Self {
        let signals = input.signals;
        let (spans, period) = (&signals.spans, signals.period);
        let end = spans.last().map(|s| s.start + s.position.len().saturating_sub(1) as f64 * period);
        let experiments = agreement.iter().flat_map(|agreement| &agreement.experiments);
        let mut feedforward: Vec<FeedforwardMode> = experiments.map(|experiment| experiment.mode).collect();
        if feedforward.is_empty() && agreement.is_some() {
            feedforward.extend(input.feedforward);
        }
        feedforward.dedup();
        let duration = |kind: SegmentKind| {
            let segments = agreement.iter().flat_map(|agreement| &agreement.segments);
            let count: usize = segments.filter(|s| s.kind == kind).map(|s| s.samples.len()).sum();
            count as f64 * period
        };
        RecordingSummary {
            name: signals.name.clone(),
            duration_s: spans.first().zip(end).map_or(0.0, |(first, end)| end - first.start),
            samples: spans.iter().map(|span| span.position.len()).sum(),
            spans: spans.len(),
            period_ms: period / MILLISECOND,
            cutoff_hz: signals.cutoff,
            current_lag_ms: signals.current_lag / MILLISECOND,
            feedforward,
            segments_s: [SegmentKind::Static, SegmentKind::ConstantVelocity, SegmentKind::Accelerating]
                .map(duration),
        }
    }

    /// Returns the names of the active feedforward modes, separated by commas; a dash without modes.
    pub fn feedforward_names(&self) -> String {
        let names: Vec<&str> = self.feedforward.iter().map(|mode| mode.name()).collect();
        if names.is_empty() { "–".to_owned() } else { names.join(", ") }
    }
}

/// Agreement of the identified axis with a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgreementSummary {
    /// Name of the recording.
    pub name: String,
    /// Residuals.
    #[serde(flatten)]
    pub residuals: ResidualSummary,
}

/// Agreement of the identified axis with a validation recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ValidationSummary {
    /// Properties of the recording.
    #[serde(flatten)]
    pub recording: RecordingSummary,
    /// Residuals.
    #[serde(flatten)]
    pub residuals: ResidualSummary,
}

/// Residuals of the simulations and of inverse dynamics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualSummary {
    /// Residuals of each simulated part of the recording.
    pub parts: Vec<PartSummary>,
    /// Residuals by inverse dynamics; none without current.
    pub inverse_dynamics: Option<InverseSummary>,
    /// RMS differences of simple predictions and of the model; none without simulation.
    pub baseline: Option<BaselineSummary>,
}

/// RMS and largest differences of the position from simple predictions and from the model, in the unit of position residuals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BaselineSummary {
    /// From PSEC.
    pub command: f64,
    /// Best constant lag, ms.
    pub lag_ms: f64,
    /// From PSEC delayed by this lag.
    pub delayed: f64,
    /// From the model.
    pub model: f64,
    /// Largest difference from the delayed PSEC.
    pub delayed_max: f64,
    /// Largest difference from the model.
    pub model_max: f64,
}

impl ResidualSummary {
    fn new(agreement: &Agreement, position: f64, velocity: f64) -> Self {
        let scaled = |found: Option<ResidualStatistics>, unit: f64| {
            found.map(|r| ResidualStatistics { max: r.max / unit, rms: r.rms / unit })
        };
        let part = |(feedforward, comparison): (FeedforwardMode, &ExperimentComparison)| PartSummary {
            feedforward,
            constant_velocity: scaled(comparison.constant_velocity, position),
            elsewhere: scaled(comparison.elsewhere, position),
            velocity: scaled(comparison.velocity, velocity),
            current_a: comparison.current,
            current_r_squared: comparison.current_r_squared,
        };
        let modes = agreement.experiments.iter().map(|experiment| experiment.mode);
        ResidualSummary {
            parts: modes.zip(&agreement.comparisons).map(part).collect(),
            inverse_dynamics: agreement.inverse.as_ref().map(|inverse| InverseSummary {
                current_a: inverse.current,
                current_r_squared: inverse.r_squared,
            }),
            baseline: agreement.baseline.map(|baseline| BaselineSummary {
                command: baseline.command / position,
                lag_ms: baseline.lag / MILLISECOND,
                delayed: baseline.delayed / position,
                model: baseline.model / position,
                delayed_max: baseline.delayed_max / position,
                model_max: baseline.model_max / position,
            }),
        }
    }
}

/// Residuals of a closed-loop simulation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartSummary {
    /// Active feedforward.
    pub feedforward: FeedforwardMode,
    /// Position residual at constant velocity.
    pub constant_velocity: Option<ResidualStatistics>,
    /// Position residual elsewhere.
    pub elsewhere: Option<ResidualStatistics>,
    /// Velocity residual.
    pub velocity: Option<ResidualStatistics>,
    /// Current residual, A.
    pub current_a: Option<ResidualStatistics>,
    /// R² of the unfiltered current.
    pub current_r_squared: Option<f64>,
}

/// Residuals of the current by inverse dynamics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InverseSummary {
    /// Current residual, A.
    pub current_a: ResidualStatistics,
    /// R² of the unfiltered current.
    pub current_r_squared: f64,
}
