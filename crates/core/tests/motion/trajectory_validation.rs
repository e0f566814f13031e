//! Validation of trajectory requests: rejection codes, joints, NaN, travel limits, speed.

use crate::trajectory_common::*;
use virtual_axes_core::trajectory::{RejectionCode, Start, TrajectoryPoint, TrajectoryRequest};

fn rejection_of(request: TrajectoryRequest) -> (RejectionCode, Option<String>, Option<usize>, f64, f64) {
    let r = validate(request, false).unwrap_err();
    assert!(!r.to_string().is_empty());
    (r.code, r.joint, r.index, r.value, r.limit)
}

fn joint(name: &str) -> Option<String> {
    Some(name.into())
}

#[test]
fn rejection_codes_keep_their_values() {
    let codes = [
        (RejectionCode::UnknownJoint, 1),
        (RejectionCode::DuplicateJoint, 2),
        (RejectionCode::WrongSize, 3),
        (RejectionCode::TimesNotIncreasing, 4),
        (RejectionCode::NegativeTime, 5),
        (RejectionCode::NotFinite, 6),
        (RejectionCode::OutsideTravelLimits, 7),
        (RejectionCode::Jump, 8),
        (RejectionCode::Speed, 9),
        (RejectionCode::EndedInThePast, 10),
        (RejectionCode::TooManyPoints, 11),
        (RejectionCode::VelocityAtEnd, 12),
        (RejectionCode::InvalidTime, 13),
        (RejectionCode::QueueFull, 14),
        (RejectionCode::InvalidTolerance, 15),
        (RejectionCode::MultiDof, 16),
        (RejectionCode::TooManyGoals, 17),
        (RejectionCode::NotActive, 18),
    ];
    for (code, number) in codes {
        assert_eq!(code as u8, number);
    }
}

#[test]
fn unknown_and_duplicate_joints_are_rejected_even_in_a_stop() {
    let names = |names: &[&str]| {
        TrajectoryRequest::new(Start::Now, names.iter().map(|&name| name.to_owned()).collect())
    };
    assert_eq!(rejection_of(names(&["x", "q"])).1, joint("q"));
    assert_eq!(rejection_of(names(&["x", "q"])).0, RejectionCode::UnknownJoint);
    assert_eq!(rejection_of(names(&["c", "c"])).0, RejectionCode::DuplicateJoint);
}

#[test]
fn a_point_outside_the_travel_limits_gives_joint_index_value_and_limit() {
    let request = request(Start::Now, "x", &[(0, &[-0.35]), (1_000_000_000, &[-0.3551])]);
    assert_eq!(
        rejection_of(request),
        (RejectionCode::OutsideTravelLimits, joint("x"), Some(1), -0.3551, -0.355)
    );
}

#[test]
fn a_point_exactly_at_the_travel_limit_is_accepted() {
    let r = request(Start::Now, "x", &[(0, &[0.355]), (TSP, &[0.355])]);
    assert!(validate(r, false).is_ok());
}

#[test]
fn a_spline_outside_the_travel_limits_between_its_points_is_rejected() {
    let r = request(Start::Now, "x", &[(0, &[0.35, 0.4]), (200_000_000, &[0.35, -0.4])]);
    let (code, _, index, value, limit) = rejection_with_end_velocity(r);
    assert_eq!((code, index, limit), (RejectionCode::OutsideTravelLimits, Some(1), 0.355));
    assert!(value > 0.355);
}

fn rejection_with_end_velocity(
    request: TrajectoryRequest,
) -> (RejectionCode, Option<String>, Option<usize>, f64, f64) {
    let r = validate(request, true).unwrap_err();
    (r.code, r.joint, r.index, r.value, r.limit)
}

#[test]
fn speed_at_the_limit_is_accepted_and_a_millionth_more_is_rejected() {
    let step = 0.5 * TSP_S;
    let ramp = |scale: f64| {
        let mut r = TrajectoryRequest::new(Start::Now, vec!["x".into()]);
        for k in 0..100 {
            let point =
                TrajectoryPoint { positions: &[f64::from(k) * step * scale], ..TrajectoryPoint::default() };
            r.push(i64::from(k) * TSP, point).unwrap();
        }
        r
    };
    assert!(validate(ramp(1.0), false).is_ok());
    let (code, _, index, value, limit) = rejection_of(ramp(1.000_001));
    assert_eq!((code, index, limit), (RejectionCode::Speed, Some(1), 0.5));
    assert!((value - 0.500_000_5).abs() < 1e-12);
}

#[test]
fn a_velocity_field_beyond_the_limit_is_rejected_as_speed() {
    let r = request(Start::Now, "x", &[(0, &[0.0, 100.0]), (TSP, &[0.0, 0.0])]);
    let (code, _, index, value, _) = rejection_of(r);
    assert_eq!((code, index, value), (RejectionCode::Speed, Some(0), 100.0));
}

#[test]
fn a_fast_step_between_dense_points_is_detected_on_the_position_grid() {
    // Points each 1 ms; one of the steps is 2·Vmax·Tsp.
    let mut r = TrajectoryRequest::new(Start::Now, vec!["c".into()]);
    for ms in 0..20 {
        let positions = [if ms < 10 { 0.0 } else { 0.006 }];
        let point = TrajectoryPoint { positions: &positions, ..TrajectoryPoint::default() };
        r.push(ms * 1_000_000, point).unwrap();
    }
    assert_eq!(rejection_of(r).0, RejectionCode::Speed);
}

#[test]
fn the_last_step_to_a_point_between_two_periods_is_checked() {
    let r = request(Start::Now, "c", &[(0, &[0.0]), (1_000_000, &[0.004])]);
    assert_eq!(rejection_of(r).0, RejectionCode::Speed);
}

#[test]
fn a_residual_velocity_at_the_end_counts_as_zero() {
    let of = |velocity: f64| request(Start::Now, "x", &[(0, &[0.0, 0.0]), (TSP * 10, &[0.003, velocity])]);
    assert!(validate(of(4e-7), false).is_ok() && validate(of(-1e-6), false).is_ok());
    assert_eq!(rejection_of(of(1.1e-6)).0, RejectionCode::VelocityAtEnd);
}

#[test]
fn velocity_at_the_end_requires_the_parameter() {
    let points: &[(i64, &[f64])] = &[(0, &[0.0, 0.1]), (TSP * 10, &[0.006, 0.1])];
    assert_eq!(
        rejection_of(request(Start::Now, "x", points)),
        (RejectionCode::VelocityAtEnd, joint("x"), Some(1), 0.1, 0.0)
    );
    assert!(validate(request(Start::Now, "x", points), true).is_ok());
}

#[test]
fn too_many_points_are_rejected_first() {
    let mut r = TrajectoryRequest::new(Start::Now, vec!["x".into()]);
    for k in 0..=100_000 {
        let point = TrajectoryPoint { positions: &[0.0], ..TrajectoryPoint::default() };
        r.push(k, point).unwrap();
    }
    let (code, _, _, value, limit) = rejection_of(r);
    assert_eq!((code, value, limit), (RejectionCode::TooManyPoints, 100_001.0, 100_000.0));
}

#[test]
fn validation_cost_of_centuries_is_bounded() {
    let (mut r, century) =
        (TrajectoryRequest::new(Start::Now, vec!["x".into(), "c".into()]), 3_155_760_000_000_000_000);
    let point = |positions| TrajectoryPoint {
        positions,
        velocities: &[0.0, 0.0],
        accelerations: &[0.0, 0.0],
        effort: &[],
    };
    for i in 0..1000 {
        r.push(i * (century / 1000), point(&[0.0, 0.1])).unwrap();
    }
    let begin = std::time::Instant::now();
    assert!(validate(r, false).is_ok());
    assert!(begin.elapsed().as_secs() < 20, "bounded cost also in a debug build");
}

#[test]
fn a_long_segment_outside_the_travel_limits_is_detected_by_samples() {
    let hour = 3_600_000_000_000;
    let mut r = TrajectoryRequest::new(Start::Now, vec!["x".into()]);
    let point =
        |positions, velocities| TrajectoryPoint { positions, velocities, ..TrajectoryPoint::default() };
    // 64 samples for each segment; the second segment overshoots by meters.
    for i in 0..70_000 {
        let velocity: &[f64] = if i == 1 { &[0.01] } else { &[0.0] };
        r.push(i * hour, point(&[0.0], velocity)).unwrap();
    }
    let (code, _, index, _, _) = rejection_of(r);
    assert_eq!((code, index), (RejectionCode::OutsideTravelLimits, Some(1)));
}

#[test]
fn values_that_overflow_the_polynomial_are_rejected() {
    let r = request(Start::Now, "c", &[(0, &[0.0, 0.0, f64::MAX]), (i64::MAX - 1, &[0.0, 0.0, -f64::MAX])]);
    assert!(matches!(
        rejection_of(r).0,
        RejectionCode::Speed | RejectionCode::OutsideTravelLimits | RejectionCode::NotFinite
    ));
}

#[test]
fn no_points_is_a_stop_of_the_named_joints_or_all() {
    assert!(stop(&[]).is_stop());
    assert_eq!(stop(&[]).joints(), [0, 1]);
    assert_eq!(stop(&["c"]).joints(), [1]);
}
