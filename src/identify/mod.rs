//! Identification: the parameters of an axis from recordings of it (Prévost section 3).
//!
//! A recording is read as a [`RawRecording`], checked and made even in time ([`Signals`]); the steps of the
//! paper take it from there. What they could not tell, and what to record to mend it, are [`Finding`]s.

pub mod campaign;

mod closed_loop;
mod condition;
mod delays;
mod fault;
mod feedforward;
mod filter;
mod finding;
mod fit;
mod friction;
mod gravity;
mod identification;
mod inertia;
mod lag;
mod order;
mod plausible;
mod recording;
mod refine;
mod regression;
mod segments;
mod setpoints;
mod sampling;
mod spans;
mod stamps;
mod steps;
mod tell;
mod validate;
mod values;

pub use closed_loop::{Experiment, FeedforwardMode, Simulated, experiments, simulate, simulate_all};
pub use condition::{Conditioning, condition};
pub use delays::{Delay, DelayFit};
pub use fault::RecordingFault;
pub use feedforward::{FeedforwardFit, Regression, feedforward};
pub use finding::{Finding, Severity};
pub use friction::{Breakaway, Friction, FrictionLaw, LawFit, friction};
pub use gravity::{Gravity, GravityCurrent, GravitySource, Level, Rest, Steady, gravity};
pub use identification::{Identification, Input, Options, identify};
pub use inertia::{Inertia, inertia};
pub use recording::{RawRecording, Signals, Span};
pub use refine::{Parameter, Refined, Refinement, refine};
pub use segments::{Segment, SegmentKind, segments};
pub use validate::{Agreement, Comparison, Deviation, InverseDynamics, validate};
pub use values::{Identified, adopt};
