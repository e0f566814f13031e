//! Gravity, and the current that each speed asks for beside it.
//!
//! At constant velocity and at rest nothing accelerates (Prévost eq. 2), so the current is
//! `i = s f(|V|) + C_gravity(q) / Kt` with the sign s of the velocity. Steady motion in both directions tells
//! the two apart whatever the law f is. At rest friction holds anything up to ±i0 of it: what is left of it
//! changes its sign with the direction in which the axis came, and cancels where it came from both.

use super::fit::linear;
use super::segments::{Segment, SegmentKind, mean};
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, AxisKind};

/// Samples of a segment are averaged over so long, s, before they enter a fit.
const BATCH: f64 = 0.1;
/// Speeds that differ by less than this part are one.
const SAME_SPEED: f64 = 0.03;
/// Standard errors beyond which a gravity is there.
const SIGNIFICANT: f64 = 4.0;
/// Part of the friction below which a gravity does not matter.
const RELEVANT: f64 = 0.01;

/// Mean current of a speed in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Velocity of the axis, m/s or rad/s, with its sign.
    pub velocity: f64,
    /// Mean motor current as recorded, A.
    pub current: f64,
    /// What friction has of it, A, with the sign of the velocity.
    pub friction: f64,
    /// Standard error of both, A.
    pub error: f64,
    /// How long it was moved at, s.
    pub duration: f64,
}

/// Mean current of a standstill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Position, m or rad.
    pub position: f64,
    /// Mean motor current, A.
    pub current: f64,
    /// Sign of the velocity with which the axis came; 0 if it had not moved.
    pub approach: f64,
}

/// Gravity as motor currents, A: `constant + sine · sin q + cosine · cos q`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GravityCurrent {
    /// Alike at each position.
    pub constant: f64,
    /// Factor of the sine of the position (rotary axes).
    pub sine: f64,
    /// Factor of the cosine of the position (rotary axes).
    pub cosine: f64,
}

impl GravityCurrent {
    /// At a position (m or rad), A.
    pub fn at(&self, position: f64) -> f64 {
        self.constant + self.sine * position.sin() + self.cosine * position.cos()
    }
}

/// Where a gravity comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GravitySource {
    /// Constant velocities in both directions.
    Motion,
    /// Standstills.
    Rest,
}

/// Gravity of an axis, with standard errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Gravity {
    /// As motor currents, with nothing left out.
    pub current: GravityCurrent,
    /// Standard errors of those, A.
    pub error: GravityCurrent,
    /// What the model takes over: zero where it is not significant.
    pub model: GravityCurrent,
    /// W, N, and its standard error (linear axes).
    pub weight: Option<(f64, f64)>,
    /// k, N·m, and its standard error (rotary axes).
    pub tilt: Option<(f64, f64)>,
    /// φ, rad, and its standard error (rotary axes that have k).
    pub phase: Option<(f64, f64)>,
    /// Whether it was found in motion or at rest.
    pub source: GravitySource,
    /// The same from standstills alone, where both are there, A.
    pub at_rest: Option<(GravityCurrent, GravityCurrent)>,
}

impl Gravity {
    /// Makes it the gravity of an axis.
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

/// What steady segments hold.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Steady {
    /// Speeds in rising order, those towards minus first.
    pub levels: Vec<Level>,
    /// Standstills, in the order of time.
    pub rests: Vec<Rest>,
}

/// A piece of a segment, averaged.
struct Batch {
    /// Number of the speed, and sign of the velocity; none at rest.
    speed: Option<(usize, f64)>,
    approach: f64,
    velocity: f64,
    current: f64,
    sine: f64,
    cosine: f64,
    samples: f64,
    /// s.
    duration: f64,
}

/// Gravity and currents of each speed, from recordings with their segments.
///
/// `inertia` is the motor current per acceleration of the axis (A per m/s² or rad/s²), as far as it is known:
/// what is left of accelerations is taken off.
pub fn gravity(
    recordings: &[(&Signals, &[Segment])],
    axis: &AxisConfig,
    inertia: f64,
) -> (Steady, Option<Gravity>) {
    let rotary = axis.kind() == AxisKind::Rotary;
    let speeds = distinct_speeds(recordings);
    let batches = batches(recordings, &speeds, inertia);
    let shape = |b: &Batch| if rotary { vec![1.0, b.sine, b.cosine] } else { vec![1.0] };
    let unknowns = if rotary { 3 } else { 1 };
    let moving = |b: &&Batch| b.speed.is_some();

    let in_motion = linear(batches.iter().filter(moving).map(|b| {
        let mut row = shape(b);
        row.extend((0..speeds.len()).map(|k| match b.speed {
            Some((speed, sign)) if speed == k => sign,
            _ => 0.0,
        }));
        (row, b.current, b.samples)
    }));
    let at_rest = linear(batches.iter().filter(|b| b.speed.is_none()).map(|b| {
        let mut row = shape(b);
        row.push(b.approach);
        (row, b.current, b.samples)
    }));
    let read = |values: &dyn Fn(usize) -> f64| GravityCurrent {
        constant: values(0),
        sine: if rotary { values(1) } else { 0.0 },
        cosine: if rotary { values(2) } else { 0.0 },
    };
    let of = |fit: &super::fit::Linear| (read(&|k| fit.values[k]), read(&|k| fit.error(k)));
    let rest = at_rest.as_ref().map(of);
    let found = in_motion.as_ref().map(|fit| (of(fit), GravitySource::Motion));
    let found = found.or(rest.map(|rest| (rest, GravitySource::Rest)));

    let friction_scale = in_motion.as_ref().map_or(0.0, |fit| {
        let levels = &fit.values[unknowns..];
        mean(&levels.iter().map(|level| level.abs()).collect::<Vec<_>>())
    });
    let gravity = found.map(|((current, error), source)| {
        let at_rest = rest.filter(|_| source == GravitySource::Motion);
        model(axis, current, error, source, at_rest, friction_scale)
    });
    let current = gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
    (Steady { levels: levels(&batches, &speeds, &current), rests: rests(recordings) }, gravity)
}

/// Speeds of the segments of constant velocity, each once, rising.
fn distinct_speeds(recordings: &[(&Signals, &[Segment])]) -> Vec<f64> {
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

fn batches(recordings: &[(&Signals, &[Segment])], speeds: &[f64], inertia: f64) -> Vec<Batch> {
    let mut found = Vec::new();
    for (signals, segments) in recordings {
        let length = ((BATCH / signals.period).round() as usize).max(1);
        for segment in segments.iter().filter(|s| s.kind != SegmentKind::Accelerating) {
            let Some(span) = signals.spans.get(segment.span) else { continue };
            let Some(current) = &span.current else { continue };
            let speed = (segment.kind == SegmentKind::ConstantVelocity).then(|| {
                let v = segment.velocity.abs();
                // The speed that the segment was counted to: the last one that is not faster.
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
                let average = |f: fn(f64) -> f64| mean(&position.iter().map(|q| f(*q)).collect::<Vec<_>>());
                found.push(Batch {
                    speed,
                    approach: segment.approach,
                    velocity: mean(velocity),
                    current: mean(current) - if speed.is_some() { inertia * mean(acceleration) } else { 0.0 },
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

/// Means of each speed and direction.
fn levels(batches: &[Batch], speeds: &[f64], gravity: &GravityCurrent) -> Vec<Level> {
    let mut found = Vec::new();
    for direction in [-1.0, 1.0] {
        for number in 0..speeds.len() {
            let of_it = || batches.iter().filter(move |b| b.speed == Some((number, direction)));
            let samples: f64 = of_it().map(|b| b.samples).sum();
            if samples == 0.0 {
                continue;
            }
            let average =
                |f: &dyn Fn(&Batch) -> f64| of_it().map(|b| b.samples * f(b)).sum::<f64>() / samples;
            let weight = |b: &Batch| gravity.constant + gravity.sine * b.sine + gravity.cosine * b.cosine;
            let friction = average(&|b| b.current - weight(b));
            let count = of_it().count() as f64;
            let scatter = average(&|b| (b.current - weight(b) - friction).powi(2));
            found.push(Level {
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

fn rests(recordings: &[(&Signals, &[Segment])]) -> Vec<Rest> {
    let mut found = Vec::new();
    for (signals, segments) in recordings {
        for segment in segments.iter().filter(|s| s.kind == SegmentKind::Static) {
            let current = signals.spans.get(segment.span).and_then(|span| span.current.as_ref());
            if let Some(current) = current {
                let (position, approach) = (segment.position, segment.approach);
                found.push(Rest { position, current: mean(segment.of(current)), approach });
            }
        }
    }
    found
}

/// What the model of the axis has of it (Prévost section 3.4).
fn model(
    axis: &AxisConfig,
    current: GravityCurrent,
    error: GravityCurrent,
    source: GravitySource,
    at_rest: Option<(GravityCurrent, GravityCurrent)>,
    friction: f64,
) -> Gravity {
    let force = axis.motor.torque_constant / axis.transmission_ratio;
    let is_there = |value: f64, error: f64| value.abs() > (SIGNIFICANT * error).max(RELEVANT * friction);
    let mut gravity = Gravity {
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
