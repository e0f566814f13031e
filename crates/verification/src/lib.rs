//! Verification of the library: stress test with random trajectories, production traces, and fixtures shared by the tests
//! of all crates.
//!
//! - [`stress`] runs random trajectories and checks limits, friction, energy balance and following errors at every tick.
//! - [`production_traces`] generates recordings of hidden axes in production.
//! - [`presliding_study`] identifies the presliding of random axes.
//! - [`transmission_study`] identifies the transmission of random axes.
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
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Trajectory 12 of seed 7 on the default machine with each kind of controller.
//! let machines = TestMachines::new(&[Parameters::embedded_default()?])?;
//! let mut test = TrajectoryTest::new(&machines, 7, SimdWidth::Widest);
//! let record = test.run(12)?;
//! assert!(record.violations.is_empty(), "{:?}", record.violations);
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

use std::ops::Range;

pub mod fixtures;
pub mod presliding_study;
pub mod production_traces;
pub mod stress;
pub mod transmission_study;

/// Parses the seeds of a study, `5000..5200`.
///
/// # Errors
/// Returns the text of the error for anything but a range that is not empty.
pub fn parse_seeds(text: &str) -> Result<Range<u64>, String> {
    let parsed = text.split_once("..").and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    parsed.filter(|seeds| !seeds.is_empty()).ok_or_else(|| format!("{text} is no range such as 5000..5200"))
}
