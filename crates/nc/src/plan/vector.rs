//! Vectors of machine joints and their derivatives along a path.

use virtual_axes_core::config::KinematicsConfig;

use crate::motion::AXIS_COUNT;

/// Largest number of joints of a machine.
pub(super) const MAX_JOINTS: usize = AXIS_COUNT;
/// One value per joint; entries beyond the joints of the machine are 0.
pub(super) type JointVector = [f64; MAX_JOINTS];
/// Value and first three derivatives with respect to the path parameter.
pub(super) type Jet = [JointVector; 4];

/// Returns the Euclidean norm of the values at `indices`.
pub(super) fn norm(vector: &JointVector, indices: &[usize]) -> f64 {
    indices.iter().map(|&i| vector[i] * vector[i]).sum::<f64>().sqrt()
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

fn negative(x: &Scalar) -> Scalar {
    x.map(|value| -value)
}

fn sine_cosine(x: &Scalar) -> (Scalar, Scalar) {
    let (s, c) = x[0].sin_cos();
    let [_, d1, d2, d3] = *x;
    let sine = [s, c * d1, c * d2 - s * d1 * d1, c * d3 - 3.0 * s * d1 * d2 - c * d1 * d1 * d1];
    let cosine = [c, -s * d1, -s * d2 - c * d1 * d1, -s * d3 - 3.0 * c * d1 * d2 + s * d1 * d1 * d1];
    (sine, cosine)
}

/// Transformation of the tool tip into joints for tool center point control.
#[derive(Debug, Clone)]
pub(super) struct TipToJoints {
    geometry: KinematicsConfig,
    /// Joint indices of X, Y, Z.
    linear: [usize; 3],
    /// Joint indices of A and C.
    tables: [Option<usize>; 2],
}

impl TipToJoints {
    pub fn new(geometry: KinematicsConfig, linear: [usize; 3], tables: [Option<usize>; 2]) -> Self {
        Self { geometry, linear, tables }
    }

    /// Converts the tip, in the machine frame with the tables at 0, into positions of X, Y and Z for a tool of `length`,
    /// with three derivatives.
    pub fn apply(&self, coordinates: &mut Jet, length: f64) {
        let of = |index: usize| -> Scalar { std::array::from_fn(|order| coordinates[order][index]) };
        let shifted = |mut x: Scalar, by: f64| {
            x[0] += by;
            x
        };
        let [x, y, z] = self.linear.map(of);
        let angles = self.tables.map(|index| index.map_or([0.0; 4], of));
        let [(sin_a, cos_a), (sin_c, cos_c)] = angles.map(|angle| sine_cosine(&angle));
        let KinematicsConfig { pivot_a, pivot_c, .. } = self.geometry;
        let (x, y) = (shifted(x, -pivot_c[0]), shifted(y, -pivot_c[1]));
        let turned_x = shifted(sum(&product(&cos_c, &x), &product(&sin_c, &y)), pivot_c[0]);
        let turned_y = sum(&product(&cos_c, &y), &negative(&product(&sin_c, &x)));
        let y = shifted(turned_y, pivot_c[1] - pivot_a[0]);
        let z = shifted(z, -pivot_a[1]);
        let tilted_y = shifted(sum(&product(&cos_a, &y), &product(&sin_a, &z)), pivot_a[0]);
        let tilted_z = sum(&product(&cos_a, &z), &negative(&product(&sin_a, &y)));
        let tilted_z = shifted(tilted_z, pivot_a[1] + length);
        for (index, value) in self.linear.into_iter().zip([turned_x, tilted_y, tilted_z]) {
            for (order, derivative) in value.into_iter().enumerate() {
                coordinates[order][index] = derivative;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::Parameters;
    use virtual_axes_core::kinematics::Kinematics;

    #[test]
    fn tip_transform_agrees_with_the_kinematics() {
        let machine = Parameters::embedded_default().unwrap().machine_config().unwrap();
        let geometry = *machine.kinematics();
        let kinematics = Kinematics::new(&machine);
        let transform = TipToJoints::new(geometry, [0, 1, 2], [Some(3), Some(4)]);
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
