//! Identification of the equivalent inertia from accelerating samples (Prévost section 3.4, eq. 5).

use super::fit::robust_mean_and_deviation;
use super::friction::LawFit;
use super::gravity::GravityCurrent;
use super::segments::{MotionSegment, SegmentKind, largest_magnitude};
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::statistics::{mean, median};

/// Smallest acceleration of a used sample, relative to the largest.
const STRONG: f64 = 0.5;
/// Number of robust standard deviations beyond which a sample is an outlier.
const OUTLIER: f64 = 3.0;
/// Fewest samples.
const FEWEST: usize = 10;
/// Current relative to the limit of the motor above which it is saturated.
pub(super) const SATURATED: f64 = 0.98;

/// Equivalent inertia of an axis, kg·m² at the motor (kg for a linear motor).
#[derive(Debug, Clone, PartialEq)]
pub struct InertiaFit {
    /// Mean without outliers.
    pub value: f64,
    /// Standard error, from the scatter between accelerations.
    pub error: f64,
    /// Robust standard deviation of single samples; NaN for a regression.
    pub spread: f64,
    /// Samples: index of the recording among those with current, time in s, inertia by eq. 5.
    pub instants: Vec<(usize, f64, f64)>,
    /// Number of accelerations.
    pub accelerations: usize,
}

impl InertiaFit {
    /// Returns true if the value is a coefficient of a regression over all motion, which has no single samples.
    pub fn is_regression(&self) -> bool {
        self.spread.is_nan()
    }
}

/// Evaluates `Jeq = (Kt i − C_friction − C_gravity) / (dω/dt)` (Prévost eq. 5) at each accelerating sample
/// and averages it.
pub fn fit_inertia(
    recordings: &[(&Signals, &[MotionSegment])],
    axis: &AxisConfig,
    friction: &LawFit,
    gravity: &GravityCurrent,
    findings: &mut Vec<Finding>,
) -> Option<InertiaFit> {
    let samples = evaluate_samples(recordings, axis, friction, gravity);
    let AcceleratingSamples { instants, phases, saturated } = samples;
    if saturated > 0 {
        findings.push(Finding::warning(
            "saturated-current",
            format!(
                "{saturated} samples at the current limit of the motor ({:.1} A) are excluded",
                axis.motor.max_current
            ),
            "record with a lower acceleration",
        ));
    }
    if instants.len() < FEWEST {
        findings.push(Finding::missing(
            "no-acceleration",
            format!("no inertia: only {} accelerating samples with current", instants.len()),
            "record moves with current that use at least half of the axis acceleration",
        ));
        return None;
    }
    let values: Vec<f64> = instants.iter().map(|instant| instant.2).collect();
    let (middle, spread) = robust_mean_and_deviation(&values);
    let kept: Vec<f64> = values.into_iter().filter(|v| (v - middle).abs() <= OUTLIER * spread).collect();
    let error = robust_mean_and_deviation(&phases).1 / (phases.len() as f64).sqrt();
    let value = if kept.is_empty() { middle } else { mean(&kept).unwrap_or(f64::NAN) };
    if value <= 0.0 {
        findings.push(Finding::missing(
            "negative-inertia",
            format!("no inertia: Prévost eq. 5 gives {value:.4}; the current opposes the acceleration"),
            "check the sign of the current (`current=COLUMN[-1 A]`)",
        ));
        return None;
    }
    Some(InertiaFit { value, error, spread, instants, accelerations: phases.len() })
}

/// Equivalent inertia at the accelerating samples.
#[derive(Default)]
struct AcceleratingSamples {
    /// Index of the recording among those with current, time in s, inertia by eq. 5.
    instants: Vec<(usize, f64, f64)>,
    /// Median inertia of each acceleration.
    phases: Vec<f64>,
    /// Number of samples with saturated current.
    saturated: usize,
}

/// Evaluates eq. 5 at each strongly accelerating sample without saturation.
fn evaluate_samples(
    recordings: &[(&Signals, &[MotionSegment])],
    axis: &AxisConfig,
    friction: &LawFit,
    gravity: &GravityCurrent,
) -> AcceleratingSamples {
    let accelerations: Vec<f64> = recordings
        .iter()
        .flat_map(|(s, _)| s.spans.iter())
        .flat_map(|s| s.acceleration.iter().copied())
        .collect();
    let strong = STRONG * largest_magnitude(&accelerations);
    let (kt, r, unit) = (axis.motor.torque_constant, axis.transmission_ratio, axis.units().speed);
    let limit = SATURATED * axis.motor.max_current;
    let mut found = AcceleratingSamples::default();
    for (number, (signals, segments)) in recordings.iter().enumerate() {
        for segment in segments.iter().filter(|s| s.kind == SegmentKind::Accelerating) {
            let Some(span) = signals.spans.get(segment.span) else { continue };
            let (Some(current), Some(raw)) = (&span.smooth_current, &span.current) else { continue };
            let mut phase = Vec::new();
            for i in segment.samples.clone() {
                let (v, a) = (span.velocity[i], span.acceleration[i]);
                if a.abs() < strong {
                    continue;
                }
                if raw[i].abs() >= limit {
                    found.saturated += 1;
                    continue;
                }
                let rest = current[i] - friction.at(v / unit) - gravity.at(span.position[i]);
                let value = kt * rest * r / a;
                found.instants.push((number, span.start + i as f64 * signals.period, value));
                phase.push(value);
            }
            if !phase.is_empty() {
                found.phases.push(median(&mut phase).unwrap_or(f64::NAN));
            }
        }
    }
    found
}
