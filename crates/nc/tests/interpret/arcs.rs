//! Arcs against their analytic geometry.

use proptest::prelude::*;
use virtual_axes_nc::interpret::InterpreterOptions;
use virtual_axes_nc::motion::{MotionKind, PlanarArc, Plane, ProgramMotion};

use crate::common::motions;

/// Largest error of a radius, of a center and of an arc length, m.
const TOLERANCE: f64 = 1e-9;

/// Returns the arc of the last motion of a program.
fn last_arc(text: &str) -> (ProgramMotion, PlanarArc) {
    let motion = motions(text, InterpreterOptions::default()).pop().expect("a motion");
    let MotionKind::Arc(arc) = motion.kind else { panic!("{motion:?}") };
    (motion, arc)
}

/// Letters of plane, first axis, second axis, their centers, and normal.
const PLANES: [(Plane, [&str; 6]); 3] = [
    (Plane::Xy, ["G17", "X", "Y", "I", "J", "Z"]),
    (Plane::Zx, ["G18", "Z", "X", "K", "I", "Y"]),
    (Plane::Yz, ["G19", "Y", "Z", "J", "K", "X"]),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn center_sweep_and_length_are_exact(
        plane in 0..3_usize,
        center in prop::array::uniform2(-500.0..500.0_f64),
        radius in 0.05..400.0_f64,
        from in -3.1..3.1_f64,
        angle in 0.01..6.27_f64,
        is_clockwise: bool,
        by_radius: bool,
        turns in 1..4_u32,
        depth in -20.0..20.0_f64,
    ) {
        let (plane, [code, x, y, i, j, z]) = PLANES[plane];
        let sweep = if is_clockwise { -angle } else { angle };
        let point = |angle: f64| [center[0] + radius * angle.cos(), center[1] + radius * angle.sin()];
        let (start, end) = (point(from), point(from + sweep));
        // The radius is ill-conditioned near half a turn: the center moves as the square root of its rounding.
        let by_radius = by_radius && (angle - std::f64::consts::PI).abs() > 0.5;
        let word = match by_radius {
            true => format!("R{:.12}", if angle > std::f64::consts::PI { -radius } else { radius }),
            false => format!("{i}{:.12} {j}{:.12}", center[0] - start[0], center[1] - start[1]),
        };
        let motion = if is_clockwise { "G2" } else { "G3" };
        let text = format!(
            "{code} F100 G0 {x}{:.12} {y}{:.12}\n{motion} {x}{:.12} {y}{:.12} {z}{depth:.12} {word} P{turns}\n",
            start[0], start[1], end[0], end[1],
        );
        let (motion, arc) = last_arc(&text);
        let [first, second, normal] = plane.axes();
        prop_assert_eq!(arc.plane, plane);
        for (found, expected) in [
            (arc.center[0], center[0]),
            (arc.center[1], center[1]),
            (motion.end[first], end[0]),
            (motion.end[second], end[1]),
            (motion.end[normal], depth),
            ((motion.start[first] - arc.center[0]).hypot(motion.start[second] - arc.center[1]), radius),
            ((motion.end[first] - arc.center[0]).hypot(motion.end[second] - arc.center[1]), radius),
        ] {
            prop_assert!((found - expected * 1e-3).abs() <= TOLERANCE, "{found} m, expected {expected} mm\n{text}");
        }
        let turned = sweep + f64::from(turns - 1) * std::f64::consts::TAU.copysign(sweep);
        prop_assert!(((arc.sweep - turned) * radius * 1e-3).abs() <= TOLERANCE, "{} rad\n{text}", arc.sweep);
    }
}

#[test]
fn a_full_circle_survives_the_rounding_of_offsets() {
    // 0.1 + 0.2 is not 0.3: start and end differ by the rounding of the offsets.
    let text = "G10 L2 P1 X0.1 Y0.7\nF100 G0 X0.2 Y0\nG10 L2 P1 X0 Y0\nG2 X0.3 Y0.7 I5\n";
    let (motion, arc) = last_arc(text);
    assert!((motion.end[0] - motion.start[0]).abs() < 1e-15);
    assert!((arc.sweep + std::f64::consts::TAU).abs() < 1e-12, "{}", arc.sweep);
}

#[test]
fn a_short_arc_of_a_large_radius_is_no_full_circle() {
    let (_, arc) = last_arc("F100\nG3 X0.01 Y0 R9000000\n");
    assert!((arc.sweep - 0.01 / 9e6).abs() < 1e-12, "{}", arc.sweep);
}
