//! Conditioning of axis recordings: plausibility checks, resampling to a uniform time grid, zero-phase
//! filtering.
//!
//! [`condition`] turns a [`RawRecording`] into [`Signals`] that the identification can use, or returns a
//! [`ConditioningError`]. [`Finding`]s list all corrections and shortcomings.

mod condition;
mod current_lag;
mod error;
mod filter;
mod filtered_section;
mod finding;
mod full_turns;
mod held_samples;
mod ordering;
mod plausibility;
mod regression;
mod sampling;
mod signals;
mod spans;
mod stated;
mod uniform_grid;

pub use condition::{Conditioning, PsecShift, condition};
pub use error::ConditioningError;
pub(crate) use filter::deviation;
pub use filter::{FilteredSignal, GaussianFilter};
pub use finding::{Finding, Severity};
pub use signals::{RawRecording, SignalSpan, Signals};
pub use stated::StatedValues;
