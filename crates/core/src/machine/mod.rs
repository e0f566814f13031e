//! Simulated machine: axes of plant and controllers, stepped by position cycles.
//!
//! The same [`Machine`] runs in the node, in the command line and in the benchmarks. Time is an integer count of
//! ticks (current cycles), independent of the wall clock.

mod axis;
mod bank;
mod closed_loop;
mod compensation;
mod contour_control;
mod controller;
mod coupled_ticks;
mod coupling;
mod drive_mode;
mod elements;
mod energy;
mod error;
mod inner_loops;
mod loop_responses;
mod parameters;
mod prediction;
mod sample;
mod simulated;
mod stored;

pub use axis::{Axis, AxisParameters};
pub use bank::SimdWidth;
pub use closed_loop::closed_loop_response;
pub use contour_control::{contour_axes, design_contour_controller, with_contour_gain};
pub use controller::{FALLBACK_DELAY, design_controller};
pub use drive_mode::DriveMode;
pub use energy::CycleEnergy;
pub use error::{AxisError, InputOutOfRange, MAX_INPUT, MachineError, check_input};
pub use loop_responses::{NaturalFrequencies, contour_response, loop_response, natural_frequencies};
pub use parameters::MachineParameters;
pub use prediction::{deviating_plant_model, prediction_model};
pub use sample::AxisSample;
pub use simulated::{Activity, Machine};
pub use stored::StateError;
