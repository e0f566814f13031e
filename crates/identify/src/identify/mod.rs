//! Identification: the parameters of an axis from recordings of it (Prévost section 3).
//!
//! The steps of the paper take [`Signals`](crate::recording::Signals) one after the other: segments, gravity,
//! friction, inertia, feedforward, delays; behind them stands a refinement on the whole closed loop. What
//! they could not tell, and what to record to mend it, are [`Finding`](crate::recording::Finding)s.

pub mod campaign;

mod closed_loop;
mod delays;
mod feedforward;
mod fit;
mod friction;
mod gravity;
mod identification;
mod inertia;
mod mode;
mod refine;
mod segments;
mod setpoints;
mod steps;
mod tell;
mod validate;
mod values;

pub use closed_loop::{Experiment, Simulated, experiments, simulate, simulate_all};
pub use delays::{Delay, DelayFit};
pub use feedforward::{FeedforwardFit, Regression, feedforward};
pub use friction::{Breakaway, Friction, FrictionLaw, LawFit, friction};
pub use gravity::{Gravity, GravityCurrent, GravitySource, Level, Rest, Steady, gravity};
pub use identification::{Identification, Input, Options, Refine, identify};
pub use inertia::{Inertia, inertia};
pub use mode::FeedforwardMode;
pub use refine::{Parameter, Refined, Refinement, refine};
pub use segments::{Segment, SegmentKind, segments};
pub use validate::{Agreement, Comparison, Deviation, InverseDynamics, validate};
pub use values::{Identified, adopt};
