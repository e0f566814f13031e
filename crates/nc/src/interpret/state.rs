//! State of the interpreter between lines: position, offsets and modes.

use std::collections::VecDeque;

use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::cycles::Cycle;
use super::error::Outcome;
use super::options::InterpreterOptions;
use super::parameters::{FIRST_OF_CONTROL, ParameterValues, Variables};
use super::spline::OpenSpline;
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates, PathControl, Plane, ProgramEvent, ProgramStep};

/// State of the interpreter between lines.
#[derive(Debug)]
pub(super) struct State {
    pub options: InterpreterOptions,
    pub parameters: ParameterValues,
    /// End of the last motion: axis positions, or the tool tip if `modal.tcp_length` is set.
    pub position: Coordinates,
    pub offsets: Offsets,
    pub modal: Modal,
    /// Source line, from 1.
    pub line: usize,
    /// Depth of subprogram calls.
    pub calls: usize,
    /// Value returned by the last subprogram.
    pub returned: Option<f64>,
    /// NURBS that later lines complete.
    pub spline: Option<OpenSpline>,
    /// Jump that the line requests.
    pub jump: Option<Jump>,
    /// Steps of the line.
    pub steps: VecDeque<ProgramStep>,
    /// True after the program end.
    pub has_ended: bool,
}

/// Jump of the subprograms that are called by number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Jump {
    /// M98.
    Call { program: u32, times: u32 },
    /// M99.
    Return,
}

/// Offsets between programmed coordinates and the position, m and rad.
#[derive(Debug)]
pub(super) struct Offsets {
    /// Index of the work coordinate system.
    pub active: usize,
    /// Offset of G92 or G52.
    pub shift: Coordinates,
    /// Offset that G92.3 restores.
    pub saved_shift: Coordinates,
    /// Tool length offset along Z (G43); 0 with tool center point control.
    pub tool_length: f64,
}

/// Modes that stay in effect until a line changes them.
#[derive(Debug)]
pub(super) struct Modal {
    /// G code of the motion mode, in tenths.
    pub motion: Option<u16>,
    pub plane: Plane,
    /// Canned cycle of the motion mode.
    pub cycle: Option<Cycle>,
    /// True if canned cycles retract to the initial position (G98), false for the plane R (G99).
    pub retracts_to_initial: bool,
    /// Length unit, m.
    pub length: f64,
    pub is_incremental: bool,
    pub has_absolute_centers: bool,
    pub feed_mode: FeedMode,
    /// F word.
    pub feed_word: f64,
    /// F word in meters and radians by the length unit of its line; per minute, per revolution or per motion.
    pub feed: Option<[f64; 2]>,
    pub path_control: PathControl,
    /// Spindle speed of the S word, rpm.
    pub spindle_speed: f64,
    /// Direction of the spindle: 1 clockwise, −1 counterclockwise, 0 stopped.
    pub spindle_direction: f64,
    pub selected_tool: u32,
    pub tool: u32,
    pub mist: bool,
    pub flood: bool,
    /// Tool length of tool center point control, m.
    pub tcp_length: Option<f64>,
}

/// Meaning of the F word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FeedMode {
    /// G93.
    InverseTime,
    /// G94.
    PerMinute,
    /// G95.
    PerRevolution,
}

impl State {
    pub(super) fn new(options: InterpreterOptions) -> Self {
        let modal = Modal {
            motion: None,
            plane: Plane::Xy,
            cycle: None,
            retracts_to_initial: true,
            length: MILLIMETER,
            is_incremental: false,
            has_absolute_centers: false,
            feed_mode: FeedMode::PerMinute,
            feed_word: 0.0,
            feed: None,
            path_control: options.path_control,
            spindle_speed: 0.0,
            spindle_direction: 0.0,
            selected_tool: 0,
            tool: 0,
            mist: false,
            flood: false,
            tcp_length: None,
        };
        let none = [0.0; AXIS_COUNT];
        Self {
            parameters: ParameterValues::new(),
            position: options.start,
            offsets: Offsets { active: 0, shift: none, saved_shift: none, tool_length: 0.0 },
            modal,
            line: 1,
            calls: 0,
            returned: None,
            spline: None,
            jump: None,
            steps: VecDeque::new(),
            has_ended: false,
            options,
        }
    }

    /// Appends an event to the steps.
    pub(super) fn push_event(&mut self, event: ProgramEvent) {
        self.steps.push_back(ProgramStep::Event { line: self.line, event });
    }

    /// Returns the unit of an axis, m or rad.
    pub(super) fn unit(&self, axis: usize) -> f64 {
        if is_rotary(axis) { DEGREE } else { self.modal.length }
    }

    /// Returns the position of an axis at programmed coordinate 0, m or rad.
    pub(super) fn origin(&self, axis: usize) -> f64 {
        let work = self.options.work_offsets[self.offsets.active][axis];
        let tool = if axis == 2 { self.offsets.tool_length } else { 0.0 };
        work + self.offsets.shift[axis] + tool
    }

    /// Returns the programmed coordinate of the position, in units of the program.
    pub(super) fn coordinate(&self, axis: usize) -> f64 {
        (self.position[axis] - self.origin(axis)) / self.unit(axis)
    }

    /// Returns a parameter of the control; offsets are in mm and degrees, the unit of the control.
    fn control_parameter(&self, number: usize) -> Option<f64> {
        let value = |coordinates: &Coordinates, first: usize| {
            let axis = number.checked_sub(first).filter(|axis| *axis < AXIS_COUNT)?;
            Some(coordinates[axis] / if is_rotary(axis) { DEGREE } else { MILLIMETER })
        };
        let tool = [0.0, 0.0, self.offsets.tool_length + self.modal.tcp_length.unwrap_or(0.0)];
        let system = number.saturating_sub(5221) / 20;
        match number {
            5161..=5169 => value(&self.options.references[0], 5161),
            5181..=5189 => value(&self.options.references[1], 5181),
            5210 => Some(f64::from(self.offsets.shift.iter().any(|shift| *shift != 0.0))),
            5211..=5219 => value(&self.offsets.saved_shift, 5211),
            5220 => Some(self.offsets.active as f64 + 1.0),
            5221..=5389 => value(self.options.work_offsets.get(system)?, 5221 + 20 * system),
            5400 => Some(f64::from(self.modal.tool)),
            5401..=5409 => tool.get(number - 5401).map(|length| length / MILLIMETER).or(Some(0.0)),
            5420..=5428 => Some(self.coordinate(number - 5420)),
            _ => None,
        }
    }

    /// Returns a named parameter of the control.
    fn control_name(&self, name: &str) -> Option<f64> {
        let modal = &self.modal;
        let flag = |flag: bool| Some(f64::from(flag));
        let mut letters = name.strip_prefix('_')?.chars();
        if let (Some(letter), None) = (letters.next(), letters.next())
            && let Some(axis) = AXIS_LETTERS.iter().position(|axis| axis.eq_ignore_ascii_case(&letter))
        {
            return Some(self.coordinate(axis));
        }
        match name {
            "_line" => Some(self.line as f64),
            "_motion_mode" => Some(modal.motion.map_or(800.0, f64::from)),
            "_plane" => Some(match modal.plane {
                Plane::Xy => 170.0,
                Plane::Zx => 180.0,
                Plane::Yz => 190.0,
            }),
            "_coord_system" => {
                let active = self.offsets.active;
                Some(if active < 6 { 540.0 + 10.0 * active as f64 } else { 585.0 + active as f64 })
            }
            "_metric" => flag(modal.length == MILLIMETER),
            "_imperial" => flag(modal.length != MILLIMETER),
            "_incremental" => flag(modal.is_incremental),
            "_absolute" => flag(!modal.is_incremental),
            "_inverse_time" => flag(modal.feed_mode == FeedMode::InverseTime),
            "_units_per_minute" => flag(modal.feed_mode == FeedMode::PerMinute),
            "_units_per_rev" => flag(modal.feed_mode == FeedMode::PerRevolution),
            "_feed" => Some(modal.feed_word),
            "_rpm" => Some(modal.spindle_speed),
            "_spindle_on" => flag(modal.spindle_direction != 0.0),
            "_spindle_cw" => flag(modal.spindle_direction > 0.0),
            "_mist" => flag(modal.mist),
            "_flood" => flag(modal.flood),
            "_current_tool" => Some(f64::from(modal.tool)),
            "_selected_tool" => Some(f64::from(modal.selected_tool)),
            "_call_level" => Some(self.calls as f64),
            "_value" => Some(self.returned.unwrap_or(0.0)),
            "_value_returned" => flag(self.returned.is_some()),
            _ => None,
        }
    }
}

impl Variables for State {
    fn numbered(&self, number: usize) -> Outcome<f64> {
        let value = match number < FIRST_OF_CONTROL {
            true => self.parameters.numbered(number),
            false => self.control_parameter(number),
        };
        let supported =
            "#1 to #4999, #5161 to #5169, #5181 to #5189, #5210 to #5389, #5400 to #5409, #5420 to #5428";
        value.ok_or_else(|| format!("#{number} is not supported; supported: {supported}"))
    }

    fn named(&self, name: &str) -> Outcome<f64> {
        let value = self.control_name(name).or_else(|| self.parameters.named(name));
        value.ok_or_else(|| format!("#<{name}> has no value: set it before it is used"))
    }

    fn is_defined(&self, name: &str) -> bool {
        self.control_name(name).is_some() || self.parameters.named(name).is_some()
    }
}

/// Returns true for A, B and C.
pub(super) fn is_rotary(axis: usize) -> bool {
    (3..6).contains(&axis)
}
