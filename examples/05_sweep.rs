//! Simulates a scenario with many gains at once: the variants are lanes of one machine.
//!
//! ```text
//! cargo run --release --example 05_sweep
//! ```

use std::error::Error;
use std::sync::Arc;

use virtual_axes_core::config::{MachineConfig, Parameters, Value, ValueSource};
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trial::{self, Measures, ProgramSource, SetpointSource, Trial};

/// Returns the RMS contour error at a corner for each gain of the position loop of X, m; gains in (m/min)/mm.
pub fn run(gains: &[f64]) -> Result<Vec<f64>, Box<dyn Error>> {
    let machine = Parameters::embedded_default()?.machine_config()?;
    let variant = |gain: &f64| -> Result<MachineConfig, Box<dyn Error>> {
        let mut parameters = Parameters::embedded_default()?;
        parameters.set("x.position_loop.gain", Value::Double(*gain), &ValueSource::named("example"))?;
        Ok(parameters.machine_config()?)
    };
    let variants: Vec<MachineConfig> = gains.iter().map(variant).collect::<Result<_, _>>()?;
    let program =
        Arc::new(Scenario::load("corner-90", virtual_axes_builtin::SCENARIOS)?.program(&machine, None)?);
    let limits = joint_limits(&machine, "");
    let source = ProgramSource::new(Arc::clone(&program), "corner-90", &limits, machine.periods().position);
    let trial = Trial {
        machine: &machine,
        program: Some(program),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::WITHOUT_CIRCLES,
    };
    // Only X, the axis 0, differs between the variants.
    let setpoints = SetpointSource::Grid(Box::new(source));
    let figures = trial::run_variants(&trial, setpoints, &variants, &[0], || Ok(()))?;
    figures.iter().map(|one| Ok(one.contour.ok_or("the machine has no contour error")?.rms)).collect()
}

/// Prints the contour errors over the gain.
pub fn main() -> Result<(), Box<dyn Error>> {
    let gains: Vec<f64> = (10..=20).map(|tenth| f64::from(tenth) / 10.0).collect();
    for (gain, error) in gains.iter().zip(run(&gains)?) {
        println!("Kp = {gain:.1} (m/min)/mm: RMS contour error {:.2} µm", error * 1e6);
    }
    Ok(())
}
