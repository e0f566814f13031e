//! Length of motions, and positions that contain the extreme ones of each axis.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use crate::motion::{Coordinates, MotionKind, ProgramMotion};

/// Number of intervals in which the joints of a curved motion are evaluated.
const SAMPLES: u32 = 32;

/// Returns the Euclidean norm of the distances along some axes, m or rad.
pub(super) fn norm(motion: &ProgramMotion, axes: Range<usize>) -> f64 {
    axes.map(|axis| (motion.end[axis] - motion.start[axis]).powi(2)).sum::<f64>().sqrt()
}

/// Returns the length of a motion along X, Y and Z, or U, V and W, m. Of a spline it is that of the control polygon.
pub(super) fn length(motion: &ProgramMotion) -> f64 {
    match &motion.kind {
        MotionKind::Arc(arc) => {
            let [first, second, normal] = arc.plane.axes();
            let radius = (motion.start[first] - arc.center[0]).hypot(motion.start[second] - arc.center[1]);
            (radius * arc.sweep).hypot(motion.end[normal] - motion.start[normal])
        }
        MotionKind::Nurbs(spline) => {
            let distance =
                |pair: &[([f64; 2], f64)]| (pair[1].0[0] - pair[0].0[0]).hypot(pair[1].0[1] - pair[0].0[1]);
            spline.control.windows(2).map(distance).sum()
        }
        _ => match norm(motion, 0..3) {
            0.0 => norm(motion, 6..9),
            length => length,
        },
    }
}

/// Returns positions of a motion that contain the extreme ones of each joint, with the end as the last: exact for lines and
/// arcs without tool center point control, samples otherwise.
pub(super) fn positions(motion: &ProgramMotion) -> Vec<Coordinates> {
    let mut fractions: Vec<f64> = match (&motion.kind, motion.tcp_length) {
        (_, Some(_)) => (0..SAMPLES).map(|step| f64::from(step) / f64::from(SAMPLES)).collect(),
        (MotionKind::Arc(arc), None) => {
            let [first, second, _] = arc.plane.axes();
            let from = (motion.start[second] - arc.center[1]).atan2(motion.start[first] - arc.center[0]);
            let first = if arc.sweep > 0.0 { (from / FRAC_PI_2).ceil() } else { (from / FRAC_PI_2).floor() };
            // One turn has all extreme points.
            let quadrants = (0..4).map(|step| (first + f64::from(step) * arc.sweep.signum()) * FRAC_PI_2);
            quadrants.map(|angle| (angle - from) / arc.sweep).filter(|fraction| *fraction < 1.0).collect()
        }
        (MotionKind::Nurbs(spline), None) => {
            let count = SAMPLES * spline.control.len() as u32;
            (0..count).map(|step| f64::from(step) / f64::from(count)).collect()
        }
        _ => Vec::new(),
    };
    fractions.push(1.0);
    fractions.into_iter().map(|fraction| at(motion, fraction)).collect()
}

/// Returns the position at a fraction of a motion.
fn at(motion: &ProgramMotion, fraction: f64) -> Coordinates {
    let mut position: Coordinates =
        std::array::from_fn(|axis| motion.start[axis] + fraction * (motion.end[axis] - motion.start[axis]));
    if let (MotionKind::Arc(arc), true) = (&motion.kind, fraction < 1.0) {
        let [first, second, _] = arc.plane.axes();
        let [x, y] = [motion.start[first] - arc.center[0], motion.start[second] - arc.center[1]];
        let (sin, cos) = (arc.sweep * fraction).sin_cos();
        position[first] = arc.center[0] + x * cos - y * sin;
        position[second] = arc.center[1] + x * sin + y * cos;
    }
    if let (MotionKind::Nurbs(spline), true) = (&motion.kind, fraction < 1.0) {
        let [first, second, _] = spline.plane.axes();
        [position[first], position[second]] = spline.point(fraction);
    }
    position
}
