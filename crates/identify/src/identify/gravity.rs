//! Identification of gravity and of the friction current at each speed.
//!
//! Without acceleration (Prévost eq. 2) the current is `i = s f(|V|) + C_gravity(q) / Kt` with the sign s of
//! the velocity. Steady motion in both directions separates the two for any law f. At rest the current
//! contains a friction part within ±i0 whose sign follows the approach direction; it cancels with approaches
//! from both sides.

use serde::Serialize;

use super::fit::fit_linear;
use super::segments::{MotionSegment, SegmentKind};
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::statistics::mean;

/// Averaging time of samples before a fit, s.
const BATCH: f64 = 0.1;
/// Relative difference below which two speeds are the same.
pub(super) const SAME_SPEED: f64 = 0.03;
/// Number of standard errors of a significant gravity.
const SIGNIFICANT: f64 = 4.0;
/// Gravity relative to friction below which it is neglected.
const RELEVANT: f64 = 0.01;

/// Mean current at one speed in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyCurrent {
    /// Velocity of the axis with sign, m/s or rad/s.
    pub velocity: f64,
    /// Mean recorded motor current, A.
    pub current: f64,
    /// Friction part of the current with the sign of the velocity, A.
    pub friction: f64,
    /// Standard error of current and friction, A.
    pub error: f64,
    /// Duration of the motion, s.
    pub duration: f64,
}

/// Mean current at a standstill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standstill {
    /// Position, m or rad.
    pub position: f64,
    /// Mean motor current, A.
    pub current: f64,
    /// Sign of the approach velocity; 0 without motion before.
    pub approach: f64,
}

/// Gravity as motor current, A: `constant + sine · sin q + cosine · cos q`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct GravityCurrent {
    /// Part independent of the position, A.
    #[serde(rename = "constant_a")]
    pub constant: f64,
    /// Factor of the sine of the position, A (rotary axes).
    #[serde(rename = "sine_a")]
    pub sine: f64,
    /// Factor of the cosine of the position, A (rotary axes).
    #[serde(rename = "cosine_a")]
    pub cosine: f64,
}

impl GravityCurrent {
    /// Returns the gravity current at a position (m or rad), A.
    pub fn at(&self, position: f64) -> f64 {
        self.constant + self.sine * position.sin() + self.cosine * position.cos()
    }
}

/// Source of an identified gravity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GravitySource {
    /// Constant velocities in both directions.
    Motion,
    /// Standstills.
    Rest,
    /// Regression over all motion.
    Regression,
}

/// Identified gravity of an axis with standard errors.
#[derive(Debug, Clone, PartialEq)]
pub struct GravityFit {
    /// Fitted gravity current before the significance test.
    pub current: GravityCurrent,
    /// Standard errors of the gravity current, A.
    pub error: GravityCurrent,
    /// Gravity current of the model; zero if it is not significant.
    pub model: GravityCurrent,
    /// Weight W and its standard error, N (linear axes).
    pub weight: Option<(f64, f64)>,
    /// Tilting torque k and its standard error, N·m (rotary axes).
    pub tilt: Option<(f64, f64)>,
    /// Phase φ and its standard error, rad (rotary axes with significant k).
    pub phase: Option<(f64, f64)>,
    /// Source: motion or standstills.
    pub source: GravitySource,
    /// Gravity current and standard errors from standstills alone, A, if the source is motion.
    pub at_rest: Option<(GravityCurrent, GravityCurrent)>,
}

impl GravityFit {
    /// Sets the gravity parameters of an axis.
    pub(super) fn apply(&self, axis: &mut AxisConfig) {
        if let Some((weight, _)) = self.weight {
            axis.gravity.weight = weight;
        }
        if let Some((tilt, _)) = self.tilt {
            axis.gravity.tilt = tilt;
            axis.gravity.phase = self.phase.map_or(0.0, |(phase, _)| phase);
        }
    }
}

/// Measured currents at constant velocity and at rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SteadyMeasurements {
    /// Mean currents by velocity in rising order, negative velocities first.
    pub levels: Vec<SteadyCurrent>,
    /// Standstills in order of time.
    pub standstills: Vec<Standstill>,
}

/// Averaged part of a segment.
struct CurrentBatch {
    /// Index of the speed and sign of the velocity; none at rest.
    speed: Option<(usize, f64)>,
    approach: f64,
    velocity: f64,
    current: f64,
    sine: f64,
    cosine: f64,
    samples: f64,
    /// Duration, s.
    duration: f64,
}

/// Fits gravity and the mean currents of each speed to segmented recordings.
///
/// `inertia` is the known motor current per acceleration of the axis (A per m/s² or rad/s²); it corrects for
/// residual accelerations.
pub fn fit_gravity(
    recordings: &[(&Signals, &[MotionSegment])],
    axis: &AxisConfig,
    inertia: f64,
) -> (SteadyMeasurements, Option<GravityFit>) {
    let rotary = axis.kind() == AxisKind::Rotary;
    let speeds = distinct_speeds(recordings);
    let batches = average_batches(recordings, &speeds, inertia);
    let shape = |b: &CurrentBatch| if rotary { vec![1.0, b.sine, b.cosine] } else { vec![1.0] };
    let unknowns = if rotary { 3 } else { 1 };
    let moving = |b: &&CurrentBatch| b.speed.is_some();

    let in_motion = fit_linear(batches.iter().filter(moving).map(|b| {
        let mut row = shape(b);
        row.extend((0..speeds.len()).map(|k| match b.speed {
            Some((speed, sign)) if speed == k => sign,
            _ => 0.0,
        }));
        (row, b.current, b.samples)
    }));
    let at_rest = fit_linear(batches.iter().filter(|b| b.speed.is_none()).map(|b| {
        let mut row = shape(b);
        row.push(b.approach);
        (row, b.current, b.samples)
    }));
    let read = |values: &dyn Fn(usize) -> f64| GravityCurrent {
        constant: values(0),
        sine: if rotary { values(1) } else { 0.0 },
        cosine: if rotary { values(2) } else { 0.0 },
    };
    let of = |fit: &super::fit::LinearFit| (read(&|k| fit.values[k]), read(&|k| fit.error(k)));
    let rest = at_rest.as_ref().map(of);
    let found = in_motion.as_ref().map(|fit| (of(fit), GravitySource::Motion));
    let found = found.or(rest.map(|rest| (rest, GravitySource::Rest)));

    let friction_scale = in_motion.as_ref().map_or(0.0, |fit| {
        let levels = &fit.values[unknowns..];
        mean(&levels.iter().map(|level| level.abs()).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    });
    let gravity = found.map(|((current, error), source)| {
        let at_rest = rest.filter(|_| source == GravitySource::Motion);
        select_model(axis, current, error, source, at_rest, friction_scale)
    });
    let current = gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
    (
        SteadyMeasurements {
            levels: average_levels(&batches, &speeds, &current),
            standstills: find_standstills(recordings),
        },
        gravity,
    )
}

/// Returns the distinct speeds of the constant-velocity segments in rising order.
fn distinct_speeds(recordings: &[(&Signals, &[MotionSegment])]) -> Vec<f64> {
    let segments = recordings.iter().flat_map(|(_, segments)| segments.iter());
    let mut found: Vec<f64> = segments
        .filter(|s| s.kind == SegmentKind::ConstantVelocity)
        .map(|s| s.velocity.abs())
        .filter(|v| v.is_finite())
        .collect();
    found.sort_by(f64::total_cmp);
    found.dedup_by(|next, kept| *next - *kept <= SAME_SPEED * *kept);
    found
}

fn average_batches(
    recordings: &[(&Signals, &[MotionSegment])],
    speeds: &[f64],
    inertia: f64,
) -> Vec<CurrentBatch> {
    let mut found = Vec::new();
    for (signals, segments) in recordings {
        let length = ((BATCH / signals.period).round() as usize).max(1);
        for segment in segments.iter().filter(|s| s.kind != SegmentKind::Accelerating) {
            let Some(span) = signals.spans.get(segment.span) else { continue };
            let Some(current) = &span.current else { continue };
            let speed = (segment.kind == SegmentKind::ConstantVelocity).then(|| {
                let v = segment.velocity.abs();
                // Index of the speed of the segment: the last one that is not faster.
                (speeds.partition_point(|s| *s <= v).saturating_sub(1), segment.velocity.signum())
            });
            let channels =
                segment.of(current).chunks(length).zip(segment.of(&span.position).chunks(length)).zip(
                    segment
                        .of(&span.velocity)
                        .chunks(length)
                        .zip(segment.of(&span.acceleration).chunks(length)),
                );
            for ((current, position), (velocity, acceleration)) in channels {
                let average = |f: fn(f64) -> f64| {
                    mean(&position.iter().map(|q| f(*q)).collect::<Vec<_>>()).unwrap_or(f64::NAN)
                };
                found.push(CurrentBatch {
                    speed,
                    approach: segment.approach,
                    velocity: mean(velocity).unwrap_or(f64::NAN),
                    current: mean(current).unwrap_or(f64::NAN)
                        - if speed.is_some() {
                            inertia * mean(acceleration).unwrap_or(f64::NAN)
                        } else {
                            0.0
                        },
                    sine: average(f64::sin),
                    cosine: average(f64::cos),
                    samples: current.len() as f64,
                    duration: current.len() as f64 * signals.period,
                });
            }
        }
    }
    found
}

/// Averages the currents of each speed and direction.
fn average_levels(batches: &[CurrentBatch], speeds: &[f64], gravity: &GravityCurrent) -> Vec<SteadyCurrent> {
    let mut found = Vec::new();
    for direction in [-1.0, 1.0] {
        for number in 0..speeds.len() {
            let of_it = || batches.iter().filter(move |b| b.speed == Some((number, direction)));
            let samples: f64 = of_it().map(|b| b.samples).sum();
            if samples == 0.0 {
                continue;
            }
            let average =
                |f: &dyn Fn(&CurrentBatch) -> f64| of_it().map(|b| b.samples * f(b)).sum::<f64>() / samples;
            let weight =
                |b: &CurrentBatch| gravity.constant + gravity.sine * b.sine + gravity.cosine * b.cosine;
            let friction = average(&|b| b.current - weight(b));
            let count = of_it().count() as f64;
            let scatter = average(&|b| (b.current - weight(b) - friction).powi(2));
            found.push(SteadyCurrent {
                velocity: average(&|b| b.velocity),
                current: average(&|b| b.current),
                friction,
                error: (scatter / (count - 1.0).max(1.0)).sqrt(),
                duration: of_it().map(|b| b.duration).sum(),
            });
        }
    }
    found.sort_by(|a, b| a.velocity.total_cmp(&b.velocity));
    found
}

fn find_standstills(recordings: &[(&Signals, &[MotionSegment])]) -> Vec<Standstill> {
    let mut found = Vec::new();
    for (signals, segments) in recordings {
        for segment in segments.iter().filter(|s| s.kind == SegmentKind::Static) {
            let current = signals.spans.get(segment.span).and_then(|span| span.current.as_ref());
            if let Some(current) = current {
                let (position, approach) = (segment.position, segment.approach);
                found.push(Standstill {
                    position,
                    current: mean(segment.of(current)).unwrap_or(f64::NAN),
                    approach,
                });
            }
        }
    }
    found
}

/// Converts the gravity current to the parameters of the axis model (Prévost section 3.4); insignificant
/// gravity is zero.
fn select_model(
    axis: &AxisConfig,
    current: GravityCurrent,
    error: GravityCurrent,
    source: GravitySource,
    at_rest: Option<(GravityCurrent, GravityCurrent)>,
    friction: f64,
) -> GravityFit {
    let force = axis.motor.torque_constant / axis.transmission_ratio;
    let is_there = |value: f64, error: f64| value.abs() > (SIGNIFICANT * error).max(RELEVANT * friction);
    let mut gravity = GravityFit {
        current,
        error,
        model: GravityCurrent::default(),
        weight: None,
        tilt: None,
        phase: None,
        source,
        at_rest,
    };
    match axis.kind() {
        AxisKind::Linear => {
            let there = is_there(current.constant, error.constant);
            gravity.model.constant = if there { current.constant } else { 0.0 };
            gravity.weight = Some((force * gravity.model.constant, force * error.constant));
        }
        AxisKind::Rotary => {
            let amplitude = current.sine.hypot(current.cosine);
            let spread = error.sine.hypot(error.cosine);
            let there = is_there(amplitude, spread);
            gravity.tilt = Some((if there { force * amplitude } else { 0.0 }, force * spread));
            if there {
                (gravity.model.sine, gravity.model.cosine) = (current.sine, current.cosine);
                gravity.phase = Some((current.cosine.atan2(current.sine), spread / amplitude));
            }
        }
    }
    gravity
}
