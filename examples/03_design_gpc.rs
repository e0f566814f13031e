//! Designs predictive controllers for X and prints their stability margins.
//!
//! ```text
//! cargo run --release --example 03_design_gpc
//! ```

use std::error::Error;

use virtual_axes_core::config::Parameters;
use virtual_axes_core::design::{ControlWeight, GpcTuning, Margins, gpc, margins};
use virtual_axes_core::machine::prediction_model;

/// Returns the margins of the design with the prediction horizon N2 and the relative weight λ of the control increments.
pub fn run(n2: usize, lambda_rel: f64) -> Result<Margins, Box<dyn Error>> {
    let machine = Parameters::embedded_default()?.machine_config()?;
    let axis = machine.axes().iter().find(|axis| axis.name() == "x").ok_or("no axis x")?;
    let model = prediction_model(axis, &machine.periods())?;
    let tuning = GpcTuning { n1: 1, n2, nu: 1, weight: ControlWeight::Relative(lambda_rel) };
    let rst = gpc(&model, &tuning)?;
    Ok(margins(&model, &rst)?)
}

/// Prints the margins over the prediction horizon.
pub fn main() -> Result<(), Box<dyn Error>> {
    for n2 in [8, 12, 16, 20] {
        let found = run(n2, 0.1)?;
        println!("N2 = {n2}: modulus margin {:.3}, delay margin {:.2} ms", found.modulus, found.delay * 1e3);
    }
    Ok(())
}
