//! Prints the seconds that the simulation of a five-axis motion of 4 s takes, the mean over runs.
//!
//! ```text
//! cargo run --release --example time_simulation -- [RUNS]
//! ```
//!
//! `tools/measure_python.py` compares the Python module with it: the same setpoints, figures and signals.

use std::env;
use std::error::Error;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use virtual_axes_core::config::Parameters;
use virtual_axes_core::trial::{self, GridRows, Measures, SetpointSource, Trial};

/// Position cycles of the motion: 4 s at 6 ms.
const CYCLES: u32 = 667;
/// Half of the way of each axis, m or rad.
const AMPLITUDES: [f64; 5] = [0.02, 0.02, 0.02, 0.05, 0.1];

fn main() -> Result<(), Box<dyn Error>> {
    let runs: u32 = env::args().nth(1).as_deref().unwrap_or("50").parse()?;
    let machine = Parameters::embedded_default()?.machine_config()?;
    let row = |cycle: u32| {
        let angle = TAU * f64::from(cycle) / f64::from(CYCLES);
        AMPLITUDES.map(|amplitude| amplitude * (1.0 - angle.cos()))
    };
    let rows: Vec<f64> = (0..=CYCLES).flat_map(row).collect();
    let began = Instant::now();
    for _ in 0..runs {
        let trial = Trial {
            machine: &machine,
            program: None,
            allow_nonzero_end_velocity: false,
            record: false,
            measures: Measures::AXES,
        };
        let source = SetpointSource::Grid(Box::new(GridRows::new(&[0, 1, 2, 3, 4], &rows)));
        let mut signals: [Vec<f64>; 3] = Default::default();
        let outcome = trial::run(&trial, source, |tick| {
            for axis in tick.machine.axes() {
                let sample = axis.sample();
                let values = [sample.position, sample.velocity, sample.current];
                signals.iter_mut().zip(values).for_each(|(signal, value)| signal.push(value));
            }
            Ok(())
        })?;
        black_box((outcome, signals));
    }
    println!("{:.9}", began.elapsed().as_secs_f64() / f64::from(runs));
    Ok(())
}
