//! Corners that the lines beside them bound, and not the tolerance of blending.

use std::array;

use virtual_axes_core::units::MILLIMETER;

use super::extent::norm;
use crate::motion::{Blend, MotionKind, PathControl, ProgramMotion};
use crate::plan::bounded_corner;

/// Least tolerance that is compared with the lines beside a corner, m: that of G64 without P.
const LEAST_TOLERANCE: f64 = 20e-6;
/// Least turn of a corner, as the norm of the difference of the directions: 10°.
const LEAST_TURN: f64 = 0.174;

/// Corners of lines at feed that are passed nearer than the tolerance of G64 P, since a line beside them is short.
#[derive(Debug, Clone, Default)]
pub struct BoundedCorners {
    /// First source line, from 1.
    first_line: usize,
    count: usize,
    /// Largest distance at which one of them is passed, m.
    largest: f64,
    /// Direction, length and tolerance of the line before.
    before: Option<([f64; 3], f64, f64)>,
}

impl BoundedCorners {
    /// Adds the motion after those before.
    pub(super) fn add(&mut self, motion: &ProgramMotion) {
        let tolerance = match motion.path_control {
            PathControl::Blend(Blend { tolerance, .. }) => tolerance.filter(|it| *it > LEAST_TOLERANCE),
            _ => None,
        };
        let length = norm(motion, 0..3);
        let is_line = motion.kind == MotionKind::Line && motion.tcp_length.is_none() && length > 0.0;
        let Some(tolerance) = tolerance.filter(|_| is_line) else {
            self.before = None;
            return;
        };
        let direction: [f64; 3] = array::from_fn(|axis| (motion.end[axis] - motion.start[axis]) / length);
        if let Some((other, other_length, other_tolerance)) =
            self.before.replace((direction, length, tolerance))
        {
            let turn = (0..3).map(|axis| (direction[axis] - other[axis]).powi(2)).sum::<f64>().sqrt();
            let bound = bounded_corner(tolerance.min(other_tolerance), turn, length.min(other_length));
            if let Some(distance) = bound.filter(|_| turn > LEAST_TURN) {
                self.first_line = if self.count == 0 { motion.line } else { self.first_line };
                self.count += 1;
                self.largest = self.largest.max(distance);
            }
        }
    }

    /// Returns the note with its line, if the program has such corners.
    pub(super) fn note(&self) -> Option<(usize, String)> {
        let text = format!(
            "G64 P: {} corners are passed nearer than P, at most {:.3} mm away: the lines beside them are too short",
            self.count,
            self.largest / MILLIMETER
        );
        (self.count > 0).then_some((self.first_line, text))
    }
}
