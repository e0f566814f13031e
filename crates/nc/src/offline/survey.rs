//! Survey of a part program: its interpretation as a whole, without planning. All errors, motions and extents at once.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;

use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::text::{BuiltinFiles, escaped};
use virtual_axes_core::units::{DEGREE, MILLIMETER, Rounded, position_text};

use super::extent::{length, norm, positions};
use super::setpoints::{PartProgramOptions, ProgramTrack};
use crate::builtin::{open_program, program_folder};
use crate::interpret::{
    DetectedDialect, InterpretationReport, Interpreter, InterpreterOptions, Occurrences, TipTransform,
    system_name,
};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Feed, MotionKind, ProgramEvent, ProgramMotion, ProgramStep};

/// Distance beyond a travel limit that is the rounding of a program, m or rad.
const ROUNDING: f64 = 1e-9;
/// Full turn, the largest useful work offset of a rotary axis, rad.
const TURN: f64 = std::f64::consts::TAU;
/// Largest number of errors on a page.
const MAX_LINES: usize = 60;

/// Survey of a part program on a machine.
#[derive(Debug, Clone)]
pub struct ProgramSurvey {
    /// Dialect, and what it was detected from.
    pub dialect: DetectedDialect,
    /// Words without effect, assumptions and errors.
    pub report: InterpretationReport,
    /// Letters of the axes that the program moves and the machine lacks.
    pub missing_axes: BTreeSet<char>,
    /// Number of rapid traverses.
    pub rapids: usize,
    /// Number of straight lines at feed.
    pub lines: usize,
    /// Number of arcs.
    pub arcs: usize,
    /// Number of splines.
    pub splines: usize,
    /// Length of the path at feed, m.
    pub length: f64,
    /// Shortest motion at feed, m; infinite without one.
    pub shortest: f64,
    /// Time at the programmed feed, with dwells, s.
    pub time: f64,
    /// Positions of the joints at the start, m or rad.
    pub start: Vec<f64>,
    /// Positions of the joints at the end, m or rad.
    pub end: Vec<f64>,
    /// Range of each joint, m or rad.
    pub ranges: Vec<[f64; 2]>,
    /// Ranges by work coordinate system; `None` has motions in machine coordinates.
    by_system: BTreeMap<Option<usize>, Vec<[f64; 2]>>,
    /// First motion beyond a travel limit: line and text.
    first_excess: Option<(usize, String)>,
    /// Axis positions at programmed coordinate 0 of each system at the end, m and rad.
    work_offsets: BTreeMap<usize, [f64; AXIS_COUNT]>,
    /// Work offsets that the program sets.
    set_work_offsets: BTreeSet<usize>,
    /// Work coordinate systems and indices of joints whose ranges no work offset moves.
    fixed: BTreeSet<(usize, usize)>,
    has_tool_center_point: bool,
}

impl ProgramSurvey {
    /// Interprets the part program `name` of `builtin`, or the file `name`, for a machine. `on_line` receives the lines that
    /// were read and may end the survey.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or the error of `on_line`. Errors of the program are in the survey.
    pub fn new<E: From<String>>(
        name: &str,
        builtin: &BuiltinFiles,
        machine: &MachineConfig,
        options: &PartProgramOptions,
        mut on_line: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<Self, E> {
        let options = InterpreterOptions {
            reports_all_errors: true,
            subprogram_folder: program_folder(name, builtin),
            ..options.interpreter(machine).map_err(|error| format!("{name}: {error}"))?
        };
        let mut survey = Self::interpret(name, builtin, machine, options.clone(), &mut on_line)?;
        if survey.first_excess.is_some() {
            let mut moved = options;
            moved.work_offsets.iter_mut().flatten().for_each(|offset| *offset += MILLIMETER);
            let moved = Self::interpret(name, builtin, machine, moved, &mut on_line)?;
            for (system, ranges) in &survey.by_system {
                let (Some(system), Some(others)) = (*system, moved.by_system.get(system)) else { continue };
                let is_fixed = |(joint, pair): (usize, (&[f64; 2], &[f64; 2]))| {
                    ((pair.0[0] - pair.1[0]).abs() < ROUNDING).then_some((system, joint))
                };
                survey.fixed.extend(ranges.iter().zip(others).enumerate().filter_map(is_fixed));
            }
        }
        Ok(survey)
    }

    fn interpret<E: From<String>>(
        name: &str,
        builtin: &BuiltinFiles,
        machine: &MachineConfig,
        options: InterpreterOptions,
        on_line: &mut impl FnMut(usize) -> Result<(), E>,
    ) -> Result<Self, E> {
        let source = open_program(name, builtin).map_err(|error| format!("{name}: {error}"))?;
        let given = options.work_offsets.clone();
        let transform = TipTransform::new(machine);
        let start = transform.joints(&options.start, None);
        let mut steps = Interpreter::new(source, &escaped(name), options);
        let ranges: Vec<_> = start.iter().map(|value| [*value; 2]).collect();
        let mut survey = Self {
            dialect: steps.dialect().clone(),
            report: InterpretationReport::default(),
            missing_axes: BTreeSet::new(),
            rapids: 0,
            lines: 0,
            arcs: 0,
            splines: 0,
            length: 0.0,
            shortest: f64::INFINITY,
            time: 0.0,
            end: start.clone(),
            by_system: BTreeMap::new(),
            start,
            ranges,
            first_excess: None,
            work_offsets: BTreeMap::new(),
            set_work_offsets: BTreeSet::new(),
            fixed: BTreeSet::new(),
            has_tool_center_point: false,
        };
        let mut failure = None;
        // Line of the last call of a file.
        let mut call = None;
        while let Some(step) = steps.next() {
            on_line(steps.line())?;
            if let Some(file) = steps.line_of_file() {
                call = Some((steps.line(), Arc::clone(&file.name)));
            }
            match step {
                Ok(ProgramStep::Motion(motion)) => {
                    let is_within = survey.first_excess.is_none();
                    let system = (!steps.moves_in_machine_coordinates()).then(|| steps.work_offset());
                    survey.add(&motion, &transform, machine, system.map(|(index, _)| index));
                    if let (true, Some((line, text)), Some((call, file))) =
                        (is_within, &mut survey.first_excess, &call)
                        && line == call
                    {
                        *text += &format!("; this line calls {file}");
                    }
                    if let Some((index, offset)) = system {
                        survey.work_offsets.insert(index, offset);
                        if given.get(index) != Some(&offset) {
                            survey.set_work_offsets.insert(index);
                        }
                    }
                }
                Ok(ProgramStep::Event {
                    event: ProgramEvent::Dwell(time) | ProgramEvent::Pause(time),
                    ..
                }) => survey.time += time,
                Ok(ProgramStep::Event { .. }) => {}
                Err(error) => failure = Some(error),
            }
        }
        survey.report.clone_from(steps.report());
        survey.missing_axes = steps.missing_axes();
        if let Some(error) = failure {
            let file = steps.line_of_file().cloned();
            let first_line = if file.is_some() { steps.line() } else { error.line };
            survey.report.errors.insert(error.reason, Occurrences { count: 1, first_line, file });
        }
        Ok(survey)
    }

    /// Adds a motion.
    fn add(
        &mut self,
        motion: &ProgramMotion,
        transform: &TipTransform,
        machine: &MachineConfig,
        system: Option<usize>,
    ) {
        match motion.kind {
            MotionKind::Rapid => self.rapids += 1,
            MotionKind::Line => self.lines += 1,
            MotionKind::Arc(_) => self.arcs += 1,
            MotionKind::Nurbs(_) => self.splines += 1,
        }
        self.has_tool_center_point |= motion.tcp_length.is_some();
        let length = length(motion);
        if motion.feed != Feed::Rapid && length > 0.0 {
            self.length += length;
            self.shortest = self.shortest.min(length);
        }
        self.time += match motion.feed {
            Feed::Rapid => 0.0,
            Feed::Linear(feed) => length / feed,
            Feed::Rotary(feed) => norm(motion, 3..6) / feed,
            Feed::Duration(time) => time,
        };
        let mut moves = vec![[f64::INFINITY, f64::NEG_INFINITY]; self.ranges.len()];
        for position in positions(motion) {
            self.end = transform.joints(&position, motion.tcp_length);
            extend(&mut moves, self.end.iter().map(|value| [*value; 2]));
        }
        extend(&mut self.ranges, moves.iter().copied());
        // An axis that stands still has no place of its own in the system.
        let from = transform.joints(&motion.start, motion.tcp_length);
        for (range, from) in moves.iter_mut().zip(from) {
            if range[0] == from && range[1] == from {
                *range = [f64::INFINITY, f64::NEG_INFINITY];
            }
        }
        let none = || vec![[f64::INFINITY, f64::NEG_INFINITY]; moves.len()];
        extend(self.by_system.entry(system).or_insert_with(none), moves.iter().copied());
        if self.first_excess.is_none() {
            self.first_excess = machine
                .axes()
                .iter()
                .zip(&moves)
                .find_map(|(axis, range)| Some((motion.line, excess_text(axis, range)?)));
        }
    }

    /// Returns notes on dialect, words without effect and assumptions: line and text.
    pub fn notes(&self) -> Vec<(usize, String)> {
        let track = ProgramTrack {
            dialect: Some(self.dialect.clone()),
            report: self.report.clone(),
            ..ProgramTrack::default()
        };
        track.notes()
    }

    /// Returns the errors of the program and its travel excess as one page, or `None` for a valid program. A single error
    /// is one line.
    pub fn page(&self, name: &str, machine: &MachineConfig) -> Option<String> {
        let name = escaped(name);
        let mut errors: Vec<_> = self.report.errors.iter().collect();
        errors.sort_by_key(|(_, found)| found.first_line);
        let mut page = String::new();
        if errors.len() > 1 {
            let dialect = self.dialect.dialect;
            let _ = writeln!(page, "{name}: {} errors, read in the dialect {dialect}", errors.len());
        }
        for (text, found) in errors.iter().take(MAX_LINES) {
            let times = if found.count > 1 { format!(" ({} times)", found.count) } else { String::new() };
            let _ = writeln!(page, "{}: {text}{times}", found.place(&name));
        }
        if errors.len() > MAX_LINES {
            let _ = writeln!(page, "{name}: {} further errors", errors.len() - MAX_LINES);
        }
        if let Some((line, text)) = &self.first_excess {
            let _ = writeln!(page, "{name}:{line}: {text}");
            page += &self.excess_table(machine);
        }
        (!page.is_empty()).then(|| page.trim_end().to_owned())
    }

    /// Returns the table of axes beyond their travel limits, with the work offsets that would fit.
    fn excess_table(&self, machine: &MachineConfig) -> String {
        let mut rows = vec![["axis", "program", "travel", "work offset that fits"].map(str::to_owned)];
        for (system, ranges) in &self.by_system {
            for (joint, (axis, range)) in machine.axes().iter().zip(ranges).enumerate() {
                if excess_text(axis, range).is_none() {
                    continue;
                }
                let limits = axis.limits();
                let (from, to) = (Position(axis, range[0]), Position(axis, range[1]));
                let (least, most) = (Position(axis, limits.travel_min), Position(axis, limits.travel_max));
                rows.push([
                    axis.name().to_owned(),
                    format!("{from} to {to}"),
                    format!("{least} to {most}"),
                    self.fit(*system, joint, axis, *range),
                ]);
            }
        }
        let widths: Vec<usize> = (0..4)
            .map(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0))
            .collect();
        let line = |row: &[String; 4]| {
            let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
            format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
        };
        rows.iter().map(line).collect()
    }

    /// Returns the work offset of an axis with which a range is within the travel limits.
    fn fit(&self, system: Option<usize>, joint: usize, axis: &AxisConfig, [low, high]: [f64; 2]) -> String {
        let Some(system) = system else {
            return "machine coordinates (G53), or the point of G28 or G30: change the program".to_owned();
        };
        let (name, limits) = (system_name(system), axis.limits());
        if high - low > limits.travel_max - limits.travel_min + ROUNDING {
            return format!("none: the program is longer than the travel of {}", axis.name());
        }
        let letter =
            AXIS_LETTERS.iter().position(|letter| axis.name().eq_ignore_ascii_case(&letter.to_string()));
        let Some(index) = letter else { return "none".to_owned() };
        let is_rotary = axis.kind() == AxisKind::Rotary;
        if self.has_tool_center_point && is_rotary {
            return format!(
                "none: an offset of {} turns the tool: post the other solution of the rotary axes, or check on a machine \
                 with this travel",
                AXIS_LETTERS[index]
            );
        }
        if self.has_tool_center_point {
            return format!("{name}: with tool center point control, move the workpiece frame");
        }
        let offset = self.work_offsets.get(&system).map_or(0.0, |offset| offset[index]);
        let [least, most] = [limits.travel_min - low, limits.travel_max - high].map(|shift| offset + shift);
        if is_rotary && (least > TURN || most < -TURN) {
            return format!("none: {} turns more than its travel: it must be continuous", axis.name());
        }
        let [least, most] = [least, most].map(|position| Position(axis, position).to_string());
        if self.fixed.contains(&(system, joint)) && !self.set_work_offsets.contains(&system) {
            return "none: G91 or G92 counts from where the axis starts: program a motion into the travel before".to_owned();
        }
        let letter = AXIS_LETTERS[index];
        let mut fit = format!("{name} {letter}: {least} to {most} (now {})", Position(axis, offset));
        if is_rotary {
            fit += ", which turns workpiece or tool";
        }
        match self.set_work_offsets.contains(&system) {
            true => fit + ", which the program sets by G10: change it there",
            false => fit,
        }
    }
}

/// Position of an axis in mm or degrees.
struct Position<'a>(&'a AxisConfig, f64);

impl std::fmt::Display for Position<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(axis, value) = self;
        match axis.kind() {
            AxisKind::Linear => write!(formatter, "{} mm", Rounded(value / MILLIMETER)),
            AxisKind::Rotary => write!(formatter, "{}°", Rounded(value / DEGREE)),
        }
    }
}

fn extend(ranges: &mut [[f64; 2]], by: impl Iterator<Item = [f64; 2]>) {
    for (range, by) in ranges.iter_mut().zip(by) {
        *range = [range[0].min(by[0]), range[1].max(by[1])];
    }
}

/// Returns what is wrong with a range of an axis outside of its travel limits.
fn excess_text(axis: &AxisConfig, range: &[f64; 2]) -> Option<String> {
    let limits = axis.limits();
    let is_beyond = |value: &&f64| {
        value.is_finite()
            && (**value < limits.travel_min - ROUNDING || **value > limits.travel_max + ROUNDING)
    };
    let value = range.iter().find(is_beyond)?;
    let unit = if axis.kind() == AxisKind::Linear { "m" } else { "rad" };
    let [value, least, most] =
        [*value, limits.travel_min, limits.travel_max].map(|value| position_text(value, unit));
    Some(format!("{} at {value} is outside of its travel limits {least} to {most}", axis.name()))
}
