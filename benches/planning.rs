//! Time of interpretation and planning of part programs over their length and over their feed.
//!
//!     cargo bench --no-default-features --bench planning
//!
//! A row shows the least CPU times of several rounds, and the exponent of a power law through the times of a
//! program: 1 for times in proportion to the length, 0 for times that do not depend on the feed.

use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Cursor;
use std::time::Instant;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};
use virtual_axes_verification::fixtures::machines::parameters;

/// Rounds of each measurement.
const ROUNDS: usize = 3;
/// Sizes of the programs of the table over the length, MB.
const SIZES: [f64; 3] = [0.25, 1.0, 4.0];
/// Feeds of the table over the feed, mm/min.
const FEEDS: [f64; 4] = [20.0, 80.0, 320.0, 1280.0];
/// Position cycles in a chunk of planned motion.
const CHUNK: u32 = 1000;

/// Returns the points of a surface of a part, 0.4 mm apart, at most `size` bytes.
fn surface(header: &str, size: f64, has_rotary: bool) -> String {
    let mut text = format!("G21 G90\n{header}\nG0 X-40 Y-40 Z30\nG1 F4000\n");
    let mut i = 0;
    while (text.len() as f64) < 1e6 * size {
        let (row, column) = (i / 200, i % 200);
        let column = if row % 2 == 0 { column } else { 199 - column };
        let (x, y) = (-40.0 + 0.4 * f64::from(column), -40.0 + (0.4 * f64::from(row)) % 80.0);
        let z = 5.0 * (x / 15.0).sin() * (y / 20.0).cos();
        _ = write!(text, "X{x:.3} Y{y:.3} Z{z:.3}");
        if has_rotary {
            let (a, c) = (-10.0 + 8.0 * (x / 20.0).sin(), 20.0 * (y / 25.0 + x / 60.0).sin());
            _ = write!(text, " A{a:.3} C{c:.3}");
        }
        text.push('\n');
        i += 1;
    }
    text + "G0 Z50\nM30\n"
}

/// Returns a drilling cycle of 100 holes at `feed`.
fn holes(feed: f64) -> String {
    let mut text = format!("G21 G90\nG0 X0 Y0 Z5\nG81 Z-8 R2 F{feed}\n");
    for i in 1..100 {
        _ = writeln!(text, "X{} Y{}", i % 10 * 5, i / 10 * 5);
    }
    text + "G80\nM30\n"
}

/// Returns a contour of 2000 short lines at `feed`.
fn contour(header: &str, feed: f64) -> String {
    let mut text = format!("G21 G90\n{header}\nG1 X0 Y0 F{feed}\n");
    for i in 0..2000 {
        let angle = f64::from(i) * 0.01;
        _ = writeln!(text, "X{:.4} Y{:.4}", 20.0 * angle.sin(), 20.0 - 20.0 * angle.cos());
    }
    text + "M30\n"
}

/// Returns the CPU time of this thread, s, to a few milliseconds; the time of the clock where the system does not tell it.
fn cpu_time(began: Instant) -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
    nanoseconds.map_or_else(|| began.elapsed().as_secs_f64(), |nanoseconds| 1e-9 * nanoseconds)
}

/// Returns the least times of interpretation, and of interpretation and planning, s, with the duration of the program, s.
fn measure(text: &str, machine: &MachineConfig) -> [f64; 3] {
    let interpreter = || {
        Interpreter::new(Cursor::new(text.as_bytes()), "bench.nc", InterpreterOptions::for_machine(machine))
    };
    let start = Instant::now();
    let (mut interpreted, mut planned, mut duration) = (f64::INFINITY, f64::INFINITY, 0.0);
    for _ in 0..ROUNDS {
        let began = cpu_time(start);
        for step in interpreter() {
            black_box(step.expect("a valid program"));
        }
        interpreted = interpreted.min(cpu_time(start) - began);
        let began = cpu_time(start);
        let mut planner =
            PartProgramPlanner::new(interpreter(), machine, PlanOptions::default()).expect("options");
        while let Some(chunk) = planner.next_chunk(CHUNK).expect("a valid program") {
            black_box(chunk);
        }
        planned = planned.min(cpu_time(start) - began);
        duration = planner.path_time();
    }
    [interpreted, planned, duration]
}

/// Returns the exponent of the power law through the points, by least squares of the logarithms.
fn exponent(points: &[[f64; 2]]) -> f64 {
    let logs: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let mean = |k: usize| logs.iter().map(|point| point[k]).sum::<f64>() / logs.len() as f64;
    let [x, y] = [mean(0), mean(1)];
    let sum = |of: &dyn Fn(&[f64; 2]) -> f64| logs.iter().map(of).sum::<f64>();
    sum(&|p| (p[0] - x) * (p[1] - y)) / sum(&|p| (p[0] - x).powi(2))
}

/// Measures the programs of a table and prints its rows.
fn table(column: &str, values: &[f64], programs: &[(&str, &dyn Fn(f64) -> String)], machine: &MachineConfig) {
    println!("\n| program | {column} | machining, s | interpretation, s | with planning, s | exponent |");
    println!("|---|---|---|---|---|---|");
    for (name, program) in programs {
        let mut points = Vec::new();
        for (i, value) in values.iter().enumerate() {
            let [interpreted, planned, duration] = measure(&program(*value), machine);
            points.push([*value, planned]);
            let is_last = i + 1 == values.len();
            let fitted = if is_last { format!("{:.2}", exponent(&points)) } else { String::new() };
            println!("| {name} | {value} | {duration:.0} | {interpreted:.3} | {planned:.3} | {fitted} |");
        }
    }
}

fn main() {
    let machine = parameters::<&str>(&[]).machine_config().expect("a machine");
    let over_length: [(&str, &dyn Fn(f64) -> String); 4] = [
        ("three axes", &|size| surface("", size, false)),
        ("three axes, G61", &|size| surface("G61", size, false)),
        ("A and C", &|size| surface("", size, true)),
        ("A and C, tool center point", &|size| surface("G43.4 H1", size, true)),
    ];
    table("MB", &SIZES, &over_length, &machine);
    let over_feed: [(&str, &dyn Fn(f64) -> String); 3] = [
        ("100 holes", &holes),
        ("contour of 2000 lines", &|feed| contour("", feed)),
        ("contour of 2000 lines, G61", &|feed| contour("G61", feed)),
    ];
    table("mm/min", &FEEDS, &over_feed, &machine);
}
