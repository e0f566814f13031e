//! Property tests of trajectories and the timeline with random requests.

use crate::trajectory_common::*;
use proptest::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;
use virtual_axes_core::trajectory::{
    KinematicState, MotionId, Start, TimelineEvent, TrajectoryPoint, TrajectoryRequest,
};

/// Random request.
#[derive(Debug, Clone)]
struct RandomRequest {
    start: Option<i64>,
    joints: usize,
    order: usize,
    points: Vec<(i64, f64, f64, f64)>,
}

#[derive(Debug, Clone)]
enum Step {
    Submit(RandomRequest),
    Stop(usize),
    Run(usize),
    Stream(usize, f64),
}

fn names(joints: usize) -> Vec<String> {
    let sets: [&[&str]; 4] = [&["x"], &["c"], &["c", "x"], &[]];
    sets[joints].iter().map(|&name| name.to_owned()).collect()
}

fn build(random: &RandomRequest) -> Option<TrajectoryRequest> {
    // Starts are relative to instant 0, between position cycles.
    let start = random.start.map_or(Start::Now, |ns| Start::At(ORIGIN + ns));
    let mut request = TrajectoryRequest::new(start, names(random.joints));
    let mut time = 0;
    for &(dt, p, v, a) in &random.points {
        time += dt;
        let n = request.joints().len();
        let (positions, velocities, accelerations) = (vec![p; n], vec![v; n], vec![a; n]);
        let point = TrajectoryPoint {
            positions: &positions,
            velocities: if random.order > 0 { &velocities } else { &[] },
            accelerations: if random.order > 1 { &accelerations } else { &[] },
            effort: &[],
        };
        request.push(time, point).ok()?;
    }
    Some(request)
}

fn random_request() -> impl Strategy<Value = RandomRequest> {
    let time = prop_oneof![
        4 => (0..200i64).prop_map(|k| k * TSP),
        4 => 0..600_000_000i64,
        1 => -5..5i64
    ];
    let value = prop_oneof![8 => -0.05..0.05f64, 1 => -1.0..1.0f64];
    let velocity = prop_oneof![2 => Just(0.0), 8 => -0.4..0.4f64, 1 => -9.0..9.0f64];
    let acceleration = prop_oneof![2 => Just(0.0), 8 => -3.0..3.0f64, 1 => -1e3..1e3f64];
    (
        prop_oneof![Just(None), (-300_000_000..3_000_000_000i64).prop_map(Some)],
        0..3usize,
        0..3usize,
        prop::collection::vec((time, value, velocity, acceleration), 1..6),
    )
        .prop_map(|(start, joints, order, points)| RandomRequest { start, joints, order, points })
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        6 => random_request().prop_map(Step::Submit),
        1 => (0..4usize).prop_map(Step::Stop),
        4 => (0..80usize).prop_map(Step::Run),
        1 => (0..3usize, -0.4..0.4f64).prop_map(|(joint, p)| Step::Stream(joint, p)),
    ];
    prop::collection::vec(step, 0..60)
}

/// Number of start events and end events of each trajectory.
type EventCounts = HashMap<MotionId, (u32, u32)>;

fn run_checked(t: &mut virtual_axes_core::trajectory::Timeline, periods: usize, counts: &mut EventCounts) {
    for _ in 0..periods {
        let before = [t.psec()[0], t.psec()[1]];
        let ahead = [t.psec_ahead(0, 1).unwrap(), t.psec_ahead(1, 1).unwrap()];
        t.next();
        assert_eq!(t.psec(), ahead, "previewed setpoints are commanded");
        for (joint, before) in before.iter().enumerate() {
            let step = (t.psec()[joint] - before).abs();
            assert!(step <= 0.5 * TSP_S * (1.0 + 1e-6), "{step} on {joint}");
        }
        assert!(t.psec()[0].abs() <= 0.355 + 1e-9, "outside the travel limits");
        for event in t.events() {
            match *event {
                TimelineEvent::Started(id) => {
                    let entry = counts.get_mut(&id).unwrap();
                    assert_eq!(*entry, (0, 0), "{event:?}");
                    entry.0 += 1;
                }
                TimelineEvent::Completed(id) => {
                    assert_eq!(counts[&id], (1, 0), "completed without start");
                    counts.get_mut(&id).unwrap().1 += 1;
                }
                TimelineEvent::Preempted { id, .. } | TimelineEvent::Stopped { id, .. } => {
                    counts.get_mut(&id).unwrap().1 += 1;
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn any_sequence_of_requests_obeys_the_limits_and_ends_each_motion_once(
        steps in steps(),
    ) {
        let mut t = timeline();
        let mut counts = EventCounts::new();
        for (id, step) in steps.iter().enumerate() {
            let id = id as u64;
            let request = match step {
                Step::Run(periods) => {
                    run_checked(&mut t, *periods, &mut counts);
                    continue;
                }
                Step::Stream(joint, position) => {
                    let _ = t.submit_setpoint(*joint, *position);
                    continue;
                }
                Step::Submit(random) => build(random),
                Step::Stop(joints) => Some(TrajectoryRequest::new(Start::Now, names(*joints))),
            };
            let Some(Ok(trajectory)) = request.map(|r| validate(r, true)) else { continue };
            if submit(&mut t, id, &trajectory).is_ok() {
                counts.insert(MotionId(id), (0, 0));
            }
        }
        submit(&mut t, u64::MAX, &stop(&[])).unwrap();
        counts.insert(MotionId(u64::MAX), (0, 0));
        run_checked(&mut t, 300, &mut counts);
        prop_assert!(!t.is_moving() && !t.is_waiting());
        for (id, (_, ends)) in counts {
            prop_assert_eq!(ends, 1, "{:?}", id);
        }
    }

    #[test]
    fn points_on_the_grid_are_commanded_bit_for_bit(
        order in 0..3usize,
        start in 0..20i64,
        points in prop::collection::vec((1..40i64, -1.0..1.0f64, -0.5..0.5f64, -2.0..2.0f64), 1..20),
    ) {
        // Reachable positions, from rest at zero.
        let (mut k, mut position, mut rows) = (0, 0.0, vec![(0, 0.0, 0.0, 0.0)]);
        for (dk, direction, velocity, acceleration) in points {
            k += dk;
            position += direction * 0.2 * dk as f64 * TSP_S;
            rows.push((k * TSP, position, velocity * 0.2, acceleration * 0.05));
        }
        let mut request = TrajectoryRequest::new(at(start), vec!["c".into()]);
        for &(time, p, v, a) in &rows {
            let (v, a) = ([v], [a]);
            request
                .push(time, TrajectoryPoint {
                    positions: &[p],
                    velocities: if order > 0 { &v } else { &[] },
                    accelerations: if order > 1 { &a } else { &[] },
                    effort: &[],
                })
                .unwrap();
        }
        let checked = validate(request, true);
        let Ok(checked) = checked else { return Ok(()) };
        let mut t = timeline();
        submit(&mut t, 1, &checked).unwrap();
        let (psec, _) = run(&mut t, 1, (start + k) as usize + 1);
        for (time, p, _, _) in rows {
            prop_assert_eq!(psec[(start + time / TSP) as usize].to_bits(), p.to_bits());
        }
    }

    /// Checks difference quotients of the setpoints, which are means of the derivatives over position cycles,
    /// from the instant before the stop on.
    #[test]
    fn a_stop_at_any_time_obeys_acceleration_and_jerk_and_ends_at_rest(
        order in 0..3usize,
        after in 0..200usize,
        points in prop::collection::vec((5..80i64, -1.0..1.0f64, -1.0..1.0f64, -4.0..4.0f64), 1..8),
    ) {
        let mut request = TrajectoryRequest::new(Start::Now, vec!["c".into()]);
        let (mut time, mut position) = (0, 0.0);
        for (dk, direction, velocity, acceleration) in points {
            time += dk * TSP + 1_234_567;
            position += direction * 0.3 * dk as f64 * TSP_S;
            let (v, a) = ([velocity * 0.3], [acceleration]);
            request
                .push(time, TrajectoryPoint {
                    positions: &[position],
                    velocities: if order > 0 { &v } else { &[] },
                    accelerations: if order > 1 { &a } else { &[] },
                    effort: &[],
                })
                .unwrap();
        }
        let mut t = timeline();
        let accepted = validate(request, true).and_then(|path| submit(&mut t, 1, &path));
        if accepted.is_err() {
            return Ok(());
        }
        t.next();
        run(&mut t, 1, after);
        let mut psec = vec![t.psec()[1]];
        submit(&mut t, 2, &stop(&["c"])).unwrap();
        psec.extend(run(&mut t, 1, 150).0);
        let d: Vec<_> = psec.windows(2).map(|w| (w[1] - w[0]) / TSP_S).collect();
        let dd: Vec<_> = d.windows(2).map(|w| (w[1] - w[0]) / TSP_S).collect();
        prop_assert!(d.iter().all(|v| v.abs() <= 0.5 * (1.0 + 1e-6)));
        prop_assert!(dd.iter().all(|a| a.abs() <= 2.5 * (1.0 + 1e-6)));
        prop_assert!(dd.windows(2).all(|w| (w[1] - w[0]).abs() / TSP_S <= 50.0 * (1.0 + 1e-6)));
        prop_assert_eq!(t.commanded_state(1), Some(KinematicState::at_rest(psec[150])));
    }

    #[test]
    fn arbitrary_values_including_nan_do_not_panic(
        stamp in any::<i64>(),
        origin in any::<i64>(),
        times in prop::collection::vec(any::<i64>(), 0..4),
        sorted in any::<bool>(),
        values in prop::collection::vec(any::<f64>(), 12),
        order in 0..3usize,
    ) {
        let mut times = times;
        if sorted {
            times = times.into_iter().map(|t| t.checked_abs().unwrap_or(0)).collect();
            times.sort_unstable();
        }
        let mut request = TrajectoryRequest::new(Start::At(stamp), vec!["c".into()]);
        for (&time, v) in times.iter().zip(values.chunks(3)) {
            let _ = request.push(time, TrajectoryPoint {
                positions: &v[..1],
                velocities: if order > 0 { &v[1..2] } else { &[] },
                accelerations: if order > 1 { &v[2..] } else { &[] },
                effort: &[],
            });
        }
        let mut t = timeline();
        if let Ok(trajectory) = validate(request, true) {
            let _ = t.submit(MotionId(1), Arc::clone(&trajectory), origin);
            let _ = t.submit(MotionId(2), trajectory, stamp);
        }
        run(&mut t, 1, 3);
        prop_assert!(t.psec().iter().all(|p| p.is_finite()));
    }
}
