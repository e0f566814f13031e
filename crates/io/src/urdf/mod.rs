//! Converts a machine into a URDF for robot_state_publisher, RViz and MoveIt.
//!
//! The movable joints have the names of `joint_states` and the limits of the machine file. Signs follow ISO 841: a
//! positive joint moves the *tool* relative to the workpiece, so tables turn against the sign of their joints.
//!
//! ```text
//! machine ─ a ─ cradle ─ c ─ table ─ workpiece                                      tables c and a
//!         ├ x ─ x_slide ─ y ─ y_slide ─ z ─ z_slide ─ tool
//!         └ bed
//! machine ─ workpiece                                                               heads c and a
//!         ├ x ─ x_slide ─ y ─ y_slide ─ z ─ z_slide ─ c ─ fork ─ a ─ head ─ tool
//!         └ bed
//! ```
//!
//! `workpiece`, `tool` and `bed` are fixed to their parents. `tool` is the tool tip, its Z axis points to the spindle: the
//! transform from `workpiece` to `tool` is
//! [`Kinematics::forward`](virtual_axes_core::kinematics::Kinematics::forward). A missing axis is a fixed joint. Shapes
//! are simple, for visualization, collisions and the masses of a rigid-body simulator; the URDF contains no meshes.

mod inertia;
mod model;
mod shapes;
mod xml;

pub use model::{MACHINE_FRAME, TOOL_FRAME, UrdfError, WORKPIECE_FRAME};

use virtual_axes_core::config::MachineConfig;

/// Returns the URDF of a machine, with `joint_prefix` before the names of its joints as in the node.
///
/// # Errors
/// [`UrdfError`] if a joint has no role in the chain, or a name contains a character that XML does not allow.
pub fn urdf(machine: &MachineConfig, joint_prefix: &str) -> Result<String, UrdfError> {
    xml::written(&model::Model::new(machine, joint_prefix)?)
}
