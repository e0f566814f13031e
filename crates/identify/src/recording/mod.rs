//! Recordings of an axis: checked, made even in time, filtered without phase.
//!
//! A recording is read as a [`RawRecording`]; [`condition`] makes it [`Signals`] that are fit for identification,
//! or says why it cannot. What was found on the way are [`Finding`]s.

mod condition;
mod fault;
mod filter;
mod finding;
mod lag;
mod order;
mod plausible;
mod regression;
mod sampling;
mod signals;
mod spans;
mod stamps;

pub use condition::{Conditioning, condition};
pub use fault::RecordingFault;
pub use filter::{Filtered, Gaussian};
pub use finding::{Finding, Severity};
pub use signals::{RawRecording, Signals, Span};
