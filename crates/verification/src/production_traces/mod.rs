//! Production traces: recordings of a machining center at work, from hidden axes with known parameters.
//!
//! A production trace contains commanded position, actual position, actual velocity and current of an axis during a
//! part program, with feedforward active: short phases of constant velocity, horizontal axes at standstill for most of
//! the time, a vertical axis under its weight. The control samples at 500 Hz, filters all signals alike at 24 Hz and
//! stores one sample every 20 ms.
//!
//! - [`HiddenAxis`] is an axis with random parameters, [`HiddenMachine`] a machine of such axes.
//! - [`ProductionProgram`] is a random part program for three linear axes; several programs can run on one axis.
//! - [`TraceRecorder`] sets filter, sampling, quantization, noise, gaps and jitter of [`HiddenAxis::record`].
//! - [`AxisGuess`] contains what a user knows about a hidden axis.
//! - [`write_csv`], [`machine_file()`] and [`truth_file`] write traces and parameters.
//!
//! Every random number derives from a seed: equal seeds give bit-identical traces on one machine.
//!
//! # Example
//! ```
//! use virtual_axes_verification::production_traces::{AxisOrientation, HiddenAxis, TraceRecorder};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let axis = HiddenAxis::draw(1, AxisOrientation::Vertical);
//! let program = axis.program(10, 3.0)?;
//! let recording = axis.record(&program, &TraceRecorder::default(), 1)?;
//! assert_eq!(recording.current.map(|current| current.len()), Some(recording.time.len()));
//! // Another program on the same axis.
//! let unseen = axis.record(&axis.program(11, 3.0)?, &TraceRecorder::default(), 2)?;
//! assert!(!unseen.time.is_empty());
//! # Ok(())
//! # }
//! ```

mod butterworth;
mod csv;
mod drawn;
mod error;
mod guess;
mod hidden_axis;
mod hidden_machine;
mod machine_file;
mod position_error;
mod program;
mod recorder;
mod study;

pub use butterworth::ButterworthFilter;
pub use csv::write_csv;
pub use error::TraceError;
pub use guess::AxisGuess;
pub use hidden_axis::{AxisOrientation, HiddenAxis, SimulatedAxis};
pub use hidden_machine::HiddenMachine;
pub use machine_file::{machine_file, truth_file};
pub use position_error::PositionError;
pub use program::ProductionProgram;
pub use recorder::{CurrentSampling, TraceRecorder};
pub use study::{StudyCase, StudyFigures, TraceStudy};
