//! Tool tip and tool axis along a block as polynomials of arc length.

use nalgebra::{SMatrix, Vector3};

use crate::kinematics::ToolPose;

/// Coefficients of a polynomial.
const COEFFICIENTS: usize = 8;
/// Largest deviation of a polynomial from the tool tip, m.
const TIP_TOLERANCE: f64 = 2e-14;
/// Largest deviation of a polynomial from the tool axis.
const AXIS_TOLERANCE: f64 = 2e-14;
/// Bisections of an interval between two knots after which a curve has no polynomials.
const MAX_HALVINGS: u32 = 16;
/// Arguments at which a polynomial is compared with the curve: the extremes of the interpolation error, by symmetry.
/// The constant coefficient is compared too.
const CHECKED: [f64; 3] = [-1.0, std::f64::consts::FRAC_1_SQRT_2, 1.0];
/// Factor of bounds found at the nodes.
const BOUND_MARGIN: f64 = 1.25;

/// Polynomials of the three coordinates of a vector.
pub(super) type Polynomials = [[f64; COEFFICIENTS]; 3];

/// Part of a block in which tip and tool axis are polynomials of x = (s − middle)/half.
#[derive(Debug, Clone)]
pub(super) struct CurveCell {
    pub middle: f64,
    pub half: f64,
    pub tip: Polynomials,
    pub axis: Polynomials,
    /// Smallest |dq/ds|² and largest |dq/ds| and |d²q/ds²| of the tip q.
    pub least_square_speed: f64,
    pub most_speed: f64,
    pub most_bend: f64,
}

/// Cells of a block, in order.
#[derive(Debug, Clone)]
pub(super) struct CurveCells {
    cells: Box<[CurveCell]>,
    /// Largest |dq/ds| of the tip q.
    most_speed: f64,
}

/// Returns the value of a polynomial at `x`.
#[inline(always)]
pub(super) fn value([c0, c1, c2, c3, c4, c5, c6, c7]: &[f64; COEFFICIENTS], x: f64) -> f64 {
    c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * (c5 + x * (c6 + x * c7))))))
}

/// Returns the value of a polynomial and its first and second derivative at `x`.
#[inline(always)]
pub(super) fn derivatives(c: &[f64; COEFFICIENTS], x: f64) -> [f64; 3] {
    let [_, c1, c2, c3, c4, c5, c6, c7] = c;
    let first = c1
        + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * (5.0 * c5 + x * (6.0 * c6 + x * (7.0 * c7))))));
    let second =
        2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * (20.0 * c5 + x * (30.0 * c6 + x * (42.0 * c7)))));
    [value(c, x), first, second]
}

impl CurveCells {
    /// Creates the cells of a block with knots at arc lengths `knots`; `pose` returns the pose at an arc length. Returns
    /// `None` for a curve that is not smooth enough.
    pub fn new(knots: &[f64], mut pose: impl FnMut(f64) -> ToolPose) -> Option<Self> {
        let interpolation = Interpolation::new()?;
        let mut cells = Vec::new();
        for pair in knots.windows(2) {
            let mut stack = vec![(pair[0], pair[1], 0)];
            while let Some((from, to, depth)) = stack.pop() {
                let at = |x: f64| pose(0.5 * (from + to) + 0.5 * (to - from) * x);
                if let Some(cell) = interpolation.cell([from, to], at) {
                    cells.push(cell);
                } else if depth < MAX_HALVINGS {
                    let middle = 0.5 * (from + to);
                    stack.extend([(middle, to, depth + 1), (from, middle, depth + 1)]);
                } else {
                    return None;
                }
            }
        }
        let most_speed = cells.iter().map(|cell: &CurveCell| cell.most_speed).fold(0.0, f64::max);
        (!cells.is_empty()).then(|| CurveCells { cells: cells.into_boxed_slice(), most_speed })
    }

    /// Returns all cells.
    pub fn cells(&self) -> &[CurveCell] {
        &self.cells
    }

    /// Returns the largest |dq/ds| of the tip q.
    pub fn most_speed(&self) -> f64 {
        self.most_speed
    }

    /// Returns the index of the cell that contains arc length `s`.
    pub fn index_at(&self, s: f64) -> usize {
        self.cells.partition_point(|cell| cell.middle + cell.half <= s).min(self.cells.len() - 1)
    }

    fn at(&self, s: f64) -> (&CurveCell, f64) {
        let cell = &self.cells[self.index_at(s)];
        (cell, cell.argument(s))
    }

    /// Returns the tip at arc length `s`, m.
    pub fn tip(&self, s: f64) -> Vector3<f64> {
        let (cell, x) = self.at(s);
        Vector3::from(cell.tip.each_ref().map(|c| value(c, x)))
    }

    /// Returns the tool axis at arc length `s`.
    pub fn axis(&self, s: f64) -> Vector3<f64> {
        let (cell, x) = self.at(s);
        Vector3::from(cell.axis.each_ref().map(|c| value(c, x))).normalize()
    }

    /// Returns the tip and its first and second derivative with respect to arc length at `s`.
    pub fn tip_derivatives(&self, s: f64) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let (cell, x) = self.at(s);
        let all = cell.tip.each_ref().map(|c| derivatives(c, x));
        let vector = |order: usize| Vector3::from(all.map(|values| values[order]));
        (vector(0), vector(1) / cell.half, vector(2) / (cell.half * cell.half))
    }
}

impl CurveCell {
    /// Returns the argument of the polynomials at arc length `s`.
    pub fn argument(&self, s: f64) -> f64 {
        (s - self.middle) / self.half
    }
}

/// Interpolation at the Chebyshev nodes.
struct Interpolation {
    nodes: [f64; COEFFICIENTS],
    /// Coefficients of the powers from the values at the nodes.
    matrix: SMatrix<f64, COEFFICIENTS, COEFFICIENTS>,
}

impl Interpolation {
    fn new() -> Option<Self> {
        let angle = |i: usize| (2 * i + 1) as f64 * std::f64::consts::PI / (2 * COEFFICIENTS) as f64;
        let nodes: [f64; COEFFICIENTS] = std::array::from_fn(|i| angle(i).cos());
        let powers =
            SMatrix::<f64, COEFFICIENTS, COEFFICIENTS>::from_fn(|row, column| nodes[row].powi(column as i32));
        Some(Interpolation { nodes, matrix: powers.try_inverse()? })
    }

    /// Returns the cell of a range of arc length if its polynomials are within the tolerances; `at` returns the pose
    /// at an argument.
    fn cell(&self, [from, to]: [f64; 2], mut at: impl FnMut(f64) -> ToolPose) -> Option<CurveCell> {
        let center = at(0.0);
        let poses = self.nodes.map(&mut at);
        let interpolated = |center: Vector3<f64>, values: [Vector3<f64>; COEFFICIENTS]| -> Polynomials {
            // Differences from the center have less rounding.
            std::array::from_fn(|axis| {
                let differences = values.map(|value| value[axis] - center[axis]);
                (self.matrix * SMatrix::<f64, COEFFICIENTS, 1>::from(differences)).into()
            })
        };
        let mut tip = interpolated(center.tip, poses.map(|pose| pose.tip));
        let mut axis = interpolated(center.axis, poses.map(|pose| pose.axis));
        let is_exact =
            |polynomials: &Polynomials, tolerance: f64| polynomials.iter().all(|c| c[0].abs() <= tolerance);
        let is_exact_at_center = is_exact(&tip, TIP_TOLERANCE) && is_exact(&axis, AXIS_TOLERANCE);
        for (polynomials, center) in [(&mut tip, center.tip), (&mut axis, center.axis)] {
            polynomials.iter_mut().zip(&center).for_each(|(c, value)| c[0] += value);
        }
        let differs = |polynomials: &Polynomials, x: f64, wanted: Vector3<f64>, tolerance: f64| {
            let is_close =
                polynomials.iter().zip(&wanted).all(|(c, wanted)| (value(c, x) - wanted).abs() <= tolerance);
            !is_close
        };
        if !is_exact_at_center
            || CHECKED.into_iter().any(|x| {
                let pose = at(x);
                differs(&tip, x, pose.tip, TIP_TOLERANCE) || differs(&axis, x, pose.axis, AXIS_TOLERANCE)
            })
        {
            return None;
        }
        let half = 0.5 * (to - from);
        let local = |x: f64| {
            let all = tip.each_ref().map(|c| derivatives(c, x));
            [1, 2]
                .map(|order| Vector3::from(all.map(|values| values[order])).norm() / half.powi(order as i32))
        };
        let found = self.nodes.map(local);
        let most = |order: usize| found.iter().fold(0.0, |most, f| f64::max(most, f[order])) * BOUND_MARGIN;
        let least = found.iter().fold(f64::INFINITY, |least, f| f64::min(least, f[0])) / BOUND_MARGIN;
        Some(CurveCell {
            middle: 0.5 * (from + to),
            half,
            tip,
            axis,
            least_square_speed: least * least,
            most_speed: most(0),
            most_bend: most(1),
        })
    }
}
