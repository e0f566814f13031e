//! Feed profiles compared with closed forms, and limits of the sampled setpoints.

use std::f64::consts::{PI, TAU};

use crate::path_common::*;
use proptest::prelude::*;
use virtual_axes_core::path::{Block, FeedProfile, Frame, Move, PathLimits, PlanError, Program};
use virtual_axes_core::units::{DEGREE, RPM};
use virtual_axes_verification::fixtures::machines::{Ballbar, M_MIN, RestToRestProfile};

const HOME: [f64; 5] = [0.0; 5];

/// Compares the sampled setpoints with `wanted`, m or rad.
#[track_caller]
fn assert_joint(program: &Program, joint: usize, tolerance: f64, wanted: impl Fn(f64) -> f64) {
    let last = (program.duration() / TSP).ceil() as usize + 2;
    for k in 0..last {
        let t = k as f64 * TSP;
        let (found, wanted) = (psec(program, t)[joint], wanted(t));
        assert!((found - wanted).abs() <= tolerance, "{t} s: {found}, wanted {wanted}");
    }
}

#[test]
fn a_line_of_200_mm_has_the_seven_phase_jerk_limited_profile() {
    let profile = RestToRestProfile::new(0.2, 10.0 * M_MIN, 2.5, 50.0);
    let block = line(HOME, [0.2, 0.0, 0.0, 0.0, 0.0]);
    let program = plan(Frame::Joints, vec![Move::new(block, 10.0 * M_MIN)]).expect("planned");
    assert!((program.duration() - profile.duration()).abs() < 1e-14);
    assert_joint(&program, 0, 1e-12, |t| profile.at(t));
    assert_joint(&program, 1, 0.0, |_| 0.0);
}

#[test]
fn a_rotation_is_measured_in_radians() {
    let profile = RestToRestProfile::new(90.0 * DEGREE, 10.0 * RPM, 0.83 * TAU, 50.0 * TAU);
    let block = line(HOME, [0.0, 0.0, 0.0, 0.0, 90.0 * DEGREE]);
    let program = plan(Frame::Joints, vec![Move::new(block, 10.0 * RPM)]).expect("planned");
    assert_joint(&program, 4, 1e-12, |t| profile.at(t));
}

#[test]
fn moves_with_an_exact_stop_follow_without_a_dwell_off_the_grid() {
    let leg = RestToRestProfile::new(0.05, 10.0 * M_MIN, 2.5, 50.0);
    for turn in [90.0 * DEGREE, 45.0 * DEGREE] {
        let corner = [0.05, 0.0, 0.0, 0.0, 0.0];
        let end = [0.05 + 0.05 * turn.cos(), 0.05 * turn.sin(), 0.0, 0.0, 0.0];
        // Along a diagonal the limits of two axes would permit more than those of the test.
        let limits = PathLimits { acceleration: 2.5, jerk: 50.0 };
        let moves = [line(HOME, corner), line(corner, end)]
            .map(|block| Move { limits, ..Move::new(block, 10.0 * M_MIN) });
        let program = plan(Frame::Joints, moves.to_vec()).expect("planned");
        assert_eq!(program.time_range(0).end, program.time_range(1).start);
        assert!((program.duration() - 2.0 * leg.duration()).abs() < 1e-14);
        let second = |t: f64| leg.at(t - leg.duration());
        assert_joint(&program, 0, 1e-12, |t| leg.at(t) + turn.cos() * second(t));
        assert_joint(&program, 1, 1e-12, |t| turn.sin() * second(t));
        assert_within_limits(&program);
    }
}

#[test]
fn a_planned_ballbar_matches_its_closed_form() {
    let trial = Ballbar::paper();
    let circle = arc(HOME, [-0.15, 0.0], 0.0 + 2.0 * TAU + trial.velocity * Ballbar::RAMP / 0.15, HOME);
    let profile = FeedProfile::Cosine { ramp: Ballbar::RAMP };
    let moves = vec![Move { profile, dwell: Ballbar::REST, ..Move::new(circle, trial.velocity) }];
    let program = Program::plan(kinematics(&[]), Frame::Joints, &limits(), PERIOD, Ballbar::REST, moves)
        .expect("planned");
    assert!((program.duration() - trial.duration()).abs() < 1e-12);
    for joint in 0..5 {
        assert_joint(&program, joint, 1e-12, |t| trial.psec(t)[joint]);
    }
}

#[test]
fn two_feeds_on_one_line_change_before_the_junction() {
    let (border, end) = (130.0 * DEGREE, 210.0 * DEGREE);
    let [a, b] = [border, end].map(|c| [0.0, 0.0, 0.0, 0.0, c]);
    let moves = vec![Move::new(line(HOME, a), 18.0 * RPM), Move::new(line(a, b), 6.0 * RPM)];
    let program = plan(Frame::Joints, moves).expect("planned");
    let at = program.time_range(0).end;
    assert_eq!(psec(&program, at)[4], border);
    let h = 1e-5;
    let speed = |t: f64| (psec(&program, t + h)[4] - psec(&program, t - h)[4]) / (2.0 * h);
    assert!((speed(at) / (6.0 * RPM) - 1.0).abs() < 1e-6, "{}", speed(at) / RPM);
    assert!((speed(at / 2.0) / (18.0 * RPM) - 1.0).abs() < 1e-9);
    // Ramp from 18 to 6 rpm before the junction; after it only the ramp to rest.
    let (acceleration, jerk) = (0.83 * TAU, 50.0 * TAU);
    let ramp = |gain: f64| gain * RPM / acceleration + acceleration / jerk;
    let first = 130.0 * DEGREE - 9.0 * RPM * ramp(18.0) - 12.0 * RPM * ramp(12.0);
    let second = 80.0 * DEGREE - 3.0 * RPM * ramp(6.0);
    let wanted = ramp(18.0) + first / (18.0 * RPM) + ramp(12.0) + second / (6.0 * RPM) + ramp(6.0);
    assert!((program.duration() - wanted).abs() < 1e-12, "{} {wanted}", program.duration());
    assert_within_limits(&program);
}

/// Moves along two lines of 60 mm joined by half circles of 15 mm.
fn contour_b(turned: f64) -> Vec<Move> {
    let (s, c) = turned.sin_cos();
    let at = |x: f64, y: f64| [c * x - s * y, s * x + c * y, 0.0, 0.0, 0.0];
    let center = |x: f64, y: f64| [at(x, y)[0], at(x, y)[1]];
    let corners = [at(0.0, 0.0), at(0.06, 0.0), at(0.06, 0.03), at(0.0, 0.03)];
    let first = line(corners[0], corners[1]);
    let half = arc(corners[1], center(0.06, 0.015), PI, corners[2]);
    let back = Block::line(half.end(), &corners[3], &KINDS).expect("a line");
    let last = Block::arc(back.end(), [0, 1], center(0.0, 0.015), PI, &HOME, &KINDS).expect("an arc");
    [first, half, back, last].map(|block| Move::new(block, 10.0 * M_MIN)).to_vec()
}

#[test]
fn a_curvature_jump_is_passed_at_the_speed_whose_acceleration_is_jerk_times_period() {
    let program = plan(Frame::Joints, contour_b(0.0)).expect("planned");
    // Y has 3.0 m/s² and 50 m/s³: v²/R = Jmax·Tsp.
    let wanted = (50.0 * TSP * 0.015_f64).sqrt();
    for block in 0..3 {
        let at = program.time_range(block).end;
        let h = 1e-6;
        let speed = (program.progress(at + h) - program.progress(at - h)) / (2.0 * h);
        assert!((speed / wanted - 1.0).abs() < 1e-5, "end of block {block}: {speed}, wanted {wanted}");
    }
    assert_within_limits(&program);
}

#[test]
fn contours_with_curvature_jumps_keep_the_limits_in_any_direction() {
    for degrees in [15.0, 30.0, 45.0, 60.0, 200.0] {
        let program = plan(Frame::Joints, contour_b(degrees * DEGREE)).expect("planned");
        println!("{degrees}°: {} s", program.duration());
        assert_within_limits(&program);
    }
}

/// Returns the speed along the path at time `t`.
fn speed(program: &Program, t: f64) -> f64 {
    let h = 1e-5;
    (program.progress(t + h) - program.progress(t - h)) / (2.0 * h)
}

fn spline(from: [f64; 5], points: &[[f64; 5]]) -> Block {
    let points: Vec<Vec<f64>> = points.iter().map(|point| point.to_vec()).collect();
    Block::spline(&from, &points, &KINDS).expect("a spline")
}

#[test]
fn first_and_last_points_are_exact_and_progress_is_monotonic() {
    let corner = [0.0123, 0.0456, 0.0789, 0.1, -0.2];
    let end = [0.05, 0.02, 0.07, 0.3, 0.4];
    let moves = vec![
        Move { dwell: 0.1, ..Move::new(line(HOME, corner), 0.2) },
        Move::new(spline(corner, &[[0.03, 0.05, 0.08, 0.1, 0.0], [0.04, 0.04, 0.08, 0.2, 0.3], end]), 0.1),
    ];
    let program =
        Program::plan(kinematics(&[]), Frame::Joints, &limits(), PERIOD, 0.25, moves).expect("planned");
    assert_eq!(program.time_range(0).start, 0.25);
    assert!((program.time_range(1).start - program.time_range(0).end - 0.1).abs() < 1e-15);
    assert_eq!(program.duration(), program.time_range(1).end);
    assert_eq!(psec(&program, -1.0), HOME);
    assert_eq!(psec(&program, 0.25), HOME);
    assert_eq!(psec(&program, program.time_range(0).end), corner);
    assert_eq!(psec(&program, program.time_range(1).start), corner);
    assert_eq!(psec(&program, program.duration()), end);
    assert_eq!(psec(&program, f64::INFINITY), end);
    assert_eq!(program.progress(f64::INFINITY), program.path().length());
    let mut before = 0.0;
    for i in 0..200_000 {
        let u = program.progress(program.duration() * f64::from(i) / 199_999.0);
        assert!(u >= before);
        before = u;
    }
    // Times close to the ends of spans, in steps of a few rounding errors.
    for span in [program.time_range(0), program.time_range(1)] {
        for border in [span.start, span.end] {
            let mut t = border - 1e-9;
            let mut before = program.progress(t);
            for _ in 0..1000 {
                t += 2e-12;
                let u = program.progress(t);
                assert!(u >= before, "{u} after {before} at {t}");
                before = u;
            }
        }
    }
    assert_within_limits(&program);
}

#[test]
fn a_straight_line_of_the_tip_is_as_fast_as_the_axes_allow() {
    // Along the diagonal of X and Y with the table at 45° only X moves.
    let c = 45.0 * DEGREE;
    let from = [0.0, 0.0, 0.0, 0.0, c];
    let to = [0.1, 0.1, 0.0, 0.0, c];
    let length = 0.1 * 2.0_f64.sqrt();
    let program = plan(Frame::Workpiece, vec![Move::new(line(from, to), 10.0 * M_MIN)]).expect("planned");
    let profile = RestToRestProfile::new(length, 10.0 * M_MIN, 2.5, 50.0);
    assert!((program.duration() - profile.duration()).abs() < 1e-12);
    let start = psec(&program, 0.0)[0];
    assert_joint(&program, 0, 1e-12, |t| start + profile.at(t));
    let start = psec(&program, 0.0)[1];
    assert_joint(&program, 1, 1e-15, |_| start);
}

#[test]
fn limits_of_the_move_are_kept_in_addition_to_those_of_the_axes() {
    let profile = RestToRestProfile::new(0.2, 10.0 * M_MIN, 1.0, 20.0);
    let limits = PathLimits { acceleration: 1.0, jerk: 20.0 };
    let block = line(HOME, [0.2, 0.0, 0.0, 0.0, 0.0]);
    let program =
        plan(Frame::Joints, vec![Move { limits, ..Move::new(block, 10.0 * M_MIN) }]).expect("planned");
    assert_joint(&program, 0, 1e-12, |t| profile.at(t));
}

#[test]
fn a_feed_above_the_axis_limits_is_reduced_to_them() {
    // 30 m/min on each of X and Y.
    let to = [0.3, 0.3, 0.0, 0.0, 0.0];
    let program = plan(Frame::Joints, vec![Move::new(line(HOME, to), 1e9)]).expect("planned");
    let root = 2.0_f64.sqrt();
    let profile = RestToRestProfile::new(0.3 * root, 0.5 * root, 2.5 * root, 50.0 * root);
    assert!((program.duration() - profile.duration()).abs() < 1e-12);
    assert_within_limits(&program);
}

#[test]
fn a_permitted_corner_is_passed_at_its_speed() {
    let corner = [0.05, 0.0, 0.0, 0.0, 0.0];
    let end = [0.05, 0.05, 0.0, 0.0, 0.0];
    let permitted = 1.0 * M_MIN;
    let first = Move { corner: Some(permitted), ..Move::new(line(HOME, corner), 10.0 * M_MIN) };
    let program =
        plan(Frame::Joints, vec![first, Move::new(line(corner, end), 10.0 * M_MIN)]).expect("planned");
    let at = program.time_range(0).end;
    assert!((speed(&program, at) / permitted - 1.0).abs() < 1e-3);
    assert!(speed(&program, at - 0.05) > 2.0 * permitted && speed(&program, at + 0.05) > 2.0 * permitted);
}

#[test]
fn a_spline_is_slow_only_where_its_curvature_requires_it() {
    // A sharp bend in the middle of a long, otherwise straight spline.
    let points: Vec<[f64; 5]> = (1..=20)
        .map(|i| {
            let x = 0.03 * f64::from(i);
            [x, if i == 10 { 0.04 } else { 0.0 }, 0.0, 0.0, 0.0]
        })
        .collect();
    let program = plan(Frame::Joints, vec![Move::new(spline(HOME, &points), 20.0 * M_MIN)]).expect("planned");
    assert_within_limits(&program);
    let mut fastest = 0.0_f64;
    let mut slowest = f64::INFINITY;
    let (from, to) = (0.15, program.duration() - 0.3);
    for i in 0..1000 {
        let v = speed(&program, from + (to - from) * f64::from(i) / 1000.0);
        fastest = fastest.max(v);
        slowest = slowest.min(v);
    }
    println!("{} s, {} to {} m/min", program.duration(), slowest / M_MIN, fastest / M_MIN);
    assert!(fastest > 19.9 * M_MIN && slowest < 10.0 * M_MIN);
}

#[test]
fn a_spline_that_nearly_turns_back_is_passed_slowly() {
    let points = [
        [0.0, 0.0, -0.02, 0.0, 0.0],
        [-0.0277, 0.0192, -0.0308, 0.0, 0.0],
        [-0.0004, -0.0017, -0.0176, 0.0, 0.0],
        [-0.0004, -0.0017, -0.0339, 0.0, 0.0],
    ];
    let program = plan(Frame::Joints, vec![Move::new(spline(HOME, &points), 10.0 * M_MIN)]).expect("planned");
    println!("{} s", program.duration());
    assert_within_limits(&program);
}

#[test]
fn the_tool_tip_follows_its_path_while_the_tables_rotate() {
    let a = [0.02, 0.0, 0.0, 0.0, 0.0];
    let b = [0.05, 0.01, 0.0, 30.0 * DEGREE, 60.0 * DEGREE];
    let center = [0.05, 0.03];
    let half = arc(b, center, PI, [0.0, 0.0, 0.01, 10.0 * DEGREE, 90.0 * DEGREE]);
    let mut end = [0.0; 5];
    end.copy_from_slice(half.end());
    let moves =
        [line(HOME, a), line(a, b), half, line(end, HOME)].map(|block| Move::new(block, 10.0 * M_MIN));
    let program = plan(Frame::Workpiece, moves.to_vec()).expect("planned");
    println!("{} s", program.duration());
    assert_within_limits(&program);
    // On the arc the tip follows a helix around its center.
    let kinematics = kinematics(&[]);
    let span = program.time_range(2);
    for i in 0..=1000 {
        let t = span.start + (span.end - span.start) * f64::from(i) / 1000.0;
        let tip = kinematics.forward(&psec(&program, t)).tip;
        assert!(((tip.x - center[0]).hypot(tip.y - center[1]) - 0.02).abs() < 1e-14);
    }
    // At least one axis is near its limit, so the motion is near the optimum.
    let used = use_of_limits(&program).concat().into_iter().fold(0.0, f64::max);
    assert!(used > 0.9, "{used}");
}

#[test]
fn a_divided_tip_curve_is_passed_at_speed() {
    // A helix around the axis of C while A and C rotate, divided in two.
    let from = [0.03, 0.0, 0.0, 10.0 * DEGREE, 0.0];
    let middle = arc(from, [0.0, 0.0], PI, [0.0, 0.0, 0.005, 20.0 * DEGREE, 60.0 * DEGREE]);
    let mut at = [0.0; 5];
    at.copy_from_slice(middle.end());
    let rest = arc(at, [0.0, 0.0], PI, [0.0, 0.0, 0.01, 30.0 * DEGREE, 120.0 * DEGREE]);
    let moves = [middle, rest].map(|block| Move::new(block, 2.0 * M_MIN)).to_vec();
    let program = plan(Frame::Workpiece, moves).expect("planned");
    assert_within_limits(&program);
    let border = program.time_range(0).end;
    assert!((speed(&program, border) / (2.0 * M_MIN) - 1.0).abs() < 1e-6, "{}", speed(&program, border));
}

#[test]
fn many_turns_of_the_tip_keep_the_limits() {
    let helix = arc([0.03, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0], 20.0 * TAU, [0.0, 0.0, 0.02, 0.5, 3.0 * TAU]);
    let program = plan(Frame::Workpiece, vec![Move::new(helix, 10.0 * M_MIN)]).expect("planned");
    assert_within_limits(&program);
    println!("{} s", program.duration());
}

#[test]
fn a_change_of_orientation_over_a_fixed_tip_keeps_the_limits_of_all_axes() {
    let from = [0.05, 0.02, 0.0, 0.0, 0.0];
    let to = [0.05, 0.02, 0.0, 60.0 * DEGREE, 90.0 * DEGREE];
    let program = plan(Frame::Workpiece, vec![Move::new(line(from, to), 20.0 * RPM)]).expect("planned");
    assert_within_limits(&program);
    let tip = kinematics(&[]).forward(&psec(&program, 0.0)).tip;
    for i in 0..=1000 {
        let t = program.duration() * f64::from(i) / 1000.0;
        assert!((kinematics(&[]).forward(&psec(&program, t)).tip - tip).norm() < 1e-15);
    }
    // At least one axis is near a limit, so the motion is not much slower than necessary.
    let used = use_of_limits(&program).concat().into_iter().fold(0.0, f64::max);
    assert!(used > 0.9, "{used}");
}

/// Random consecutive blocks.
#[derive(Debug, Clone)]
enum Piece {
    Line([f64; 5]),
    Arc(f64, f64, f64, [f64; 3]),
    Spline(Vec<[f64; 5]>),
    /// Line that continues in the direction of the last block.
    Further(f64),
}

fn step(linear: f64, rotary: f64) -> impl Strategy<Value = [f64; 5]> {
    let (l, r) = (-linear..linear, -rotary..rotary);
    (l.clone(), l.clone(), l, r.clone(), r).prop_map(|(x, y, z, a, c)| [x, y, z, a, c])
}

fn piece(rotary: f64) -> impl Strategy<Value = Piece> {
    prop_oneof![
        step(0.05, rotary).prop_map(Piece::Line),
        (
            0.002..0.05f64,
            0.0..TAU,
            prop_oneof![-7.0..-0.1f64, 0.1..7.0f64],
            prop::array::uniform3(-rotary..rotary)
        )
            .prop_map(|(radius, at, sweep, rest)| Piece::Arc(radius, at, sweep, rest)),
        prop::collection::vec(step(0.03, rotary), 3..7).prop_map(Piece::Spline),
        (0.001..0.05f64).prop_map(Piece::Further),
    ]
}

fn blocks(pieces: &[Piece], tangent: bool) -> Vec<Block> {
    let mut at = HOME;
    let mut direction = [1.0_f64, 0.0, 0.0, 0.0, 0.0];
    let mut blocks = Vec::new();
    for piece in pieces {
        let plus = |at: [f64; 5], step: [f64; 5]| -> [f64; 5] { std::array::from_fn(|i| at[i] + step[i]) };
        let block = match piece {
            Piece::Line(step) => line(at, plus(at, *step)),
            Piece::Arc(radius, angle, sweep, rest) => {
                // Tangent to the last block if that is planar.
                let angle = if tangent {
                    direction[1].atan2(direction[0]) - PI / 2.0 * sweep.signum()
                } else {
                    *angle
                };
                let center = [at[0] - radius * angle.cos(), at[1] - radius * angle.sin()];
                let flat = if tangent { 0.0 } else { 0.02 * rest[0] };
                let to = [0.0, 0.0, at[2] + flat, at[3] + rest[1], at[4] + rest[2]];
                arc(at, center, *sweep, to)
            }
            Piece::Spline(steps) => {
                let mut point = at;
                let mut points = Vec::new();
                for (i, step) in steps.iter().enumerate() {
                    let mut step = *step;
                    if i == 0 && tangent {
                        step = direction.map(|slope| 0.02 * slope);
                    }
                    point = plus(point, step);
                    points.push(point.to_vec());
                }
                match Block::spline(&at, &points, &KINDS) {
                    Ok(block) => block,
                    Err(_) => continue,
                }
            }
            Piece::Further(length) => line(at, plus(at, direction.map(|slope| slope * length))),
        };
        direction.copy_from_slice(&block.derivatives(block.length()).first);
        at.copy_from_slice(block.end());
        blocks.push(block);
    }
    blocks
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn setpoints_of_any_path_keep_the_limits(
        pieces in prop::collection::vec(piece(0.3), 1..6), tangent: bool, workpiece: bool, feed in 0.01..0.6f64,
    ) {
        let frame = if workpiece { Frame::Workpiece } else { Frame::Joints };
        let moves: Vec<Move> = blocks(&pieces, tangent).into_iter().map(|block| Move::new(block, feed)).collect();
        prop_assume!(!moves.is_empty());
        let program = plan(frame, moves).expect("planned");
        assert_within_limits(&program);
    }

    #[test]
    fn setpoints_of_planar_tangent_paths_keep_the_limits(
        pieces in prop::collection::vec(piece(1e-12), 2..8), feed in 0.01..0.6f64,
    ) {
        let moves: Vec<Move> = blocks(&pieces, true).into_iter().map(|block| Move::new(block, feed)).collect();
        prop_assume!(!moves.is_empty());
        let program = plan(Frame::Joints, moves).expect("planned");
        assert_within_limits(&program);
    }
}

#[test]
fn invalid_moves_are_rejected_with_their_number_and_values() {
    let block = || line(HOME, [0.1, 0.0, 0.0, 0.0, 0.0]);
    let good = || Move::new(block(), 0.1);
    let rejected = |order: Move| {
        let first = Move::new(line([-0.1, 0.0, 0.0, 0.0, 0.0], HOME), 0.1);
        let error = plan(Frame::Joints, vec![first, order]).unwrap_err();
        println!("{error}");
        error
    };
    for feed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            matches!(rejected(Move { feed, ..good() }), PlanError::InvalidValue { what, .. } if what.starts_with("move 2: "))
        );
    }
    assert!(
        matches!(rejected(Move { dwell: -1.0, ..good() }), PlanError::InvalidValue { what, .. } if what.starts_with("move 2: "))
    );
    assert!(matches!(
        rejected(Move { corner: Some(f64::NAN), ..good() }),
        PlanError::InvalidValue { what, .. } if what.starts_with("move 2: ")
    ));
    let limits = PathLimits { acceleration: 0.0, jerk: 1.0 };
    assert!(
        matches!(rejected(Move { limits, ..good() }), PlanError::InvalidValue { what, .. } if what.starts_with("move 2: "))
    );
    let profile = FeedProfile::Cosine { ramp: 2.0 };
    assert_eq!(
        rejected(Move { profile, ..good() }),
        PlanError::TooShort { index: 2, length: 0.1, needed: 0.2 }
    );
    let profile = FeedProfile::Cosine { ramp: 0.01 };
    let fast = rejected(Move { profile, feed: 0.6, ..good() });
    assert!(matches!(&fast, PlanError::TooFast { index: 2, joint, .. } if joint == "x"), "{fast}");
    assert!(matches!(plan(Frame::Joints, vec![]), Err(PlanError::Path(_))));
    let few = Program::plan(kinematics(&[]), Frame::Joints, &limits_of(3), PERIOD, 0.0, vec![good()]);
    assert_eq!(few, Err(PlanError::JointCount { found: 3, wanted: 5 }));
    for (period, rest) in [(0, 0.0), (PERIOD, -1.0), (PERIOD, f64::NAN)] {
        let planned =
            Program::plan(kinematics(&[]), Frame::Joints, &limits_of(5), period, rest, vec![good()]);
        assert!(matches!(planned, Err(PlanError::InvalidValue { .. })));
    }
    let mut broken = limits_of(5);
    broken[2].limits.jerk = 0.0;
    let planned = Program::plan(kinematics(&[]), Frame::Joints, &broken, PERIOD, 0.0, vec![good()]);
    assert!(matches!(planned, Err(PlanError::InvalidValue { .. })));
}

fn limits_of(count: usize) -> Vec<virtual_axes_core::trajectory::JointLimits> {
    limits().into_iter().take(count).collect()
}

#[test]
fn extreme_finite_moves_are_planned_or_rejected_quickly() {
    for size in [1e-300, 1e-12, 1e6, 1e150, 1e300] {
        for feed in [1e-300, 0.1, 1e300] {
            let to = [size, size, 0.0, 0.1, 0.0];
            let back = [0.0, size, 0.0, 0.1, 0.3];
            let points: Vec<Vec<f64>> =
                (1..6).map(|i| vec![size * f64::from(i), size, 0.0, 0.0, 1.0]).collect();
            let candidates = [
                Block::line(&HOME, &to, &KINDS),
                Block::line(&HOME, &back, &KINDS),
                Block::spline(&HOME, &points, &KINDS),
                Block::arc(&HOME, [0, 1], [size, 0.0], 1.0, &[0.0, 0.0, 0.0, 1.0, 1.0], &KINDS),
                Block::arc(&HOME, [0, 1], [size, 0.0], 1e9, &HOME, &KINDS),
                Block::arc(&HOME, [0, 1], [0.1, 0.0], size, &HOME, &KINDS),
            ];
            for (i, block) in candidates.into_iter().enumerate() {
                let Ok(block) = block else { continue };
                for frame in [Frame::Joints, Frame::Workpiece] {
                    let planned = plan(frame, vec![Move::new(block.clone(), feed)]);
                    if let Ok(program) = &planned {
                        let end = psec(program, program.duration());
                        assert!(end.iter().all(|value| value.is_finite()), "{size} {feed} {i} {frame:?}");
                        assert!(program.duration().is_finite() && program.duration() > 0.0);
                    }
                }
            }
        }
    }
}

#[test]
fn a_hundred_thousand_blocks_are_planned_in_seconds() {
    let count = 100_000;
    let circle = |i: i32| {
        let angle = f64::from(i) * 1e-4;
        [0.1 * angle.cos(), 0.1 * angle.sin(), 0.0, 0.0, 0.0]
    };
    let zigzag = |i: i32| [f64::from(i) * 1e-3, f64::from(i % 2) * 1e-3, 0.0, 0.0, 0.0];
    for (what, at) in [("tangent", &circle as &dyn Fn(i32) -> [f64; 5]), ("zigzag", &zigzag)] {
        let moves = (0..count).map(|i| Move::new(line(at(i), at(i + 1)), 10.0 * M_MIN)).collect();
        let begun = std::time::Instant::now();
        let program = plan(Frame::Joints, moves).expect("planned");
        println!("{what}: planned in {:?}, runs {} s", begun.elapsed(), program.duration());
        let begun = std::time::Instant::now();
        let mut sum = 0.0;
        for i in 0..100_000 {
            sum += psec(&program, program.duration() * f64::from(i) * 1e-5)[0];
        }
        println!("{what}: {:?} per setpoint ({sum})", begun.elapsed() / 100_000);
    }
}
