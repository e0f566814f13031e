//! Circularity after ISO 230-4 on simulated points.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector3};

/// Bins of the polar angle: a tenth of a degree each.
const BINS: usize = 3600;
/// Sectors that must each hold a point of a full circle.
const SECTORS: usize = 36;

/// Collects the points of a circular path in one direction, in memory that does not grow (200 kB).
///
/// Of a circular path with a nominal center and radius R, positive is outside:
///
/// - radial deviation F: distance of a point from the nominal center less R; here its mean, least and
///   largest value. (The standard also lets the center be found by least squares. A simulation knows
///   its center, so that it does not have to.)
/// - circular deviation G: radial separation of two concentric circles that hold the path between
///   them, evaluated as the range of the radius about the center of the least-squares circle. It
///   contains neither an error of the radius nor one of the center.
/// - bi-directional circular deviation G(b): the same for two paths together, one clockwise, one
///   counterclockwise.
/// - mean bi-directional radial deviation D: radius of the least-squares circle of both paths, less R.
///
/// # Least squares
///
/// The circle is Kåsa's: it minimizes the sum of (d² − ρ²)², d the distance of a point from the
/// center sought, ρ the radius sought. With coordinates in units of R about the nominal center
/// and q = (u² + v² − 1)/2 this is linear,
///
/// ```text
/// q = eₓ u + e_y v + k        ρ² = 1 + 2 k + eₓ² + e_y²
/// ```
///
/// and needs nothing but running sums. On points of a true circle it is exact, however far its
/// center is off. Where the form is off by f, its center differs from the one that minimizes the sum
/// of (d − ρ)² by less than f²/R (17 nm for f = 50 µm, R = 150 mm); its radius, which is a root mean
/// square, is brought to the mean distance by the variance of the residuals, exact to f³/R².
///
/// # A second pass in bounded memory
///
/// G asks for the extremes about a center that is known only at the end. The polar angle is cut
/// into 3600 bins, each of which keeps its innermost and its outermost point as seen from the
/// nominal center; the distances of these points from the least-squares center are exact. Inside a
/// bin of width w the offset e of that center shifts two points by amounts that differ by less than
/// |e| w, so that G is never too large and too small by less than 2 |e| w (for e = 10 µm by 35 nm; for
/// a smooth path by far less, since it is flat where it is extreme).
#[derive(Debug, Clone)]
pub struct CircleAssessor {
    center: [f64; 2],
    radius: f64,
    sums: Sums,
    /// Least and largest radial deviation, m.
    range: [f64; 2],
    bins: Box<[Bin]>,
}

/// Figures of a circular path in one direction, m; see [`CircleAssessor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CircleReport {
    /// Mean of the radial deviation.
    pub mean: f64,
    /// Least radial deviation, Fmin.
    pub min: f64,
    /// Largest radial deviation, Fmax.
    pub max: f64,
    /// What needs a full circle; none for an arc, whose center the points do not determine well.
    pub full: Option<FullCircle>,
}

/// Figures of a full circle, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullCircle {
    /// G: range of the radius about the center of the least-squares circle.
    pub circular_deviation: f64,
    /// That center, seen from the nominal one.
    pub center: [f64; 2],
    /// Radius of the least-squares circle less the nominal one.
    pub radius_deviation: f64,
}

/// Figures of a full circle that was run in both directions, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BidirectionalReport {
    /// G(b).
    pub circular_deviation: f64,
    /// D, positive outside.
    pub mean_radial_deviation: f64,
}

impl CircleAssessor {
    /// No point yet of a circle with nominal `center` and `radius`, m; the radius is positive.
    pub fn new(center: [f64; 2], radius: f64) -> Self {
        debug_assert!(radius > 0.0, "a circle has a radius");
        Self {
            center,
            radius,
            sums: Sums::default(),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            bins: vec![Bin::default(); BINS].into_boxed_slice(),
        }
    }

    /// Nominal center, m.
    pub fn center(&self) -> [f64; 2] {
        self.center
    }

    /// Nominal radius, m.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Adds a point of the path, m; returns its radial deviation, m, positive outside.
    pub fn push(&mut self, x: f64, y: f64) -> f64 {
        let (x, y) = (x - self.center[0], y - self.center[1]);
        let deviation = (x * x + y * y).sqrt() - self.radius;
        self.sums.add(x / self.radius, y / self.radius, deviation / self.radius);
        self.range = [self.range[0].min(deviation), self.range[1].max(deviation)];
        // A float becomes an index by truncation; the angle π has the last bin.
        let bin = ((y.atan2(x) + PI) / TAU * BINS as f64) as usize;
        self.bins[bin.min(BINS - 1)].add([x, y], deviation);
        deviation
    }

    /// The figures so far; none without a point.
    pub fn report(&self) -> Option<CircleReport> {
        let sums = self.sums.means()?;
        let full = self.is_full().then(|| Fit::new(&sums)).flatten().map(|fit| {
            let center = fit.center.map(|offset| offset * self.radius);
            FullCircle {
                circular_deviation: self.range_about(center).width(),
                center,
                radius_deviation: fit.radius_deviation * self.radius,
            }
        });
        let [min, max] = self.range;
        Some(CircleReport { mean: sums.deviation * self.radius, min, max, full })
    }

    /// Whether every sector holds a point.
    fn is_full(&self) -> bool {
        self.bins.chunks(BINS / SECTORS).all(|sector| sector.iter().any(|bin| bin.points.is_some()))
    }

    /// Least and largest distance from `center`, which is seen from the nominal one.
    fn range_about(&self, [x, y]: [f64; 2]) -> Range {
        let points = self.bins.iter().filter_map(|bin| bin.points).flatten();
        points.fold(Range::EMPTY, |range, point| range.with((point.place[0] - x).hypot(point.place[1] - y)))
    }
}

/// Figures of one circle run in both directions; each counts the same, however many points it has.
///
/// None unless both paths are full circles about the same nominal center with the same radius.
pub fn bidirectional(
    clockwise: &CircleAssessor,
    counterclockwise: &CircleAssessor,
) -> Option<BidirectionalReport> {
    let paths = [clockwise, counterclockwise];
    let same = clockwise.center == counterclockwise.center && clockwise.radius == counterclockwise.radius;
    if !same || !paths.iter().all(|path| path.is_full()) {
        return None;
    }
    let fit = Fit::new(&clockwise.sums.means()?.plus(&counterclockwise.sums.means()?).means()?)?;
    let center = fit.center.map(|offset| offset * clockwise.radius);
    let range = paths.map(|path| path.range_about(center));
    Some(BidirectionalReport {
        circular_deviation: range[0].with(range[1].min).with(range[1].max).width(),
        mean_radial_deviation: fit.radius_deviation * clockwise.radius,
    })
}

/// A point seen from the nominal center, m.
#[derive(Debug, Clone, Copy)]
struct Point {
    place: [f64; 2],
    deviation: f64,
}

/// Innermost and outermost point of a bin.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    points: Option<[Point; 2]>,
}

impl Bin {
    fn add(&mut self, place: [f64; 2], deviation: f64) {
        let point = Point { place, deviation };
        let [inner, outer] = self.points.get_or_insert([point; 2]);
        if deviation < inner.deviation {
            *inner = point;
        }
        if deviation > outer.deviation {
            *outer = point;
        }
    }
}

/// Least and largest value.
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

/// Sums over points (u, v), in units of the radius about the nominal center.
#[derive(Debug, Clone, Copy)]
struct Sums {
    count: f64,
    /// Of (u, v, 1)(u, v, 1)ᵀ.
    normal: Matrix3<f64>,
    /// Of (u, v, 1) q.
    right: Vector3<f64>,
    /// Of q².
    square: f64,
    /// Of the radial deviation.
    deviation: f64,
}

impl Default for Sums {
    fn default() -> Self {
        Self { count: 0.0, normal: Matrix3::zeros(), right: Vector3::zeros(), square: 0.0, deviation: 0.0 }
    }
}

impl Sums {
    fn add(&mut self, u: f64, v: f64, deviation: f64) {
        // (r² − 1)/2 without the difference of two large numbers.
        let q = deviation + deviation * deviation / 2.0;
        let row = Vector3::new(u, v, 1.0);
        self.count += 1.0;
        self.normal += row * row.transpose();
        self.right += row * q;
        self.square += q * q;
        self.deviation += deviation;
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            normal: self.normal + other.normal,
            right: self.right + other.right,
            square: self.square + other.square,
            deviation: self.deviation + other.deviation,
        }
    }

    /// The sums as if of one point; none of no point.
    fn means(&self) -> Option<Self> {
        let n = self.count;
        (n > 0.0).then(|| Self {
            count: 1.0,
            normal: self.normal / n,
            right: self.right / n,
            square: self.square / n,
            deviation: self.deviation / n,
        })
    }
}

/// The least-squares circle, in units of the nominal radius.
struct Fit {
    center: [f64; 2],
    radius_deviation: f64,
}

impl Fit {
    fn new(means: &Sums) -> Option<Self> {
        let solution = means.normal.cholesky()?.solve(&means.right);
        let [x, y, k] = solution.into();
        // ρ² − 1; and ρ − 1 without the difference of two large numbers.
        let excess = 2.0 * k + x * x + y * y;
        let radius = (1.0 + excess).sqrt();
        let variance = (means.square - solution.dot(&means.right)).max(0.0);
        // d² = ρ² + 2 ε gives a mean d of ρ − ⟨ε²⟩/(2 ρ³).
        let radius_deviation = excess / (radius + 1.0) - variance / (2.0 * radius.powi(3));
        radius_deviation.is_finite().then_some(Self { center: [x, y], radius_deviation })
    }
}

#[cfg(test)]
mod tests;
