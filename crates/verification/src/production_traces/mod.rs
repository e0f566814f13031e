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
//! - [`TraceKind`] is a random program, recorder and feedforward, at sampling periods from 0.5 to 20 ms.
//! - [`study`] identifies an axis from such a recording and compares the result with the hidden parameters.
//! - [`AxisGuess`] contains what a user knows about a hidden axis.
//! - [`write_csv`] and [`machine_file()`] write traces and parameters.
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

mod drawn;
mod guess;
mod hidden_axis;
mod program;
mod recorder;
mod study;
mod study_table;
mod trace_files;
mod trace_kind;

pub use drawn::AxisOrientation;
pub use guess::AxisGuess;
pub use hidden_axis::{HiddenAxis, HiddenMachine, SimulatedAxis};
pub use program::ProductionProgram;
pub use recorder::{CurrentSampling, TraceRecorder};
pub use study::{StudyFigures, study};
pub use study_table::study_table;
pub use trace_files::{machine_file, write_csv};
pub use trace_kind::{PERIODS, TraceKind, TraceProgram};
