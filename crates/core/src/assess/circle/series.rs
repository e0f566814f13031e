//! Series of points of a circle: scaling and bins of the polar angle without an arctangent for each point.

use std::f64::consts::{PI, TAU};

use super::BINS;
use crate::simd::{SliceOperation, vectorize};

/// Range of polar angles of a bin, as directions of its ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sector {
    pub bin: usize,
    from: [f64; 2],
    to: [f64; 2],
}

impl Sector {
    /// Sine of the angle from the ends within which the bin is not decided.
    const MARGIN: f64 = 1e-12;

    /// Returns the sector of a bin.
    pub fn of(bin: usize) -> Self {
        let direction = |bin: usize| {
            let (sine, cosine) = (bin as f64 / BINS as f64 * TAU - PI).sin_cos();
            [cosine, sine]
        };
        Sector { bin, from: direction(bin), to: direction(bin + 1) }
    }

    /// Returns true if the point lies clearly within the sector.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let margin = Self::MARGIN * (x.abs() + y.abs());
        let (after, before) = (self.from[0] * y - self.from[1] * x, x * self.to[1] - y * self.to[0]);
        // Both hold on the opposite side of a sector at most for the center.
        after > margin && before > margin
    }
}

/// Points in units of the radius about the nominal center, with their radial deviations in that unit and in m.
#[derive(Debug, Clone, Default)]
pub(super) struct ScaledPoints {
    pub points: Vec<[f64; 4]>,
}

impl ScaledPoints {
    /// Computes the points at `xs` and `ys`, m.
    pub fn compute(&mut self, xs: &[f64], ys: &[f64], center: [f64; 2], radius: f64) {
        self.points.resize(xs.len(), [0.0; 4]);
        vectorize(Scaling { xs, ys, center, radius, points: &mut self.points });
    }
}

/// Computation of [`ScaledPoints`].
struct Scaling<'a> {
    xs: &'a [f64],
    ys: &'a [f64],
    center: [f64; 2],
    radius: f64,
    points: &'a mut [[f64; 4]],
}

impl SliceOperation for Scaling<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for ((x, y), point) in self.xs.iter().zip(self.ys).zip(self.points) {
            let (x, y) = (x - self.center[0], y - self.center[1]);
            let deviation = (x * x + y * y).sqrt() - self.radius;
            *point = [x / self.radius, y / self.radius, deviation / self.radius, deviation];
        }
    }
}
