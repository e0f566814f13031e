//! Vectors of machine joints and their derivatives along a path.

use virtual_axes_core::kinematics::Rotation;

use crate::motion::AXIS_COUNT;

/// Largest number of joints of a machine.
pub(super) const MAX_JOINTS: usize = AXIS_COUNT;
/// One value per joint; entries beyond the joints of the machine are 0.
pub(super) type JointVector = [f64; MAX_JOINTS];
/// Value and first three derivatives with respect to the path parameter.
pub(super) type Jet = [JointVector; 4];

/// Returns the Euclidean norm of the values at `indices`.
pub(super) fn norm(vector: &JointVector, indices: &[usize]) -> f64 {
    // Not `sum`, which is -0 without indices.
    indices.iter().map(|&i| vector[i] * vector[i]).fold(0.0, |sum, square| sum + square).sqrt()
}

/// Length that counts for one radian of a rotary axis in the path parameter, m.
const ROTARY_LENGTH: f64 = 0.1;

/// Joints by kind of movement.
#[derive(Debug, Clone, Default)]
pub(super) struct JointKinds {
    pub linear: Vec<usize>,
    pub rotary: Vec<usize>,
}

impl JointKinds {
    /// Returns the length of a step in the metric of the path parameter.
    pub fn length(&self, step: &JointVector) -> f64 {
        norm(step, &self.linear).hypot(ROTARY_LENGTH * norm(step, &self.rotary))
    }
}

/// Returns `a − b`.
pub(super) fn difference(a: &JointVector, b: &JointVector) -> JointVector {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Returns `a + (b − a) · t`, exact at both ends.
pub(super) fn mix(a: &JointVector, b: &JointVector, t: f64) -> JointVector {
    std::array::from_fn(|i| if t == 1.0 { b[i] } else { a[i] + (b[i] - a[i]) * t })
}

/// Value and derivatives of one scalar.
type Scalar = [f64; 4];

fn product(x: &Scalar, y: &Scalar) -> Scalar {
    [
        x[0] * y[0],
        x[1] * y[0] + x[0] * y[1],
        x[2] * y[0] + 2.0 * x[1] * y[1] + x[0] * y[2],
        x[3] * y[0] + 3.0 * (x[2] * y[1] + x[1] * y[2]) + x[0] * y[3],
    ]
}

fn sum(x: &Scalar, y: &Scalar) -> Scalar {
    std::array::from_fn(|i| x[i] + y[i])
}

fn sine_cosine(x: &Scalar) -> (Scalar, Scalar) {
    let (s, c) = x[0].sin_cos();
    let [_, d1, d2, d3] = *x;
    let sine = [s, c * d1, c * d2 - s * d1 * d1, c * d3 - 3.0 * s * d1 * d2 - c * d1 * d1 * d1];
    let cosine = [c, -s * d1, -s * d2 - c * d1 * d1, -s * d3 - 3.0 * c * d1 * d2 + s * d1 * d1 * d1];
    (sine, cosine)
}

/// Rotates a point about the pivot of a rotary axis by an angle.
fn turn(point: &mut [Scalar; 3], rotation: &Rotation, angle: &Scalar) {
    let ((sine, cosine), [i, j]) = (sine_cosine(angle), rotation.plane());
    let offset = |point: &mut [Scalar; 3], factor: f64| {
        for k in [i, j] {
            point[k][0] += factor * rotation.pivot()[k];
        }
    };
    offset(point, -1.0);
    let (u, v) = (point[i], point[j]);
    point[i] = sum(&product(&cosine, &u), &product(&sine.map(|value| -value), &v));
    point[j] = sum(&product(&cosine, &v), &product(&sine, &u));
    offset(point, 1.0);
}

/// Transformation of the tool tip into joints for tool center point control.
#[derive(Debug, Clone)]
pub(super) struct TipToJoints {
    rotations: [Rotation; 2],
    /// Joint indices of X, Y, Z.
    linear: [usize; 3],
}

impl TipToJoints {
    pub fn new(rotations: [Rotation; 2], linear: [usize; 3]) -> Self {
        Self { rotations, linear }
    }

    /// Converts the tip, in the machine frame with the tables at 0, into positions of X, Y and Z for a tool of `length`,
    /// with three derivatives.
    pub fn apply(&self, coordinates: &mut Jet, length: f64) {
        let of = |index: usize| -> Scalar { std::array::from_fn(|order| coordinates[order][index]) };
        let angles = self.rotations.each_ref().map(|rotation| rotation.joint().map_or([0.0; 4], of));
        let mut tip = self.linear.map(of);
        let mut tool = [[0.0; 4]; 3];
        tool[2][0] = -length;
        for (rotation, angle) in
            self.rotations.iter().zip(&angles).filter(|(rotation, _)| !rotation.is_head())
        {
            turn(&mut tip, rotation, &angle.map(|value| -value));
        }
        for (rotation, angle) in
            self.rotations.iter().zip(&angles).rev().filter(|(rotation, _)| rotation.is_head())
        {
            turn(&mut tool, rotation, angle);
        }
        for (index, (tip, tool)) in self.linear.into_iter().zip(tip.into_iter().zip(tool)) {
            for order in 0..tip.len() {
                coordinates[order][index] = tip[order] - tool[order];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::{MachineConfig, Parameters};
    use virtual_axes_core::kinematics::Kinematics;

    #[test]
    fn no_joints_turn_at_no_rate() {
        let rate = norm(&[1.0; MAX_JOINTS], &[]);
        assert!(rate == 0.0 && rate.is_sign_positive(), "{rate}");
    }

    #[test]
    fn tip_transform_agrees_with_the_kinematics() {
        for name in ["mikron_ucp710", "bc_center", "ac_center", "vmc_a", "fork_head"] {
            let machine =
                Parameters::load(name, virtual_axes_builtin::MACHINES).unwrap().machine_config().unwrap();
            agrees_with_the_kinematics(&machine);
        }
    }

    fn agrees_with_the_kinematics(machine: &MachineConfig) {
        let geometry = *machine.kinematics();
        let kinematics = Kinematics::new(machine);
        let transform = TipToJoints::new(*kinematics.rotations(), [0, 1, 2]);
        let at = |u: f64| {
            let mut jet = [[0.0; MAX_JOINTS]; 4];
            let values = [0.05 + 0.3 * u, -0.02 + 0.1 * u * u, 0.1 - 0.2 * u, 0.4 + u, -1.0 + 2.0 * u * u];
            let first = [0.3, 0.2 * u, -0.2, 1.0, 4.0 * u];
            let second = [0.0, 0.2, 0.0, 0.0, 4.0];
            jet[0][..5].copy_from_slice(&values);
            jet[1][..5].copy_from_slice(&first);
            jet[2][..5].copy_from_slice(&second);
            jet
        };
        let u = 0.3;
        let mut jet = at(u);
        let mut expected: Vec<f64> = jet[0][..5].to_vec();
        for (i, value) in expected[..3].iter_mut().enumerate() {
            *value -= geometry.workpiece[i];
        }
        kinematics.tip_to_joints(&mut expected);
        transform.apply(&mut jet, geometry.tool_length);
        for (found, expected) in jet[0].iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-14);
        }
        // Central differences of each derivative.
        let h = 1e-5;
        let [mut before, mut after] = [at(u - h), at(u + h)];
        transform.apply(&mut before, geometry.tool_length);
        transform.apply(&mut after, geometry.tool_length);
        for order in 0..3 {
            for joint in 0..5 {
                let slope = (after[order][joint] - before[order][joint]) / (2.0 * h);
                assert!((slope - jet[order + 1][joint]).abs() < 1e-7, "order {order}, joint {joint}");
            }
        }
    }
}
