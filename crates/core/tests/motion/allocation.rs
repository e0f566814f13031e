//! A position period neither allocates nor frees, whatever the machine is asked to do.

use std::sync::Arc;

use crate::simulation_common::{Bench, NONE, TSP, X};
use allocation_counter::{AllocationInfo, measure};
use virtual_axes_core::simulation::{Simulation, Tolerance, Tolerances, joint_limits};
use virtual_axes_core::trajectory::{
    MotionId, Start, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_verification::fixtures::machines::configured;

const A: MotionId = MotionId(1);
/// Periods in which whatever is used again may grow to its size: a second and a half, within which the
/// longest memory of a machine, that of contour errors, has been filled.
const WARM_UP: usize = 256;
/// Periods that are looked at.
const LOOKED_AT: usize = 256;
const Z: usize = 2;
/// m, of a motion to and fro.
const AMPLITUDE: f64 = 0.01;
/// rad/s of it: 3 s a period, 0.05 m/s² at most.
const FREQUENCY: f64 = std::f64::consts::TAU / 3.0;

/// Steps until nothing grows any more, and then looks at each step; `ask` asks for something before it.
fn assert_nothing_allocated(what: &str, simulation: &mut Simulation, mut ask: impl FnMut(&mut Simulation)) {
    for period in 0..WARM_UP + LOOKED_AT {
        ask(simulation);
        let found = measure(|| {
            simulation.step();
        });
        assert!(
            period < WARM_UP || found == AllocationInfo::default(),
            "{what}, period {period}: {} allocations, {:+} left",
            found.count_total,
            found.count_current
        );
    }
}

/// Where X is in a motion to and fro, and how fast.
fn to_and_fro(time: f64) -> [f64; 3] {
    let (sin, cos) = (FREQUENCY * time).sin_cos();
    [AMPLITUDE * (1.0 - cos), AMPLITUDE * FREQUENCY * sin, AMPLITUDE * FREQUENCY.powi(2) * cos]
}

/// X to and fro for six seconds, by points `every` ns with the first `derivatives` derivatives.
fn wave(bench: &Bench, every: Nanoseconds, derivatives: usize) -> Arc<Trajectory> {
    let mut request = TrajectoryRequest::new(Start::Now, vec!["x".to_owned()]);
    for k in 0..=6_000_000_000 / every {
        let [position, velocity, acceleration] = to_and_fro(seconds(k * every)).map(|v| [v]);
        let row = TrajectoryPoint {
            positions: &position,
            velocities: if derivatives > 0 { &velocity } else { &[] },
            accelerations: if derivatives > 1 { &acceleration } else { &[] },
            ..TrajectoryPoint::default()
        };
        request.push(k * every, row).expect("well formed");
    }
    let context = ValidationContext {
        joints: &bench.joints,
        period: TSP,
        max_points: 100_000,
        allow_nonzero_end_velocity: true,
    };
    Arc::new(Trajectory::new(request, &context).expect("within limits"))
}

fn predictive() -> Bench {
    let config = configured("mikron_ucp710", &["position_loop.controller=gpc"]);
    let joints = joint_limits(&config, "");
    let simulation = Simulation::new(&config, joints.clone(), 0).expect("can be simulated");
    Bench { simulation, joints, origin: 0 }
}

#[test]
fn the_counter_sees_what_is_allocated_and_what_is_freed() {
    let before = vec![1_u8];
    let found = measure(|| drop(std::hint::black_box(before)));
    assert_eq!((found.count_total, found.count_current), (0, -1));
    assert_eq!(measure(|| drop(std::hint::black_box(vec![1_u8]))).count_total, 1);
}

#[test]
fn a_machine_at_rest_allocates_nothing() {
    let mut bench = Bench::new(NONE, 0);
    assert_nothing_allocated("at rest", &mut bench.simulation, |_| ());
}

#[test]
fn a_trajectory_under_way_allocates_nothing_however_it_is_interpolated() {
    for derivatives in 0..=2 {
        for every in [TSP, 50 * TSP] {
            let mut bench = Bench::new(NONE, 0);
            let trajectory = wave(&bench, every, derivatives);
            bench.simulation.submit(A, trajectory).expect("accepted");
            let what = format!("{derivatives} derivatives, a point each {every} ns");
            assert_nothing_allocated(&what, &mut bench.simulation, |_| ());
        }
    }
}

#[test]
fn motions_of_several_joints_with_tolerances_allocate_nothing() {
    let mut bench = Bench::new(NONE, 0);
    let circle = bench.ballbar(Start::Now);
    let wide = Tolerance { position: Some(0.1), ..Tolerance::default() };
    let tolerances = Tolerances { path: vec![wide; 2], goal: vec![wide; 2], goal_time: None };
    bench.simulation.submit_with_tolerances(A, circle, tolerances).expect("accepted");
    let other = bench.trajectory(Start::Now, &["c"], &[(0, &[0.0]), (1000 * TSP, &[1.0])]);
    bench.simulation.submit(MotionId(2), other).expect("accepted");
    assert_nothing_allocated("two motions", &mut bench.simulation, |_| ());
}

#[test]
fn a_motion_that_waits_for_its_time_allocates_nothing() {
    let mut bench = Bench::new(NONE, 0);
    let later = bench.ballbar(Start::At(10_000 * TSP));
    bench.simulation.submit(A, later).expect("accepted");
    assert_nothing_allocated("waiting", &mut bench.simulation, |_| ());
}

#[test]
fn a_stream_allocates_nothing() {
    for (what, mut bench) in [("cascade", Bench::new(NONE, 0)), ("predictive", predictive())] {
        assert_nothing_allocated(what, &mut bench.simulation, |simulation| {
            let time = simulation.time_of(simulation.next_instant());
            let taken = simulation.submit_setpoint_stamped(X, to_and_fro(seconds(time))[0], Some(time));
            assert_eq!(taken, Ok(true));
        });
    }
}

#[test]
fn loads_allocate_nothing() {
    let mut bench = Bench::new(NONE, 0);
    assert_nothing_allocated("loads", &mut bench.simulation, |simulation| {
        simulation.set_load(X, 100.0, 20 * TSP);
        simulation.set_load(Z, -50.0, 20 * TSP);
    });
}

#[test]
fn predictive_control_allocates_nothing() {
    let mut bench = predictive();
    let circle = bench.ballbar(Start::Now);
    bench.simulation.submit(A, circle).expect("accepted");
    assert_nothing_allocated("predictive", &mut bench.simulation, |_| ());
}
