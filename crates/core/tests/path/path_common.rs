//! Fixtures of path tests: default machine, moves, and differences of setpoints over the position cycle.

use nalgebra::Vector3;
use virtual_axes_core::config::{AxisKind, Parameters};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::path::{Block, Frame, Move, Path, PlanError, Program};
use virtual_axes_core::trajectory::JointLimits;

/// Position cycle of the default machine, ns.
pub const PERIOD: i64 = 6_000_000;
pub const TSP: f64 = 0.006;
/// Kinds of the axes x, y, z, a, c.
pub const KINDS: [AxisKind; 5] =
    [AxisKind::Linear, AxisKind::Linear, AxisKind::Linear, AxisKind::Rotary, AxisKind::Rotary];

/// Kinematics of the default machine with changed parameters.
pub fn kinematics(changes: &[(&str, f64)]) -> Kinematics {
    Kinematics::new(
        &virtual_axes_verification::fixtures::machines::parameters(changes).machine_config().expect("valid"),
    )
}

/// Limits of the default machine.
pub fn limits() -> Vec<JointLimits> {
    let parameters = Parameters::embedded_default().expect("valid");
    let machine = parameters.machine_config().expect("valid");
    machine.axes().iter().map(JointLimits::from_axis).collect()
}

/// Plans a program for the default machine without a rest.
pub fn plan(frame: Frame, moves: Vec<Move>) -> Result<Program, PlanError> {
    Program::plan(kinematics(&[]), frame, &limits(), PERIOD, 0.0, moves)
}

pub fn line(from: [f64; 5], to: [f64; 5]) -> Block {
    Block::line(&from, &to, &KINDS).expect("a line")
}

/// Creates an arc in the X–Y plane.
pub fn arc(from: [f64; 5], center: [f64; 2], sweep: f64, to: [f64; 5]) -> Block {
    Block::arc(&from, [0, 1], center, sweep, &to, &KINDS).expect("an arc")
}

/// Returns the setpoints at time `t`.
pub fn psec(program: &Program, t: f64) -> [f64; 5] {
    let mut joints = [0.0; 5];
    program.psec(t, &mut joints);
    joints
}

/// Returns the largest first, second and third difference of each joint, divided by its limit.
pub fn use_of_limits(program: &Program) -> [[f64; 5]; 3] {
    let limits = limits();
    let last = (program.duration() / TSP).ceil() as i64 + 4;
    let at = |k: i64| psec(program, virtual_axes_core::units::seconds(k.max(0) * PERIOD));
    let mut window = [at(0); 4];
    let mut used = [[0.0_f64; 5]; 3];
    for k in 1..last {
        window.rotate_left(1);
        window[3] = at(k);
        let [a, b, c, d] = window;
        for i in 0..5 {
            let l = &limits[i].limits;
            let differences = [
                (d[i] - c[i]) / TSP / l.velocity,
                (d[i] - 2.0 * c[i] + b[i]) / TSP.powi(2) / l.acceleration,
                (d[i] - 3.0 * c[i] + 3.0 * b[i] - a[i]) / TSP.powi(3) / l.jerk,
            ];
            for (used, difference) in used.iter_mut().zip(differences) {
                used[i] = used[i].max(difference.abs());
            }
        }
    }
    used
}

/// Asserts that no difference exceeds its limit by more than the guaranteed 10⁻⁶.
#[track_caller]
pub fn assert_within_limits(program: &Program) {
    let used = use_of_limits(program);
    for (order, joints) in used.iter().enumerate() {
        for (joint, used) in joints.iter().enumerate() {
            assert!(*used <= 1.0 + 1.1e-6, "joint {joint}, difference {}: {used} of its limit", order + 1);
        }
    }
}

/// Returns the smallest distance of the tip from the path between two values of progress, block by block, by sampling and
/// interval reduction around each sample that is nearer than its neighbors.
pub fn brute_force(path: &Path, from: f64, to: f64, tip: &Vector3<f64>) -> f64 {
    let at = |u: f64| (path.tool(u).tip - tip).norm();
    let starts = (0..path.blocks().len()).map(|block| path.start_of(block)).filter(|u| from < *u && *u < to);
    let bounds: Vec<f64> = [from].into_iter().chain(starts).chain([to]).collect();
    let count = 2000;
    let nearest_of_block = |from: f64, to: f64| {
        let progress = |i: usize| from + (to - from) * i as f64 / count as f64;
        let samples: Vec<f64> = (0..=count).map(|i| at(progress(i))).collect();
        let refined = |i: usize| {
            let (mut low, mut high) = (progress(i.saturating_sub(1)), progress((i + 1).min(count)));
            for _ in 0..90 {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if at(a) < at(b) { high = b } else { low = a }
            }
            at(low).min(at(high))
        };
        let is_least = |i: &usize| {
            samples[*i] <= samples[i.saturating_sub(1)] && samples[*i] <= samples[(i + 1).min(count)]
        };
        (0..=count).filter(is_least).map(refined).fold(at(from).min(at(to)), f64::min)
    };
    bounds.windows(2).map(|pair| nearest_of_block(pair[0], pair[1])).fold(f64::INFINITY, f64::min)
}
