//! A path as a curve of the joints: derivatives of these with respect to the length of a block.

use super::block::{Block, Derivatives};
use super::route::{Frame, Path};

/// Step of the difference quotients, as a part of the smooth piece that they stay in: with five points
/// their error is below 10⁻⁴ of the third derivative where a piece turns by up to a quarter radian.
const STEP: f64 = 1.0 / 200.0;

/// How derivatives of a block's joints are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Means {
    /// The coordinates are the joints.
    Direct,
    /// The tables stand still: joints are coordinates turned and displaced.
    Turned,
    /// Five-point difference quotients through the kinematics.
    Differences,
}

/// Finds derivatives along one block, with room for it.
#[derive(Debug)]
pub(super) struct JointCurve<'a> {
    path: &'a Path,
    block: usize,
    means: Means,
    points: [Vec<f64>; 5],
}

impl<'a> JointCurve<'a> {
    pub fn new(path: &'a Path, block: usize) -> Self {
        let means = match path.frame() {
            Frame::Joints => Means::Direct,
            Frame::Workpiece if path.keeps_tables(block) => Means::Turned,
            Frame::Workpiece => Means::Differences,
        };
        let joints = path.joint_count();
        Self { path, block, means, points: std::array::from_fn(|_| vec![0.0; joints]) }
    }

    pub fn block(&self) -> &'a Block {
        &self.path.blocks()[self.block]
    }

    /// Whether the joints run along a straight line.
    pub fn is_straight(&self) -> bool {
        self.means != Means::Differences && self.block().is_line()
    }

    /// Whether the tables move under a path of the tip.
    pub fn is_bent(&self) -> bool {
        self.means == Means::Differences
    }

    /// Derivatives at `s` in the smooth piece from `piece.0` to `piece.1`.
    pub fn derivatives(&mut self, s: f64, piece: (f64, f64), out: &mut Derivatives) {
        // At a border of pieces the third derivative is that of this piece.
        let inside = s.clamp(piece.0, piece.1.next_down().max(piece.0));
        match self.means {
            Means::Direct => self.block().derivatives_into(inside, out),
            Means::Turned => {
                self.block().derivatives_into(inside, out);
                for order in [&mut out.first, &mut out.second, &mut out.third] {
                    self.turn(order);
                }
            }
            Means::Differences => self.differences(s, piece, out),
        }
    }

    /// Turns a vector of coordinates into one of joints: the difference of two points.
    fn turn(&mut self, vector: &mut [f64]) {
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

    /// Derivatives of the quartic through five equidistant points, moved from its middle to `s`.
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
