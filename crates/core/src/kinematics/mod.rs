//! Forward and inverse kinematics of five-axis machines with two rotary tables (RRTTT): joints to tool pose in the
//! workpiece frame and back, tool center point (TCP) coordinates, and the singularity at A = 0.
//!
//! The chain is workpiece–C–A–X/Y/Z–tool. X, Y and Z move the tool; the rotary table C, mounted on the tilting table A,
//! moves the workpiece. Names and signs follow ISO 841: a positive joint moves the *tool* relative to the workpiece, so
//! the tables rotate in the opposite direction. At home (all joints 0) machine frame and workpiece frame are parallel.
//!
//! With the tool length L, the origin W of the workpiece frame, the points Pa = (0, pivot_a) and Pc = (pivot_c, 0) on the
//! axes of A and C, all in the machine frame at home, and the right-handed rotations Rx and Rz about X and Z, a point p
//! of the workpiece frame has the machine coordinates
//!
//! ```text
//! p_m = Pa + Rx(−a) (Pc + Rz(−c) (W + p − Pc) − Pa)        tip: p_m = (x, y, z) − L ez
//! ```
//!
//! and the tool axis, from the tip to the spindle, has in the workpiece frame the components
//!
//! ```text
//! u = Rz(c) Rx(a) ez = (sin a sin c, −sin a cos c, cos a)
//! ```
//!
//! # Two solutions and the singularity at A = 0
//!
//! (a, c) and (−a, c + 180°) give the same tool axis, with any number of turns of C. [`Kinematics::inverse`] selects the
//! solution nearest to the reference joints; solutions inside the travel limits of A take precedence.
//!
//! At A = 0 (and 180°) the axis of C is parallel to the tool axis, and every C gives the same tool axis. C then keeps its
//! reference value: a path *through* the singularity keeps C and changes the sign of A. If the travel limits exclude
//! negative A, C rotates by 180° there. On a path *near* the singularity with minimum tilt a, C rotates 1/a times as fast
//! as the tool axis. This is a property of the geometry; the axis limits apply to it.
//!
//! The solution is numerically stable near the singularity. The transverse part of u has a rounding error of about 1e-16,
//! so C has an error of about 1e-16/a, but the tool axis only of 1e-16. X, Y and Z are computed from the returned A and
//! C, so the tip is accurate for any C and any distance from the axis of C.

mod chain;
mod error;
mod inverse;
mod poses;

pub use chain::{AxisRole, Kinematics, TableAngles, ToolPose};
pub use error::KinematicsError;
pub use poses::Poses;
