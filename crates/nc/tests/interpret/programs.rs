//! Programs in config/programs: extents, lengths and travel on the machine that they are meant for.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_nc::interpret::InterpreterOptions;
use virtual_axes_nc::motion::{Coordinates, Feed, MotionKind, ProgramMotion};

use crate::common::motions;

/// Rounding of coordinates with four decimals, m.
const ROUNDING: f64 = 0.5e-7;

fn machine() -> MachineConfig {
    Parameters::embedded_default().and_then(|parameters| parameters.machine_config()).expect("a machine")
}

fn program(name: &str) -> Vec<ProgramMotion> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/programs").join(name);
    let text = std::fs::read_to_string(path).expect("a program");
    motions(&text, InterpreterOptions::for_machine(&machine()))
}

/// Returns the position at a fraction of a motion.
fn at(motion: &ProgramMotion, fraction: f64) -> Coordinates {
    let mut position: Coordinates =
        std::array::from_fn(|axis| motion.start[axis] + fraction * (motion.end[axis] - motion.start[axis]));
    if let MotionKind::Arc(arc) = &motion.kind {
        let [first, second, _] = arc.plane.axes();
        let [x, y] = [motion.start[first] - arc.center[0], motion.start[second] - arc.center[1]];
        let (sin, cos) = (arc.sweep * fraction).sin_cos();
        position[first] = arc.center[0] + x * cos - y * sin;
        position[second] = arc.center[1] + x * sin + y * cos;
    }
    position
}

/// Returns the length along X, Y and Z, m.
fn length(motion: &ProgramMotion) -> f64 {
    let moved = |axis: usize| motion.end[axis] - motion.start[axis];
    match &motion.kind {
        MotionKind::Arc(arc) => {
            let [first, second, normal] = arc.plane.axes();
            let radius = (motion.start[first] - arc.center[0]).hypot(motion.start[second] - arc.center[1]);
            (radius * arc.sweep).hypot(moved(normal))
        }
        _ => moved(0).hypot(moved(1)).hypot(moved(2)),
    }
}

/// Returns the length at a feed in mm/min, m.
fn length_at(motions: &[ProgramMotion], feed: f64) -> f64 {
    let is_feed = |found: Feed| matches!(found, Feed::Linear(found) if (found * 60e3 - feed).abs() < 1e-9);
    motions.iter().filter(|motion| is_feed(motion.feed)).map(length).sum()
}

#[test]
fn programs_stay_within_the_travel_of_the_machine() {
    let machine = machine();
    let kinematics = Kinematics::new(&machine);
    for name in ["circle-diamond-square.nc", "finishing-raster.nc", "pocket.nc", "s-path-five-axis.nc"] {
        for motion in program(name) {
            for step in 0..=8 {
                let position = at(&motion, f64::from(step) / 8.0);
                let mut joints = [position[0], position[1], position[2], position[3], position[5]];
                if let Some(length) = motion.tcp_length {
                    assert!((length - machine.kinematics().tool_length).abs() < 1e-12);
                    kinematics.tip_to_joints(&mut joints);
                }
                for (axis, value) in machine.axes().iter().zip(joints) {
                    let limits = axis.limits();
                    let is_inside = (limits.travel_min..=limits.travel_max).contains(&value);
                    assert!(is_inside, "{name}:{}: {} at {value}", motion.line, axis.name());
                }
            }
        }
    }
}

#[test]
fn the_outlines_have_the_length_of_circle_diamond_and_squares() {
    let side = 170.0;
    let circle = TAU * 54.0 + 2.0 * FRAC_PI_2 * 16.0;
    let expected =
        circle + 2.0 * 20.0 + 4.0 * 76.3675 * 2_f64.sqrt() + 2.0 * 20.0 + 4.0 * 160.0 + 20.0 + 4.0 * side;
    let found = length_at(&program("circle-diamond-square.nc"), 3000.0) * 1e3;
    assert!((found - expected).abs() < 1e-9, "{found} mm, expected {expected} mm");
}

#[test]
fn the_pocket_has_its_size_and_depth() {
    let motions = program("pocket.nc");
    let cutting: Vec<_> = motions.iter().filter(|motion| motion.feed != Feed::Rapid).collect();
    let extent = |axis: usize, fold: fn(f64, f64) -> f64, from: f64| {
        let values =
            cutting.iter().flat_map(|motion| (0..=64).map(|step| at(motion, f64::from(step) / 64.0)[axis]));
        values.fold(from, fold) * 1e3
    };
    // Zero of Z is 100 mm above that of the tip, by the tool length.
    for (axis, lowest, highest) in [(0, -35.0, 35.0), (1, -20.0, 20.0), (2, -6.0 + 100.0, 1.0 + 100.0)] {
        let found = [extent(axis, f64::min, f64::INFINITY), extent(axis, f64::max, f64::NEG_INFINITY)];
        assert!(
            (found[0] - lowest).abs() < 1e-9 && (found[1] - highest).abs() < 1e-9,
            "axis {axis}: {found:?} mm"
        );
    }
    let turns = motions
        .iter()
        .filter(|motion| matches!(&motion.kind, MotionKind::Arc(arc) if arc.sweep.abs() > 6.0 * PI - 1e-9));
    assert_eq!(turns.count(), 3, "one helix of three turns for each level");
    // Three levels of five rings: straight sides, and four corners with a radius of 3 mm.
    let rings: f64 = (1..=5)
        .map(|ring| f64::from(ring) * 4.0)
        .map(|half| 4.0 * (2.0 * half + 15.0) - 24.0 + 6.0 * PI)
        .sum();
    // From the helix to the first ring, between rings, off the wall, along full circles, and back in the air.
    let found = length_at(&motions, 1800.0) * 1e3;
    assert!(found > 3.0 * rings && found < 3.0 * (rings + 60.0), "{found} mm, rings {rings} mm");
}

#[test]
fn the_s_path_follows_its_arcs_with_the_tool_inclined_to_the_left() {
    let motions = program("s-path-five-axis.nc");
    let path: Vec<_> =
        motions.iter().filter(|motion| motion.tcp_length.is_some() && motion.end[2] == 0.0).skip(1).collect();
    assert!(path.len() > 500, "{}", path.len());
    let workpiece = machine().kinematics().workpiece;
    let kinematics = Kinematics::new(&machine());
    let mut total = 0.0;
    for motion in &path {
        total += length(motion);
        let [x, y] = [motion.end[0] - workpiece[0], motion.end[1] - workpiece[1]];
        let distance = |center: f64| (x.hypot(y - center) - 0.030).abs();
        assert!(distance(0.030).min(distance(-0.030)) < 2.0 * ROUNDING, "line {}: {x}, {y}", motion.line);
        // The tool leans to the left of the path, by 5 to 25 degrees.
        let tool = kinematics.forward(&[0.0, 0.0, 0.0, motion.end[3], motion.end[5]]).axis;
        let along = [motion.end[0] - motion.start[0], motion.end[1] - motion.start[1]];
        let left = [-along[1] / length(motion), along[0] / length(motion)];
        let (sin, turn) = (tool.x * left[0] + tool.y * left[1], tool.x * left[1] - tool.y * left[0]);
        assert!(
            (4.9_f64.to_radians().sin()..=25.1_f64.to_radians().sin()).contains(&sin),
            "{}: {sin}",
            motion.line
        );
        // The line is a chord of 0.5 mm: its direction is half a degree before that of its end.
        assert!((turn / sin).abs() < 0.01, "{}: {turn}", motion.line);
        let turned = (motion.end[5] - motion.start[5]).abs().to_degrees();
        assert!(turned < 1.0, "C moves {turned} degrees in line {}", motion.line);
    }
    let expected = 0.030 * 3.0 * PI;
    assert!((total - expected).abs() < 1e-5, "{total} m, expected {expected} m");
}

#[test]
fn the_raster_consists_of_short_lines_on_its_surface() {
    let motions = program("finishing-raster.nc");
    let lines: Vec<_> =
        motions.iter().filter(|motion| matches!(motion.kind, MotionKind::Line)).skip(2).collect();
    assert!(lines.len() > 12_000, "{}", lines.len());
    for motion in &lines {
        let length = length(motion) * 1e6;
        assert!((2.8..=50.2).contains(&length), "line {}: {length} µm", motion.line);
        let [x, y, z] = [motion.end[0] * 1e3, motion.end[1] * 1e3, (motion.end[2] - 0.1) * 1e3];
        let surface = 0.8 * (TAU * x / 20.0).sin() * (TAU * y / 26.0).cos();
        assert!((z - surface).abs() < 1.2e-4, "line {}: {z} mm, surface {surface} mm", motion.line);
    }
}
