//! Time-optimal speed along a window of the path.
//!
//! The unknown is b(u) = u̇², a quadratic spline, so that the acceleration ü = b′/2 is continuous and linear in each
//! interval, and u⃛ = √b b″/2. For each joint q(u) with limits V, A and J:
//!
//! ```text
//! √b |q′| ≤ V     |q′ b′/2 + q″ b| ≤ A     √b |q‴ b + 3/2 q″ b′ + 1/2 q′ b″| ≤ J
//! ```
//!
//! The time Σ h/√c, with the middle spline coefficient c of each interval of length h, is minimized by a primal-dual
//! interior-point method. Its linear systems have two off-diagonals, so that the cost is linear in the number of
//! intervals. Next to a standstill the first interval has constant jerk: b ∝ u^(4/3).

mod lanes;

use virtual_axes_core::simd::{LANES, SliceOperation, vectorize};

use super::band::BandSystem;
use super::window::{Form, Stations, Window, WindowStart, dot};
use lanes::{
    Constraint, Group, Lanes, PLACES, Root, SUMS, Sides, Slope, SolverStep, add, consecutive, larger,
};

/// Largest number of iterations.
const MAX_ITERATIONS: usize = 60;
/// Duality gap relative to the time at which the iteration ends.
const GAP: f64 = 3e-4;
/// Largest violation of a normalized constraint at the end, and of one without √b: feeds are exceeded by at most 10⁻⁶.
const RESIDUAL: f64 = 1e-3;
const LINEAR_RESIDUAL: f64 = 2e-6;
/// Violation of the optimality conditions at the end, relative to the time.
const DUAL: f64 = 2e-3;
/// Fractions of the bounds for the first guess.
const GUESS: f64 = 0.5;
const GUESS_JERK: f64 = 0.1;
const MIN_GUESS: f64 = 0.02;
/// Duality gap of the first guess relative to the time, and its smallest slack: with less, multipliers of constraints
/// that the guess violates would take many iterations to become feasible.
const GAP_GUESS: f64 = 0.5;
const SLACK_GUESS: f64 = 0.3;
/// Duality gap relative to the time at which the state is kept for the next solution of the same window.
const GAP_MIDDLE: f64 = 2e-3;
/// Fraction of the way to the boundary per iteration: of slacks and multipliers, and of coefficients.
const TO_BOUNDARY: f64 = 0.99;
const COEFFICIENT_TO_ZERO: f64 = 0.7;

/// Progress of the iteration.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    /// Sum of the products of slacks and multipliers.
    gap: f64,
    /// Largest violation of a constraint with its slack.
    residual: f64,
    /// Largest violation of a constraint without √b.
    linear_residual: f64,
    /// Sum of the magnitudes of the Lagrangian's derivatives times the coefficients.
    dual: f64,
    time: f64,
}

/// Solver with its working memory.
#[derive(Debug, Default)]
pub(super) struct SpeedSolver {
    coefficients: Vec<f64>,
    /// Steps of the coefficients.
    steps: Vec<f64>,
    groups: Vec<Group>,
    /// Constraints of the groups, of each at first those without √b, then those on the jerk by place.
    constraints: Vec<Constraint>,
    /// Number of constraints without √b and of those on the jerk at a place, of each group.
    counts: [usize; 2],
    /// Number of constraints of all intervals.
    count: usize,
    /// Number of coefficients.
    size: usize,
    /// Derivatives of the Lagrangian, and part of the right-hand side that is proportional to the barrier.
    gradient: Vec<f64>,
    pulls: Vec<f64>,
    system: BandSystem,
    /// State in the middle of the last iteration.
    middle: Middle,
}

/// Coefficients, slacks and multipliers in the middle of an iteration, from which it continues with slightly reduced limits.
#[derive(Debug, Default)]
struct Middle {
    coefficients: Vec<f64>,
    sides: Vec<Sides>,
    barrier: f64,
}

impl SpeedSolver {
    /// Returns b and b′ at the stations between the first and the last interval, and true if the iteration converged, or
    /// `None` if it failed.
    pub fn solve(&mut self, window: &Window<'_>) -> Option<(Stations, bool)> {
        let ties = window.ties();
        let barrier = self.begin(window, &ties);
        self.iterate(window, &ties, barrier)
    }

    /// Returns the solution of the window of the last call of [`solve`](Self::solve), whose limits were slightly reduced.
    pub fn solve_again(&mut self, window: &Window<'_>) -> Option<(Stations, bool)> {
        let ties = &window.ties();
        self.set_constraints(window);
        let Middle { coefficients, sides, barrier } = &self.middle;
        if coefficients.len() != self.coefficients.len() || sides.len() != self.constraints.len() {
            return self.solve(window);
        }
        self.coefficients.clone_from(coefficients);
        self.constraints.iter_mut().zip(sides).for_each(|(constraint, sides)| constraint.sides = *sides);
        let barrier = *barrier;
        self.assemble(window, ties, None);
        match self.iterate(window, ties, barrier) {
            Some((stations, true)) => Some((stations, true)),
            _ => self.solve(window),
        }
    }

    /// Sets the first guess, and returns its barrier.
    fn begin(&mut self, window: &Window<'_>, ties: &[f64; 2]) -> f64 {
        self.middle.coefficients.clear();
        self.initialize(window);
        self.set_constraints(window);
        self.assemble(window, ties, None);
        if window.start == WindowStart::Rest {
            // Strictly within all bounds: jerk is proportional to b^(3/2).
            let values = self.constraints.iter().flat_map(|constraint| constraint.value);
            let worst = values.map(f64::abs).fold(0.0, f64::max);
            let factor = (0.9 / worst).clamp(MIN_GUESS, 1.0);
            self.coefficients.iter_mut().for_each(|c| *c *= factor);
            self.assemble(window, ties, None);
        }
        let weights = self.groups.iter().flat_map(|group| group.weight);
        let time: f64 = weights.zip(&self.coefficients[1..]).map(|(weight, c)| weight / c.sqrt()).sum();
        let barrier = GAP_GUESS * time / (2.0 * self.count as f64);
        for Constraint { form, value, sides } in &mut self.constraints {
            for i in 0..LANES {
                let is_used = form.iter().any(|lanes| lanes[i] != 0.0);
                for (side, excess) in [value[i] - 1.0, -value[i] - 1.0].into_iter().enumerate() {
                    sides.slacks[side][i] = (-excess).max(SLACK_GUESS);
                    sides.multipliers[side][i] = if is_used { barrier / sides.slacks[side][i] } else { 0.0 };
                }
            }
        }
        self.assemble(window, ties, None);
        barrier
    }

    /// Returns the solution after iterations from the present coefficients, slacks and multipliers.
    fn iterate(
        &mut self,
        window: &Window<'_>,
        ties: &[f64; 2],
        mut barrier: f64,
    ) -> Option<(Stations, bool)> {
        let sides = 2.0 * self.count as f64;
        let mut is_middle = false;

        for _ in 0..MAX_ITERATIONS {
            let step = self.step(ties, barrier)?;
            let Progress { gap, residual, linear_residual, dual, time } =
                self.assemble(window, ties, Some(step));
            let is_feasible = residual <= RESIDUAL && linear_residual <= LINEAR_RESIDUAL;
            if gap <= GAP * time && is_feasible && dual <= DUAL * time {
                return Some((self.stations(window), true));
            }
            let average = gap / sides;
            if !is_middle && gap <= GAP_MIDDLE * time {
                is_middle = true;
                self.keep_middle(barrier);
            }
            if dual <= 0.5 * gap && residual <= 0.1 {
                barrier = barrier.min(0.3 * average);
            } else if dual <= 2.0 * gap {
                barrier = barrier.min(0.5 * average);
            }
        }
        Some((self.stations(window), false))
    }

    /// Keeps the present state for [`solve_again`](Self::solve_again).
    fn keep_middle(&mut self, barrier: f64) {
        self.middle.coefficients.clone_from(&self.coefficients);
        self.middle.sides.clear();
        self.middle.sides.extend(self.constraints.iter().map(|constraint| constraint.sides));
        self.middle.barrier = barrier;
    }

    /// Sets the coefficients to a slow profile.
    fn initialize(&mut self, window: &Window<'_>) {
        let inner = window.inner();
        let c = &mut self.coefficients;
        c.clear();
        c.resize(inner.len() + 2, 0.0);
        // Bounds on the growth of b by the acceleration and of b^(3/4) by the jerk, which is linear from a standstill.
        let mut gains = Vec::with_capacity(inner.len());
        for (k, interval) in inner.iter().enumerate() {
            let mut bound = interval.cap * interval.cap;
            let (mut acceleration, mut jerk, mut bend) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
            for (j, bounds) in window.joints.iter().enumerate() {
                for [first, second, third] in &interval.ends {
                    bound = bound.min(0.5 * bounds.acceleration / second[j].abs());
                    bend = bend.min(0.5 * bounds.jerk / third[j].abs());
                    acceleration = acceleration.min(0.3 * bounds.acceleration / first[j].abs());
                    jerk = jerk.min(GUESS_JERK * bounds.jerk / first[j].abs());
                }
            }
            let bound = bound.min(bend.powf(2.0 / 3.0));
            c[k + 1] = GUESS * bound;
            gains.push((2.0 * acceleration * interval.length, (4.5 * jerk).sqrt() * interval.length));
        }
        let grown = |c: f64, gain: (f64, f64)| {
            let root = c.sqrt();
            let power = root * root.sqrt() + gain.1;
            (c + gain.0).min(power * power.cbrt())
        };
        let fixed = match window.start {
            WindowStart::Rest => {
                c[1] = c[1].min(0.5 * window.rest_bound(0));
                1
            }
            WindowStart::Moving { b, slope } => {
                c[0] = b;
                c[1] = b + 0.5 * slope * inner[0].length;
                2
            }
        };
        let last = inner.len();
        c[last] = c[last].min(0.5 * window.rest_bound(1));
        for k in fixed.max(2)..=last {
            c[k] = c[k].min(grown(c[k - 1], gains[k - 1]));
        }
        for k in (fixed..last).rev() {
            c[k] = c[k].min(grown(c[k + 1], gains[k - 1]));
        }
        // The motion that was planned before is within the limits.
        for k in fixed..last {
            c[k] = c[k].max(inner[k - 1].guess);
        }
        let ties = window.ties();
        if window.start == WindowStart::Rest {
            c[0] = ties[0] * c[1];
        }
        c[last + 1] = ties[1] * c[last];
    }

    /// Sets the constraints of all intervals.
    fn set_constraints(&mut self, window: &Window<'_>) {
        let (is_rest, length) = (window.start == WindowStart::Rest, window.inner().len());
        let joints = window.moving_joints();
        self.counts = [PLACES + joints.len(), joints.len()];
        let per_group = self.counts[0] + PLACES * self.counts[1];
        let groups = length.div_ceil(LANES);
        let empty = Group {
            weight: [0.0; LANES],
            speed: [[[0.0; LANES], [1.0; LANES], [0.0; LANES]]; PLACES],
            roots: [[1.0; LANES]; PLACES],
            inverses: [[0.0; LANES]; PLACES],
        };
        self.groups.clear();
        self.groups.resize(groups, empty);
        self.constraints.clear();
        self.constraints.resize(groups * per_group, Constraint::EMPTY);
        self.size = length + 2;
        // Lanes beyond the last interval have no constraints.
        self.coefficients.resize(LANES * groups + 2, 1.0);
        self.count = 0;
        for k in 0..length {
            let (shape, i) = (window.shape(k), k % LANES);
            let group = &mut self.groups[k / LANES];
            group.weight[i] = window.weight(k);
            for (speed, form) in group.speed.iter_mut().zip(&shape.b) {
                speed.iter_mut().zip(form).for_each(|(lanes, value)| lanes[i] = *value);
            }
            let mut constraints = self.constraints[k / LANES * per_group..].iter_mut();
            let mut push = |form: Form| {
                let Some(constraint) = constraints.next() else { return };
                // Of the coefficients that a moving start fixes alone: nothing can be done about these.
                if form == [0.0; 3] || form[2] == 0.0 && k == 0 && !is_rest {
                    return;
                }
                constraint.form.iter_mut().zip(form).for_each(|(lanes, value)| lanes[i] = value);
                self.count += 1;
            };
            for (form, bound) in shape.b.iter().zip(window.feed_bounds(k)) {
                push(form.map(|value| value / bound));
            }
            for joint in &joints {
                push(window.acceleration_form(k, &shape, *joint));
            }
            for place in 0..PLACES {
                for joint in &joints {
                    push(window.jerk_form(k, &shape, *joint, place));
                }
            }
        }
    }

    /// Makes a step, and computes the constraints and the linear system of the next one at the new coefficients.
    fn assemble(&mut self, window: &Window<'_>, ties: &[f64; 2], step: Option<SolverStep>) -> Progress {
        let padded = self.coefficients.len();
        self.system.clear(padded);
        for vector in [&mut self.gradient, &mut self.pulls] {
            vector.clear();
            vector.resize(padded, 0.0);
        }
        self.steps.resize(padded, 0.0);
        let mut progress = vectorize(Assembly { solver: self, step });
        // Coefficients that depend on others or are fixed.
        let n = self.size;
        self.system.tie_first(ties[0]);
        self.system.tie_last(n, ties[1]);
        for vector in [&mut self.system.right, &mut self.gradient, &mut self.pulls] {
            vector[1] += ties[0] * vector[0];
            vector[n - 2] += ties[1] * vector[n - 1];
            (vector[0], vector[n - 1]) = (0.0, 0.0);
        }
        self.system.fix(0);
        self.system.fix(n - 1);
        if window.start != WindowStart::Rest {
            self.system.fix(1);
            (self.gradient[1], self.pulls[1]) = (0.0, 0.0);
        }
        let derivatives = self.gradient.iter().zip(&self.coefficients);
        progress.dual = derivatives.take(n).map(|(g, c)| (g * c).abs()).sum();
        progress
    }

    /// Returns the next step and passes it to the coefficients, or `None` if the linear system is singular.
    fn step(&mut self, ties: &[f64; 2], barrier: f64) -> Option<SolverStep> {
        let n = self.size;
        self.system.add_right(barrier, &self.pulls);
        self.steps[..n].copy_from_slice(self.system.solve(n)?);
        self.steps[0] += ties[0] * self.steps[1];
        self.steps[n - 1] = ties[1] * self.steps[n - 2];
        // Parts of coefficients, slacks and multipliers that a whole step takes away.
        let coefficients = self.coefficients.iter().zip(&self.steps).map(|(c, step)| -step / c);
        let coefficients = coefficients.fold(0.0, f64::max) / COEFFICIENT_TO_ZERO;
        let [slacks, multipliers] =
            vectorize(StepBounds { solver: self, barrier }).map(|most| most / TO_BOUNDARY);
        let primal = coefficients.max(slacks).max(1.0).recip();
        for (c, step) in self.coefficients.iter_mut().zip(&self.steps) {
            *c += primal * step;
        }
        Some(SolverStep { barrier, primal, dual: multipliers.max(1.0).recip() })
    }

    fn stations(&self, window: &Window<'_>) -> Stations {
        let mut stations = Vec::with_capacity(window.inner().len() + 1);
        for k in 0..window.inner().len() {
            let (shape, c) = (window.shape(k), &self.coefficients[k..k + 3]);
            if k == 0 {
                stations.push((dot(&shape.b[0], c), dot(&shape.slope[0], c)));
            }
            stations.push((dot(&shape.b[1], c), dot(&shape.slope[1], c)));
        }
        stations
    }
}

/// Pass of [`SpeedSolver::assemble`] over all constraints.
struct Assembly<'a> {
    solver: &'a mut SpeedSolver,
    step: Option<SolverStep>,
}

impl SliceOperation for Assembly<'_> {
    type Output = Progress;

    #[inline(always)]
    fn run(self) -> Progress {
        let SpeedSolver { coefficients, steps, groups, constraints, counts, gradient, pulls, system, .. } =
            self.solver;
        let [linear, jerks] = *counts;
        let (mut times, mut gaps, mut residuals) = ([0.0; LANES], [0.0; LANES], [[0.0; LANES]; 2]);
        let per_group = constraints.chunks_exact_mut(linear + PLACES * jerks);
        for (g, (group, constraints)) in groups.iter_mut().zip(per_group).enumerate() {
            let from = LANES * g;
            let (c, steps) = (consecutive(coefficients, from), consecutive(steps, from));
            if let Some(step) = &self.step {
                let (linear, jerk) = constraints.split_at_mut(linear);
                linear.iter_mut().for_each(|constraint| constraint.pass(&steps, &Root::NONE, step));
                for place in 0..PLACES {
                    let root = group.change(place, &steps);
                    let at = &mut jerk[place * jerks..(place + 1) * jerks];
                    at.iter_mut().for_each(|constraint| constraint.pass(&steps, &root, step));
                }
            }
            let mut sums = [[0.0; LANES]; SUMS];
            let none = [[0.0; LANES]; 3];
            let slope = Slope { root: &[1.0; LANES], speed: &none };
            for constraint in &mut constraints[..linear] {
                constraint.add_to(&c, &slope, &mut sums, &mut residuals[1]);
            }
            for place in 0..PLACES {
                let speed = group.set_root(place, &c);
                let slope = Slope { root: &group.roots[place], speed: &speed };
                for constraint in &mut constraints[linear + place * jerks..linear + (place + 1) * jerks] {
                    constraint.add_to(&c, &slope, &mut sums, &mut residuals[0]);
                }
            }
            let mut bends = [0.0; LANES];
            let mut slopes = [0.0; LANES];
            for i in 0..LANES {
                let time = group.weight[i] / c[1][i].sqrt();
                times[i] += time;
                gaps[i] += sums[15][i];
                slopes[i] = -0.5 * time / c[1][i];
                bends[i] = -1.5 * slopes[i] / c[1][i];
            }
            let [m0, m1, m2, m3, m4, m5, r0, r1, r2, p0, p1, p2, g0, g1, g2, _] = &sums;
            let [diagonal, first, second] = &mut system.bands;
            add(diagonal, from, m0);
            add(diagonal, from + 1, m3);
            add(diagonal, from + 1, &bends);
            add(diagonal, from + 2, m5);
            add(first, from, m1);
            add(first, from + 1, m4);
            add(second, from, m2);
            add(&mut system.right, from + 1, &slopes.map(|slope| -slope));
            add(gradient, from + 1, &slopes);
            for (k, ([right, pull], slope)) in
                [[r0, p0], [r1, p1], [r2, p2]].into_iter().zip([g0, g1, g2]).enumerate()
            {
                add(&mut system.right, from + k, right);
                add(pulls, from + k, pull);
                add(gradient, from + k, slope);
            }
        }
        let largest = |lanes: &Lanes| lanes.iter().copied().fold(0.0, larger);
        let linear_residual = largest(&residuals[1]);
        Progress {
            gap: gaps.iter().sum(),
            residual: larger(largest(&residuals[0]), linear_residual),
            linear_residual,
            dual: 0.0,
            time: times.iter().sum(),
        }
    }
}

/// Pass of [`SpeedSolver::step`] over all constraints: the largest parts of slacks and of multipliers that a whole step
/// takes away.
struct StepBounds<'a> {
    solver: &'a SpeedSolver,
    barrier: f64,
}

impl SliceOperation for StepBounds<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        let SpeedSolver { steps, groups, constraints, counts: [linear, jerks], .. } = self.solver;
        let mut most = [[0.0; LANES]; 2];
        for (g, (group, constraints)) in
            groups.iter().zip(constraints.chunks_exact(linear + PLACES * jerks)).enumerate()
        {
            let steps = consecutive(steps, LANES * g);
            let (linear, jerk) = constraints.split_at(*linear);
            for constraint in linear {
                constraint.bound(&steps, &Root::NONE, self.barrier, &mut most);
            }
            for place in 0..PLACES {
                let root = group.change(place, &steps);
                for constraint in &jerk[place * jerks..(place + 1) * jerks] {
                    constraint.bound(&steps, &root, self.barrier, &mut most);
                }
            }
        }
        most.map(|lanes| lanes.into_iter().fold(0.0, larger))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::vector::MAX_JOINTS;
    use crate::plan::window::Interval;
    use virtual_axes_core::config::LimitsConfig;

    fn straight(lengths: &[f64], cap: f64) -> Vec<Interval> {
        let mut first = [0.0; MAX_JOINTS];
        first[0] = 1.0;
        let node = [first, [0.0; MAX_JOINTS], [0.0; MAX_JOINTS]];
        lengths
            .iter()
            .map(|&length| Interval { length, ends: [node, node], cap, share: 1.0, guess: 0.0 })
            .collect()
    }

    #[test]
    fn a_straight_line_is_nearly_as_fast_as_the_closed_form() {
        let bounds = [LimitsConfig {
            velocity: 0.5,
            acceleration: 2.5,
            jerk: 50.0,
            travel_min: f64::NEG_INFINITY,
            travel_max: f64::INFINITY,
        }];
        let mut lengths = Vec::new();
        let (mut h, mut half) = (4e-6_f64, 0.0);
        while half < 0.025 {
            lengths.push(h);
            half += h;
            h = (h * 1.3).min(0.7e-3);
        }
        let mirrored: Vec<f64> = lengths.iter().rev().copied().collect();
        lengths.extend(mirrored);
        let total: f64 = lengths.iter().sum();
        let intervals = straight(&lengths, 0.1);
        let window =
            Window { intervals: &intervals, start: WindowStart::Rest, rest: [4e-6; 2], joints: &bounds };
        let mut solver = SpeedSolver::default();
        let (stations, is_optimal) = solver.solve(&window).unwrap();
        assert!(is_optimal);
        let mut time = 0.0;
        for (k, pair) in stations.windows(2).enumerate() {
            time += 2.0 * lengths[k + 1] / (pair[0].0.sqrt() + pair[1].0.sqrt());
        }
        time += 3.0 * 4e-6 / stations[0].0.sqrt() * 2.0;
        let expected = total / 0.1 + 2.0 * (50.0_f64 * 0.1).sqrt() / 50.0;
        assert!(time < 1.01 * expected && time > 0.995 * expected);
    }
}
