//! Junctions of blocks: tangent continuity, curvature jumps and the permitted speed.

use super::derivatives::Derivatives;
use super::profile::FeedLimits;
use crate::config::LimitsConfig;

/// Largest change of direction that counts as tangent, rad, with speeds normalized by Vmax: more than
/// results from coordinates rounded to a micrometer on an arc of a centimeter.
const TANGENT_TOLERANCE: f64 = 1e-4;
/// Fraction of Jmax available for the speed jump at a junction that is tangent except for rounding.
const TURN_SHARE: f64 = 0.25;
/// Tolerance within which the ratio of the two blocks' lengths is 1.
const RATIO_TOLERANCE: f64 = 1e-9;

/// A junction; its speed is that at the end of the block before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Junction {
    /// Speed after the junction divided by speed before it: the two arc lengths may differ in unit.
    pub ratio: f64,
    /// Largest speed that the junction permits; 0 is an exact stop.
    pub cap: f64,
    /// True if the setpoint velocity jumps there, as permitted.
    pub is_corner: bool,
}

impl Junction {
    /// An exact stop.
    pub const STOP: Self = Self { ratio: 1.0, cap: 0.0, is_corner: false };
    /// A boundary of spans inside a block, without a discontinuity.
    pub const INSIDE: Self = Self { ratio: 1.0, cap: f64::INFINITY, is_corner: false };

    /// Creates the junction between joints with the derivatives `before` and `after`.
    ///
    /// At a tangent-continuous junction the acceleration jump of each joint, v² |Δq''|, is at most
    /// Jmax·Tsp; in sampled setpoints it is a jerk during one cycle. At a change of direction, `corner` is
    /// the permitted speed, if any.
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
        // The comparison treats NaN as not tangent.
        let tangent = turn <= TANGENT_TOLERANCE;
        if !tangent {
            let cap = corner.unwrap_or(0.0);
            return Self { ratio: 1.0, cap, is_corner: cap > 0.0 };
        }
        let mut cap = f64::INFINITY;
        for (i, limits) in joints.iter().enumerate() {
            let curvature_jump = (before.second[i] - ratio * ratio * after.second[i]).abs();
            let by_curvature = (limits.jerk * period / curvature_jump).sqrt();
            let by_turn = TURN_SHARE * limits.jerk * period * period / turns[i].abs();
            cap = cap.min(by_curvature).min(by_turn);
        }
        Self { ratio, cap, is_corner: false }
    }
}

/// Candidate jerks of the spans at an acceleration jump, as fractions.
const JERK_FRACTIONS: [f64; 8] = [1.0, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4];
/// Positions of the jump in the window of a third difference, in cycles from its middle.
const JUMP_OFFSETS: [f64; 11] = [-1.25, -1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25];
/// Acceleration jumps below this fraction of Jmax·Tsp are ignored.
const SMALL_JUMP: f64 = 1e-3;

/// Effect of a curvature jump on one joint, as fractions of its Jmax.
struct AccelerationJump {
    /// Acceleration jump over a cycle, v² |Δq''| / Tsp.
    jump: f64,
    /// Jerk before the jump: part proportional to the jerk along the path, and part from the speed.
    before: (f64, f64),
    after: (f64, f64),
}

/// Returns the weight of an acceleration jump `x` cycles from the middle of the window, and the share of
/// the window before it.
///
/// A third difference over the cycle is the jerk weighted by the quadratic B-spline over three cycles.
fn weights(x: f64) -> (f64, f64) {
    let tail = |x: f64| (1.5 - x).powi(3) / 6.0;
    if x.abs() <= 0.5 {
        return (0.75 - x * x, 0.5 + 0.75 * x - x.powi(3) / 3.0);
    }
    let share = if x > 0.0 { 1.0 - tail(x) } else { tail(-x) };
    (0.5 * (1.5 - x.abs()).powi(2), share)
}

/// Reduces the junction speed and the jerk of both adjacent spans so that each joint keeps Jmax.
///
/// A joint with an acceleration jump at the junction and jerk along the path next to it shares its Jmax
/// between both. The combination of least cost is selected.
pub(super) fn share_jerk(
    junction: &mut Junction,
    (before, earlier): (&Derivatives, &mut FeedLimits),
    (after, later): (&Derivatives, &mut FeedLimits),
    joints: &[LimitsConfig],
    period: f64,
) {
    let ratio = junction.ratio;
    let speed = junction.cap.min(earlier.velocity).min(later.velocity / ratio);
    let jumps: Vec<AccelerationJump> = joints
        .iter()
        .enumerate()
        .map(|(i, limits)| {
            let curvature_jump = (before.second[i] - ratio * ratio * after.second[i]).abs();
            let of = |derivatives: &Derivatives, jerk: f64, speed: f64| {
                let along = derivatives.first[i].abs() * jerk / limits.jerk;
                (along, derivatives.third[i].abs() * speed.powi(3) / limits.jerk)
            };
            AccelerationJump {
                jump: speed * speed * curvature_jump / (limits.jerk * period),
                before: of(before, earlier.jerk, speed),
                after: of(after, later.jerk, speed * ratio),
            }
        })
        .collect();
    let jumps: Vec<AccelerationJump> =
        jumps.into_iter().filter(|joint_jump| joint_jump.jump > SMALL_JUMP).collect();
    if jumps.is_empty() {
        return;
    }
    // Admissible fraction of the jump for the given fractions of the two jerks.
    let jump_share = |first: f64, second: f64| {
        let left = |joint_jump: &AccelerationJump, x: f64| {
            let (weight, share) = weights(x);
            let before = joint_jump.before.0 * first + joint_jump.before.1;
            let after = joint_jump.after.0 * second + joint_jump.after.1;
            (1.0 - share * before - (1.0 - share) * after) / (weight * joint_jump.jump)
        };
        let all = jumps.iter().flat_map(|joint_jump| JUMP_OFFSETS.map(|x| left(joint_jump, x)));
        all.fold(1.0, f64::min)
    };
    let (mut best, mut best_merit) = ((0.0, 1.0, 1.0), 0.0);
    for first in JERK_FRACTIONS {
        for second in JERK_FRACTIONS {
            let jump = jump_share(first, second);
            let merit = jump * (first * second).sqrt();
            if merit > best_merit {
                (best, best_merit) = ((jump, first, second), merit);
            }
        }
    }
    // Without an admissible combination, the verification of the setpoints decides.
    if best_merit > 0.0 {
        let (jump, first, second) = best;
        if jump < 1.0 {
            junction.cap = speed * jump.sqrt();
        }
        earlier.jerk *= first;
        later.jerk *= second;
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
