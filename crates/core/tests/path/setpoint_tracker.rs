//! Nearest point on the polyline of setpoints compared with a brute-force search.

use crate::path_common::kinematics;
use nalgebra::Vector3;
use proptest::prelude::*;
use virtual_axes_core::assess::{PathDeviations, SetpointTracker};
use virtual_axes_core::kinematics::{Kinematics, Poses, RotaryAngles, ToolPose};

/// Setpoints known beyond the present one.
const PREVIEW: usize = 16;
/// Segments before the last nearest one that are searched.
const LOOK_BACK: usize = 8;
/// Setpoints that are kept.
const MEMORY: usize = 512;
/// Ticks of a position cycle.
const TICKS: usize = 48;

/// Returns the distance of a point from a segment.
fn distance(point: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let step = to - from;
    let length = step.norm();
    if length == 0.0 {
        return (point - from).norm();
    }
    let along = (point - from).dot(&step) / length;
    if along <= 0.0 {
        (point - from).norm()
    } else if along >= length {
        (point - to).norm()
    } else {
        // Distance from the straight line, without the difference of nearly equal squares.
        (point - from).cross(&(step / length)).norm()
    }
}

/// Returns the smallest distance from the segments from `from` on, and the first and last segment with it.
fn brute_force(path: &[ToolPose], from: usize, tip: &Vector3<f64>) -> (f64, [usize; 2]) {
    let distances = path[from..].windows(2).map(|pair| distance(tip, &pair[0].tip, &pair[1].tip));
    let distances: Vec<f64> = distances.collect();
    let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let is_nearest = |distance: &f64| *distance <= least + 1e-12;
    let ends = [distances.iter().position(is_nearest), distances.iter().rposition(is_nearest)];
    (least, ends.map(|index| from + index.expect("a segment")))
}

/// Motion of five axes: setpoints, one per position cycle, and positions at any time, position cycles.
struct Motion {
    setpoints: Vec<[f64; 5]>,
    position: Box<dyn Fn(f64) -> [f64; 5]>,
}

/// Follows a motion cycle by cycle, and compares ticks with brute force over the path from a little before the nearest
/// segment of the tick before on. `whole` also compares with the whole path.
fn compare(motion: &Motion, whole: bool) {
    let kinematics: Kinematics = kinematics(&[]);
    let path: Vec<ToolPose> = motion.setpoints.iter().map(|joints| kinematics.forward(joints)).collect();
    let mut tracker = SetpointTracker::new(path[0]);
    path[1..=PREVIEW].iter().for_each(|pose| tracker.push(*pose, false));
    let (mut angles, mut poses, mut found) =
        (RotaryAngles::default(), Poses::default(), PathDeviations::default());
    // First and last segment that can be the last nearest one.
    let mut nearest = [0, 0];
    for cycle in 0..path.len() - PREVIEW - 1 {
        let newest = cycle + PREVIEW + 1;
        tracker.push(path[newest], false);
        let ticks: Vec<[f64; 5]> =
            (0..TICKS).map(|tick| (motion.position)(cycle as f64 + tick as f64 / TICKS as f64)).collect();
        let columns: Vec<f64> = (0..5).flat_map(|joint| ticks.iter().map(move |row| row[joint])).collect();
        kinematics.forward_batch(&mut angles, &columns, TICKS, &mut poses);
        tracker.follow(&poses, &mut found);
        let from = |segment: usize| {
            segment.max(LOOK_BACK).max((newest + 1).saturating_sub(MEMORY) + LOOK_BACK) - LOOK_BACK
        };
        for tick in 0..TICKS {
            let pose = poses.get(tick);
            let at = format!("cycle {cycle}, tick {tick}: {} m", found.distance[tick]);
            let [(least, first), (largest, last)] =
                nearest.map(|segment| brute_force(&path[..=newest], from(segment), &pose.tip));
            nearest = [first[0].min(last[0]), first[1].max(last[1])];
            let range = least - 1e-12..=largest + 1e-12;
            assert!(range.contains(&found.distance[tick]), "{at}, brute force {least} to {largest} m");
            assert!(found.within_ends[tick] <= found.distance[tick] * (1.0 + 1e-15), "{at}");
            if whole && tick % 8 == 0 {
                let (wanted, _) = brute_force(&path[..=newest], 0, &pose.tip);
                assert!((found.distance[tick] - wanted).abs() <= 1e-12, "{at}, whole path {wanted} m");
            }
        }
        let one = tracker.clone().nearest(&poses.get(TICKS - 1));
        assert!(one.distance <= found.distance[TICKS - 1] + 1e-12, "cycle {cycle}: {}", one.distance);
    }
}

/// Returns the setpoints at a time, position cycles, between its neighbors.
fn interpolated(setpoints: &[[f64; 5]], time: f64) -> [f64; 5] {
    let time = time.clamp(0.0, (setpoints.len() - 1) as f64);
    let k = (time as usize).min(setpoints.len() - 2);
    std::array::from_fn(|joint| {
        setpoints[k][joint] + (time - k as f64) * (setpoints[k + 1][joint] - setpoints[k][joint])
    })
}

/// Returns the motion along setpoints with a lag, position cycles, and an error, m or rad.
fn lagging(setpoints: Vec<[f64; 5]>, lag: f64, error: f64) -> Motion {
    let path = setpoints.clone();
    let position = move |time: f64| {
        let at = interpolated(&path, time - lag);
        std::array::from_fn(|joint| at[joint] + error * (1.7 * time + joint as f64).sin())
    };
    Motion { setpoints, position: Box::new(position) }
}

#[test]
fn a_helix_with_moving_tables_is_followed_over_its_whole_length() {
    let helix = |k: usize| {
        let t = 0.03 * k as f64;
        [0.1 * t.cos(), 0.1 * t.sin(), 2e-3 * t, 0.2 * (0.3 * t).sin(), 0.5 * t]
    };
    // Slow compared with the error, and fast.
    for (stretch, error) in [(1, 2e-5), (1, 3e-4), (7, 2e-5)] {
        compare(&lagging((0..600).map(|k| helix(k * stretch)).collect(), 3.4, error), stretch == 1);
    }
}

#[test]
fn reversals_standstill_and_crossings_are_followed_in_order() {
    let mut setpoints = Vec::new();
    let mut at = [0.0; 5];
    let mut line = |step: [f64; 5], count: usize| {
        for _ in 0..count {
            at = std::array::from_fn(|joint| at[joint] + step[joint]);
            setpoints.push(at);
        }
    };
    line([0.0; 5], 20);
    line([1e-3, 0.0, 0.0, 0.0, 1e-3], 60);
    // Back over the same line, a standstill longer than the memory, and on at a right angle.
    line([-1e-3, 0.0, 0.0, 0.0, 0.0], 30);
    line([0.0; 5], 700);
    line([0.0, 1e-3, 0.0, 2e-3, 0.0], 30);
    // A crossing of the first line.
    line([-1e-3, -1e-3, 0.0, 0.0, 0.0], 60);
    // Back and forth by less than the error.
    for _ in 0..20 {
        line([2e-6, 0.0, 1e-6, 0.0, 0.0], 3);
        line([-2e-6, 0.0, 1e-6, 0.0, 0.0], 3);
    }
    line([0.0, 0.0, 1e-3, 0.0, 0.0], 20);
    line([0.0; 5], 60);
    for (lag, error) in [(0.0, 0.0), (4.3, 1e-5), (12.0, 1e-4), (2.0, 5e-3)] {
        compare(&lagging(setpoints.clone(), lag, error), false);
    }
}

#[test]
fn jumps_of_setpoints_and_positions_are_followed() {
    let step = |k: usize| [0.05 * (k / 40 % 2) as f64, 1e-4 * k as f64, 0.0, 0.0, 0.1 * (k / 55 % 3) as f64];
    let setpoints: Vec<[f64; 5]> = (0..400).map(step).collect();
    let path = setpoints.clone();
    let position = move |time: f64| {
        // Every seventh cycle the position is that of another time, ahead or behind.
        let leap = if time as usize % 7 == 3 { 14.0 * (time * 0.9).sin() } else { 0.0 };
        interpolated(&path, time - 2.0 + leap)
    };
    compare(&Motion { setpoints, position: Box::new(position) }, false);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_walks_are_followed(
        legs in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), -7.0..-2.0f64, 1usize..40, -2e-3..2e-3f64), 3..9),
        lag in 0.0..14.0f64,
        error in -7.0..-3.0f64,
    ) {
        let mut at = [0.0; 5];
        let mut setpoints = vec![at; PREVIEW + 2];
        for (direction, size, count, turn) in legs {
            for _ in 0..count {
                for (value, component) in at.iter_mut().zip(direction) {
                    *value += component * 10f64.powf(size);
                }
                at[3] += turn;
                setpoints.push(at);
            }
        }
        compare(&lagging(setpoints, lag, 10f64.powf(error)), false);
    }
}
