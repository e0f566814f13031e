//! Curves of the motions of a program, one after the other.

use std::collections::VecDeque;

use virtual_axes_core::trajectory::JointLimits;

use super::activity::{ProgramActivity, ProgramStop, TimeKind};
use super::blended_path::ARC_DEVIATION;
use super::error::{FeedPlanError, StepError};
use super::motion_curve::{Arc, BlendTolerance, CurveEnd, FeedCap, FeedJoints, MotionCurve, Shape};
use super::nurbs::SplineTable;
use super::vector::{JointKinds, JointVector, MAX_JOINTS, mix};
use crate::motion::{
    AXIS_COUNT, AXIS_LETTERS, Blend, Coordinates, Feed, MotionKind, Nurbs, PathControl, PlanarArc,
    ProgramEvent, ProgramMotion, ProgramStep,
};

/// Largest gap between two motions, m or rad.
const GAP_TOLERANCE: f64 = 1e-9;
/// Smallest blending tolerance, m.
const MIN_TOLERANCE: f64 = 1e-8;

/// Part of a program: one along the path, or a standstill.
#[derive(Debug, Clone)]
pub(super) enum Part<T> {
    Path(T),
    Stop(ProgramStop),
}

/// Axes of the machine and their programmed letters.
#[derive(Debug, Clone)]
pub(super) struct ProgramAxes {
    /// Joint of each programmed axis.
    pub joint_of: [Option<usize>; AXIS_COUNT],
    pub kinds: JointKinds,
}

impl ProgramAxes {
    pub fn new(limits: &[JointLimits]) -> Self {
        let joint_of = AXIS_LETTERS.map(|letter| {
            limits.iter().position(|joint| joint.name.eq_ignore_ascii_case(&letter.to_string()))
        });
        let of = |kind: &str| (0..limits.len()).filter(|&i| limits[i].unit() == kind).collect();
        Self { joint_of, kinds: JointKinds { linear: of("m"), rotary: of("rad") } }
    }

    fn set(&self, axes: [usize; 3]) -> FeedJoints {
        FeedJoints { indices: axes.map(|axis| self.joint_of[axis]) }
    }

    fn vector(&self, coordinates: &Coordinates) -> JointVector {
        let mut vector = [0.0; MAX_JOINTS];
        for (joint, value) in self.joint_of.iter().zip(coordinates) {
            if let Some(joint) = joint {
                vector[*joint] = *value;
            }
        }
        vector
    }
}

/// Steps of a program in order.
pub(super) type ProgramSteps<'a> = Box<dyn Iterator<Item = Result<ProgramStep, StepError>> + 'a>;

/// Source of the curves of a program.
pub(super) struct PartSource<'a> {
    steps: ProgramSteps<'a>,
    axes: ProgramAxes,
    default_tolerance: BlendTolerance,
    end: Option<Coordinates>,
    /// Tool length of the last motion.
    tcp_length: Option<f64>,
    /// Tool in the spindle.
    tool: Option<u32>,
    pending: VecDeque<Part<MotionCurve>>,
    is_finished: bool,
    /// True if the axes stop for the spindle and the coolant.
    pub stops_at_auxiliaries: bool,
}

impl<'a> PartSource<'a> {
    pub fn new(steps: ProgramSteps<'a>, axes: ProgramAxes, default_tolerance: BlendTolerance) -> Self {
        let pending = VecDeque::new();
        Self {
            steps,
            axes,
            default_tolerance,
            end: None,
            tcp_length: None,
            tool: None,
            pending,
            is_finished: false,
            stops_at_auxiliaries: false,
        }
    }

    /// Returns the joints by kind of movement.
    pub fn kinds(&self) -> &JointKinds {
        &self.axes.kinds
    }

    /// Returns true if `next` continues a line such that the points `between` are within its tolerance of a line from the
    /// start of `curve` to the end of `next`.
    pub fn is_merged(&self, curve: &MotionCurve, next: &MotionCurve, between: &[JointVector]) -> bool {
        let xyz = self.axes.set([0, 1, 2]);
        let step: JointVector = std::array::from_fn(|i| next.to[i] - curve.from[i]);
        let others = |i: &usize| {
            !xyz.indices.contains(&Some(*i)) && (curve.from[*i] != next.to[*i] || curve.to[*i] != next.to[*i])
        };
        let is_alike = curve.is_line()
            && next.is_line()
            && curve.merge_tolerance > 0.0
            && curve.cap != FeedCap::Rapid
            && curve.cap == next.cap
            && curve.at_end == next.at_end
            && curve.merge_tolerance == next.merge_tolerance
            && curve.tcp_length == next.tcp_length
            && curve.tool == next.tool
            && !(0..MAX_JOINTS).any(|i| others(&i));
        let square = xyz.norm(&step).powi(2);
        is_alike
            && between.iter().all(|point| {
                let offset: JointVector = std::array::from_fn(|i| point[i] - curve.from[i]);
                let dot: f64 = xyz.indices.iter().flatten().map(|&i| offset[i] * step[i]).sum();
                let part = dot / square;
                let distance = xyz.norm(&std::array::from_fn(|i| offset[i] - part * step[i]));
                (0.0..=1.0).contains(&part) && distance <= curve.merge_tolerance
            })
    }

    /// Returns the next curve or stop, or `None` at the end of the program.
    pub fn next(&mut self) -> Result<Option<Part<MotionCurve>>, FeedPlanError> {
        loop {
            if let Some(part) = self.pending.pop_front() {
                return Ok(Some(part));
            }
            if self.is_finished {
                return Ok(None);
            }
            match self.steps.next() {
                None => self.is_finished = true,
                Some(Err(error)) => {
                    self.is_finished = true;
                    return Err(FeedPlanError::Step(error));
                }
                Some(Ok(ProgramStep::Motion(motion))) => self.add(&motion)?,
                Some(Ok(ProgramStep::Event { line, event })) => self.add_event(line, &event)?,
            }
        }
    }

    fn add_event(&mut self, line: usize, event: &ProgramEvent) -> Result<(), FeedPlanError> {
        match event {
            ProgramEvent::Dwell(time) | ProgramEvent::Pause(time) if !(time.is_finite() && *time >= 0.0) => {
                return Err(FeedPlanError::NotFinite { line, what: "dwell", value: *time });
            }
            ProgramEvent::Dwell(time) => self.push_stop(*time, TimeKind::Dwell, line),
            ProgramEvent::Pause(time) => self.push_stop(*time, TimeKind::Auxiliary, line),
            ProgramEvent::Stop | ProgramEvent::OptionalStop => self.push_stop(0.0, TimeKind::Auxiliary, line),
            ProgramEvent::ToolChange(tool) => {
                self.tool = Some(*tool);
                self.push_stop(0.0, TimeKind::Auxiliary, line);
            }
            ProgramEvent::Spindle(_) | ProgramEvent::Coolant { .. } if self.stops_at_auxiliaries => {
                self.push_stop(0.0, TimeKind::Auxiliary, line);
            }
            ProgramEvent::End => self.is_finished = true,
            _ => {}
        }
        Ok(())
    }

    fn push_stop(&mut self, time: f64, kind: TimeKind, line: usize) {
        let activity = ProgramActivity { kind, line, tool: self.tool };
        self.pending.push_back(Part::Stop(ProgramStop { time, activity }));
    }

    fn add(&mut self, motion: &ProgramMotion) -> Result<(), FeedPlanError> {
        self.check(motion)?;
        (self.end, self.tcp_length) = (Some(motion.end), motion.tcp_length);
        let (from, to) = (self.axes.vector(&motion.start), self.axes.vector(&motion.end));
        match &motion.kind {
            MotionKind::Rapid | MotionKind::Line => self.push(motion, Shape::Line, from, to),
            MotionKind::Arc(arc) => {
                let shape = self.arc(arc, &from, &to, motion.line)?;
                self.push(motion, shape, from, to);
            }
            MotionKind::Nurbs(nurbs) => self.push_nurbs(motion, nurbs, from, to)?,
        }
        Ok(())
    }

    fn check(&self, motion: &ProgramMotion) -> Result<(), FeedPlanError> {
        let line = motion.line;
        for value in motion.start.iter().chain(&motion.end) {
            if !value.is_finite() {
                return Err(FeedPlanError::NotFinite { line, what: "coordinate", value: *value });
            }
        }
        if let Feed::Linear(value) | Feed::Rotary(value) | Feed::Duration(value) = motion.feed
            && !(value > 0.0 && value.is_finite())
        {
            return Err(FeedPlanError::InvalidFeed { line, value });
        }
        if let PathControl::Blend(Blend { tolerance: Some(value), .. }) = motion.path_control
            && (value.is_nan() || value < MIN_TOLERANCE)
        {
            return Err(FeedPlanError::ToleranceTooSmall { line, value, least: MIN_TOLERANCE });
        }
        for (axis, letter) in AXIS_LETTERS.into_iter().enumerate() {
            if self.axes.joint_of[axis].is_none() && motion.start[axis] != motion.end[axis] {
                return Err(FeedPlanError::MissingAxis { line, axis: letter });
            }
        }
        if let Some(length) = motion.tcp_length {
            if (0..3).any(|axis| self.axes.joint_of[axis].is_none()) {
                return Err(FeedPlanError::NoToolCenterPoint { line });
            }
            if !length.is_finite() {
                return Err(FeedPlanError::NotFinite { line, what: "tool length", value: length });
            }
        }
        // Coordinates change their meaning where tool center point control begins or ends.
        let before = self.end.filter(|_| self.tcp_length == motion.tcp_length).unwrap_or(motion.start);
        let gap = before.iter().zip(&motion.start).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if gap > GAP_TOLERANCE { Err(FeedPlanError::Gap { line, gap }) } else { Ok(()) }
    }

    fn arc(
        &self,
        arc: &PlanarArc,
        from: &JointVector,
        to: &JointVector,
        line: usize,
    ) -> Result<Shape, FeedPlanError> {
        let [first, second, _] = arc.plane.axes();
        let missing = |axis: usize| FeedPlanError::MissingAxis { line, axis: AXIS_LETTERS[axis] };
        let x = self.axes.joint_of[first].ok_or_else(|| missing(first))?;
        let y = self.axes.joint_of[second].ok_or_else(|| missing(second))?;
        for value in arc.center.into_iter().chain([arc.sweep]) {
            if !value.is_finite() {
                return Err(FeedPlanError::NotFinite { line, what: "arc center or sweep", value });
            }
        }
        let radius = |point: &JointVector| (point[x] - arc.center[0]).hypot(point[y] - arc.center[1]);
        let phase = (from[y] - arc.center[1]).atan2(from[x] - arc.center[0]);
        let radii = [radius(from), radius(to)];
        Ok(Shape::Arc(Arc { plane: [x, y], center: arc.center, radii, phase, sweep: arc.sweep }))
    }

    /// Appends a curve.
    fn push(&mut self, motion: &ProgramMotion, shape: Shape, from: JointVector, to: JointVector) {
        let length = MotionCurve::measure(&shape, &from, &to, &self.axes.kinds);
        if length <= 0.0 {
            return;
        }
        let xyz = self.axes.set([0, 1, 2]);
        let is_curved = !matches!(shape, Shape::Line);
        let moves_xyz = is_curved || xyz.norm(&std::array::from_fn(|i| to[i] - from[i])) > 0.0;
        let (cap, feed) = match motion.feed {
            Feed::Rapid => (FeedCap::Rapid, f64::INFINITY),
            Feed::Linear(value) => {
                let joints = if moves_xyz { xyz } else { self.axes.set([6, 7, 8]) };
                (FeedCap::Speed { value, joints }, value)
            }
            Feed::Rotary(value) => (FeedCap::Speed { value, joints: self.axes.set([3, 4, 5]) }, value),
            Feed::Duration(time) => (FeedCap::Rate(length / time), length / time),
        };
        let at_end = match motion.path_control {
            PathControl::Blend(blend) => CurveEnd::Blend([
                blend.tolerance.unwrap_or(self.default_tolerance[0]),
                blend.rotary_tolerance.unwrap_or(self.default_tolerance[1]),
            ]),
            PathControl::ExactPath => CurveEnd::ExactPath,
            PathControl::ExactStop => CurveEnd::Stop,
        };
        let (line, tcp_length, tool) = (motion.line, motion.tcp_length, self.tool);
        let merge_tolerance = match motion.path_control {
            PathControl::Blend(blend) => blend.merge_tolerance.or(blend.tolerance).unwrap_or(0.0),
            _ => 0.0,
        };
        let curve = MotionCurve {
            shape,
            from,
            to,
            length,
            line,
            tool,
            feed,
            cap,
            tcp_length,
            at_end,
            merge_tolerance,
        };
        self.pending.push_back(Part::Path(curve));
    }

    /// Appends a NURBS curve. Where the path control allows no deviation, it is followed within [`ARC_DEVIATION`] and ends
    /// with a stop. A curve of order 2 is a sequence of lines.
    fn push_nurbs(
        &mut self,
        motion: &ProgramMotion,
        nurbs: &Nurbs,
        from: JointVector,
        to: JointVector,
    ) -> Result<(), FeedPlanError> {
        let [first, second, _] = nurbs.plane.axes();
        let (Some(x), Some(y)) = (self.axes.joint_of[first], self.axes.joint_of[second]) else {
            return Err(FeedPlanError::MissingAxis { line: motion.line, axis: AXIS_LETTERS[first] });
        };
        if nurbs.order <= 2 {
            self.push_polyline(motion, nurbs, [x, y], [from, to]);
            return Ok(());
        }
        let tolerance = match motion.path_control {
            PathControl::Blend(blend) => blend.tolerance.unwrap_or(self.default_tolerance[0]),
            _ => ARC_DEVIATION,
        };
        let kinds = &self.axes.kinds;
        let (table, error) = SplineTable::new(nurbs, [x, y], [&from, &to], kinds, tolerance, motion.line)?;
        let blend = match motion.path_control {
            PathControl::Blend(blend) => blend,
            _ => Blend { tolerance: None, rotary_tolerance: None, merge_tolerance: None },
        };
        let blend = PathControl::Blend(Blend { tolerance: Some(tolerance - error), ..blend });
        self.push(&ProgramMotion { path_control: blend, ..motion.clone() }, Shape::Spline(table), from, to);
        if !matches!(motion.path_control, PathControl::Blend(_)) {
            self.push_stop(0.0, TimeKind::Feed, motion.line);
        }
        Ok(())
    }

    /// Appends the lines between the control points of a spline of order 2.
    fn push_polyline(
        &mut self,
        motion: &ProgramMotion,
        nurbs: &Nurbs,
        [x, y]: [usize; 2],
        [from, to]: [JointVector; 2],
    ) {
        let last = nurbs.control.len().saturating_sub(1);
        let feed = match motion.feed {
            Feed::Duration(time) => Feed::Duration(time / last as f64),
            feed => feed,
        };
        let motion = ProgramMotion { feed, ..motion.clone() };
        let mut before = from;
        for (i, (position, _)) in nurbs.control.iter().enumerate().skip(1) {
            let mut point = mix(&from, &to, i as f64 / last as f64);
            if i < last {
                [point[x], point[y]] = *position;
            }
            self.push(&motion, Shape::Line, before, point);
            before = point;
        }
    }
}
