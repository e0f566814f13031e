//! Native programs of Sinumerik: expected values are closed forms of the programming guide.

mod cycles;
mod flow;
mod motions;
pub mod orientation;
mod posts;
mod properties;
mod rejections;
mod subprograms;

use virtual_axes_nc::interpret::{Dialect, InterpreterOptions};
use virtual_axes_nc::motion::{MotionKind, ProgramMotion};

use crate::common::motions;

/// Largest error of a coordinate, mm.
const TOLERANCE: f64 = 1e-9;

/// Returns the options of a machine with nine axes, without offsets.
fn options() -> InterpreterOptions {
    InterpreterOptions { dialect: Some(Dialect::Sinumerik), ..InterpreterOptions::default() }
}

/// Returns the motions of a program.
fn path(text: &str) -> Vec<ProgramMotion> {
    motions(text, options())
}

/// Returns the ends of the motions of a program, mm.
fn ends(text: &str) -> Vec<[f64; 3]> {
    path(text).iter().map(|motion| [0, 1, 2].map(|axis| motion.end[axis] * 1e3)).collect()
}

/// Returns the coordinates X at the ends of the motions, mm, rounded to a nanometer.
fn x_ends(text: &str) -> Vec<f64> {
    ends(text).iter().map(|end| (end[0] * 1e6).round() / 1e6).collect()
}

fn assert_ends(text: &str, expected: &[[f64; 3]]) {
    let found = ends(text);
    assert_eq!(found.len(), expected.len(), "{text}: {found:?}");
    for (found, expected) in found.iter().zip(expected) {
        let is_close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < TOLERANCE);
        assert!(is_close, "{text}: {found:?}, expected {expected:?}");
    }
}

/// Asserts center, mm, and sweep, degrees, of the arc that a motion is.
fn assert_arc(motion: &ProgramMotion, center: [f64; 2], sweep: f64) {
    let MotionKind::Arc(arc) = &motion.kind else { panic!("{motion:?}") };
    let found = arc.center.map(|value| value * 1e3);
    assert!(
        (found[0] - center[0]).abs() < TOLERANCE && (found[1] - center[1]).abs() < TOLERANCE,
        "{found:?}"
    );
    assert!((arc.sweep.to_degrees() - sweep).abs() < 1e-9, "{}", arc.sweep.to_degrees());
}
