//! Planner of a control with a trapezoidal speed, after observations of LinuxCNC.
//!
//! - Each motion has constant limits of speed and acceleration along its path, from those of the axes in its direction.
//! - Corners of lines and of arcs in a plane become circular arcs that touch both motions: as far from the corner as the
//!   tolerance, half of each motion and the feed allow. Arcs and corners use a part of the acceleration across the path and
//!   another part along it.
//! - Motions of rotary axes, of more than three linear axes and helices overlap in time: the next one starts while the one
//!   before slows down, each with a part of the acceleration.
//! - The control stops between rapid traverse and feed.
//! - Look-ahead: the speed allows a stop at the end of the last motion that is ahead.

mod corner_geometry;
mod segment;

use std::collections::VecDeque;
use std::f64::consts::PI;
use std::sync::Arc;

use virtual_axes_core::config::{ControlConfig, CornerRule, LimitsConfig};

use super::activity::{ProgramActivity, ProgramStop, TimeKind};
use super::corner::{CornerArc, cubic_corner};
use super::error::FeedPlanError;
use super::interval_motion::{IntervalMotion, Law, PathState};
use super::machine_model::MachineModel;
use super::motion_curve::{CurveEnd, FeedCap, MotionCurve, Shape};
use super::piece::{Overlap, Piece, PieceCurve, TimedCurve};
use super::pieces::PieceSource;
use super::planned_interval::PlannedInterval;
use super::source::Part;
use super::vector::{JointVector, norm};

use corner_geometry::{
    REVERSAL, STRAIGHT, angle_between, are_coplanar, corner_radius, is_spatial, rotary_length,
};
use segment::{JerkPhase, LEAST_LENGTH, SegmentEnd, SpeedSegment, phases};

/// Motion of the program before its end is known.
#[derive(Debug)]
struct Block {
    piece: Arc<Piece>,
    /// Meters per unit of the path parameter.
    scale: f64,
    /// Length cut off by the corner at its start, m.
    cut: f64,
    /// Limits of speed, with the feed, m/s, and acceleration, m/s², along the path.
    speed: f64,
    acceleration: f64,
    /// Largest speed at its start with which the look-ahead counts, m/s.
    entry_speed: f64,
    /// Jerk limit along the path, m/s³; infinite without one.
    jerk: f64,
    /// Speed limit of its curvature, m/s.
    bend_speed: f64,
    /// True if the path has a corner at its start or end that G61 keeps.
    has_kink: bool,
    /// True if the next motion starts before its end, or it starts before the end of the one before.
    is_overlapping: bool,
    /// True for lines of X, Y and Z and for arcs in a plane.
    is_simple: bool,
    /// True if X, Y and Z alone move.
    is_spatial: bool,
}

/// Element of the planned path.
#[derive(Debug)]
enum Element {
    Segment(SpeedSegment),
    Standstill(ProgramStop),
    /// Wait for the end of the filtered motion.
    Settling(ProgramActivity),
}

/// Last part of a motion that overlaps with the next one.
#[derive(Debug)]
struct Tail {
    motion: TimedCurve,
    duration: f64,
}

/// Planner with trapezoidal speed.
#[derive(Debug)]
pub(super) struct TrapezoidPlanner {
    control: ControlConfig,
    block: Option<Block>,
    elements: VecDeque<Element>,
    /// Speed at the start of the first element, m/s.
    speed: f64,
    tail: Option<Tail>,
    last_piece: Option<Arc<Piece>>,
    is_finished: bool,
}

impl TrapezoidPlanner {
    pub fn new(control: ControlConfig) -> Self {
        Self {
            control,
            block: None,
            elements: VecDeque::new(),
            speed: 0.0,
            tail: None,
            last_piece: None,
            is_finished: false,
        }
    }

    /// Appends the planned motion of the next element; returns false at the end of the program.
    pub fn extend(
        &mut self,
        source: &mut PieceSource<'_>,
        model: &MachineModel,
        feed_factor: f64,
        entries: &mut VecDeque<PlannedInterval>,
    ) -> Result<bool, FeedPlanError> {
        while !self.is_finished && !self.is_ready() {
            self.read(source, model, feed_factor)?;
        }
        let exit = self.exit_speed();
        match self.elements.pop_front() {
            None => Ok(false),
            Some(Element::Standstill(stop)) => {
                let time = stop.time + self.control.wait + self.control.filter_time();
                self.stand_still(time, stop.activity, entries);
                Ok(true)
            }
            Some(Element::Settling(activity)) => {
                self.stand_still(self.control.filter_time(), activity, entries);
                Ok(true)
            }
            Some(Element::Segment(segment)) => {
                self.last_piece = Some(Arc::clone(&segment.piece));
                self.execute(&segment, exit, entries);
                Ok(true)
            }
        }
    }

    /// Appends a standstill to the entries.
    fn stand_still(&self, time: f64, activity: ProgramActivity, entries: &mut VecDeque<PlannedInterval>) {
        let motion = IntervalMotion::dwell(time);
        entries.push_back(PlannedInterval::standstill(self.last_piece.clone(), motion, activity));
    }

    /// Returns true if enough of the path is known to execute the first element.
    fn is_ready(&self) -> bool {
        let mut segments = 0;
        for (i, element) in self.elements.iter().enumerate() {
            let Element::Segment(segment) = element else { return true };
            segments += 1;
            match segment.end {
                SegmentEnd::Through(_) => {}
                SegmentEnd::Stop => return true,
                SegmentEnd::Overlap(_) => return i > 0 || self.elements.len() > 1,
            }
        }
        segments > self.control.look_ahead
    }

    /// Returns the largest speed at the end of the first element from which a stop is possible, within the feeds of this
    /// element and the next one. Feeds behind them are not known ahead.
    fn exit_speed(&self) -> f64 {
        let mut known = 1;
        for element in self.elements.iter().take(self.control.look_ahead + 1) {
            match element {
                Element::Segment(SpeedSegment { end: SegmentEnd::Through(_), .. }) => known += 1,
                _ => break,
            }
        }
        let mut speed = 0.0;
        for index in (1..known.min(self.elements.len())).rev() {
            let [Element::Segment(before), Element::Segment(segment)] =
                [&self.elements[index - 1], &self.elements[index]]
            else {
                speed = 0.0;
                continue;
            };
            let SegmentEnd::Through(limit) = before.end else {
                speed = 0.0;
                continue;
            };
            speed = segment.reachable(speed).min(segment.entry_speed).min(before.entry_speed).min(limit);
            if index == 1 {
                speed = speed.min(segment.speed).min(before.speed);
            }
        }
        speed
    }

    /// Reads the next motion or standstill, and completes the one before.
    fn read(
        &mut self,
        source: &mut PieceSource<'_>,
        model: &MachineModel,
        feed_factor: f64,
    ) -> Result<(), FeedPlanError> {
        match source.next_exact()? {
            None => {
                self.close();
                self.is_finished = true;
            }
            Some(Part::Stop(stop)) => {
                self.close();
                self.elements.push_back(Element::Standstill(stop));
            }
            Some(Part::Path(mut piece)) => {
                piece.scale_feed(feed_factor);
                let next = self.block(piece, model)?;
                match self.block.take() {
                    Some(before) if before.piece.tcp_length == next.piece.tcp_length => {
                        self.join(before, next, model);
                    }
                    before => {
                        self.block = before;
                        self.close();
                        self.block = Some(next);
                    }
                }
            }
        }
        Ok(())
    }

    /// Completes the last motion before a standstill.
    fn close(&mut self) {
        let Some(mut block) = self.block.take() else { return };
        block.is_overlapping |= matches!(curve(&block.piece).at_end, CurveEnd::Blend(_));
        self.push(&block, 0.0, SegmentEnd::Stop);
    }

    /// Returns a motion with its limits.
    fn block(&self, piece: Piece, model: &MachineModel) -> Result<Block, FeedPlanError> {
        let curve = curve(&piece);
        let [_, first, second, _] = curve.jet(0.5 * curve.length);
        let linear = norm(&first, &model.kinds.linear[..model.kinds.linear.len().min(3)]);
        let mut speed =
            curve.cap.rate(&first) * if curve.cap == FeedCap::Rapid { 1.0 } else { piece.feed_factor };
        if let Some(limit) = self.control.path_velocity.filter(|_| linear > 0.0) {
            speed = speed.min(limit / linear);
        }
        let mut entry_speed = f64::INFINITY;
        let mut acceleration = f64::INFINITY;
        let mut jerk = f64::INFINITY;
        let mut bend_speed = f64::INFINITY;
        let is_simple = match &curve.shape {
            Shape::Line => {
                for (bounds, &first) in model.joints.iter().zip(&first) {
                    entry_speed = entry_speed.min(bounds.velocity / first.abs());
                    acceleration = acceleration.min(bounds.acceleration / first.abs());
                    jerk = jerk.min(bounds.jerk / first.abs());
                }
                (0..model.joints.len()).all(|joint| first[joint] == 0.0 || is_spatial(model, joint))
            }
            Shape::Arc(arc) => {
                let along = |joint: usize| {
                    if arc.plane.contains(&joint) {
                        (arc.plane.iter().map(|&i| first[i] * first[i]).sum::<f64>()).sqrt()
                    } else {
                        first[joint].abs()
                    }
                };
                for (joint, bounds) in model.joints.iter().enumerate() {
                    entry_speed = entry_speed.min(bounds.velocity / along(joint));
                    acceleration = acceleration.min(bounds.acceleration / along(joint));
                    jerk = jerk.min(bounds.jerk / along(joint));
                }
                let bend = arc.plane.iter().map(|&i| second[i] * second[i]).sum::<f64>().sqrt();
                let normal = self.control.normal_fraction
                    * arc.plane.iter().map(|&i| model.joints[i].acceleration).fold(f64::INFINITY, f64::min);
                bend_speed = (normal.min(model.centripetal) / bend).sqrt();
                acceleration *= self.control.tangential_fraction;
                let others = |joint: &usize| !arc.plane.contains(joint) && first[*joint] != 0.0;
                !(0..model.joints.len()).any(|joint| others(&joint))
            }
            Shape::Spline(_) => return Err(FeedPlanError::SplineUnsupported { line: curve.line }),
        };
        let scale = model.kinds.length(&first);
        entry_speed *= scale;
        speed = (speed * scale).min(entry_speed);
        bend_speed *= scale;
        acceleration *= scale;
        jerk = if self.control.is_jerk_limited { jerk * scale } else { f64::INFINITY };
        Ok(Block {
            scale,
            cut: 0.0,
            speed,
            entry_speed: if self.ignores_feeds_ahead() { entry_speed } else { speed },
            acceleration,
            jerk,
            bend_speed,
            has_kink: false,
            is_overlapping: false,
            is_simple,
            is_spatial: (0..model.joints.len()).all(|joint| first[joint] == 0.0 || is_spatial(model, joint)),
            piece: Arc::new(piece),
        })
    }

    /// Returns true if the control looks ahead with the limits of the axes alone. Where a feed begins that is lower, the
    /// motion before slows down as far as it can, and the new motion goes on with it.
    fn ignores_feeds_ahead(&self) -> bool {
        self.control.corners == CornerRule::Arc && !self.control.is_jerk_limited
    }

    /// Joins two motions: completes `before`, with a corner behind it, and keeps `next`.
    fn join(&mut self, mut before: Block, mut next: Block, model: &MachineModel) {
        let [first, second] = [curve(&before.piece), curve(&next.piece)];
        let is_rapid = |curve: &MotionCurve| curve.cap == FeedCap::Rapid;
        let unit = |jet: [JointVector; 4]| {
            let length = model.kinds.length(&jet[1]);
            jet[1].map(|value| value / length)
        };
        let tangents = [unit(first.jet(first.length)), unit(second.jet(0.0))];
        let angle = angle_between(&tangents, model);
        let kink_speed = self.kink_speed([first, second], &tangents, model);
        let is_blendable =
            before.is_simple && next.is_simple && are_coplanar([first, second], &tangents, model);
        let is_straight = angle < STRAIGHT || kink_speed > before.speed.min(next.speed);
        match first.at_end {
            CurveEnd::Stop => {
                self.push(&before, 0.0, SegmentEnd::Stop);
                if self.control.filter_time() > 0.0 {
                    let (line, tool) = (first.line, first.tool);
                    self.elements.push_back(Element::Settling(ProgramActivity {
                        kind: TimeKind::Feed,
                        line,
                        tool,
                    }));
                }
            }
            CurveEnd::ExactPath => {
                (before.has_kink, next.has_kink) = (before.has_kink || !is_straight, !is_straight);
                let end = if is_straight { SegmentEnd::Through(f64::INFINITY) } else { SegmentEnd::Stop };
                self.push(&before, 0.0, end);
            }
            CurveEnd::Blend(_) if is_rapid(first) != is_rapid(second) => {
                self.push(&before, 0.0, SegmentEnd::Stop)
            }
            // The start of the next motion within the end of this one allows about half of the lower speed.
            CurveEnd::Blend(_)
                if !is_blendable
                    && before.is_spatial
                    && next.is_spatial
                    && self.control.corners == CornerRule::Arc
                    && kink_speed > 0.5 * before.speed.min(next.speed) =>
            {
                (before.has_kink, next.has_kink) = (before.has_kink || !is_straight, !is_straight);
                self.push(&before, 0.0, SegmentEnd::Through(kink_speed));
            }
            CurveEnd::Blend([tolerance, rotary])
                if !is_blendable && self.control.corners == CornerRule::Arc =>
            {
                before.is_overlapping = true;
                next.is_overlapping = before.is_spatial && next.is_spatial;
                // Deviation along the path, whose speed and acceleration include those of the rotary axes.
                let spatial = norm(&tangents[0], &model.kinds.linear);
                let tolerance =
                    if spatial > 0.0 { tolerance / spatial } else { rotary_length(rotary, model) };
                let deviation = tolerance / (0.5 * angle).sin().max(STRAIGHT);
                let speed = 2.0 * (self.acceleration(&before) * deviation).sqrt();
                self.push(&before, 0.0, SegmentEnd::Overlap(speed));
            }
            CurveEnd::Blend(_) if angle > PI - REVERSAL || !is_blendable => {
                self.push(&before, 0.0, SegmentEnd::Stop)
            }
            CurveEnd::Blend(_) if is_straight => self.push(&before, 0.0, SegmentEnd::Through(f64::INFINITY)),
            CurveEnd::Blend([tolerance, _]) => match self.control.corners {
                CornerRule::Arc => {
                    let corner = [angle, tolerance, kink_speed];
                    self.corner(&mut before, &mut next, &tangents, corner, model);
                }
                CornerRule::Stop => self.push(&before, 0.0, SegmentEnd::Stop),
                CornerRule::VelocityStep => {
                    let speed = self.control.corner_velocity / (2.0 * (0.5 * angle).sin());
                    self.push(&before, 0.0, SegmentEnd::Through(speed));
                }
                CornerRule::Deviation => {
                    let normal = self.corner_acceleration(&tangents, model)[0];
                    let speed = (normal * corner_radius(angle, tolerance)).sqrt();
                    self.push(&before, 0.0, SegmentEnd::Through(speed));
                }
            },
        }
        self.block = Some(next);
    }

    /// Returns the accelerations in a corner across and along the path, m/s².
    fn corner_acceleration(&self, tangents: &[JointVector; 2], model: &MachineModel) -> [f64; 2] {
        let moves = |joint: &usize| tangents.iter().any(|tangent| tangent[*joint] != 0.0);
        let limits = (0..model.joints.len()).filter(moves).map(|joint| model.joints[joint].acceleration);
        let acceleration = limits.fold(f64::INFINITY, f64::min);
        let normal = (self.control.normal_fraction * acceleration).min(model.centripetal);
        [normal, self.control.tangential_fraction * acceleration]
    }

    /// Returns the speed at which a change of direction in one block cycle uses its part of the acceleration of an axis.
    fn kink_speed(
        &self,
        curves: [&MotionCurve; 2],
        tangents: &[JointVector; 2],
        model: &MachineModel,
    ) -> f64 {
        let change = |(joint, bounds): (usize, &LimitsConfig)| {
            (tangents[1][joint] - tangents[0][joint]).abs() / bounds.acceleration
        };
        let largest = model.joints.iter().enumerate().map(change).fold(0.0, f64::max);
        let has_arc = curves.iter().any(|curve| !curve.is_line());
        let fraction = if has_arc { self.control.tangential_fraction } else { 1.0 };
        fraction * self.control.kink_fraction * self.control.block_cycle / largest
    }

    /// Completes `before` and appends a corner of `angle` within a tolerance; cuts off the start of `next`. A corner that
    /// is passed faster without an arc remains.
    fn corner(
        &mut self,
        before: &mut Block,
        next: &mut Block,
        tangents: &[JointVector; 2],
        [angle, tolerance, kink_speed]: [f64; 3],
        model: &MachineModel,
    ) {
        let [first, second] = [curve(&before.piece), curve(&next.piece)];
        let [normal, tangential] = self.corner_acceleration(tangents, model);
        let (sine, cosine) = (0.5 * angle).sin_cos();
        let [before_length, next_length] = [&*before, &*next].map(|block| block.scale * block.piece.length);
        let most = 0.5 * before_length.min(next_length);
        let fastest = before.speed.min(before.bend_speed).max(next.speed.min(next.bend_speed));
        // Neither an arc as long as a stop and a start nor one that allows the feed need be longer.
        let radius = corner_radius(angle, tolerance)
            .min(most * cosine / sine)
            .min((fastest * fastest / (tangential * angle)).max(fastest * fastest / normal));
        let cut = radius * sine / cosine;
        let cuts = [cut / before.scale, cut / next.scale];
        let length = cuts[0] + cuts[1];
        if length * before.scale < LEAST_LENGTH {
            self.push(before, 0.0, SegmentEnd::Stop);
            return;
        }
        let speed = fastest.min((normal * radius).sqrt());
        if kink_speed > speed {
            (before.has_kink, next.has_kink) = (true, true);
            self.push(before, 0.0, SegmentEnd::Through(kink_speed));
            return;
        }
        self.push(before, cut, SegmentEnd::Through(speed));
        let start = first.point(first.length - cuts[0]);
        let curve = if first.is_line() && second.is_line() {
            PieceCurve::Corner(CornerArc::new(start, tangents, [radius, angle], length))
        } else {
            let unit = |curve: &MotionCurve, u: f64| {
                let tangent = curve.jet(u)[1];
                let length = model.kinds.length(&tangent);
                tangent.map(|value| value / length)
            };
            let tangents = [unit(first, first.length - cuts[0]), unit(second, cuts[1])];
            PieceCurve::Cubic(cubic_corner(
                &[start, second.point(cuts[1])],
                &tangents,
                [radius, angle],
                length,
            ))
        };
        let piece = before.piece.part(curve, length, before.piece.start + first.length - cuts[0]);
        self.push_segment(SpeedSegment {
            piece: Arc::new(piece),
            scale: radius * angle / length,
            from: 0.0,
            length: radius * angle,
            speed,
            entry_speed: speed,
            acceleration: tangential,
            jerk: before.jerk.min(next.jerk),
            end: SegmentEnd::Through(f64::INFINITY),
        });
        next.cut = cut;
    }

    /// Returns the acceleration of a motion along the path, m/s².
    fn acceleration(&self, block: &Block) -> f64 {
        let fraction = if block.is_overlapping { self.control.overlap_fraction } else { 1.0 };
        block.acceleration * fraction * self.kink_share(block)
    }

    /// Returns the part of the acceleration that the corners of a motion leave.
    fn kink_share(&self, block: &Block) -> f64 {
        if block.has_kink { 1.0 - self.control.kink_fraction } else { 1.0 }
    }

    /// Appends a motion without the length `cut` at its end.
    fn push(&mut self, block: &Block, cut: f64, end: SegmentEnd) {
        let length = block.scale * block.piece.length - block.cut - cut;
        let mut acceleration = self.acceleration(block);
        let bend_speed = block.bend_speed * self.kink_share(block).sqrt();
        let most = bend_speed.min(block.scale * block.piece.length / self.control.block_cycle);
        let (mut speed, mut entry_speed) = (block.speed.min(most), block.entry_speed.min(most));
        // The rest of a line that is short at the speed of the corner becomes part of it, whatever its own feed is.
        if let SegmentEnd::Through(corner) = end
            && cut > 0.0
            && curve(&block.piece).is_line()
            && length < self.control.gap_cycles * self.control.block_cycle * corner
        {
            acceleration *= self.control.tangential_fraction;
            entry_speed = corner.min(block.entry_speed);
            speed = entry_speed;
        }
        self.push_segment(SpeedSegment {
            piece: Arc::clone(&block.piece),
            scale: block.scale,
            from: block.cut / block.scale,
            length: length.max(0.0),
            speed,
            entry_speed,
            acceleration,
            jerk: block.jerk,
            end,
        });
    }

    fn push_segment(&mut self, segment: SpeedSegment) {
        if segment.length < LEAST_LENGTH && matches!(segment.end, SegmentEnd::Through(_)) {
            return;
        }
        self.elements.push_back(Element::Segment(segment));
    }

    /// Appends the motion along a segment to the entries.
    fn execute(&mut self, segment: &SpeedSegment, exit: f64, entries: &mut VecDeque<PlannedInterval>) {
        let exit = exit.min(segment.reachable(self.speed)).max(segment.slowed(self.speed));
        let phases = phases(segment, [self.speed, exit]);
        let total: f64 = phases.iter().map(|phase| phase.duration).sum();
        let tail = self.tail_duration(segment, &phases);
        let overlapped = self.tail.take();
        let mut time = 0.0;
        for phase in phases {
            // Parts of the phase: together with the end of the motion before, alone, and together with the next one.
            let mut from = 0.0;
            let ends = [overlapped.as_ref().map_or(0.0, |tail| tail.duration), total - tail, total];
            for (kind, end) in ends.into_iter().enumerate() {
                let to = (end - time).clamp(from, phase.duration);
                if to - from > 1e-12 {
                    let state = phase.state(from, segment);
                    match (kind, &overlapped) {
                        (0, Some(tail)) => {
                            entries.push_back(overlap(segment, state, tail, time + from, to - from))
                        }
                        (2, _) => {
                            let motion = TimedCurve { piece: Arc::clone(&segment.piece), state };
                            self.tail = Some(Tail { motion, duration: to - from });
                        }
                        _ => entries.push_back(alone(segment, state, phase.jerk / segment.scale, to - from)),
                    }
                }
                from = to;
            }
            time += phase.duration;
        }
        self.speed = exit;
    }

    /// Returns the part of the last phase during which the next motion starts.
    fn tail_duration(&self, segment: &SpeedSegment, phases: &[JerkPhase]) -> f64 {
        let (SegmentEnd::Overlap(most), Some(last), Some(Element::Segment(next))) =
            (segment.end, phases.last(), self.elements.front())
        else {
            return 0.0;
        };
        if last.acceleration >= 0.0 || segment.jerk.is_finite() {
            return 0.0;
        }
        let reached = next.speed.min((next.acceleration * next.length).sqrt());
        let before = self.tail.as_ref().map_or(0.0, |tail| tail.duration);
        let total: f64 = phases.iter().map(|phase| phase.duration).sum();
        last.duration
            .min(most / segment.acceleration)
            .min(next.length / reached)
            .min((total - before).max(0.0))
    }
}

/// Returns the exact curve of a motion.
fn curve(piece: &Piece) -> &MotionCurve {
    match &piece.curve {
        PieceCurve::Exact(curve) => curve,
        _ => unreachable!("blocks are exact curves"),
    }
}

/// Returns the motion along a part of a segment.
fn alone(segment: &SpeedSegment, state: PathState, jerk: f64, duration: f64) -> PlannedInterval {
    let length = duration * (state.rate + duration * (0.5 * state.acceleration + duration * jerk / 6.0));
    let law = Law::Jerk { rate: state.rate, acceleration: state.acceleration, jerk };
    let motion = IntervalMotion { law, length, duration };
    PlannedInterval::closed_form(Arc::clone(&segment.piece), state.u, motion)
}

/// Returns the end of the motion before, from `time` on, together with the start of a segment.
fn overlap(
    segment: &SpeedSegment,
    state: PathState,
    tail: &Tail,
    time: f64,
    duration: f64,
) -> PlannedInterval {
    let after = |state: PathState, time: f64| PathState {
        u: state.u + time * (state.rate + 0.5 * time * state.acceleration),
        rate: (state.rate + time * state.acceleration).max(0.0),
        ..state
    };
    let ending = after(tail.motion.state, time);
    let covered = (after(ending, duration).u - ending.u) + (after(state, duration).u - state.u);
    let length = covered.max(f64::MIN_POSITIVE);
    let motions = [
        TimedCurve { piece: Arc::clone(&tail.motion.piece), state: ending },
        TimedCurve { piece: Arc::clone(&segment.piece), state },
    ];
    let rest = tail.motion.piece.length - ending.u;
    let start = segment.piece.start + state.u - rest;
    let curve = PieceCurve::Overlap(Box::new(Overlap { motions, pace: duration / length }));
    let piece = segment.piece.part(curve, length, start);
    let law = Law::Jerk { rate: length / duration, acceleration: 0.0, jerk: 0.0 };
    PlannedInterval::closed_form(Arc::new(piece), 0.0, IntervalMotion { law, length, duration })
}
