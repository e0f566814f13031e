//! Constraints on the speed in several intervals at once, one in each lane of a vector.

use virtual_axes_core::simd::LANES;

/// Values of as many intervals as fill the largest vector.
pub(super) type Lanes = [f64; LANES];

/// Forms in three consecutive coefficients, of one interval in each lane.
pub(super) type FormLanes = [Lanes; 3];

/// Places in an interval with constraints on the jerk: start, end and middle.
pub(super) const PLACES: usize = 3;

/// Constraint |g| ≤ 1 on three consecutive coefficients of each of several intervals in a row.
#[derive(Debug, Clone)]
pub(super) struct Constraint {
    /// Linear form: g, or g/√b for a jerk; 0 where the interval does not have the constraint.
    pub form: FormLanes,
    pub value: Lanes,
    pub sides: Sides,
}

/// Slacks and multipliers of both sides; multipliers of lanes that are not used are 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sides {
    pub slacks: [Lanes; 2],
    pub multipliers: [Lanes; 2],
}

/// Number of sums over the constraints of an interval.
pub(super) const SUMS: usize = 16;

/// Square root of b at a place of each interval, and ½ of its relative change in a step; 1 and 0 for constraints without √b.
#[derive(Debug, Clone, Copy)]
pub(super) struct Root {
    pub root: Lanes,
    pub change: Lanes,
}

impl Root {
    pub const NONE: Self = Self { root: [1.0; LANES], change: [0.0; LANES] };
}

/// Gradient of the constraints at a place.
#[derive(Clone, Copy)]
pub(super) struct Slope<'a> {
    pub root: &'a Lanes,
    /// ½ of the derivatives of b by the coefficients, divided by b.
    pub speed: &'a FormLanes,
}

impl Constraint {
    /// Constraint that always holds.
    pub const EMPTY: Self = Self {
        form: [[0.0; LANES]; 3],
        value: [0.0; LANES],
        sides: Sides { slacks: [[1.0; LANES]; 2], multipliers: [[0.0; LANES]; 2] },
    };

    /// Sets `most` to the largest parts of the slacks and of the multipliers that a whole step takes away.
    #[inline(always)]
    pub fn bound(&self, steps: &FormLanes, root: &Root, barrier: f64, most: &mut [Lanes; 2]) {
        let Self { form: [f0, f1, f2], value, sides } = self;
        let Sides { slacks: [s0, s1], multipliers: [m0, m1] } = sides;
        let [t0, t1, t2] = steps;
        let [slack, multiplier] = most;
        for i in 0..LANES {
            let along =
                root.root[i] * (f0[i] * t0[i] + f1[i] * t1[i] + f2[i] * t2[i]) + value[i] * root.change[i];
            let inverse = 1.0 / (s0[i] * s1[i]);
            let (i0, i1) = (s1[i] * inverse, s0[i] * inverse);
            let (r0, r1) = ((1.0 - value[i] - along) * i0 - 1.0, (1.0 + value[i] + along) * i1 - 1.0);
            slack[i] = larger(larger(-r0, -r1), slack[i]);
            // Not a number where the multipliers are 0.
            let inverse = barrier / (m0[i] * m1[i]);
            let (w0, w1) = (1.0 + r0 - m1[i] * inverse * i0, 1.0 + r1 - m0[i] * inverse * i1);
            multiplier[i] = larger(w1, larger(w0, multiplier[i]));
        }
    }

    /// Makes a step.
    #[inline(always)]
    pub fn pass(&mut self, steps: &FormLanes, root: &Root, step: &SolverStep) {
        let Self { form: [f0, f1, f2], value, sides } = self;
        let Sides { slacks: [s0, s1], multipliers: [m0, m1] } = sides;
        let [t0, t1, t2] = steps;
        for i in 0..LANES {
            let along =
                root.root[i] * (f0[i] * t0[i] + f1[i] * t1[i] + f2[i] * t2[i]) + value[i] * root.change[i];
            let (d0, d1) = (1.0 - value[i] - s0[i] - along, 1.0 + value[i] - s1[i] + along);
            let inverse = 1.0 / (s0[i] * s1[i]);
            let barrier = if m0[i] > 0.0 { step.barrier } else { 0.0 };
            m0[i] += step.dual * ((barrier - m0[i] * d0) * (s1[i] * inverse) - m0[i]);
            m1[i] += step.dual * ((barrier - m1[i] * d1) * (s0[i] * inverse) - m1[i]);
            s0[i] += step.primal * d0;
            s1[i] += step.primal * d1;
        }
    }

    /// Computes the value at the coefficients `c`, and adds to `sums`: the matrix, its right-hand side without and with the
    /// factor of the barrier, the gradient of the Lagrangian, and the gap. Sets `residual` to the largest violation.
    #[inline(always)]
    pub fn add_to(
        &mut self,
        c: &FormLanes,
        slope: &Slope<'_>,
        sums: &mut [Lanes; SUMS],
        residual: &mut Lanes,
    ) {
        let Self { form: [f0, f1, f2], value: values, sides } = self;
        let Sides { slacks: [s0, s1], multipliers: [m0, m1] } = sides;
        let ([c0, c1, c2], [b0, b1, b2], root) = (c, slope.speed, slope.root);
        for i in 0..LANES {
            let value = root[i] * (f0[i] * c0[i] + f1[i] * c1[i] + f2[i] * c2[i]);
            values[i] = value;
            let g0 = root[i] * f0[i] + value * b0[i];
            let g1 = root[i] * f1[i] + value * b1[i];
            let g2 = root[i] * f2[i] + value * b2[i];
            let (r0, r1) = (value - 1.0 + s0[i], s1[i] - 1.0 - value);
            let inverse = 1.0 / (s0[i] * s1[i]);
            let (i0, i1) = (s1[i] * inverse, s0[i] * inverse);
            let (w0, w1) = (m0[i] * i0, m1[i] * i1);
            let (weight, right, pull, lagrangian) = (w0 + w1, w1 * r1 - w0 * r0, i1 - i0, m0[i] - m1[i]);
            let (h0, h1, h2) = (weight * g0, weight * g1, weight * g2);
            sums[0][i] += h0 * g0;
            sums[1][i] += h0 * g1;
            sums[2][i] += h0 * g2;
            sums[3][i] += h1 * g1;
            sums[4][i] += h1 * g2;
            sums[5][i] += h2 * g2;
            sums[6][i] += right * g0;
            sums[7][i] += right * g1;
            sums[8][i] += right * g2;
            sums[9][i] += pull * g0;
            sums[10][i] += pull * g1;
            sums[11][i] += pull * g2;
            sums[12][i] += lagrangian * g0;
            sums[13][i] += lagrangian * g1;
            sums[14][i] += lagrangian * g2;
            sums[15][i] += s0[i] * m0[i] + s1[i] * m1[i];
            residual[i] = larger(larger(r0, r1), residual[i]);
        }
    }
}

/// Returns the larger value, and `b` where `a` is not a number.
#[inline(always)]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Returns the lanes of three consecutive coefficients of each interval of a group.
#[inline(always)]
pub(super) fn consecutive(values: &[f64], from: usize) -> FormLanes {
    let mut lanes = [[0.0; LANES]; 3];
    for (k, lanes) in lanes.iter_mut().enumerate() {
        lanes.copy_from_slice(&values[from + k..from + k + LANES]);
    }
    lanes
}

/// Adds lanes to consecutive values.
#[inline(always)]
pub(super) fn add(values: &mut [f64], from: usize, lanes: &Lanes) {
    values[from..from + LANES].iter_mut().zip(lanes).for_each(|(value, lane)| *value += lane);
}

/// Intervals in a row, one in each lane.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Weight of 1/√c in the time; 0 beyond the last interval.
    pub weight: Lanes,
    /// Linear forms of b at each place.
    pub speed: [FormLanes; PLACES],
    /// Roots of b at the present coefficients, and inverse of 2b.
    pub roots: [Lanes; PLACES],
    pub inverses: [Lanes; PLACES],
}

/// Steps of the coefficients, slacks and multipliers.
#[derive(Debug, Clone, Copy)]
pub(super) struct SolverStep {
    pub barrier: f64,
    /// Fraction of the step of coefficients and slacks, and of multipliers.
    pub primal: f64,
    pub dual: f64,
}

impl Group {
    /// Returns the root of b at a place before a step, with its relative change.
    #[inline(always)]
    pub fn change(&self, place: usize, steps: &FormLanes) -> Root {
        let mut root = Root { root: self.roots[place], change: [0.0; LANES] };
        let ([b0, b1, b2], [t0, t1, t2], inverse) = (&self.speed[place], steps, &self.inverses[place]);
        for i in 0..LANES {
            root.change[i] = (b0[i] * t0[i] + b1[i] * t1[i] + b2[i] * t2[i]) * inverse[i];
        }
        root
    }

    /// Computes the root of b at a place; returns ½ of the derivatives of b by the coefficients, divided by b.
    #[inline(always)]
    pub fn set_root(&mut self, place: usize, c: &FormLanes) -> FormLanes {
        let mut slopes = [[0.0; LANES]; 3];
        let ([b0, b1, b2], [c0, c1, c2]) = (&self.speed[place], c);
        let ([v0, v1, v2], root, inverse) = (&mut slopes, &mut self.roots[place], &mut self.inverses[place]);
        for i in 0..LANES {
            let b = larger(b0[i] * c0[i] + b1[i] * c1[i] + b2[i] * c2[i], f64::MIN_POSITIVE);
            root[i] = b.sqrt();
            inverse[i] = 0.5 / b;
            v0[i] = inverse[i] * b0[i];
            v1[i] = inverse[i] * b1[i];
            v2[i] = inverse[i] * b2[i];
        }
        slopes
    }
}
