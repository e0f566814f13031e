//! The chain: roles of the joints, the tables, joints to tool pose.

use std::fmt;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::config::{AxisConfig, AxisKind, KinematicsConfig, MachineConfig};

/// Pose of the tool in the workpiece frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Tool tip, m.
    pub tip: Vector3<f64>,
    /// Direction from the tip to the spindle, a unit vector.
    pub axis: Vector3<f64>,
}

/// What a joint does in the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Moves the tool along X.
    X,
    /// Moves the tool along Y.
    Y,
    /// Moves the tool along Z.
    Z,
    /// Turns the workpiece about X.
    A,
    /// Turns the workpiece about Z of the table.
    C,
}

impl Role {
    /// The linear ones, in the order of coordinates.
    pub const LINEAR: [Role; 3] = [Role::X, Role::Y, Role::Z];
    /// All of them.
    pub const ALL: [Role; 5] = [Role::X, Role::Y, Role::Z, Role::A, Role::C];

    /// Name of a joint that has the role.
    pub fn name(self) -> &'static str {
        match self {
            Role::X => "x",
            Role::Y => "y",
            Role::Z => "z",
            Role::A => "a",
            Role::C => "c",
        }
    }

    /// The kind that the joint must have.
    pub fn kind(self) -> AxisKind {
        match self {
            Role::X | Role::Y | Role::Z => AxisKind::Linear,
            Role::A | Role::C => AxisKind::Rotary,
        }
    }

    fn fits(self, axis: &AxisConfig) -> bool {
        axis.kind() == self.kind() && axis.name().eq_ignore_ascii_case(self.name())
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Kinematics of one machine; see the [room](super) for the equations.
///
/// A joint has a role by its name (`x`, `y`, `z`, `a`, `c`, upper or lower case) and its kind. A role
/// that no joint has is held at 0; a joint without a role does not move the tool.
///
/// ```
/// use virtual_axes::config::Parameters;
/// use virtual_axes::kinematics::Kinematics;
///
/// let kinematics = Kinematics::new(&Parameters::embedded_default()?.machine_config()?);
/// // x, y, z in m, a = 90°, c = 0: the tool lies along −Y of the workpiece.
/// let pose = kinematics.forward(&[0.0, 0.0, 0.1, std::f64::consts::FRAC_PI_2, 0.0]);
/// assert!((pose.axis.y + 1.0).abs() < 1e-15 && pose.tip.norm() < 1e-15);
/// # Ok::<(), virtual_axes::config::ConfigError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Kinematics {
    pub(super) geometry: KinematicsConfig,
    /// Place of the joint of each role, in the order of [`Role`].
    places: [Option<usize>; Role::ALL.len()],
    /// Joints of the machine.
    pub(super) joints: usize,
    /// Stroke of A, rad.
    pub(super) stroke_a: [f64; 2],
}

impl Kinematics {
    /// The kinematics of a machine.
    pub fn new(config: &MachineConfig) -> Self {
        let axes = config.axes();
        let places = Role::ALL.map(|role| axes.iter().position(|axis| role.fits(axis)));
        let stroke_a = places[Role::A as usize].map(|place| axes[place].limits());
        Self {
            geometry: *config.kinematics(),
            places,
            joints: axes.len(),
            stroke_a: stroke_a
                .map_or([f64::NEG_INFINITY, f64::INFINITY], |limits| [limits.travel_min, limits.travel_max]),
        }
    }

    /// Whether a joint moves the tool tip along X, Y or Z.
    pub fn has_linear_axis(&self) -> bool {
        Role::LINEAR.iter().any(|role| self.role(*role).is_some())
    }

    /// Whether a joint turns the tool relative to the workpiece.
    pub fn has_rotary_axis(&self) -> bool {
        self.role(Role::A).is_some() || self.role(Role::C).is_some()
    }

    /// Place of the joint that has the role, in the order of the machine's `joints`.
    pub fn role(&self, role: Role) -> Option<usize> {
        self.places[role as usize]
    }

    /// Value of the joint that has the role, 0 where there is none.
    pub(super) fn value(&self, joints: &[f64], role: Role) -> f64 {
        debug_assert_eq!(joints.len(), self.joints, "one value for each joint");
        self.role(role).and_then(|place| joints.get(place)).copied().unwrap_or(0.0)
    }

    fn tables_at(&self, joints: &[f64]) -> Tables<'_> {
        self.tables(self.value(joints, Role::A), self.value(joints, Role::C))
    }

    /// The tables at a and c, rad.
    pub(super) fn tables(&self, a: f64, c: f64) -> Tables<'_> {
        Tables { geometry: &self.geometry, a: a.sin_cos(), c: c.sin_cos() }
    }

    /// Pose of the tool at these joints: one value for each joint of the machine, m or rad.
    pub fn forward(&self, joints: &[f64]) -> ToolPose {
        self.forward_from(&mut Turned::default(), joints)
    }

    /// As [`forward`](Self::forward), for poses that follow each other: `turned` is where the tables stood.
    pub fn forward_from(&self, turned: &mut Turned, joints: &[f64]) -> ToolPose {
        let tables = self.turned(turned, [self.value(joints, Role::A), self.value(joints, Role::C)]);
        let linear = Role::LINEAR.map(|role| self.value(joints, role));
        ToolPose { tip: tables.tip(Vector3::from(linear)), axis: tables.tool_axis() }
    }

    /// The tables at `angles`, rad.
    #[inline]
    pub(super) fn turned(&self, turned: &mut Turned, angles: [f64; 2]) -> Tables<'_> {
        turned.turn_to(angles);
        let [a, c] = turned.sin_cos;
        Tables { geometry: &self.geometry, a, c }
    }

    /// Orientation of the tool frame in the workpiece frame, `Rz(c) Rx(a)`; its Z axis is the tool axis.
    ///
    /// It is continuous in the joints, also over whole turns of C: after one it is the opposite quaternion,
    /// which is the same orientation.
    pub fn orientation(&self, joints: &[f64]) -> UnitQuaternion<f64> {
        let (sin_a, cos_a) = (0.5 * self.value(joints, Role::A)).sin_cos();
        let (sin_c, cos_c) = (0.5 * self.value(joints, Role::C)).sin_cos();
        UnitQuaternion::new_unchecked(Quaternion::new(
            cos_c * cos_a,
            cos_c * sin_a,
            sin_c * sin_a,
            sin_c * cos_a,
        ))
    }

    /// Tool-center-point programming: `coordinates` holds for each joint its value, but for x, y and z
    /// the tip's coordinates in the workpiece frame, m; they are turned into joints in place. A and C
    /// are joints in both.
    ///
    /// On a machine that lacks one of x, y and z the tip has there the coordinate of home.
    pub fn tip_to_joints(&self, coordinates: &mut [f64]) {
        let home = -self.tool_vector() - Vector3::from(self.geometry.workpiece);
        let mut tip = home;
        for (coordinate, role) in tip.iter_mut().zip(Role::LINEAR) {
            if self.role(role).is_some() {
                *coordinate = self.value(coordinates, role);
            }
        }
        let linear = self.tables_at(coordinates).linear_joints(tip);
        self.put_linear(linear, coordinates);
    }

    /// Tip coordinates instead of x, y and z: the inverse of [`tip_to_joints`](Self::tip_to_joints) on
    /// machines that have all three, or no rotary axis.
    pub fn joints_to_tip(&self, joints: &mut [f64]) {
        let tip = self.forward(joints).tip;
        self.put_tip(tip, joints);
    }

    /// Writes the coordinates of the tip (m, workpiece frame) in the place of x, y and z.
    pub fn put_tip(&self, tip: Vector3<f64>, coordinates: &mut [f64]) {
        self.put_linear(tip, coordinates);
    }

    /// Writes the coordinates of those linear roles that joints have.
    fn put_linear(&self, values: Vector3<f64>, joints: &mut [f64]) {
        for (value, role) in values.iter().zip(Role::LINEAR) {
            self.put(role, *value, joints);
        }
    }

    /// Writes the value of the joint that has the role, if one has.
    pub(super) fn put(&self, role: Role, value: f64, joints: &mut [f64]) {
        if let Some(joint) = self.role(role).and_then(|place| joints.get_mut(place)) {
            *joint = value;
        }
    }

    fn tool_vector(&self) -> Vector3<f64> {
        tool_vector(&self.geometry)
    }
}

/// From the tip to the point that X, Y and Z move, machine frame, m.
fn tool_vector(geometry: &KinematicsConfig) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, geometry.tool_length)
}

/// Where the tables stand, with what is reckoned from it: most paths turn one of them or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turned {
    /// a and c, rad.
    angles: [f64; 2],
    sin_cos: [(f64, f64); 2],
}

impl Default for Turned {
    /// Both at 0.
    fn default() -> Self {
        Turned { angles: [0.0; 2], sin_cos: [(0.0, 1.0); 2] }
    }
}

impl Turned {
    fn turn_to(&mut self, angles: [f64; 2]) {
        for ((angle, sin_cos), next) in self.angles.iter_mut().zip(&mut self.sin_cos).zip(angles) {
            // −0 has another sine than 0.
            if angle.to_bits() != next.to_bits() {
                (*angle, *sin_cos) = (next, next.sin_cos());
            }
        }
    }
}

/// Both tables at one pair of angles.
pub(super) struct Tables<'a> {
    geometry: &'a KinematicsConfig,
    /// Sine and cosine of a.
    a: (f64, f64),
    /// Sine and cosine of c.
    c: (f64, f64),
}

impl Tables<'_> {
    /// u = (sin a sin c, −sin a cos c, cos a); each component with its own relative accuracy.
    #[inline]
    pub(super) fn tool_axis(&self) -> Vector3<f64> {
        let ((sin_a, cos_a), (sin_c, cos_c)) = (self.a, self.c);
        Vector3::new(sin_a * sin_c, -sin_a * cos_c, cos_a)
    }

    /// Tip in the workpiece frame with X, Y and Z at `linear`, m.
    #[inline]
    pub(super) fn tip(&self, linear: Vector3<f64>) -> Vector3<f64> {
        let ([pivot_a, pivot_c, workpiece], (sin_a, cos_a), (sin_c, cos_c)) = (self.points(), self.a, self.c);
        let p = linear - tool_vector(self.geometry) - pivot_a;
        let p = Vector3::new(p.x, cos_a * p.y - sin_a * p.z, sin_a * p.y + cos_a * p.z) + pivot_a - pivot_c;
        Vector3::new(cos_c * p.x - sin_c * p.y, sin_c * p.x + cos_c * p.y, p.z) + pivot_c - workpiece
    }

    /// X, Y and Z with the tip there in the workpiece frame, m: the inverse of [`tip`](Self::tip).
    pub fn linear_joints(&self, tip: Vector3<f64>) -> Vector3<f64> {
        let ([pivot_a, pivot_c, workpiece], (sin_a, cos_a), (sin_c, cos_c)) = (self.points(), self.a, self.c);
        let p = workpiece + tip - pivot_c;
        let p = Vector3::new(cos_c * p.x + sin_c * p.y, cos_c * p.y - sin_c * p.x, p.z) + pivot_c - pivot_a;
        let p = Vector3::new(p.x, cos_a * p.y + sin_a * p.z, cos_a * p.z - sin_a * p.y);
        p + pivot_a + tool_vector(self.geometry)
    }

    /// Pa, Pc and W.
    fn points(&self) -> [Vector3<f64>; 3] {
        let KinematicsConfig { pivot_a, pivot_c, workpiece, .. } = *self.geometry;
        [
            Vector3::new(0.0, pivot_a[0], pivot_a[1]),
            Vector3::new(pivot_c[0], pivot_c[1], 0.0),
            Vector3::from(workpiece),
        ]
    }
}
