//! Nearest point of a path compared with closed forms and with brute force.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use crate::path_common::*;
use nalgebra::Vector3;
use proptest::prelude::*;
use virtual_axes_core::assess::{NearestPoint, PathDeviations, PathTracker};
use virtual_axes_core::kinematics::{Poses, RotaryAngles, ToolPose};
use virtual_axes_core::path::{Block, Frame, Path};
use virtual_axes_core::units::DEGREE;

const HOME: [f64; 5] = [0.0; 5];

fn path(frame: Frame, blocks: Vec<Block>) -> Arc<Path> {
    Arc::new(Path::new(kinematics(&[]), frame, blocks).expect("continuous"))
}

fn spline(from: [f64; 5], points: &[[f64; 5]]) -> Block {
    let points: Vec<Vec<f64>> = points.iter().map(|point| point.to_vec()).collect();
    Block::spline(&from, &points, &KINDS).expect("a spline")
}

#[test]
fn distance_from_a_circle_is_the_radial_deviation() {
    let radius = 0.15;
    for (frame, offset) in [(Frame::Joints, 0.1), (Frame::Workpiece, 0.0)] {
        let mut tracker = PathTracker::new(path(frame, vec![arc(HOME, [-radius, 0.0], 2.0 * TAU, HOME)]));
        let length = 2.0 * TAU * radius;
        for i in 0..4000 {
            let u = length * f64::from(i) / 4000.0;
            let (deviation, lag) = (60e-6 * (0.01 * f64::from(i)).sin(), 0.08);
            let angle = (u - 0.01).max(0.0) / radius;
            let r = radius + deviation;
            let tip = Vector3::new(r * angle.cos() - radius, r * angle.sin(), -offset);
            let nearest = tracker.nearest(&ToolPose { tip, axis: Vector3::z() }, u + lag);
            // Deviation of the rounded point.
            let wanted = ((tip.x + radius).hypot(tip.y) - radius).abs();
            assert!((nearest.distance - wanted).abs() <= 1e-14, "{} {wanted}", nearest.distance);
            assert!((nearest.progress - angle * radius).abs() < 1e-12, "in order over both turns");
            assert_eq!(nearest.orientation, 0.0);
        }
    }
}

#[test]
fn a_forward_and_backward_line_is_followed_in_order() {
    let end = [0.1, 0.0, 0.0, 0.0, 0.0];
    let path = path(Frame::Joints, vec![line(HOME, end), line(end, HOME)]);
    let mut tracker = PathTracker::new(Arc::clone(&path));
    let lag = 0.012;
    let mut before = 0.0;
    for i in 0..=20_000 {
        let u = 0.2 * f64::from(i) / 20_000.0;
        let late = (u - lag).max(0.0);
        let mut pose = path.tool(late);
        pose.tip.y = 1e-5;
        let nearest = tracker.nearest(&pose, u);
        assert!(nearest.progress >= before, "{} after {before}", nearest.progress);
        // Both lines are equally close around the turning point, within the order tolerance.
        assert!((nearest.progress - late).abs() < 3e-5, "{} at {late}", nearest.progress);
        assert!((nearest.distance - 1e-5).abs() < 1e-15);
        before = nearest.progress;
    }
}

#[test]
fn a_cut_corner_passes_from_one_leg_to_the_next() {
    let corner = [0.05, 0.0, 0.0, 0.0, 0.0];
    let end = [0.05, 0.05, 0.0, 0.0, 0.0];
    let path = path(Frame::Joints, vec![line(HOME, corner), line(corner, end)]);
    let mut tracker = PathTracker::new(Arc::clone(&path));
    // A quarter circle of 1 mm inside the corner, farthest from the path in its middle.
    let (r, start) = (1e-3, 0.049);
    let mut largest = 0.0_f64;
    for i in 0..=1000 {
        let angle = PI / 2.0 * f64::from(i) / 1000.0;
        let tip = Vector3::new(start + r * angle.sin(), r * (1.0 - angle.cos()), -0.1);
        let nearest = tracker.nearest(&ToolPose { tip, axis: Vector3::z() }, 0.06);
        let wanted = tip.y.min(0.05 - tip.x);
        assert!((nearest.distance - wanted).abs() < 1e-15);
        largest = largest.max(nearest.distance);
    }
    assert!((largest - r * (1.0 - (PI / 4.0).cos())).abs() < 1e-9);
}

#[test]
fn overshoot_beyond_the_ends_is_reported_separately() {
    let end = [0.03, 0.04, 0.0, 0.0, 0.0];
    let path = path(Frame::Joints, vec![line(HOME, end)]);
    let mut tracker = PathTracker::new(Arc::clone(&path));
    let along = Vector3::new(0.6, 0.8, 0.0);
    let across = Vector3::new(-0.8, 0.6, 0.0);
    let start = path.tool(0.0).tip;
    let mut at = |s: f64, off: f64| {
        let tip = start + along * s + across * off;
        tracker.nearest(&ToolPose { tip, axis: Vector3::z() }, 0.05)
    };
    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-15, "{found}, wanted {wanted}");
    let before = at(-3e-4, 4e-4);
    near(before.distance, 5e-4);
    near(before.within_ends, 4e-4);
    let inside = at(0.02, 4e-4);
    near(inside.distance, 4e-4);
    near(inside.within_ends, 4e-4);
    let beyond = at(0.0503, 4e-4);
    near(beyond.distance, 5e-4);
    near(beyond.within_ends, 4e-4);
    assert_eq!(beyond.progress, path.length());
}

#[test]
fn orientation_determines_the_progress_while_the_tip_is_fixed() {
    // A and C rotate with the tip fixed in the workpiece frame, between two lines.
    let a = [0.02, 0.0, 0.0, 0.0, 0.0];
    let b = [0.02, 0.0, 0.0, 40.0 * DEGREE, 30.0 * DEGREE];
    let c = [0.02, 0.03, 0.0, 40.0 * DEGREE, 30.0 * DEGREE];
    let path = path(Frame::Workpiece, vec![line(HOME, a), line(a, b), line(b, c)]);
    let mut tracker = PathTracker::new(Arc::clone(&path));
    let lag = 0.01;
    let mut wobble = 0;
    let count = 5000;
    for i in 0..=count {
        let u = path.length() * f64::from(i) / f64::from(count);
        let late = (u - lag).max(0.0);
        let mut pose = path.tool(late);
        wobble += 1;
        let error = Vector3::new(3e-6, -2e-6, 1e-6) * (f64::from(wobble) * 0.1).sin();
        pose.tip += error;
        let nearest = tracker.nearest(&pose, u);
        assert!((nearest.progress - late).abs() < 1e-5, "{} at {late}", nearest.progress);
        assert!(nearest.distance <= error.norm() + 1e-15);
        assert!(nearest.orientation < 1e-4, "{}", nearest.orientation);
    }
}

/// Follows `path` with a lag and an error of `amplitude`, and passes tip, result and window to `observe`.
fn follow(path: &Arc<Path>, amplitude: f64, mut observe: impl FnMut(&ToolPose, NearestPoint, f64, f64)) {
    let mut tracker = PathTracker::new(Arc::clone(path));
    let count = 600;
    for i in 0..=count {
        let u = path.length() * f64::from(i) / f64::from(count);
        let late = (u - 0.012).max(0.0);
        let mut pose = path.tool(late);
        let phase = 0.37 * f64::from(i);
        pose.tip += Vector3::new(phase.sin(), (1.3 * phase).cos(), (0.7 * phase).sin()) * amplitude;
        let nearest = tracker.nearest(&pose, u);
        observe(&pose, nearest, late, u);
    }
}

#[track_caller]
fn assert_nearest(path: &Arc<Path>, amplitude: f64, tolerance: f64) {
    let mut i = 0;
    follow(path, amplitude, |pose, nearest, late, u| {
        i += 1;
        if i % 37 != 0 {
            return;
        }
        let wanted = brute_force(path, (late - 0.004).max(0.0), u, &pose.tip);
        assert!(
            (nearest.distance - wanted).abs() < tolerance,
            "at {late}: {} instead of {wanted}",
            nearest.distance
        );
        let direct = (path.tool(nearest.progress).tip - pose.tip).norm();
        assert!((direct - nearest.distance).abs() < 1e-12, "point and progress agree");
    });
}

#[test]
fn nearest_point_on_a_spline_matches_brute_force() {
    let points =
        [[0.02, 0.03, 0.0], [0.05, -0.01, 0.01], [0.08, 0.04, -0.01], [0.1, 0.0, 0.02], [0.12, 0.02, 0.0]];
    let points = points.map(|[x, y, z]| [x, y, z, 0.0, 0.0]);
    for frame in [Frame::Joints, Frame::Workpiece] {
        let path = path(frame, vec![spline(HOME, &points)]);
        assert_nearest(&path, 2e-5, 1e-11);
        assert_nearest(&path, 5e-4, 1e-11);
    }
}

#[test]
fn nearest_point_with_five_axes_matches_brute_force() {
    let points = [
        [0.02, 0.03, 0.0, 0.1, 0.0],
        [0.05, -0.01, 0.01, 0.3, 0.5],
        [0.08, 0.04, -0.01, 0.4, 1.0],
        [0.12, 0.02, 0.0, 0.2, 1.2],
    ];
    let far = [0.2, 0.05, 0.03, 0.5, 0.0];
    for frame in [Frame::Joints, Frame::Workpiece] {
        let first = spline(HOME, &points);
        let second = line(points[3], far);
        let third = arc(far, [0.17, 0.05], 2.0, [0.0, 0.0, 0.03, 0.1, -0.5]);
        let path = path(frame, vec![first, second, third]);
        assert_nearest(&path, 2e-5, 1e-11);
    }
}

#[test]
fn an_arc_of_the_joints_over_a_turned_table_is_a_circle_of_the_tip() {
    let from = [0.03, 0.0, 0.0, 0.5, 0.7];
    let path = path(Frame::Joints, vec![arc(from, [0.0, 0.0], -4.0, from)]);
    assert_nearest(&path, 5e-4, 1e-13);
}

#[test]
fn a_hundred_thousand_blocks_cost_no_more_per_call_than_a_few() {
    let count = 100_000;
    let at = |i: i32| {
        let t = f64::from(i) * 1e-4;
        [0.1 * t.cos(), 0.1 * t.sin(), 1e-3 * t, 0.0, 0.0]
    };
    let blocks = (0..count).map(|i| line(at(i), at(i + 1))).collect();
    let path = path(Frame::Joints, blocks);
    follow_quickly(&path, "100 000 lines");
}

fn follow_quickly(path: &Arc<Path>, what: &str) {
    let mut tracker = PathTracker::new(Arc::clone(path));
    let calls = 400_000;
    // 15 m/min at 8 kHz.
    let step = 0.25 * 125e-6;
    let poses: Vec<(ToolPose, f64)> = (0..calls)
        .map(|i| {
            let u = f64::from(i) * step;
            let mut pose = path.tool((u - 0.012).max(0.0));
            pose.tip.x += 1e-5;
            (pose, u)
        })
        .collect();
    let start = std::time::Instant::now();
    let mut sum = 0.0;
    for (pose, u) in &poses {
        sum += tracker.nearest(pose, *u).distance;
    }
    println!("{what}: {:.0} ns per call", start.elapsed().as_secs_f64() / f64::from(calls) * 1e9);
    assert!(sum / f64::from(calls) < 1.0e-5 + 1e-9, "{}", sum / f64::from(calls));
}

#[test]
fn cost_of_a_call() {
    let circle = arc(HOME, [-0.15, 0.0], 20.0 * TAU, HOME);
    follow_quickly(&path(Frame::Joints, vec![circle]), "circle");
    follow_quickly(&path(Frame::Joints, vec![line(HOME, [20.0, 0.0, 0.0, 0.0, 0.0])]), "line");
    let points: Vec<[f64; 5]> =
        (1..200).map(|i| [0.1 * f64::from(i), 0.05 * f64::from(i % 3), 0.0, 0.0, 0.0]).collect();
    follow_quickly(&path(Frame::Joints, vec![spline(HOME, &points)]), "spline");
    let turning: Vec<[f64; 5]> = points.iter().map(|p| [p[0], p[1], 0.0, 0.1 * p[1], p[0]]).collect();
    follow_quickly(&path(Frame::Workpiece, vec![spline(HOME, &turning)]), "spline of five axes");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_polylines_are_tracked(points in prop::collection::vec((-0.05..0.05f64, -0.05..0.05f64, -0.05..0.05f64), 2..6)) {
        let mut at = HOME;
        let mut blocks = Vec::new();
        for (x, y, z) in points {
            let to = [at[0] + x, at[1] + y, at[2] + z, 0.0, 0.0];
            blocks.push(line(at, to));
            at = to;
        }
        let path = path(Frame::Joints, blocks);
        follow(&path, 1e-5, |pose, nearest, late, u| {
            if u * 1e4 % 23.0 > 1.0 {
                return;
            }
            let wanted = brute_force(&path, (late - 0.004).max(0.0), u, &pose.tip);
            assert!(nearest.distance <= wanted + 1e-12, "{} {wanted}", nearest.distance);
            assert!(nearest.progress <= u + 1e-15);
        });
    }
}

#[test]
fn nan_and_huge_inputs_are_tolerated() {
    let end = [0.1, 0.0, 0.0, 0.0, 0.0];
    let mut tracker = PathTracker::new(path(Frame::Joints, vec![line(HOME, end)]));
    let nan = Vector3::new(f64::NAN, 0.0, 0.0);
    assert!(tracker.nearest(&ToolPose { tip: nan, axis: nan }, 0.05).distance.is_nan());
    let tip = Vector3::new(0.05, 1e-5, -0.1);
    let nearest = tracker.nearest(&ToolPose { tip, axis: Vector3::z() }, f64::NAN);
    assert!(nearest.distance.is_finite());
    let nearest = tracker.nearest(&ToolPose { tip, axis: Vector3::z() }, 1e300);
    assert!((nearest.distance - 1e-5).abs() < 1e-15);
}

/// Follows a path of five axes cycle by cycle; `progress_of` returns the progress of the tip at a time, position
/// cycles. Compares each tick with the search for one pose, and some with brute force.
fn follow_cycles(path: &Arc<Path>, cycles: usize, error: f64, progress_of: impl Fn(f64) -> f64) {
    const TICKS: usize = 48;
    let kinematics = kinematics(&[]);
    let mut tracker = PathTracker::new(Arc::clone(path));
    let mut single = tracker.clone();
    let (mut angles, mut poses, mut found) =
        (RotaryAngles::default(), Poses::default(), PathDeviations::default());
    let mut joints = vec![0.0; 5];
    let mut furthest = 0.0_f64;
    for cycle in 0..cycles {
        let mut columns = vec![0.0; 5 * TICKS];
        for tick in 0..TICKS {
            let time = cycle as f64 + tick as f64 / TICKS as f64;
            path.joints(progress_of(time).clamp(0.0, path.length()), &mut joints);
            for (joint, value) in joints.iter().enumerate() {
                columns[joint * TICKS + tick] = value + error * (0.9 * time + joint as f64).sin();
            }
        }
        kinematics.forward_batch(&mut angles, &columns, TICKS, &mut poses);
        let until = |tick: usize| {
            (0..=cycle * TICKS + tick)
                .step_by(TICKS / 2)
                .fold(0.0, |most, tick| f64::max(most, progress_of(tick as f64 / TICKS as f64)))
                + 0.015
        };
        let untils: Vec<f64> = (0..TICKS).map(until).collect();
        tracker.follow(&poses, |tick| untils[tick], &mut found);
        for (tick, &until) in untils.iter().enumerate() {
            let pose = poses.get(tick);
            let one = single.nearest(&pose, until);
            let at = format!("cycle {cycle}, tick {tick}: {} m at {} m", one.distance, one.progress);
            assert!((found.distance[tick] - one.distance).abs() <= 1e-12, "{at}: {}", found.distance[tick]);
            assert!((found.within_ends[tick] - one.within_ends).abs() <= 1e-12, "{at}");
            assert!((found.orientation[tick] - one.orientation).abs() <= 1e-11, "{at}");
            furthest = furthest.max(one.progress);
            if (cycle * TICKS + tick).is_multiple_of(211) {
                let wanted =
                    brute_force(path, (furthest - 5e-3).max(0.0), until.min(path.length()), &pose.tip);
                assert!((found.distance[tick] - wanted).abs() <= 1e-12, "{at}: {wanted}");
            }
        }
    }
}

/// Two splines of five axes joined by a corner; the first one bends by its own width.
fn curved_path(frame: Frame) -> Arc<Path> {
    let points = [
        [0.02, 0.03, 0.0, 0.1, 0.0],
        [0.05, -0.01, 0.01, 0.3, 0.5],
        [0.052, 0.03, 0.01, 0.35, 0.7],
        [0.054, -0.01, 0.01, 0.4, 0.9],
        [0.12, 0.02, 0.0, 0.2, 1.2],
    ];
    let more = [
        [0.13, 0.05, 0.0, 0.2, 1.0],
        [0.1, 0.08, 0.01, 0.3, 0.8],
        [0.05, 0.09, 0.0, 0.1, 0.4],
        [0.0, 0.1, 0.0, 0.0, 0.0],
    ];
    path(frame, vec![spline(HOME, &points), spline(points[4], &more)])
}

#[test]
fn cycles_along_splines_of_five_axes_match_brute_force() {
    for frame in [Frame::Workpiece, Frame::Joints] {
        let path = curved_path(frame);
        for (feed, error) in [(5e-4, 2e-6), (5e-4, 3e-5), (1e-4, 0.0), (3e-3, 1e-4)] {
            let cycles = ((path.length() + 0.02) / feed) as usize;
            follow_cycles(&path, cycles.min(600), error, |time| feed * time - 0.004);
        }
    }
}

#[test]
fn reversals_standstill_and_jumps_on_a_spline_match_brute_force() {
    let path = curved_path(Frame::Workpiece);
    // Back and forth by 2 mm while advancing, with a standstill and jumps by 3 mm.
    let progress = |time: f64| {
        let time = if (40.0..60.0).contains(&time) { 40.0 } else { time };
        let jump = if time as usize % 17 == 9 { -3e-3 } else { 0.0 };
        3e-4 * time + 2e-3 * (0.2 * time).sin() + jump
    };
    follow_cycles(&path, 400, 1e-5, progress);
    follow_cycles(&path, 400, 4e-4, progress);
}
