//! Cycle time against the best speed profile that a brute-force search finds on fine samples of the path.

use virtual_axes_core::config::{LimitsConfig, MachineConfig};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::PlanOptions;

use crate::limits::{fine_machine, plan_on};
use crate::programs::{Program, blend, five_axis, raster};

/// Relative tolerance of the limits in the search: that of the rounding of the samples.
const TOLERANCE: f64 = 1e-6;
/// Trials of the search.
const TRIALS: usize = 60_000;

/// Samples of a path with the durations between them.
struct Profile {
    joints: Vec<Vec<f64>>,
    /// Tool tip for tool center point control, otherwise the linear axes.
    tips: Vec<[f64; 3]>,
    durations: Vec<f64>,
    limits: Vec<LimitsConfig>,
    feed: f64,
}

impl Profile {
    /// Returns the largest ratio of speed, acceleration and jerk to their limits in the samples `from..to`.
    fn load(&self, from: usize, to: usize) -> f64 {
        let mut worst = 0.0_f64;
        for k in from..to.min(self.durations.len()) {
            let tool = (0..3).map(|j| (self.tips[k + 1][j] - self.tips[k][j]).powi(2)).sum::<f64>().sqrt();
            worst = worst.max(tool / self.durations[k] / self.feed);
            for (j, limits) in self.limits.iter().enumerate() {
                let speed = |k: usize| (self.joints[k + 1][j] - self.joints[k][j]) / self.durations[k];
                let acceleration =
                    |k: usize| 2.0 * (speed(k + 1) - speed(k)) / (self.durations[k] + self.durations[k + 1]);
                worst = worst.max(speed(k).abs() / limits.velocity);
                if k + 1 < self.durations.len() {
                    worst = worst.max(acceleration(k).abs() / limits.acceleration);
                }
                if k + 2 < self.durations.len() {
                    let span = (self.durations[k] + self.durations[k + 1] + self.durations[k + 2]) / 3.0;
                    worst = worst.max((acceleration(k + 1) - acceleration(k)).abs() / span / limits.jerk);
                }
            }
        }
        worst
    }

    /// Multiplies the durations around `center` by 1 − `depth` times a smooth bump.
    fn bend(&mut self, center: usize, width: usize, depth: f64) -> (usize, usize) {
        let (from, to) = (center.saturating_sub(width), (center + width + 1).min(self.durations.len()));
        for k in from..to {
            let x = (k as f64 - center as f64) / (width as f64 + 1.0);
            self.durations[k] *= 1.0 - depth * (1.0 - x * x).powi(3);
        }
        (from, to)
    }

    /// Returns the profile with all durations multiplied by `factor`.
    fn slowed(&self, factor: f64) -> Self {
        Self {
            joints: self.joints.clone(),
            tips: self.tips.clone(),
            durations: self.durations.iter().map(|duration| duration * factor).collect(),
            limits: self.limits.clone(),
            feed: self.feed,
        }
    }

    fn time(&self) -> f64 {
        self.durations.iter().sum()
    }

    /// Accepts random bumps, alone and in pairs, that save time within the limits.
    fn improve(&mut self) {
        // Linear congruential generator (Knuth), upper bits.
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let count = self.durations.len();
        for _ in 0..TRIALS {
            let before = self.durations.clone();
            let bumps = if random() < 0.5 { 1 } else { 2 };
            let (mut low, mut high) = (count, 0);
            for i in 0..bumps {
                let width = 2f64.powf(1.0 + 8.0 * random()) as usize;
                let depth = 10f64.powf(-4.0 + 3.5 * random()) * if i == 0 { 1.0 } else { -1.0 };
                let near = if i == 0 { random() * count as f64 } else { low as f64 + 64.0 * random() };
                let near = (near as usize).min(count - 1);
                let (from, to) = self.bend(near, width, depth);
                (low, high) = (low.min(from), high.max(to));
            }
            let saved: f64 = before.iter().zip(&self.durations).map(|(a, b)| a - b).sum();
            if saved <= 0.0 || self.load(low.saturating_sub(3), high) > 1.0 + TOLERANCE {
                self.durations = before;
            }
        }
    }
}

fn check(name: &str, program: &Program, machine: &MachineConfig) {
    let outcome = plan_on(machine, program, PlanOptions::default(), |_| 1.0).unwrap();
    outcome.audit.assert_kept();
    let mut joints: Vec<Vec<f64>> = outcome.setpoints.iter().map(|s| s.psec().to_vec()).collect();
    // Standstill before and after.
    let (first, last) = (joints[0].clone(), joints[joints.len() - 1].clone());
    (0..3).for_each(|_| joints.insert(0, first.clone()));
    (0..3).for_each(|_| joints.push(last.clone()));
    let kinematics = Kinematics::new(machine);
    let tip = |joints: &Vec<f64>| match program.tcp_length {
        Some(_) => kinematics.forward(joints).tip.into(),
        None => [joints[0], joints[1], joints[2]],
    };
    let tips = joints.iter().map(tip).collect();
    let period = 1e-3;
    let limits = machine.axes().iter().map(|axis| *axis.limits()).collect();
    let durations = vec![period; joints.len() - 1];
    let mut profile = Profile { joints, tips, durations, limits, feed: program.feed };
    let start = profile.time();
    if name == "line" {
        // The search itself finds most of what a slower profile leaves.
        let mut slow = profile.slowed(1.1);
        slow.improve();
        assert!(slow.time() < 1.03 * start, "{} {start}", slow.time());
    }
    assert!(profile.load(0, profile.durations.len()) <= 1.0 + TOLERANCE, "{name}");
    profile.improve();
    let saved = start - profile.time();
    println!("{name}: {} s, the search saves {saved} s", outcome.path_time);
    assert!(saved <= 0.02 * outcome.path_time, "{name}: {} s, the search saves {saved} s", outcome.path_time);
}

#[test]
fn cycle_times_are_near_the_optimum() {
    let machine = fine_machine();
    let mut line = Program::new(0.2, PathControl::ExactStop);
    line.line(0.08, 0.03, 0.01);
    check("line", &line, &machine);
    let mut circle = Program::new(0.2, PathControl::ExactPath);
    circle.arc([0.02, 0.0], std::f64::consts::TAU, 0.01);
    check("helix", &circle, &machine);
    let mut square = Program::new(0.1, blend(100e-6));
    square.line(0.03, 0.0, 0.0).line(0.03, 0.03, 0.0).line(0.0, 0.03, 0.0);
    check("square", &square, &machine);
    check("raster", &raster(2, 0.03, 50e-6, 1e-6, 0.1, 10e-6), &machine);
    check("five axes", &five_axis(machine.kinematics().tool_length), &machine);
}
