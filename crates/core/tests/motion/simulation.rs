//! Trajectories in the complete simulation: preemption per joint, start instants, bit-identical repetition.

use crate::simulation_common::{NONE, SimulationFixture, TSP, X};
use virtual_axes_core::simulation::{AbortReason, MotionOutcome};
use virtual_axes_core::trajectory::{MotionId, Start};
use virtual_axes_core::units::SECOND_NS;
use virtual_axes_verification::fixtures::machines::assert_near;

#[test]
fn a_trajectory_is_bit_identical_for_any_waiting_time() {
    let mut at_once = SimulationFixture::new(NONE, 0);
    at_once.simulation.submit(MotionId(1), at_once.ballbar(Start::Now)).expect("accepted");
    let (rows, ends) = at_once.run();
    assert_eq!(ends.len(), 1);

    let mut later = SimulationFixture::new(NONE, 1_700_000_000 * SECOND_NS);
    for _ in 0..777 {
        later.simulation.step();
    }
    later.simulation.submit(MotionId(1), later.ballbar(Start::Now)).expect("accepted");
    assert_eq!(later.run().0, rows);

    later.simulation.reset();
    for _ in 0..5 {
        later.simulation.step();
    }
    let start = Start::At(later.origin + 4000 * TSP - 1);
    later.simulation.submit(MotionId(2), later.ballbar(start)).expect("accepted");
    let (waited, _) = later.run();
    let wait = waited.len() - rows.len();
    assert_eq!(wait, 4000 - (777 + rows.len() + 5), "start at the first instant at or after the stamp");
    assert_eq!(waited[wait..], rows[..]);
}

#[test]
fn a_copy_amid_motion_continues_with_the_same_bits() {
    let mut original = SimulationFixture::new(NONE, 0);
    original.simulation.submit(MotionId(1), original.ballbar(Start::Now)).expect("accepted");
    for _ in 0..300 {
        original.simulation.step();
    }
    assert!(original.simulation.is_in_motion());
    let mut copy = original.simulation.clone();
    for cycle in 0..500 {
        // At the end of a position cycle the machine is where the next one starts.
        let end = original.simulation.machine().motion_at_end(X)[0];
        assert_eq!(original.simulation.step(), copy.step());
        assert_eq!(original.simulation.samples(), copy.samples(), "cycle {cycle}");
        assert_eq!(original.simulation.samples()[X].position, end, "cycle {cycle}");
    }
}

#[test]
fn the_ballbar_report_matches_the_reference_values() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    fixture.simulation.submit(MotionId(1), fixture.ballbar(Start::Now)).expect("accepted");
    let (_, ends) = fixture.run();
    let end = &ends[0];
    assert_eq!((end.outcome, end.axis_indices.as_slice()), (MotionOutcome::Completed, &[0, 1][..]));
    let x = end.report.axes[0];
    // 3 mm at 15 m/min: pure delay of two position cycles.
    assert_near("X following error, m", x.max_following_error, 0.003, 0.0002);
    assert!(x.saturation_time == 0.0 && x.peak_current > 2.0);
    // 49 µm outside the circle in steady motion, relative to the polyline through its points.
    let contour = end.report.max_contour_error.expect("contour error of linear axes");
    assert!((50e-6..90e-6).contains(&contour), "contour error {contour}");
}

#[test]
fn a_trajectory_of_one_joint_does_not_affect_other_joints() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    let slow = fixture.trajectory(Start::Now, &["x", "y"], &[(0, &[0.0, 0.0]), (SECOND_NS, &[0.05, 0.05])]);
    let y = fixture.trajectory(Start::At(SECOND_NS / 2), &["y"], &[(SECOND_NS, &[0.0])]);
    fixture.simulation.submit(MotionId(1), slow).expect("accepted");
    fixture.simulation.submit(MotionId(2), y).expect("accepted");
    let (_, ends) = fixture.run();
    let outcomes: Vec<_> = ends.iter().map(|e| (e.id, e.outcome)).collect();
    assert_eq!(
        outcomes,
        [
            (MotionId(1), MotionOutcome::Preempted { by: MotionId(2) }),
            (MotionId(2), MotionOutcome::Completed)
        ]
    );
    let samples = fixture.simulation.samples();
    assert_near("x", samples[0].position, 0.05, 2e-6);
    assert_near("y", samples[1].position, 0.0, 2e-6);
}

#[test]
fn a_load_acts_for_its_hold_time() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    fixture.simulation.set_load(X, -800.0, SECOND_NS / 10);
    let mut loaded = 0;
    for _ in 0..100 {
        fixture.simulation.step();
        loaded += usize::from(fixture.simulation.machine().axis(X).sample().load_current > 0.0);
    }
    // 0.1 s is 16 complete position cycles.
    assert_eq!(loaded, 16);
    assert_near("x after the load", fixture.simulation.samples()[X].position, 0.0, 2e-6);
}

#[test]
fn the_largest_load_and_nan_keep_the_state_finite() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    fixture.simulation.set_load(X, f64::INFINITY, SECOND_NS);
    fixture.simulation.set_load(2, f64::NAN, SECOND_NS);
    for _ in 0..300 {
        fixture.simulation.step();
        for sample in fixture.simulation.samples() {
            assert!(sample.position.is_finite() && sample.current.is_finite(), "{sample:?}");
        }
    }
    fixture.simulation.reset();
    fixture.simulation.step();
    assert_eq!(fixture.simulation.samples()[X].position, 0.0);
}

#[test]
fn a_reset_aborts_active_motions() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    fixture.simulation.submit(MotionId(1), fixture.ballbar(Start::Now)).expect("accepted");
    for _ in 0..300 {
        fixture.simulation.step();
    }
    fixture.simulation.reset();
    let ends: Vec<_> = fixture.simulation.drain_finished().collect();
    assert_eq!((ends.len(), ends[0].outcome), (1, MotionOutcome::Aborted(AbortReason::Reset)));
    fixture.simulation.step();
    assert_eq!(fixture.simulation.samples()[X].position, 0.0);
    assert!(!fixture.simulation.is_moving());
}
