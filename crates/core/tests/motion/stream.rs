//! Streamed setpoints: preview buffer, jump check, preemption and stops, change of the delay.

use std::sync::Arc;

use crate::trajectory_common::*;
use proptest::prelude::*;
use virtual_axes_core::config::{Assignment, MachineConfig, Value, ValueSource};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::simulation::{Simulation, joint_limits};
use virtual_axes_core::trajectory::stream::{MAX_STREAM_DELAY, STREAM_PAUSE};
use virtual_axes_core::trajectory::{
    KinematicState, MotionId, RejectionCode, STREAM_JITTER, Start, StreamEnd, Timeline, Trajectory,
    TrajectoryPoint, TrajectoryRequest, ValidationContext,
};

/// Vmax·Tsp of the joints, m or rad.
const REACH: f64 = 0.003;
/// Number of instants without a change after which a stream has paused.
const PAUSE: usize = (STREAM_PAUSE / TSP) as usize + 2;

/// Creates a timeline with a stream delay of `cycles`.
fn delayed(cycles: u32) -> Timeline {
    let mut t = timeline();
    t.set_stream_delay(cycles);
    t
}

/// Streams one setpoint per instant to `joint` and returns the commanded setpoints.
fn stream(t: &mut Timeline, joint: usize, positions: &[f64]) -> Vec<f64> {
    let command = |&position: &f64| {
        assert_eq!(t.submit_setpoint(joint, position), Ok(true));
        t.next();
        t.psec()[joint]
    };
    positions.iter().map(command).collect()
}

/// Returns a ramp from `from` with `step` m or rad per instant.
fn ramp(from: f64, step: f64, count: usize) -> Vec<f64> {
    (1..=count).map(|i| from + step * i as f64).collect()
}

#[test]
fn a_setpoint_is_commanded_after_the_delay() {
    let positions = ramp(0.0, 0.001, 60);
    for delay in [0, 1, 2, 14] {
        let mut t = delayed(delay);
        run(&mut t, 0, 5);
        let mut psec = stream(&mut t, 0, &positions);
        psec.extend(run(&mut t, 0, delay as usize + 3).0);
        let delay = delay as usize;
        assert_eq!(psec[..delay], vec![0.0; delay]);
        assert_eq!(psec[delay..delay + 60], positions);
        assert_eq!(psec[delay + 60..], [0.06; 3], "the last setpoint is held");
    }
}

#[test]
fn the_buffer_is_the_preview() {
    let positions = ramp(0.0, 0.001, 30);
    let mut t = delayed(14);
    stream(&mut t, 1, &positions);
    for periods in 0..40 {
        let known = positions[(15 + periods as usize).min(29)];
        assert_eq!(t.psec_ahead(1, periods), Some(known), "{periods} ahead");
    }
    // A setpoint accepted for the next instant follows the buffer.
    t.submit_setpoint(1, 0.031).unwrap();
    assert_eq!((t.psec_ahead(1, 14), t.psec_ahead(1, 15)), (Some(0.030), Some(0.031)));
    assert_eq!(t.psec_ahead(0, 14), Some(0.0), "the other joint is at rest");
    let ahead: Vec<_> = (1..=20).map(|periods| t.psec_ahead(1, periods).unwrap()).collect();
    assert_eq!(run(&mut t, 1, 20).0, ahead, "previewed setpoints are commanded");
}

#[test]
fn a_gap_holds_the_last_setpoint_which_enters_the_buffer() {
    let mut t = delayed(3);
    let mut psec = stream(&mut t, 0, &[0.001, 0.002]);
    psec.extend(run(&mut t, 0, 2).0);
    psec.extend(stream(&mut t, 0, &[0.003]));
    psec.extend(run(&mut t, 0, 4).0);
    assert_eq!(psec, [0.0, 0.0, 0.0, 0.001, 0.002, 0.002, 0.002, 0.003, 0.003]);
}

#[test]
fn the_last_of_several_setpoints_in_one_cycle_applies() {
    let mut t = delayed(1);
    for position in [0.001, -0.002, 0.002] {
        assert_eq!(t.submit_setpoint(0, position), Ok(true));
    }
    assert_eq!(run(&mut t, 0, 3).0, [0.0, 0.002, 0.002]);
}

#[test]
fn a_stream_must_begin_within_vmax_tsp() {
    let mut t = timeline();
    for away in [1.01 * REACH, -0.1] {
        let rejection = t.submit_setpoint(0, away).unwrap_err();
        assert_eq!((rejection.code, rejection.joint.as_deref()), (RejectionCode::Jump, Some("x")));
        assert!((rejection.value - away.abs()).abs() < 1e-15 && (rejection.limit - REACH).abs() < 1e-15);
    }
    assert_eq!(run(&mut t, 0, 3).0, [0.0; 3], "rejected setpoints change nothing");
    assert_eq!(stream(&mut t, 0, &[REACH]), [REACH]);
}

#[test]
fn a_further_setpoint_must_be_reachable_in_the_elapsed_time() {
    let mut t = delayed(10);
    let positions = ramp(0.0, REACH, 10);
    let psec = stream(&mut t, 0, &positions);
    assert_eq!(psec, [0.0; 10]);
    let newest = positions[9];
    // One cycle has passed.
    let allowed = REACH * (1.0 + STREAM_JITTER as f64 / TSP as f64);
    let rejection = t.submit_setpoint(0, newest + 1.01 * allowed).unwrap_err();
    assert_eq!((rejection.code, rejection.joint.as_deref()), (RejectionCode::Jump, Some("x")));
    assert!((rejection.value - 1.01 * allowed).abs() < 1e-15, "{rejection}");
    // No cycle has passed since the rejected setpoint.
    let allowed = allowed - REACH;
    assert_eq!(t.submit_setpoint(0, newest + 1.01 * allowed).unwrap_err().code, RejectionCode::Jump);
    assert_eq!(
        t.submit_setpoint(0, 0.0).unwrap_err().code,
        RejectionCode::Jump,
        "the commanded setpoint is out of reach"
    );
    assert_eq!(run(&mut t, 0, 11).0[10], newest, "rejected setpoints change nothing");
}

/// One setpoint is late, the next one on time: the second one is 2·Vmax·Tsp away.
#[test]
fn the_second_of_two_setpoints_in_one_cycle_is_approached_at_vmax() {
    for delay in [0, 14] {
        let mut t = delayed(delay);
        let positions = ramp(0.0, REACH, 60);
        let mut psec = stream(&mut t, 0, &positions[..10]);
        psec.extend(run(&mut t, 0, 1).0);
        assert_eq!(t.submit_setpoint(0, positions[10]), Ok(true));
        psec.extend(stream(&mut t, 0, &positions[11..40]));
        psec.extend(run(&mut t, 0, delay as usize + 2).0);
        let psec = &psec[delay as usize..];
        assert_eq!(psec[..10], positions[..10]);
        assert_eq!(psec[10], positions[9], "held");
        for two in psec[10..].windows(2) {
            assert!((0.0..=REACH * (1.0 + 1e-9)).contains(&(two[1] - two[0])), "{two:?}");
        }
        assert_eq!(psec.last(), Some(&positions[39]), "reached");
        assert!((28..=30).contains(&t.stream_counts().limited), "{:?}", t.stream_counts());
    }
}

/// A sender of 100 Hz at 0.9·Vmax sends fewer setpoints than position cycles, more than Vmax·Tsp apart.
#[test]
fn a_sender_slower_than_the_position_cycle_is_followed_at_vmax_at_most() {
    let mut t = timeline();
    let (sample, count) = (10_000_000_i64, 40_i64);
    let speed = 0.9 * REACH / TSP_S;
    let mut psec = vec![0.0];
    let mut sent = 0;
    for k in 0..count * sample / TSP + 4 {
        while sent < count && sent * sample < k * TSP {
            sent += 1;
            // The ramp begins within Vmax·Tsp.
            let position = speed * 1e-9 * (sent * sample - sample / 2) as f64;
            assert_eq!(t.submit_setpoint(0, position), Ok(true), "{sent}");
        }
        t.next();
        psec.push(t.psec()[0]);
    }
    assert!(psec.windows(2).all(|two| (0.0..=REACH * (1.0 + 1e-9)).contains(&(two[1] - two[0]))));
    let last = speed * 1e-9 * (count * sample - sample / 2) as f64;
    assert_eq!(psec.last(), Some(&last));
}

#[test]
fn a_short_gap_is_caught_up_and_after_a_pause_the_stream_begins_again() {
    let at = |k: usize| REACH * 0.5 * k as f64;
    for lost in [8, PAUSE + 1] {
        let mut t = timeline();
        stream(&mut t, 0, &ramp(0.0, at(1), 10));
        run(&mut t, 0, lost);
        let next = t.submit_setpoint(0, at(10 + lost + 1));
        if lost == 8 {
            assert_eq!(next, Ok(true));
            let psec = run(&mut t, 0, 5).0;
            let wanted = [1.0, 2.0, 3.0, 4.0, 4.5].map(|periods| at(10) + periods * REACH);
            assert!(psec.iter().zip(wanted).all(|(p, w)| (p - w).abs() < 1e-15), "{psec:?}");
            assert_eq!(t.stream_counts().gaps, 0);
        } else {
            assert_eq!(next.unwrap_err().code, RejectionCode::Jump);
            assert_eq!(t.stream_counts().gaps, 1);
            assert_eq!(stream(&mut t, 0, &[at(11)]), [at(11)]);
        }
    }
}

/// Stamps give the elapsed time for lost or delayed messages.
#[test]
fn the_elapsed_time_is_the_longer_of_stamps_and_arrivals() {
    for (sent, taken) in [(Some(40_000_000), true), (Some(1_000_000), false), (None, false)] {
        let mut t = timeline();
        t.submit_setpoint_stamped(0, 0.001, Some(0)).unwrap();
        t.next();
        // 20 mm in one cycle: 40 ms at Vmax.
        assert_eq!(t.submit_setpoint_stamped(0, 0.021, sent).is_ok(), taken, "{sent:?}");
        let psec = run(&mut t, 0, 1).0[0];
        assert!((psec - if taken { 0.001 + REACH } else { 0.001 }).abs() < 1e-15);
    }
}

#[test]
fn a_stream_that_ends_at_rest_has_no_gap() {
    let mut t = timeline();
    // Deceleration at the limit, 2.5 m/s².
    let brake = |k: i32| 0.02 - 0.5 * 2.5 * (f64::from(20 - k.min(20)) * TSP_S).powi(2);
    assert_eq!(t.submit_setpoint(0, brake(0) - brake(0)), Ok(true));
    let positions: Vec<_> = (1..=20).map(|k| brake(k) - brake(0)).collect();
    stream(&mut t, 0, &positions);
    run(&mut t, 0, 3 * PAUSE);
    assert_eq!(t.stream_counts().gaps, 0);
}

#[test]
fn after_a_stop_a_stream_is_inhibited_until_it_pauses() {
    let mut t = timeline();
    stream(&mut t, 0, &ramp(0.0, 0.0001, 20));
    assert!(!t.is_stream_inhibited());
    submit(&mut t, 1, &stop(&[])).unwrap();
    let (end, joints) = t.take_stream_end().expect("the stream commanded x");
    assert_eq!((end, joints.iter().collect::<Vec<_>>()), (StreamEnd::Stopped(MotionId(1)), vec![0]));
    assert!(t.take_stream_end().is_none(), "reported once");
    // Reachable setpoints for longer than the duration of the stop.
    for position in ramp(0.002, 0.00001, 60) {
        assert_eq!(t.submit_setpoint(0, position), Ok(false));
        assert!(t.is_stream_inhibited());
        t.next();
    }
    let rest_position = t.psec()[0];
    // A constant setpoint counts as a pause.
    let rest = 0.0026;
    let ignored = (0..2 * PAUSE).take_while(|_| {
        let taken = t.submit_setpoint(0, rest).unwrap();
        t.next();
        !taken
    });
    assert!((PAUSE - 2..=PAUSE + 1).contains(&ignored.count()));
    assert!(!t.is_stream_inhibited() && rest_position < 0.0026);
    assert_eq!(stream(&mut t, 0, &[0.003]), [0.003]);
}

#[test]
fn a_stop_inhibits_a_stream_that_begins_during_the_stop() {
    let mut t = timeline();
    submit(&mut t, 1, &stop(&[])).unwrap();
    assert_eq!(t.take_stream_end(), None, "nothing was streamed");
    assert_eq!(t.submit_setpoint(0, 0.001), Ok(false));
    run(&mut t, 0, 2);
    assert_eq!(t.submit_setpoint(0, 0.002), Ok(false));
    run(&mut t, 0, PAUSE);
    assert_eq!(t.submit_setpoint(0, 0.003), Ok(true));
}

#[test]
fn the_end_of_a_stream_reports_cause_and_commanded_joints() {
    let mut t = timeline();
    stream(&mut t, 1, &ramp(0.0, 0.001, 5));
    let end = |t: &mut Timeline| t.take_stream_end().map(|(end, joints)| (end, joints.iter().collect()));
    submit(&mut t, 1, &path(Start::Now, "x", &[(0, &[0.0]), (4, &[0.001])])).unwrap();
    assert_eq!(end(&mut t), None, "the stream commanded c");
    let too_far = path(Start::Now, "c", &[(0, &[1.0]), (4, &[1.0])]);
    submit(&mut t, 2, &too_far).unwrap_err();
    assert_eq!(end(&mut t), None, "rejected");
    submit(&mut t, 3, &path(Start::Now, "c", &[(0, &[0.005]), (4, &[0.006])])).unwrap();
    assert_eq!(end(&mut t), Some((StreamEnd::Preempted(MotionId(3)), vec![1])));
    run(&mut t, 1, 6);
    assert_eq!(stream(&mut t, 1, &[0.007]), [0.007], "a reachable stream continues immediately");
    t.reset(&[0.0, 0.0]).unwrap();
    assert_eq!(end(&mut t), Some((StreamEnd::Reset, vec![1])));
    run(&mut t, 1, PAUSE);
    submit(&mut t, 4, &path(Start::Now, "c", &[(0, &[0.0]), (4, &[0.001])])).unwrap();
    assert_eq!(end(&mut t), None, "the stream had ended");
}

#[test]
fn nan_infinity_and_positions_outside_the_travel_limits_are_rejected() {
    let mut t = delayed(2);
    for (joint, position, code) in [
        (0, f64::NAN, RejectionCode::NotFinite),
        (0, f64::INFINITY, RejectionCode::NotFinite),
        (0, 0.356, RejectionCode::OutsideTravelLimits),
        (2, 0.0, RejectionCode::UnknownJoint),
    ] {
        let rejection = t.submit_setpoint(joint, position).unwrap_err();
        assert_eq!((rejection.code, rejection.index), (code, None));
        assert!(!rejection.text.contains("point"), "{rejection}");
    }
    assert!(!t.is_streaming());
}

#[test]
fn a_trajectory_takes_over_from_the_commanded_state_and_clears_the_buffer() {
    let mut t = delayed(5);
    stream(&mut t, 0, &ramp(0.0, 0.002, 10));
    assert_eq!(t.psec()[0], 0.010);
    // Reachable from the commanded state, not from the newest setpoint.
    let trajectory = path(Start::Now, "x", &[(0, &[0.009]), (4, &[0.005])]);
    submit(&mut t, 1, &trajectory).unwrap();
    assert_eq!(t.submit_setpoint(0, 0.022), Ok(false));
    let (psec, _) = run(&mut t, 0, 30);
    for (psec, wanted) in psec.iter().zip([0.009, 0.008, 0.007, 0.006]) {
        assert!((psec - wanted).abs() < 1e-15);
    }
    assert_eq!(psec[4..], vec![0.005; 26], "no setpoint of the stream remains");
    assert_eq!(t.submit_setpoint(0, 0.022).unwrap_err().code, RejectionCode::Jump);
    // The next stream has the same delay.
    assert_eq!(stream(&mut t, 0, &[0.006; 7]), [0.005, 0.005, 0.005, 0.005, 0.005, 0.006, 0.006]);
}

#[test]
fn the_buffer_is_commanded_until_a_waiting_trajectory_starts() {
    let mut t = delayed(5);
    let positions = ramp(0.0, 0.001, 10);
    stream(&mut t, 0, &positions);
    // The buffer is empty at instant 15; two instants earlier the trajectory starts at the position of that instant.
    submit(&mut t, 1, &path(at(13), "x", &[(0, &[0.009]), (10, &[0.0])])).unwrap();
    assert_eq!(t.submit_setpoint(0, 0.011), Ok(false), "while a trajectory waits");
    assert_eq!(t.submit_setpoint(1, 0.001), Ok(true), "the other joint is free");
    let (psec, _) = run(&mut t, 0, 5);
    assert_eq!(psec[..3], positions[5..8]);
    assert_eq!(psec[3], 0.009);
    assert!((psec[4] - 0.0081).abs() < 1e-15);
}

#[test]
fn a_stop_brakes_from_the_velocity_of_the_stream() {
    for delay in [0, 8] {
        let mut t = delayed(delay);
        stream(&mut t, 0, &ramp(0.0, 0.0012, 40));
        let from = t.commanded_state(0).unwrap();
        assert!((from.velocity - 0.2).abs() < 1e-12);
        let admission = submit(&mut t, 1, &stop(&[])).unwrap();
        let mut psec = vec![from.position - 0.0012, from.position];
        psec.extend(run(&mut t, 0, 60).0);
        // From constant velocity: v/a + a/j = 0.08 s + 0.05 s, at half the velocity on average.
        assert_eq!(admission.end_k - admission.join_k + 1, 22);
        assert!((psec[61] - from.position - 0.2 * 0.13 / 2.0).abs() < 1e-12);
        for three in psec.windows(3) {
            let acceleration = (three[2] - 2.0 * three[1] + three[0]) / (TSP_S * TSP_S);
            assert!(acceleration.abs() <= 2.5 * (1.0 + 1e-6), "{acceleration} m/s² at delay {delay}");
        }
        assert_eq!(t.commanded_state(0), Some(KinematicState::at_rest(psec[61])));
    }
}

#[test]
fn a_reset_clears_the_buffer() {
    let mut t = delayed(5);
    stream(&mut t, 0, &ramp(0.0, 0.001, 10));
    t.reset(&[0.1, 0.0]).unwrap();
    assert!(!t.is_streaming() && !t.is_stream_moving());
    assert_eq!(t.psec_ahead(0, 3), Some(0.1));
    assert_eq!(run(&mut t, 0, 10).0, [0.1; 10]);
    assert_eq!(t.submit_setpoint(0, 0.011).unwrap_err().code, RejectionCode::Jump);
}

#[test]
fn a_change_of_the_delay_waits_for_a_pause_and_causes_no_motion() {
    for (before, after) in [(0, 14), (14, 0), (14, 3), (3, 14)] {
        let mut t = delayed(before);
        let positions = ramp(0.0, 0.001, 40);
        stream(&mut t, 0, &positions);
        t.set_stream_delay(after);
        assert_eq!(t.stream_delay(), before);
        // A stream without a pause keeps its delay, also with a short gap.
        let mut psec = stream(&mut t, 0, &ramp(0.040, 0.001, 40));
        psec.extend(run(&mut t, 0, 10).0);
        psec.extend(stream(&mut t, 0, &ramp(0.080, 0.001, 10)));
        assert_eq!(t.stream_delay(), before);
        psec.extend(run(&mut t, 0, before as usize + PAUSE).0);
        assert_eq!(t.stream_delay(), after, "{before} to {after}");
        assert!(psec.windows(2).all(|two| (0.0..=0.001 + 1e-15).contains(&(two[1] - two[0]))));
        assert_eq!(psec.last(), Some(&0.09));
        let psec = stream(&mut t, 0, &[0.091; 20]);
        assert_eq!(psec.iter().position(|&p| p == 0.091), Some(after as usize));
    }
}

#[test]
fn without_a_stream_a_delay_takes_effect_immediately_and_is_bounded() {
    let mut t = timeline();
    t.set_stream_delay(u32::MAX);
    assert_eq!(t.stream_delay(), MAX_STREAM_DELAY);
    t.set_stream_delay(7);
    assert_eq!(t.stream_delay(), 7);
    // Also during a trajectory.
    submit(&mut t, 1, &path(Start::Now, "x", &[(0, &[0.0]), (10, &[0.01])])).unwrap();
    run(&mut t, 0, 5);
    t.set_stream_delay(2);
    assert_eq!(t.stream_delay(), 2);
    run(&mut t, 0, 10);
    assert_eq!(stream(&mut t, 0, &[0.011; 4]), [0.01, 0.01, 0.011, 0.011]);
}

#[test]
fn a_stream_is_active_until_it_has_paused_and_its_last_setpoint_is_commanded() {
    let mut t = delayed(14);
    assert!(!t.is_streaming() && !t.is_stream_moving());
    // A constant stream is active without motion.
    stream(&mut t, 0, &[0.0; 20]);
    assert!(t.is_streaming() && !t.is_stream_moving());
    stream(&mut t, 0, &[0.001]);
    let moving: Vec<_> = (0..20)
        .map(|_| {
            t.next();
            t.is_stream_moving()
        })
        .collect();
    assert_eq!(moving.iter().position(|m| !m), Some(14));
    assert!(t.is_streaming() && !t.is_moving());
    run(&mut t, 0, PAUSE);
    assert!(!t.is_streaming());
}

proptest! {
    /// Commanded speed never exceeds Vmax, and commanded setpoints equal the previewed ones, for any sender and any
    /// changes of the delay.
    #[test]
    fn no_sender_and_no_change_of_the_delay_causes_a_jump(
        script in prop::collection::vec((-1.5..1.5f64, 0..30usize, prop::option::weighted(0.2, 0..40u32)), 1..60),
    ) {
        let mut t = timeline();
        let (mut target, mut last) = (0.0, 0.0);
        for (step, gap, delay) in script {
            if let Some(delay) = delay {
                t.set_stream_delay(delay);
            }
            if t.submit_setpoint(0, target + step * REACH) == Ok(true) {
                target += step * REACH;
            }
            let known: Vec<_> = (1..=30).map(|periods| t.psec_ahead(0, periods).unwrap()).collect();
            let delay = t.stream_delay();
            for (psec, known) in run(&mut t, 0, gap + 1).0.into_iter().zip(known) {
                prop_assert!((psec - last).abs() <= REACH * (1.0 + 1e-9));
                prop_assert!(psec == known || t.stream_delay() != delay);
                last = psec;
            }
        }
        // Remaining approach: at most 1.5·Vmax·Tsp for each of 60 steps.
        let rest = t.stream_delay() as usize + 1 + 90;
        prop_assert_eq!(run(&mut t, 0, rest).0[rest - 1], target);
    }
}

/// The default machine with `controller` on X.
fn config(controller: &str) -> MachineConfig {
    let mut parameters = virtual_axes_verification::fixtures::machines::parameters::<&str>(&[]);
    let assignment = Assignment {
        key: "x.position_loop.controller".into(),
        value: Value::Text(controller.into()),
        source: ValueSource::named("test"),
    };
    parameters.set_all(vec![assignment]).expect("known controller");
    parameters.machine_config().expect("valid")
}

fn simulation(config: &MachineConfig) -> Simulation {
    Simulation::new(config, joint_limits(config, ""), 0).expect("can be simulated")
}

/// Returns the bits of the signals of X.
fn signals(s: &Simulation) -> [u64; 4] {
    let x = s.samples()[0];
    [x.psec, x.position, x.current, x.velocity_setpoint].map(f64::to_bits)
}

/// Creates a trajectory of X with points at position cycles.
fn trajectory_of_x(config: &MachineConfig, positions: &[f64]) -> Arc<Trajectory> {
    let mut request = TrajectoryRequest::new(Start::Now, vec!["x".into()]);
    for (k, position) in positions.iter().enumerate() {
        request
            .push(k as i64 * TSP, TrajectoryPoint { positions: &[*position], ..TrajectoryPoint::default() })
            .unwrap();
    }
    let joints = joint_limits(config, "");
    let context = ValidationContext {
        joints: &joints,
        period: TSP,
        max_points: 1000,
        allow_nonzero_end_velocity: false,
    };
    Trajectory::new(request, &context).unwrap().into()
}

/// The stream delay equals the preview of the controller: T reads up to N2 = 14 cycles beyond the setpoint, minus
/// the pure delay α = 1.5 cycles, rounded up to 2.
#[test]
fn a_streamed_path_is_bit_identical_to_the_same_path_in_a_trajectory() {
    for (controller, delay) in [("cascade", 0), ("gpc", 12)] {
        let config = config(controller);
        // At rest at the start, for the longest preview, and at the end.
        let wave = |k: i32| 0.02 * (1.0 - (f64::from(k.clamp(0, 314)) * 0.02).cos());
        let positions: Vec<_> = (-20..400).map(wave).collect();
        let mut streamed = simulation(&config);
        assert_eq!(streamed.stream_delay(), delay * TSP, "{controller}");
        let mut followed = Vec::new();
        for &position in positions.iter().chain(&[wave(400); 12]) {
            streamed.submit_setpoint(0, position).unwrap();
            streamed.step();
            followed.push(signals(&streamed));
        }
        let mut reference = simulation(&config);
        reference.submit(MotionId(1), trajectory_of_x(&config, &positions)).unwrap();
        for k in 0..positions.len() {
            reference.step();
            assert_eq!(signals(&reference), followed[k + delay as usize], "{controller}, instant {k}");
        }
    }
}

#[test]
fn a_new_controller_changes_the_delay_when_the_stream_pauses() {
    let parameters = |controller| Arc::new(MachineParameters::new(&config(controller)).unwrap());
    let mut s = simulation(&config("cascade"));
    for position in ramp(0.0, 0.001, 20) {
        s.submit_setpoint(0, position).unwrap();
        s.step();
    }
    s.update_parameters(parameters("gpc")).unwrap();
    for _ in 0..3 {
        s.step();
        assert_eq!(s.stream_delay(), 0);
        assert_eq!(s.samples()[0].psec, 0.020);
    }
    for _ in 0..PAUSE {
        s.step();
    }
    assert_eq!(s.stream_delay(), 12 * TSP);
    s.update_parameters(parameters("cascade")).unwrap();
    assert_eq!(s.stream_delay(), 0, "the stream has paused");
}

#[test]
fn a_stream_starts_the_machine_at_its_first_motion_and_is_no_active_command() {
    let mut s = simulation(&config("cascade"));
    let at_rest = s.machine().tick();
    for _ in 0..10 {
        s.submit_setpoint(0, 0.0).unwrap();
        s.step();
    }
    assert_eq!(s.machine().tick(), at_rest, "a constant stream at home does not start the machine");
    s.submit_setpoint(0, 0.001).unwrap();
    s.step();
    assert!(s.machine().tick() > at_rest);
    assert!(s.is_streaming() && !s.is_moving() && !s.is_busy());
    for _ in 0..200 {
        s.step();
    }
    virtual_axes_verification::fixtures::machines::assert_near(
        "x follows",
        s.samples()[0].position,
        0.001,
        2e-6,
    );
    assert!(!s.is_streaming());
}

#[test]
fn a_setpoint_is_commanded_with_the_delay_of_its_preview() {
    for (before, after) in [(20, 0), (3, 14)] {
        // A setpoint arrives at about the instant at which the changed delay takes effect.
        for early in 0..4 {
            let mut t = delayed(before);
            stream(&mut t, 0, &[0.001]);
            t.set_stream_delay(after);
            run(&mut t, 0, before as usize + PAUSE - early);
            assert_eq!(t.submit_setpoint(0, 0.0039), Ok(true));
            let previewed: Vec<f64> = (1..40).filter_map(|j| t.psec_ahead(0, j)).collect();
            assert_eq!(run(&mut t, 0, 39).0, previewed, "{before} to {after}, {early} early");
        }
    }
}

#[test]
fn a_reset_applies_a_requested_delay() {
    let mut t = delayed(20);
    stream(&mut t, 0, &ramp(0.0, 0.001, 10));
    t.set_stream_delay(0);
    assert_eq!(t.stream_delay(), 20);
    t.reset(&vec![0.0; t.joints().len()]).expect("home");
    assert_eq!(t.stream_delay(), 0);
    assert_eq!(stream(&mut t, 0, &[0.001, 0.002]), [0.001, 0.002]);
}

#[test]
fn a_stream_starts_identically_with_and_without_a_simultaneous_load() {
    let config = config("cascade");
    let loaded_from = |instant: Option<usize>| -> Vec<[u64; 4]> {
        let mut s = simulation(&config);
        (0..40)
            .map(|k| {
                // A load on Y starts the machine and does not affect X.
                if instant.is_some_and(|instant| k >= instant) {
                    s.set_load(1, 50.0, TSP);
                }
                if k >= 10 {
                    s.submit_setpoint(0, 0.001).unwrap();
                }
                s.step();
                signals(&s)
            })
            .collect()
    };
    let alone = loaded_from(None);
    assert_ne!(alone[0], alone[39], "X moves");
    assert_eq!(loaded_from(Some(2)), alone);
    assert_eq!(loaded_from(Some(10)), alone);
}
