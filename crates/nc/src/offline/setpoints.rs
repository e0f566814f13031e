//! Setpoints of a part program, with the source line of each.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::Cursor;
use std::path::PathBuf;

use virtual_axes_core::config::{ControlProfile, MachineConfig, PartProgramConfig};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::text::BuiltinFiles;
use virtual_axes_core::trajectory::PathPlace;
use virtual_axes_core::trial::{GridSource, SourceError};
use virtual_axes_core::units::{Nanoseconds, seconds};

use super::corners::BoundedCorners;
use super::operations::comment_lines;
use crate::builtin::{ProgramReader, open_program, program_folder};
use crate::interpret::{
    DetectedDialect, Dialect, IgnoredCodes, InterpretationReport, Interpreter, InterpreterOptions,
    Occurrences, ProgramError, ToolTable, WorkOffset,
};
use crate::motion::{Blend, PathControl, ProgramEvent, ProgramStep};
use crate::plan::{FeedPlanError, PartProgramPlanner, PlanOptions, ProgramActivity, ProgrammedPath};

/// Hour, s.
const HOUR: f64 = 3600.0;
/// Longest cycle time, s: that of a loop without an end.
const LONGEST: f64 = 100.0 * HOUR;

/// Feed override over time: percent from a time on, s.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OverrideSchedule(Vec<(f64, f64)>);

impl OverrideSchedule {
    /// Parses `PERCENT` or `TIME:PERCENT,TIME:PERCENT…` with increasing times, s.
    ///
    /// # Errors
    ///
    /// Returns an error if a number is invalid or outside 0 to 200 %, or if times do not increase.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut points: Vec<(f64, f64)> = Vec::new();
        for part in text.split(',') {
            let (time, percent) = part.split_once(':').unwrap_or(("0", part));
            let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
            let (Some(time), Some(percent)) = (number(time), number(percent)) else {
                return Err(format!("{part}: must be PERCENT or SECONDS:PERCENT"));
            };
            if !(0.0..=200.0).contains(&percent) {
                return Err(format!("{percent} %: must be 0 to 200 %"));
            }
            if time < 0.0 || points.last().is_some_and(|(before, _)| time <= *before) {
                return Err(format!(
                    "{part}: time {time} s: must be 0 or more and above that before, as in 0:100,2.5:80"
                ));
            }
            points.push((time, percent / 100.0));
        }
        if points.last().is_some_and(|(_, last)| *last == 0.0) {
            return Err("the last value is 0 %: the program would not end".to_owned());
        }
        Ok(Self(points))
    }

    /// Creates a constant feed override, 1 for 100 %.
    pub fn constant(factor: f64) -> Self {
        Self(vec![(0.0, factor)])
    }

    /// Returns the highest feed override.
    fn highest(&self) -> f64 {
        let OverrideSchedule(points) = self;
        points.iter().map(|(_, factor)| *factor).fold(self.at(0.0), f64::max)
    }

    fn at(&self, time: f64) -> f64 {
        let OverrideSchedule(points) = self;
        points.iter().take_while(|(from, _)| *from <= time).last().map_or(1.0, |(_, value)| *value)
    }
}

/// Options of the interpretation of a part program.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PartProgramOptions {
    /// Feed override.
    pub schedule: OverrideSchedule,
    /// Dialect; `None` for that of the machine, or the detected one.
    pub dialect: Option<Dialect>,
    /// Codes without effect.
    pub ignored: IgnoredCodes,
    /// Work offsets in place of those of the machine.
    pub work_offsets: Vec<WorkOffset>,
    /// Tool table; empty for the tools of the machine.
    pub tools: ToolTable,
    /// Duration of a tool change (M6), s; `None` for that of the machine.
    pub tool_change_time: Option<f64>,
    /// Duration of a change of the spindle speed (M3, M4, M5, S), s; `None` for that of the machine.
    pub spindle_time: Option<f64>,
    /// Options of the feed planner.
    pub plan: PlanOptions,
}

impl PartProgramOptions {
    /// Returns the options of the interpreter for a machine: those of the machine file, where none are given.
    ///
    /// # Errors
    ///
    /// Returns an error if the machine file has an invalid work offset, tool or tool table.
    pub fn interpreter(&self, machine: &MachineConfig) -> Result<InterpreterOptions, String> {
        let setup = machine.part_program();
        // A tool table replaces that of the machine file, which is not read then.
        let without_tools = || PartProgramConfig { tools: None, tool_table: None, ..setup.clone() };
        let setup = if self.tools.is_empty() { setup.clone() } else { without_tools() };
        let mut options = InterpreterOptions::for_machine(machine).with_setup(&setup)?;
        options.dialect = self.dialect.or(options.dialect);
        options.ignored.clone_from(&self.ignored);
        options.set_tools(self.tools.clone());
        self.work_offsets.iter().for_each(|offset| options.set_work_offset(offset));
        options.tool_change_time = self.tool_change_time.unwrap_or(options.tool_change_time);
        options.spindle_time = self.spindle_time.unwrap_or(options.spindle_time);
        Ok(options)
    }
}

/// Setpoints that are not simulated yet, and the times of the program.
#[derive(Debug, Clone, Default)]
pub struct ProgramTrack {
    /// Places and activities of the setpoints in order.
    pub setpoints: VecDeque<(PathPlace, ProgramActivity)>,
    /// Lines of comments that begin an operation, with their texts, and without a text the limits of subprograms.
    pub comments: Vec<(usize, String)>,
    /// Programmed path of these setpoints and beyond.
    pub programmed: ProgrammedPath,
    /// Time from the first to the last setpoint, s.
    pub cycle_time: f64,
    /// Duration of all motions at their programmed feed, s.
    pub programmed_time: f64,
    /// Duration of all dwells and pauses read, s.
    pub dwell_time: f64,
    /// Farthest source line that was read, from 1.
    pub lines_read: usize,
    /// Dialect of the program.
    pub dialect: Option<DetectedDialect>,
    /// Words without effect and assumptions of the program.
    pub report: InterpretationReport,
    /// First line with a stop (M0, M1), which the simulation passes without a wait.
    pub stop: Option<usize>,
    /// First line of a motion with a tolerance of merged lines (G64 Q), which has no effect.
    pub merge_tolerance: Option<usize>,
    /// Corners that short lines bound, and not the tolerance.
    pub corners: BoundedCorners,
}

impl ProgramTrack {
    /// Returns notes on dialect, assumptions and words without effect: line and text.
    pub fn notes(&self) -> Vec<(usize, String)> {
        let dialect = self.dialect.iter().filter_map(DetectedDialect::note);
        let codes = self.report.without_effect.iter().map(|(code, found)| {
            let Occurrences { count, first_line, .. } = found;
            (*first_line, found.located(&format!("{code} is ignored, {count} in all")))
        });
        let assumptions =
            self.report.assumptions.iter().map(|(text, found)| (found.first_line, found.located(text)));
        let stop = self.stop.map(|line| (line, "M0 and M1 stop the axes and do not wait".to_owned()));
        let merging = "G64 Q has no effect: short lines are joined within P".to_owned();
        let merging = self.merge_tolerance.map(|line| (line, merging));
        let corners = self.corners.note();
        let mut notes: Vec<_> =
            dialect.chain(codes).chain(assumptions).chain(stop).chain(merging).chain(corners).collect();
        notes.sort_by_key(|(line, _)| *line);
        notes
    }
}

/// Steps of a program that notes words without effect in its track.
struct NotedSteps<'a> {
    interpreter: Interpreter<ProgramReader>,
    track: &'a RefCell<ProgramTrack>,
    /// True if the control joins lines within the tolerance of G64 Q.
    merges: bool,
}

impl Iterator for NotedSteps<'_> {
    type Item = Result<ProgramStep, ProgramError>;

    fn next(&mut self) -> Option<Self::Item> {
        let step = self.interpreter.next();
        let mut track = self.track.borrow_mut();
        track.lines_read = track.lines_read.max(self.interpreter.line());
        if matches!(step, Some(Err(_) | Ok(ProgramStep::Event { event: ProgramEvent::End, .. }))) {
            track.report.clone_from(self.interpreter.report());
            track.dialect = Some(self.interpreter.dialect().clone());
        }
        match &step {
            Some(Ok(ProgramStep::Motion(motion))) => {
                if !self.merges {
                    track.corners.add(motion);
                }
                if let PathControl::Blend(Blend { merge_tolerance: Some(_), .. }) = motion.path_control
                    && !self.merges
                {
                    track.merge_tolerance.get_or_insert(motion.line);
                }
            }
            Some(Ok(ProgramStep::Event {
                event: ProgramEvent::Dwell(time) | ProgramEvent::Pause(time),
                ..
            })) => track.dwell_time += time,
            Some(Ok(ProgramStep::Event { line, event: ProgramEvent::Stop | ProgramEvent::OptionalStop })) => {
                track.stop.get_or_insert(*line);
            }
            _ => {}
        }
        step
    }
}

/// Source of the setpoints of a part program.
pub struct PartProgramSource<'a> {
    planner: PartProgramPlanner<'a>,
    kinematics: Kinematics,
    name: &'a str,
    schedule: &'a OverrideSchedule,
    track: &'a RefCell<ProgramTrack>,
    joints: Vec<usize>,
    period: Nanoseconds,
    cycle: i64,
    /// True if the last setpoint is reached at rapid traverse.
    is_rapid: bool,
}

impl<'a> PartProgramSource<'a> {
    /// Opens the part program `name` of `builtin` or the file `name` for a machine; `track` receives its lines and times.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be opened or the machine has invalid limits.
    pub fn open(
        name: &'a str,
        builtin: &BuiltinFiles,
        machine: &MachineConfig,
        options: &'a PartProgramOptions,
        track: &'a RefCell<ProgramTrack>,
    ) -> Result<Self, String> {
        let file = open_program(name, builtin).map_err(|error| format!("{name}: {error}"))?;
        let comments = open_program(name, builtin).and_then(comment_lines);
        let comments = comments.map_err(|error| format!("{name}: {error}"))?;
        let folder = program_folder(name, builtin);
        Self::with_reader(file, (name, folder), comments, machine, options, track)
    }

    /// Reads the part program `text` for a machine; `name` is the file in messages, in whose folder subprograms are searched.
    ///
    /// # Errors
    ///
    /// Returns an error if the machine has invalid limits.
    pub fn read(
        text: &str,
        (name, folder): (&'a str, Option<PathBuf>),
        machine: &MachineConfig,
        options: &'a PartProgramOptions,
        track: &'a RefCell<ProgramTrack>,
    ) -> Result<Self, String> {
        let file = ProgramReader::Text(Cursor::new(text.to_owned()));
        Self::with_reader(file, (name, folder), Vec::new(), machine, options, track)
    }

    fn with_reader(
        file: ProgramReader,
        (name, subprogram_folder): (&'a str, Option<PathBuf>),
        comments: Vec<(usize, String)>,
        machine: &MachineConfig,
        options: &'a PartProgramOptions,
        track: &'a RefCell<ProgramTrack>,
    ) -> Result<Self, String> {
        let interpreter = options.interpreter(machine).map_err(|error| format!("{name}: {error}"))?;
        let interpreter = InterpreterOptions { subprogram_folder, ..interpreter };
        track.replace(ProgramTrack { comments, ..ProgramTrack::default() });
        let interpreter = Interpreter::new(file, name, interpreter);
        let merges = machine.control().profile == ControlProfile::LinuxCnc;
        let mut planner =
            PartProgramPlanner::new(NotedSteps { interpreter, track, merges }, machine, options.plan)
                .map_err(|error| format!("{name}: {error}"))?;
        planner.keep_programmed_path();
        Ok(Self {
            planner,
            kinematics: Kinematics::new(machine),
            name,
            schedule: &options.schedule,
            track,
            joints: (0..machine.axes().len()).collect(),
            period: machine.periods().position,
            cycle: 0,
            is_rapid: true,
        })
    }
}

impl PartProgramSource<'_> {
    fn too_long(&self) -> SourceError {
        let (name, hours, line) = (self.name, LONGEST / HOUR, self.track.borrow().lines_read);
        format!(
            "{name}:{line}: the program takes longer than {hours} h; end its loop, or check feed and dwell"
        )
        .into()
    }
}

impl GridSource for PartProgramSource<'_> {
    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn is_rapid(&self) -> bool {
        self.is_rapid
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        let time = seconds(self.cycle * self.period);
        if time > LONGEST {
            return Err(self.too_long());
        }
        let setpoint = self.planner.next_setpoint(self.schedule.at(time)).map_err(|error| match error {
            // The interpreter's error names the file.
            FeedPlanError::Step(error) => error,
            error => format!("{}: {error}", self.name).into(),
        })?;
        let mut track = self.track.borrow_mut();
        track.programmed_time = self.planner.programmed_time();
        // Motions ahead that alone take too long are not awaited.
        if track.programmed_time / self.schedule.highest() + track.dwell_time > LONGEST {
            drop(track);
            return Err(self.too_long());
        }
        let Some(setpoint) = setpoint else { return Ok(false) };
        self.planner.take_programmed_path(&self.kinematics, &mut track.programmed);
        row.copy_from_slice(setpoint.psec());
        self.is_rapid = setpoint.place.programmed_feed.is_infinite();
        track.setpoints.push_back((setpoint.place, setpoint.activity));
        track.cycle_time = time;
        self.cycle += 1;
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_holds_each_value_until_the_next() {
        let schedule = OverrideSchedule::parse("0:100,2.5:0,4:120").unwrap();
        let values = [0.0, 2.4, 2.5, 3.9, 4.0, 100.0].map(|time| schedule.at(time));
        assert_eq!(values, [1.0, 1.0, 0.0, 0.0, 1.2, 1.2]);
        assert_eq!(OverrideSchedule::parse("50").unwrap().at(7.0), 0.5);
        for (text, highest) in [("50", 0.5), ("0:50,1:120", 1.2), ("2:50", 1.0)] {
            assert_eq!(OverrideSchedule::parse(text).unwrap().highest(), highest, "{text}");
        }
        assert_eq!(OverrideSchedule::default().at(7.0), 1.0);
        for text in ["", "x", "201", "-1", "1:50,1:60", "0:100,5:0", "nan", "1:2:3"] {
            assert!(OverrideSchedule::parse(text).is_err(), "{text}");
        }
    }
}
