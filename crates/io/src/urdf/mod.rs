//! Converts a machine into a URDF for robot_state_publisher, RViz and MoveIt.
//!
//! The movable joints have the names of `joint_states` and the limits of the machine file. Signs follow ISO 841: a
//! positive joint moves the *tool* relative to the workpiece, so the tables turn about −X (A) and −Z (C) of the
//! machine frame.
//!
//! ```text
//! machine ─ a ─ cradle ─ c ─ table ─ workpiece
//!         └ x ─ x_slide ─ y ─ y_slide ─ z ─ z_slide ─ tool
//! ```
//!
//! `workpiece` and `tool` are fixed to their parents. `tool` is the tool tip, its Z axis points to the spindle: the
//! transform from `workpiece` to `tool` is
//! [`Kinematics::forward`](virtual_axes_core::kinematics::Kinematics::forward). A missing axis is a fixed joint. Shapes
//! are simple and for visualization only; the URDF contains no masses and no meshes.

mod error;
mod model;
mod shapes;
mod xml;

pub use error::UrdfError;

use virtual_axes_core::config::MachineConfig;

/// Root frame: the machine frame of the kinematics.
pub const MACHINE_FRAME: &str = "machine";
/// Frame of the workpiece, fixed to the table of C.
pub const WORKPIECE_FRAME: &str = "workpiece";
/// Frame of the tool tip, Z along the tool axis toward the spindle.
pub const TOOL_FRAME: &str = "tool";

/// Returns the URDF of a machine, with `joint_prefix` before the names of its joints as in the node.
///
/// # Errors
/// [`UrdfError`] if a joint has no role in the chain, or a name contains a character that XML does not allow.
pub fn urdf(machine: &MachineConfig, joint_prefix: &str) -> Result<String, UrdfError> {
    xml::written(&model::Model::new(machine, joint_prefix)?)
}
