//! Distance of setpoints from the programmed curves.

use virtual_axes_nc::motion::{MotionKind, ProgramMotion};

/// Largest distance in the file of the nearest motion from the present one.
const NEIGHBORS: usize = 400;

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Returns the point of a motion at the fraction `t` of its curve.
pub fn point(motion: &ProgramMotion, t: f64) -> [f64; 9] {
    let mut p: [f64; 9] = std::array::from_fn(|i| motion.start[i] + (motion.end[i] - motion.start[i]) * t);
    if let MotionKind::Arc(arc) = &motion.kind {
        let [x, y, _] = arc.plane.axes();
        let (dx, dy) = (motion.start[x] - arc.center[0], motion.start[y] - arc.center[1]);
        let (s, c) = (arc.sweep * t).sin_cos();
        p[x] = arc.center[0] + c * dx - s * dy;
        p[y] = arc.center[1] + s * dx + c * dy;
    }
    p
}

/// Returns the distance of `tip` from a motion at the local minimum near `t`, by Gauss-Newton steps.
fn distance_near(motion: &ProgramMotion, t: f64, tip: &[f64]) -> f64 {
    let mut t = t.clamp(0.0, 1.0);
    let mut nearest = distance(&point(motion, t)[..3], &tip[..3]);
    for _ in 0..6 {
        let h = 1e-6;
        let (here, ahead) = (point(motion, t), point(motion, t + h));
        let slope: [f64; 3] = std::array::from_fn(|i| (ahead[i] - here[i]) / h);
        let along: f64 = (0..3).map(|i| (tip[i] - here[i]) * slope[i]).sum();
        t = (t + along / slope.iter().map(|x| x * x).sum::<f64>()).clamp(0.0, 1.0);
        nearest = nearest.min(distance(&point(motion, t)[..3], &tip[..3]));
    }
    nearest
}

/// Returns the distance of `tip` from the curve of X, Y and Z of a motion.
pub fn to_motion(motion: &ProgramMotion, tip: &[f64]) -> f64 {
    match &motion.kind {
        MotionKind::Arc(arc) => {
            let [x, y, _] = arc.plane.axes();
            let angle = |p: &[f64]| (p[y] - arc.center[1]).atan2(p[x] - arc.center[0]);
            let turn = std::f64::consts::TAU;
            let from = angle(&motion.start);
            let by_angle = (-3..=3).map(|k| (angle(tip) - from + turn * f64::from(k)) / arc.sweep);
            let axial = arc.plane.axes()[2];
            let pitch = motion.end[axial] - motion.start[axial];
            let by_height = (pitch != 0.0).then(|| (tip[axial] - motion.start[axial]) / pitch);
            let nearest = by_angle.chain(by_height).map(|t| distance_near(motion, t, tip));
            nearest.fold(f64::INFINITY, f64::min)
        }
        _ => {
            let step: Vec<f64> = (0..3).map(|i| motion.end[i] - motion.start[i]).collect();
            let length2: f64 = step.iter().map(|x| x * x).sum();
            let along: f64 = (0..3).map(|i| (tip[i] - motion.start[i]) * step[i]).sum();
            let t = if length2 > 0.0 { (along / length2).clamp(0.0, 1.0) } else { 0.0 };
            distance(&point(motion, t)[..3], &tip[..3])
        }
    }
}

/// Returns the distance of `tip` from the programmed path near source line `line`.
pub fn to_program(motions: &[&ProgramMotion], line: usize, tip: &[f64]) -> f64 {
    let index = motions.partition_point(|motion| motion.line < line);
    let range = index.saturating_sub(NEIGHBORS)..(index + NEIGHBORS).min(motions.len());
    motions[range].iter().map(|motion| to_motion(motion, tip)).fold(f64::INFINITY, f64::min)
}
