//! Simulates setpoints of a CSV text: `time` in s, then joints in m or rad.
//!
//! ```text
//! cargo run --release --example 01_simulate_csv [-- FILE]
//! ```

use std::error::Error;
use std::fs;

use virtual_axes_core::config::Parameters;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trial::{self, GridRows, Measures, SetpointSource, Trial};
use virtual_axes_io::files::PsecCsvReader;

/// A move of X by 10 mm and back. Between the rows, setpoints are interpolated.
const CSV: &str = "time,x\n0,0\n0.1,0.0\n0.6,0.01\n1.1,0.0\n1.2,0.0\n";

/// Returns the largest following error of X, m.
pub fn run(csv: &str) -> Result<f64, Box<dyn Error>> {
    let machine = Parameters::embedded_default()?.machine_config()?;
    let limits = joint_limits(&machine, "");
    let mut reader = PsecCsvReader::new(csv.as_bytes(), "setpoints", machine.periods().position, &limits)?;
    let joints = reader.joints().to_vec();
    let (mut row, mut rows) = (vec![0.0; joints.len()], Vec::new());
    while reader.next(&mut row)? {
        rows.extend_from_slice(&row);
    }
    let source = SetpointSource::Grid(Box::new(GridRows::new(&joints, &rows)));
    let trial = Trial {
        machine: &machine,
        program: None,
        allow_nonzero_end_velocity: true,
        record: false,
        measures: Measures::AXES,
    };
    let outcome = trial::run(&trial, source, |tick| {
        let sample = tick.machine.axis(0).sample();
        println!("{:.6} m, {:.6} m, {:.3} A", sample.psec, sample.position, sample.current);
        Ok(())
    })?;
    Ok(outcome.figures.axes[0].report.max_following_error)
}

/// Prints setpoint, position and current of X at each position cycle.
pub fn main() -> Result<(), Box<dyn Error>> {
    let csv = std::env::args().nth(1).map_or_else(|| Ok(CSV.to_owned()), fs::read_to_string)?;
    println!("largest following error: {:.3} mm", run(&csv)? * 1e3);
    Ok(())
}
