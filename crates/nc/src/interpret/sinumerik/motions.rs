//! Motions of a block: lines, polar coordinates, machine coordinates, corners.

use std::f64::consts::TAU;

use virtual_axes_core::units::DEGREE;

use super::super::contour::Corner;
use super::super::error::Outcome;
use super::super::limits::MAX_RATE;
use super::super::state::State;
use super::Sinumerik;
use super::modes::MotionMode;
use super::words::{Approach, Words};
use crate::motion::{AXIS_LETTERS, Coordinates, PlanarArc, is_rotary};

/// Sine of an angle below which three points are on a line.
pub(super) const STRAIGHT: f64 = 1e-9;
/// Letters of the center along X, Y and Z.
pub(super) const CENTERS: [&str; 3] = ["I", "J", "K"];
/// Addresses that move an axis without an axis word.
const MOVING: [&str; 10] = ["AP", "RP", "AR", "I", "J", "K", "CR", "A3", "B3", "C3"];
const ANGLES: [&str; 3] = ["A2", "B2", "C2"];

/// Frames that a block suppresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Suppression {
    None,
    /// G53, G153, SUPA: axis positions.
    All,
}

impl Sinumerik {
    /// Returns true if a block moves axes.
    pub(super) fn moves(&self, words: &Words) -> bool {
        words.has_axis() || MOVING.iter().chain(&ANGLES).any(|address| words.has(address))
    }

    /// Executes the motion of a block.
    pub(super) fn motion(
        &mut self,
        words: &mut Words,
        suppression: Suppression,
        state: &mut State,
    ) -> Outcome<()> {
        require_axes(words, state)?;
        note_length_axis(state);
        if suppression == Suppression::All {
            self.require_no_approach()?;
            return self.machine_motion(words, state);
        }
        let approach = self.approach.take();
        let start = approach.as_ref().map_or_else(|| state.programmed(), |path| path.point);
        let axis = self.tool_axis(words, state)?;
        let mut end = self.targets(words, &start, state)?;
        if let Some(mut path) = approach.clone().filter(|path| !path.has_point) {
            (path.point, path.has_point) = (end, true);
            self.approach = Some(path);
            return Ok(());
        }
        if let Some(axis) = &axis {
            let rotary = self.rotary_axes(axis, state)?;
            (3..6).for_each(|index| end[index] = rotary[index] - state.origin(index));
        }
        let mode = self.modes.motion;
        let corner = self.corner(words, state)?;
        if mode != MotionMode::Rapid {
            state.corner = corner;
        }
        match mode {
            MotionMode::Rapid | MotionMode::Line => {
                if let Some(angle) = words.number("ANG")? {
                    complete_line(&start, &mut end, angle, state)?;
                }
                let is_rapid = mode == MotionMode::Rapid;
                if let Some(path) = &approach {
                    let tangent = direction(&start, &end, None, state);
                    self.approach_contour(path, tangent, state)?;
                }
                match axis {
                    Some(axis) => self.line_with_vector(&end, &axis, is_rapid, state)?,
                    None if is_rapid => state.rapid_to(&end)?,
                    None => state.line_to(&end)?,
                }
                self.note_tangent(&start, &end, None, state);
            }
            _ => {
                let arc = self.circle(words, &start, &mut end, state)?;
                if let Some(path) = &approach {
                    let tangent = direction(&start, &end, arc.as_ref(), state);
                    self.approach_contour(path, tangent, state)?;
                }
                self.note_tangent(&start, &end, arc.as_ref(), state);
                match arc {
                    Some(arc) => state.arc_to(&arc, &end)?,
                    None => state.line_to(&end)?,
                }
            }
        }
        // Without a motion, as after a word that keeps its place, there is no corner.
        state.corner = None;
        Ok(())
    }

    /// Moves to axis positions: SUPA, G53, G153. It interrupts TRAORI.
    fn machine_motion(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let tcp_length = state.modal.tcp_length;
        if tcp_length.is_some() {
            state.assume("SUPA, G53 and G153 with TRAORI: axis positions, as after TRAFOOF".to_owned());
            state.leave_tcp();
        }
        let (tool_length, length_axis) = match tcp_length {
            Some(length) => (length, 2),
            None => (state.offsets.tool_length, state.length_axis()),
        };
        state.moves_in_machine_coordinates = true;
        let mut end = state.position;
        for (axis, word) in words.axes.iter_mut().enumerate() {
            let Some((value, approach)) = word.take() else { continue };
            let value = value * state.unit(axis);
            let tool = if axis == length_axis { tool_length } else { 0.0 };
            end[axis] = match approach {
                Approach::Incremental => end[axis] + value,
                Approach::Modal if state.modal.is_incremental => end[axis] + value,
                _ => value + tool,
            };
        }
        match self.modes.motion {
            MotionMode::Rapid => state.push_rapid(end)?,
            MotionMode::Line => state.push_feed(crate::motion::MotionKind::Line, end)?,
            _ => return Err("SUPA, G53 and G153 require G0 or G1".to_owned()),
        }
        tcp_length.map_or(Ok(()), |length| state.enter_tcp(length))
    }

    /// Returns the end of a motion by axis words or polar coordinates, which then count as used.
    pub(super) fn targets(
        &mut self,
        words: &mut Words,
        start: &Coordinates,
        state: &State,
    ) -> Outcome<Coordinates> {
        let mut end = *start;
        for (axis, word) in words.axes.iter_mut().enumerate() {
            let Some((value, approach)) = word.take() else { continue };
            let value = value * state.unit(axis);
            if matches!(approach, Approach::Shortest | Approach::Positive | Approach::Negative)
                && !is_rotary(axis)
            {
                return Err(format!("word {}: DC, ACP and ACN require a rotary axis", AXIS_LETTERS[axis]));
            }
            let turns = (start[axis] - value) / TAU;
            end[axis] = match approach {
                Approach::Modal if state.modal.is_incremental => start[axis] + value,
                Approach::Modal | Approach::Absolute => value,
                Approach::Incremental => start[axis] + value,
                Approach::Shortest => value + TAU * turns.round(),
                // Within rounding the axis is there already.
                Approach::Positive => value + TAU * (turns - 1e-12).ceil(),
                Approach::Negative => value + TAU * (turns + 1e-12).floor(),
            };
        }
        if words.has("AP") || words.has("RP") {
            let [first, second, _] = state.modal.plane.axes();
            let length = state.modal.length;
            let angle = words.take("AP");
            let radius = words.take("RP");
            if let Some(radius) = radius {
                let value = radius.value.number()? * length;
                let is_incremental = radius.approach == Approach::Incremental;
                self.modes.polar[0] = if is_incremental { self.modes.polar[0] + value } else { value };
            } else {
                let offset = [start[first] - self.modes.pole[0], start[second] - self.modes.pole[1]];
                self.modes.polar[0] = offset[0].hypot(offset[1]);
            }
            if let Some(angle) = angle {
                let value = angle.value.number()? * DEGREE;
                let is_incremental = angle.approach == Approach::Incremental;
                self.modes.polar[1] = if is_incremental { self.modes.polar[1] + value } else { value };
            }
            let [radius, angle] = self.modes.polar;
            end[first] = self.modes.pole[0] + radius * angle.cos();
            end[second] = self.modes.pole[1] + radius * angle.sin();
            self.is_polar = true;
        } else {
            self.is_polar = false;
        }
        Ok(end)
    }

    /// Returns the corner that RND, CHF, CHR or RNDM give to the end of the motion.
    fn corner(&mut self, words: &mut Words, state: &State) -> Outcome<Option<Corner>> {
        let length = state.modal.length;
        let mut take = |name: &str| -> Outcome<Option<f64>> {
            Ok(words.positive(name, MAX_RATE)?.map(|value| value * length))
        };
        let (round, chamfer, leg) = (take("RND")?, take("CHF")?, take("CHR")?);
        let modal = Some(self.modes.rounding);
        let corner = match (round, chamfer, leg) {
            (_, Some(length), _) => Some(length).filter(|size| *size > 0.0).map(Corner::ChamferLength),
            (_, _, Some(leg)) => Some(leg).filter(|size| *size > 0.0).map(Corner::Chamfer),
            (round, _, _) => round.or(modal).filter(|size| *size > 0.0).map(Corner::Round),
        };
        Ok(corner)
    }

    /// Stores the tangent of the last motion in the plane, in programmed coordinates, for CT.
    pub(super) fn note_tangent(
        &mut self,
        start: &Coordinates,
        end: &Coordinates,
        arc: Option<&PlanarArc>,
        state: &State,
    ) {
        let plane = state.modal.plane;
        let [first, second, _] = plane.axes();
        let direction = match arc {
            Some(arc) => {
                let radius = [end[first] - arc.center[0], end[second] - arc.center[1]];
                let sign = arc.sweep.signum();
                [-radius[1] * sign, radius[0] * sign]
            }
            None => [end[first] - start[first], end[second] - start[second]],
        };
        let length = direction[0].hypot(direction[1]);
        if length > 1e-12 {
            self.tangent = Some((plane, direction.map(|value| value / length)));
        }
    }

    /// Taps along the plane's normal at the feed of a pitch: G331, G332 and G33 of one axis.
    pub(super) fn tap(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let pitches = CENTERS.map(|name| words.number(name));
        let mut pitch = 0.0;
        for value in pitches {
            pitch = value?.unwrap_or(0.0).abs().max(pitch);
        }
        if pitch == 0.0 {
            return Err("G331 and G332 require the pitch I, J or K".to_owned());
        }
        let speed = state.modal.spindle_speed;
        if speed <= 0.0 {
            return Err("G331 and G332 require the spindle speed S".to_owned());
        }
        let feed = state.modal.feed.replace([pitch * state.modal.length * speed; 2]);
        let mode = std::mem::replace(&mut state.modal.feed_mode, super::super::codes::FeedMode::PerMinute);
        let start = state.programmed();
        let end = self.targets(words, &start, state)?;
        let result = state.line_to(&end);
        (state.modal.feed, state.modal.feed_mode) = (feed, mode);
        result
    }
}

/// Returns the tangent at the start of a line or arc in the plane.
fn direction(
    start: &Coordinates,
    end: &Coordinates,
    arc: Option<&PlanarArc>,
    state: &State,
) -> Option<[f64; 2]> {
    let [first, second, _] = state.modal.plane.axes();
    let [x, y] = match arc {
        Some(arc) => {
            let [x, y] = [start[first] - arc.center[0], start[second] - arc.center[1]];
            [-y * arc.sweep.signum(), x * arc.sweep.signum()]
        }
        None => [end[first] - start[first], end[second] - start[second]],
    };
    let length = x.hypot(y);
    (length > 1e-12).then(|| [x / length, y / length])
}

/// Notes a tool length that does not act along Z.
fn note_length_axis(state: &mut State) {
    let axis = state.length_axis();
    if axis != 2 && state.offsets.tool_length != 0.0 && state.offsets.length_axis.is_none() {
        let (plane, letter) = (if axis == 1 { "G18" } else { "G19" }, AXIS_LETTERS[axis]);
        state.assume(format!(
            "{plane}: the tool length acts along {letter}, normal to the plane; program $SC_TOOL_LENGTH_CONST=17 if the \
             machine has this setting, with which it acts along Z in each plane"
        ));
    }
}

/// Rejects words of axes that the machine lacks.
fn require_axes(words: &Words, state: &State) -> Outcome<()> {
    let mut missing = Vec::new();
    for (axis, letter) in AXIS_LETTERS.into_iter().enumerate() {
        // A rotary axis that the machine lacks may stay at 0.
        let moves = words.axes[axis].is_some_and(|(value, _)| !(3..6).contains(&axis) || value != 0.0);
        if moves && !state.options.axes[axis] {
            missing.push(letter);
        }
    }
    if missing.is_empty() { Ok(()) } else { Err(state.reject_axes(&missing)) }
}

/// Completes the end of a line by its angle ANG and one coordinate.
fn complete_line(start: &Coordinates, end: &mut Coordinates, angle: f64, state: &State) -> Outcome<()> {
    let [first, second, _] = state.modal.plane.axes();
    let (sine, cosine) = (angle * DEGREE).sin_cos();
    let moves = [first, second].map(|axis| end[axis] != start[axis]);
    match moves {
        [true, false] if cosine.abs() > STRAIGHT => {
            end[second] = start[second] + (end[first] - start[first]) * sine / cosine;
            Ok(())
        }
        [false, true] if sine.abs() > STRAIGHT => {
            end[first] = start[first] + (end[second] - start[second]) * cosine / sine;
            Ok(())
        }
        _ => {
            Err("ANG requires one coordinate of the plane; post contours of two lines with their end points"
                .to_owned())
        }
    }
}
