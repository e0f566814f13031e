//! Benchmarks of trajectory, path, assess and simulation.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput};
use virtual_axes_core::assess::{AxisAssessor, CircleAssessor, PathDeviations, PathTracker};
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::{Kinematics, Poses, TableAngles};
use virtual_axes_core::machine::{Machine, MachineParameters};
use virtual_axes_core::path::Program;
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::simulation::{Simulation, joint_limits};
use virtual_axes_core::trajectory::{
    JointLimits, MotionId, Start, Timeline, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::seconds;

use crate::{bench, shipped};
use virtual_axes_verification::fixtures::machines::program;

/// Points of a long trajectory: one minute at 6 ms.
const POINTS: usize = 10_000;
/// Position cycles sampled by a timeline.
const SAMPLED: usize = 1000;
/// Search range of the closest path point beyond the setpoint, as in a trial, m or rad.
const AHEAD: f64 = 5e-3;
/// Number of linear axes of the shipped machine, which come first.
const LINEAR: usize = 3;
/// Deviation of the linear axes from the path, m.
const OFF: f64 = 1e-6;
/// Scenarios with lines, a circle, spatial curves and five axes.
const SCENARIOS: [&str; 4] = ["corner-90", "ballbar", "bspline-3d", "five-axis"];

pub fn all(criterion: &mut Criterion) {
    trajectory(criterion);
    path(criterion);
    assess(criterion);
    simulation(criterion);
}

/// Returns a slow rest-to-rest motion of five axes, optionally with velocities.
fn request(config: &MachineConfig, every: i64, with_velocities: bool) -> TrajectoryRequest {
    let names = config.axes().iter().map(|axis| axis.name().to_owned()).collect();
    let mut request = TrajectoryRequest::new(Start::Now, names);
    let period = config.periods().position * every;
    // Rest-to-rest profile 10 u³ − 15 u⁴ + 6 u⁵.
    let size = 0.05;
    let duration = seconds(period * (POINTS as i64 - 1));
    for k in 0..POINTS {
        let u = k as f64 / (POINTS - 1) as f64;
        let position = size * u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u);
        let velocity = size * 30.0 * (u * (1.0 - u)).powi(2) / duration;
        let (positions, velocities) = ([position; 5], [velocity; 5]);
        let velocities: &[f64] = if with_velocities { &velocities } else { &[] };
        let row = TrajectoryPoint { positions: &positions, velocities, ..TrajectoryPoint::default() };
        request.push(k as i64 * period, row).expect("well formed");
    }
    request
}

fn checked(request: TrajectoryRequest, limits: &[JointLimits], period: i64) -> Trajectory {
    let context =
        ValidationContext { joints: limits, period, max_points: POINTS, allow_nonzero_end_velocity: false };
    Trajectory::new(request, &context).expect("the machine can do it")
}

fn trajectory(criterion: &mut Criterion) {
    let config = shipped();
    let (limits, period) = (joint_limits(&config, ""), config.periods().position);
    // On the grid of position cycles, and with cubic interpolation between the points.
    let kinds = [("on the grid", request(&config, 1, false)), ("cubic", request(&config, 3, true))];
    let mut group = criterion.benchmark_group("trajectory, points");
    group.throughput(Throughput::Elements(POINTS as u64));
    for (name, request) in &kinds {
        group.bench_function(format!("checked, {name}"), |bencher| {
            let check = |request| checked(request, &limits, period);
            bencher.iter_batched(|| request.clone(), check, BatchSize::LargeInput);
        });
    }
    group.finish();
    let mut group = criterion.benchmark_group("trajectory, setpoints of five axes");
    group.throughput(Throughput::Elements(SAMPLED as u64));
    for (name, request) in kinds {
        let trajectory = Arc::new(checked(request, &limits, period));
        let begun = || {
            let mut timeline = Timeline::new(limits.clone(), period, &[0.0; 5]).expect("joints");
            timeline.submit(MotionId(1), Arc::clone(&trajectory), 0).expect("it is free");
            timeline
        };
        let sample = |mut timeline: Timeline| {
            (0..SAMPLED).for_each(|_| _ = black_box(timeline.next()));
            timeline
        };
        group.bench_function(format!("sampled, {name}"), |bencher| {
            bencher.iter_batched(begun, sample, BatchSize::LargeInput);
        });
    }
    group.finish();
}

/// Returns the number of position cycles of a program.
fn periods_of(program: &Program, config: &MachineConfig) -> usize {
    (program.duration() / seconds(config.periods().position)).ceil() as usize
}

fn path(criterion: &mut Criterion) {
    let config = shipped();
    let period = seconds(config.periods().position);
    let mut group = criterion.benchmark_group("path, position cycles");
    for name in SCENARIOS {
        let scenario = Scenario::builtin(name).expect("it is shipped");
        let program = program(name, &config);
        let count = periods_of(&program, &config);
        bench(&mut group, &format!("{name} planned"), count, || scenario.program(black_box(&config), None));
        let mut psec = vec![0.0; config.axes().len()];
        bench(&mut group, &format!("setpoints of {name}"), count, || {
            for k in 0..count {
                program.psec(k as f64 * period, &mut psec);
                black_box(&psec);
            }
        });
    }
    group.finish();
}

/// Returns the poses of a program with a small deviation, one batch per position cycle.
fn poses(program: &Program, config: &MachineConfig) -> Vec<Poses> {
    let kinematics = Kinematics::new(config);
    let (ticks, axes) = (config.periods().ticks_per_position() as usize, config.axes().len());
    let tick = seconds(config.periods().current);
    let mut turned = TableAngles::default();
    let mut joints = vec![0.0; axes];
    let period = |period: usize| {
        let mut columns = vec![0.0; axes * ticks];
        for instant in 0..ticks {
            program.psec((period * ticks + instant) as f64 * tick, &mut joints);
            for (axis, value) in joints.iter().enumerate() {
                // Tables at rest do not move by a single bit.
                let off = if axis < LINEAR { OFF * (instant as f64).sin() } else { 0.0 };
                columns[axis * ticks + instant] = value + off;
            }
        }
        let mut poses = Poses::default();
        kinematics.forward_batch(&mut turned, &columns, ticks, &mut poses);
        poses
    };
    (0..periods_of(program, config)).map(period).collect()
}

fn assess(criterion: &mut Criterion) {
    let config = shipped();
    let (ticks, tick) = (config.periods().ticks_per_position() as usize, seconds(config.periods().current));
    let mut group = criterion.benchmark_group("assess, ticks");
    for name in SCENARIOS {
        let program = program(name, &config);
        let poses = poses(&program, &config);
        let tracker = PathTracker::new(Arc::clone(program.path()));
        let until: Vec<f64> =
            (0..poses.len() * ticks).map(|i| program.progress(i as f64 * tick) + AHEAD).collect();
        let mut found = PathDeviations::default();
        let follow = |mut tracker: PathTracker| {
            for (period, poses) in poses.iter().enumerate() {
                black_box(tracker.follow(poses, |at| until[period * ticks + at], &mut found));
            }
            tracker
        };
        group.throughput(Throughput::Elements((poses.len() * ticks) as u64));
        let mut follow = follow;
        group.bench_function(format!("contour and orientation error along {name}"), |bencher| {
            bencher.iter_batched(|| tracker.clone(), &mut follow, BatchSize::LargeInput);
        });
    }
    let (radius, points) = (0.15, 100_000);
    let angles: Vec<[f64; 2]> =
        (0..points).map(|k| f64::from(k) * 1e-4).map(|a| [a.cos(), a.sin()]).collect();
    let mut circle = CircleAssessor::new([0.0, 0.0], radius);
    bench(&mut group, "radial deviation from a circle", points as usize, || {
        angles.iter().for_each(|[x, y]| _ = black_box(circle.push(radius * x, radius * y)));
    });
    group.finish();
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("it can be discretized")));
    machine.advance(&[1e-3; 5], &[]);
    let (sample, activity) = (*machine.axis(0).sample(), machine.activity(0));
    let mut assessor = AxisAssessor::default();
    let mut group = criterion.benchmark_group("assess, position cycles of an axis");
    bench(&mut group, "following errors and currents", 1000, || {
        (0..1000).for_each(|_| assessor.observe(black_box(&sample), &activity));
        assessor.report(tick)
    });
    group.finish();
}

fn simulation(criterion: &mut Criterion) {
    let config = shipped();
    let (limits, period) = (joint_limits(&config, ""), config.periods().position);
    let trajectory = Arc::new(checked(request(&config, 1, false), &limits, period));
    let mut group = criterion.benchmark_group("simulation, position cycles");
    group.throughput(Throughput::Elements(POINTS as u64));
    for (name, assessing) in [("five axes", false), ("five axes, with the figures of a motion", true)] {
        let begun = || {
            let mut simulation = Simulation::new(&config, limits.clone(), 0).expect("it can be simulated");
            simulation.set_assessing(assessing);
            simulation.submit(MotionId(1), Arc::clone(&trajectory)).expect("it is free");
            simulation
        };
        let run = |mut simulation: Simulation| {
            (0..POINTS).for_each(|_| _ = black_box(simulation.step()));
            simulation
        };
        group.bench_function(name, |bencher| bencher.iter_batched(begun, run, BatchSize::LargeInput));
    }
    group.finish();
}
