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

use super::band::BandSystem;
use super::window::{
    ConstraintRow, Stations, Window, WindowStart, dot, push_bounds, push_joint_rows, push_upper,
};

/// Largest number of iterations.
const MAX_ITERATIONS: usize = 60;
/// Duality gap relative to the time at which the iteration ends.
const GAP: f64 = 3e-4;
/// Largest violation of a normalized constraint at the end.
const RESIDUAL: f64 = 1e-3;
/// Violation of the optimality conditions at the end, relative to the time.
const DUAL: f64 = 2e-3;
/// Fractions of the bounds for the first guess.
const GUESS: f64 = 0.5;
const GUESS_JERK: f64 = 0.1;
const MIN_GUESS: f64 = 0.02;
/// Fraction of the way to the boundary per iteration.
const TO_BOUNDARY: f64 = 0.99;

/// Solver with its working memory.
#[derive(Debug, Default)]
pub(super) struct SpeedSolver {
    coefficients: Vec<f64>,
    rows: Vec<ConstraintRow>,
    /// Slacks and multipliers of both sides of each constraint.
    slacks: Vec<[f64; 2]>,
    multipliers: Vec<[f64; 2]>,
    /// Steps of slacks and multipliers.
    changes: Vec<[(f64, f64); 2]>,
    gradient: Vec<f64>,
    system: BandSystem,
}

impl SpeedSolver {
    /// Returns b and b′ at the stations between the first and the last interval, and true if the iteration converged, or
    /// `None` if it failed.
    pub fn solve(&mut self, window: &Window<'_>) -> Option<(Stations, bool)> {
        let inner = window.inner();
        let n = inner.len() + 2;
        let ties = window.ties();
        self.initialize(window);
        self.linearize(window, &ties);
        if window.start == WindowStart::Rest {
            // Strictly within all bounds: jerk is proportional to b^(3/2).
            let worst = self.rows.iter().map(|row| row.value.abs()).fold(0.0, f64::max);
            let factor = (0.9 / worst).clamp(MIN_GUESS, 1.0);
            self.coefficients.iter_mut().for_each(|c| *c *= factor);
            self.linearize(window, &ties);
        }
        let time: f64 = inner.iter().zip(&self.coefficients[1..]).map(|(i, c)| i.length / c.sqrt()).sum();
        self.slacks.clear();
        self.slacks.extend(self.rows.iter().map(|row| {
            let [upper, lower] = row.excess();
            [(-upper).max(0.05), (-lower).max(0.05)]
        }));
        let sides = 2.0 * self.rows.len() as f64;
        let mut barrier = 0.2 * time / sides;
        self.multipliers.clear();
        self.multipliers.extend(self.slacks.iter().map(|[upper, lower]| [barrier / upper, barrier / lower]));
        self.changes.clear();
        self.changes.resize(self.rows.len(), Default::default());
        for _ in 0..MAX_ITERATIONS {
            self.step(window, n, barrier)?;
            self.linearize(window, &ties);
            let rows = self.rows.iter().zip(&self.slacks).zip(&self.multipliers);
            let (mut gap, mut residual) = (0.0, 0.0_f64);
            for ((row, slacks), multipliers) in rows {
                for (side, excess) in row.excess().into_iter().enumerate() {
                    gap += slacks[side] * multipliers[side];
                    residual = residual.max(excess + slacks[side]);
                }
            }
            let (time, dual) = self.optimality(window);
            if gap <= GAP * time && residual <= RESIDUAL && dual <= DUAL * time {
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

    /// Returns the time and the sum of the magnitudes of the Lagrangian's derivatives times the coefficients.
    fn optimality(&mut self, window: &Window<'_>) -> (f64, f64) {
        let gradient = &mut self.gradient;
        gradient.clear();
        gradient.resize(self.coefficients.len(), 0.0);
        let mut time = 0.0;
        for k in 0..window.inner().len() {
            let (c, weight) = (self.coefficients[k + 1], window.weight(k));
            time += weight / c.sqrt();
            gradient[k + 1] = -0.5 * weight * c.powf(-1.5);
        }
        for (row, [upper, lower]) in self.rows.iter().zip(&self.multipliers) {
            for (i, g) in row.gradient.iter().enumerate() {
                gradient[row.first + i] += (upper - lower) * g;
            }
        }
        let fixed = if window.start == WindowStart::Rest { 1 } else { 2 };
        let last = gradient.len() - 1;
        let terms = gradient[fixed..last].iter().zip(&self.coefficients[fixed..last]);
        (time, terms.map(|(g, c)| (g * c).abs()).sum())
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

    /// Computes values and gradients of all constraints at the present coefficients.
    fn linearize(&mut self, window: &Window<'_>, ties: &[f64; 2]) {
        let inner = window.inner();
        let last = inner.len() - 1;
        self.rows.clear();
        let is_rest = window.start == WindowStart::Rest;
        for (k, interval) in inner.iter().enumerate() {
            let shape = window.shape(k);
            let c = &self.coefficients[k..k + 3];
            let from = self.rows.len();
            push_bounds(&mut self.rows, k, interval, &shape, c);
            for end in 0..3 {
                push_joint_rows(&mut self.rows, k, interval, &shape, c, end, window.joints);
            }
            if k == 0 && is_rest {
                push_upper(&mut self.rows, k, &shape.b[0], c, window.rest_bound(0));
            }
            if k == last {
                push_upper(&mut self.rows, k, &shape.b[1], c, window.rest_bound(1));
            }
            for row in &mut self.rows[from..] {
                if k == 0 {
                    row.gradient[1] += ties[0] * row.gradient[0];
                    row.gradient[0] = 0.0;
                }
                if k == last {
                    row.gradient[1] += ties[1] * row.gradient[2];
                    row.gradient[2] = 0.0;
                }
                if !is_rest {
                    // The first two coefficients are fixed.
                    (0..2_usize.saturating_sub(k)).for_each(|i| row.gradient[i] = 0.0);
                }
            }
            if !is_rest && k == 0 {
                // Of the fixed coefficients alone: nothing can be done about these.
                self.rows.retain(|row| row.gradient[2] != 0.0);
            }
        }
    }

    /// Performs one iteration, or returns `None` if the linear system is singular.
    fn step(&mut self, window: &Window<'_>, n: usize, barrier: f64) -> Option<()> {
        let inner = window.inner();
        let ties = window.ties();
        self.system.clear(n);
        for k in 0..inner.len() {
            let (c, weight) = (self.coefficients[k + 1], window.weight(k));
            let (slope, curvature) = (-0.5 * weight * c.powf(-1.5), 0.75 * weight * c.powf(-2.5));
            self.system.add(k, &[0.0, 1.0, 0.0], curvature, -slope);
        }
        for ((row, slacks), multipliers) in self.rows.iter().zip(&self.slacks).zip(&self.multipliers) {
            let (excess, weights) = (row.excess(), [multipliers[0] / slacks[0], multipliers[1] / slacks[1]]);
            let pull = |side: usize| barrier / slacks[side] + weights[side] * (excess[side] + slacks[side]);
            self.system.add(row.first, &row.gradient, weights[0] + weights[1], pull(1) - pull(0));
        }
        self.system.fix(0);
        self.system.fix(n - 1);
        if window.start != WindowStart::Rest {
            self.system.fix(1);
        }
        let steps = self.system.solve()?;
        let (mut primal, mut dual) = (1.0_f64, 1.0_f64);
        for (c, step) in self.coefficients.iter().zip(steps) {
            if *step < 0.0 {
                primal = primal.min(-0.7 * c / step);
            }
        }
        // Steps of slack and multiplier of one side, by the step of the excess.
        let change = |excess: f64, along: f64, slack: f64, multiplier: f64| {
            let slack_step = -(excess + slack) - along;
            (slack_step, (barrier - multiplier * slack_step) / slack - multiplier)
        };
        let rows = self.rows.iter().zip(&mut self.slacks).zip(&mut self.multipliers);
        for (((row, slacks), multipliers), changes) in rows.zip(&mut self.changes) {
            let along = dot(&row.gradient, &steps[row.first..row.first + 3]);
            let excess = row.excess();
            *changes = [
                change(excess[0], along, slacks[0], multipliers[0]),
                change(excess[1], -along, slacks[1], multipliers[1]),
            ];
            for side in 0..2 {
                let (slack_step, multiplier_step) = changes[side];
                if slack_step < 0.0 {
                    primal = primal.min(-TO_BOUNDARY * slacks[side] / slack_step);
                }
                if multiplier_step < 0.0 {
                    dual = dual.min(-TO_BOUNDARY * multipliers[side] / multiplier_step);
                }
            }
        }
        let rows = self.slacks.iter_mut().zip(&mut self.multipliers).zip(&self.changes);
        for ((slacks, multipliers), changes) in rows {
            for side in 0..2 {
                slacks[side] += primal * changes[side].0;
                multipliers[side] += dual * changes[side].1;
            }
        }
        for (c, step) in self.coefficients.iter_mut().zip(steps) {
            *c += primal * step;
        }
        if window.start == WindowStart::Rest {
            self.coefficients[0] = ties[0] * self.coefficients[1];
        }
        self.coefficients[n - 1] = ties[1] * self.coefficients[n - 2];
        Some(())
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
