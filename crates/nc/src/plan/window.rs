//! Window of the path for the speed solver: intervals, and the constraints of the joints on the spline's coefficients.

use virtual_axes_core::config::LimitsConfig;

use super::vector::JointVector;

/// First three derivatives of the joints at one end of an interval.
pub(super) type Node = [JointVector; 3];

/// Interval of the path between two stations.
#[derive(Debug, Clone)]
pub(super) struct Interval {
    pub length: f64,
    pub ends: [Node; 2],
    /// Largest rate of the path parameter, 1/s.
    pub cap: f64,
    /// Usable fraction of the acceleration and jerk limits.
    pub share: f64,
    /// Coefficient of u̇² in a motion that is known before, or 0.
    pub guess: f64,
}

/// State at the start of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum WindowStart {
    /// Standstill: the first interval has constant jerk.
    Rest,
    /// b = u̇² and b′.
    Moving { b: f64, slope: f64 },
}

/// Solution over the intervals between the rest intervals: b and b′ at each station.
pub(super) type Stations = Vec<(f64, f64)>;

/// Linear form in three consecutive coefficients.
pub(super) type Form = [f64; 3];

/// b, b′ at start, end and middle, and b″ of an interval, as linear forms. In the middle, b is the coefficient that bounds
/// it.
pub(super) struct IntervalForms {
    pub b: [Form; 3],
    pub slope: [Form; 3],
    pub curvature: Form,
}

fn scaled(form: &Form, by: f64) -> Form {
    [form[0] * by, form[1] * by, form[2] * by]
}

fn sum(a: &Form, b: &Form) -> Form {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn dot(a: &Form, c: &[f64]) -> f64 {
    a[0] * c[0] + a[1] * c[1] + a[2] * c[2]
}

/// Description of a window for the solver.
pub(super) struct Window<'a> {
    pub intervals: &'a [Interval],
    pub start: WindowStart,
    /// Lengths of the rest intervals: 0 for a moving start.
    pub rest: [f64; 2],
    pub joints: &'a [LimitsConfig],
}

impl Window<'_> {
    /// Returns the intervals without the rest intervals.
    pub fn inner(&self) -> &[Interval] {
        let from = usize::from(self.start == WindowStart::Rest);
        &self.intervals[from..self.intervals.len() - 1]
    }

    pub fn shape(&self, k: usize) -> IntervalForms {
        let inner = self.inner();
        let h = inner[k].length;
        let before = if k > 0 { inner[k - 1].length } else { 0.0 };
        let after = if k + 1 < inner.len() { inner[k + 1].length } else { 0.0 };
        let slope =
            [[-2.0 / (before + h), 2.0 / (before + h), 0.0], [0.0, -2.0 / (h + after), 2.0 / (h + after)]];
        let curvature = scaled(&sum(&slope[1], &scaled(&slope[0], -1.0)), 1.0 / h);
        let middle = scaled(&sum(&slope[0], &slope[1]), 0.5);
        IntervalForms {
            b: [
                [h / (before + h), before / (before + h), 0.0],
                [0.0, after / (h + after), h / (h + after)],
                [0.0, 1.0, 0.0],
            ],
            slope: [slope[0], slope[1], middle],
            curvature,
        }
    }

    /// Returns the first coefficient divided by the second for constant jerk from rest.
    pub fn ties(&self) -> [f64; 2] {
        let inner = self.inner();
        let tie = |rest: f64, h: f64| 1.0 / (1.0 + 2.0 / 3.0 * h / rest);
        let first = if self.start == WindowStart::Rest { tie(self.rest[0], inner[0].length) } else { 0.0 };
        [first, tie(self.rest[1], inner[inner.len() - 1].length)]
    }

    /// Returns the weight of 1/√c in the time, with the rest intervals.
    pub fn weight(&self, k: usize) -> f64 {
        let (inner, ties) = (self.inner(), self.ties());
        let mut weight = inner[k].length;
        if k == 0 && self.start == WindowStart::Rest {
            weight += 3.0 * self.rest[0] / ties[0].sqrt();
        }
        if k + 1 == inner.len() {
            weight += 3.0 * self.rest[1] / ties[1].sqrt();
        }
        weight
    }

    /// Returns the largest b at the inner end of a rest interval, where b ∝ u^(4/3): acceleration 2/3 b / h, jerk
    /// 2/9 (b / h^(4/3))^(3/2), with a share for the curvature.
    pub fn rest_bound(&self, end: usize) -> f64 {
        let interval = if end == 0 { &self.intervals[0] } else { &self.intervals[self.intervals.len() - 1] };
        let (h, share) = (interval.length, interval.share);
        let (mut acceleration, mut jerk) = (f64::INFINITY, f64::INFINITY);
        for (j, bounds) in self.joints.iter().enumerate() {
            for node in &interval.ends {
                // a (q′ + 3/2 q″ u) and j (q′ + 9 q″ u + 9/2 q‴ u²) at distance u from the standstill.
                let [first, second, third] = node.map(|derivative| derivative[j].abs());
                acceleration = acceleration.min(share * bounds.acceleration / (first + 1.5 * second * h));
                jerk = jerk.min(share * bounds.jerk / (first + 9.0 * second * h + 4.5 * third * h * h));
            }
        }
        (1.5 * acceleration * h).min((4.5 * jerk).powf(2.0 / 3.0) * h.powf(4.0 / 3.0))
    }

    /// Returns the largest b by the feed at the start, at the end and in the middle of inner interval `k`.
    pub fn feed_bounds(&self, k: usize) -> [f64; 3] {
        let inner = self.inner();
        let mut bounds = [inner[k].cap * inner[k].cap; 3];
        if k == 0 && self.start == WindowStart::Rest {
            bounds[0] = bounds[0].min(self.rest_bound(0));
        }
        if k + 1 == inner.len() {
            bounds[1] = bounds[1].min(self.rest_bound(1));
        }
        bounds
    }

    /// Returns the form g of the constraint |g| ≤ 1 on the acceleration of a joint at the start of inner interval `k`.
    pub fn acceleration_form(&self, k: usize, shape: &IntervalForms, joint: usize) -> Form {
        let interval = &self.inner()[k];
        let [q1, q2, _] = derivatives(interval, joint, 0);
        let scale = 1.0 / (interval.share * self.joints[joint].acceleration);
        sum(&scaled(&shape.slope[0], 0.5 * q1 * scale), &scaled(&shape.b[0], q2 * scale))
    }

    /// Returns the form g of the constraint |√b g| ≤ 1 on the jerk of a joint at the start (0), the end (1) or in the middle
    /// (2) of inner interval `k`.
    pub fn jerk_form(&self, k: usize, shape: &IntervalForms, joint: usize, end: usize) -> Form {
        let interval = &self.inner()[k];
        let [q1, q2, q3] = derivatives(interval, joint, end);
        let curved = sum(&scaled(&shape.slope[end], 1.5 * q2), &scaled(&shape.curvature, 0.5 * q1));
        let form = sum(&scaled(&shape.b[end], q3), &curved);
        scaled(&form, 1.0 / (interval.share * self.joints[joint].jerk))
    }

    /// Returns the indices of the joints that move.
    pub fn moving_joints(&self) -> Vec<usize> {
        let moves = |node: &Node, j: usize| node.iter().any(|derivative| derivative[j] != 0.0);
        let any =
            |j: &usize| self.inner().iter().any(|interval| interval.ends.iter().any(|node| moves(node, *j)));
        (0..self.joints.len()).filter(any).collect()
    }
}

/// Returns the first three derivatives of a joint at the start (0), the end (1) or in the middle (2) of an interval.
fn derivatives(interval: &Interval, joint: usize, end: usize) -> [f64; 3] {
    let [from, to] = if end == 2 { [0, 1] } else { [end; 2] }.map(|end| &interval.ends[end]);
    [0, 1, 2].map(|order| 0.5 * (from[order][joint] + to[order][joint]))
}
