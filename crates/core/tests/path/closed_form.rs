//! Deviations of whole position cycles on lines and circles compared with brute force.

use std::f64::consts::TAU;
use std::sync::Arc;

use crate::path_common::*;
use proptest::prelude::*;
use virtual_axes_core::assess::{PathDeviations, PathTracker};
use virtual_axes_core::kinematics::{Poses, RotaryAngles};
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

/// Tracker of a path that is compared with brute force.
struct ComparedTracker {
    path: Arc<Path>,
    tracker: PathTracker,
    angles: RotaryAngles,
    poses: Poses,
    found: PathDeviations,
}

impl ComparedTracker {
    fn new(path: Path) -> Self {
        let path = Arc::new(path);
        let tracker = PathTracker::new(Arc::clone(&path));
        let (angles, poses, found) = (RotaryAngles::default(), Poses::default(), PathDeviations::default());
        ComparedTracker { path, tracker, angles, poses, found }
    }

    /// Follows a position cycle: `joints` contains the values of the first axis at all ticks, then those of the next one,
    /// and `until` the progress commanded at each tick. Compares the tick `compared` with brute force: over the range at
    /// the end of the cycle, and over the smaller one of a single pose. An error describes another distance.
    fn follow(&mut self, joints: &[f64], until: &[f64], compared: usize) -> Result<(), String> {
        let last = until.len() - 1;
        self.path.kinematics().forward_batch(&mut self.angles, joints, until.len(), &mut self.poses);
        let before = self.tracker.furthest();
        self.tracker.follow(&self.poses, |tick| until[tick], &mut self.found).expect("poses");
        let after = self.tracker.furthest();
        let found = self.found.distance[compared];
        let within = |furthest: f64, until: f64| {
            let low = (furthest - 5e-3).max(0.0);
            let high = until.clamp(0.0, self.path.length());
            brute_force(&self.path, low, high.max(low), &self.poses.tip(compared))
        };
        let least = within(before, until[last].max(after));
        let largest = within(after, until[compared].max(before));
        let is_within = (least - 1e-12..=largest + 1e-12).contains(&found);
        is_within.then_some(()).ok_or_else(|| {
            format!("tick {compared}, progress {after}: {found} instead of {least} to {largest}")
        })
    }
}

/// Follows a path up to `target`, then `motion` about it, a function of the time in position cycles, and compares it with
/// brute force.
fn follow(block: Block, position: Position, target: f64, motion: &dyn Fn(f64) -> f64) {
    let mut tracker =
        ComparedTracker::new(Path::new(kinematics(&[]), Frame::Joints, vec![block]).expect("a path"));
    let length = tracker.path.length();
    let approach = (target / FEED).ceil() as usize;
    let progress = |time: f64| {
        let after = time - approach as f64;
        target + if after < 0.0 { FEED * after } else { motion(after) }
    };
    let mut furthest = 0.0_f64;
    for cycle in 0..approach + 300 {
        let mut joints = vec![0.0; 5 * TICKS];
        let mut until = [0.0; TICKS];
        let deviation = |time: f64| 2e-6 * (0.7 * time).sin();
        for tick in 0..TICKS {
            let time = cycle as f64 + tick as f64 / TICKS as f64;
            furthest = furthest.max(progress(time));
            until[tick] = furthest + 6e-3;
            let [x, y] = position(progress(time), deviation(time));
            (joints[tick], joints[TICKS + tick]) = (x, y);
        }
        tracker.follow(&joints, &until, 7 * cycle % TICKS).unwrap_or_else(|error| panic!("{error}"));
        // In closed form.
        for tick in 0..TICKS {
            let time = cycle as f64 + tick as f64 / TICKS as f64;
            if (0.0..length).contains(&progress(time)) {
                let wanted = deviation(time).abs();
                assert!((tracker.found.distance[tick] - wanted).abs() <= 1e-13, "cycle {cycle}, tick {tick}");
                assert!(
                    (tracker.found.within_ends[tick] - wanted).abs() <= 1e-12,
                    "cycle {cycle}, tick {tick}"
                );
                assert_eq!(tracker.found.orientation[tick], 0.0);
            }
        }
    }
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
fn forward_and_backward_motions_have_the_deviations_of_closed_forms() {
    let motions: [&dyn Fn(f64) -> f64; 4] = [
        &|time| 2e-4 * time,
        &|time| 1.5e-3 * (0.3 * time).sin(),
        &|time| 1e-7 * (9.0 * time).sin(),
        &|time| -1e-9 * (1.0 - (-0.02 * time).exp()),
    ];
    for motion in motions {
        for turns in [1.0, 20.0] {
            follow(circle(turns), on_circle, (turns - 0.4) * TAU * RADIUS, motion);
        }
        follow(straight(), on_line, 0.2, motion);
    }
}

#[test]
fn settling_at_the_end_has_the_deviations_of_closed_forms() {
    // Overshoot, or creep before the end, that decays from 20 µm to 10⁻¹¹ m.
    for sign in [1.0, -1.0] {
        let motion = |time: f64| sign * 2e-5 * (-time / 20.6).exp();
        for turns in [1.0, 20.0] {
            follow(circle(turns), on_circle, turns * TAU * RADIUS, &motion);
        }
        follow(straight(), on_line, LENGTH, &motion);
    }
}

/// Shape of a random block that begins at the end of the block before.
#[derive(Debug, Clone, Copy)]
enum Shape {
    /// Line: direction, rad, and length, m.
    Line(f64, f64),
    /// Arc: radius, m, direction of the center, rad, and angle, rad, negative clockwise.
    Arc(f64, f64, f64),
}

/// Motion of the axes during a random position cycle.
#[derive(Debug, Clone)]
struct Cycle {
    ticks: usize,
    /// Change of progress in the cycle, m.
    step: f64,
    /// Amplitude, m, of a half wave within the cycle.
    swing: f64,
    /// Jump of progress after a part of the cycle, m.
    jump: Option<(f64, f64)>,
    /// Progress commanded beyond that of the axes, m.
    ahead: f64,
    /// Deviation of X, Y and Z, m.
    deviation: [f64; 3],
}

/// Returns a strategy of numbers with either sign whose magnitude is between powers of ten.
fn signed(exponents: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    (exponents, prop::sample::select(vec![-1.0, 1.0]))
        .prop_map(|(exponent, sign)| sign * 10f64.powf(exponent))
}

fn shapes() -> impl Strategy<Value = Vec<Shape>> {
    let line = (-3.2..3.2, 0.001..0.3).prop_map(|(direction, length)| Shape::Line(direction, length));
    let radius = (-2.5..-0.5).prop_map(|exponent| 10f64.powf(exponent));
    let turns = prop::sample::select(vec![-2.0 * TAU, -TAU, TAU, 3.0 * TAU]);
    let angle = prop_oneof![turns, signed(-1.0..1.2)];
    let arc = (radius, -3.2..3.2, angle).prop_map(|(radius, at, angle)| Shape::Arc(radius, at, angle));
    prop::collection::vec(prop_oneof![1 => line, 2 => arc], 1..4)
}

fn cycles() -> impl Strategy<Value = Vec<Cycle>> {
    let step = prop_oneof![3 => (0.0..2e-3).boxed(), 2 => signed(-13.0..-3.0).boxed()];
    let swing = prop_oneof![2 => Just(0.0).boxed(), 1 => signed(-12.0..-1.7).boxed()];
    let jump = prop::option::weighted(0.1, (0.0..1.0, signed(-6.0..-0.5)));
    let ahead = prop_oneof![2 => Just(6e-3).boxed(), 1 => Just(-1e-3).boxed(), 1 => (0.0..0.5).boxed()];
    let deviation = [signed(-12.0..-3.0), signed(-12.0..-3.0), signed(-12.0..-5.0)];
    let cycle = (1_usize..60, step, swing, jump, ahead, deviation).prop_map(
        |(ticks, step, swing, jump, ahead, deviation)| Cycle { ticks, step, swing, jump, ahead, deviation },
    );
    prop::collection::vec(cycle, 1..60)
}

/// Returns the blocks of a path, one after the other from home.
fn blocks(shapes: &[Shape]) -> Vec<Block> {
    let mut at = [0.0; 5];
    let block = |shape: &Shape| match *shape {
        Shape::Line(direction, length) => {
            let (sine, cosine) = direction.sin_cos();
            let from = at;
            (at[0], at[1]) = (from[0] + length * cosine, from[1] + length * sine);
            line(from, at)
        }
        Shape::Arc(radius, direction, angle) => {
            let (sine, cosine) = direction.sin_cos();
            let (from, center) = (at, [at[0] + radius * cosine, at[1] + radius * sine]);
            let (sine, cosine) = (direction + angle).sin_cos();
            (at[0], at[1]) = (center[0] - radius * cosine, center[1] - radius * sine);
            arc(from, center, angle, at)
        }
    };
    shapes.iter().map(block).collect()
}

/// Returns the joints at progress `u`, straight on beyond the ends.
fn joints_at(path: &Path, u: f64) -> [f64; 5] {
    let (length, step) = (path.length(), 1e-5);
    let (mut joints, mut inside) = ([0.0; 5], [0.0; 5]);
    let end = u.clamp(0.0, length);
    path.joints(end, &mut joints);
    if u != end {
        path.joints((end + if u > end { -step } else { step }).clamp(0.0, length), &mut inside);
        for (joint, inside) in joints.iter_mut().zip(inside) {
            *joint += (*joint - inside) / step * (u - end).abs();
        }
    }
    joints
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_motions_match_brute_force(
        shapes in shapes(), cycles in cycles(), begin in 0.0..1.0_f64, is_in_joints: bool
    ) {
        let frame = if is_in_joints { Frame::Joints } else { Frame::Workpiece };
        let path = Path::new(kinematics(&[]), frame, blocks(&shapes)).expect("a path");
        let length = path.length();
        let mut tracker = ComparedTracker::new(path.clone());
        let mut progress = begin * length;
        let mut commanded = progress;
        for cycle in cycles {
            let mut joints = vec![0.0; 5 * cycle.ticks];
            let mut until = vec![0.0; cycle.ticks];
            for (tick, until) in until.iter_mut().enumerate() {
                let part = tick as f64 / cycle.ticks as f64;
                let jump = cycle.jump.map_or(0.0, |(from, jump)| if part >= from { jump } else { 0.0 });
                let u = progress + cycle.step * part + cycle.swing * (0.5 * TAU * part).sin() + jump;
                commanded = commanded.max(u + cycle.ahead);
                *until = commanded;
                let mut row = joints_at(&path, u.clamp(-0.01, length + 0.01));
                row.iter_mut().zip(cycle.deviation).for_each(|(joint, deviation)| *joint += deviation);
                row.iter().enumerate().for_each(|(axis, value)| joints[axis * cycle.ticks + tick] = *value);
            }
            progress = (progress + cycle.step).clamp(-1e-3, length + 1e-3);
            let compared = (cycle.ticks - 1) * 5 / 7;
            let followed = tracker.follow(&joints, &until, compared);
            prop_assert!(followed.is_ok(), "{followed:?}");
        }
    }
}
