//! Kinematics of the chain RRTTT: joints to the pose of the tool in the workpiece frame, and back.
//!
//! The chain is workpiece–C–A–X/Y/Z–tool: X, Y and Z move the tool, the tables C (on top) and A (below
//! it) move the workpiece. Names and signs are those of ISO 841: a positive joint moves the *tool*
//! relative to the workpiece, so the tables themselves turn the other way. At home (every joint 0) the
//! machine frame and the workpiece frame are parallel.
//!
//! With L the tool length, W the origin of the workpiece frame, Pa = (0, pivot_a) and Pc = (pivot_c, 0)
//! points of the axes of A and C, all in the machine frame at home, and Rx, Rz the right-handed
//! rotations about X and Z, the point p of the workpiece frame stands in the machine frame at
//!
//! ```text
//! p_m = Pa + Rx(−a) (Pc + Rz(−c) (W + p − Pc) − Pa)        tip: p_m = (x, y, z) − L ez
//! ```
//!
//! and the tool axis, from the tip to the spindle, is in the workpiece frame
//!
//! ```text
//! u = Rz(c) Rx(a) ez = (sin a sin c, −sin a cos c, cos a)
//! ```
//!
//! # Two solutions, and the singularity at A = 0
//!
//! (a, c) and (−a, c + 180°) give the same axis, and so does each turn of C.
//! [`Kinematics::inverse`] takes the solution nearest to the joints it is given, after those that the
//! travel limits of A excludes.
//!
//! At A = 0 (and 180°) the axis of C is parallel to the tool axis: C turns the workpiece about the
//! tool, and every C gives the same tool axis. There C keeps the value that it was given, so a path
//! that goes *through* the singularity keeps C and changes the sign of A; on a machine whose A cannot
//! go negative, C must turn by 180° there. A path that passes *near* the singularity, at a smallest
//! tilt a, is well defined, but C must turn fast: 1/a times as fast as the tool axis. That is geometry
//! and no fault of the solution; the limits of the axis show it.
//!
//! Rounding does no harm there. The transverse part of u has about 1e-16 of it, so C is known to
//! about 1e-16/a only, but the tool axis to 1e-16 all the same; and X, Y and Z are computed from the
//! very C and A that are returned, so that the tip is where it should be whatever C is, and however
//! far it is from the axis of C.

mod chain;
mod error;
mod inverse;
mod poses;

pub use chain::{Kinematics, Role, ToolPose, Turned};
pub use error::KinematicsError;
pub use poses::Poses;
