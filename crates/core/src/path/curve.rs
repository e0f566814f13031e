//! Derivatives of the joint positions with respect to the arc length of a block.

use super::block::Block;
use super::derivatives::Derivatives;
use super::geometry::{Frame, Path};

/// Step of the difference quotients, as a fraction of the smooth piece that contains them: with five points
/// the error is below 10⁻⁴ of the third derivative where a piece turns by up to a quarter radian.
const STEP: f64 = 1.0 / 200.0;

/// Method for the derivatives of a block's joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DerivativeMethod {
    /// The coordinates are the joints.
    Direct,
    /// The rotary tables are fixed: joints are rotated and translated coordinates.
    Rotated,
    /// Five-point difference quotients through the inverse kinematics.
    Differences,
}

/// Derivatives along one block, with buffers.
#[derive(Debug)]
pub(super) struct JointCurve<'a> {
    path: &'a Path,
    block: usize,
    method: DerivativeMethod,
    points: [Vec<f64>; 5],
}

impl<'a> JointCurve<'a> {
    pub fn new(path: &'a Path, block: usize) -> Self {
        let method = match path.frame() {
            Frame::Joints => DerivativeMethod::Direct,
            Frame::Workpiece if path.has_fixed_rotary_axes(block) => DerivativeMethod::Rotated,
            Frame::Workpiece => DerivativeMethod::Differences,
        };
        let joints = path.joint_count();
        Self { path, block, method, points: std::array::from_fn(|_| vec![0.0; joints]) }
    }

    pub fn block(&self) -> &'a Block {
        &self.path.blocks()[self.block]
    }

    /// Returns true if the joints move along a straight line.
    pub fn is_straight(&self) -> bool {
        self.method != DerivativeMethod::Differences && self.block().is_line()
    }

    /// Returns true if the rotary tables move along a workpiece path.
    pub fn has_moving_tables(&self) -> bool {
        self.method == DerivativeMethod::Differences
    }

    /// Computes the derivatives at `s` in the smooth piece from `piece.0` to `piece.1`.
    pub fn derivatives(&mut self, s: f64, piece: (f64, f64), out: &mut Derivatives) {
        // At a piece boundary the third derivative is that of this piece.
        let inside = s.clamp(piece.0, piece.1.next_down().max(piece.0));
        match self.method {
            DerivativeMethod::Direct => self.block().derivatives_into(inside, out),
            DerivativeMethod::Rotated => {
                self.block().derivatives_into(inside, out);
                for order in [&mut out.first, &mut out.second, &mut out.third] {
                    self.rotate(order);
                }
            }
            DerivativeMethod::Differences => self.differences(s, piece, out),
        }
    }

    /// Rotates a vector of coordinates into joint space: the difference of two transformed points.
    fn rotate(&mut self, vector: &mut [f64]) {
        let [origin, tip, ..] = &mut self.points;
        origin.copy_from_slice(self.path.blocks()[self.block].start());
        tip.copy_from_slice(origin);
        let kinematics = self.path.kinematics();
        for (value, step) in tip.iter_mut().zip(vector.iter()) {
            *value += step;
        }
        kinematics.tip_to_joints(origin);
        kinematics.tip_to_joints(tip);
        for ((step, tip), origin) in vector.iter_mut().zip(tip.iter()).zip(origin.iter()) {
            *step = tip - origin;
        }
    }

    /// Computes the derivatives of the quartic through five equidistant points at `s`, which may be off
    /// their middle.
    fn differences(&mut self, s: f64, piece: (f64, f64), out: &mut Derivatives) {
        let h = (piece.1 - piece.0) * STEP;
        let middle = s.clamp(piece.0 + 2.0 * h, piece.1 - 2.0 * h);
        for (i, point) in self.points.iter_mut().enumerate() {
            let at = middle + (i as f64 - 2.0) * h;
            self.path.joints_in(self.block, at.clamp(piece.0, piece.1), point);
        }
        let [a, b, c, d, e] = &self.points;
        let x = s - middle;
        for i in 0..c.len() {
            let (a, b, c, d, e) = (a[i] - c[i], b[i] - c[i], 0.0, d[i] - c[i], e[i] - c[i]);
            let first = (a - 8.0 * b + 8.0 * d - e) / (12.0 * h);
            let second = (-a + 16.0 * b - 30.0 * c + 16.0 * d - e) / (12.0 * h * h);
            let third = (-a + 2.0 * b - 2.0 * d + e) / (2.0 * h * h * h);
            let fourth = (a - 4.0 * b + 6.0 * c - 4.0 * d + e) / (h * h * h * h);
            out.first[i] = first + x * (second + x * (third / 2.0 + x * fourth / 6.0));
            out.second[i] = second + x * (third + x * fourth / 2.0);
            out.third[i] = third + x * fourth;
        }
    }
}
