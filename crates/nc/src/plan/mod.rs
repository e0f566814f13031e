//! Look-ahead and feed planning: position setpoints along the motions of a part program, in constant memory.
//!
//! 1. Geometry: motions become pieces with a continuous second derivative. With exact stop, a piece is the programmed curve.
//!    Blended motions become one cubic spline within their tolerances, whose control points lie on the programmed curve:
//!    corners, arcs and micro-segments alike. With exact path, the feed continues where tangent and curvature do.
//! 2. Look-ahead: pieces ahead are divided into intervals, and the time along them is minimized within the velocity,
//!    acceleration and jerk limits of all joints, through the kinematics, and within the programmed feed. The plan always
//!    ends at a standstill, so that the motion can stop within the window; it is renewed before its last part is reached.
//!    Straight lines between standstills have the closed form of seven phases.
//! 3. Feed override: the planned time passes more slowly, within the limits of the axes and on the path.
//!
//! A machine whose control has another profile ([`ControlProfile`](virtual_axes_core::config::ControlProfile)) has a planner
//! with trapezoidal speed in place of steps 1 and 2, and filters of the setpoints.
//!
//! Limits of the profile `own` hold for the continuous motion, so that differences of setpoints at any position period keep them.

mod activity;
mod band;
mod blended_path;
mod chunk;
mod corner;
mod error;
mod filter;
mod interval_motion;
mod look_ahead;
mod machine_model;
mod motion_curve;
mod nurbs;
mod piece;
mod pieces;
mod planned;
mod planned_interval;
mod planner;
mod programmed;
mod source;
mod speed;
mod trapezoid;
mod vector;
mod window;

pub use activity::{ProgramActivity, TimeKind};
pub(crate) use blended_path::bounded_corner;
pub use chunk::PlannedChunk;
pub use error::{FeedPlanError, StepError};
pub use planner::{PartProgramPlanner, PlanOptions, PlannedSetpoint};
pub use programmed::{ProgrammedCorner, ProgrammedPath};
