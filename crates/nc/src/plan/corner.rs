//! Curves in a corner: arcs, and cubic polynomials like them.

use super::vector::{Jet, JointVector, difference};

/// Circular arc that touches both lines of a corner.
#[derive(Debug, Clone)]
pub(super) struct CornerArc {
    /// Start, and unit tangent and normal there.
    start: JointVector,
    tangent: JointVector,
    normal: JointVector,
    radius: f64,
    /// Angle per unit of the path parameter.
    turn: f64,
}

impl CornerArc {
    /// Creates the arc of `angle` and `radius` from `start` with two unit tangents, over `length` of the path parameter.
    pub fn new(
        start: JointVector,
        tangents: &[JointVector; 2],
        [radius, angle]: [f64; 2],
        length: f64,
    ) -> Self {
        let [tangent, after] = *tangents;
        let (sine, cosine) = angle.sin_cos();
        let normal = std::array::from_fn(|i| (after[i] - cosine * tangent[i]) / sine);
        Self { start, tangent, normal, radius, turn: angle / length }
    }

    /// Returns the coordinates and their derivatives at path parameter `u`.
    pub fn jet(&self, u: f64) -> Jet {
        let (sine, cosine) = (self.turn * u).sin_cos();
        let (r, w) = (self.radius, self.turn);
        let of = |along: f64, across: f64| -> JointVector {
            std::array::from_fn(|i| along * self.tangent[i] + across * self.normal[i])
        };
        let offset = of(r * sine, r * (1.0 - cosine));
        [
            std::array::from_fn(|i| self.start[i] + offset[i]),
            of(r * w * cosine, r * w * sine),
            of(-r * w * w * sine, r * w * w * cosine),
            of(-r * w.powi(3) * cosine, -r * w.powi(3) * sine),
        ]
    }
}

/// Returns the cubic polynomial over `length` between two points with unit tangents, like an arc of `radius` and `angle`.
pub(super) fn cubic_corner(
    points: &[JointVector; 2],
    tangents: &[JointVector; 2],
    [radius, angle]: [f64; 2],
    length: f64,
) -> Jet {
    // Distance of the control points of an arc as a cubic Bézier curve, times 3.
    let reach = 4.0 * (angle / 4.0).tan() * radius;
    let step = difference(&points[1], &points[0]);
    let of = |f: &dyn Fn(usize) -> f64, order: i32| -> JointVector {
        std::array::from_fn(|i| f(i) / length.powi(order))
    };
    let (first, last) = (|i: usize| reach * tangents[0][i], |i: usize| reach * tangents[1][i]);
    [
        points[0],
        of(&first, 1),
        of(&|i| 6.0 * step[i] - 4.0 * first(i) - 2.0 * last(i), 2),
        of(&|i| -12.0 * step[i] + 6.0 * first(i) + 6.0 * last(i), 3),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::vector::MAX_JOINTS;
    use super::*;

    #[test]
    fn a_corner_arc_ends_at_the_second_tangent() {
        let mut tangents = [[0.0; MAX_JOINTS]; 2];
        let angle = 2.0_f64;
        tangents[0][0] = 1.0;
        (tangents[1][0], tangents[1][1]) = (angle.cos(), angle.sin());
        let length = 0.3;
        let arc = CornerArc::new([0.0; MAX_JOINTS], &tangents, [0.1, angle], length);
        let end = arc.jet(length);
        // Both tangents have the length r tan(angle/2) from the corner.
        let reach = 0.1 * (angle / 2.0).tan();
        for i in 0..2 {
            let wanted = reach * (tangents[0][i] + tangents[1][i]);
            assert!((end[0][i] - wanted).abs() < 1e-15);
            assert!((end[1][i] - 0.1 * angle / length * tangents[1][i]).abs() < 1e-14);
        }
        let cubic = cubic_corner(&[[0.0; MAX_JOINTS], end[0]], &tangents, [0.1, angle], length);
        let middle: f64 =
            cubic[1][0] * 0.15 + 0.5 * cubic[2][0] * 0.15_f64.powi(2) + cubic[3][0] * 0.15_f64.powi(3) / 6.0;
        assert!((middle - arc.jet(0.15)[0][0]).abs() < 1e-3);
        let last = |i: usize| {
            cubic[0][i] + length * (cubic[1][i] + length * (0.5 * cubic[2][i] + length * cubic[3][i] / 6.0))
        };
        assert!((last(0) - end[0][0]).abs() < 1e-15 && (last(1) - end[0][1]).abs() < 1e-15);
    }
}
