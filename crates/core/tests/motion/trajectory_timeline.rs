//! Timeline: start instants, junctions of trajectories, preemption, stops, reset.

use crate::trajectory_common::*;
use std::f64::consts::TAU;
use std::sync::Arc;
use virtual_axes_core::trajectory::timeline::MAX_WAITING;
use virtual_axes_core::trajectory::{
    KinematicState, MotionId, RejectionCode, Start, Timeline, TimelineEvent, TrajectoryRequest,
};

const A: MotionId = MotionId(1);
const B: MotionId = MotionId(2);
const C: MotionId = MotionId(3);

fn is_preempted(id: MotionId, by: MotionId, joints: &[usize]) -> impl Fn(&TimelineEvent) -> bool {
    move |event| {
        matches!(event, TimelineEvent::Preempted { id: i, by: b, joints: j }
            if *i == id && *b == by && j.iter().eq(joints.iter().copied()))
    }
}

#[test]
fn start_now_begins_at_the_next_instant_with_exact_points() {
    let mut t = timeline();
    run(&mut t, 0, 3);
    let points: &[(i64, &[f64])] = &[(0, &[0.0]), (1, &[0.001]), (2, &[0.0031]), (3, &[0.004])];
    let admission = submit(&mut t, 1, &path(Start::Now, "x", points)).unwrap();
    assert_eq!((admission.start_k, admission.end_k, admission.is_late), (3, 6, false));
    let (psec, events) = run(&mut t, 0, 5);
    assert_eq!(psec, [0.0, 0.001, 0.0031, 0.004, 0.004]);
    assert_eq!(events, [(3, TimelineEvent::Started(A)), (6, TimelineEvent::Completed(A))]);
    assert!(!t.is_moving());
}

#[test]
fn a_start_between_two_instants_is_rounded_up() {
    let mut t = timeline();
    for (ns, k) in [(0, 20), (1, 21), (TSP - 1, 21)] {
        let start = Start::At(ORIGIN + 20 * TSP + ns);
        let trajectory = path(start, "x", &[(0, &[0.0]), (5, &[0.001])]);
        assert_eq!(submit(&mut t, 1, &trajectory).unwrap().start_k, k);
    }
}

#[test]
fn a_future_start_waits_while_the_active_trajectory_continues() {
    let mut t = timeline();
    let first = path(Start::Now, "x", &[(0, &[0.0]), (100, &[0.1])]);
    submit(&mut t, 1, &first).unwrap();
    run(&mut t, 0, 5);
    // Position of the first one at instant 20.
    let second = path(at(20), "x", &[(0, &[0.02]), (10, &[0.02])]);
    submit(&mut t, 2, &second).unwrap();
    assert!(t.is_waiting());
    assert_eq!(t.psec_ahead(0, 10), Some(0.1 * 14.0 / 100.0));
    assert_eq!(t.psec_ahead(0, 1000), Some(0.02));
    let (psec, events) = run(&mut t, 0, 40);
    assert_eq!(psec[14], 0.1 * 19.0 / 100.0);
    assert_eq!(psec[15..].to_vec(), vec![0.02; 25]);
    assert_eq!(events.len(), 3);
    assert_eq!(events[0], (20, TimelineEvent::Started(B)));
    assert!(events[1].0 == 20 && is_preempted(A, B, &[0])(&events[1].1));
    assert_eq!(events[2], (30, TimelineEvent::Completed(B)));
}

#[test]
fn a_past_start_is_joined_at_the_present_time() {
    let mut t = timeline();
    run(&mut t, 0, 10);
    // At instant 10 the trajectory is at 0.002 m, within Vmax·Tsp.
    let late = path(at(8), "x", &[(0, &[0.0]), (100, &[0.1])]);
    let admission = submit(&mut t, 1, &late).unwrap();
    assert!(admission.is_late);
    assert_eq!((admission.start_k, admission.join_k), (8, 10));
    assert_eq!(run(&mut t, 0, 1).0, [0.002]);
}

#[test]
fn a_late_start_with_a_jump_is_rejected_with_the_distance() {
    let mut t = timeline();
    run(&mut t, 0, 50);
    let late = path(at(0), "x", &[(0, &[0.0]), (100, &[0.1])]);
    let rejection = submit(&mut t, 1, &late).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::Jump);
    assert_eq!(rejection.joint.as_deref(), Some("x"));
    assert!((rejection.value - 0.05).abs() < 1e-15);
    assert!((rejection.limit - 0.003).abs() < 1e-15);
}

#[test]
fn a_trajectory_in_the_past_is_rejected_and_one_at_its_last_point_is_accepted() {
    let mut t = timeline();
    run(&mut t, 0, 11);
    let ends_at = |k: i64| path(at(k - 2), "x", &[(0, &[0.0]), (2, &[0.001])]);
    let rejection = submit(&mut t, 1, &ends_at(10)).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::EndedInThePast);
    assert!((rejection.value - TSP_S).abs() < 1e-12);
    assert!(submit(&mut t, 2, &ends_at(11)).is_ok());
    assert_eq!(run(&mut t, 0, 1).0, [0.001]);
}

#[test]
fn a_jump_is_measured_from_the_setpoint_commanded_at_the_start() {
    let mut t = timeline();
    submit(&mut t, 1, &path(Start::Now, "x", &[(0, &[0.0]), (100, &[0.1])])).unwrap();
    let from = |position: f64| path(at(50), "x", &[(0, &[position]), (10, &[position])]);
    // Commanded at instant 49: 0.049 m; Vmax·Tsp: 0.003 m.
    assert!(submit(&mut t, 2, &from(0.052)).is_ok());
    assert_eq!(submit(&mut t, 3, &from(0.053)).unwrap_err().code, RejectionCode::Jump);
    assert_eq!(submit(&mut t, 4, &from(0.0)).unwrap_err().code, RejectionCode::Jump);
    let (psec, _) = run(&mut t, 0, 51);
    assert_eq!(psec[50], 0.052, "rejected trajectories change nothing");
}

#[test]
fn a_trajectory_on_a_continuous_joint_begins_at_the_nearest_turn() {
    let mut t = Timeline::new(joints(), TSP, &[0.0, 7.0]).unwrap();
    for turns in [-3.0, 0.0, 1.0, 12.0] {
        let begin = 7.0 + turns * TAU;
        let points: &[(i64, &[f64])] = &[(0, &[begin, 0.0]), (10, &[begin + 0.01, 0.0]), (20, &[begin, 0.0])];
        submit(&mut t, 1, &path(Start::Now, "c", points)).unwrap();
        let (psec, _) = run(&mut t, 1, 30);
        for (k, expected) in [(0, 7.0), (10, 7.01), (20, 7.0), (29, 7.0)] {
            assert!((psec[k] - expected).abs() < 1e-12, "{turns}: {} at {k}", psec[k]);
        }
    }
    // A later first point is an absolute angle, and a start between two turns is a jump.
    submit(&mut t, 1, &path(Start::Now, "c", &[(5000, &[7.0 - TAU, 0.0])])).unwrap();
    assert_eq!(run(&mut t, 1, 5001).0.last(), Some(&(7.0 - TAU)));
    let rejection = submit(&mut t, 2, &path(Start::Now, "c", &[(0, &[4.0]), (5, &[4.0])])).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::Jump);
    assert!((rejection.value - (4.0 - (7.0 - TAU) - TAU).abs()).abs() < 1e-12);
}

#[test]
fn a_stamp_of_another_clock_is_rejected_with_the_remedy() {
    const HOUR_K: i64 = 3_600_000_000_000 / TSP;
    let mut t = timeline();
    run(&mut t, 0, 3);
    let starting = |k: i64| path(at(k), "x", &[(0, &[0.0]), (2, &[0.0])]);
    assert!(submit(&mut t, 1, &starting(99 * HOUR_K)).is_ok());
    for (k, code) in
        [(101 * HOUR_K, RejectionCode::InvalidTime), (-101 * HOUR_K, RejectionCode::EndedInThePast)]
    {
        let rejection = submit(&mut t, 2, &starting(k)).unwrap_err();
        assert_eq!(rejection.code, code);
        assert!(
            rejection.text.contains("set use_sim_time of both nodes, or of neither"),
            "{}",
            rejection.text
        );
    }
    let rejection = submit(&mut t, 2, &starting(-HOUR_K)).unwrap_err();
    assert!(!rejection.text.contains("use_sim_time"), "{}", rejection.text);
}

#[test]
fn a_later_first_point_is_approached_with_the_degree_of_its_fields() {
    let quintic = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
    let cubic = |s: f64| s * s * (3.0 - 2.0 * s);
    let linear = |s: f64| s;
    let shapes = [linear, cubic, quintic];
    let points: [&[f64]; 3] = [&[0.1], &[0.1, 0.0], &[0.1, 0.0, 0.0]];
    for (point, shape) in points.into_iter().zip(shapes) {
        let mut t = timeline();
        run(&mut t, 0, 4);
        submit(&mut t, 1, &path(Start::Now, "x", &[(100, point)])).unwrap();
        let (psec, events) = run(&mut t, 0, 102);
        for (k, psec) in psec[..=100].iter().enumerate() {
            assert!((psec - 0.1 * shape(k as f64 / 100.0)).abs() < 1e-15);
        }
        assert_eq!(psec[100..], [0.1, 0.1]);
        assert_eq!(events.last(), Some(&(104, TimelineEvent::Completed(A))));
    }
}

#[test]
fn a_later_first_point_is_approached_from_the_commanded_velocity() {
    let mut t = timeline();
    submit(&mut t, 1, &path(Start::Now, "x", &[(0, &[0.0, 0.0]), (50, &[0.06, 0.0])])).unwrap();
    run(&mut t, 0, 25);
    let before = t.commanded_state(0).unwrap();
    assert!(before.velocity > 0.2);
    submit(&mut t, 2, &path(Start::Now, "x", &[(100, &[0.0, 0.0])])).unwrap();
    let mut last = before.velocity;
    for _ in 0..105 {
        t.next();
        let velocity = t.commanded_state(0).unwrap().velocity;
        // Cubic segments have continuous velocity: the acceleration stays small.
        assert!((velocity - last).abs() / TSP_S < 3.0);
        last = velocity;
    }
    assert_eq!(t.commanded_state(0), Some(KinematicState::at_rest(0.0)));
}

#[test]
fn the_approach_to_a_later_first_point_is_checked_for_speed() {
    let mut t = timeline();
    let rejection = submit(&mut t, 1, &path(Start::Now, "x", &[(10, &[0.1])])).unwrap_err();
    assert_eq!((rejection.code, rejection.index), (RejectionCode::Speed, Some(0)));
    assert!((rejection.value - 0.1 / 0.06).abs() < 1e-9);
    // A rest-to-rest quintic has a peak of 15/8 of the mean speed; it is longer than the number of samples.
    let peak = |k: i64| 0.35 * 1.875 / (k as f64 * TSP_S);
    let fast = path(Start::Now, "x", &[(200, &[0.35, 0.0, 0.0])]);
    assert!(peak(200) > 0.5 && submit(&mut t, 1, &fast).is_err());
    let slow = path(Start::Now, "x", &[(300, &[0.35, 0.0, 0.0])]);
    assert!(peak(300) < 0.5 && submit(&mut t, 1, &slow).is_ok());
}

/// Creates a chunk of constant velocity 0.1 m/s from instant `k` on, `n` position cycles long.
fn chunk(k: i64, n: i64) -> Arc<virtual_axes_core::trajectory::Trajectory> {
    let p = |k: i64| 0.0006 * k as f64;
    path(at(k), "x", &[(0, &[p(k), 0.1]), (n, &[p(k + n), 0.1])])
}

#[test]
fn chunks_join_without_a_gap_and_each_completes() {
    let mut t = timeline();
    submit(&mut t, 0, &chunk(0, 20)).unwrap();
    submit(&mut t, 1, &chunk(20, 20)).unwrap();
    submit(&mut t, 2, &chunk(40, 20)).unwrap();
    let (psec, events) = run(&mut t, 0, 61);
    for (k, psec) in psec.iter().enumerate() {
        assert!((psec - 0.0006 * k as f64).abs() < 1e-15, "gap at {k}");
    }
    let expected = [
        (0, TimelineEvent::Started(MotionId(0))),
        (20, TimelineEvent::Started(A)),
        (20, TimelineEvent::Completed(MotionId(0))),
        (40, TimelineEvent::Started(B)),
        (40, TimelineEvent::Completed(A)),
        (60, TimelineEvent::Completed(B)),
    ];
    assert_eq!(events, expected);
}

#[test]
fn a_chunk_without_successor_becomes_a_controlled_stop() {
    let mut t = timeline();
    submit(&mut t, 1, &chunk(0, 20)).unwrap();
    let (psec, events) = run(&mut t, 0, 60);
    assert_eq!(events.last(), Some(&(20, TimelineEvent::Completed(A))));
    assert!(psec[21] > psec[20], "no abrupt stop");
    assert_within_limits(&psec[19..]);
    assert!(!t.is_moving());
    assert!(psec[59] > psec[20] && psec[59] < psec[20] + 0.02);
}

#[test]
fn a_late_chunk_takes_over_from_the_controlled_stop() {
    let mut t = timeline();
    submit(&mut t, 1, &chunk(0, 20)).unwrap();
    run(&mut t, 0, 23);
    let admission = submit(&mut t, 2, &chunk(20, 20)).unwrap();
    assert!(admission.is_late);
    let (psec, events) = run(&mut t, 0, 5);
    assert_eq!(psec[4], 0.0006 * 20.0 + (0.0006 * 40.0 - 0.0006 * 20.0) * 7.0 / 20.0);
    assert_eq!(events, [(23, TimelineEvent::Started(B))]);
}

#[test]
fn an_earlier_start_preempts_waiting_trajectories_immediately() {
    let mut t = timeline();
    submit(&mut t, 1, &path(at(50), "x", &[(0, &[0.0]), (9, &[0.01])])).unwrap();
    submit(&mut t, 2, &path(at(40), "x", &[(0, &[0.0]), (9, &[0.0])])).unwrap();
    let (psec, events) = run(&mut t, 0, 70);
    assert!(psec.iter().all(|&p| p == 0.0));
    assert!(events[0].0 == 0 && is_preempted(A, B, &[0])(&events[0].1));
    assert_eq!(events[1..], [(40, TimelineEvent::Started(B)), (49, TimelineEvent::Completed(B))]);
}

#[test]
fn a_later_start_does_not_affect_a_waiting_trajectory() {
    let mut t = timeline();
    submit(&mut t, 1, &path(at(10), "x", &[(0, &[0.0]), (9, &[0.01])])).unwrap();
    submit(&mut t, 2, &path(at(30), "x", &[(0, &[0.01]), (9, &[0.0])])).unwrap();
    let (psec, events) = run(&mut t, 0, 50);
    assert_eq!((psec[19], psec[29], psec[49]), (0.01, 0.01, 0.0));
    assert_eq!(events.len(), 4);
    assert!(events.contains(&(19, TimelineEvent::Completed(A))));
}

fn both(start: Start, n: i64) -> Arc<virtual_axes_core::trajectory::Trajectory> {
    let mut request = TrajectoryRequest::new(start, vec!["c".into(), "x".into()]);
    for (time, positions) in [(0, [0.0, 0.0]), (n * TSP, [0.2, 0.1])] {
        let point =
            virtual_axes_core::trajectory::TrajectoryPoint { positions: &positions, ..Default::default() };
        request.push(time, point).unwrap();
    }
    validate(request, false).unwrap()
}

#[test]
fn joints_that_are_not_named_continue() {
    let mut t = timeline();
    submit(&mut t, 1, &both(Start::Now, 100)).unwrap();
    run(&mut t, 0, 10);
    submit(&mut t, 2, &path(Start::Now, "x", &[(0, &[0.01]), (5, &[0.01])])).unwrap();
    let (c, events) = run(&mut t, 1, 91);
    assert_eq!(c[90], 0.2, "c reaches the end of its first trajectory");
    assert!(is_preempted(A, B, &[0])(&events[1].1), "{events:?}");
    assert_eq!(events.len(), 3, "one last event per trajectory: {events:?}");
    assert_eq!(events[2], (15, TimelineEvent::Completed(B)));
}

#[test]
fn a_stop_of_a_joint_ends_its_active_and_waiting_motions_only() {
    let mut t = timeline();
    submit(&mut t, 1, &both(Start::Now, 100)).unwrap();
    submit(&mut t, 2, &path(at(200), "x", &[(0, &[0.1]), (9, &[0.1])])).unwrap();
    run(&mut t, 0, 30);
    let admission = submit(&mut t, 3, &stop(&["x"])).unwrap();
    assert_eq!(admission.start_k, 30);
    let (mut x, mut c, mut events) = (Vec::new(), 0.0, Vec::new());
    for _ in 0..300 {
        let k = t.next();
        x.push(t.psec()[0]);
        c = t.psec()[1];
        events.extend(t.events().iter().map(|&event| (k, event)));
    }
    assert_within_limits(&x);
    assert!(x[299] < 0.05 && c == 0.2);
    let by = Some(C);
    let expected = [
        (30, TimelineEvent::Stopped { id: A, by }),
        (30, TimelineEvent::Stopped { id: B, by }),
        (30, TimelineEvent::Started(C)),
        (admission.end_k, TimelineEvent::Completed(C)),
    ];
    assert_eq!(events, expected);
}

#[test]
fn a_stop_from_constant_velocity_obeys_acceleration_and_jerk_and_the_braking_distance() {
    let mut t = timeline();
    let line = path(Start::Now, "x", &[(0, &[-0.3]), (200, &[0.3])]);
    t.reset(&[-0.3, 0.0]).unwrap();
    submit(&mut t, 1, &line).unwrap();
    run(&mut t, 0, 50);
    let from = t.commanded_state(0).unwrap();
    assert!((from.velocity - 0.5).abs() < 1e-12 && from.acceleration == 0.0);
    submit(&mut t, 2, &stop(&[])).unwrap();
    let (psec, _) = run(&mut t, 0, 100);
    assert_within_limits(&psec);
    // v/2 (v/A + A/J).
    let distance = 0.25 * (0.5 / 2.5 + 2.5 / 50.0);
    assert!((psec[99] - from.position - distance).abs() < 1e-12);
    assert!(!t.is_moving() && t.commanded_state(0) == Some(KinematicState::at_rest(psec[99])));
}

#[test]
fn a_stop_beyond_the_travel_limits_ends_at_the_limit() {
    let mut t = timeline();
    t.reset(&[0.05, 0.0]).unwrap();
    submit(&mut t, 1, &path(Start::Now, "x", &[(0, &[0.05]), (100, &[0.35])])).unwrap();
    run(&mut t, 0, 100);
    submit(&mut t, 2, &stop(&[])).unwrap();
    let (psec, _) = run(&mut t, 0, 100);
    assert!(psec.iter().all(|&p| p <= 0.355));
    assert_eq!(psec[99], 0.355);
}

#[test]
fn a_stop_at_rest_completes_immediately() {
    let mut t = timeline();
    submit(&mut t, 1, &stop(&[])).unwrap();
    assert_eq!(run(&mut t, 0, 3).1, [(0, TimelineEvent::Started(A)), (0, TimelineEvent::Completed(A))]);
}

#[test]
fn the_queue_is_bounded_and_a_stop_clears_it() {
    let mut t = timeline();
    let waiting = |i: i64| path(at(100 + 2 * i), "x", &[(0, &[0.0]), (1, &[0.0])]);
    for i in 0..MAX_WAITING as i64 {
        submit(&mut t, i as u64, &waiting(i)).unwrap();
    }
    let rejection = submit(&mut t, 9999, &waiting(5000)).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::QueueFull);
    assert!(submit(&mut t, 9998, &waiting(3)).is_ok(), "it replaces waiting ones");
    submit(&mut t, 10_000, &stop(&[])).unwrap();
    let (_, events) = run(&mut t, 0, 5);
    let is_end = |e: &&(i64, TimelineEvent)| {
        matches!(e.1, TimelineEvent::Stopped { .. } | TimelineEvent::Preempted { .. })
    };
    assert_eq!(events.iter().filter(is_end).count(), MAX_WAITING + 1);
    assert!(!t.is_waiting());
}

#[test]
fn reset_stops_all_motions_and_rejects_nan() {
    let mut t = timeline();
    submit(&mut t, 1, &both(Start::Now, 100)).unwrap();
    run(&mut t, 0, 10);
    assert_eq!(t.reset(&[f64::NAN, 0.0]).unwrap_err().code, RejectionCode::NotFinite);
    assert!(t.is_moving());
    t.reset(&[0.1, -0.2]).unwrap();
    assert_eq!(t.psec(), [0.1, -0.2]);
    let (psec, events) = run(&mut t, 0, 3);
    assert_eq!(psec, [0.1; 3]);
    assert_eq!(events, [(10, TimelineEvent::Stopped { id: A, by: None })]);
}

#[test]
fn streamed_setpoints_are_accepted_for_free_joints_only() {
    let mut t = timeline();
    assert_eq!(t.submit_setpoint(0, 0.002), Ok(true));
    assert_eq!(run(&mut t, 0, 2).0, [0.002, 0.002]);
    assert_eq!(t.submit_setpoint(0, 0.2).unwrap_err().code, RejectionCode::Jump);
    assert_eq!(t.submit_setpoint(0, 0.4).unwrap_err().code, RejectionCode::OutsideTravelLimits);
    assert_eq!(t.submit_setpoint(7, 0.0).unwrap_err().code, RejectionCode::UnknownJoint);
    submit(&mut t, 1, &path(at(9), "x", &[(0, &[0.002]), (9, &[0.01])])).unwrap();
    assert_eq!(t.submit_setpoint(0, 0.003), Ok(false), "while a trajectory waits");
    assert_eq!(t.submit_setpoint(1, 0.003), Ok(true), "the other joint is free");
    run(&mut t, 0, 12);
    assert_eq!(t.submit_setpoint(0, 0.003), Ok(false), "while a trajectory is active");
    run(&mut t, 0, 9);
    assert_eq!(t.submit_setpoint(0, 0.011), Ok(true));
}

#[test]
fn a_trajectory_for_another_machine_is_rejected() {
    let one = vec![joints().remove(0)];
    let mut t = virtual_axes_core::trajectory::Timeline::new(one, TSP, &[0.0]).unwrap();
    let rejection = submit(&mut t, 1, &both(Start::Now, 100)).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::UnknownJoint);
}

#[test]
fn a_start_beyond_the_range_of_instants_is_rejected() {
    let joints = joints();
    let mut t = virtual_axes_core::trajectory::Timeline::new(joints, 1, &[0.0, 0.0]).unwrap();
    let far = validate(request(Start::At(i64::MAX), "x", &[(0, &[0.0])]), false).unwrap();
    let rejection = t.submit(A, far, i64::MIN).unwrap_err();
    assert_eq!(rejection.code, RejectionCode::InvalidTime);
}

/// Asserts the limits of a stop by differences of the setpoints, which are means of the derivatives over
/// position cycles and therefore obey the same limits.
fn assert_within_limits(psec: &[f64]) {
    let d = |k: usize| psec[k + 1] - psec[k];
    let dd = |k: usize| (d(k + 1) - d(k)) / TSP_S.powi(2);
    for k in 0..psec.len() - 3 {
        assert!(d(k).abs() / TSP_S <= 0.5 * (1.0 + 1e-6), "speed at {k}");
        assert!(dd(k).abs() <= 2.5 * (1.0 + 1e-6), "acceleration at {k}");
        let jerk = (dd(k + 1) - dd(k)) / TSP_S;
        assert!(jerk.abs() <= 50.0 * (1.0 + 1e-6), "jerk at {k}: {jerk}");
    }
}
