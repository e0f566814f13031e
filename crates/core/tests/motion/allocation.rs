//! Absence of heap allocations in a position cycle, for all kinds of commands.

use std::sync::Arc;

use crate::simulation_common::{NONE, SimulationFixture, TSP, X};
use allocation_counter::{AllocationInfo, measure};
use virtual_axes_core::simulation::{Simulation, Tolerance, Tolerances, joint_limits};
use virtual_axes_core::trajectory::{
    MotionId, Start, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_verification::fixtures::machines::{configured, configured_with};

const A: MotionId = MotionId(1);
/// Cycles in which buffers can grow: 1.5 s, longer than the longest buffer, that of the contour error.
const WARM_UP: usize = 256;
/// Measured cycles.
const MEASURED: usize = 256;
const Z: usize = 2;
/// Amplitude of the oscillation, m.
const AMPLITUDE: f64 = 0.01;
/// Angular frequency of the oscillation, rad/s: period 3 s, at most 0.05 m/s².
const FREQUENCY: f64 = std::f64::consts::TAU / 3.0;

/// Steps through the warm-up and then measures each step; calls `command` before each step.
fn assert_nothing_allocated(
    what: &str,
    simulation: &mut Simulation,
    mut command: impl FnMut(&mut Simulation),
) {
    for period in 0..WARM_UP + MEASURED {
        command(simulation);
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

/// Position, velocity and acceleration of X in an oscillation.
fn oscillation(time: f64) -> [f64; 3] {
    let (sin, cos) = (FREQUENCY * time).sin_cos();
    [AMPLITUDE * (1.0 - cos), AMPLITUDE * FREQUENCY * sin, AMPLITUDE * FREQUENCY.powi(2) * cos]
}

/// Oscillation of X for six seconds, with points each `every` ns and the first `derivatives` derivatives.
fn wave(fixture: &SimulationFixture, every: Nanoseconds, derivatives: usize) -> Arc<Trajectory> {
    let mut request = TrajectoryRequest::new(Start::Now, vec!["x".to_owned()]);
    for k in 0..=6_000_000_000 / every {
        let [position, velocity, acceleration] = oscillation(seconds(k * every)).map(|v| [v]);
        let point = TrajectoryPoint {
            positions: &position,
            velocities: if derivatives > 0 { &velocity } else { &[] },
            accelerations: if derivatives > 1 { &acceleration } else { &[] },
            ..TrajectoryPoint::default()
        };
        request.push(k * every, point).expect("valid point");
    }
    let context = ValidationContext {
        joints: &fixture.joints,
        period: TSP,
        max_points: 100_000,
        allow_nonzero_end_velocity: true,
    };
    Arc::new(Trajectory::new(request, &context).expect("within limits"))
}

fn predictive() -> SimulationFixture {
    let config = configured("mikron_ucp710", &["position_loop.controller=gpc"]);
    let joints = joint_limits(&config, "");
    let simulation = Simulation::new(&config, joints.clone(), 0).expect("can be simulated");
    SimulationFixture { simulation, joints, origin: 0 }
}

#[test]
fn the_counter_counts_allocations_and_deallocations() {
    let before = vec![1_u8];
    let found = measure(|| drop(std::hint::black_box(before)));
    assert_eq!((found.count_total, found.count_current), (0, -1));
    assert_eq!(measure(|| drop(std::hint::black_box(vec![1_u8]))).count_total, 1);
}

#[test]
fn a_machine_at_rest_allocates_nothing() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    assert_nothing_allocated("at rest", &mut fixture.simulation, |_| ());
}

#[test]
fn an_active_trajectory_of_any_degree_allocates_nothing() {
    for derivatives in 0..=2 {
        for every in [TSP, 50 * TSP] {
            let mut fixture = SimulationFixture::new(NONE, 0);
            let trajectory = wave(&fixture, every, derivatives);
            fixture.simulation.submit(A, trajectory).expect("accepted");
            let what = format!("{derivatives} derivatives, a point each {every} ns");
            assert_nothing_allocated(&what, &mut fixture.simulation, |_| ());
        }
    }
}

#[test]
fn motions_of_several_joints_with_tolerances_allocate_nothing() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    let circle = fixture.ballbar(Start::Now);
    let wide = Tolerance { position: Some(0.1), ..Tolerance::default() };
    let tolerances = Tolerances { path: vec![wide; 2], goal: vec![wide; 2], goal_time: None };
    fixture.simulation.submit_with_tolerances(A, circle, tolerances).expect("accepted");
    let other = fixture.trajectory(Start::Now, &["c"], &[(0, &[0.0]), (1000 * TSP, &[1.0])]);
    fixture.simulation.submit(MotionId(2), other).expect("accepted");
    assert_nothing_allocated("two motions", &mut fixture.simulation, |_| ());
}

#[test]
fn a_changing_feed_override_allocates_nothing() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    let trajectory = wave(&fixture, TSP, 2);
    fixture.simulation.submit(A, trajectory).expect("accepted");
    let mut cycle = 0;
    assert_nothing_allocated("feed override", &mut fixture.simulation, |simulation| {
        cycle += 1;
        simulation.set_feed_override([1.0, 0.3, 2.0, 0.0][cycle / 40 % 4]).expect("valid");
    });
}

#[test]
fn a_waiting_motion_allocates_nothing() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    let later = fixture.ballbar(Start::At(10_000 * TSP));
    fixture.simulation.submit(A, later).expect("accepted");
    assert_nothing_allocated("waiting", &mut fixture.simulation, |_| ());
}

#[test]
fn a_stream_allocates_nothing() {
    for (what, mut fixture) in [("cascade", SimulationFixture::new(NONE, 0)), ("predictive", predictive())] {
        assert_nothing_allocated(what, &mut fixture.simulation, |simulation| {
            let time = simulation.time_of(simulation.next_instant());
            let taken = simulation.submit_setpoint_stamped(X, oscillation(seconds(time))[0], Some(time));
            assert_eq!(taken, Ok(true));
        });
    }
}

#[test]
fn loads_allocate_nothing() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    assert_nothing_allocated("loads", &mut fixture.simulation, |simulation| {
        simulation.set_load(X, 100.0, 20 * TSP);
        simulation.set_load(Z, -50.0, 20 * TSP);
    });
}

#[test]
fn predictive_control_allocates_nothing() {
    let mut fixture = predictive();
    let circle = fixture.ballbar(Start::Now);
    fixture.simulation.submit(A, circle).expect("accepted");
    assert_nothing_allocated("predictive", &mut fixture.simulation, |_| ());
}

#[test]
fn coupled_axes_allocate_nothing() {
    let workpiece = ["workpiece.mass_kg=400", "workpiece.center_of_mass_x_mm=200"];
    let config = configured_with("mikron_ucp710", &[], &workpiece);
    let joints = joint_limits(&config, "");
    let mut simulation = Simulation::new(&config, joints, 0).expect("can be simulated");
    assert_nothing_allocated("coupled", &mut simulation, |simulation| {
        simulation.set_load(3, 3000.0, 20 * TSP);
        simulation.set_load(4, -2000.0, 20 * TSP);
    });
}
