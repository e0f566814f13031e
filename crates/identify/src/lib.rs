//! Identification of drive parameters from recordings, tuning of position controllers, and iterative learning.
//!
//! Four modules, each usable on its own:
//! - [`recording`] conditions raw recordings of an axis: time grid, gaps, zero-phase filter, plausibility.
//! - [`mod@identify`] plans identification campaigns and identifies gravity, friction, inertia, feedforward
//!   weights and delays of an axis (Prévost section 3).
//! - [`tune`] searches controller tunings that minimize a cost on a path.
//! - [`learn`] learns setpoints that compensate the repeatable errors of a motion.
//!
//! The crate root re-exports the functions [`condition`] and [`identify()`] with their arguments and results.
//!
//! # Example
//! ```
//! use std::sync::Arc;
//!
//! use virtual_axes_core::config::{MachineConfig, Parameters};
//! use virtual_axes_core::machine::{Machine, MachineParameters};
//! use virtual_axes_identify::identify::campaign::{Campaign, CampaignOptions};
//! use virtual_axes_identify::{
//!     Conditioning, FeedforwardMode, IdentificationInput, IdentificationOptions, RawRecording, condition, identify,
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Setpoints of a campaign without feedforward for the X axis of the default machine.
//! let mode = FeedforwardMode::Off;
//! let mut parameters = Parameters::embedded_default()?;
//! parameters.set_all(mode.assignments(&parameters, "x"))?;
//! let config = parameters.machine_config()?;
//! let (axis, periods) = (&config.axes()[0], config.periods());
//! let campaign = Campaign::plan(&config, 0, &[mode], &CampaignOptions::default())?;
//!
//! // Recording of position and motor current every millisecond, here from the virtual axis.
//! let virtual_axis = MachineConfig::from_axis(axis.clone(), periods);
//! let mut machine = Machine::new(Arc::new(MachineParameters::new(&virtual_axis)?));
//! let (mut time, mut position, mut current) = (Vec::new(), Vec::new(), Vec::new());
//! for psec in campaign.psec() {
//!     machine.advance_with(&[*psec], &[], |machine| {
//!         if machine.time() % 1_000_000 == 0 {
//!             let sample = machine.axis(0).sample();
//!             time.push(machine.time() as f64 * 1e-9);
//!             position.push(sample.position);
//!             current.push(sample.current);
//!         }
//!     });
//! }
//! let name = "x.csv".to_owned();
//! let raw = RawRecording { name, time, position: Some(position), current: Some(current), ..Default::default() };
//!
//! let (signals, _) = condition(&raw, axis, &periods, &Conditioning::default())?;
//! let input = IdentificationInput { signals: &signals, feedforward: Some(mode) };
//! let result = identify(&[input], axis, &periods, &IdentificationOptions::default());
//! let inertia = result.inertia.as_ref().ok_or("no inertia")?.value;
//! assert!((inertia / axis.motor.inertia - 1.0).abs() < 0.02, "{inertia} kg·m²");
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod identify;
pub mod learn;
pub mod recording;
pub mod tune;

pub use identify::{
    FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, RefinementScope, identify,
};
pub use recording::{Conditioning, ConditioningError, Finding, RawRecording, Signals, condition};
