//! Cycle time against the shortest one that a search over all speed profiles finds (`speed_search`).

use std::f64::consts::TAU;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::PlanOptions;

use crate::limits::{fine_machine, plan_on};
use crate::programs::{Program, blend, five_axis, raster};
use crate::speed_search::{Grid, SampledPath};

/// Longest time that is searched, relative to the planned time.
const SEARCHED: f64 = 1.008;
/// Largest ratio of the planned time to the shortest one.
const LARGEST_RATIO: f64 = 1.02;
/// Shortest chord, m.
const SHORTEST: f64 = 1e-6;

/// Resolution of a search.
struct Resolution {
    /// Number of setpoints per chord; they are 1 ms apart.
    stride: usize,
    grid: Grid,
}

/// Resolution whose result for a line is 0.6 % above the closed form.
const COARSE: Resolution = Resolution { stride: 2, grid: Grid { speeds: 300, accelerations: 90 } };
/// Resolution for paths with features shorter than 0.2 mm, which longer chords pass over.
const FINE: Resolution = Resolution { stride: 1, grid: Grid { speeds: 500, accelerations: 180 } };

/// Plans a program, searches the shortest time along its path, and returns it with the planned time, s.
fn check(name: &str, program: &Program, machine: &MachineConfig, resolution: &Resolution) -> [f64; 2] {
    let outcome = plan_on(machine, program, PlanOptions::default(), |_| 1.0).unwrap();
    outcome.audit.assert_kept();
    let all: Vec<Vec<f64>> = outcome.setpoints.iter().map(|s| s.psec().to_vec()).collect();
    let mut joints: Vec<Vec<f64>> = all.iter().step_by(resolution.stride).cloned().collect();
    joints.extend(all.last().cloned());
    let kinematics = Kinematics::new(machine);
    let tip = |joints: &Vec<f64>| match program.tcp_length {
        Some(_) => kinematics.forward(joints).tip.into(),
        None => [joints[0], joints[1], joints[2]],
    };
    let tips: Vec<[f64; 3]> = joints.iter().map(tip).collect();
    let limits = machine.axes().iter().map(|axis| *axis.limits()).collect();
    let path = SampledPath::new(&joints, &tips, limits, program.feed, SHORTEST);
    let planned = outcome.path_time;
    let shortest = path.shortest_time(resolution.grid, planned * SEARCHED).unwrap_or(f64::NAN);
    println!("{name}: planned {planned:.4} s, search {shortest:.4} s");
    // The search finds a profile that is as fast: otherwise it proves nothing.
    assert!(planned <= shortest * LARGEST_RATIO, "{name}: planned {planned} s, search {shortest} s");
    [shortest, planned]
}

#[test]
fn the_time_of_a_line_is_the_optimum() {
    let machine = fine_machine();
    let mut line = Program::new(0.2, PathControl::ExactStop);
    line.line(0.08, 0.03, 0.01);
    let [shortest, _] = check("line", &line, &machine, &COARSE);
    // Ramps with constant jerk, acceleration and jerk: the limits are those of X.
    let length = (0.08_f64.powi(2) + 0.03_f64.powi(2) + 0.01_f64.powi(2)).sqrt();
    let limits = machine.axes()[0].limits();
    let [acceleration, jerk] = [limits.acceleration, limits.jerk].map(|limit| limit * length / 0.08);
    let exact = length / 0.2 + 0.2 / acceleration + acceleration / jerk;
    assert!((shortest / exact - 1.0).abs() < 0.007, "{shortest} {exact}");
}

#[test]
fn the_time_of_a_helix_is_near_the_optimum() {
    let mut circle = Program::new(0.2, PathControl::ExactPath);
    circle.arc([0.02, 0.0], TAU, 0.01);
    check("helix", &circle, &fine_machine(), &COARSE);
}

#[test]
fn the_time_of_blended_corners_is_near_the_optimum() {
    let mut square = Program::new(0.1, blend(100e-6));
    square.line(0.03, 0.0, 0.0).line(0.03, 0.03, 0.0).line(0.0, 0.03, 0.0);
    check("square", &square, &fine_machine(), &COARSE);
}

#[test]
fn the_time_of_a_raster_is_near_the_optimum() {
    check("raster", &raster(2, 0.03, 50e-6, 1e-6, 0.1, 10e-6), &fine_machine(), &FINE);
}

#[test]
fn the_time_of_a_five_axis_path_is_near_the_optimum() {
    let machine = fine_machine();
    check("five axes", &five_axis(machine.kinematics().tool_length), &machine, &COARSE);
}
