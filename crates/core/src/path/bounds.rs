//! Speed, acceleration and jerk along a path that keep every joint within its limits.

use super::block::Derivatives;
use super::profile::Limits;
use crate::config::LimitsConfig;

/// Part of a limit that curves do not use: between two samples a joint may ask for that much more.
const MARGIN: f64 = 1e-3;
/// Speeds that are tried, as parts of the largest one.
const SPEED_PARTS: [f64; 7] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.35];
/// Accelerations that are tried, as parts of what the speed leaves.
const ACCELERATION_PARTS: [f64; 4] = [1.0, 0.75, 0.5, 0.3];

/// Magnitudes of the three derivatives of each joint, sample after sample.
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    rows: Vec<[f64; 3]>,
}

impl Samples {
    pub fn push(&mut self, derivatives: &Derivatives) {
        let orders = derivatives.first.iter().zip(&derivatives.second).zip(&derivatives.third);
        self.rows.extend(orders.map(|((first, second), third)| [first.abs(), second.abs(), third.abs()]));
    }

    /// Samples `from` to `to`, the latter excluded.
    pub fn range(&self, from: usize, to: usize, joints: usize) -> &[[f64; 3]] {
        &self.rows[from * joints..to * joints]
    }

    pub fn all(&self) -> &[[f64; 3]] {
        &self.rows
    }
}

/// min over joints and samples of what `bound` says of a joint's limits and derivatives.
fn smallest(
    rows: &[[f64; 3]],
    joints: &[LimitsConfig],
    bound: impl Fn(&LimitsConfig, &[f64; 3]) -> f64,
) -> f64 {
    let bounds = rows.chunks_exact(joints.len()).flat_map(|row| joints.iter().zip(row));
    bounds.map(|(limits, row)| bound(limits, row)).fold(f64::INFINITY, f64::min)
}

/// Constant limits along a stretch of path such that, for each joint q of s,
///
/// ```text
/// |q'| v ≤ Vmax      |q'| a + |q''| v² ≤ Amax      |q'| j + 3 |q''| v a + |q'''| v³ ≤ Jmax
/// ```
///
/// On a straight line these are the largest there are. On a curve speed, acceleration and jerk are at
/// the expense of each other; taken is what would pass `length` from rest to rest the fastest.
/// `cap` holds what else limits them.
pub(super) fn fastest(rows: &[[f64; 3]], joints: &[LimitsConfig], cap: &Limits, length: f64) -> Limits {
    let speed = smallest(rows, joints, |limits, row| limits.velocity / row[0]).min(cap.velocity);
    if rows.iter().all(|row| row[1] == 0.0 && row[2] == 0.0) {
        return Limits {
            velocity: speed,
            acceleration: smallest(rows, joints, |limits, row| limits.acceleration / row[0])
                .min(cap.acceleration),
            jerk: smallest(rows, joints, |limits, row| limits.jerk / row[0]).min(cap.jerk),
        };
    }
    let use_of = 1.0 - MARGIN;
    let bent = smallest(rows, joints, |limits, row| {
        (use_of * limits.acceleration / row[1]).sqrt().min((use_of * limits.jerk / row[2]).cbrt())
    });
    let speed = speed.min(bent);
    let mut best = (f64::INFINITY, Limits { velocity: 0.0, acceleration: 0.0, jerk: 0.0 });
    for part in SPEED_PARTS {
        let v = part * speed;
        // What is left of Amax, and of Jmax while the acceleration is constant.
        let free = smallest(rows, joints, |limits, row| {
            let by_acceleration = (use_of * limits.acceleration - row[1] * v * v) / row[0];
            let by_jerk = (use_of * limits.jerk - row[2] * v * v * v) / (3.0 * row[1] * v);
            by_acceleration.min(by_jerk)
        });
        for part in ACCELERATION_PARTS {
            let acceleration = part * free.min(cap.acceleration);
            let jerk = smallest(rows, joints, |limits, row| {
                (use_of * limits.jerk - 3.0 * row[1] * v * acceleration - row[2] * v * v * v) / row[0]
            });
            let jerk = jerk.min(cap.jerk);
            let time = length / v + v / acceleration + acceleration / jerk;
            if acceleration > 0.0 && jerk > 0.0 && time < best.0 {
                best = (time, Limits { velocity: v, acceleration, jerk });
            }
        }
    }
    best.1
}
