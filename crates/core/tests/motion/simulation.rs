//! Trajectories through the whole simulation: who moves what, when, and the same bits every time.

use crate::simulation_common::{Bench, NONE, TSP, X};
use virtual_axes_core::simulation::{AbortReason, MotionOutcome};
use virtual_axes_core::trajectory::{MotionId, Start};
use virtual_axes_core::units::SECOND_NS;
use virtual_axes_verification::fixtures::machines::assert_near;

#[test]
fn waiting_before_a_trajectory_changes_no_bit_of_it() {
    let mut at_once = Bench::new(NONE, 0);
    at_once.simulation.submit(MotionId(1), at_once.ballbar(Start::Now)).expect("accepted");
    let (rows, ends) = at_once.run();
    assert_eq!(ends.len(), 1);

    let mut later = Bench::new(NONE, 1_700_000_000 * SECOND_NS);
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
    assert_eq!(wait, 4000 - (777 + rows.len() + 5), "it starts at the instant after its stamp");
    assert_eq!(waited[wait..], rows[..]);
}

#[test]
fn the_report_of_the_ballbar_has_the_reference_numbers() {
    let mut bench = Bench::new(NONE, 0);
    bench.simulation.submit(MotionId(1), bench.ballbar(Start::Now)).expect("accepted");
    let (_, ends) = bench.run();
    let end = &ends[0];
    assert_eq!((end.outcome, end.axis_indices.as_slice()), (MotionOutcome::Completed, &[0, 1][..]));
    let x = end.report.axes[0];
    // Three millimeters at 15 m/min: the pure delay of two position periods.
    assert_near("X tracking error, m", x.max_following_error, 0.003, 0.0002);
    assert!(x.saturation_time == 0.0 && x.peak_current > 2.0);
    // 49 µm outside the circle in steady motion, against the polyline through its points.
    let contour = end.report.max_contour_error.expect("there are linear axes");
    assert!((50e-6..90e-6).contains(&contour), "contour error {contour}");
}

#[test]
fn a_trajectory_of_one_joint_leaves_the_others_to_theirs() {
    let mut bench = Bench::new(NONE, 0);
    let slow = bench.trajectory(Start::Now, &["x", "y"], &[(0, &[0.0, 0.0]), (SECOND_NS, &[0.05, 0.05])]);
    let y = bench.trajectory(Start::At(SECOND_NS / 2), &["y"], &[(SECOND_NS, &[0.0])]);
    bench.simulation.submit(MotionId(1), slow).expect("accepted");
    bench.simulation.submit(MotionId(2), y).expect("accepted");
    let (_, ends) = bench.run();
    let outcomes: Vec<_> = ends.iter().map(|e| (e.id, e.outcome)).collect();
    assert_eq!(
        outcomes,
        [
            (MotionId(1), MotionOutcome::Preempted { by: MotionId(2) }),
            (MotionId(2), MotionOutcome::Completed)
        ]
    );
    let samples = bench.simulation.samples();
    assert_near("x", samples[0].position, 0.05, 2e-6);
    assert_near("y", samples[1].position, 0.0, 2e-6);
}

#[test]
fn a_load_acts_for_its_time_and_then_is_gone() {
    let mut bench = Bench::new(NONE, 0);
    bench.simulation.set_load(X, -800.0, SECOND_NS / 10);
    let mut loaded = 0;
    for _ in 0..100 {
        bench.simulation.step();
        loaded += usize::from(bench.simulation.machine().axis(X).sample().load_current > 0.0);
    }
    // 0.1 s are 16 whole position periods.
    assert_eq!(loaded, 16);
    assert_near("x is back", bench.simulation.samples()[X].position, 0.0, 2e-6);
}

#[test]
fn the_largest_load_leaves_every_number_finite() {
    let mut bench = Bench::new(NONE, 0);
    bench.simulation.set_load(X, f64::INFINITY, SECOND_NS);
    bench.simulation.set_load(2, f64::NAN, SECOND_NS);
    for _ in 0..300 {
        bench.simulation.step();
        for sample in bench.simulation.samples() {
            assert!(sample.position.is_finite() && sample.current.is_finite(), "{sample:?}");
        }
    }
    bench.simulation.reset();
    bench.simulation.step();
    assert_eq!(bench.simulation.samples()[X].position, 0.0);
}

#[test]
fn a_reset_aborts_what_moves_and_forgets_it() {
    let mut bench = Bench::new(NONE, 0);
    bench.simulation.submit(MotionId(1), bench.ballbar(Start::Now)).expect("accepted");
    for _ in 0..300 {
        bench.simulation.step();
    }
    bench.simulation.reset();
    let ends: Vec<_> = bench.simulation.drain_finished().collect();
    assert_eq!((ends.len(), ends[0].outcome), (1, MotionOutcome::Aborted(AbortReason::Reset)));
    bench.simulation.step();
    assert_eq!(bench.simulation.samples()[X].position, 0.0);
    assert!(!bench.simulation.is_moving());
}
