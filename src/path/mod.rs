//! Geometric paths, and set-points along them at a limited feed.
//!
//! A [`Block`] is one curve in programmed coordinates, by its arc length: a line, an arc, a cubic
//! B-spline. A [`Path`] joins blocks without gaps and knows how its coordinates become joints. A
//! [`Program`] adds the law of time: a feed along the path within which no axis exceeds its speed,
//! acceleration or jerk.

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
