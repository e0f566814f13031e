//! Random trajectory points with velocities and accelerations for cubic and quintic interpolation.

use super::shape::{MotionLimits, extent};
use crate::random::RandomSource;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Point of one axis: displacement, velocity, acceleration.
pub type CurvePoint = [f64; 3];

/// Largest velocity of a point, relative to the mean velocity of a segment.
const VELOCITY: f64 = 1.5;
/// Largest acceleration of a point, relative to the mean velocity of a segment per its duration.
const ACCELERATION: f64 = 4.0;

/// Draws points at `times` (ns, from 0), the first and the last at rest, whose polynomials of `degree` 3 or 5 stay
/// within `limits`.
pub fn points(
    random: &mut RandomSource,
    limits: &MotionLimits,
    times: &[Nanoseconds],
    degree: usize,
) -> Vec<CurvePoint> {
    let last = times.len() - 1;
    let mean = seconds(times[last]) / last as f64;
    let mut points: Vec<CurvePoint> = (0..times.len())
        .map(|k| {
            let index = if k == 0 { 0.0 } else { random.between(-1.0, 1.0) };
            if k == 0 || k == last {
                return [index, 0.0, 0.0];
            }
            let v = random.between(-VELOCITY, VELOCITY) / mean;
            let a =
                if degree == 5 { random.between(-ACCELERATION, ACCELERATION) / (mean * mean) } else { 0.0 };
            [index, v, a]
        })
        .collect();
    let (mut velocity, mut acceleration, mut span) = (0.0_f64, 0.0_f64, (0.0, 0.0));
    for (pair, times) in points.windows(2).zip(times.windows(2)) {
        let h = seconds(times[1] - times[0]);
        let polygon = control_polygon(&pair[0], &pair[1], h, degree);
        let (low, high) = extent(&polygon);
        span = (f64::min(span.0, low), f64::max(span.1, high));
        let v = derivative(&polygon, h);
        let a = derivative(&v, h);
        velocity = v.iter().fold(velocity, |most, v| most.max(v.abs()));
        acceleration = a.iter().fold(acceleration, |most, a| most.max(a.abs()));
    }
    let scale = limits.scale(velocity, acceleration, span.1 - span.0) * random.between(0.05, 1.0);
    points.iter_mut().flatten().for_each(|value| *value *= scale);
    points
}

/// Returns bounds (lower, upper) of the displacement of the polynomials through `points`.
pub fn hull(points: &[CurvePoint], times: &[Nanoseconds], degree: usize) -> (f64, f64) {
    let polygons = points.windows(2).zip(times.windows(2));
    polygons.fold((0.0, 0.0), |span: (f64, f64), (pair, times)| {
        let h = seconds(times[1] - times[0]);
        let (low, high) = extent(&control_polygon(&pair[0], &pair[1], h, degree));
        (span.0.min(low), span.1.max(high))
    })
}

/// Returns the Bézier control points of the polynomial between two points; it lies in their convex hull.
fn control_polygon(a: &CurvePoint, b: &CurvePoint, h: f64, degree: usize) -> Vec<f64> {
    if degree == 3 {
        return vec![a[0], a[0] + a[1] * h / 3.0, b[0] - b[1] * h / 3.0, b[0]];
    }
    let (along, back) = (a[1] * h / 5.0, b[1] * h / 5.0);
    let (a2, b2) = (a[2] * h * h / 20.0, b[2] * h * h / 20.0);
    vec![a[0], a[0] + along, a[0] + 2.0 * along + a2, b[0] - 2.0 * back + b2, b[0] - back, b[0]]
}

/// Returns the Bézier control points of the derivative.
fn derivative(polygon: &[f64], h: f64) -> Vec<f64> {
    let degree = (polygon.len() - 1) as f64;
    polygon.windows(2).map(|pair| degree * (pair[1] - pair[0]) / h).collect()
}
