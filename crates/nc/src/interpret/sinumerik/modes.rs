//! Modes of a program that stay in effect, beside those of the interpreter's state.

use std::collections::BTreeMap;

use virtual_axes_core::units::{DEGREE, MILLIMETER, Rounded};

use super::super::error::Outcome;
use super::super::state::State;
use super::frame::AxisFrame;
use crate::motion::{AXIS_COUNT, Blend, PathControl};

/// Contour tolerance of G642 to G645 without CTOL and CYCLE832: that of the control, m.
const CONTOUR_TOLERANCE: f64 = 0.01 * MILLIMETER;
/// Deviation of a smoothed right angle over the distance ADIS at which the smoothing begins: that of a parabola.
const DEVIATION_PER_DISTANCE: f64 = 0.354;

/// Smallest product of the scales of a frame.
const LEAST_SCALE: f64 = 1e-12;

/// Motion mode of G codes of group 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MotionMode {
    /// G0.
    Rapid,
    /// G1.
    Line,
    /// G2.
    Clockwise,
    /// G3.
    Counterclockwise,
    /// CIP: circle through a point.
    ThroughPoint,
    /// CT: circle with tangential start.
    Tangential,
}

/// Path control of G codes of group 10.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PathMode {
    /// That of the options.
    Initial,
    /// G60.
    ExactStop,
    /// G64.
    Continuous,
    /// G641, with ADIS, m.
    Distance(f64),
    /// G642 to G645.
    Tolerance,
}

/// Interpolation and angles of the orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct OrientationMode {
    /// True if the rotary axes are interpolated (ORIAXES, ORIMKS), false for the great circle of the tool (ORIVECT).
    pub interpolates_axes: bool,
    /// True for ORIMKS: vectors in the coordinate system of the machine.
    pub is_of_machine: bool,
    pub angles: OrientationAngles,
}

/// Meaning of A2, B2 and C2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OrientationAngles {
    /// ORIEULER: about Z, the new X, and the new Z.
    Euler,
    /// ORIRPY: about Z by C2, the new Y by B2, the new X by A2.
    Rpy,
    /// ORIRPY2: about X by A2, the new Y by B2, the new Z by C2.
    Rpy2,
}

impl Default for OrientationMode {
    fn default() -> Self {
        Self { interpolates_axes: false, is_of_machine: false, angles: OrientationAngles::Euler }
    }
}

impl OrientationMode {
    /// Sets the mode by a keyword; returns false if it is none.
    pub(super) fn set(&mut self, keyword: &str) -> bool {
        match keyword {
            "ORIAXES" => self.interpolates_axes = true,
            "ORIVECT" | "ORIPLANE" => self.interpolates_axes = false,
            "ORIMKS" => self.is_of_machine = true,
            "ORIWKS" => self.is_of_machine = false,
            "ORIEULER" => self.angles = OrientationAngles::Euler,
            "ORIRPY" => self.angles = OrientationAngles::Rpy,
            "ORIRPY2" => self.angles = OrientationAngles::Rpy2,
            _ => return false,
        }
        true
    }
}

/// Modes of the program.
#[derive(Debug)]
pub(super) struct Modes {
    pub motion: MotionMode,
    pub path: PathMode,
    /// Contour tolerance (CTOL, CYCLE832), m.
    pub tolerance: Option<f64>,
    /// Orientation tolerance (OTOL, CYCLE832), rad.
    pub rotary_tolerance: Option<f64>,
    /// Distance ADIS, m.
    pub smoothing_distance: f64,
    /// Programmable frame.
    pub frame: AxisFrame,
    /// Swiveled plane (CYCLE800).
    pub tilt: Option<AxisFrame>,
    /// False after G500.
    pub has_settable_frame: bool,
    /// Cutting edge D.
    pub edge: u32,
    /// ProgramUnit of feeds, m: that of G700 and G710.
    pub feed_length: f64,
    /// Pole of polar coordinates along the axes of the plane, m.
    pub pole: [f64; 2],
    /// Polar radius, m, and angle, rad, of the last block.
    pub polar: [f64; 2],
    /// Modal rounding (RNDM), m.
    pub rounding: f64,
    pub orientation: OrientationMode,
    /// Side of the tool with G41 and G42.
    pub is_tool_left: Option<bool>,
    /// True for G340: smooth approach and retraction with a helix, false for G341.
    pub approaches_in_space: bool,
    /// Numbers of the tools without entry in the tool table, by name.
    pub tool_names: BTreeMap<String, u32>,
}

impl Default for Modes {
    fn default() -> Self {
        Self {
            motion: MotionMode::Line,
            path: PathMode::Initial,
            tolerance: None,
            rotary_tolerance: None,
            smoothing_distance: 0.0,
            frame: AxisFrame::default(),
            tilt: None,
            has_settable_frame: true,
            edge: 1,
            feed_length: MILLIMETER,
            pole: [0.0; 2],
            polar: [0.0; 2],
            rounding: 0.0,
            orientation: OrientationMode::default(),
            is_tool_left: None,
            approaches_in_space: true,
            tool_names: BTreeMap::new(),
        }
    }
}

impl Modes {
    /// Sets the path control of the state.
    pub(super) fn update_path_control(&self, state: &mut State) {
        let blend = |tolerance: Option<f64>| {
            let rotary = tolerance.map(|tolerance| tolerance / MILLIMETER * DEGREE);
            PathControl::Blend(Blend {
                tolerance,
                rotary_tolerance: self.rotary_tolerance.filter(|_| tolerance.is_some()).or(rotary),
                merge_tolerance: None,
            })
        };
        state.modal.path_control = match self.path {
            PathMode::Initial => state.options.path_control,
            PathMode::ExactStop => PathControl::ExactStop,
            PathMode::Continuous => blend(None),
            PathMode::Distance(distance) if distance > 0.0 => blend(Some(DEVIATION_PER_DISTANCE * distance)),
            PathMode::Distance(_) => PathControl::ExactPath,
            PathMode::Tolerance => blend(Some(self.tolerance.unwrap_or(CONTOUR_TOLERANCE))),
        };
    }

    /// Sets the frames of the state: settable frame, swiveled plane and programmable frame.
    pub(super) fn update_frame(&self, state: &mut State) -> Outcome<()> {
        let base = state.options.work_offsets[state.offsets.active];
        // Without a settable frame (G500), that of the active system is taken back.
        let none = if self.has_settable_frame { [0.0; AXIS_COUNT] } else { base.map(|offset| -offset) };
        let plane = AxisFrame::translation(none).then(&self.tilt.unwrap_or_default());
        let [tilt, frame] = [&plane, &self.frame].map(AxisFrame::linear_map);
        if frame.linear.determinant().abs() < LEAST_SCALE {
            return Err("a frame with the scale 0: program a scale above 0".to_owned());
        }
        let total = self.frame.total();
        let shift: Vec<f64> = (3..AXIS_COUNT).map(|axis| none[axis] + total[axis]).collect();
        let tilt = (!tilt.is_identity()).then_some(tilt);
        if (tilt, frame) != (state.tilt, state.frame) || state.offsets.shift[3..] != shift {
            state.finish_contour()?;
            (state.tilt, state.frame) = (tilt, frame);
            state.offsets.shift[3..].copy_from_slice(&shift);
        }
        Ok(())
    }

    /// Returns the length of the active cutting edge, m.
    pub(super) fn tool_length(&self, state: &mut State) -> Outcome<f64> {
        let number = active_tool(state);
        let is_named = self.tool_names.values().any(|named| *named == number);
        if self.edge > 1 {
            state.assume(format!(
                "D{}: the tool table has one cutting edge, its length and radius",
                self.edge
            ));
        }
        match (self.edge, state.options.default_tool_length) {
            (0, _) => Ok(0.0),
            (_, Some(length)) if is_named => {
                let tool = self.tool_text(number);
                state.assume(format!(
                    "{tool} is not in the tool table: length {} mm",
                    Rounded(length / MILLIMETER)
                ));
                Ok(length)
            }
            _ => state.tool_length(number),
        }
    }

    /// Returns the name of a tool for a message.
    pub(super) fn tool_text(&self, number: u32) -> String {
        let name = self.tool_names.iter().find(|(_, named)| **named == number);
        name.map_or_else(|| format!("tool {number}"), |(name, _)| format!("tool {name:?}"))
    }

    /// Sets the tool length of the active cutting edge.
    pub(super) fn update_tool_length(&self, state: &mut State) -> Outcome<()> {
        let length = self.tool_length(state)?;
        let present = state.modal.tcp_length.unwrap_or(state.offsets.tool_length);
        if length == present {
            return Ok(());
        }
        state.finish_contour()?;
        if state.modal.tcp_length.is_some() {
            state.leave_tcp();
            state.enter_tcp(length)?;
        } else {
            state.offsets.tool_length = length;
        }
        Ok(())
    }
}

/// Returns the number of the tool in the spindle; without a change (M6) of the one selected last.
pub(super) fn active_tool(state: &State) -> u32 {
    if state.modal.tool == 0 { state.modal.selected_tool } else { state.modal.tool }
}
