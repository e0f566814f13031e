//! Where two blocks meet: how fast it may be passed.

use super::block::Derivatives;
use crate::config::LimitsConfig;

/// Largest turn of the direction that still counts as tangent, rad, with speeds measured in Vmax: more
/// than coordinates rounded to a micrometre make of an arc of a centimetre.
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
    /// Whether set-points jump in their speed there, as permitted.
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
    /// sampled set-points it is a jerk over a period. Where the direction turns, `corner` is the
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
