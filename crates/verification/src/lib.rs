//! Verification of the library: stress test with random trajectories, production traces, and fixtures shared by the tests
//! of all crates.
//!
//! - [`stress`] runs random trajectories and checks limits, friction, energy balance and following errors at every tick.
//! - [`production_traces`] generates recordings of hidden axes in production.
//! - [`random`] has the random numbers of both, bit-identical on every processor.
//! - [`fixtures`] contains test machines, recordings, tuning problems and temporary folders.
//!
//! The crate is a development dependency only and is not published.
//!
//! # Example
//! ```
//! use virtual_axes_core::config::Parameters;
//! use virtual_axes_core::machine::SimdWidth;
//! use virtual_axes_verification::stress::{TestMachines, TrajectoryTest};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
//! // Trajectory 12 of seed 7 on the default machine with each kind of controller.
//! let machines = TestMachines::new(&[Parameters::embedded_default()?])?;
//! let mut test = TrajectoryTest::new(&machines, 7, SimdWidth::Widest);
//! let record = test.run(12)?;
//! assert!(record.violations.is_empty(), "{:?}", record.violations);
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod fixtures;
pub mod production_traces;
pub mod random;
pub mod stress;

use std::fmt::Display;
use std::process::ExitCode;

/// Prints the text of a developer's program, or its error; returns the exit status, 2 after an error.
pub fn print_result(result: Result<String, impl Display>) -> ExitCode {
    match result {
        Ok(text) => print!("{text}"),
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}
