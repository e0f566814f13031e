//! Cylindrical and polar coordinate interpolation of Fanuc: paths in their planes, and the time of the programmed feed.

use std::f64::consts::{FRAC_PI_2, PI};

use virtual_axes_nc::interpret::{Dialect, InterpreterOptions};
use virtual_axes_nc::motion::{Feed, MotionKind, ProgramMotion};

use crate::common::motions;

/// Largest distance of a chord from the path, m.
const CHORD_ERROR: f64 = 0.21e-6;

fn run(text: &str) -> Vec<ProgramMotion> {
    motions(text, InterpreterOptions { dialect: Some(Dialect::Fanuc), ..InterpreterOptions::default() })
}

/// Returns the motions of a line of the program.
fn of_line(motions: &[ProgramMotion], line: usize) -> Vec<&ProgramMotion> {
    let found: Vec<_> = motions.iter().filter(|motion| motion.line == line).collect();
    assert!(found.iter().all(|motion| motion.kind == MotionKind::Line), "{found:?}");
    found
}

/// Returns the duration of motions, s.
fn time(motions: &[&ProgramMotion]) -> f64 {
    let duration = |motion: &&ProgramMotion| match motion.feed {
        Feed::Duration(time) => time,
        feed => panic!("{feed:?}"),
    };
    motions.iter().map(duration).sum()
}

/// Returns points along motions whose axes move in proportion: a coordinate and the angle of the rotary axis.
fn points(motions: &[&ProgramMotion], [linear, rotary]: [usize; 2]) -> Vec<[f64; 2]> {
    let at = |motion: &ProgramMotion, share: f64, axis: usize| {
        motion.start[axis] + share * (motion.end[axis] - motion.start[axis])
    };
    motions
        .iter()
        .flat_map(|motion| {
            [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| [at(motion, share, linear), at(motion, share, rotary)])
        })
        .collect()
}

fn plane([radius, angle]: [f64; 2]) -> [f64; 2] {
    [radius * angle.cos(), radius * angle.sin()]
}

/// A square with a corner radius about C: two lines and a quarter circle.
#[test]
fn polar_paths_are_lines_and_circles_in_the_plane_of_the_table() {
    let motions = run(
        "O1\nG21 G90 G0 X20. C0 Z1.\nG12.1\nG1 C10. F600.\nG3 X10. C20. I-10. J0\nG1 X-20.\nG13.1\nG0 C0\nM30\n",
    );
    let [up, arc, back] = [4, 5, 6].map(|line| of_line(&motions, line));
    for [x, _] in points(&up, [0, 5]).into_iter().map(plane) {
        assert!((x - 0.02).abs() < CHORD_ERROR, "{x}");
    }
    for [x, y] in points(&arc, [0, 5]).into_iter().map(plane) {
        assert!(((x - 0.01).hypot(y - 0.01) - 0.01).abs() < CHORD_ERROR, "{x} {y}");
    }
    for [_, y] in points(&back, [0, 5]).into_iter().map(plane) {
        assert!((y - 0.02).abs() < CHORD_ERROR, "{y}");
    }
    // 10 mm/s along 10 mm, a quarter of 20 pi mm, and 30 mm.
    for (motions, expected) in [(&up, 1.0), (&arc, FRAC_PI_2), (&back, 3.0)] {
        assert!((time(motions) - expected).abs() < 1e-9, "{}", time(motions));
    }
    // (-20, 20) is at 135° and hypot(20, 20).
    let end = back.last().expect("a motion").end;
    assert!((end[0] - 0.02 * 2_f64.sqrt()).abs() < 1e-12 && (end[5] - 0.75 * PI).abs() < 1e-12, "{end:?}");
    // C continues over half a turn, so that the last motion turns it back.
    assert_eq!(motions.last().expect("a motion").end[5], 0.0);
}

#[test]
fn arcs_on_a_cylinder_are_circles_of_its_unrolled_surface() {
    // Radius 20 mm: 90° are 10 pi mm. A circle of 5 mm about (X10, A0).
    let motions =
        run("O1\nG21 G90 G17 G0 X15. A0\nG7.1 A20.\nG3 X15. A0 I-5. J0 F300.\nG2 X5. I-5.\nG7.1 A0\nM30\n");
    let [circle, half] = [4, 5].map(|line| of_line(&motions, line));
    for [x, angle] in points(&circle, [0, 3]).into_iter().chain(points(&half, [0, 3])) {
        assert!(((x - 0.01).hypot(0.02 * angle) - 0.005).abs() < CHORD_ERROR, "{x} {angle}");
    }
    // The circle is counterclockwise from X to A; the half circle runs below.
    assert!(circle[0].end[3] > 0.0 && half[0].end[3] < 0.0);
    // 5 mm/s along 10 pi and 5 pi mm.
    for (motions, expected) in [(&circle, 2.0 * PI), (&half, PI)] {
        assert!((time(motions) - expected).abs() < 1e-9, "{}", time(motions));
    }
}
