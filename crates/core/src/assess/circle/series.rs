//! Sums over points of a circle in lanes, and bins of the polar angle.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::simd::LANES;

/// Number of bins of the polar angle: a tenth of a degree each.
pub(super) const BINS: usize = 3600;

/// Number of sums of a [`LaneSums`].
const TERMS: usize = 10;

/// Sums over points, one part per lane: that of a point is its number modulo [`LANES`], so that the sums do not depend on
/// how the points are divided into series.
#[derive(Debug, Clone, Default)]
pub(super) struct LaneSums {
    pub count: usize,
    /// Number, modulo [`LANES`], of the points of the first part.
    first: usize,
    pub parts: [[f64; LANES]; TERMS],
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
    pub fn align(&mut self) {
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
pub(super) fn terms(u: f64, v: f64, deviation: f64) -> [f64; TERMS] {
    // (r² − 1)/2 without cancellation.
    let q = deviation + deviation * deviation / 2.0;
    [u * u, u * v, v * v, u, v, u * q, v * q, q, q * q, deviation]
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

/// Returns the bin of the polar angle of a point relative to the nominal center.
pub(super) fn bin_of(x: f64, y: f64) -> usize {
    // The conversion to an index truncates; the angle π belongs to the last bin.
    let bin = ((y.atan2(x) + PI) / TAU * BINS as f64) as usize;
    bin.min(BINS - 1)
}

/// Sums over points (u, v), in units of the radius about the nominal center.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    pub count: f64,
    /// Sums of u², u v and v².
    pub products: Vector3<f64>,
    /// Sums of u and v.
    pub first: Vector2<f64>,
    /// Sum of (u, v, 1) q.
    pub right: Vector3<f64>,
    /// Sum of q².
    pub square: f64,
    /// Sum of the radial deviation.
    pub deviation: f64,
}

impl Sums {
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            products: self.products + other.products,
            first: self.first + other.first,
            right: self.right + other.right,
            square: self.square + other.square,
            deviation: self.deviation + other.deviation,
        }
    }

    /// Returns the sum of (u, v, 1)(u, v, 1)ᵀ.
    pub fn normal(&self) -> Matrix3<f64> {
        let ([uu, uv, vv], [u, v]) = (self.products.into(), self.first.into());
        Matrix3::new(uu, uv, u, uv, vv, v, u, v, self.count)
    }

    /// Returns the sums divided by the number of points, `None` without a point.
    pub fn means(&self) -> Option<Self> {
        let n = self.count;
        (n > 0.0).then(|| Self {
            count: 1.0,
            products: self.products / n,
            first: self.first / n,
            right: self.right / n,
            square: self.square / n,
            deviation: self.deviation / n,
        })
    }
}
