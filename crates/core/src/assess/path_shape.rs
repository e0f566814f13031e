//! Tip curve of a path block in the workpiece frame: line, circle or sampled curve.

use nalgebra::Vector3;

use super::curve_cells::CurveCells;
use crate::kinematics::{AxisRole, ToolPose};
use crate::path::{Derivatives, Frame, Path};

/// Largest angle between two samples of a curve, rad, of any joint or of an arc.
const SAMPLE_ANGLE: f64 = 0.05;
const SAMPLES_OF_SPLINE: usize = 256;
/// Largest number of samples of a block.
const MAX_SAMPLES: usize = 4096;
/// Tip displacement below which the tip is fixed, m.
const FIXED_TIP_TOLERANCE: f64 = 1e-9;
/// Tool axis displacement below which the orientation is fixed, rad.
const FIXED_AXIS_TOLERANCE: f64 = 1e-9;
/// Step of difference quotients, as a fraction of the block.
const STEP: f64 = 1e-4;
/// Deviation from unit length attributed to rounding in the vectors of a plane.
const UNIT_TOLERANCE: f64 = 1e-12;

/// Curve of the tool tip along a block.
#[derive(Debug, Clone)]
pub(super) enum TipCurve {
    /// Line: point at s = 0 and derivative with respect to s.
    Segment { from: Vector3<f64>, slope: Vector3<f64>, axis: Vector3<f64> },
    /// Circle in the plane of two unit vectors: angle from the first vector at s = 0, and angle per unit of
    /// s.
    Circle {
        center: Vector3<f64>,
        plane: [Vector3<f64>; 3],
        radius: f64,
        start: f64,
        turn: f64,
        axis: Vector3<f64>,
    },
    /// Other curve: tip samples at equal distances of s, and the linear map from coordinates if the rotary
    /// tables are fixed. Polynomials replace the curve where it is smooth.
    Sampled { samples: Vec<Vector3<f64>>, map: Option<LinearMap>, cells: Option<CurveCells> },
    /// Reorientation with a fixed tip: tool axes at equal distances of s.
    Reorientation { samples: Vec<Vector3<f64>> },
    /// Fixed tip and tool axis.
    Fixed,
}

/// Linear map from the linear coordinates to the tip, and the tool axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearMap {
    columns: [(usize, Vector3<f64>); 3],
    used: usize,
    axis: Vector3<f64>,
}

impl LinearMap {
    fn of(&self, coordinates: &[f64]) -> Vector3<f64> {
        let columns = self.columns[..self.used].iter();
        columns.map(|(index, column)| column * coordinates[*index]).sum()
    }
}

/// Buffers of one evaluation.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    pub joints: Vec<f64>,
    derivatives: Derivatives,
}

impl Scratch {
    pub fn new(joints: usize) -> Self {
        Self { joints: vec![0.0; joints], derivatives: Derivatives::new(joints) }
    }
}

/// Returns the tool pose at arc length `s` of a block.
pub(super) fn pose(path: &Path, block: usize, s: f64, scratch: &mut Scratch) -> ToolPose {
    path.blocks()[block].point(s, &mut scratch.joints);
    let linear = [AxisRole::X, AxisRole::Y, AxisRole::Z].map(|role| path.kinematics().role(role));
    if path.frame() == Frame::Joints {
        return path.kinematics().forward(&scratch.joints);
    }
    let programmed = linear.map(|index| index.map(|index| scratch.joints[index]));
    path.kinematics().tip_to_joints(&mut scratch.joints);
    let mut pose = path.kinematics().forward(&scratch.joints);
    // The tip is the programmed one, without the rounding of the transformation and its inverse.
    for (value, programmed) in pose.tip.iter_mut().zip(programmed) {
        *value = programmed.unwrap_or(*value);
    }
    pose
}

/// Returns the point of the evaluated curve: the tip, or the tool axis while the tip is fixed.
fn curve_point(path: &Path, block: usize, s: f64, turn: bool, scratch: &mut Scratch) -> Vector3<f64> {
    let pose = pose(path, block, s, scratch);
    if turn { pose.axis } else { pose.tip }
}

impl TipCurve {
    pub fn new(path: &Path, block: usize, scratch: &mut Scratch) -> Self {
        let map = path.has_fixed_rotary_axes(block).then(|| linear_map(path, block, scratch));
        if let Some(shape) = map.and_then(|map| closed_form(path, block, &map, scratch)) {
            return shape;
        }
        let length = path.blocks()[block].length();
        let intervals = intervals(path, block);
        let mut tips = Vec::with_capacity(intervals + 1);
        let mut axes = Vec::with_capacity(intervals + 1);
        let cells = CurveCells::new(&path.blocks()[block].knots(), |s| pose(path, block, s, scratch));
        for i in 0..=intervals {
            let s = length * (i as f64 / intervals as f64);
            let pose = match &cells {
                Some(cells) => ToolPose { tip: cells.tip(s), axis: cells.axis(s) },
                None => pose(path, block, s, scratch),
            };
            tips.push(pose.tip);
            axes.push(pose.axis);
        }
        let stays = |samples: &[Vector3<f64>], bound: f64| {
            samples.iter().all(|sample| (sample - samples[0]).norm() <= bound)
        };
        match (stays(&tips, FIXED_TIP_TOLERANCE), stays(&axes, FIXED_AXIS_TOLERANCE)) {
            (false, _) => Self::Sampled { samples: tips, map, cells },
            (true, false) => Self::Reorientation { samples: axes },
            (true, true) => Self::Fixed,
        }
    }

    /// Returns true if the tip moves.
    pub fn is_tip_moving(&self) -> bool {
        !matches!(self, Self::Reorientation { .. } | Self::Fixed)
    }

    /// Returns the polynomials that replace the curve.
    pub fn cells(&self) -> Option<&CurveCells> {
        if let Self::Sampled { cells, .. } = self { cells.as_ref() } else { None }
    }

    /// Returns the tool axis at `s`.
    pub fn axis(&self, path: &Path, block: usize, s: f64, scratch: &mut Scratch) -> Vector3<f64> {
        match self {
            Self::Segment { axis, .. } | Self::Circle { axis, .. } => *axis,
            Self::Sampled { map: Some(map), .. } => map.axis,
            Self::Sampled { cells: Some(cells), .. } => cells.axis(s),
            _ => pose(path, block, s, scratch).axis,
        }
    }

    /// Returns the direction of the tip's motion at `s`, a unit vector, or `None` if the tip is fixed.
    pub fn direction(
        &self,
        path: &Path,
        block: usize,
        s: f64,
        scratch: &mut Scratch,
    ) -> Option<Vector3<f64>> {
        let slope = match self {
            Self::Segment { slope, .. } => *slope,
            Self::Circle { plane, start, turn, .. } => {
                let (sine, cosine) = (start + turn * s).sin_cos();
                (plane[1] * cosine - plane[0] * sine) * *turn
            }
            Self::Sampled { .. } => self.local_derivatives(path, block, s, scratch).1,
            Self::Reorientation { .. } | Self::Fixed => return None,
        };
        slope.try_normalize(0.0)
    }

    /// Returns the point of the evaluated curve and its first and second derivative at `s`.
    pub fn local_derivatives(
        &self,
        path: &Path,
        block: usize,
        s: f64,
        scratch: &mut Scratch,
    ) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        if let Self::Sampled { cells: Some(cells), .. } = self {
            return cells.tip_derivatives(s);
        }
        let turn = !self.is_tip_moving();
        let mut at = |s: f64| curve_point(path, block, s, turn, scratch);
        if let Self::Sampled { map: Some(map), .. } = self {
            let point = at(s);
            path.blocks()[block].derivatives_into(s, &mut scratch.derivatives);
            return (point, map.of(&scratch.derivatives.first), map.of(&scratch.derivatives.second));
        }
        let length = path.blocks()[block].length();
        let h = length * STEP;
        let middle = s.clamp(h, length - h);
        let [a, b, c] = [-h, 0.0, h].map(|step| at(middle + step));
        let point = if middle == s { b } else { at(s) };
        let second = (a - 2.0 * b + c) / (h * h);
        (point, (c - a) / (2.0 * h) + second * (s - middle), second)
    }

    /// Returns the point of the evaluated curve at `s`.
    pub fn point(&self, path: &Path, block: usize, s: f64, scratch: &mut Scratch) -> Vector3<f64> {
        match self {
            Self::Segment { from, slope, .. } => from + slope * s,
            Self::Circle { center, plane, radius, start, turn, .. } => {
                let (sine, cosine) = (start + turn * s).sin_cos();
                center + (plane[0] * cosine + plane[1] * sine) * *radius
            }
            Self::Sampled { cells: Some(cells), .. } => cells.tip(s),
            _ => curve_point(path, block, s, !self.is_tip_moving(), scratch),
        }
    }
}

/// Returns the number of intervals between the samples of a curve.
fn intervals(path: &Path, block: usize) -> usize {
    let block = &path.blocks()[block];
    if !block.is_line() && block.circle().is_none() {
        return SAMPLES_OF_SPLINE;
    }
    let sweep = block.circle().map_or(0.0, |circle| circle.sweep.abs());
    let turned: f64 = path
        .kinematics()
        .rotary_joints()
        .map(|index| (block.end()[index] - block.start()[index]).abs())
        .sum();
    (((sweep + turned) / SAMPLE_ANGLE).ceil() as usize).clamp(2, MAX_SAMPLES)
}

/// Returns the linear map of a block with fixed rotary tables.
fn linear_map(path: &Path, block: usize, scratch: &mut Scratch) -> LinearMap {
    let (kinematics, start) = (path.kinematics(), path.blocks()[block].start());
    let mut coordinates = start.to_vec();
    let mut columns = [(0, Vector3::zeros()); 3];
    let mut used = 0;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for (role, unit) in [AxisRole::X, AxisRole::Y, AxisRole::Z].into_iter().zip(axes) {
        let Some(index) = kinematics.role(role) else { continue };
        let column = if path.frame() == Frame::Workpiece {
            unit
        } else {
            // The map is linear; one meter on either side of 0 minimizes rounding.
            let mut tip = |value: f64| {
                coordinates.fill(0.0);
                for joint in kinematics.rotary_joints() {
                    coordinates[joint] = start[joint];
                }
                coordinates[index] = value;
                kinematics.forward(&coordinates).tip
            };
            (tip(1.0) - tip(-1.0)) * 0.5
        };
        columns[used] = (index, column);
        used += 1;
    }
    LinearMap { columns, used, axis: pose(path, block, 0.0, scratch).axis }
}

/// Returns the line or circle of the tip, if it is one.
fn closed_form(path: &Path, block: usize, map: &LinearMap, scratch: &mut Scratch) -> Option<TipCurve> {
    let index = block;
    let block = &path.blocks()[index];
    let from = pose(path, index, 0.0, scratch).tip;
    let axis = map.axis;
    let slope = map.of(&block.derivatives(0.0).first);
    if block.is_line() {
        return (slope.norm() > 0.0).then_some(TipCurve::Segment { from, slope, axis });
    }
    let circle = block.circle()?;
    let vectors = circle.plane.map(|index| {
        let mut unit = vec![0.0; block.joints()];
        unit[index] = 1.0;
        map.of(&unit)
    });
    let units = vectors.iter().all(|vector| (vector.norm() - 1.0).abs() < UNIT_TOLERANCE);
    let others = (0..block.joints()).filter(|index| !circle.plane.contains(index));
    if !units || !block.is_constant(others) {
        return None;
    }
    let radius_vector = [0, 1].map(|i| block.start()[circle.plane[i]] - circle.center[i]);
    let center = if path.frame() == Frame::Workpiece {
        from - vectors[0] * radius_vector[0] - vectors[1] * radius_vector[1]
    } else {
        scratch.joints.copy_from_slice(block.start());
        for i in 0..2 {
            scratch.joints[circle.plane[i]] = circle.center[i];
        }
        path.kinematics().forward(&scratch.joints).tip
    };
    let plane = [vectors[0], vectors[1], vectors[0].cross(&vectors[1])];
    let (start, turn) = (radius_vector[1].atan2(radius_vector[0]), circle.sweep / block.length());
    Some(TipCurve::Circle { center, plane, radius: circle.radius, start, turn, axis })
}

/// Returns the coordinates of a tip in the frame of a circle, and its distance from the circle's axis.
pub(super) fn circle_coordinates(
    tip: Vector3<f64>,
    center: Vector3<f64>,
    plane: &[Vector3<f64>; 3],
) -> ([f64; 3], f64) {
    let out = tip - center;
    let [x, y, z] = plane.map(|vector| vector.dot(&out));
    ([x, y, z], (x * x + y * y).sqrt())
}

/// Returns the distance from a circle of a point at distance `off` from its axis and `z` from its plane.
pub(super) fn distance_to_circle(off: f64, z: f64, radius: f64) -> f64 {
    let outside = off - radius;
    (outside * outside + z * z).sqrt()
}

/// Returns the first of s, s + period, … between `low` and `high` that is not before `ahead`, or else the
/// last of them in the range.
pub(super) fn select_passage(s: f64, period: f64, low: f64, high: f64, ahead: f64) -> Option<f64> {
    let first_from = |bound: f64| s + ((bound - s) / period).ceil().max(0.0) * period;
    let next = first_from(low.max(ahead));
    let index = if next <= high { next } else { s + ((high - s) / period).floor() * period };
    (low..=high).contains(&index).then_some(index)
}
