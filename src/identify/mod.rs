//! Identification: the parameters of an axis from recordings of it (Prévost section 3).
//!
//! A recording is read as a [`RawRecording`], checked and made even in time ([`Signals`]); the steps of the
//! paper take it from there. What they could not tell, and what to record to mend it, are [`Finding`]s.

mod condition;
mod fault;
mod filter;
mod finding;
mod lag;
mod order;
mod plausible;
mod recording;
mod regression;
mod sampling;
mod spans;
mod stamps;

pub use condition::{Conditioning, condition};
pub use fault::RecordingFault;
pub use finding::{Finding, Severity};
pub use recording::{RawRecording, Signals, Span};
