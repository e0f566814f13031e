//! Geometric paths and feed planning: position setpoints along lines, arcs and B-splines within the axis
//! limits.
//!
//! A [`Block`] is one curve in programmed coordinates, parametrized by arc length: a line, an arc or a
//! cubic B-spline. A [`Path`] joins blocks without gaps and transforms their coordinates into joints. A
//! [`Program`] adds feed profiles: the feed along the path for which no axis exceeds its speed,
//! acceleration or jerk limit.
//!
//! ```
//! use virtual_axes_core::config::{AxisKind, Parameters};
//! use virtual_axes_core::kinematics::Kinematics;
//! use virtual_axes_core::path::{Block, Frame, Move, Program};
//! use virtual_axes_core::trajectory::JointLimits;
//!
//! let machine = Parameters::embedded_default()?.machine_config()?;
//! let limits: Vec<_> = machine.axes().iter().map(JointLimits::from_axis).collect();
//! let kinds: Vec<AxisKind> = machine.axes().iter().map(|axis| axis.kind()).collect();
//! // 200 mm along X at 10 m/min, with 2.5 m/s² and 50 m/s³: v/a + a/j for the ramps, and l/v.
//! let block = Block::line(&[0.0; 5], &[0.2, 0.0, 0.0, 0.0, 0.0], &kinds)?;
//! let feed = 10.0 / 60.0;
//! let period = machine.periods().position;
//! let kinematics = Kinematics::new(&machine);
//! let program = Program::plan(kinematics, Frame::Joints, &limits, period, 0.0, vec![Move::new(block, feed)])?;
//! let expected = feed / 2.5 + 2.5 / 50.0 + 0.2 / feed;
//! assert!((program.duration() - expected).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arc;
mod block;
mod bounds;
mod curve;
mod derivatives;
mod error;
mod geometry;
mod junction;
mod limit_use;
mod planner;
mod profile;
mod program;
mod quadrature;
mod spans;
mod spline;
mod verify;

pub use arc::Circle;
pub use block::Block;
pub use derivatives::Derivatives;
pub use error::{PathError, PlanError, SetpointDerivative};
pub use geometry::{Frame, Path};
pub use limit_use::LimitUse;
pub use program::{FeedProfile, Move, PathLimits, Program};
