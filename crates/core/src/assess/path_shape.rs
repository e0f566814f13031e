//! A block of a path as the tool sees it: the curve of its tip in the workpiece frame.

use nalgebra::Vector3;

use crate::kinematics::{Role, ToolPose};
use crate::path::{Derivatives, Frame, Path};

/// Largest change between two samples of a curve that is not a line or a circle: rad of any joint or of
/// the circle; parts of a polynomial piece.
const SAMPLE_TURN: f64 = 0.05;
const SAMPLES_OF_SPLINE: usize = 256;
/// Most samples of a block.
const MAX_SAMPLES: usize = 4096;
/// A tip that moves less than that, m, stands still.
const STILL: f64 = 1e-9;
/// An axis that turns less than that, rad, stands still.
const STILL_AXIS: f64 = 1e-9;
/// Step of difference quotients, as a part of the block.
const STEP: f64 = 1e-4;
/// Deviation of a plane's vectors from unit length that is rounding.
const UNIT_TOLERANCE: f64 = 1e-12;

/// A block of a path as the tool sees it.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    /// Straight: point at s = 0 and change per unit of s.
    Segment { from: Vector3<f64>, slope: Vector3<f64>, axis: Vector3<f64> },
    /// In the plane of two unit vectors: angle from the first at s = 0, and per unit of s.
    Circle {
        center: Vector3<f64>,
        plane: [Vector3<f64>; 3],
        radius: f64,
        start: f64,
        turn: f64,
        axis: Vector3<f64>,
    },
    /// Anything else: tips at equal distances of s; the linear map from coordinates where the tables
    /// stand still.
    Curve { samples: Vec<Vector3<f64>>, map: Option<LinearMap> },
    /// The tip stands still while the tool axis turns: tool axes at equal distances of s.
    Turn { samples: Vec<Vector3<f64>> },
    /// Neither tip nor tool axis moves.
    Still,
}

/// Change of the tip with the three linear coordinates, and the tool axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearMap {
    columns: [(usize, Vector3<f64>); 3],
    used: usize,
    axis: Vector3<f64>,
}

impl LinearMap {
    fn of(&self, coordinates: &[f64]) -> Vector3<f64> {
        let columns = self.columns[..self.used].iter();
        columns.map(|(place, column)| column * coordinates[*place]).sum()
    }
}

/// Room for one evaluation.
#[derive(Debug, Clone)]
pub(super) struct Room {
    pub joints: Vec<f64>,
    derivatives: Derivatives,
}

impl Room {
    pub fn new(joints: usize) -> Self {
        Self { joints: vec![0.0; joints], derivatives: Derivatives::new(joints) }
    }
}

/// Pose of the tool at the length `s` of a block.
pub(super) fn pose(path: &Path, block: usize, s: f64, room: &mut Room) -> ToolPose {
    path.blocks()[block].point(s, &mut room.joints);
    let linear = [Role::X, Role::Y, Role::Z].map(|role| path.kinematics().role(role));
    if path.frame() == Frame::Joints {
        return path.kinematics().forward(&room.joints);
    }
    let programmed = linear.map(|place| place.map(|place| room.joints[place]));
    path.kinematics().tip_to_joints(&mut room.joints);
    let mut pose = path.kinematics().forward(&room.joints);
    // The tip is where it was programmed, without the rounding of there and back.
    for (value, programmed) in pose.tip.iter_mut().zip(programmed) {
        *value = programmed.unwrap_or(*value);
    }
    pose
}

/// The curve that is followed: the tip's, or the axis's while the tip stands still.
fn followed(path: &Path, block: usize, s: f64, turn: bool, room: &mut Room) -> Vector3<f64> {
    let pose = pose(path, block, s, room);
    if turn { pose.axis } else { pose.tip }
}

impl Shape {
    pub fn new(path: &Path, block: usize, room: &mut Room) -> Self {
        let map = path.keeps_tables(block).then(|| linear_map(path, block, room));
        if let Some(shape) = map.and_then(|map| closed_form(path, block, &map, room)) {
            return shape;
        }
        let length = path.blocks()[block].length();
        let intervals = intervals(path, block);
        let mut tips = Vec::with_capacity(intervals + 1);
        let mut axes = Vec::with_capacity(intervals + 1);
        for i in 0..=intervals {
            let pose = pose(path, block, length * (i as f64 / intervals as f64), room);
            tips.push(pose.tip);
            axes.push(pose.axis);
        }
        let stays = |samples: &[Vector3<f64>], bound: f64| {
            samples.iter().all(|sample| (sample - samples[0]).norm() <= bound)
        };
        match (stays(&tips, STILL), stays(&axes, STILL_AXIS)) {
            (false, _) => Self::Curve { samples: tips, map },
            (true, false) => Self::Turn { samples: axes },
            (true, true) => Self::Still,
        }
    }

    /// Whether the tip moves.
    pub fn moves_tip(&self) -> bool {
        !matches!(self, Self::Turn { .. } | Self::Still)
    }

    /// Tool axis at `s`.
    pub fn axis(&self, path: &Path, block: usize, s: f64, room: &mut Room) -> Vector3<f64> {
        match self {
            Self::Segment { axis, .. } | Self::Circle { axis, .. } => *axis,
            Self::Curve { map: Some(map), .. } => map.axis,
            _ => pose(path, block, s, room).axis,
        }
    }

    /// Direction of the tip's motion at `s`, a unit vector; none where it stands still.
    pub fn direction(&self, path: &Path, block: usize, s: f64, room: &mut Room) -> Option<Vector3<f64>> {
        let slope = match self {
            Self::Segment { slope, .. } => *slope,
            Self::Circle { plane, start, turn, .. } => {
                let (sine, cosine) = (start + turn * s).sin_cos();
                (plane[1] * cosine - plane[0] * sine) * *turn
            }
            Self::Curve { .. } => self.local(path, block, s, room).1,
            Self::Turn { .. } | Self::Still => return None,
        };
        slope.try_normalize(0.0)
    }

    /// Point of the followed curve, its first and second derivative at `s`.
    pub fn local(
        &self,
        path: &Path,
        block: usize,
        s: f64,
        room: &mut Room,
    ) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let turn = !self.moves_tip();
        let mut at = |s: f64| followed(path, block, s, turn, room);
        if let Self::Curve { map: Some(map), .. } = self {
            let point = at(s);
            path.blocks()[block].derivatives_into(s, &mut room.derivatives);
            return (point, map.of(&room.derivatives.first), map.of(&room.derivatives.second));
        }
        let length = path.blocks()[block].length();
        let h = length * STEP;
        let middle = s.clamp(h, length - h);
        let [a, b, c] = [-h, 0.0, h].map(|step| at(middle + step));
        let point = if middle == s { b } else { at(s) };
        let second = (a - 2.0 * b + c) / (h * h);
        (point, (c - a) / (2.0 * h) + second * (s - middle), second)
    }

    /// Point of the followed curve at `s`.
    pub fn point(&self, path: &Path, block: usize, s: f64, room: &mut Room) -> Vector3<f64> {
        followed(path, block, s, !self.moves_tip(), room)
    }
}

/// Intervals between the samples of a curve.
fn intervals(path: &Path, block: usize) -> usize {
    let block = &path.blocks()[block];
    if !block.is_line() && block.circle().is_none() {
        return SAMPLES_OF_SPLINE;
    }
    let sweep = block.circle().map_or(0.0, |circle| circle.sweep.abs());
    let tables = [Role::A, Role::C].into_iter().filter_map(|role| path.kinematics().role(role));
    let turned: f64 = tables.map(|place| (block.end()[place] - block.start()[place]).abs()).sum();
    (((sweep + turned) / SAMPLE_TURN).ceil() as usize).clamp(2, MAX_SAMPLES)
}

/// The linear map of a block along which the tables stand still.
fn linear_map(path: &Path, block: usize, room: &mut Room) -> LinearMap {
    let (kinematics, start) = (path.kinematics(), path.blocks()[block].start());
    let mut coordinates = start.to_vec();
    let mut columns = [(0, Vector3::zeros()); 3];
    let mut used = 0;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for (role, unit) in [Role::X, Role::Y, Role::Z].into_iter().zip(axes) {
        let Some(place) = kinematics.role(role) else { continue };
        let column = if path.frame() == Frame::Workpiece {
            unit
        } else {
            // The map is linear: one meter on either side of 0 shows it best.
            let mut tip = |value: f64| {
                coordinates.fill(0.0);
                for table in [Role::A, Role::C].into_iter().filter_map(|role| kinematics.role(role)) {
                    coordinates[table] = start[table];
                }
                coordinates[place] = value;
                kinematics.forward(&coordinates).tip
            };
            (tip(1.0) - tip(-1.0)) * 0.5
        };
        columns[used] = (place, column);
        used += 1;
    }
    LinearMap { columns, used, axis: pose(path, block, 0.0, room).axis }
}

/// A line or a circle of the tip.
fn closed_form(path: &Path, block: usize, map: &LinearMap, room: &mut Room) -> Option<Shape> {
    let place = block;
    let block = &path.blocks()[place];
    let from = pose(path, place, 0.0, room).tip;
    let axis = map.axis;
    let slope = map.of(&block.derivatives(0.0).first);
    if block.is_line() {
        return (slope.norm() > 0.0).then_some(Shape::Segment { from, slope, axis });
    }
    let circle = block.circle()?;
    let vectors = circle.plane.map(|place| {
        let mut unit = vec![0.0; block.joints()];
        unit[place] = 1.0;
        map.of(&unit)
    });
    let units = vectors.iter().all(|vector| (vector.norm() - 1.0).abs() < UNIT_TOLERANCE);
    let others = (0..block.joints()).filter(|place| !circle.plane.contains(place));
    if !units || !block.keeps(others) {
        return None;
    }
    let spoke = [0, 1].map(|i| block.start()[circle.plane[i]] - circle.center[i]);
    let center = if path.frame() == Frame::Workpiece {
        from - vectors[0] * spoke[0] - vectors[1] * spoke[1]
    } else {
        room.joints.copy_from_slice(block.start());
        for i in 0..2 {
            room.joints[circle.plane[i]] = circle.center[i];
        }
        path.kinematics().forward(&room.joints).tip
    };
    let plane = [vectors[0], vectors[1], vectors[0].cross(&vectors[1])];
    let (start, turn) = (spoke[1].atan2(spoke[0]), circle.sweep / block.length());
    Some(Shape::Circle { center, plane, radius: circle.radius, start, turn, axis })
}
