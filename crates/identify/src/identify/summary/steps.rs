//! Summaries of the identification steps.

use serde::{Serialize, Serializer};

use super::super::delays::{DelayFit, DelayParameter};
use super::super::feedforward_mode::FeedforwardMode;
use super::super::friction::{FrictionFit, FrictionLaw, LawFit};
use super::super::gravity::{GravityCurrent, GravityFit, GravitySource, SAME_SPEED, SteadyCurrent};
use super::super::identification::Identification;
use super::super::presliding::PreslidingFit;
use super::super::refine::{RefinedParameter, RefinedValue, Refinement};
use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, MILLISECOND_NS, NEWTON_PER_MICROMETER, Nanoseconds};

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

impl LawSummary {
    pub(super) fn new(fit: &LawFit) -> Self {
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

impl FrictionSummary {
    pub(super) fn new(friction: &FrictionFit, levels: &[SteadyCurrent], unit: f64) -> Self {
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

/// Serializes the number of elements.
fn serialize_count<T, S: Serializer>(items: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    items.len().serialize(serializer)
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

impl InertiaSummary {
    pub(super) fn new(found: &Identification) -> Option<Self> {
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

/// Presliding of the friction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PreslidingSummary {
    /// Stiffness σ0 at the axis, N/µm or N·m/rad.
    pub stiffness: f64,
    /// Unit of the stiffness.
    pub stiffness_unit: &'static str,
    /// Bounds of the 95 % interval of the stiffness.
    pub interval: [f64; 2],
    /// Damping σ1 at the axis, N·s/m or N·m·s/rad; none if the recordings do not determine it.
    pub damping: Option<Estimate>,
    /// Friction over stiffness, µm or mdeg.
    pub length: f64,
    /// Number of reversals.
    pub reversals: usize,
    /// Distance since a reversal, µm or mdeg, measured and modeled friction current, A, of one reversal.
    pub curve: Vec<[f64; 3]>,
}

impl PreslidingSummary {
    pub(super) fn new(fit: &PreslidingFit, kind: AxisKind) -> Self {
        let (unit, stiffness_unit, length) = match kind {
            AxisKind::Linear => (NEWTON_PER_MICROMETER, "N/um", 1e-6),
            AxisKind::Rotary => (1.0, "N.m/rad", 1e-3 * DEGREE),
        };
        PreslidingSummary {
            stiffness: fit.stiffness / unit,
            stiffness_unit,
            interval: fit.interval.map(|bound| bound / unit),
            damping: fit.damping.map(|(value, error)| Estimate { value, error }),
            length: fit.length / length,
            reversals: fit.reversals,
            curve: fit.curve.iter().map(|&[x, i, model]| [x / length, i, model]).collect(),
        }
    }
}

/// Value with standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard error.
    pub error: f64,
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

impl GravitySummary {
    pub(super) fn new(gravity: &GravityFit) -> Self {
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

/// Gravity current from standstills.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RestSummary {
    /// Gravity current.
    pub current: GravityCurrent,
    /// Standard errors.
    pub error: GravityCurrent,
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
    /// Confidence interval, ms: above the first and up to the second value. All its delays give the same motion, but for β
    /// and γ of a joint fit, whose interval is two standard errors wide on each side.
    pub interval_ms: [f64; 2],
    /// True if the delay was fitted jointly with the others.
    #[serde(skip)]
    pub is_joint: bool,
    /// True if the value of the machine file was kept.
    #[serde(rename = "left")]
    pub is_unchanged: bool,
    /// Evaluated delays, ms, and RMS position residual.
    pub profile: Vec<[f64; 2]>,
}

impl DelaySummary {
    pub(super) fn new(fit: &DelayFit, unit: f64) -> Self {
        DelaySummary {
            name: fit.delay,
            feedforward: fit.delay.feedforward_mode(),
            value_ms: milliseconds(fit.value),
            interval_ms: [milliseconds(fit.interval.0), milliseconds(fit.interval.1)],
            is_joint: fit.is_joint,
            is_unchanged: fit.is_unchanged,
            profile: fit.profile.iter().map(|(delay, rms)| [milliseconds(*delay), rms / unit]).collect(),
        }
    }
}

fn milliseconds(delay: Nanoseconds) -> f64 {
    delay as f64 / MILLISECOND_NS as f64
}

/// Value before and after the refinement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Value before the refinement.
    pub before: f64,
    /// Value after the refinement.
    pub after: f64,
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

impl RefinementSummary {
    pub(super) fn new(refinement: &Refinement, unit: f64) -> Self {
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
