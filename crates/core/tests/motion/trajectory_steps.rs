//! Trajectories without interpolation, and the setpoints planned at a later time.

use crate::trajectory_common::*;
use virtual_axes_core::trajectory::{RejectionCode, Start};

const TWO_MM: f64 = 0.002;

#[test]
fn without_interpolation_the_setpoint_is_the_next_point() {
    let mut t = timeline();
    // Before the first point at 12 ms, the commanded state is held; jumps are at most Vmax·Tsp = 3 mm.
    let points: &[(i64, &[f64])] = &[(2 * TSP, &[TWO_MM]), (4 * TSP, &[2.0 * TWO_MM]), (5 * TSP, &[TWO_MM])];
    let steps = validate(request(Start::Now, "x", points).without_interpolation(), false).unwrap();
    submit(&mut t, 1, &steps).unwrap();
    let expected = [0.0, 0.0, TWO_MM, 2.0 * TWO_MM, 2.0 * TWO_MM, TWO_MM, TWO_MM];
    assert_eq!(run(&mut t, 0, 7).0, expected);
    assert!(!t.is_moving());
}

#[test]
fn steps_beyond_the_velocity_limit_are_rejected_with_their_point() {
    let points: &[(i64, &[f64])] = &[(0, &[0.0]), (TSP, &[TWO_MM]), (5 * TSP, &[3.0 * TWO_MM])];
    assert!(validate(request(Start::Now, "x", points), false).is_ok());
    let rejection = validate(request(Start::Now, "x", points).without_interpolation(), false)
        .expect_err("a jump of 4 mm");
    assert_eq!((rejection.code, rejection.index), (RejectionCode::Speed, Some(2)));
    let mut t = timeline();
    let late =
        validate(request(Start::Now, "x", &[(2 * TSP, &[0.01])]).without_interpolation(), false).unwrap();
    assert_eq!(submit(&mut t, 1, &late).unwrap_err().code, RejectionCode::Speed);
}

#[test]
fn velocities_of_points_without_interpolation_are_checked_and_move_nothing() {
    let points: &[(i64, &[f64])] = &[(0, &[0.0, 0.1]), (TSP, &[0.0, 0.1])];
    let steps = |allow| validate(request(Start::Now, "x", points).without_interpolation(), allow);
    assert_eq!(steps(false).expect_err("in motion at the end").code, RejectionCode::VelocityAtEnd);
    let mut t = timeline();
    submit(&mut t, 1, &steps(true).unwrap()).unwrap();
    assert_eq!(run(&mut t, 0, 5).0, [0.0; 5]);
}

#[test]
fn planned_states_are_the_setpoints_that_follow() {
    let mut t = timeline();
    let cubic: &[(i64, &[f64])] = &[(0, &[0.0, 0.0]), (40, &[0.02, 0.0])];
    submit(&mut t, 1, &path(at(10), "x", cubic)).unwrap();
    t.set_feed_override(0.5).unwrap();
    for _ in 0..20 {
        t.next();
    }
    let now = t.next_instant() - 1;
    let planned: Vec<_> = (0..120).map(|ahead| t.planned_state(0, now + ahead).unwrap()).collect();
    assert_eq!(t.planned_state(0, now - 5), t.planned_state(0, now), "the past is not kept");
    assert_eq!(t.planned_state(2, now), None);
    for (ahead, (state, is_commanded)) in planned.into_iter().enumerate() {
        let commanded = t.commanded_state(0).unwrap();
        assert!((state.position - commanded.position).abs() < 1e-15, "{ahead}");
        assert!((state.velocity - commanded.velocity).abs() < 1e-13, "{ahead}");
        assert_eq!(is_commanded, t.is_moving(), "{ahead}");
        assert!(!t.planned_state(1, now + ahead as i64).unwrap().1);
        t.next();
    }
}
