//! Links and joints of the URDF of a machine, and the error of the conversion.

use nalgebra::Vector3;

use super::shapes::{Shapes, Visual};
use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::kinematics::{AxisRole, Kinematics, Rotation};

/// Root frame: the machine frame of the kinematics.
pub const MACHINE_FRAME: &str = "machine";
/// Frame of the workpiece, fixed to the table of C.
pub const WORKPIECE_FRAME: &str = "workpiece";
/// Frame of the tool tip, Z along the tool axis toward the spindle.
pub const TOOL_FRAME: &str = "tool";

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
        let shapes = Shapes::new(geometry, |role| chain.axis(role).map(AxisConfig::limits));
        let (mut heads, tables): (Vec<&Rotation>, Vec<&Rotation>) =
            chain.kinematics.rotations().iter().partition(|rotation| rotation.is_head());
        heads.retain(|head| head.joint().is_some());
        let mut model = Model { name: machine.name().to_owned(), links: Vec::new(), joints: Vec::new() };
        model.add_link(MACHINE_FRAME, Vec::new());
        let mut end = ChainEnd { link: MACHINE_FRAME, position: Vector3::zeros() };
        // The root has no inertia, which KDL does not support.
        model.add(fixed("bed_mount", end.beside("bed")), shapes.bed());
        for (place, table) in tables.iter().enumerate().rev() {
            let link = if place == 0 { "table" } else { "cradle" };
            // The tables turn against their joints (ISO 841).
            let joint = chain.joint(table.role(), end.to(link, table.pivot()), -table.direction());
            let visuals = match (place, table.role()) {
                (0, _) => shapes.table(),
                (_, AxisRole::A) => shapes.cradle(),
                _ => shapes.plate(),
            };
            model.add(joint, visuals);
        }
        model.add(fixed("workpiece_mount", end.to(WORKPIECE_FRAME, geometry.workpiece.into())), Vec::new());

        let mut end = ChainEnd { link: MACHINE_FRAME, position: Vector3::zeros() };
        let slides = ["x_slide", "y_slide", "z_slide"];
        let directions = [Vector3::x(), Vector3::y(), Vector3::z()];
        for ((role, link), direction) in AxisRole::LINEAR.into_iter().zip(slides).zip(directions) {
            let joint = chain.joint(role, end.to(link, Vector3::zeros()), direction);
            model.add(joint, shapes.slide(role, heads.is_empty()));
        }
        for (place, head) in heads.iter().enumerate() {
            let link = if place + 1 == heads.len() { "head" } else { "fork" };
            let joint = chain.joint(head.role(), end.to(link, head.pivot()), head.direction());
            let visuals = if link == "head" { shapes.head(head.pivot()) } else { shapes.plate() };
            model.add(joint, visuals);
        }
        let tip = Vector3::new(0.0, 0.0, -geometry.tool_length);
        model.add(fixed("tool_mount", end.to(TOOL_FRAME, tip)), shapes.tool());
        Ok(model)
    }

    fn add_link(&mut self, name: &'static str, visuals: Vec<Visual>) {
        self.links.push(Link { name, visuals });
    }

    /// Adds a joint with its child.
    fn add(&mut self, joint: Joint, visuals: Vec<Visual>) {
        self.add_link(joint.child, visuals);
        self.joints.push(joint);
    }
}

/// Last link of a chain that is built, with its origin in the machine frame at home, m.
struct ChainEnd {
    link: &'static str,
    position: Vector3<f64>,
}

/// Place of a joint: parent, child and the origin of the child in the parent at home, m.
struct Place {
    parent: &'static str,
    child: &'static str,
    origin: [f64; 3],
}

impl ChainEnd {
    /// Returns the place of a joint to a link with the same origin, beside the chain.
    fn beside(&self, child: &'static str) -> Place {
        Place { parent: self.link, child, origin: [0.0; 3] }
    }

    /// Returns the place of a joint to a link with the origin `position` in the machine frame, which becomes the end.
    fn to(&mut self, child: &'static str, position: Vector3<f64>) -> Place {
        let place = Place { parent: self.link, child, origin: (position - self.position).into() };
        *self = ChainEnd { link: child, position };
        place
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
    fn joint(&self, role: AxisRole, place: Place, axis: Vector3<f64>) -> Joint {
        let Some(config) = self.axis(role) else {
            return fixed(&format!("{role}_held"), place);
        };
        let limit = Limit::of(config);
        let kind = match config.kind() {
            AxisKind::Linear => "prismatic",
            AxisKind::Rotary if limit.travel.is_none() => "continuous",
            AxisKind::Rotary => "revolute",
        };
        let Place { parent, child, origin } = place;
        let name = format!("{}{}", self.prefix, config.name());
        Joint { name, parent, child, origin, motion: Motion::Moves { kind, axis: axis.into(), limit } }
    }
}

fn fixed(name: &str, Place { parent, child, origin }: Place) -> Joint {
    Joint { name: name.to_owned(), parent, child, origin, motion: Motion::Fixed }
}

/// Error of the conversion of a machine into a URDF.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// A joint has no role in the kinematic chain.
    #[error(
        "joint {joint} ({kind}) has no role in the kinematic chain; its joints are x, y, z (linear) and those of \
         kinematics.chain, at most two of a, b and c (rotary), each at most once"
    )]
    NotInChain {
        /// Name of the joint.
        joint: String,
        /// Kind of the joint, `linear` or `rotary`.
        kind: &'static str,
    },
    /// A text contains a character that XML 1.0 does not allow.
    #[error("{what} {text:?} contains the character {character:?}, which XML does not allow")]
    NotXml {
        /// Meaning of the text.
        what: &'static str,
        /// Text.
        text: String,
        /// First invalid character.
        character: char,
    },
    /// Writing the XML failed.
    #[error("the URDF cannot be written: {0}")]
    Write(#[from] std::io::Error),
}
