//! The machine as a URDF for robot_state_publisher, RViz and MoveIt.
//!
//! The joints that move are those of `joint_states`, by the same names; their limits are the machine
//! file's. Signs are those of ISO 841: a positive joint moves the *tool* relative to the workpiece, so
//! the tables turn about −X (A) and −Z (C) of the machine frame.
//!
//! ```text
//! machine ─ a ─ cradle ─ c ─ table ─ workpiece
//!         └ x ─ x_slide ─ y ─ y_slide ─ z ─ z_slide ─ tool
//! ```
//!
//! `workpiece` and `tool` are fixed to their parents. `tool` is the tip, its Z axis points to the
//! spindle: the transform from `workpiece` to `tool` is [`Kinematics::forward`](virtual_axes_core::kinematics::Kinematics::forward).
//! A role that no joint has is a fixed joint. Shapes are simple ones, for the eye only; there are no
//! masses and no meshes.

mod error;
mod model;
mod shapes;
mod xml;

pub use error::UrdfError;

use virtual_axes_core::config::MachineConfig;

/// Frame that everything else hangs on: the machine frame of the kinematics.
pub const MACHINE_FRAME: &str = "machine";
/// Frame of the workpiece, fixed to the table of C.
pub const WORKPIECE_FRAME: &str = "workpiece";
/// Frame of the tool tip, Z along the tool axis towards the spindle.
pub const TOOL_FRAME: &str = "tool";

/// The URDF of a machine, `joint_prefix` before the names of its joints as in the node.
///
/// # Errors
/// [`UrdfError`] if a joint has no place in the chain, or the prefix cannot stand in XML.
pub fn urdf(machine: &MachineConfig, joint_prefix: &str) -> Result<String, UrdfError> {
    xml::written(&model::Model::new(machine, joint_prefix)?)
}
