//! Options of the interpreter.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::path::PathBuf;

use nalgebra::{Matrix3, Vector3};
use virtual_axes_core::config::{MachineConfig, PartProgramConfig};
use virtual_axes_core::kinematics::{Kinematics, ToolPose};
use virtual_axes_core::units::{DEGREE, Rounded};

use super::dialect::Dialect;
use super::error::Outcome;
use super::ignored::IgnoredCodes;
use super::limits::{ADDITIONAL_OFFSET_COUNT, REPEATED_LINES, WORK_OFFSET_COUNT};
use super::tools::ToolTable;
use super::work_offset::WorkOffset;
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Blend, Coordinates, PathControl};

/// Difference of two directions, and of an angle from its travel limit, that is rounding, rad.
const SAME_DIRECTION: f64 = 1e-9;

/// Options of the interpreter: machine, offsets and tolerances that the program relies on.
#[derive(Debug, Clone)]
pub struct InterpreterOptions {
    /// Axes of the machine, in the order of [`Coordinates`]; words of other axes are rejected.
    pub axes: [bool; AXIS_COUNT],
    /// Axis positions at the program start, m and rad.
    pub start: Coordinates,
    /// Work offsets G54 to G59.3 and G54.1 P1 to P300, m and rad.
    pub work_offsets: Vec<Coordinates>,
    /// Indices of the work offsets that are given; `None` if none is an assumption.
    pub given_work_offsets: Option<BTreeSet<usize>>,
    /// Upper travel limits, at which rapid traverses of Okuma end, m and rad.
    pub upper_limits: Coordinates,
    /// Axis positions of G28 and G30, m and rad.
    pub references: [Coordinates; 2],
    /// Dialect; `None` detects it from the content of the program.
    pub dialect: Option<Dialect>,
    /// Tool table: lengths (H word) and radii (D word).
    pub tools: ToolTable,
    /// Length of tools without entry in `tools`, m; `None` rejects them.
    pub default_tool_length: Option<f64>,
    /// Duration of a tool change (M6), s.
    pub tool_change_time: f64,
    /// Duration of a change of the spindle speed, s.
    pub spindle_time: f64,
    /// Path control mode at the program start.
    pub path_control: PathControl,
    /// G and M codes that are accepted without effect.
    pub ignored: IgnoredCodes,
    /// True if lines that begin with a slash are skipped (block delete).
    pub skips_optional_lines: bool,
    /// Number of lines that loops and subprograms may repeat.
    pub repeated_lines: u64,
    /// True if the interpreter continues after an error, for a report of all of them.
    pub reports_all_errors: bool,
    /// Folder with the files of subprograms; `None` for those in the program alone.
    pub subprogram_folder: Option<PathBuf>,
    /// Folder, without links in its path, that contains every file of a subprogram after links are followed; `None` for any.
    pub subprogram_root: Option<PathBuf>,
    /// Kinematics for tool center point control; `None` rejects G43.4.
    pub kinematics: Option<TipTransform>,
}

impl Default for InterpreterOptions {
    /// Returns a machine with all axes, zero offsets, tools of length 0, and blending without tolerance.
    fn default() -> Self {
        Self {
            axes: [true; AXIS_COUNT],
            start: [0.0; AXIS_COUNT],
            work_offsets: vec![[0.0; AXIS_COUNT]; WORK_OFFSET_COUNT + ADDITIONAL_OFFSET_COUNT],
            given_work_offsets: None,
            upper_limits: [f64::INFINITY; AXIS_COUNT],
            references: [[0.0; AXIS_COUNT]; 2],
            dialect: None,
            tools: ToolTable::default(),
            default_tool_length: Some(0.0),
            tool_change_time: 0.0,
            spindle_time: 0.0,
            path_control: PathControl::Blend(Blend {
                tolerance: None,
                rotary_tolerance: None,
                merge_tolerance: None,
            }),
            ignored: IgnoredCodes::default(),
            skips_optional_lines: false,
            repeated_lines: REPEATED_LINES,
            reports_all_errors: false,
            subprogram_folder: None,
            subprogram_root: None,
            kinematics: None,
        }
    }
}

impl InterpreterOptions {
    /// Returns the options for a machine: its axes by the letters of their names, its kinematics, the origin of its
    /// workpiece frame as all work offsets, and its tool length for all tools. The program starts with all axes at 0.
    pub fn for_machine(machine: &MachineConfig) -> Self {
        let geometry = *machine.kinematics();
        let transform = TipTransform::new(machine);
        let mut options = Self { axes: [false; AXIS_COUNT], ..Self::default() };
        for (axis, joint) in transform.joints.iter().zip(machine.axes()) {
            let Some(axis) = axis else { continue };
            options.axes[*axis] = true;
            options.upper_limits[*axis] = joint.limits().travel_max;
        }
        for offset in &mut options.work_offsets {
            offset[..3].copy_from_slice(&geometry.workpiece);
        }
        options.given_work_offsets = Some([0].into());
        options.default_tool_length = Some(geometry.tool_length);
        options.kinematics = Some(transform);
        options
    }

    /// Sets dialect, work offsets, tools and times to those of a machine file.
    ///
    /// # Errors
    ///
    /// Returns an error with the parameter whose text is invalid, or with the file that cannot be read.
    pub fn with_setup(mut self, setup: &PartProgramConfig) -> Result<Self, String> {
        let of = |key: &str, error: &str| format!("part_program.{key}: {error}");
        if let Some(name) = &setup.dialect {
            self.dialect = Some(name.parse().map_err(|error: String| of("dialect", &error))?);
        }
        for text in setup.work_offsets.iter().flatten() {
            self.set_work_offset(&text.parse().map_err(|error: String| of("work_offsets", &error))?);
        }
        let mut tools = match &setup.tool_table {
            Some(path) => ToolTable::from_file(path).map_err(|error| of("tool_table", &error))?,
            None => ToolTable::default(),
        };
        if let Some(lines) = &setup.tools {
            tools.replace_with(ToolTable::parse(&lines.join("\n")).map_err(|error| of("tools", &error))?);
        }
        self.set_tools(tools);
        (self.tool_change_time, self.spindle_time) = (setup.tool_change_time, setup.spindle_time);
        Ok(self)
    }

    /// Sets a work offset, which counts as given.
    pub(crate) fn set_work_offset(&mut self, WorkOffset { index, coordinates }: &WorkOffset) {
        self.work_offsets[*index] = *coordinates;
        if let Some(given) = &mut self.given_work_offsets {
            given.insert(*index);
        }
    }

    /// Sets the tools; with any, a tool that is missing has the length 0. Without one, nothing changes.
    pub(crate) fn set_tools(&mut self, tools: ToolTable) {
        if !tools.is_empty() {
            self.tools = tools;
            self.default_tool_length = Some(0.0);
        }
    }

    /// Sets the axis positions at the program start to `joints`, m and rad, in the order of the machine of
    /// [`for_machine`](Self::for_machine).
    #[must_use]
    pub fn starting_at(mut self, joints: &[f64]) -> Self {
        let axes = self.kinematics.iter().flat_map(|transform| &transform.joints);
        for (axis, position) in axes.zip(joints) {
            if let Some(axis) = axis {
                self.start[*axis] = *position;
            }
        }
        self
    }
}

/// Transformation between axis positions and the tool tip as fixed to the workpiece.
#[derive(Debug, Clone)]
pub struct TipTransform {
    kinematics: Kinematics,
    /// Origin of the workpiece frame in the machine frame, m.
    workpiece: [f64; 3],
    /// Index in [`Coordinates`] of each joint of the machine.
    joints: Vec<Option<usize>>,
    /// Travel limits of each joint, m or rad.
    travel: Vec<[f64; 2]>,
}

impl TipTransform {
    /// Creates the transformation of a machine.
    pub fn new(machine: &MachineConfig) -> Self {
        let letter = |name: &str| {
            AXIS_LETTERS.iter().position(|letter| name.eq_ignore_ascii_case(&letter.to_string()))
        };
        let joints = machine.axes().iter().map(|axis| letter(axis.name())).collect();
        let limits = machine.axes().iter().map(|axis| axis.limits());
        let travel = limits.map(|limits| [limits.travel_min, limits.travel_max]).collect();
        Self {
            kinematics: Kinematics::new(machine),
            workpiece: machine.kinematics().workpiece,
            joints,
            travel,
        }
    }

    /// Computes the joint positions of the machine, in its order, at a position of a motion. `tcp_length` is
    /// [`ProgramMotion::tcp_length`](crate::motion::ProgramMotion::tcp_length).
    pub fn joints(&self, position: &Coordinates, tcp_length: Option<f64>) -> Vec<f64> {
        let position = self.positions(position, tcp_length);
        self.joints.iter().map(|axis| axis.map_or(0.0, |axis| position[axis])).collect()
    }

    /// Computes the axis positions at a position of a motion, as [`joints`](Self::joints) does.
    pub fn positions(&self, position: &Coordinates, tcp_length: Option<f64>) -> Coordinates {
        let mut position = *position;
        if let Some(length) = tcp_length {
            self.axis_positions(&mut position, length);
        }
        position
    }

    /// Computes the tip of a tool at axis positions, in machine coordinates with the tables at 0, m and rad.
    pub fn tip_of(&self, axes: &Coordinates, tool_length: f64) -> Coordinates {
        let mut tip = *axes;
        self.tip(&mut tip, tool_length);
        tip
    }

    /// Computes the axis positions of A, B and C that give the tool a direction in the workpiece frame, from the tip to the
    /// spindle; `near` are the present positions, and X, Y and Z of the result are those of `near`.
    ///
    /// # Errors
    ///
    /// A direction that the machine cannot reach.
    pub(super) fn oriented(&self, direction: [f64; 3], near: &Coordinates) -> Outcome<Coordinates> {
        let joints: Vec<f64> = self.joints.iter().map(|axis| axis.map_or(0.0, |axis| near[axis])).collect();
        let mut out = joints.clone();
        let pose = ToolPose { axis: direction.into(), ..self.kinematics.forward(&joints) };
        self.kinematics.inverse(&pose, &joints, &mut out).map_err(|error| error.to_string())?;
        let mut found = *near;
        for (axis, value) in self.joints.iter().zip(out) {
            if let Some(axis @ 3..6) = axis {
                found[*axis] = value;
            }
        }
        Ok(found)
    }

    /// Computes the axis positions of [`oriented`](Self::oriented), with the sign of `direction` at the first rotary axis if
    /// the travel limits allow it.
    pub(super) fn oriented_towards(
        &self,
        axis: [f64; 3],
        near: &Coordinates,
        direction: f64,
    ) -> Outcome<Coordinates> {
        let found = self.oriented(axis, near)?;
        let is_against = self.first_rotary_axis().is_some_and(|first| direction * found[first] < 0.0);
        let Some(other) = self.other_solution(&found).filter(|_| is_against) else { return Ok(found) };
        let other = self.oriented(axis, &other)?;
        let is_reached = self.first_rotary_axis().is_some_and(|first| direction * other[first] > 0.0);
        Ok(if is_reached { other } else { found })
    }

    /// Returns the first rotary axis of A, B and C.
    pub(super) fn first_rotary_axis(&self) -> Option<usize> {
        (3..6).find(|axis| self.joints.contains(&Some(*axis)))
    }

    /// Returns the other axis positions with the same tool axis: the first rotary axis at the opposite angle, the second one
    /// half a turn away; `None` without two rotary axes that have this property, or if both solutions are the same.
    pub(super) fn other_solution(&self, position: &Coordinates) -> Option<Coordinates> {
        let first = self.first_rotary_axis().filter(|first| position[*first] != 0.0)?;
        let second = (first + 1..6).find(|axis| self.joints.contains(&Some(*axis)))?;
        let mut other = *position;
        other[first] = -other[first];
        other[second] += PI;
        let [from, to] = [position, &other].map(|position| Vector3::from(self.direction(position)));
        ((from - to).norm() < SAME_DIRECTION).then_some(other)
    }

    /// Returns the rotary axes beyond their travel limits at axis positions, as text; empty without one.
    pub(super) fn rotary_excess(&self, position: &Coordinates) -> String {
        let joints = self.joints.iter().zip(&self.travel);
        let beyond = joints.filter_map(|(axis, [least, most])| {
            let axis = axis.filter(|axis| (3..6).contains(axis))?;
            let value = position[axis];
            let is_beyond = value < least - SAME_DIRECTION || value > most + SAME_DIRECTION;
            let [value, least, most] = [value, *least, *most].map(|angle| Rounded(angle / DEGREE));
            let letter = AXIS_LETTERS[axis];
            is_beyond.then(|| format!("{letter} {value}° is beyond its travel of {least}° to {most}°"))
        });
        beyond.collect::<Vec<_>>().join(" and ")
    }

    /// Returns the angles of the rotary axes at axis positions, as text: `A 30° C 90°`.
    pub(super) fn rotary_text(&self, position: &Coordinates) -> String {
        let axes = (3..6).filter(|axis| self.joints.contains(&Some(*axis)));
        let text = axes.map(|axis| format!("{} {}°", AXIS_LETTERS[axis], Rounded(position[axis] / DEGREE)));
        text.collect::<Vec<_>>().join(" ")
    }

    /// Returns the orientation of the tool in the workpiece at axis positions; its third column is the tool axis.
    pub(super) fn orientation(&self, position: &Coordinates) -> Matrix3<f64> {
        self.kinematics.orientation(&self.joints(position, None)).to_rotation_matrix().into_inner()
    }

    /// Returns the direction of the tool axis in the workpiece frame, from the tip to the spindle.
    pub(super) fn direction(&self, position: &Coordinates) -> [f64; 3] {
        let joints: Vec<f64> =
            self.joints.iter().map(|axis| axis.map_or(0.0, |axis| position[axis])).collect();
        self.kinematics.forward(&joints).axis.into()
    }

    /// Converts axis positions to the tip of a tool, in machine coordinates with the tables at 0.
    pub(super) fn tip(&self, position: &mut Coordinates, tool_length: f64) {
        self.convert(position, tool_length, Kinematics::joints_to_tip);
        for (value, origin) in position.iter_mut().zip(self.workpiece) {
            *value += origin;
        }
    }

    /// Converts the tip of a tool to axis positions. It is the inverse of [`tip`](Self::tip).
    pub(super) fn axis_positions(&self, position: &mut Coordinates, tool_length: f64) {
        for (value, origin) in position.iter_mut().zip(self.workpiece) {
            *value -= origin;
        }
        self.convert(position, tool_length, Kinematics::tip_to_joints);
    }

    fn convert(&self, position: &mut Coordinates, tool_length: f64, conversion: fn(&Kinematics, &mut [f64])) {
        let value = |axis: &Option<usize>| axis.map_or(0.0, |axis| position[axis]);
        let mut joints: Vec<f64> = self.joints.iter().map(value).collect();
        conversion(&self.kinematics.with_tool_length(tool_length), &mut joints);
        for (axis, value) in self.joints.iter().zip(joints) {
            if let Some(axis) = axis {
                position[*axis] = value;
            }
        }
    }
}
