//! Feed planning of a raster of micro-segments: motions per minute of computing time, and peak memory.
//!
//! ```text
//! cargo run --release -p virtual_axes_nc --example plan_raster -- 150000
//! ```

use std::error::Error;
use std::time::Instant;

use virtual_axes_core::config::Parameters;
use virtual_axes_nc::motion::{
    Blend, Coordinates, Feed, MotionKind, PathControl, ProgramMotion, ProgramStep,
};
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};

/// Length of a row, m, and distance of the points, m.
const ROW: f64 = 0.06;
const SEGMENT: f64 = 20e-6;
/// Distance of the rows, m.
const PITCH: f64 = 0.2e-3;
/// Resolution of the coordinates, m.
const RESOLUTION: f64 = 1e-6;

fn rounded(value: f64) -> f64 {
    (value / RESOLUTION).round() * RESOLUTION
}

/// Returns point `index` of the raster on a wavy surface; rows alternate in direction.
fn point(index: usize) -> Coordinates {
    let per_row = (ROW / SEGMENT) as usize + 1;
    let (row, column) = (index / per_row, index % per_row);
    let column = if row % 2 == 0 { column } else { per_row - 1 - column };
    // Two strips of rows, back and forth, so that the raster stays within the travel limits.
    let y = PITCH * (500.0 - (row as f64 % 1000.0 - 500.0).abs());
    let x = SEGMENT * column as f64;
    let z = 2e-3 * (x / 8e-3).sin() * (y / 5e-3).cos();
    [rounded(x), rounded(y), rounded(z), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// Returns the peak of resident memory, MB, or `None` where the system does not tell it.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}

fn main() -> Result<(), Box<dyn Error>> {
    let count: usize = std::env::args().nth(1).map_or(Ok(150_000), |count| count.parse())?;
    let machine = Parameters::embedded_default()?.machine_config()?;
    let blend = Blend { tolerance: Some(10e-6), rotary_tolerance: None, merge_tolerance: None };
    let steps = (1..=count).map(|line| {
        Ok::<_, std::io::Error>(ProgramStep::Motion(ProgramMotion {
            line,
            kind: MotionKind::Line,
            start: point(line - 1),
            end: point(line),
            feed: Feed::Linear(0.1),
            path_control: PathControl::Blend(blend),
            tcp_length: None,
        }))
    });
    let started = Instant::now();
    let mut planner = PartProgramPlanner::new(steps, &machine, PlanOptions::default())?;
    let mut cycles = 0_u64;
    while planner.next_setpoint(1.0)?.is_some() {
        cycles += 1;
    }
    let elapsed = started.elapsed().as_secs_f64();
    println!("{count} motions, {cycles} position cycles, program time {:.2} s", planner.path_time());
    println!("computed in {elapsed:.2} s: {:.1} million motions per minute", 60e-6 * count as f64 / elapsed);
    if let Some(memory) = peak_memory() {
        println!("peak memory {memory:.1} MB");
    }
    Ok(())
}
