//! Kinematic chain and forward kinematics: joints to tool pose.

use std::fmt;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::config::{AxisKind, KinematicsConfig, MachineConfig};

/// Pose of the tool in the workpiece frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Tool tip, m.
    pub tip: Vector3<f64>,
    /// Tool axis: unit vector from the tip to the spindle.
    pub axis: Vector3<f64>,
}

/// Role of a joint in the kinematic chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisRole {
    /// Linear axis that moves the tool along X.
    X,
    /// Linear axis that moves the tool along Y.
    Y,
    /// Linear axis that moves the tool along Z.
    Z,
    /// Tilting table that rotates the workpiece about X.
    A,
    /// Rotary table that rotates the workpiece about Z of the tilting table.
    C,
}

impl AxisRole {
    /// Linear roles, in the order of coordinates.
    pub const LINEAR: [AxisRole; 3] = [AxisRole::X, AxisRole::Y, AxisRole::Z];
    /// All roles.
    pub const ALL: [AxisRole; 5] = [AxisRole::X, AxisRole::Y, AxisRole::Z, AxisRole::A, AxisRole::C];

    /// Returns the joint name for the role.
    pub fn name(self) -> &'static str {
        match self {
            AxisRole::X => "x",
            AxisRole::Y => "y",
            AxisRole::Z => "z",
            AxisRole::A => "a",
            AxisRole::C => "c",
        }
    }

    /// Returns the axis type for the role.
    pub fn kind(self) -> AxisKind {
        match self {
            AxisRole::X | AxisRole::Y | AxisRole::Z => AxisKind::Linear,
            AxisRole::A | AxisRole::C => AxisKind::Rotary,
        }
    }

    /// Returns true if a joint of this name and type can have the role; the first such joint of a machine has it.
    pub fn matches(self, name: &str, kind: AxisKind) -> bool {
        kind == self.kind() && name.eq_ignore_ascii_case(self.name())
    }
}

impl fmt::Display for AxisRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Kinematics of a machine; the [module documentation](super) contains the equations.
///
/// Name (`x`, `y`, `z`, `a`, `c`, in upper or lower case) and type of a joint determine its role. A role without joint
/// is fixed at 0; a joint without role does not move the tool.
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
    pub(super) geometry: KinematicsConfig,
    /// Joint index of each role, in the order of [`AxisRole`].
    indices: [Option<usize>; AxisRole::ALL.len()],
    /// Number of joints of the machine.
    pub(super) joints: usize,
    /// Travel limits of A, rad.
    pub(super) travel_a: [f64; 2],
}

impl Kinematics {
    /// Creates the kinematics of a machine.
    pub fn new(config: &MachineConfig) -> Self {
        let axes = config.axes();
        let indices =
            AxisRole::ALL.map(|role| axes.iter().position(|axis| role.matches(axis.name(), axis.kind())));
        let travel_a = indices[AxisRole::A as usize].map(|index| axes[index].limits());
        Self {
            geometry: *config.kinematics(),
            indices,
            joints: axes.len(),
            travel_a: travel_a
                .map_or([f64::NEG_INFINITY, f64::INFINITY], |limits| [limits.travel_min, limits.travel_max]),
        }
    }

    /// Returns true if a joint moves the tool along X, Y or Z.
    pub fn has_linear_axis(&self) -> bool {
        AxisRole::LINEAR.iter().any(|role| self.role(*role).is_some())
    }

    /// Returns true if a joint rotates the workpiece.
    pub fn has_rotary_axis(&self) -> bool {
        self.role(AxisRole::A).is_some() || self.role(AxisRole::C).is_some()
    }

    /// Returns the index of the joint with the role, in the order of `joints` of the machine.
    pub fn role(&self, role: AxisRole) -> Option<usize> {
        self.indices[role as usize]
    }

    /// Returns the value of the joint with the role, 0 if there is none.
    pub(super) fn value(&self, joints: &[f64], role: AxisRole) -> f64 {
        debug_assert_eq!(joints.len(), self.joints, "one value for each joint");
        self.role(role).and_then(|index| joints.get(index)).copied().unwrap_or(0.0)
    }

    fn tables_at(&self, joints: &[f64]) -> Tables<'_> {
        self.tables(self.value(joints, AxisRole::A), self.value(joints, AxisRole::C))
    }

    /// Returns the tables at the angles a and c, rad.
    pub(super) fn tables(&self, a: f64, c: f64) -> Tables<'_> {
        Tables { geometry: &self.geometry, a: a.sin_cos(), c: c.sin_cos() }
    }

    /// Returns the tool pose (forward kinematics). `joints` contains one value per joint of the machine, m or rad.
    pub fn forward(&self, joints: &[f64]) -> ToolPose {
        self.forward_cached(&mut TableAngles::default(), joints)
    }

    /// Returns the tool pose, see [`forward`](Self::forward). `table_angles` caches sines and cosines between calls.
    pub fn forward_cached(&self, table_angles: &mut TableAngles, joints: &[f64]) -> ToolPose {
        let tables = self
            .tables_cached(table_angles, [self.value(joints, AxisRole::A), self.value(joints, AxisRole::C)]);
        let linear = AxisRole::LINEAR.map(|role| self.value(joints, role));
        ToolPose { tip: tables.tip(Vector3::from(linear)), axis: tables.tool_axis() }
    }

    /// Returns the tables at `angles` (rad), and updates the cache.
    #[inline]
    pub(super) fn tables_cached(&self, table_angles: &mut TableAngles, angles: [f64; 2]) -> Tables<'_> {
        table_angles.update(angles);
        let [a, c] = table_angles.sin_cos;
        Tables { geometry: &self.geometry, a, c }
    }

    /// Returns the orientation of the tool frame in the workpiece frame, `Rz(c) Rx(a)`. Its Z axis is the tool axis.
    ///
    /// The quaternion is continuous in the joints. A full turn of C negates it, which is the same orientation.
    pub fn orientation(&self, joints: &[f64]) -> UnitQuaternion<f64> {
        let (sin_a, cos_a) = (0.5 * self.value(joints, AxisRole::A)).sin_cos();
        let (sin_c, cos_c) = (0.5 * self.value(joints, AxisRole::C)).sin_cos();
        UnitQuaternion::new_unchecked(Quaternion::new(
            cos_c * cos_a,
            cos_c * sin_a,
            sin_c * sin_a,
            sin_c * cos_a,
        ))
    }

    /// Converts tool center point (TCP) coordinates to joints, in place: x, y and z from tip coordinates in the workpiece
    /// frame (m) to joint positions; all other joints are unchanged.
    ///
    /// On a machine without one of x, y and z, the tip has the coordinate of the home position there.
    pub fn tip_to_joints(&self, coordinates: &mut [f64]) {
        let home = -self.tool_vector() - Vector3::from(self.geometry.workpiece);
        let mut tip = home;
        for (coordinate, role) in tip.iter_mut().zip(AxisRole::LINEAR) {
            if self.role(role).is_some() {
                *coordinate = self.value(coordinates, role);
            }
        }
        let linear = self.tables_at(coordinates).linear_joints(tip);
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

    /// Sets the values of the joints with linear roles.
    fn set_linear(&self, values: Vector3<f64>, joints: &mut [f64]) {
        for (value, role) in values.iter().zip(AxisRole::LINEAR) {
            self.set(role, *value, joints);
        }
    }

    /// Sets the value of the joint with the role, if there is one.
    pub(super) fn set(&self, role: AxisRole, value: f64, joints: &mut [f64]) {
        if let Some(joint) = self.role(role).and_then(|index| joints.get_mut(index)) {
            *joint = value;
        }
    }

    fn tool_vector(&self) -> Vector3<f64> {
        tool_vector(&self.geometry)
    }
}

/// Returns the vector from the tip to the point moved by X, Y and Z, machine frame, m.
#[inline(always)]
fn tool_vector(geometry: &KinematicsConfig) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, geometry.tool_length)
}

/// Table angles with their cached sines and cosines. Most paths move only one table or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableAngles {
    /// Angles a and c, rad.
    angles: [f64; 2],
    sin_cos: [(f64, f64); 2],
}

impl Default for TableAngles {
    /// Returns both angles at 0.
    fn default() -> Self {
        TableAngles { angles: [0.0; 2], sin_cos: [(0.0, 1.0); 2] }
    }
}

impl TableAngles {
    fn update(&mut self, angles: [f64; 2]) {
        for ((angle, sin_cos), next) in self.angles.iter_mut().zip(&mut self.sin_cos).zip(angles) {
            // The sine of −0 differs from that of 0.
            if angle.to_bits() != next.to_bits() {
                (*angle, *sin_cos) = (next, next.sin_cos());
            }
        }
    }
}

/// Tilting and rotary table at given angles.
pub(super) struct Tables<'a> {
    geometry: &'a KinematicsConfig,
    /// Sine and cosine of a.
    a: (f64, f64),
    /// Sine and cosine of c.
    c: (f64, f64),
}

impl<'a> Tables<'a> {
    /// Returns sine and cosine of a and c.
    pub(super) fn sin_cos(&self) -> [(f64, f64); 2] {
        [self.a, self.c]
    }

    /// Returns the tables at other sines and cosines of a and c.
    #[inline(always)]
    pub(super) fn with_sin_cos(&self, a: (f64, f64), c: (f64, f64)) -> Tables<'a> {
        Tables { geometry: self.geometry, a, c }
    }

    /// Returns the tool axis u = (sin a sin c, −sin a cos c, cos a). Each component has full relative accuracy.
    #[inline(always)]
    pub(super) fn tool_axis(&self) -> Vector3<f64> {
        let ((sin_a, cos_a), (sin_c, cos_c)) = (self.a, self.c);
        Vector3::new(sin_a * sin_c, -sin_a * cos_c, cos_a)
    }

    /// Returns the tip in the workpiece frame for X, Y and Z at `linear`, m.
    #[inline(always)]
    pub(super) fn tip(&self, linear: Vector3<f64>) -> Vector3<f64> {
        let ([pivot_a, pivot_c, workpiece], (sin_a, cos_a), (sin_c, cos_c)) = (self.points(), self.a, self.c);
        let p = linear - tool_vector(self.geometry) - pivot_a;
        let p = Vector3::new(p.x, cos_a * p.y - sin_a * p.z, sin_a * p.y + cos_a * p.z) + pivot_a - pivot_c;
        Vector3::new(cos_c * p.x - sin_c * p.y, sin_c * p.x + cos_c * p.y, p.z) + pivot_c - workpiece
    }

    /// Returns X, Y and Z for a tip in the workpiece frame, m. It is the inverse of [`tip`](Self::tip).
    pub fn linear_joints(&self, tip: Vector3<f64>) -> Vector3<f64> {
        let ([pivot_a, pivot_c, workpiece], (sin_a, cos_a), (sin_c, cos_c)) = (self.points(), self.a, self.c);
        let p = workpiece + tip - pivot_c;
        let p = Vector3::new(cos_c * p.x + sin_c * p.y, cos_c * p.y - sin_c * p.x, p.z) + pivot_c - pivot_a;
        let p = Vector3::new(p.x, cos_a * p.y + sin_a * p.z, cos_a * p.z - sin_a * p.y);
        p + pivot_a + tool_vector(self.geometry)
    }

    /// Returns Pa, Pc and W, m.
    #[inline(always)]
    fn points(&self) -> [Vector3<f64>; 3] {
        let KinematicsConfig { pivot_a, pivot_c, workpiece, .. } = *self.geometry;
        [
            Vector3::new(0.0, pivot_a[0], pivot_a[1]),
            Vector3::new(pivot_c[0], pivot_c[1], 0.0),
            Vector3::from(workpiece),
        ]
    }
}
