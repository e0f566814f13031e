//! Serializable summary of an identification, for JSON, text and pages.
//!
//! Values have the units of their keys. `position_unit`, `velocity_unit` and `speed_unit` are the units of the
//! quantities that depend on the kind of the axis.

use serde::{Serialize, Serializer};

use super::delays::{DelayFit, DelayParameter};
use super::feedforward::FeedforwardRegression;
use super::feedforward_mode::FeedforwardMode;
use super::friction::{FrictionFit, FrictionLaw, LawFit, speed_unit, speed_unit_name};
use super::gravity::{GravityCurrent, GravityFit, GravitySource, SAME_SPEED, SteadyCurrent};
use super::identification::Identification;
use super::options::IdentificationInput;
use super::refine::{RefinedParameter, RefinedValue, Refinement};
use super::segments::SegmentKind;
use super::validate::{Agreement, ExperimentComparison, ResidualStatistics};
use super::values::IdentifiedValue;
use crate::recording::Finding;
use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, MILLIMETER, MILLISECOND, MILLISECOND_NS, Nanoseconds};

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
    /// Gravity.
    pub gravity: Option<GravitySummary>,
    /// Regressions of the feedforward weights.
    pub feedforward: FeedforwardSummary,
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

/// Value with standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard error.
    pub error: f64,
}

/// Value before and after the refinement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Value before the refinement.
    pub before: f64,
    /// Value after the refinement.
    pub after: f64,
}

/// Coefficients of Prévost eq. 3, or their standard errors; a and c in A, b and d in min/m or min/rev.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LawCoefficients {
    /// Coefficient a.
    pub a: f64,
    /// Exponent b.
    pub b: f64,
    /// Coefficient c.
    pub c: f64,
    /// Exponent d.
    pub d: f64,
}

/// Linear friction law.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineSummary {
    /// Coulomb level, A.
    pub level_a: f64,
    /// Viscous slope, A per unit of speed.
    pub slope_a: f64,
}

/// Fitted friction law.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LawSummary {
    /// Form of the law.
    pub law: FrictionLaw,
    /// Coefficients a, b, c, d.
    #[serde(flatten)]
    pub coefficients: LawCoefficients,
    /// Breakaway current, A.
    pub i0: f64,
    /// Standard errors of a, b, c, d; NaN for a linear law.
    pub standard_errors: LawCoefficients,
    /// Level and slope of a linear law.
    pub line: Option<LineSummary>,
    /// Coefficient of determination R².
    pub r_squared: f64,
}

/// Friction of the axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrictionSummary {
    /// Law for both directions.
    #[serde(flatten)]
    pub law: LawSummary,
    /// Speeds with their friction currents in both directions; serialized as their number.
    #[serde(serialize_with = "serialize_count")]
    pub speeds: Vec<SpeedSummary>,
    /// Mean currents at each velocity.
    pub levels: Vec<LevelSummary>,
    /// Largest difference between the directions relative to their mean; NaN with one direction only.
    pub asymmetry: f64,
    /// Laws of the directions.
    pub directions: DirectionsSummary,
}

/// Friction currents at one speed.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedSummary {
    /// Mean speed of the directions.
    pub speed: f64,
    /// Mean currents in positive and in negative direction.
    pub directions: [Option<SteadyCurrent>; 2],
    /// Friction current of the law, A.
    pub law: f64,
}

/// Mean current at one velocity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelSummary {
    /// Speed with the sign of the direction.
    pub speed: f64,
    /// Friction part of the current, A.
    pub friction_a: f64,
    /// Mean current, A.
    pub current_a: f64,
    /// Standard error of both currents, A.
    pub error_a: f64,
    /// Duration of the motion, s.
    pub duration_s: f64,
}

/// Friction laws of the directions; none without enough speeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DirectionsSummary {
    /// Positive direction.
    pub plus: Option<LawSummary>,
    /// Negative direction.
    pub minus: Option<LawSummary>,
}

/// Inertia, kg·m² (kg for a linear motor).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InertiaSummary {
    /// Inertia by Prévost eq. 5.
    pub eq5: f64,
    /// Standard error of `eq5`.
    pub error: f64,
    /// Robust standard deviation of single samples.
    pub spread: f64,
    /// Number of accelerations.
    pub accelerations: usize,
    /// Number of samples.
    pub instants: usize,
    /// Inertia by eq. 5 on the simulated axis.
    pub simulated_eq5: Option<f64>,
    /// Inertia by the refinement.
    pub refined: Option<f64>,
    /// Standard error of `refined`.
    pub refined_error: Option<f64>,
}

/// Gravity with standard errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GravitySummary {
    /// Source: motion or standstills.
    pub source: GravitySource,
    /// Fitted gravity current before the significance test.
    pub current: GravityCurrent,
    /// Standard errors of `current`.
    pub error: GravityCurrent,
    /// Gravity current of the model; zero if it is not significant.
    pub model: GravityCurrent,
    /// Weight W, N (linear axes).
    pub weight_n: Option<Estimate>,
    /// Tilting torque k, N·m (rotary axes).
    pub tilt_nm: Option<Estimate>,
    /// Phase φ, ° (rotary axes with significant k).
    pub tilt_phase_deg: Option<Estimate>,
    /// Gravity from standstills alone, if the source is motion.
    pub at_rest: Option<RestSummary>,
}

/// Gravity current from standstills.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RestSummary {
    /// Gravity current.
    pub current: GravityCurrent,
    /// Standard errors.
    pub error: GravityCurrent,
}

/// Regressions of VFFW and TFFW.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeedforwardSummary {
    /// Regression of VFFW.
    pub velocity: Option<RegressionSummary>,
    /// Regression of TFFW.
    pub torque: Option<RegressionSummary>,
}

/// Regression of a feedforward weight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegressionSummary {
    /// VFFW, or TFFW in kg·m² (kg for a linear motor).
    pub value: f64,
    /// Standard error of the weight.
    pub error: f64,
    /// Coefficient of determination R².
    pub r_squared: f64,
    /// Delay of the feedforward behind the derivative of PSEC, ms: above the first and up to the second value.
    pub delay_ms: [f64; 2],
}

/// Identified delay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DelaySummary {
    /// Delay parameter.
    pub name: DelayParameter,
    /// Feedforward mode of the recordings that identify the delay.
    pub feedforward: FeedforwardMode,
    /// Identified delay, ms.
    pub value_ms: f64,
    /// Interval of equivalent delays, ms: above the first and up to the second value.
    pub interval_ms: [f64; 2],
    /// True if the value of the machine file was kept.
    #[serde(rename = "left")]
    pub is_unchanged: bool,
    /// Evaluated delays, ms, and RMS position residual.
    pub profile: Vec<[f64; 2]>,
}

/// Result of the closed-loop refinement.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RefinementSummary {
    /// Refined parameters.
    pub parameters: Vec<RefinedValue>,
    /// Correlation matrix of the parameters.
    pub correlations: Vec<Vec<f64>>,
    /// Pairs of strongly correlated parameters, with the correlation.
    #[serde(skip)]
    pub correlated_pairs: Vec<(RefinedParameter, RefinedParameter, f64)>,
    /// RMS position residual.
    pub position_rms: Change,
    /// RMS current residual, A; none without currents.
    pub current_rms_a: Option<Change>,
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

/// Serializes the number of elements.
fn serialize_count<T, S: Serializer>(items: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    items.len().serialize(serializer)
}

fn milliseconds(delay: Nanoseconds) -> f64 {
    delay as f64 / MILLISECOND_NS as f64
}

impl IdentificationSummary {
    /// Summarizes an identification.
    ///
    /// `recordings` are the inputs of the identification, `values` its [values](Identification::values),
    /// `validations` the other recordings with their agreement, `findings` all findings in the order of output.
    pub fn new(
        machine: &str,
        recordings: &[IdentificationInput<'_>],
        identification: &Identification,
        values: Vec<IdentifiedValue>,
        validations: &[(IdentificationInput<'_>, &Agreement)],
        findings: Vec<Finding>,
    ) -> Self {
        let (axis, found) = (&identification.initial, identification);
        let kind = axis.kind();
        // Units of position and velocity residuals, SI.
        let (position_unit, position, velocity_unit, velocity) = match kind {
            AxisKind::Linear => ("um", 1e-6, "mm/s", MILLIMETER),
            AxisKind::Rotary => ("mdeg", 1e-3 * DEGREE, "deg/s", DEGREE),
        };
        let residuals = |agreement| ResidualSummary::new(agreement, position, velocity);
        let all = found.agreements.iter().map(Some).chain(std::iter::repeat(None));
        IdentificationSummary {
            machine: machine.to_owned(),
            axis: axis.name().to_owned(),
            kind,
            position_unit,
            velocity_unit,
            speed_unit: speed_unit_name(axis),
            recordings: recordings
                .iter()
                .zip(all)
                .map(|(input, a)| RecordingSummary::new(input, a))
                .collect(),
            values,
            friction: found
                .friction
                .as_ref()
                .map(|friction| FrictionSummary::new(friction, &found.steady.levels, speed_unit(axis))),
            inertia: InertiaSummary::new(found),
            gravity: found.gravity.as_ref().map(GravitySummary::new),
            feedforward: FeedforwardSummary {
                velocity: found.feedforward.velocity.as_ref().map(RegressionSummary::new),
                torque: found.feedforward.torque.as_ref().map(RegressionSummary::new),
            },
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

impl LawSummary {
    fn new(fit: &LawFit) -> Self {
        let of = |[a, b, c, d]: [f64; 4]| LawCoefficients { a, b, c, d };
        let config = &fit.config;
        LawSummary {
            law: fit.law,
            coefficients: of([config.a, config.b, config.c, config.d]),
            i0: config.i0,
            standard_errors: of(fit.errors),
            line: fit.line().map(|(level_a, slope_a)| LineSummary { level_a, slope_a }),
            r_squared: fit.r_squared,
        }
    }
}

impl FrictionSummary {
    fn new(friction: &FrictionFit, levels: &[SteadyCurrent], unit: f64) -> Self {
        let level = |level: &SteadyCurrent| LevelSummary {
            speed: level.velocity / unit,
            friction_a: level.friction,
            current_a: level.current,
            error_a: level.error,
            duration_s: level.duration,
        };
        let speed = |directions: [Option<SteadyCurrent>; 2]| {
            let both = directions.iter().flatten();
            let speed = both.clone().map(|l| l.velocity.abs()).sum::<f64>() / both.count() as f64 / unit;
            SpeedSummary { speed, directions, law: friction.law.at(speed) }
        };
        let [plus, minus] = friction.directions.each_ref().map(|law| law.as_ref().map(LawSummary::new));
        FrictionSummary {
            law: LawSummary::new(&friction.law),
            speeds: group_by_speed(levels).into_iter().map(speed).collect(),
            levels: levels.iter().map(level).collect(),
            asymmetry: friction.asymmetry,
            directions: DirectionsSummary { plus, minus },
        }
    }
}

/// Groups friction levels by speed, each with the positive and the negative direction.
fn group_by_speed(levels: &[SteadyCurrent]) -> Vec<[Option<SteadyCurrent>; 2]> {
    let mut sorted = levels.to_vec();
    sorted.sort_by(|a, b| a.velocity.abs().total_cmp(&b.velocity.abs()));
    let mut found: Vec<[Option<SteadyCurrent>; 2]> = Vec::new();
    for level in sorted {
        let (side, other) = if level.velocity > 0.0 { (0, 1) } else { (1, 0) };
        let is_near = |other: SteadyCurrent| {
            level.velocity.abs() - other.velocity.abs() < SAME_SPEED * other.velocity.abs()
        };
        match found.last_mut() {
            Some(pair) if pair[side].is_none() && pair[other].is_some_and(is_near) => {
                pair[side] = Some(level);
            }
            _ => {
                let mut pair = [None; 2];
                pair[side] = Some(level);
                found.push(pair);
            }
        }
    }
    found
}

impl InertiaSummary {
    fn new(found: &Identification) -> Option<Self> {
        let inertia = found.inertia.as_ref()?;
        let refined = found.refined(RefinedParameter::Inertia);
        Some(InertiaSummary {
            eq5: inertia.value,
            error: inertia.error,
            spread: inertia.spread,
            accelerations: inertia.accelerations,
            instants: inertia.instants.len(),
            simulated_eq5: found.replayed_inertia,
            refined: refined.map(|refined| refined.value),
            refined_error: refined.map(|refined| refined.error),
        })
    }
}

impl GravitySummary {
    fn new(gravity: &GravityFit) -> Self {
        let estimate =
            |unit: f64| move |(value, error)| Estimate { value: value / unit, error: error / unit };
        GravitySummary {
            source: gravity.source,
            current: gravity.current,
            error: gravity.error,
            model: gravity.model,
            weight_n: gravity.weight.map(estimate(1.0)),
            tilt_nm: gravity.tilt.map(estimate(1.0)),
            tilt_phase_deg: gravity.phase.map(estimate(DEGREE)),
            at_rest: gravity.at_rest.map(|(current, error)| RestSummary { current, error }),
        }
    }
}

impl RegressionSummary {
    fn new(found: &FeedforwardRegression) -> Self {
        RegressionSummary {
            value: found.value,
            error: found.error,
            r_squared: found.r_squared,
            delay_ms: [found.delay.0 / MILLISECOND, found.delay.1 / MILLISECOND],
        }
    }
}

impl DelaySummary {
    fn new(fit: &DelayFit, unit: f64) -> Self {
        DelaySummary {
            name: fit.delay,
            feedforward: fit.delay.feedforward_mode(),
            value_ms: milliseconds(fit.value),
            interval_ms: [milliseconds(fit.interval.0), milliseconds(fit.interval.1)],
            is_unchanged: fit.is_unchanged,
            profile: fit.profile.iter().map(|(delay, rms)| [milliseconds(*delay), rms / unit]).collect(),
        }
    }
}

impl RefinementSummary {
    fn new(refinement: &Refinement, unit: f64) -> Self {
        let change = |unit: f64| move |(before, after)| Change { before: before / unit, after: after / unit };
        RefinementSummary {
            parameters: refinement.parameters.clone(),
            correlations: refinement.correlations.clone(),
            correlated_pairs: refinement.correlated_pairs(),
            position_rms: change(unit)(refinement.position),
            current_rms_a: refinement.current.map(change(1.0)),
        }
    }
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
        }
    }
}
