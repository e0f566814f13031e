//! Feed limits from joint limits: speed, acceleration and jerk along a path that keep every joint within
//! its limits.

use super::derivatives::Derivatives;
use super::profile::FeedLimits;
use crate::config::LimitsConfig;

/// Unused fraction of a limit on curves: reserve for joint values between samples.
const MARGIN: f64 = 1e-3;
/// Candidate speeds, as fractions of the largest one.
const SPEED_FRACTIONS: [f64; 7] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.35];
/// Candidate accelerations, as fractions of the largest one at that speed.
const ACCELERATION_FRACTIONS: [f64; 4] = [1.0, 0.75, 0.5, 0.3];

/// Appends the magnitudes of the three derivatives of each joint at one sample.
pub(super) fn push_sample(derivatives: &Derivatives, rows: &mut Vec<[f64; 3]>) {
    let orders = derivatives.first.iter().zip(&derivatives.second).zip(&derivatives.third);
    rows.extend(orders.map(|((first, second), third)| [first.abs(), second.abs(), third.abs()]));
}

/// Returns the minimum over joints and samples of `bound`, a function of a joint's limits and derivatives.
fn min_bound(
    rows: &[[f64; 3]],
    joints: &[LimitsConfig],
    bound: impl Fn(&LimitsConfig, &[f64; 3]) -> f64,
) -> f64 {
    let bounds = rows.chunks_exact(joints.len()).flat_map(|row| joints.iter().zip(row));
    bounds.map(|(limits, row)| bound(limits, row)).fold(f64::INFINITY, f64::min)
}

/// Returns constant limits along an interval of a path such that, for each joint q of s,
///
/// ```text
/// |q'| v ≤ Vmax      |q'| a + |q''| v² ≤ Amax      |q'| j + 3 |q''| v a + |q'''| v³ ≤ Jmax
/// ```
///
/// On a straight line these are the largest limits. On a curve, speed, acceleration and jerk trade off; the
/// result is the candidate that passes `length` from rest to rest in the shortest time. `cap` contains
/// additional limits along the path.
pub(super) fn fastest_limits(
    rows: &[[f64; 3]],
    joints: &[LimitsConfig],
    cap: &FeedLimits,
    length: f64,
) -> FeedLimits {
    let speed = min_bound(rows, joints, |limits, row| limits.velocity / row[0]).min(cap.velocity);
    if rows.iter().all(|row| row[1] == 0.0 && row[2] == 0.0) {
        return FeedLimits {
            velocity: speed,
            acceleration: min_bound(rows, joints, |limits, row| limits.acceleration / row[0])
                .min(cap.acceleration),
            jerk: min_bound(rows, joints, |limits, row| limits.jerk / row[0]).min(cap.jerk),
        };
    }
    let usable = 1.0 - MARGIN;
    // Both roots are monotonic: the root of the minimum is the minimum of the roots.
    let by_acceleration = min_bound(rows, joints, |limits, row| usable * limits.acceleration / row[1]).sqrt();
    let by_jerk = min_bound(rows, joints, |limits, row| usable * limits.jerk / row[2]).cbrt();
    let speed = speed.min(by_acceleration).min(by_jerk);
    let mut best = (f64::INFINITY, FeedLimits { velocity: 0.0, acceleration: 0.0, jerk: 0.0 });
    for part in SPEED_FRACTIONS {
        let v = part * speed;
        // Acceleration left by Amax, and by Jmax while the acceleration is constant.
        let max_acceleration = min_bound(rows, joints, |limits, row| {
            let by_acceleration = (usable * limits.acceleration - row[1] * v * v) / row[0];
            let by_jerk = (usable * limits.jerk - row[2] * v * v * v) / (3.0 * row[1] * v);
            by_acceleration.min(by_jerk)
        });
        for part in ACCELERATION_FRACTIONS {
            let acceleration = part * max_acceleration.min(cap.acceleration);
            // Without the time for changes of the acceleration. The comparison skips NaN too.
            let least_time = length / v + v / acceleration;
            if !(acceleration > 0.0 && least_time < best.0) {
                continue;
            }
            let jerk = min_bound(rows, joints, |limits, row| {
                (usable * limits.jerk - 3.0 * row[1] * v * acceleration - row[2] * v * v * v) / row[0]
            });
            let jerk = jerk.min(cap.jerk);
            let time = least_time + acceleration / jerk;
            if jerk > 0.0 && time < best.0 {
                best = (time, FeedLimits { velocity: v, acceleration, jerk });
            }
        }
    }
    best.1
}
