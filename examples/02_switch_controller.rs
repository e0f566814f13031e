//! Compares two position controllers on a scenario.
//!
//! ```text
//! cargo run --release --example 02_switch_controller
//! ```

use std::error::Error;
use std::sync::Arc;

use virtual_axes_core::config::{Parameters, Value, ValueSource};
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trial::{self, Measures, ProgramSource, SetpointSource, Trial};

/// Returns the largest contour error on the ballbar with a controller, m.
pub fn run(controller: &str) -> Result<f64, Box<dyn Error>> {
    let mut parameters = Parameters::embedded_default()?;
    for axis in ["x", "y", "z", "a", "c"] {
        let key = format!("{axis}.position_loop.controller");
        parameters.set(&key, Value::Text(controller.to_owned()), &ValueSource::named("example"))?;
    }
    let machine = parameters.machine_config()?;
    let program =
        Arc::new(Scenario::load("ballbar", virtual_axes_builtin::SCENARIOS)?.program(&machine, None)?);
    let limits = joint_limits(&machine, "");
    let source = ProgramSource::new(Arc::clone(&program), "ballbar", &limits, machine.periods().position);
    let trial = Trial {
        machine: &machine,
        program: Some(program),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::WITHOUT_CIRCLES,
    };
    let outcome = trial::run(&trial, SetpointSource::Grid(Box::new(source)), |_| Ok(()))?;
    Ok(outcome.figures.contour.ok_or("the machine has no contour error")?.max)
}

/// Prints the contour errors of both controllers.
pub fn main() -> Result<(), Box<dyn Error>> {
    for controller in ["cascade", "gpc"] {
        println!("{controller}: contour error {:.1} µm", run(controller)? * 1e6);
    }
    Ok(())
}
