//! Circularity after ISO 230-4 of simulated points.

use crate::simd::{LANES, SliceOperation, vectorize};

mod series;

use series::{BINS, LaneSums, Sector, Sums, terms};

/// Number of sectors, each of which contains a point in a full circle.
const SECTORS: usize = 36;
/// Bins on each side of a reversal point in which its spike is sought: 20 degrees.
const SPIKE_BINS: usize = 200;

/// Accumulator of the points of a circular path in one direction; its memory is constant (200 kB).
///
/// For a circular path with a nominal center and radius R, positive is outside:
///
/// - radial deviation F: distance of a point from the nominal center minus R; reported are its mean,
///   smallest and largest value. (The standard also permits the least-squares center. A simulation knows
///   its center.)
/// - circular deviation G: radial separation of two concentric circles that enclose the path, evaluated as
///   the range of the radius about the center of the least-squares circle. It contains no error of the
///   radius or the center.
/// - bi-directional circular deviation G(b): G of two paths together, one clockwise, one counterclockwise.
/// - mean bi-directional radial deviation D: radius of the least-squares circle of both paths minus R.
///
/// # Least squares
///
/// The circle is that of Kåsa: it minimizes the sum of (d² − ρ²)², where d is the distance of a point from
/// the unknown center and ρ is the unknown radius. With coordinates in units of R about the nominal center
/// and q = (u² + v² − 1)/2 the problem is linear,
///
/// ```text
/// q = eₓ u + e_y v + k        ρ² = 1 + 2 k + eₓ² + e_y²
/// ```
///
/// and needs running sums only. For points of a true circle it is exact for any center offset. For a form
/// error f, its center differs from the one that minimizes the sum of (d − ρ)² by less than f²/R (17 nm for
/// f = 50 µm, R = 150 mm). Its radius is a root mean square; it is corrected to the mean distance by the
/// variance of the residuals, exact to f³/R².
///
/// # Second pass in constant memory
///
/// G needs the extremes about a center that is known at the end only. The polar angle is divided into 3600
/// bins; each keeps its innermost and its outermost point relative to the nominal center. The distances of
/// these points from the least-squares center are exact. Inside a bin of width w the offset e of that
/// center shifts two points by amounts that differ by less than |e| w, so G is never too large, and too
/// small by less than 2 |e| w (35 nm for e = 10 µm; for a smooth path far less, since it is flat at its
/// extremes).
#[derive(Debug, Clone)]
pub struct CircleAssessor {
    center: [f64; 2],
    radius: f64,
    sums: LaneSums,
    /// Least and largest radial deviation, m.
    range: [f64; 2],
    bins: Box<[Bin]>,
    /// Bin of the last point.
    sector: Sector,
}

/// Figures of a circular path in one direction, m; see [`CircleAssessor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CircleReport {
    /// Mean radial deviation, m.
    pub mean: f64,
    /// Smallest radial deviation Fmin, m.
    pub min: f64,
    /// Largest radial deviation Fmax, m.
    pub max: f64,
    /// Figures of a full circle; `None` for an arc, whose points do not determine its center well.
    pub full: Option<FullCircle>,
}

/// Figures of a full circle, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullCircle {
    /// Circular deviation G: range of the radius about the center of the least-squares circle, m.
    pub circular_deviation: f64,
    /// Center of the least-squares circle relative to the nominal center, m.
    pub center: [f64; 2],
    /// Radius of the least-squares circle minus the nominal radius, m.
    pub radius_deviation: f64,
    /// Reversal spikes where an axis reverses, at the polar angles 0, 90, 180 and 270 degrees, m: within 20 degrees of
    /// the reversal, the radial deviation that differs most from the mean one, minus the mean one.
    pub reversal_spikes: [f64; 4],
}

/// Figures of a full circle in both directions, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BidirectionalReport {
    /// Bi-directional circular deviation G(b), m.
    pub circular_deviation: f64,
    /// Mean bi-directional radial deviation D, m, positive outside.
    pub mean_radial_deviation: f64,
}

impl CircleAssessor {
    /// Creates an empty assessor of a circle with nominal `center` and `radius`, m; the radius is positive.
    pub fn new(center: [f64; 2], radius: f64) -> Self {
        debug_assert!(radius > 0.0, "a circle has a radius");
        Self {
            center,
            radius,
            sums: LaneSums::default(),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            bins: vec![Bin::EMPTY; BINS].into_boxed_slice(),
            sector: Sector::of(0),
        }
    }

    /// Returns the nominal center, m.
    pub fn center(&self) -> [f64; 2] {
        self.center
    }

    /// Returns the nominal radius, m.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Adds a point of the path, m; returns its radial deviation, m, positive outside.
    pub fn push(&mut self, x: f64, y: f64) -> f64 {
        let (x, y) = (x - self.center[0], y - self.center[1]);
        let deviation = (x * x + y * y).sqrt() - self.radius;
        self.sums.add(x / self.radius, y / self.radius, deviation / self.radius);
        self.range = [self.range[0].min(deviation), self.range[1].max(deviation)];
        if !self.sector.contains(x, y) {
            self.sector = self.sector.of_next_point(x, y);
        }
        self.bins[self.sector.bin].add([x, y], deviation);
        deviation
    }

    /// Adds points of the path, m, as [`push`](Self::push) does one by one, bit by bit.
    pub fn push_all(&mut self, xs: &[f64], ys: &[f64]) {
        let count = xs.len().min(ys.len());
        let (xs, xs_after) = xs[..count].as_chunks::<LANES>();
        let (ys, ys_after) = ys[..count].as_chunks::<LANES>();
        vectorize(GroupAddition { assessor: &mut *self, xs, ys });
        xs_after.iter().zip(ys_after).for_each(|(x, y)| _ = self.push(*x, *y));
    }

    /// Returns the figures so far, `None` without a point.
    pub fn report(&self) -> Option<CircleReport> {
        let sums = self.sums.total().means()?;
        let mean = sums.deviation * self.radius;
        let full = self.is_full().then(|| Fit::new(&sums)).flatten().map(|fit| {
            let center = fit.center.map(|offset| offset * self.radius);
            FullCircle {
                circular_deviation: self.range_about(center).width(),
                center,
                radius_deviation: fit.radius_deviation * self.radius,
                reversal_spikes: self.reversal_spikes(mean),
            }
        });
        let [min, max] = self.range;
        Some(CircleReport { mean, min, max, full })
    }

    /// Returns the reversal spikes relative to a mean radial deviation, m.
    fn reversal_spikes(&self, mean: f64) -> [f64; 4] {
        // The first bin begins at −π.
        [BINS / 2, BINS / 4 * 3, 0, BINS / 4].map(|reversal| {
            let bins = self.bins.iter().cycle().skip(BINS + reversal - SPIKE_BINS).take(2 * SPIKE_BINS);
            let spikes = bins.flat_map(Bin::points).map(|point| point.deviation - mean);
            spikes.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
        })
    }

    /// Returns true if every sector contains a point.
    fn is_full(&self) -> bool {
        self.bins.chunks(BINS / SECTORS).all(|sector| sector.iter().any(|bin| !bin.is_empty()))
    }

    /// Returns the smallest and largest distance from `center`, which is relative to the nominal center.
    fn range_about(&self, [x, y]: [f64; 2]) -> Range {
        let points = self.bins.iter().flat_map(Bin::points);
        points.fold(Range::EMPTY, |range, point| range.with((point.offset[0] - x).hypot(point.offset[1] - y)))
    }
}

/// Returns the figures of a circle in both directions, each with the same weight whatever its number of
/// points.
///
/// Returns `None` unless both paths are full circles about the same nominal center with the same radius.
pub fn bidirectional(
    clockwise: &CircleAssessor,
    counterclockwise: &CircleAssessor,
) -> Option<BidirectionalReport> {
    let paths = [clockwise, counterclockwise];
    let same = clockwise.center == counterclockwise.center && clockwise.radius == counterclockwise.radius;
    if !same || !paths.iter().all(|path| path.is_full()) {
        return None;
    }
    let fit =
        Fit::new(&clockwise.sums.total().means()?.plus(&counterclockwise.sums.total().means()?).means()?)?;
    let center = fit.center.map(|offset| offset * clockwise.radius);
    let range = paths.map(|path| path.range_about(center));
    Some(BidirectionalReport {
        circular_deviation: range[0].with(range[1].min).with(range[1].max).width(),
        mean_radial_deviation: fit.radius_deviation * clockwise.radius,
    })
}

/// A point relative to the nominal center, m.
#[derive(Debug, Clone, Copy)]
struct PathPoint {
    offset: [f64; 2],
    deviation: f64,
}

/// Addition of whole groups of points of a circle.
struct GroupAddition<'a> {
    assessor: &'a mut CircleAssessor,
    xs: &'a [[f64; LANES]],
    ys: &'a [[f64; LANES]],
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

/// Innermost and outermost point of a bin.
#[derive(Debug, Clone, Copy)]
struct Bin {
    inner: PathPoint,
    outer: PathPoint,
}

impl Bin {
    const EMPTY: Self = Bin {
        inner: PathPoint { offset: [0.0; 2], deviation: f64::INFINITY },
        outer: PathPoint { offset: [0.0; 2], deviation: f64::NEG_INFINITY },
    };

    fn is_empty(&self) -> bool {
        self.inner.deviation > self.outer.deviation
    }

    /// Returns the two points; none of an empty bin.
    fn points(&self) -> impl Iterator<Item = &PathPoint> {
        [&self.inner, &self.outer].into_iter().filter(|_| !self.is_empty())
    }

    #[inline(always)]
    fn add(&mut self, offset: [f64; 2], deviation: f64) {
        let point = PathPoint { offset, deviation };
        if deviation < self.inner.deviation {
            self.inner = point;
        }
        if deviation > self.outer.deviation {
            self.outer = point;
        }
    }
}

/// Smallest and largest value.
#[derive(Debug, Clone, Copy)]
struct Range {
    min: f64,
    max: f64,
}

impl Range {
    const EMPTY: Self = Self { min: f64::INFINITY, max: f64::NEG_INFINITY };

    fn with(self, value: f64) -> Self {
        Self { min: self.min.min(value), max: self.max.max(value) }
    }

    fn width(self) -> f64 {
        self.max - self.min
    }
}

/// Least-squares circle, in units of the nominal radius.
struct Fit {
    center: [f64; 2],
    radius_deviation: f64,
}

impl Fit {
    fn new(means: &Sums) -> Option<Self> {
        let solution = means.normal().cholesky()?.solve(&means.right);
        let [x, y, k] = solution.into();
        // ρ² − 1, and ρ − 1 without cancellation.
        let excess = 2.0 * k + x * x + y * y;
        let radius = (1.0 + excess).sqrt();
        let variance = (means.square - solution.dot(&means.right)).max(0.0);
        // d² = ρ² + 2 ε results in a mean d of ρ − ⟨ε²⟩/(2 ρ³).
        let radius_deviation = excess / (radius + 1.0) - variance / (2.0 * radius.powi(3));
        radius_deviation.is_finite().then_some(Self { center: [x, y], radius_deviation })
    }
}

#[cfg(test)]
mod tests;
