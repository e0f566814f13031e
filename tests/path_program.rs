//! Time laws of paths against closed forms, and their promise to keep the limits.

mod common;
mod path_common;

use std::f64::consts::{PI, TAU};

use common::{Ballbar, M_MIN, Profile};
use path_common::*;
use proptest::prelude::*;
use virtual_axes::path::{Block, Frame, Law, Move, PathLimits, PlanError, Program};
use virtual_axes::units::{DEGREE, RPM};

const HOME: [f64; 5] = [0.0; 5];

/// Set-points at instants against `wanted`, m or rad.
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
fn a_line_of_200_mm_is_the_textbook_profile_of_seven_phases() {
    let profile = Profile::new(0.2, 10.0 * M_MIN, 2.5, 50.0);
    let block = line(HOME, [0.2, 0.0, 0.0, 0.0, 0.0]);
    let program = plan(Frame::Joints, vec![Move::new(block, 10.0 * M_MIN)]).expect("planned");
    assert!((program.duration() - profile.duration()).abs() < 1e-14);
    assert_joint(&program, 0, 1e-12, |t| profile.at(t));
    assert_joint(&program, 1, 0.0, |_| 0.0);
}

#[test]
fn a_rotation_counts_in_radians() {
    let profile = Profile::new(90.0 * DEGREE, 10.0 * RPM, 0.83 * TAU, 50.0 * TAU);
    let block = line(HOME, [0.0, 0.0, 0.0, 0.0, 90.0 * DEGREE]);
    let program = plan(Frame::Joints, vec![Move::new(block, 10.0 * RPM)]).expect("planned");
    assert_joint(&program, 4, 1e-12, |t| profile.at(t));
}

#[test]
fn legs_with_an_exact_stop_follow_each_other_without_a_pause_off_the_grid() {
    let leg = Profile::new(0.05, 10.0 * M_MIN, 2.5, 50.0);
    for turn in [90.0 * DEGREE, 45.0 * DEGREE] {
        let corner = [0.05, 0.0, 0.0, 0.0, 0.0];
        let end = [0.05 + 0.05 * turn.cos(), 0.05 * turn.sin(), 0.0, 0.0, 0.0];
        // Along a diagonal two axes would allow more than one; the trial does not.
        let limits = PathLimits { acceleration: 2.5, jerk: 50.0 };
        let moves = [line(HOME, corner), line(corner, end)]
            .map(|block| Move { limits, ..Move::new(block, 10.0 * M_MIN) });
        let program = plan(Frame::Joints, moves.to_vec()).expect("planned");
        assert_eq!(program.span(0).end, program.span(1).start);
        assert!((program.duration() - 2.0 * leg.duration()).abs() < 1e-14);
        let second = |t: f64| leg.at(t - leg.duration());
        assert_joint(&program, 0, 1e-12, |t| leg.at(t) + turn.cos() * second(t));
        assert_joint(&program, 1, 1e-12, |t| turn.sin() * second(t));
        assert_within_limits(&program);
    }
}

#[test]
fn the_ballbar_is_the_one_of_the_trial() {
    let trial = Ballbar::paper();
    let circle = arc(HOME, [-0.15, 0.0], 0.0 + 2.0 * TAU + trial.velocity * Ballbar::RAMP / 0.15, HOME);
    let law = Law::Cosine { ramp: Ballbar::RAMP };
    let moves = vec![Move { law, dwell: Ballbar::REST, ..Move::new(circle, trial.velocity) }];
    let program = Program::plan(kinematics(&[]), Frame::Joints, &limits(), PERIOD, Ballbar::REST, moves)
        .expect("planned");
    assert!((program.duration() - trial.duration()).abs() < 1e-12);
    for joint in 0..5 {
        assert_joint(&program, joint, 1e-12, |t| trial.psec(t)[joint]);
    }
}

#[test]
fn two_speeds_on_one_line_meet_at_the_slower_one_at_the_border() {
    let (border, end) = (130.0 * DEGREE, 210.0 * DEGREE);
    let [a, b] = [border, end].map(|c| [0.0, 0.0, 0.0, 0.0, c]);
    let moves = vec![Move::new(line(HOME, a), 18.0 * RPM), Move::new(line(a, b), 6.0 * RPM)];
    let program = plan(Frame::Joints, moves).expect("planned");
    let at = program.span(0).end;
    assert_eq!(psec(&program, at)[4], border);
    let h = 1e-5;
    let speed = |t: f64| (psec(&program, t + h)[4] - psec(&program, t - h)[4]) / (2.0 * h);
    assert!((speed(at) / (6.0 * RPM) - 1.0).abs() < 1e-6, "{}", speed(at) / RPM);
    assert!((speed(at / 2.0) / (18.0 * RPM) - 1.0).abs() < 1e-9);
    // Ramp down from 18 to 6 rpm before the border, none behind it but that to rest.
    let (acceleration, jerk) = (0.83 * TAU, 50.0 * TAU);
    let ramp = |gain: f64| gain * RPM / acceleration + acceleration / jerk;
    let first = 130.0 * DEGREE - 9.0 * RPM * ramp(18.0) - 12.0 * RPM * ramp(12.0);
    let second = 80.0 * DEGREE - 3.0 * RPM * ramp(6.0);
    let wanted = ramp(18.0) + first / (18.0 * RPM) + ramp(12.0) + second / (6.0 * RPM) + ramp(6.0);
    assert!((program.duration() - wanted).abs() < 1e-12, "{} {wanted}", program.duration());
    assert_within_limits(&program);
}

/// Two lines of 60 mm joined by half-circles of 15 mm.
fn contour_b(turned: f64) -> Vec<Move> {
    let (s, c) = turned.sin_cos();
    let at = |x: f64, y: f64| [c * x - s * y, s * x + c * y, 0.0, 0.0, 0.0];
    let centre = |x: f64, y: f64| [at(x, y)[0], at(x, y)[1]];
    let corners = [at(0.0, 0.0), at(0.06, 0.0), at(0.06, 0.03), at(0.0, 0.03)];
    let first = line(corners[0], corners[1]);
    let half = arc(corners[1], centre(0.06, 0.015), PI, corners[2]);
    let back = Block::line(half.end(), &corners[3], &KINDS).expect("a line");
    let last = Block::arc(back.end(), [0, 1], centre(0.0, 0.015), PI, &HOME, &KINDS).expect("an arc");
    [first, half, back, last].map(|block| Move::new(block, 10.0 * M_MIN)).to_vec()
}

#[test]
fn a_jump_of_curvature_is_passed_at_the_speed_whose_acceleration_is_jerk_times_period() {
    let program = plan(Frame::Joints, contour_b(0.0)).expect("planned");
    // Y has 3.0 m/s² and 50 m/s³: v² / R = Jmax Tsp.
    let wanted = (50.0 * TSP * 0.015_f64).sqrt();
    for block in 0..3 {
        let at = program.span(block).end;
        let h = 1e-6;
        let speed = (program.progress(at + h) - program.progress(at - h)) / (2.0 * h);
        assert!((speed / wanted - 1.0).abs() < 1e-5, "end of block {block}: {speed}, wanted {wanted}");
    }
    assert_within_limits(&program);
}

#[test]
fn contours_with_jumps_of_curvature_keep_the_limits_whatever_their_direction() {
    for degrees in [15.0, 30.0, 45.0, 60.0, 200.0] {
        let program = plan(Frame::Joints, contour_b(degrees * DEGREE)).expect("planned");
        println!("{degrees}°: {} s", program.duration());
        assert_within_limits(&program);
    }
}
