//! State of the interpreter between lines: position, offsets and modes.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{Matrix3, Vector3};
use virtual_axes_core::text::escaped;
use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::codes::{CutterCompensation, FeedMode, Motion, PlaneCode, ReturnLevel, ToolLength};
use super::contour::{Contour, Corner};
use super::dialect::Dialect;
use super::error::Outcome;
use super::frame::CoordinateFrame;
use super::okuma;
use super::options::InterpreterOptions;
use super::parameters::{FIRST_OF_CONTROL, FIRST_VARIABLE_OF_CONTROL, LOCALS, ParameterValues};
use super::report::{FileLine, InterpretationReport, count};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates, PathControl, Plane, ProgramStep, is_rotary};

/// Plane of the path that a rotary axis carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Surface {
    /// Cylinder about a rotary axis with a radius, m; words of the rotary axis are angles.
    Cylinder { rotary: usize, radius: f64 },
    /// Plane normal to C: words of C are lengths. X lies along the axis X with C at the angle `base`, rad.
    Polar { base: f64 },
}

/// Distance below which an axis stays in its place, m and rad.
const ROUNDING: f64 = 1e-13;

/// State of the interpreter between lines.
#[derive(Debug)]
pub(super) struct State {
    pub options: InterpreterOptions,
    /// Words without effect, assumptions and errors.
    pub report: InterpretationReport,
    pub parameters: ParameterValues,
    /// End of the last motion: axis positions, or the tool tip if `modal.tcp_length` is set.
    pub position: Coordinates,
    pub offsets: Offsets,
    /// Dialect of the program.
    pub dialect: Dialect,
    /// True if the options name the dialect, false if it was detected.
    pub has_given_dialect: bool,
    /// True after an error in the line of the canned cycle in effect, of which the next lines would be consequences.
    pub has_failed_cycle: bool,
    /// True if the program has set the units, or a note says that it did not.
    pub has_units: bool,
    /// Programmable frame: scaling, mirroring, rotation.
    pub frame: CoordinateFrame,
    /// Tilted plane (G68.2) in the work coordinate system, which the table angles of each position place.
    pub tilt: Option<CoordinateFrame>,
    pub modal: Modal,
    /// Line of the program, from 1: in the file of a subprogram, that of the call.
    pub line: usize,
    /// Line in the file of a subprogram; `None` in the program.
    pub file: Option<FileLine>,
    /// Depth of subprogram calls.
    pub calls: usize,
    /// Value returned by the last subprogram.
    pub returned: Option<f64>,
    /// NURBS that later lines complete.
    pub spline: Option<OpenSpline>,
    /// P and Q, m, of a G5 that the motion before was.
    pub cubic_end: Option<[f64; 2]>,
    /// Steps that wait for the next motion.
    pub contour: Contour,
    /// Corner between the next motion and the one after it.
    pub corner: Option<Corner>,
    /// Macro that follows each motion (G66), and the depth of calls at which it was programmed.
    pub modal_macro: Option<(Jump, usize)>,
    /// Modes that M70 has saved.
    pub saved_modes: Option<Box<Modal>>,
    /// Jump that the line requests.
    pub jump: Option<Jump>,
    /// Steps of the line.
    pub steps: VecDeque<ProgramStep>,
    /// True if the motions of the line are in machine coordinates.
    pub moves_in_machine_coordinates: bool,
    /// True between G10 L50 and G11: the lines have parameters of the control.
    pub enters_parameters: bool,
    /// True after the program end.
    pub has_ended: bool,
    /// Letters of the axes that the program moves and the machine lacks.
    pub missing_axes: RefCell<BTreeSet<char>>,
    /// Variable of macro B without value that was read last; 0 without one.
    pub vacant: Cell<usize>,
    /// Variable without value that an F word has read, as long as no feed is programmed; 0 without one.
    pub vacant_feed: usize,
}

/// Jump of the subprograms that are called by number.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Jump {
    /// M98: subprogram by number.
    Call { program: u32, times: u32 },
    /// M97: lines from a number on.
    Local { number: u32, times: u32 },
    /// G65 and G66: subprogram with arguments.
    Macro { program: u32, times: u32, arguments: Box<[f64; LOCALS]> },
    /// M99, with the line number to return to.
    Return { number: Option<u32> },
    /// GOTO.
    Goto { number: u32 },
    /// MODIN of Okuma: subprogram by name.
    Named { program: String },
}

/// Offsets between programmed coordinates and the position, m and rad.
#[derive(Debug)]
pub(super) struct Offsets {
    /// Index of the work coordinate system: 0 is G54.
    pub active: usize,
    /// Rotations of work coordinate systems about Z (G10 L2 R), rad.
    pub rotations: BTreeMap<usize, f64>,
    /// Offset of G92, and of G52 without a local coordinate system.
    pub shift: Coordinates,
    /// Local coordinate system of Fanuc and Haas (G52).
    pub local: Coordinates,
    /// Offset that G92.3 restores.
    pub saved_shift: Coordinates,
    /// Tool length offset (G43); 0 with tool center point control.
    pub tool_length: f64,
    /// Change of the tool length offset that the next increment of Z adds, with Z of the axes there (Fanuc, Haas), m.
    pub length_change: Option<(f64, f64)>,
    /// Axis of the tool length of Sinumerik in all planes; `None` for the normal of the plane.
    pub length_axis: Option<usize>,
    /// Tip of the tool and axes at the start of tool center point control: without a motion it ends at the same bits.
    pub tcp_start: Option<[Coordinates; 2]>,
}

/// Modes that stay in effect until a line changes them.
#[derive(Debug, Clone)]
pub(super) struct Modal {
    pub motion: Option<Motion>,
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
    /// Code of the tool length in effect.
    pub tool_length_code: Option<ToolLength>,
    /// Code of the cutter compensation in effect.
    pub cutter_compensation_code: Option<CutterCompensation>,
    /// True if I, J and K are the direction of the tool (G43.5).
    pub has_tool_vectors: bool,
    /// Number of the offset with the tool radius (D).
    pub radius_number: Option<u32>,
    /// Polar coordinates (G16): radius, m, and angle, degrees.
    pub polar: Option<[f64; 2]>,
    /// Center of polar coordinates in the plane, m.
    pub polar_center: [f64; 2],
    /// Parts of the programmable frame: scaling (G51), mirroring (G51.1), rotation (G68).
    pub frames: [CoordinateFrame; 3],
    /// Lines of a plane by points or vectors (G68.2 P2, P3) before its last one, by Q: a point, m, and a vector or angle.
    pub plane_points: [Option<[Vector3<f64>; 2]>; 4],
    /// Programmed point of the last G28, m and rad.
    pub between: Coordinates,
    /// Plane of the path that a rotary axis carries (G7.1, G12.1).
    pub surface: Option<Surface>,
    /// True with constant surface speed (G96).
    pub has_surface_speed: bool,
    /// True if coordinates are axis positions (G15 H0 of Okuma).
    pub is_machine: bool,
    /// Level to which canned cycles of Okuma retract, and the one of G71, m.
    pub return_level: (ReturnLevel, Option<f64>),
}

/// Canned cycle with the words that stay in effect for its next lines.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cycle {
    pub code: Motion,
    /// Programmed coordinate of the drilling axis before the first line of the cycle, m.
    pub initial: f64,
    /// Word R, m; of macro B its programmed coordinate.
    pub retract: Option<f64>,
    /// Word of the depth, m; of macro B its programmed coordinate.
    pub bottom: Option<f64>,
    /// Dwell P, s.
    pub dwell: Option<f64>,
    /// Peck Q, m.
    pub peck: Option<f64>,
    /// Words I, J and K: first peck, its reduction and the least peck, or a lateral shift, m.
    pub extra: [Option<f64>; 3],
    /// Factor of feed and speed on the way out of a thread (J of Haas).
    pub retraction_factor: Option<f64>,
}

/// NURBS between G5.2 and G5.3.
#[derive(Debug)]
pub(super) struct OpenSpline {
    pub order: usize,
    pub control: Vec<([f64; 2], f64)>,
}

impl State {
    pub(super) fn new(options: InterpreterOptions) -> Self {
        let modal = Modal {
            motion: options.dialect.filter(|dialect| *dialect != Dialect::LinuxCnc).map(|_| Motion::Rapid),
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
            tool_length_code: None,
            cutter_compensation_code: None,
            has_tool_vectors: false,
            radius_number: None,
            polar: None,
            polar_center: [0.0; 2],
            frames: [CoordinateFrame::identity(); 3],
            plane_points: [None; 4],
            between: [0.0; AXIS_COUNT],
            surface: None,
            has_surface_speed: false,
            is_machine: false,
            return_level: (ReturnLevel::Point, None),
        };
        let none = [0.0; AXIS_COUNT];
        Self {
            report: InterpretationReport::default(),
            parameters: ParameterValues::new(options.dialect.unwrap_or_default()),
            position: options.start,
            offsets: Offsets {
                active: 0,
                rotations: BTreeMap::new(),
                shift: none,
                local: none,
                saved_shift: none,
                tool_length: 0.0,
                length_change: None,
                length_axis: None,
                tcp_start: None,
            },
            dialect: options.dialect.unwrap_or_default(),
            has_given_dialect: false,
            has_failed_cycle: false,
            has_units: false,
            frame: CoordinateFrame::identity(),
            tilt: None,
            modal,
            line: 1,
            file: None,
            calls: 0,
            returned: None,
            spline: None,
            cubic_end: None,
            contour: Contour::default(),
            corner: None,
            modal_macro: None,
            saved_modes: None,
            jump: None,
            steps: VecDeque::new(),
            moves_in_machine_coordinates: false,
            enters_parameters: false,
            has_ended: false,
            missing_axes: RefCell::default(),
            vacant: Cell::new(0),
            vacant_feed: 0,
            options,
        }
    }

    /// Returns true if lengths are in millimeters.
    pub(super) fn is_metric(&self) -> bool {
        self.modal.length == MILLIMETER
    }

    /// Returns the unit of an axis, m or rad.
    pub(super) fn unit(&self, axis: usize) -> f64 {
        if is_rotary(axis) { DEGREE } else { self.modal.length }
    }

    /// Returns the position of an axis at programmed coordinate 0 without rotations and scaling, m or rad.
    pub(super) fn origin(&self, axis: usize) -> f64 {
        let work = self.options.work_offsets[self.offsets.active][axis];
        let tool = if axis == self.length_axis() { self.offsets.tool_length } else { 0.0 };
        work + self.offsets.shift[axis] + self.offsets.local[axis] + tool
    }

    /// Returns the axis along which the tool length acts: Z, and of Sinumerik the normal of the plane.
    pub(super) fn length_axis(&self) -> usize {
        match self.dialect {
            Dialect::Sinumerik => self.offsets.length_axis.unwrap_or(self.modal.plane.axes()[2]),
            _ => 2,
        }
    }

    /// Returns the programmed coordinate of the position, in units of the program.
    pub(super) fn coordinate(&self, axis: usize) -> f64 {
        self.programmed()[axis] / self.unit(axis)
    }

    /// Returns the error of words of axes that the machine lacks.
    pub(super) fn reject_axes(&self, letters: &[char]) -> String {
        self.missing_axes.borrow_mut().extend(letters);
        let known = AXIS_LETTERS.into_iter().zip(self.options.axes).filter(|(_, has)| *has);
        let known = known.map(|(letter, _)| letter.to_string()).collect::<Vec<_>>().join(" ");
        let missing = letters.iter().map(char::to_string).collect::<Vec<_>>().join(" ");
        format!("word {missing}: the machine has no axis {missing}; axes: {known}")
    }

    /// Returns what gives a variable of macro B its value, for a message.
    pub(super) fn value_source(&self, variable: usize) -> String {
        let has_arguments = variable <= LOCALS && self.calls == 0;
        let source = match has_arguments {
            true => "a macro with arguments runs by the program that calls it, as with G65 P9010 X10",
            false => "set it at the start of the program to its value in the control",
        };
        format!("#{variable} has no value: {source}")
    }

    /// Adds an assumption to the report.
    pub(super) fn assume(&mut self, text: String) {
        count(&mut self.report.assumptions, text, self.line, &self.file);
    }

    /// Adds a code without effect to the report.
    pub(super) fn note_without_effect(&mut self, name: String) {
        count(&mut self.report.without_effect, name, self.line, &self.file);
    }

    /// Reports an error and continues, if the options require a report of all errors.
    pub(super) fn reject(&mut self, reason: String) -> Outcome<()> {
        if !self.options.reports_all_errors {
            return Err(reason);
        }
        count(&mut self.report.errors, escaped(&reason), self.line, &self.file);
        Ok(())
    }

    /// Returns the map from programmed coordinates X, Y and Z to the position, m.
    pub(super) fn map(&self) -> CoordinateFrame {
        self.map_with(&self.position)
    }

    /// Returns the map with A, B and C at the axis positions of `at`.
    fn map_with(&self, at: &Coordinates) -> CoordinateFrame {
        let (Some(tilt), Some(kinematics), None) =
            (&self.tilt, &self.options.kinematics, self.modal.tcp_length)
        else {
            return self.plane_map(self.offsets.tool_length);
        };
        // The tables carry the tilted plane.
        let placed = |point: Vector3<f64>| {
            let mut position = *at;
            position[..3].copy_from_slice(point.as_slice());
            kinematics.axis_positions(&mut position, self.offsets.tool_length);
            Vector3::from_column_slice(&position[..3])
        };
        let origin = placed(Vector3::zeros());
        let columns = [0, 1, 2].map(|axis| placed(Vector3::ith(axis, 1.0)) - origin);
        let tables = CoordinateFrame { linear: Matrix3::from_columns(&columns), origin };
        tables.then(&self.plane_map_of(0.0, &tilt.then(&self.frame)))
    }

    fn plane_map(&self, tool_length: f64) -> CoordinateFrame {
        match &self.tilt {
            Some(tilt) => self.plane_map_of(tool_length, &tilt.then(&self.frame)),
            None => self.plane_map_of(tool_length, &self.frame),
        }
    }

    fn plane_map_of(&self, tool_length: f64, frame: &CoordinateFrame) -> CoordinateFrame {
        let vector = |coordinates: &Coordinates| Vector3::from_column_slice(&coordinates[..3]);
        let system = self.offsets.active;
        let tool = Vector3::ith(self.length_axis(), tool_length);
        let work = CoordinateFrame::shift(vector(&self.options.work_offsets[system]) + tool);
        let rotation = self.offsets.rotations.get(&system).copied().unwrap_or(0.0);
        let shift = vector(&self.offsets.shift) + vector(&self.offsets.local);
        let outer = match rotation == 0.0 {
            true => CoordinateFrame::shift(work.origin + shift),
            false => work.then(&CoordinateFrame::rotation(2, rotation)).then(&CoordinateFrame::shift(shift)),
        };
        if frame.is_identity() { outer } else { outer.then(frame) }
    }

    /// Returns the programmed coordinates of the position, m and rad.
    pub(super) fn programmed(&self) -> Coordinates {
        let mut programmed: Coordinates = std::array::from_fn(|axis| self.position[axis] - self.origin(axis));
        let point = self.map().invert(&Vector3::from_column_slice(&self.position[..3]));
        programmed[..3].copy_from_slice(point.as_slice());
        programmed
    }

    /// Returns the position at programmed coordinates, m and rad. An axis that does not move keeps its value without
    /// rounding.
    pub(super) fn position_at(&self, programmed: &Coordinates) -> Coordinates {
        let mut position: Coordinates = std::array::from_fn(|axis| programmed[axis] + self.origin(axis));
        let point = self.map_with(&position).apply(&Vector3::from_column_slice(&programmed[..3]));
        position[..3].copy_from_slice(point.as_slice());
        for (value, before) in position.iter_mut().zip(self.position) {
            if (*value - before).abs() < ROUNDING {
                *value = before;
            }
        }
        position
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
            // Diameter of the tool in the spindle.
            5410 => Some(
                self.options.tools.get(self.modal.tool).map_or(0.0, |tool| 2.0 * tool.radius / MILLIMETER),
            ),
            5420..=5428 => Some(self.coordinate(number - 5420)),
            5601..=5602 => None,
            _ => Some(self.parameters.of_control(number).unwrap_or(0.0)),
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
            "_task"
            | "_spindle_css_mode"
            | "_ijk_absolute_mode"
            | "_lathe_diameter_mode"
            | "_adaptive_feed"
            | "_feed_hold"
            | "_current_pocket"
            | "_selected_pocket" => Some(0.0),
            "_spindle_rpm_mode" | "_lathe_radius_mode" | "_feed_override" | "_speed_override" => Some(1.0),
            "_vmajor" => Some(2.9),
            "_vminor" => Some(0.0),
            "_retract_old_z" => flag(modal.retracts_to_initial),
            "_retract_r_plane" => flag(!modal.retracts_to_initial),
            "_motion_mode" => Some(f64::from(modal.motion.unwrap_or(Motion::Cancel).number())),
            "_plane" => Some(f64::from(match modal.plane {
                Plane::Xy => PlaneCode::Xy.number(),
                Plane::Zx => PlaneCode::Zx.number(),
                Plane::Yz => PlaneCode::Yz.number(),
            })),
            "_coord_system" => Some(match self.offsets.active {
                index @ 0..6 => 540.0 + 10.0 * index as f64,
                index => 585.0 + index as f64,
            }),
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

    /// Returns the value of `#number`.
    pub(super) fn numbered(&self, number: usize) -> Outcome<f64> {
        if self.dialect.has_macro_b() && number >= FIRST_VARIABLE_OF_CONTROL {
            let value = self.control_variable(number);
            if value.is_nan() {
                self.vacant.set(number);
            }
            return Ok(value);
        }
        let value = match number < FIRST_OF_CONTROL {
            true => self.parameters.numbered(number),
            false => self.control_parameter(number),
        };
        if number != 0 && value.is_some_and(f64::is_nan) {
            self.vacant.set(number);
        }
        value.ok_or_else(|| format!("#{number} is not supported; supported: #1 to #5600"))
    }

    /// Returns the value of `#<name>`.
    pub(super) fn named(&self, name: &str) -> Outcome<f64> {
        let value = self.control_name(name).or_else(|| self.parameters.named(name));
        if let (None, Some(name)) = (value, name.strip_prefix(okuma::PREFIX))
            && self.dialect == Dialect::Okuma
        {
            // Variables of the control begin with V.
            let shown = name.to_uppercase();
            if let Some(axis) = okuma::limit_axis(name) {
                let missing = || format!("{shown}: the machine has no such travel limit");
                return self.upper_limit(axis).ok_or_else(missing);
            }
            let missing = || format!("{shown}: the variable has no value: set it before it is used");
            return name.starts_with('v').then_some(0.0).ok_or_else(missing);
        }
        let is_of_control = name.starts_with("_hal[") || name.starts_with("_ini[");
        let remedy = match is_of_control {
            true => {
                "is a value of the running control, which a simulation lacks: write a number in its place"
            }
            false => "has no value: set it before it is used",
        };
        value.ok_or_else(|| format!("#<{name}> {remedy}"))
    }

    /// Returns true if `#<name>` has a value.
    pub(super) fn is_defined(&self, name: &str) -> bool {
        self.control_name(name).is_some() || self.parameters.named(name).is_some()
    }
}
