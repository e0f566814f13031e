//! Sums, extremes and bins over series of points of a circle, in groups of as many points as a vector has lanes.

use std::f64::consts::{PI, TAU};

use super::{BINS, CircleAssessor, Sums, bin_of};
use crate::simd::{LANES, SliceOperation};

/// Number of sums of a [`LaneSums`].
const TERMS: usize = 10;

/// Sums over points, one part per lane: that of a point is its number modulo [`LANES`], so that the sums do not depend on
/// how the points are divided into series.
#[derive(Debug, Clone, Default)]
pub(super) struct LaneSums {
    count: usize,
    /// Number, modulo [`LANES`], of the points of the first part.
    first: usize,
    parts: [[f64; LANES]; TERMS],
}

impl LaneSums {
    /// Adds a point (u, v) with its radial deviation, in units of the radius.
    pub fn add(&mut self, u: f64, v: f64, deviation: f64) {
        let part = self.next_part();
        for (sum, term) in self.parts.iter_mut().zip(terms(u, v, deviation)) {
            sum[part] += term;
        }
        self.count += 1;
    }

    fn next_part(&self) -> usize {
        (self.count - self.first) % LANES
    }

    /// Rotates the parts so that the next point belongs to the first of them.
    fn align(&mut self) {
        let part = self.next_part();
        if part != 0 {
            self.parts.iter_mut().for_each(|sum| sum.rotate_left(part));
            self.first = self.count % LANES;
        }
    }

    /// Returns the sums over all parts.
    pub fn total(&self) -> Sums {
        let [uu, uv, vv, u, v, uq, vq, q, square, deviation] = self.parts.map(|mut sum| {
            sum.rotate_right(self.first);
            sum.into_iter().sum::<f64>()
        });
        Sums {
            count: self.count as f64,
            products: [uu, uv, vv].into(),
            first: [u, v].into(),
            right: [uq, vq, q].into(),
            square,
            deviation,
        }
    }
}

/// Returns the terms of the sums of a point.
#[inline(always)]
fn terms(u: f64, v: f64, deviation: f64) -> [f64; TERMS] {
    // (r² − 1)/2 without cancellation.
    let q = deviation + deviation * deviation / 2.0;
    [u * u, u * v, v * v, u, v, u * q, v * q, q, q * q, deviation]
}

/// Addition of whole groups of points of a circle.
pub(super) struct GroupAddition<'a> {
    pub assessor: &'a mut CircleAssessor,
    pub xs: &'a [[f64; LANES]],
    pub ys: &'a [[f64; LANES]],
}

impl SliceOperation for GroupAddition<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let GroupAddition { assessor, xs, ys } = self;
        let ([center_x, center_y], radius) = (assessor.center, assessor.radius);
        assessor.sums.align();
        let (mut sums, mut sector) = (assessor.sums.parts, assessor.sector);
        let [mut least, mut largest] = assessor.range.map(|value| [value; LANES]);
        for (x, y) in xs.iter().zip(ys) {
            let (mut x, mut y, mut deviations) = (*x, *y, [0.0; LANES]);
            for k in 0..LANES {
                (x[k], y[k]) = (x[k] - center_x, y[k] - center_y);
                deviations[k] = (x[k] * x[k] + y[k] * y[k]).sqrt() - radius;
                let terms = terms(x[k] / radius, y[k] / radius, deviations[k] / radius);
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[k] += term;
                }
                least[k] = if deviations[k] < least[k] { deviations[k] } else { least[k] };
                largest[k] = if deviations[k] > largest[k] { deviations[k] } else { largest[k] };
            }
            for k in 0..LANES {
                if !sector.contains(x[k], y[k]) {
                    sector = sector.of_next_point(x[k], y[k]);
                }
                assessor.bins[sector.bin].add([x[k], y[k]], deviations[k]);
            }
        }
        assessor.sums.parts = sums;
        assessor.sums.count += xs.len().min(ys.len()) * LANES;
        assessor.sector = sector;
        let of_all = |lanes: [f64; LANES], pick: fn(f64, f64) -> f64| lanes.into_iter().fold(lanes[0], pick);
        assessor.range = [of_all(least, f64::min), of_all(largest, f64::max)];
    }
}

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
        Sector { bin, from: direction(bin), to: direction(bin + 1) }
    }

    /// Returns true if the point lies clearly within the sector.
    #[inline(always)]
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let margin = Self::MARGIN * (x.abs() + y.abs());
        let (after, before) = (self.from[0] * y - self.from[1] * x, x * self.to[1] - y * self.to[0]);
        // Both hold on the opposite side of a sector at most for the center.
        after > margin && before > margin
    }

    /// Returns the sector of a point that this one does not contain; that of a neighbor needs no arctangent.
    pub fn of_next_point(&self, x: f64, y: f64) -> Self {
        let (bin, from, to) = (self.bin, self.from, self.to);
        let is_after = y * to[0] - x * to[1] > 0.0;
        let neighbor = if is_after {
            Sector { bin: bin + 1, from: to, to: direction(bin + 2) }
        } else {
            let bin = bin.saturating_sub(1);
            Sector { bin, from: direction(bin), to: from }
        };
        if neighbor.bin < BINS && neighbor.contains(x, y) { neighbor } else { Sector::of(bin_of(x, y)) }
    }
}

/// Returns the direction of the start of a bin.
fn direction(bin: usize) -> [f64; 2] {
    let (sine, cosine) = (bin as f64 / BINS as f64 * TAU - PI).sin_cos();
    [cosine, sine]
}
