//! Equivalent inertia from accelerating instants (Prévost section 3.4, eq. 5).

use super::fit::{median, robust};
use super::friction::{LawFit, speed_unit};
use super::gravity::GravityCurrent;
use super::segments::{Segment, SegmentKind, largest, mean};
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::AxisConfig;

/// Instants count whose acceleration is at least this part of the largest.
const STRONG: f64 = 0.5;
/// Instants further from the middle than so many robust standard deviations are left out of the mean.
const OUTLIER: f64 = 3.0;
/// Least number of instants.
const FEWEST: usize = 10;
/// A current at this part of the motor's largest one is saturated.
pub(super) const SATURATED: f64 = 0.98;

/// Equivalent inertia of an axis, kg·m² at the motor (kg for a linear motor).
#[derive(Debug, Clone, PartialEq)]
pub struct Inertia {
    /// Mean without outliers.
    pub value: f64,
    /// Standard error, from the scatter of the accelerations as wholes.
    pub error: f64,
    /// Robust standard deviation of single instants.
    pub spread: f64,
    /// Every instant: the number of its recording among those with a current, its time in s, and eq. 5 there.
    pub instants: Vec<(usize, f64, f64)>,
    /// Accelerations that they belong to.
    pub accelerations: usize,
}

/// (Prévost eq. 5) `Jeq = (Kt i − C_friction − C_gravity) / (dω/dt)` at each accelerating instant.
pub fn inertia(
    recordings: &[(&Signals, &[Segment])],
    axis: &AxisConfig,
    friction: &LawFit,
    gravity: &GravityCurrent,
    findings: &mut Vec<Finding>,
) -> Option<Inertia> {
    let accelerations: Vec<f64> = recordings
        .iter()
        .flat_map(|(s, _)| s.spans.iter())
        .flat_map(|s| s.acceleration.iter().copied())
        .collect();
    let strong = STRONG * largest(&accelerations);
    let (kt, r, unit) = (axis.motor.torque_constant, axis.transmission_ratio, speed_unit(axis));
    let limit = SATURATED * axis.motor.max_current;
    let (mut instants, mut phases, mut saturated) = (Vec::new(), Vec::new(), 0_usize);
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
                    saturated += 1;
                    continue;
                }
                let rest = current[i] - friction.at(v / unit) - gravity.at(span.position[i]);
                let value = kt * rest * r / a;
                instants.push((number, span.start + i as f64 * signals.period, value));
                phase.push(value);
            }
            if !phase.is_empty() {
                phases.push(median(&mut phase));
            }
        }
    }
    if saturated > 0 {
        findings.push(Finding::warning(
            "saturated-current",
            format!(
                "{saturated} instants at the motor's largest current ({:.1} A) are left out",
                axis.motor.max_current
            ),
            "record with a lower acceleration",
        ));
    }
    if instants.len() < FEWEST {
        findings.push(Finding::missing(
            "no-acceleration",
            format!("no inertia: {} accelerating instants with a current", instants.len()),
            "record moves that start and stop at a good part of the axis's acceleration, with their currents",
        ));
        return None;
    }
    let values: Vec<f64> = instants.iter().map(|instant| instant.2).collect();
    let (middle, spread) = robust(&values);
    let kept: Vec<f64> = values.into_iter().filter(|v| (v - middle).abs() <= OUTLIER * spread).collect();
    let error = robust(&phases).1 / (phases.len() as f64).sqrt();
    let value = if kept.is_empty() { middle } else { mean(&kept) };
    if value <= 0.0 {
        findings.push(Finding::missing(
            "negative-inertia",
            format!(
                "no inertia: eq. 5 gives {value:.4}; the current does not push the way the axis accelerates"
            ),
            "check the sign of the current's column (`current=COLUMN[-1 A]`)",
        ));
        return None;
    }
    Some(Inertia { value, error, spread, instants, accelerations: phases.len() })
}
