//! Links and joints of the URDF of a machine.

use super::shapes::{Shapes, Visual};
use super::{MACHINE_FRAME, TOOL_FRAME, UrdfError, WORKPIECE_FRAME};
use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::kinematics::{AxisRole, Kinematics};

/// Travel limit of a linear axis without limit in the machine file, m: the largest allowed value.
const OPEN_TRAVEL: f64 = 1e3;
/// Travel limit of a rotary axis with one open end, rad: 1e6°.
const OPEN_ROTATION: f64 = 1e6 * virtual_axes_core::units::DEGREE;

/// URDF model of a machine.
pub(super) struct Model {
    /// Name of the machine.
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
}

/// Link of the URDF.
pub(super) struct Link {
    pub name: &'static str,
    pub visuals: Vec<Visual>,
}

/// Joint of the URDF.
pub(super) struct Joint {
    pub name: String,
    pub parent: &'static str,
    pub child: &'static str,
    /// Origin of the child in the parent at joint position 0, without rotation, m.
    pub origin: [f64; 3],
    pub motion: Motion,
}

/// Type of motion of a joint.
pub(super) enum Motion {
    Fixed,
    Moves {
        /// Joint type: `prismatic`, `revolute` or `continuous`.
        kind: &'static str,
        /// Unit vector in the parent frame along or about which a positive joint moves the child.
        axis: [f64; 3],
        limit: Limit,
    },
}

/// Limits of a joint in m, m/s, N or in rad, rad/s, N·m.
pub(super) struct Limit {
    /// Travel limits; `None` for a continuous joint.
    pub travel: Option<[f64; 2]>,
    pub velocity: f64,
    /// Largest force or torque of the motor at the axis, Kt·imax/r.
    pub effort: f64,
}

impl Limit {
    fn of(axis: &AxisConfig) -> Self {
        let limits = axis.limits();
        let (min, max) = (limits.travel_min, limits.travel_max);
        let endless = axis.kind() == AxisKind::Rotary && min.is_infinite() && max.is_infinite();
        let open = match axis.kind() {
            AxisKind::Linear => OPEN_TRAVEL,
            AxisKind::Rotary => OPEN_ROTATION,
        };
        Limit {
            travel: (!endless).then(|| [min.max(-open), max.min(open)]),
            velocity: limits.velocity,
            effort: axis.max_effort(),
        }
    }
}

impl Model {
    pub fn new(machine: &MachineConfig, joint_prefix: &str) -> Result<Self, UrdfError> {
        let chain = Chain::new(machine, joint_prefix)?;
        let geometry = machine.kinematics();
        let ([a_y, a_z], [c_x, c_y], [w_x, w_y, w_z]) =
            (geometry.pivot_a, geometry.pivot_c, geometry.workpiece);
        let home = [0.0; 3];
        let joints = vec![
            // The tables turn against their joints (ISO 841).
            chain.joint(AxisRole::A, [MACHINE_FRAME, "cradle"], [0.0, a_y, a_z], [-1.0, 0.0, 0.0]),
            chain.joint(AxisRole::C, ["cradle", "table"], [c_x, c_y - a_y, -a_z], [0.0, 0.0, -1.0]),
            fixed("workpiece_mount", ["table", WORKPIECE_FRAME], [w_x - c_x, w_y - c_y, w_z]),
            chain.joint(AxisRole::X, [MACHINE_FRAME, "x_slide"], home, [1.0, 0.0, 0.0]),
            chain.joint(AxisRole::Y, ["x_slide", "y_slide"], home, [0.0, 1.0, 0.0]),
            chain.joint(AxisRole::Z, ["y_slide", "z_slide"], home, [0.0, 0.0, 1.0]),
            fixed("tool_mount", ["z_slide", TOOL_FRAME], [0.0, 0.0, -geometry.tool_length]),
        ];
        let shapes = Shapes::new(geometry, |role| chain.axis(role).map(AxisConfig::limits));
        let link = |name, visuals| Link { name, visuals };
        let links = vec![
            link(MACHINE_FRAME, shapes.machine()),
            link("cradle", shapes.cradle()),
            link("table", shapes.table()),
            link(WORKPIECE_FRAME, Vec::new()),
            link("x_slide", shapes.x_slide()),
            link("y_slide", shapes.y_slide()),
            link("z_slide", shapes.z_slide()),
            link(TOOL_FRAME, shapes.tool()),
        ];
        Ok(Model { name: machine.name().to_owned(), links, joints })
    }
}

/// Kinematic chain: the joints of a machine by their roles.
struct Chain<'a> {
    axes: &'a [AxisConfig],
    kinematics: Kinematics,
    prefix: &'a str,
}

impl<'a> Chain<'a> {
    fn new(machine: &'a MachineConfig, prefix: &'a str) -> Result<Self, UrdfError> {
        let kinematics = Kinematics::new(machine);
        let indices = AxisRole::ALL.map(|role| kinematics.role(role));
        let unassigned =
            machine.axes().iter().enumerate().find(|(index, _)| !indices.contains(&Some(*index)));
        if let Some((_, axis)) = unassigned {
            let kind = match axis.kind() {
                AxisKind::Linear => "linear",
                AxisKind::Rotary => "rotary",
            };
            return Err(UrdfError::NotInChain { joint: axis.name().to_owned(), kind });
        }
        Ok(Chain { axes: machine.axes(), kinematics, prefix })
    }

    fn axis(&self, role: AxisRole) -> Option<&'a AxisConfig> {
        self.kinematics.role(role).and_then(|index| self.axes.get(index))
    }

    /// Returns the joint with the role, or a fixed joint if the machine has none.
    fn joint(&self, role: AxisRole, between: [&'static str; 2], origin: [f64; 3], axis: [f64; 3]) -> Joint {
        let Some(config) = self.axis(role) else {
            return fixed(&format!("{role}_held"), between, origin);
        };
        let limit = Limit::of(config);
        let kind = match config.kind() {
            AxisKind::Linear => "prismatic",
            AxisKind::Rotary if limit.travel.is_none() => "continuous",
            AxisKind::Rotary => "revolute",
        };
        let [parent, child] = between;
        let name = format!("{}{}", self.prefix, config.name());
        Joint { name, parent, child, origin, motion: Motion::Moves { kind, axis, limit } }
    }
}

fn fixed(name: &str, [parent, child]: [&'static str; 2], origin: [f64; 3]) -> Joint {
    Joint { name: name.to_owned(), parent, child, origin, motion: Motion::Fixed }
}
