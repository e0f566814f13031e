//! Motions that have to keep tolerances, are called off, or lose their clock.

use crate::simulation_common::{Bench, NONE, TSP, X};
use virtual_axes_core::simulation::{AbortReason, MotionEnd, MotionOutcome, Quantity, Tolerance, Tolerances};
use virtual_axes_core::trajectory::{MotionId, Start};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS, seconds};
use virtual_axes_verification::fixtures::machines::assert_near;

const A: MotionId = MotionId(1);
const B: MotionId = MotionId(2);

/// X without feedforward: it lags V/Kp behind (Kp = 1.5 (m/min)/mm = 25 1/s).
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

/// X at 10 m/min for a second.
fn line(bench: &Bench, start: Start) -> std::sync::Arc<virtual_axes_core::trajectory::Trajectory> {
    bench.trajectory(
        start,
        &["x"],
        &[(0, &[0.0]), (SECOND_NS / TSP * TSP, &[FEED * seconds(SECOND_NS / TSP * TSP)])],
    )
}

/// Steps until something ends, or nothing is asked any more.
fn next_end(bench: &mut Bench) -> Option<MotionEnd> {
    for _ in 0..10_000 {
        bench.simulation.step();
        if let Some(end) = bench.simulation.drain_finished().next() {
            return Some(end);
        }
        if !bench.simulation.is_busy() {
            return None;
        }
    }
    panic!("nothing ends");
}

/// Setpoints of X over the next instants.
fn setpoints(bench: &mut Bench, count: usize) -> Vec<f64> {
    let step = |_| {
        bench.simulation.step();
        bench.simulation.samples()[X].psec
    };
    (0..count).map(step).collect()
}

/// Setpoints come to rest within Amax and Jmax, as differences over a period show them.
fn assert_controlled_stop(psec: &[f64]) {
    let tsp = seconds(TSP);
    let differences = |v: &[f64]| v.windows(2).map(|w| (w[1] - w[0]) / tsp).collect::<Vec<_>>();
    let velocity = differences(psec);
    let acceleration = differences(&velocity);
    // The default machine's X: 2.5 m/s².
    let largest = acceleration.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert!((2.0..=2.5 * (1.0 + 1e-6)).contains(&largest), "largest acceleration {largest} m/s²");
    assert_eq!(velocity.last(), Some(&0.0));
}

#[test]
fn a_motion_that_strays_from_its_path_is_stopped_where_it_does() {
    let mut bench = Bench::new(LAGGING, 0);
    let limit = 0.75 * LAG;
    bench
        .simulation
        .submit_with_tolerances(A, line(&bench, Start::Now), path(within(limit)))
        .expect("accepted");
    let end = next_end(&mut bench).expect("it ends");
    let MotionOutcome::PathTolerance(violation) = end.outcome else { panic!("{:?}", end.outcome) };
    assert_eq!((violation.axis_index, violation.quantity, violation.limit), (X, Quantity::Position, limit));
    // Seen at the first instant at which it is: one period of motion beyond the limit at most.
    assert!((limit..limit + FEED * seconds(TSP)).contains(&violation.error), "{violation:?}");
    let mut psec =
        vec![bench.simulation.samples()[X].psec - FEED * seconds(TSP), bench.simulation.samples()[X].psec];
    psec.extend(setpoints(&mut bench, 100));
    assert_controlled_stop(&psec);
    assert!(next_end(&mut bench).is_none(), "it ends once");
}

#[test]
fn the_pure_delay_and_a_lag_inside_the_tolerance_are_no_violation() {
    for (changes, limit) in [(LAGGING, 1.01 * LAG), (NONE, 0.75 * FEED * 2.0 * seconds(TSP))] {
        let mut bench = Bench::new(changes, 0);
        bench
            .simulation
            .submit_with_tolerances(A, line(&bench, Start::Now), path(within(limit)))
            .expect("accepted");
        assert_eq!(next_end(&mut bench).expect("it ends").outcome, MotionOutcome::Completed);
    }
}

#[test]
fn velocity_and_acceleration_have_tolerances_of_their_own() {
    // At the step in velocity the lagging axis has all of the feed as its error, within a period.
    let velocity = Tolerance { velocity: Some(0.5 * FEED), ..Tolerance::default() };
    let acceleration = Tolerance { acceleration: Some(0.5 * FEED / seconds(TSP)), ..Tolerance::default() };
    for (tolerance, quantity, most) in
        [(velocity, Quantity::Velocity, FEED), (acceleration, Quantity::Acceleration, FEED / seconds(TSP))]
    {
        let mut bench = Bench::new(LAGGING, 0);
        bench
            .simulation
            .submit_with_tolerances(A, line(&bench, Start::Now), path(tolerance))
            .expect("accepted");
        let end = next_end(&mut bench).expect("it ends");
        let MotionOutcome::PathTolerance(violation) = end.outcome else { panic!("{:?}", end.outcome) };
        assert_eq!(violation.quantity, quantity);
        assert!(violation.error > violation.limit && violation.error <= most, "{violation:?}");
    }
}

#[test]
fn the_goal_is_reached_in_time_or_not() {
    // From the lag on it creeps in as exp(−25 t): 1 % of it takes 0.184 s, from the pure delay on.
    let limit = 0.01 * LAG;
    let creep = 100.0_f64.ln() / 25.0;
    let end_of = |goal_time| {
        let mut bench = Bench::new(LAGGING, 0);
        let admission = bench.simulation.submit_with_tolerances(
            A,
            line(&bench, Start::Now),
            goal(within(limit), goal_time),
        );
        let last = bench.simulation.time_of(admission.expect("accepted").end_k);
        let end = next_end(&mut bench).expect("it ends");
        (end.outcome, seconds(end.time - last))
    };
    // The delay of 9 ms is two periods on the grid.
    let delay = 2.0 * seconds(TSP);
    for goal_time in [None, Some(SECOND_NS)] {
        let (outcome, late) = end_of(goal_time);
        assert_eq!(outcome, MotionOutcome::Completed);
        assert_near("time to creep in, s", late, delay + creep, 0.03);
    }
    let (outcome, late) = end_of(Some(SECOND_NS / 10));
    assert!(
        matches!(outcome, MotionOutcome::GoalTolerance(v) if v.limit == limit && v.error > limit),
        "{outcome:?}"
    );
    // The first instant that is not before the time allowed.
    assert_near("time allowed, s", late, delay + (0.1 / seconds(TSP)).ceil() * seconds(TSP), 1e-9);
}

#[test]
fn who_waits_for_its_goal_gives_way_to_a_successor() {
    let mut bench = Bench::new(LAGGING, 0);
    bench
        .simulation
        .submit_with_tolerances(A, line(&bench, Start::Now), goal(within(1e-12), None))
        .expect("accepted");
    setpoints(&mut bench, 200);
    assert_eq!(bench.simulation.drain_finished().count(), 0, "it waits");
    let back = bench.trajectory(Start::Now, &["x"], &[(SECOND_NS, &[0.0])]);
    bench.simulation.submit(B, back).expect("accepted");
    let end = next_end(&mut bench).expect("it ends");
    assert_eq!((end.id, end.outcome), (A, MotionOutcome::Preempted { by: B }));
}

#[test]
fn a_motion_that_is_called_off_stops_within_the_limits() {
    let mut bench = Bench::new(NONE, 0);
    assert!(!bench.simulation.cancel(A), "there is none");
    bench.simulation.submit(A, line(&bench, Start::Now)).expect("accepted");
    setpoints(&mut bench, 50);
    assert!(bench.simulation.cancel(A) && bench.simulation.cancel(A), "twice is as once");
    assert!(bench.simulation.drain_finished().next().is_none(), "it is not at rest yet");
    let end = next_end(&mut bench).expect("it ends");
    assert_eq!((end.id, end.outcome), (A, MotionOutcome::Canceled));
    let rest = bench.simulation.samples()[X].psec;
    let mut again = Bench::new(NONE, 0);
    again.simulation.submit(A, line(&again, Start::Now)).expect("accepted");
    setpoints(&mut again, 50);
    again.simulation.cancel(A);
    let psec = setpoints(&mut again, 150);
    assert_controlled_stop(&psec);
    assert_eq!(*psec.last().expect("setpoints"), rest, "its end is the first instant at rest");
    assert!(!bench.simulation.cancel(A), "it is over");
}

#[test]
fn one_that_waits_is_called_off_without_a_trace_in_what_moves() {
    let mut alone = Bench::new(NONE, 0);
    alone.simulation.submit(A, line(&alone, Start::Now)).expect("accepted");
    let expected = setpoints(&mut alone, 250);

    let mut bench = Bench::new(NONE, 0);
    bench.simulation.submit(A, line(&bench, Start::Now)).expect("accepted");
    let back = bench.trajectory(Start::At(90 * TSP), &["x"], &[(SECOND_NS, &[0.0])]);
    let behind = bench.trajectory(Start::At(300 * TSP), &["x"], &[(SECOND_NS, &[0.01])]);
    bench.simulation.submit(B, back).expect("accepted");
    bench.simulation.submit(MotionId(3), behind).expect("accepted");
    let mut found = setpoints(&mut bench, 20);
    assert!(bench.simulation.cancel(B));
    found.extend(setpoints(&mut bench, 230));
    assert_eq!(found, expected);
    let mut ends: Vec<_> = bench.simulation.drain_finished().map(|end| (end.id, end.outcome)).collect();
    ends.sort_by_key(|(id, _)| *id);
    assert_eq!(
        ends,
        [(A, MotionOutcome::Completed), (B, MotionOutcome::Canceled), (MotionId(3), MotionOutcome::Stopped)]
    );
}

#[test]
fn one_whose_set_points_are_over_is_called_off_at_once() {
    let mut bench = Bench::new(LAGGING, 0);
    bench
        .simulation
        .submit_with_tolerances(A, line(&bench, Start::Now), goal(within(1e-12), None))
        .expect("accepted");
    setpoints(&mut bench, 200);
    assert!(bench.simulation.cancel(A));
    let ends: Vec<_> = bench.simulation.drain_finished().map(|end| end.outcome).collect();
    assert_eq!(ends, [MotionOutcome::Canceled]);
}

#[test]
fn a_successor_of_what_is_being_called_off_leaves_it_canceled() {
    let mut bench = Bench::new(NONE, 0);
    bench.simulation.submit(A, line(&bench, Start::Now)).expect("accepted");
    setpoints(&mut bench, 50);
    bench.simulation.cancel(A);
    setpoints(&mut bench, 3);
    let back = bench.trajectory(Start::Now, &["x"], &[(SECOND_NS, &[0.0])]);
    bench.simulation.submit(B, back).expect("accepted");
    let end = next_end(&mut bench).expect("it ends");
    assert_eq!((end.id, end.outcome), (A, MotionOutcome::Canceled));
    let end = next_end(&mut bench).expect("it ends");
    assert_eq!((end.id, end.outcome), (B, MotionOutcome::Completed));
}

#[test]
fn calling_one_of_two_off_leaves_the_other_joints_alone() {
    let mut bench = Bench::new(NONE, 0);
    let xy = bench.trajectory(Start::Now, &["x", "y"], &[(0, &[0.0, 0.0]), (SECOND_NS, &[0.1, 0.1])]);
    bench.simulation.submit(A, xy).expect("accepted");
    let z = bench.trajectory(Start::Now, &["z"], &[(SECOND_NS, &[0.05])]);
    bench.simulation.submit(B, z).expect("accepted");
    setpoints(&mut bench, 40);
    bench.simulation.cancel(A);
    let ends: Vec<_> = std::iter::from_fn(|| next_end(&mut bench)).map(|e| (e.id, e.outcome)).collect();
    assert_eq!(ends, [(A, MotionOutcome::Canceled), (B, MotionOutcome::Completed)]);
    assert_eq!(bench.simulation.samples()[2].psec, 0.05);
}

#[test]
fn a_clock_that_jumps_ends_motions_and_brings_axes_to_rest() {
    for target in [0, 1_700_000_000 * SECOND_NS, 3] {
        let mut bench = Bench::new(NONE, 500 * SECOND_NS);
        bench.simulation.submit(A, line(&bench, Start::Now)).expect("accepted");
        let waits = bench.trajectory(Start::At(520 * SECOND_NS), &["y"], &[(SECOND_NS, &[0.01])]);
        bench.simulation.submit(B, waits).expect("accepted");
        setpoints(&mut bench, 50);
        bench.simulation.set_load(X, -500.0, 100 * SECOND_NS);
        let at = bench.simulation.next_instant();
        let from = bench.simulation.time_of(at - 1);
        bench.simulation.jump_to(target);
        assert_eq!(bench.simulation.time_of(at), target);
        let ends: Vec<_> = bench.simulation.drain_finished().map(|e| (e.id, e.outcome)).collect();
        let aborted = MotionOutcome::Aborted(AbortReason::ClockJump { from, to: target });
        assert_eq!(ends, [(A, aborted), (B, aborted)]);
        let psec = setpoints(&mut bench, 200);
        assert_controlled_stop(&psec);
        assert_eq!(bench.simulation.samples()[X].load_current, 0.0);
        assert!(next_end(&mut bench).is_none());
        // It takes trajectories by the new time.
        let start = bench.simulation.time_of(bench.simulation.next_instant() + 10);
        let x = *psec.last().expect("setpoints");
        let on = bench.trajectory(Start::At(start), &["x"], &[(0, &[x]), (SECOND_NS, &[0.0])]);
        let admission = bench.simulation.submit(B, on).expect("accepted");
        assert_eq!(admission.start_k, bench.simulation.next_instant() + 10);
    }
}
