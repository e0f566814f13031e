//! Trajectories: from requested points to one position setpoint (PSEC) per period and joint.
//!
//! A [`Request`] holds what was asked for. [`Trajectory::new`] checks it against the machine, on
//! the side of whoever asks: that is where the work is. The [`Timeline`] belongs to the thread that
//! moves the machine; it takes checked trajectories, looks at the junction with what is being
//! commanded only, and hands out setpoints, one position instant after another.

pub mod event;
pub mod limits;
pub mod path;
pub mod rejection;
pub mod request;
pub mod spline;
pub mod stop;
pub mod stream;
pub mod timeline;

mod arrivals;
mod cancel;
mod check;
mod motions;
mod offer;
mod plan;

pub use arrivals::STREAM_JITTER;
pub use cancel::CallOff;
pub use event::{Event, JointSet, MotionId};
pub use limits::JointLimits;
pub use offer::Admission;
pub use path::{Context, Trajectory};
pub use rejection::{Code, Rejection};
pub use request::{Request, Row, Start};
pub use spline::State;
pub use stream::{StreamCounts, StreamEnd};
pub use timeline::{Timeline, TimelineError};
