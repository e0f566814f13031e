//! Deviations of whole position cycles on lines and circles compared with the search for single poses.

use std::f64::consts::TAU;
use std::sync::Arc;

use crate::path_common::*;
use virtual_axes_core::assess::{PathDeviations, PathTracker};
use virtual_axes_core::kinematics::{Poses, TableAngles};
use virtual_axes_core::path::{Block, Frame, Path};

const TICKS: usize = 48;
const RADIUS: f64 = 0.15;
/// Length of the line, m.
const LENGTH: f64 = 0.4;
/// Motion of a position cycle on the way to the place of interest, m.
const FEED: f64 = 0.01;

/// Returns X and Y, m, at progress `u` with a deviation to the left, also beyond the ends.
type Position = fn(u: f64, deviation: f64) -> [f64; 2];

fn on_line(u: f64, deviation: f64) -> [f64; 2] {
    [u, deviation]
}

fn on_circle(u: f64, deviation: f64) -> [f64; 2] {
    let (sine, cosine) = (u / RADIUS).sin_cos();
    [(RADIUS - deviation) * cosine - RADIUS, (RADIUS - deviation) * sine]
}

/// Follows a path up to `target`, then `motion` about it, a function of the time in position cycles, and compares each tick
/// with the search for single poses.
///
/// Returns the share of the cycles of `motion` in closed form.
fn follow(block: Block, position: Position, target: f64, motion: &dyn Fn(f64) -> f64) -> f64 {
    let kinematics = kinematics(&[]);
    let path = Arc::new(Path::new(kinematics.clone(), Frame::Workpiece, vec![block]).expect("a path"));
    let mut at_once = PathTracker::new(path);
    let mut single = at_once.clone();
    let (mut angles, mut poses, mut found) =
        (TableAngles::default(), Poses::default(), PathDeviations::default());
    let approach = (target / FEED).ceil() as usize;
    let progress = |time: f64| {
        let after = time - approach as f64;
        target + if after < 0.0 { FEED * after } else { motion(after) }
    };
    let (cycles, mut closed_forms, mut furthest) = (300, 0, 0.0_f64);
    for cycle in 0..approach + cycles {
        let mut joints = vec![0.0; 5 * TICKS];
        let mut until = [0.0; TICKS];
        for tick in 0..TICKS {
            let time = cycle as f64 + tick as f64 / TICKS as f64;
            furthest = furthest.max(progress(time));
            until[tick] = furthest + 6e-3;
            let [x, y] = position(progress(time), 2e-6 * (0.7 * time).sin());
            (joints[tick], joints[TICKS + tick]) = (x, y);
        }
        kinematics.forward_batch(&mut angles, &joints, TICKS, &mut poses);
        let followed = at_once.follow(&poses, |tick| until[tick], &mut found).expect("poses");
        closed_forms += usize::from(cycle >= approach && followed.closed_form);
        for (tick, until) in until.into_iter().enumerate() {
            let wanted = single.nearest(&poses.get(tick), until);
            let found = [found.distance[tick], found.within_ends[tick], found.orientation[tick]];
            let wanted_deviations = [wanted.distance, wanted.within_ends, wanted.orientation];
            assert!(
                found.map(f64::to_bits) == wanted_deviations.map(f64::to_bits),
                "cycle {cycle}, tick {tick}, progress {}: {found:?} instead of {wanted_deviations:?}",
                wanted.progress
            );
        }
    }
    closed_forms as f64 / cycles as f64
}

/// Creates a circle of some turns.
fn circle(turns: f64) -> Block {
    arc([0.0; 5], [-RADIUS, 0.0], turns * TAU, [0.0; 5])
}

/// Creates the line.
fn straight() -> Block {
    line([0.0; 5], [LENGTH, 0.0, 0.0, 0.0, 0.0])
}

#[test]
fn forward_and_backward_motions_are_evaluated_in_closed_form() {
    let motions: [(&str, &dyn Fn(f64) -> f64); 4] = [
        ("forward", &|time| 2e-4 * time),
        ("back and forth", &|time| 1.5e-3 * (0.3 * time).sin()),
        ("vibration within cycles", &|time| 1e-7 * (9.0 * time).sin()),
        ("backward creep", &|time| -1e-9 * (1.0 - (-0.02 * time).exp())),
    ];
    for (name, motion) in motions {
        for turns in [1.0, 20.0] {
            let share = follow(circle(turns), on_circle, (turns - 0.4) * TAU * RADIUS, motion);
            assert!(share >= 0.9, "{name} on {turns} turns: {share}");
        }
        let share = follow(straight(), on_line, 0.2, motion);
        assert!(share >= 0.9, "{name} on the line: {share}");
    }
}

#[test]
fn settling_at_the_end_is_evaluated_in_closed_form() {
    // Overshoot, or creep before the end, that decays from 20 µm to 10⁻¹¹ m.
    for (name, sign) in [("overshoot", 1.0), ("creep", -1.0)] {
        let motion = |time: f64| sign * 2e-5 * (-time / 20.6).exp();
        for turns in [1.0, 20.0] {
            let share = follow(circle(turns), on_circle, turns * TAU * RADIUS, &motion);
            assert!(share >= 0.9, "{name} on {turns} turns: {share}");
        }
        let share = follow(straight(), on_line, LENGTH, &motion);
        assert!(share >= 0.9, "{name} on the line: {share}");
    }
}
