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

use virtual_axes_core::simd::{LANES, SliceOperation, vectorize};

use super::band::{BandSystem, add};
use super::window::{Form, Stations, Window, WindowStart, dot};

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
/// Fraction of the way to the boundary per iteration: of slacks and multipliers, and of coefficients.
const TO_BOUNDARY: f64 = 0.99;
const COEFFICIENT_TO_ZERO: f64 = 0.7;

/// Values of as many constraints as fill the largest vector.
type Lanes = [f64; LANES];

/// Constraints |g| ≤ 1 on three consecutive coefficients, one in each lane.
#[derive(Debug, Clone)]
struct Block {
    /// Linear forms: g, or g/√b for a jerk.
    form: [Lanes; 3],
    /// Linear form of the b of a jerk, and 1 for other constraints.
    speed: [Lanes; 3],
    constant: Lanes,
    gradient: [Lanes; 3],
    value: Lanes,
    /// Slacks and multipliers of both sides; multipliers of lanes that are not used are 0.
    slacks: [Lanes; 2],
    multipliers: [Lanes; 2],
}

/// Number of sums over the constraints of an interval.
const SUMS: usize = 16;

impl Block {
    /// Constraints that always hold.
    const EMPTY: Self = Self {
        form: [[0.0; LANES]; 3],
        speed: [[0.0; LANES]; 3],
        constant: [1.0; LANES],
        gradient: [[0.0; LANES]; 3],
        value: [0.0; LANES],
        slacks: [[1.0; LANES]; 2],
        multipliers: [[0.0; LANES]; 2],
    };

    /// Returns the steps of slack and multiplier of one side in a lane, by the step of the constraint toward it.
    #[inline(always)]
    fn side(&self, i: usize, side: usize, along: f64, barrier: f64) -> [f64; 2] {
        let (slack, multiplier) = (self.slacks[side][i], self.multipliers[side][i]);
        let value = if side == 0 { self.value[i] } else { -self.value[i] };
        let step = -(value - 1.0 + slack) - along;
        let barrier = if multiplier > 0.0 { barrier } else { 0.0 };
        [step, (barrier - multiplier * step) / slack - multiplier]
    }

    /// Returns the step of the constraint in a lane, by the steps of the coefficients.
    #[inline(always)]
    fn along(&self, i: usize, steps: &Form) -> f64 {
        self.gradient[0][i] * steps[0] + self.gradient[1][i] * steps[1] + self.gradient[2][i] * steps[2]
    }

    /// Sets `most` to the largest parts of the slacks and of the multipliers that a whole step takes away.
    #[inline(always)]
    fn bound(&self, steps: &Form, barrier: f64, most: &mut [Lanes; 2]) {
        let [slacks, multipliers] = most;
        for (i, (most_of_slack, most_of_multiplier)) in slacks.iter_mut().zip(multipliers).enumerate() {
            let along = self.along(i, steps);
            let (upper, lower) = (self.side(i, 0, along, barrier), self.side(i, 1, -along, barrier));
            let slack = larger(-upper[0] / self.slacks[0][i], -lower[0] / self.slacks[1][i]);
            *most_of_slack = larger(slack, *most_of_slack);
            let multiplier = larger(-upper[1] / self.multipliers[0][i], *most_of_multiplier);
            *most_of_multiplier = larger(-lower[1] / self.multipliers[1][i], multiplier);
        }
    }

    /// Makes a step.
    #[inline(always)]
    fn pass(&mut self, steps: &Form, step: &Step) {
        for i in 0..LANES {
            let along = self.along(i, steps);
            let upper = self.side(i, 0, along, step.barrier);
            let lower = self.side(i, 1, -along, step.barrier);
            self.slacks[0][i] += step.primal * upper[0];
            self.slacks[1][i] += step.primal * lower[0];
            self.multipliers[0][i] += step.dual * upper[1];
            self.multipliers[1][i] += step.dual * lower[1];
        }
    }

    /// Computes values and gradients at the coefficients `c`.
    #[inline(always)]
    fn linearize(&mut self, c: &Form, tie: &Tie) {
        let (form, speed) = (&self.form, &self.speed);
        for i in 0..LANES {
            let b = speed[0][i] * c[0] + speed[1][i] * c[1] + speed[2][i] * c[2] + self.constant[i];
            let root = larger(b, f64::MIN_POSITIVE).sqrt();
            let value = form[0][i] * c[0] + form[1][i] * c[1] + form[2][i] * c[2];
            let half = 0.5 * value / root;
            let first = root * form[0][i] + half * speed[0][i];
            let middle = root * form[1][i] + half * speed[1][i];
            let last = root * form[2][i] + half * speed[2][i];
            self.value[i] = root * value;
            self.gradient[0][i] = tie.keep[0] * first;
            self.gradient[1][i] = tie.keep[1] * (middle + tie.share[0] * first + tie.share[1] * last);
            self.gradient[2][i] = tie.keep[2] * last;
        }
    }

    /// Adds to `sums`: the matrix, its right-hand side without and with the factor of the barrier, the gradient of the
    /// Lagrangian, and the gap. Sets `residuals` to the largest violations of all constraints and of those without √b.
    #[inline(always)]
    fn add_to(&self, sums: &mut [Lanes; SUMS], residuals: &mut [Lanes; 2]) {
        for i in 0..LANES {
            let [s0, s1] = [self.slacks[0][i], self.slacks[1][i]];
            let [m0, m1] = [self.multipliers[0][i], self.multipliers[1][i]];
            let [r0, r1] = [self.value[i] - 1.0 + s0, -self.value[i] - 1.0 + s1];
            let [i0, i1] = [1.0 / s0, 1.0 / s1];
            let [w0, w1] = [m0 * i0, m1 * i1];
            let (weight, right, pull, slope) = (w0 + w1, w1 * r1 - w0 * r0, i1 - i0, m0 - m1);
            let [g0, g1, g2] = [self.gradient[0][i], self.gradient[1][i], self.gradient[2][i]];
            sums[0][i] += weight * g0 * g0;
            sums[1][i] += weight * g0 * g1;
            sums[2][i] += weight * g0 * g2;
            sums[3][i] += weight * g1 * g1;
            sums[4][i] += weight * g1 * g2;
            sums[5][i] += weight * g2 * g2;
            sums[6][i] += right * g0;
            sums[7][i] += right * g1;
            sums[8][i] += right * g2;
            sums[9][i] += pull * g0;
            sums[10][i] += pull * g1;
            sums[11][i] += pull * g2;
            sums[12][i] += slope * g0;
            sums[13][i] += slope * g1;
            sums[14][i] += slope * g2;
            sums[15][i] += s0 * m0 + s1 * m1;
            let residual = larger(r0, r1);
            residuals[0][i] = larger(residual, residuals[0][i]);
            residuals[1][i] = larger(residual * self.constant[i], residuals[1][i]);
        }
    }
}

/// Returns the larger value, and `b` where `a` is not a number.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Returns the sum of the lanes.
#[inline(always)]
fn total(lanes: &Lanes) -> f64 {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// Coefficients of an interval that depend on others or are fixed.
#[derive(Debug, Clone, Copy)]
struct Tie {
    /// 0 for a coefficient that is not free.
    keep: Form,
    /// Shares of the first and of the last coefficient that follow the middle one.
    share: [f64; 2],
}

/// Interval with its constraints.
#[derive(Debug, Clone, Copy)]
struct Section {
    /// End of the blocks of its constraints.
    end: usize,
    tie: Tie,
    /// Weight of 1/√c in the time.
    weight: f64,
}

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

/// Steps of the coefficients, slacks and multipliers.
#[derive(Debug, Clone, Copy)]
struct Step {
    barrier: f64,
    /// Fraction of the step of coefficients and slacks, and of multipliers.
    primal: f64,
    dual: f64,
}

/// Solver with its working memory.
#[derive(Debug, Default)]
pub(super) struct SpeedSolver {
    coefficients: Vec<f64>,
    /// Steps of the coefficients.
    steps: Vec<f64>,
    sections: Vec<Section>,
    blocks: Vec<Block>,
    /// Number of constraints.
    count: usize,
    /// Derivatives of the Lagrangian, and part of the right-hand side that is proportional to the barrier.
    gradient: Vec<f64>,
    pulls: Vec<f64>,
    system: BandSystem,
}

impl SpeedSolver {
    /// Returns b and b′ at the stations between the first and the last interval, and true if the iteration converged, or
    /// `None` if it failed.
    pub fn solve(&mut self, window: &Window<'_>) -> Option<(Stations, bool)> {
        self.initialize(window);
        let ties = window.ties();
        self.set_constraints(window, &ties);
        self.assemble(None);
        if window.start == WindowStart::Rest {
            // Strictly within all bounds: jerk is proportional to b^(3/2).
            let values = self.blocks.iter().flat_map(|block| block.value);
            let worst = values.map(f64::abs).fold(0.0, f64::max);
            let factor = (0.9 / worst).clamp(MIN_GUESS, 1.0);
            self.coefficients.iter_mut().for_each(|c| *c *= factor);
            self.assemble(None);
        }
        let weighted = self.sections.iter().zip(&self.coefficients[1..]);
        let time: f64 = weighted.map(|(section, c)| section.weight / c.sqrt()).sum();
        let sides = 2.0 * self.count as f64;
        let mut barrier = GAP_GUESS * time / sides;
        for block in &mut self.blocks {
            for i in 0..LANES {
                let is_used = (0..3).any(|k| block.form[k][i] != 0.0);
                for (side, excess) in [block.value[i] - 1.0, -block.value[i] - 1.0].into_iter().enumerate() {
                    block.slacks[side][i] = (-excess).max(SLACK_GUESS);
                    block.multipliers[side][i] = if is_used { barrier / block.slacks[side][i] } else { 0.0 };
                }
            }
        }
        self.assemble(None);
        for _ in 0..MAX_ITERATIONS {
            let step = self.step(window, &ties, barrier)?;
            let Progress { gap, residual, linear_residual, dual, time } = self.assemble(Some(step));
            let is_feasible = residual <= RESIDUAL && linear_residual <= LINEAR_RESIDUAL;
            if gap <= GAP * time && is_feasible && dual <= DUAL * time {
                return Some((self.stations(window), true));
            }
            let average = gap / sides;
            if dual <= 0.5 * gap && residual <= 0.1 {
                barrier = barrier.min(0.15 * average);
            } else if dual <= 2.0 * gap {
                barrier = barrier.min(0.5 * average);
            }
        }
        Some((self.stations(window), false))
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
            let (mut acceleration, mut jerk) = (f64::INFINITY, f64::INFINITY);
            for (j, bounds) in window.joints.iter().enumerate() {
                for [first, second, third] in &interval.ends {
                    bound = bound.min(0.5 * bounds.acceleration / second[j].abs());
                    bound = bound.min((0.5 * bounds.jerk / third[j].abs()).powf(2.0 / 3.0));
                    acceleration = acceleration.min(0.3 * bounds.acceleration / first[j].abs());
                    jerk = jerk.min(GUESS_JERK * bounds.jerk / first[j].abs());
                }
            }
            c[k + 1] = GUESS * bound;
            gains.push((2.0 * acceleration * interval.length, (4.5 * jerk).sqrt() * interval.length));
        }
        let grown = |c: f64, gain: (f64, f64)| (c + gain.0).min((c.powf(0.75) + gain.1).powf(4.0 / 3.0));
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
    fn set_constraints(&mut self, window: &Window<'_>, ties: &[f64; 2]) {
        let (is_rest, last) = (window.start == WindowStart::Rest, window.inner().len() - 1);
        self.sections.clear();
        self.blocks.clear();
        self.count = 0;
        for k in 0..=last {
            let shape = window.shape(k);
            let (blocks, mut used) = (&mut self.blocks, LANES);
            let mut push = |form: Form, speed: Option<&Form>| {
                // Of the coefficients that a moving start fixes alone: nothing can be done about these.
                if form[2] == 0.0 && k == 0 && !is_rest {
                    return;
                }
                if used == LANES {
                    blocks.push(Block::EMPTY);
                    used = 0;
                }
                if let Some(block) = blocks.last_mut() {
                    for (lanes, value) in block.form.iter_mut().zip(form) {
                        lanes[used] = value;
                    }
                    for (lanes, value) in block.speed.iter_mut().zip(speed.into_iter().flatten()) {
                        lanes[used] = *value;
                    }
                    block.constant[used] = if speed.is_some() { 0.0 } else { 1.0 };
                }
                used += 1;
                self.count += 1;
            };
            window.linear_forms(k, &shape, |form| push(form, None));
            for end in 0..3 {
                window.jerk_forms(k, &shape, end, |form| push(form, Some(&shape.b[end])));
            }
            let mut tie = Tie { keep: [1.0; 3], share: [0.0; 2] };
            if k == 0 {
                (tie.keep[0], tie.share[0]) = (0.0, ties[0]);
            }
            if k == last {
                (tie.keep[2], tie.share[1]) = (0.0, ties[1]);
            }
            if !is_rest {
                // The first two coefficients are fixed.
                tie.keep[..2_usize.saturating_sub(k)].fill(0.0);
            }
            self.sections.push(Section { end: self.blocks.len(), tie, weight: window.weight(k) });
        }
    }

    /// Makes a step, and computes the constraints and the linear system of the next one at the new coefficients.
    fn assemble(&mut self, step: Option<Step>) -> Progress {
        let size = self.coefficients.len();
        self.system.clear(size);
        for vector in [&mut self.gradient, &mut self.pulls] {
            vector.clear();
            vector.resize(size, 0.0);
        }
        self.steps.resize(size, 0.0);
        vectorize(Assembly { solver: self, step })
    }

    /// Returns the next step and passes it to the coefficients, or `None` if the linear system is singular.
    fn step(&mut self, window: &Window<'_>, ties: &[f64; 2], barrier: f64) -> Option<Step> {
        let (is_rest, n) = (window.start == WindowStart::Rest, self.coefficients.len());
        self.system.add_right(barrier, &self.pulls);
        self.system.fix(0);
        self.system.fix(n - 1);
        if !is_rest {
            self.system.fix(1);
        }
        self.steps.clear();
        self.steps.extend_from_slice(self.system.solve()?);
        // Parts of coefficients, slacks and multipliers that a whole step takes away.
        let coefficients = self.coefficients.iter().zip(&self.steps).map(|(c, step)| -step / c);
        let coefficients = coefficients.fold(0.0, f64::max) / COEFFICIENT_TO_ZERO;
        let [slacks, multipliers] =
            vectorize(StepBounds { solver: self, barrier }).map(|most| most / TO_BOUNDARY);
        let primal = coefficients.max(slacks).max(1.0).recip();
        for (c, step) in self.coefficients.iter_mut().zip(&self.steps) {
            *c += primal * step;
        }
        if is_rest {
            self.coefficients[0] = ties[0] * self.coefficients[1];
        }
        self.coefficients[n - 1] = ties[1] * self.coefficients[n - 2];
        Some(Step { barrier, primal, dual: multipliers.max(1.0).recip() })
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
    step: Option<Step>,
}

impl SliceOperation for Assembly<'_> {
    type Output = Progress;

    #[inline(always)]
    fn run(self) -> Progress {
        let SpeedSolver { coefficients, steps, sections, blocks, gradient, pulls, system, .. } = self.solver;
        let (mut progress, mut residuals, mut from) = (Progress::default(), [[0.0; LANES]; 2], 0);
        for (k, section) in sections.iter().enumerate() {
            let (c, steps) = (three(coefficients, k), three(steps, k));
            let mut sums = [[0.0; LANES]; SUMS];
            for block in &mut blocks[from..section.end] {
                if let Some(step) = &self.step {
                    block.pass(&steps, step);
                }
                block.linearize(&c, &section.tie);
                block.add_to(&mut sums, &mut residuals);
            }
            from = section.end;
            let time = section.weight / c[1].sqrt();
            let slope = -0.5 * time / c[1] * section.tie.keep[1];
            let mut totals = [0.0; SUMS];
            for (total_of, lanes) in totals.iter_mut().zip(&sums) {
                *total_of = total(lanes);
            }
            let [m0, m1, m2, m3, m4, m5, r0, r1, r2, p0, p1, p2, g0, g1, g2, gap] = totals;
            progress.time += time;
            progress.gap += gap;
            system.add(k, &[m0, m1, m2, m3 - 1.5 * slope / c[1], m4, m5], &[r0, r1 - slope, r2]);
            add(&mut pulls[k..], &[p0, p1, p2]);
            add(&mut gradient[k..], &[g0, g1 + slope, g2]);
        }
        let [residual, linear_residual] = residuals.map(|lanes| lanes.into_iter().fold(0.0, larger));
        (progress.residual, progress.linear_residual) = (residual, linear_residual);
        // Derivatives by coefficients that are not free are 0.
        for (g, c) in gradient.iter().zip(coefficients.iter()) {
            progress.dual += (g * c).abs();
        }
        progress
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
        let (mut most, mut from) = ([[0.0; LANES]; 2], 0);
        for (k, section) in self.solver.sections.iter().enumerate() {
            let steps = three(&self.solver.steps, k);
            for block in &self.solver.blocks[from..section.end] {
                block.bound(&steps, self.barrier, &mut most);
            }
            from = section.end;
        }
        let mut largest = [0.0; 2];
        for (largest, lanes) in largest.iter_mut().zip(&most) {
            for value in lanes {
                *largest = larger(*value, *largest);
            }
        }
        largest
    }
}

/// Returns three consecutive values from index `k` on.
#[inline(always)]
fn three(values: &[f64], k: usize) -> Form {
    [values[k], values[k + 1], values[k + 2]]
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
