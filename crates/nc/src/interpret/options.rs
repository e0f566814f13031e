//! Options of the interpreter.

use std::collections::BTreeMap;

use virtual_axes_core::config::{KinematicsConfig, MachineConfig};
use virtual_axes_core::kinematics::Kinematics;

use super::limits::REPEATED_LINES;
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Blend, Coordinates, PathControl};

/// Number of work coordinate systems: G54 to G59.3.
pub const WORK_OFFSET_COUNT: usize = 9;

/// Options of the interpreter: machine, offsets and tolerances that the program relies on.
#[derive(Debug, Clone)]
pub struct InterpreterOptions {
    /// Axes of the machine, in the order of [`Coordinates`]; words of other axes are rejected.
    pub axes: [bool; AXIS_COUNT],
    /// Axis positions at the program start, m and rad.
    pub start: Coordinates,
    /// Work offsets G54 to G59.3, m and rad.
    pub work_offsets: [Coordinates; WORK_OFFSET_COUNT],
    /// Axis positions of G28 and G30, m and rad.
    pub references: [Coordinates; 2],
    /// Tool length by tool number (H word), m.
    pub tool_lengths: BTreeMap<u32, f64>,
    /// Length of tools without entry in `tool_lengths`, m; `None` rejects them.
    pub default_tool_length: Option<f64>,
    /// Path control mode at the program start.
    pub path_control: PathControl,
    /// M codes that are accepted without effect.
    pub ignored_m_codes: Vec<u32>,
    /// True if lines that begin with a slash are skipped (block delete).
    pub skips_optional_lines: bool,
    /// Number of lines that loops and subprograms may repeat.
    pub repeated_lines: u64,
    /// Kinematics for tool center point control; `None` rejects G43.4.
    pub kinematics: Option<TipTransform>,
}

impl Default for InterpreterOptions {
    /// Returns a machine with all axes, zero offsets, tools of length 0, and blending without tolerance.
    fn default() -> Self {
        Self {
            axes: [true; AXIS_COUNT],
            start: [0.0; AXIS_COUNT],
            work_offsets: [[0.0; AXIS_COUNT]; WORK_OFFSET_COUNT],
            references: [[0.0; AXIS_COUNT]; 2],
            tool_lengths: BTreeMap::new(),
            default_tool_length: Some(0.0),
            path_control: PathControl::Blend(Blend {
                tolerance: None,
                rotary_tolerance: None,
                merge_tolerance: None,
            }),
            ignored_m_codes: Vec::new(),
            skips_optional_lines: false,
            repeated_lines: REPEATED_LINES,
            kinematics: None,
        }
    }
}

impl InterpreterOptions {
    /// Returns the options for a machine: its axes by the letters of their names, its kinematics, the origin of its
    /// workpiece frame as G54, and its tool length for all tools. The program starts with all axes at 0.
    pub fn for_machine(machine: &MachineConfig) -> Self {
        let geometry = *machine.kinematics();
        let transform = TipTransform::new(machine);
        let mut options = Self { axes: [false; AXIS_COUNT], ..Self::default() };
        for axis in transform.joints.iter().flatten() {
            options.axes[*axis] = true;
        }
        options.work_offsets[0][..3].copy_from_slice(&geometry.workpiece);
        options.default_tool_length = Some(geometry.tool_length);
        options.kinematics = Some(transform);
        options
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
    geometry: KinematicsConfig,
    /// Index in [`Coordinates`] of each joint of the machine.
    joints: Vec<Option<usize>>,
}

impl TipTransform {
    /// Creates the transformation of a machine.
    pub fn new(machine: &MachineConfig) -> Self {
        let letter = |name: &str| {
            AXIS_LETTERS.iter().position(|letter| name.eq_ignore_ascii_case(&letter.to_string()))
        };
        let joints = machine.axes().iter().map(|axis| letter(axis.name())).collect();
        Self { kinematics: Kinematics::new(machine), geometry: *machine.kinematics(), joints }
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

    /// Converts axis positions to the tip of a tool, in machine coordinates with the tables at 0.
    pub(super) fn tip(&self, position: &mut Coordinates, tool_length: f64) {
        position[2] += self.geometry.tool_length - tool_length;
        self.convert(position, Kinematics::joints_to_tip);
        for (value, origin) in position.iter_mut().zip(self.geometry.workpiece) {
            *value += origin;
        }
    }

    /// Converts the tip of a tool to axis positions. It is the inverse of [`tip`](Self::tip).
    pub(super) fn axis_positions(&self, position: &mut Coordinates, tool_length: f64) {
        for (value, origin) in position.iter_mut().zip(self.geometry.workpiece) {
            *value -= origin;
        }
        self.convert(position, Kinematics::tip_to_joints);
        position[2] -= self.geometry.tool_length - tool_length;
    }

    fn convert(&self, position: &mut Coordinates, conversion: fn(&Kinematics, &mut [f64])) {
        let value = |axis: &Option<usize>| axis.map_or(0.0, |axis| position[axis]);
        let mut joints: Vec<f64> = self.joints.iter().map(value).collect();
        conversion(&self.kinematics, &mut joints);
        for (axis, value) in self.joints.iter().zip(joints) {
            if let Some(axis) = axis {
                position[*axis] = value;
            }
        }
    }
}
