//! Identification: the parameters of an axis from recordings of it (Prévost section 3).
//!
//! A recording is read as a [`RawRecording`], checked and made even in time ([`Signals`]); the steps of the
//! paper take it from there. What they could not tell, and what to record to mend it, are [`Finding`]s.

mod closed_loop;
mod feedforward;
mod finding;
mod fit;
mod friction;
mod gravity;
mod inertia;
mod recording;
mod segments;
mod setpoints;

pub use closed_loop::{Experiment, FeedforwardMode, Simulated, experiments, simulate, simulate_all};
pub use feedforward::{FeedforwardFit, Regression, feedforward};
pub use finding::{Finding, Severity};
pub use friction::{Breakaway, Friction, FrictionLaw, LawFit, friction};
pub use gravity::{Gravity, GravityCurrent, GravitySource, Level, Rest, Steady, gravity};
pub use inertia::{Inertia, inertia};
pub use recording::{RawRecording, Signals, Span};
pub use segments::{Segment, SegmentKind, segments};
