//! Kinematic chain and forward kinematics: joints to tool pose.

use nalgebra::{Unit, UnitQuaternion, Vector3};

use super::role::AxisRole;
use super::rotation::Rotation;
use crate::config::MachineConfig;

/// Pose of the tool in the workpiece frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Tool tip, m.
    pub tip: Vector3<f64>,
    /// Tool axis: unit vector from the tip to the spindle.
    pub axis: Vector3<f64>,
}

/// Kinematics of a machine; the [module documentation](super) contains the equations.
///
/// Name (`x`, `y`, `z`, `a`, `b`, `c`, in upper or lower case) and type of a joint determine its role. A role without joint
/// is fixed at 0; a joint without role, or a rotary joint that the chain does not contain, does not move the tool.
///
/// ```
/// use virtual_axes_core::config::Parameters;
/// use virtual_axes_core::kinematics::Kinematics;
///
/// let kinematics = Kinematics::new(&Parameters::embedded_default()?.machine_config()?);
/// // x, y, z in m, a = 90°, c = 0: the tool axis is −Y of the workpiece.
/// let pose = kinematics.forward(&[0.0, 0.0, 0.1, std::f64::consts::FRAC_PI_2, 0.0]);
/// assert!((pose.axis.y + 1.0).abs() < 1e-15 && pose.tip.norm() < 1e-15);
/// # Ok::<(), virtual_axes_core::config::ConfigError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Kinematics {
    /// Vector from the point moved by X, Y and Z to the tip with every axis at home, m.
    pub(super) tool: Vector3<f64>,
    /// Origin of the workpiece frame in the machine frame with every axis at home, m.
    pub(super) workpiece: Vector3<f64>,
    /// Joint indices of X, Y and Z.
    pub(super) linear: [Option<usize>; 3],
    /// Rotary axes from the workpiece to the tool.
    rotations: [Rotation; 2],
    /// Number of joints of the machine.
    pub(super) joints: usize,
}

impl Kinematics {
    /// Creates the kinematics of a machine.
    pub fn new(config: &MachineConfig) -> Self {
        let (axes, geometry) = (config.axes(), config.kinematics());
        let index = |role: AxisRole| axes.iter().position(|axis| role.matches(axis.name(), axis.kind()));
        let with_travel = |role: AxisRole| {
            let index = index(role)?;
            let limits = axes[index].limits();
            Some((index, [limits.travel_min, limits.travel_max]))
        };
        Self {
            tool: Vector3::new(0.0, 0.0, -geometry.tool_length),
            workpiece: Vector3::from(geometry.workpiece),
            linear: AxisRole::LINEAR.map(index),
            rotations: Rotation::of_chain(geometry, with_travel),
            joints: axes.len(),
        }
    }

    /// Returns the kinematics with another tool, from the point moved by X, Y and Z to the tip with every axis at home, m.
    #[must_use]
    pub fn with_tool_length(&self, length: f64) -> Self {
        Self { tool: Vector3::new(0.0, 0.0, -length), ..self.clone() }
    }

    /// Returns true if a joint moves the tool along X, Y or Z.
    pub fn has_linear_axis(&self) -> bool {
        self.linear.iter().any(Option::is_some)
    }

    /// Returns true if a joint rotates the workpiece or the tool.
    pub fn has_rotary_axis(&self) -> bool {
        self.rotary_joints().next().is_some()
    }

    /// Returns the rotary axes, from the workpiece to the tool.
    pub fn rotations(&self) -> &[Rotation; 2] {
        &self.rotations
    }

    /// Returns the indices of the joints that rotate the workpiece or the tool.
    pub fn rotary_joints(&self) -> impl Iterator<Item = usize> + '_ {
        self.rotations.iter().filter_map(Rotation::joint)
    }

    /// Returns the index of the joint with the role, in the order of `joints` of the machine.
    pub fn role(&self, role: AxisRole) -> Option<usize> {
        match AxisRole::LINEAR.iter().position(|linear| *linear == role) {
            Some(coordinate) => self.linear[coordinate],
            None => self.rotations.iter().find(|rotation| rotation.role() == role)?.joint(),
        }
    }

    /// Returns the positions of X, Y and Z, 0 for a missing one.
    pub(super) fn linear_of(&self, joints: &[f64]) -> Vector3<f64> {
        debug_assert_eq!(joints.len(), self.joints, "one value for each joint");
        Vector3::from(self.linear.map(|joint| value(joints, joint)))
    }

    /// Returns the angles of the rotary axes, rad, 0 for a missing one.
    pub(super) fn angles_of(&self, joints: &[f64]) -> [f64; 2] {
        self.rotations.each_ref().map(|rotation| value(joints, rotation.joint()))
    }

    /// Returns the tool pose (forward kinematics). `joints` contains one value per joint of the machine, m or rad.
    pub fn forward(&self, joints: &[f64]) -> ToolPose {
        self.forward_cached(&mut RotaryAngles::default(), joints)
    }

    /// Returns the tool pose, see [`forward`](Self::forward). `angles` caches sines and cosines between calls.
    pub fn forward_cached(&self, angles: &mut RotaryAngles, joints: &[f64]) -> ToolPose {
        let sin_cos = angles.at(self.angles_of(joints));
        ToolPose { tip: self.tip(self.linear_of(joints), &sin_cos), axis: self.tool_axis(&sin_cos) }
    }

    /// Returns the tool axis. Each component has full relative accuracy.
    #[inline(always)]
    pub(super) fn tool_axis(&self, sin_cos: &[(f64, f64); 2]) -> Vector3<f64> {
        let turns = self.rotations.iter().zip(sin_cos).rev();
        turns.fold(Vector3::z(), |axis, (rotation, sin_cos)| rotation.turned(axis, *sin_cos))
    }

    /// Returns the tip in the workpiece frame for X, Y and Z at `linear`, m.
    fn tip(&self, linear: Vector3<f64>, sin_cos: &[(f64, f64); 2]) -> Vector3<f64> {
        let tables = self.rotations.iter().zip(sin_cos).rev().filter(|(rotation, _)| !rotation.is_head());
        let point = linear + self.tool_vector(sin_cos);
        tables.fold(point, |point, (rotation, sin_cos)| rotation.turned_point(point, *sin_cos))
            - self.workpiece
    }

    /// Returns X, Y and Z for a tip in the workpiece frame, m. It is the inverse of [`tip`](Self::tip).
    pub(super) fn linear_joints(&self, tip: Vector3<f64>, sin_cos: &[(f64, f64); 2]) -> Vector3<f64> {
        let tables = self.rotations.iter().zip(sin_cos).filter(|(rotation, _)| !rotation.is_head());
        let point = self.workpiece + tip;
        tables.fold(point, |point, (rotation, sin_cos)| rotation.turned_back(point, *sin_cos))
            - self.tool_vector(sin_cos)
    }

    /// Returns the vector from the point moved by X, Y and Z to the tip, m.
    fn tool_vector(&self, sin_cos: &[(f64, f64); 2]) -> Vector3<f64> {
        let heads = self.rotations.iter().zip(sin_cos).rev().filter(|(rotation, _)| rotation.is_head());
        heads.fold(self.tool, |point, (rotation, sin_cos)| rotation.turned_point(point, *sin_cos))
    }

    /// Returns the orientation of the tool frame in the workpiece frame, the product of the rotations in the order of the
    /// chain, `Rz(c) Rx(a)` with tables C and A. Its Z axis is the tool axis.
    ///
    /// The quaternion is continuous in the joints. A full turn of C negates it, which is the same orientation.
    pub fn orientation(&self, joints: &[f64]) -> UnitQuaternion<f64> {
        let [first, second] = [0, 1].map(|place| {
            let rotation = &self.rotations[place];
            let axis = Unit::new_unchecked(rotation.direction());
            UnitQuaternion::from_axis_angle(&axis, value(joints, rotation.joint()))
        });
        first * second
    }

    /// Converts tool center point (TCP) coordinates to joints, in place: x, y and z from tip coordinates in the workpiece
    /// frame (m) to joint positions; all other joints are unchanged.
    ///
    /// On a machine without one of x, y and z, the tip has the coordinate of the home position there.
    pub fn tip_to_joints(&self, coordinates: &mut [f64]) {
        let mut tip = self.tool - self.workpiece;
        for (coordinate, joint) in tip.iter_mut().zip(self.linear) {
            if joint.is_some() {
                *coordinate = value(coordinates, joint);
            }
        }
        let sin_cos = self.angles_of(coordinates).map(f64::sin_cos);
        let linear = self.linear_joints(tip, &sin_cos);
        self.set_linear(linear, coordinates);
    }

    /// Converts joints to tool center point (TCP) coordinates, in place. It is the inverse of
    /// [`tip_to_joints`](Self::tip_to_joints) on machines with x, y and z, or without rotary axes.
    pub fn joints_to_tip(&self, joints: &mut [f64]) {
        let tip = self.forward(joints).tip;
        self.set_tip(tip, joints);
    }

    /// Sets x, y and z to the coordinates of the tip, m, workpiece frame.
    pub fn set_tip(&self, tip: Vector3<f64>, coordinates: &mut [f64]) {
        self.set_linear(tip, coordinates);
    }

    /// Sets the values of the linear joints.
    pub(super) fn set_linear(&self, values: Vector3<f64>, joints: &mut [f64]) {
        for (value, joint) in values.iter().zip(self.linear) {
            set(joint, *value, joints);
        }
    }

    /// Sets the values of the rotary joints, rad.
    pub(super) fn set_angles(&self, angles: [f64; 2], joints: &mut [f64]) {
        for (angle, rotation) in angles.into_iter().zip(&self.rotations) {
            set(rotation.joint(), angle, joints);
        }
    }
}

/// Returns the value of a joint, 0 if there is none.
fn value(joints: &[f64], joint: Option<usize>) -> f64 {
    joint.and_then(|joint| joints.get(joint)).copied().unwrap_or(0.0)
}

/// Sets the value of a joint, if there is one.
fn set(joint: Option<usize>, value: f64, joints: &mut [f64]) {
    if let Some(joint) = joint.and_then(|joint| joints.get_mut(joint)) {
        *joint = value;
    }
}

/// Angles of the rotary axes with their cached sines and cosines. Most paths move only one of them or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotaryAngles {
    /// Angles in the order of the chain, rad.
    angles: [f64; 2],
    sin_cos: [(f64, f64); 2],
}

impl Default for RotaryAngles {
    /// Returns both angles at 0.
    fn default() -> Self {
        RotaryAngles { angles: [0.0; 2], sin_cos: [(0.0, 1.0); 2] }
    }
}

impl RotaryAngles {
    /// Updates the cache to `angles`, rad, and returns their sines and cosines.
    pub(super) fn at(&mut self, angles: [f64; 2]) -> [(f64, f64); 2] {
        for ((angle, sin_cos), next) in self.angles.iter_mut().zip(&mut self.sin_cos).zip(angles) {
            // The sine of −0 differs from that of 0.
            if angle.to_bits() != next.to_bits() {
                (*angle, *sin_cos) = (next, next.sin_cos());
            }
        }
        self.sin_cos
    }
}
