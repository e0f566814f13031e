//! Geometric paths, and setpoints along them at a limited feed.
//!
//! A [`Block`] is one curve in programmed coordinates, by its arc length: a line, an arc, a cubic
//! B-spline. A [`Path`] joins blocks without gaps and knows how its coordinates become joints. A
//! [`Program`] adds the law of time: a feed along the path within which no axis exceeds its speed,
//! acceleration or jerk.
//!
//! ```
//! use virtual_axes::config::{AxisKind, Parameters};
//! use virtual_axes::kinematics::Kinematics;
//! use virtual_axes::path::{Block, Frame, Move, Program};
//! use virtual_axes::trajectory::JointLimits;
//!
//! let machine = Parameters::embedded_default()?.machine_config()?;
//! let limits: Vec<_> = machine.axes().iter().map(JointLimits::of_axis).collect();
//! let kinds: Vec<AxisKind> = machine.axes().iter().map(|axis| axis.kind()).collect();
//! // 200 mm along X at 10 m/min, with 2.5 m/s² and 50 m/s³: v/a + a/j for the ramps, and l/v.
//! let block = Block::line(&[0.0; 5], &[0.2, 0.0, 0.0, 0.0, 0.0], &kinds)?;
//! let feed = 10.0 / 60.0;
//! let period = machine.periods().position;
//! let kinematics = Kinematics::new(&machine);
//! let program = Program::plan(kinematics, Frame::Joints, &limits, period, 0.0, vec![Move::new(block, feed)])?;
//! let wanted = feed / 2.5 + 2.5 / 50.0 + 0.2 / feed;
//! assert!((program.duration() - wanted).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod block;
pub mod error;
pub mod program;
pub mod route;

mod arc;
mod bounds;
mod cosine;
mod curve;
mod junction;
mod line;
mod planner;
mod profile;
mod quadrature;
mod spans;
mod spline;
mod verify;

pub use arc::Circle;
pub use block::{Block, Derivatives};
pub use error::{PathError, PlanError};
pub use program::{Law, Move, PathLimits, Program};
pub use route::{Frame, Path};
