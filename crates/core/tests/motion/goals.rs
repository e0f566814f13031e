//! Path and goal tolerances, cancellation, clock jumps.

use crate::simulation_common::{NONE, SimulationFixture, TSP, X};
use virtual_axes_core::simulation::{AbortReason, MotionEnd, MotionOutcome, Quantity, Tolerance, Tolerances};
use virtual_axes_core::trajectory::{MotionId, Start};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS, seconds};
use virtual_axes_verification::fixtures::machines::assert_near;

const A: MotionId = MotionId(1);
const B: MotionId = MotionId(2);

/// X without feedforward: following error V/Kp (Kp = 1.5 (m/min)/mm = 25 1/s).
const LAGGING: &[(&str, f64)] = &[("x.feedforward.velocity", 0.0)];
const FEED: f64 = 10.0 / 60.0;
const LAG: f64 = FEED / 25.0;

fn within(position: f64) -> Tolerance {
    Tolerance { position: Some(position), ..Tolerance::default() }
}

fn path(tolerance: Tolerance) -> Tolerances {
    Tolerances { path: vec![tolerance], goal: vec![Tolerance::default()], goal_time: None }
}

fn goal(tolerance: Tolerance, goal_time: Option<Nanoseconds>) -> Tolerances {
    Tolerances { path: vec![Tolerance::default()], goal: vec![tolerance], goal_time }
}

/// X at 10 m/min for one second.
fn line(
    fixture: &SimulationFixture,
    start: Start,
) -> std::sync::Arc<virtual_axes_core::trajectory::Trajectory> {
    fixture.trajectory(
        start,
        &["x"],
        &[(0, &[0.0]), (SECOND_NS / TSP * TSP, &[FEED * seconds(SECOND_NS / TSP * TSP)])],
    )
}

/// Steps until a motion finishes or no command is active.
fn next_finished(fixture: &mut SimulationFixture) -> Option<MotionEnd> {
    for _ in 0..10_000 {
        fixture.simulation.step();
        if let Some(end) = fixture.simulation.drain_finished().next() {
            return Some(end);
        }
        if !fixture.simulation.is_busy() {
            return None;
        }
    }
    panic!("no motion finishes");
}

/// Returns the setpoints of X at the next instants.
fn setpoints(fixture: &mut SimulationFixture, count: usize) -> Vec<f64> {
    let step = |_| {
        fixture.simulation.step();
        fixture.simulation.samples()[X].psec
    };
    (0..count).map(step).collect()
}

/// Asserts that the setpoints come to rest within Amax and Jmax, by differences over a position cycle.
fn assert_controlled_stop(psec: &[f64]) {
    let tsp = seconds(TSP);
    let differences = |v: &[f64]| v.windows(2).map(|w| (w[1] - w[0]) / tsp).collect::<Vec<_>>();
    let velocity = differences(psec);
    let acceleration = differences(&velocity);
    // X of the default machine: 2.5 m/s².
    let largest = acceleration.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert!((2.0..=2.5 * (1.0 + 1e-6)).contains(&largest), "largest acceleration {largest} m/s²");
    assert_eq!(velocity.last(), Some(&0.0));
}

#[test]
fn a_path_tolerance_violation_stops_the_motion() {
    let mut fixture = SimulationFixture::new(LAGGING, 0);
    let limit = 0.75 * LAG;
    fixture
        .simulation
        .submit_with_tolerances(A, line(&fixture, Start::Now), path(within(limit)))
        .expect("accepted");
    let end = next_finished(&mut fixture).expect("finished motion");
    let MotionOutcome::PathTolerance(violation) = end.outcome else { panic!("{:?}", end.outcome) };
    assert_eq!((violation.axis_index, violation.quantity, violation.limit), (X, Quantity::Position, limit));
    // Detected at the first instant: at most one position cycle of motion beyond the limit.
    assert!((limit..limit + FEED * seconds(TSP)).contains(&violation.error), "{violation:?}");
    let mut psec = vec![
        fixture.simulation.samples()[X].psec - FEED * seconds(TSP),
        fixture.simulation.samples()[X].psec,
    ];
    psec.extend(setpoints(&mut fixture, 100));
    assert_controlled_stop(&psec);
    assert!(next_finished(&mut fixture).is_none(), "the motion finishes once");
}

#[test]
fn pure_delay_and_following_error_within_the_path_tolerance_are_no_violation() {
    for (changes, limit) in [(LAGGING, 1.01 * LAG), (NONE, 0.75 * FEED * 2.0 * seconds(TSP))] {
        let mut fixture = SimulationFixture::new(changes, 0);
        fixture
            .simulation
            .submit_with_tolerances(A, line(&fixture, Start::Now), path(within(limit)))
            .expect("accepted");
        assert_eq!(next_finished(&mut fixture).expect("finished motion").outcome, MotionOutcome::Completed);
    }
}

#[test]
fn velocity_and_acceleration_have_separate_tolerances() {
    // At the velocity step the axis without feedforward has the full feed as its error within one cycle.
    let velocity = Tolerance { velocity: Some(0.5 * FEED), ..Tolerance::default() };
    let acceleration = Tolerance { acceleration: Some(0.5 * FEED / seconds(TSP)), ..Tolerance::default() };
    for (tolerance, quantity, most) in
        [(velocity, Quantity::Velocity, FEED), (acceleration, Quantity::Acceleration, FEED / seconds(TSP))]
    {
        let mut fixture = SimulationFixture::new(LAGGING, 0);
        fixture
            .simulation
            .submit_with_tolerances(A, line(&fixture, Start::Now), path(tolerance))
            .expect("accepted");
        let end = next_finished(&mut fixture).expect("finished motion");
        let MotionOutcome::PathTolerance(violation) = end.outcome else { panic!("{:?}", end.outcome) };
        assert_eq!(violation.quantity, quantity);
        assert!(violation.error > violation.limit && violation.error <= most, "{violation:?}");
    }
}

#[test]
fn the_goal_tolerance_is_reached_within_the_goal_time_or_violated() {
    // The error decays as exp(−25 t): 1 % is reached after 0.184 s plus the pure delay.
    let limit = 0.01 * LAG;
    let decay = 100.0_f64.ln() / 25.0;
    let finish = |goal_time| {
        let mut fixture = SimulationFixture::new(LAGGING, 0);
        let admission = fixture.simulation.submit_with_tolerances(
            A,
            line(&fixture, Start::Now),
            goal(within(limit), goal_time),
        );
        let last = fixture.simulation.time_of(admission.expect("accepted").end_k);
        let end = next_finished(&mut fixture).expect("finished motion");
        (end.outcome, seconds(end.time - last))
    };
    // The delay of 9 ms is two position cycles.
    let delay = 2.0 * seconds(TSP);
    for goal_time in [None, Some(SECOND_NS)] {
        let (outcome, late) = finish(goal_time);
        assert_eq!(outcome, MotionOutcome::Completed);
        assert_near("time to the goal tolerance, s", late, delay + decay, 0.03);
    }
    let (outcome, late) = finish(Some(SECOND_NS / 10));
    assert!(
        matches!(outcome, MotionOutcome::GoalTolerance(v) if v.limit == limit && v.error > limit),
        "{outcome:?}"
    );
    // The first instant at or after the goal time.
    assert_near("time allowed, s", late, delay + (0.1 / seconds(TSP)).ceil() * seconds(TSP), 1e-9);
}

#[test]
fn a_motion_waiting_for_its_goal_tolerance_is_preempted_by_a_successor() {
    let mut fixture = SimulationFixture::new(LAGGING, 0);
    fixture
        .simulation
        .submit_with_tolerances(A, line(&fixture, Start::Now), goal(within(1e-12), None))
        .expect("accepted");
    setpoints(&mut fixture, 200);
    assert_eq!(fixture.simulation.drain_finished().count(), 0, "the motion waits");
    let back = fixture.trajectory(Start::Now, &["x"], &[(SECOND_NS, &[0.0])]);
    fixture.simulation.submit(B, back).expect("accepted");
    let end = next_finished(&mut fixture).expect("finished motion");
    assert_eq!((end.id, end.outcome), (A, MotionOutcome::Preempted { by: B }));
}

#[test]
fn a_canceled_motion_stops_within_the_limits() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    assert!(!fixture.simulation.cancel(A), "unknown motion");
    fixture.simulation.submit(A, line(&fixture, Start::Now)).expect("accepted");
    setpoints(&mut fixture, 50);
    assert!(fixture.simulation.cancel(A) && fixture.simulation.cancel(A), "a repeated cancel has no effect");
    assert!(fixture.simulation.drain_finished().next().is_none(), "not at rest yet");
    let end = next_finished(&mut fixture).expect("finished motion");
    assert_eq!((end.id, end.outcome), (A, MotionOutcome::Canceled));
    let rest = fixture.simulation.samples()[X].psec;
    let mut again = SimulationFixture::new(NONE, 0);
    again.simulation.submit(A, line(&again, Start::Now)).expect("accepted");
    setpoints(&mut again, 50);
    again.simulation.cancel(A);
    let psec = setpoints(&mut again, 150);
    assert_controlled_stop(&psec);
    assert_eq!(*psec.last().expect("setpoints"), rest, "finished at the first instant at rest");
    assert!(!fixture.simulation.cancel(A), "finished");
}

#[test]
fn canceling_a_waiting_motion_does_not_affect_the_active_motion() {
    let mut alone = SimulationFixture::new(NONE, 0);
    alone.simulation.submit(A, line(&alone, Start::Now)).expect("accepted");
    let expected = setpoints(&mut alone, 250);

    let mut fixture = SimulationFixture::new(NONE, 0);
    fixture.simulation.submit(A, line(&fixture, Start::Now)).expect("accepted");
    let back = fixture.trajectory(Start::At(90 * TSP), &["x"], &[(SECOND_NS, &[0.0])]);
    let behind = fixture.trajectory(Start::At(300 * TSP), &["x"], &[(SECOND_NS, &[0.01])]);
    fixture.simulation.submit(B, back).expect("accepted");
    fixture.simulation.submit(MotionId(3), behind).expect("accepted");
    let mut found = setpoints(&mut fixture, 20);
    assert!(fixture.simulation.cancel(B));
    found.extend(setpoints(&mut fixture, 230));
    assert_eq!(found, expected);
    let mut ends: Vec<_> = fixture.simulation.drain_finished().map(|end| (end.id, end.outcome)).collect();
    ends.sort_by_key(|(id, _)| *id);
    assert_eq!(
        ends,
        [(A, MotionOutcome::Completed), (B, MotionOutcome::Canceled), (MotionId(3), MotionOutcome::Stopped)]
    );
}

#[test]
fn a_motion_without_remaining_setpoints_is_canceled_immediately() {
    let mut fixture = SimulationFixture::new(LAGGING, 0);
    fixture
        .simulation
        .submit_with_tolerances(A, line(&fixture, Start::Now), goal(within(1e-12), None))
        .expect("accepted");
    setpoints(&mut fixture, 200);
    assert!(fixture.simulation.cancel(A));
    let ends: Vec<_> = fixture.simulation.drain_finished().map(|end| end.outcome).collect();
    assert_eq!(ends, [MotionOutcome::Canceled]);
}

#[test]
fn a_successor_does_not_change_the_outcome_of_a_canceled_motion() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    fixture.simulation.submit(A, line(&fixture, Start::Now)).expect("accepted");
    setpoints(&mut fixture, 50);
    fixture.simulation.cancel(A);
    setpoints(&mut fixture, 3);
    let back = fixture.trajectory(Start::Now, &["x"], &[(SECOND_NS, &[0.0])]);
    fixture.simulation.submit(B, back).expect("accepted");
    let end = next_finished(&mut fixture).expect("finished motion");
    assert_eq!((end.id, end.outcome), (A, MotionOutcome::Canceled));
    let end = next_finished(&mut fixture).expect("finished motion");
    assert_eq!((end.id, end.outcome), (B, MotionOutcome::Completed));
}

#[test]
fn canceling_one_motion_does_not_affect_other_joints() {
    let mut fixture = SimulationFixture::new(NONE, 0);
    let xy = fixture.trajectory(Start::Now, &["x", "y"], &[(0, &[0.0, 0.0]), (SECOND_NS, &[0.1, 0.1])]);
    fixture.simulation.submit(A, xy).expect("accepted");
    let z = fixture.trajectory(Start::Now, &["z"], &[(SECOND_NS, &[0.05])]);
    fixture.simulation.submit(B, z).expect("accepted");
    setpoints(&mut fixture, 40);
    fixture.simulation.cancel(A);
    let ends: Vec<_> =
        std::iter::from_fn(|| next_finished(&mut fixture)).map(|e| (e.id, e.outcome)).collect();
    assert_eq!(ends, [(A, MotionOutcome::Canceled), (B, MotionOutcome::Completed)]);
    assert_eq!(fixture.simulation.samples()[2].psec, 0.05);
}

#[test]
fn a_change_of_the_clock_aborts_motions_at_once() {
    let mut fixture = SimulationFixture::new(NONE, 500 * SECOND_NS);
    fixture.simulation.submit(A, line(&fixture, Start::Now)).expect("accepted");
    let waits = fixture.trajectory(Start::At(520 * SECOND_NS), &["y"], &[(SECOND_NS, &[0.01])]);
    fixture.simulation.submit(B, waits).expect("accepted");
    setpoints(&mut fixture, 50);
    fixture.simulation.prepare_clock_change();
    let ends: Vec<_> = fixture.simulation.drain_finished().map(|e| (e.id, e.outcome)).collect();
    let aborted = MotionOutcome::Aborted(AbortReason::ClockChange);
    assert_eq!(ends, [(A, aborted), (B, aborted)]);
    fixture.simulation.jump_to(0);
    assert_controlled_stop(&setpoints(&mut fixture, 200));
    assert!(next_finished(&mut fixture).is_none());
}

#[test]
fn a_clock_jump_aborts_motions_and_stops_the_axes() {
    for target in [0, 1_700_000_000 * SECOND_NS, 3] {
        let mut fixture = SimulationFixture::new(NONE, 500 * SECOND_NS);
        fixture.simulation.submit(A, line(&fixture, Start::Now)).expect("accepted");
        let waits = fixture.trajectory(Start::At(520 * SECOND_NS), &["y"], &[(SECOND_NS, &[0.01])]);
        fixture.simulation.submit(B, waits).expect("accepted");
        setpoints(&mut fixture, 50);
        fixture.simulation.set_load(X, -500.0, 100 * SECOND_NS);
        let at = fixture.simulation.next_instant();
        let from = fixture.simulation.time_of(at - 1);
        fixture.simulation.jump_to(target);
        assert_eq!(fixture.simulation.time_of(at), target);
        let ends: Vec<_> = fixture.simulation.drain_finished().map(|e| (e.id, e.outcome)).collect();
        let aborted = MotionOutcome::Aborted(AbortReason::ClockJump { from, to: target });
        assert_eq!(ends, [(A, aborted), (B, aborted)]);
        let psec = setpoints(&mut fixture, 200);
        assert_controlled_stop(&psec);
        assert_eq!(fixture.simulation.samples()[X].load_current, 0.0);
        assert!(next_finished(&mut fixture).is_none());
        // Trajectories are accepted relative to the new time.
        let start = fixture.simulation.time_of(fixture.simulation.next_instant() + 10);
        let x = *psec.last().expect("setpoints");
        let on = fixture.trajectory(Start::At(start), &["x"], &[(0, &[x]), (SECOND_NS, &[0.0])]);
        let admission = fixture.simulation.submit(B, on).expect("accepted");
        assert_eq!(admission.start_k, fixture.simulation.next_instant() + 10);
    }
}
