//! Where two blocks meet: how fast it may be passed.

use super::block::Derivatives;
use super::profile::Limits;
use crate::config::LimitsConfig;

/// Largest turn of the direction that still counts as tangent, rad, with speeds measured in Vmax: more
/// than coordinates rounded to a micrometer make of an arc of a centimeter.
const TANGENT_TOLERANCE: f64 = 1e-4;
/// Part of Jmax left to the jump of speed at a junction that is tangent but for rounding.
const TURN_SHARE: f64 = 0.25;
/// Ratios of the two blocks' lengths that differ from 1 by less are 1.
const RATIO_TOLERANCE: f64 = 1e-9;

/// A junction, in the speed at the end of what comes before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Junction {
    /// Speed behind it over speed before it: the two lengths may count in different units.
    pub ratio: f64,
    /// Largest speed for its own sake; 0 is an exact stop.
    pub cap: f64,
    /// Whether setpoints jump in their speed there, as permitted.
    pub corner: bool,
}

impl Junction {
    /// An exact stop.
    pub const STOP: Self = Self { ratio: 1.0, cap: 0.0, corner: false };
    /// Inside a block: nothing changes.
    pub const INSIDE: Self = Self { ratio: 1.0, cap: f64::INFINITY, corner: false };

    /// The junction between joints with the derivatives `before` and `after`.
    ///
    /// Tangent continuous: the jump of acceleration of each joint, v² |Δq''|, is at most Jmax·Tsp; in
    /// sampled setpoints it is a jerk over a period. Where the direction turns, `corner` is the
    /// speed permitted, if any.
    pub fn new(
        before: &Derivatives,
        after: &Derivatives,
        joints: &[LimitsConfig],
        period: f64,
        corner: Option<f64>,
    ) -> Self {
        let size = |slopes: &[f64]| {
            let parts = slopes.iter().zip(joints).map(|(slope, limits)| slope / limits.velocity);
            parts.fold(0.0, f64::hypot)
        };
        let (speed_before, speed_after) = (size(&before.first), size(&after.first));
        let mut ratio = speed_before / speed_after;
        if (ratio - 1.0).abs() < RATIO_TOLERANCE {
            ratio = 1.0;
        }
        let turns: Vec<f64> =
            before.first.iter().zip(&after.first).map(|(before, after)| before - ratio * after).collect();
        let turn = size(&turns) / speed_before;
        // Written so that NaN is no tangent.
        let tangent = turn <= TANGENT_TOLERANCE;
        if !tangent {
            let cap = corner.unwrap_or(0.0);
            return Self { ratio: 1.0, cap, corner: cap > 0.0 };
        }
        let mut cap = f64::INFINITY;
        for (i, limits) in joints.iter().enumerate() {
            let bend = (before.second[i] - ratio * ratio * after.second[i]).abs();
            let by_bend = (limits.jerk * period / bend).sqrt();
            let by_turn = TURN_SHARE * limits.jerk * period * period / turns[i].abs();
            cap = cap.min(by_bend).min(by_turn);
        }
        Self { ratio, cap, corner: false }
    }
}

/// Parts of a span's jerk that are tried where acceleration jumps at its end.
const JERK_PARTS: [f64; 8] = [1.0, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4];
/// Places of the jump in the window of a third difference that are looked at, in periods from its middle.
const PLACES: [f64; 11] = [-1.25, -1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25];
/// Jumps of less than that part of Jmax·Tsp are left alone.
const SMALL_JUMP: f64 = 1e-3;

/// What a jump of curvature does to one joint, in parts of its Jmax.
struct Jolt {
    /// v² |Δq''| / Tsp.
    jump: f64,
    /// Jerk before and after it that goes with the jerk along the path, and that goes with the speed.
    before: (f64, f64),
    after: (f64, f64),
}

/// A third difference over the period is the jerk, weighted by the quadratic B-spline over three
/// periods: the weight of a jump of acceleration `x` periods from its middle, and the share of the
/// window before it.
fn weights(x: f64) -> (f64, f64) {
    let tail = |x: f64| (1.5 - x).powi(3) / 6.0;
    if x.abs() <= 0.5 {
        return (0.75 - x * x, 0.5 + 0.75 * x - x.powi(3) / 3.0);
    }
    let share = if x > 0.0 { 1.0 - tail(x) } else { tail(-x) };
    (0.5 * (1.5 - x.abs()).powi(2), share)
}

/// A joint that takes part in both, the jump of acceleration at a junction and the jerk along the path
/// next to it, must share its Jmax: the speed of the junction and the jerk of both spans are reduced
/// so that it does, in whatever way costs least.
pub(super) fn share_jerk(
    junction: &mut Junction,
    (before, earlier): (&Derivatives, &mut Limits),
    (after, later): (&Derivatives, &mut Limits),
    joints: &[LimitsConfig],
    period: f64,
) {
    let ratio = junction.ratio;
    let speed = junction.cap.min(earlier.velocity).min(later.velocity / ratio);
    let jolts: Vec<Jolt> = joints
        .iter()
        .enumerate()
        .map(|(i, limits)| {
            let bend = (before.second[i] - ratio * ratio * after.second[i]).abs();
            let of = |derivatives: &Derivatives, jerk: f64, speed: f64| {
                let along = derivatives.first[i].abs() * jerk / limits.jerk;
                (along, derivatives.third[i].abs() * speed.powi(3) / limits.jerk)
            };
            Jolt {
                jump: speed * speed * bend / (limits.jerk * period),
                before: of(before, earlier.jerk, speed),
                after: of(after, later.jerk, speed * ratio),
            }
        })
        .collect();
    let jolts: Vec<Jolt> = jolts.into_iter().filter(|jolt| jolt.jump > SMALL_JUMP).collect();
    if jolts.is_empty() {
        return;
    }
    // Part of the jump that is left room for, with these parts of the jerks.
    let room = |first: f64, second: f64| {
        let left = |jolt: &Jolt, x: f64| {
            let (weight, share) = weights(x);
            let before = jolt.before.0 * first + jolt.before.1;
            let after = jolt.after.0 * second + jolt.after.1;
            (1.0 - share * before - (1.0 - share) * after) / (weight * jolt.jump)
        };
        let all = jolts.iter().flat_map(|jolt| PLACES.map(|x| left(jolt, x)));
        all.fold(1.0, f64::min)
    };
    let mut best = (0.0, 1.0, 1.0, 0.0);
    for first in JERK_PARTS {
        for second in JERK_PARTS {
            let jump = room(first, second);
            let worth = jump * (first * second).sqrt();
            if worth > best.3 {
                best = (jump, first, second, worth);
            }
        }
    }
    // No room at all: the setpoints will be looked at.
    if best.3 > 0.0 {
        if best.0 < 1.0 {
            junction.cap = speed * best.0.sqrt();
        }
        earlier.jerk *= best.1;
        later.jerk *= best.2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_quadratic_b_spline_and_its_integral() {
        let mut share = 0.0;
        let h = 1e-4;
        for i in 0..30_000 {
            let x = -1.5 + h * (f64::from(i) + 0.5);
            share += h * weights(x).0;
            assert!((weights(x + h / 2.0).1 - share).abs() < 1e-8, "{x}");
        }
        assert!((share - 1.0).abs() < 1e-8);
        assert_eq!(weights(0.0), (0.75, 0.5));
    }
}
