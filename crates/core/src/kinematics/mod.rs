//! Forward and inverse kinematics: joints to the tool pose in the workpiece frame and back, coordinates of the tool center
//! point (TCP), and singularities.
//!
//! The chain leads from the workpiece over tables, X/Y/Z and heads to the tool, with at most two rotary axes: A about X, B
//! about Y, C about Z. `kinematics.chain` names them in this order, for example `[c, a, xyz]` (two tables), `[c, xyz, b]`
//! (table and head) or `[xyz, c, a]` (two heads). Names and signs follow ISO 841: a positive joint moves the *tool* relative
//! to the workpiece, so tables rotate in the opposite direction. At home (all joints 0) machine frame and workpiece frame
//! are parallel.
//!
//! With the tool length L, the origin W of the workpiece frame and a point P on each rotary axis, all in the machine frame
//! at home, the right-handed rotations R of each axis about its direction, table 1 next to the workpiece and head 1 next to
//! X/Y/Z, a point p of the workpiece frame and the tip have the machine coordinates
//!
//! ```text
//! p_m = P2 + R2⁻¹ (P1 + R1⁻¹ (W + p − P1) − P2)               tables
//! t_m = (x, y, z) + P1 + R1 (P2 + R2 (−L ez − P2) − P1)       heads
//! ```
//!
//! and the tool axis, from the tip to the spindle, has in the workpiece frame the components u = R1 R2 ez, with the rotations
//! in the order of the chain. With tables C and A:
//!
//! ```text
//! p_m = Pa + Rx(−a) (Pc + Rz(−c) (W + p − Pc) − Pa)        tip: p_m = (x, y, z) − L ez
//! u = Rz(c) Rx(a) ez = (sin a sin c, −sin a cos c, cos a)
//! ```
//!
//! # Two solutions and the singularity
//!
//! The second rotary axis of the chain, A or B, tilts the tool against the plane or the axis of the first one; two pairs of
//! angles give the same tool axis, for example (c, a) and (c + 180°, −a), with any number of turns. [`Kinematics::inverse`]
//! selects the solution nearest to the reference joints; solutions inside the travel limits of the rotary axes take
//! precedence.
//!
//! The tool axis can be parallel to the first rotary axis (A = 0 on tables C and A). Every angle of that axis gives the
//! same tool axis. It then keeps its reference value: a path *through* the singularity keeps C and changes the sign of A. If
//! the travel limits exclude negative A, C rotates by 180° there. On a path *near* the singularity with minimum tilt a, C
//! rotates 1/a times as fast as the tool axis. This is a property of the geometry; the axis limits apply to it.
//!
//! The solution is numerically stable near the singularity. The transverse part of u has a rounding error of about 1e-16,
//! so C has an error of about 1e-16/a, but the tool axis only of 1e-16. X, Y and Z are computed from the returned angles, so
//! the tip is accurate for any C and any distance from the axis of C.

mod chain;
mod error;
mod inverse;
mod poses;
mod role;
mod rotation;

pub use chain::{Kinematics, RotaryAngles, ToolPose};
pub use error::KinematicsError;
pub use poses::Poses;
pub use role::AxisRole;
pub use rotation::Rotation;
