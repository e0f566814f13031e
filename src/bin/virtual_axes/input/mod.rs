//! Input of a command: a scenario, a part program or a file with setpoints.

pub mod part_program;
pub mod program_text;
pub mod setpoint_summary;

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use crate::arguments::log_arguments::LogArguments;
use crate::builtin::{MACHINES, PROGRAM_DESCRIPTIONS, PROGRAMS, SCENARIOS};
use crate::output::progress::TrialProgress;
use crate::output::{interrupt, print_error};
use part_program::{PartProgramArguments, count_lines, is_part_program, open_other};
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::path::Program;
use virtual_axes_core::scenario::{Scenario, ScenarioError, nearest_input};
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::text::{builtin_names, builtin_text};
use virtual_axes_core::trajectory::TrajectoryRequest;
use virtual_axes_core::trial::{GridSource, ProgramSource, SetpointSource, SourceError, TrialError};
use virtual_axes_core::units::Rounded;
use virtual_axes_io::files::{
    self, FileKind, McapTrajectories, PsecCsvReader, PsecRow, TimeGap, read_psec_yaml,
};
use virtual_axes_nc::offline::{PartProgramOptions, PartProgramSource, ProgramSurvey, ProgramTrack};
use virtual_axes_nc::plan::ProgrammedPath;

/// Scenario, part program or file with setpoints.
#[derive(Debug)]
pub struct CommandInput {
    name: String,
    content: Content,
    /// Gap in the rows of a CSV file that was read.
    gap: Cell<Option<TimeGap>>,
    options: PartProgramOptions,
    /// True after the survey of a part program, or the first reading of a log.
    is_surveyed: Cell<bool>,
    track: RefCell<ProgramTrack>,
    /// Rows of a CSV file that were read and not taken; `None` if they are not kept.
    rows: Option<RefCell<Vec<PsecRow>>>,
}

#[derive(Debug)]
enum Content {
    Scenario(Box<Scenario>),
    PartProgram,
    /// Opened file, which the first run consumes, so that a pipe is possible; later runs reopen it.
    Csv(RefCell<Option<files::Input>>),
    Yaml(Vec<TrajectoryRequest>),
    Mcap {
        topic: Option<String>,
    },
    /// Recording of a control.
    Log(LogArguments),
}

impl CommandInput {
    /// Opens the built-in scenario `name`, or the file `name`. `topic` selects the topic of an MCAP
    /// recording, and `log` the columns of a log of a control.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read or is invalid, or if `topic` is given for another kind of
    /// file.
    pub fn open(name: &str, topic: Option<&str>, log: &LogArguments) -> Result<Self, Box<dyn Error>> {
        let is_scenario = builtin_text(SCENARIOS, name).is_some();
        let is_program = builtin_text(PROGRAMS, name).is_some();
        let content = if is_scenario || (!is_program && !Path::new(name).exists()) {
            // The error of an unknown name lists the built-in scenarios.
            Content::Scenario(Box::new(Scenario::load(name, SCENARIOS).map_err(with_programs)?))
        } else if !is_program && log.applies_to(name) {
            Content::Log(log.clone())
        } else if is_part_program(name) {
            Content::PartProgram
        } else {
            content_of(open_other(Path::new(name))?, topic)?
        };
        if topic.is_some() && !matches!(content, Content::Mcap { .. }) {
            return Err(format!("{name}: --topic requires an MCAP recording").into());
        }
        if let (Some(option), false) = (log.given(), matches!(content, Content::Log(_))) {
            return Err(format!("{name}: {option} requires a log of a control, or setpoints as CSV").into());
        }
        Ok(CommandInput {
            name: name.to_owned(),
            content,
            gap: Cell::new(None),
            options: PartProgramOptions::default(),
            is_surveyed: Cell::new(false),
            track: RefCell::default(),
            rows: None,
        })
    }

    /// Sets the options of a part program.
    ///
    /// # Errors
    ///
    /// Returns an error if an option is invalid, or if one is given and the input is not a part program.
    pub fn with_part_program(mut self, arguments: &PartProgramArguments) -> Result<Self, Box<dyn Error>> {
        if let (Some(option), false) = (arguments.given(), self.is_part_program()) {
            return Err(format!("{}: {option} requires a part program", self.name).into());
        }
        self.options = arguments.options()?;
        Ok(self)
    }

    /// Prints notes on words without effect of a part program that was read.
    pub fn print_program_notes(&self) {
        for (line, note) in self.track.borrow().notes() {
            print_error(&format!("note: {}:{line}: {note}", self.name));
        }
        if self.is_part_program() && self.track.borrow().cycle_time == 0.0 {
            print_error(&format!("note: {}: the program has no motion", self.name));
        }
    }

    /// Keeps the rows of a CSV file for [`take_rows`](Self::take_rows).
    #[must_use]
    pub fn with_kept_rows(mut self) -> Self {
        self.rows = matches!(self.content, Content::Csv(_) | Content::Log(_)).then(RefCell::default);
        self
    }

    /// Returns the rows of a CSV file that were read since the last call; `None` if they are not kept.
    pub fn take_rows(&self) -> Option<Vec<PsecRow>> {
        self.rows.as_ref().map(RefCell::take)
    }

    /// Returns true if the input is a part program.
    pub fn is_part_program(&self) -> bool {
        matches!(self.content, Content::PartProgram)
    }

    /// Returns lines and times of the setpoints of a part program that were read.
    pub fn track(&self) -> &RefCell<ProgramTrack> {
        &self.track
    }

    /// Creates the progress: by the lines of a part program, otherwise by the simulated duration, s, if it is known.
    /// `is_quiet` hides it.
    ///
    /// # Errors
    ///
    /// Returns an error if the lines of a part program cannot be counted.
    pub fn progress(&self, duration: Option<f64>, is_quiet: bool) -> Result<TrialProgress, String> {
        if !self.is_part_program() {
            return Ok(TrialProgress::new(&self.name, duration, is_quiet));
        }
        let lines = count_lines(&self.name).map_err(|error| format!("{}: {error}", self.name))?;
        Ok(TrialProgress::with_lines(&self.name, lines, is_quiet))
    }

    /// Reports the lines of a part program that were read, otherwise the simulated time, s.
    pub fn report_progress(&self, progress: &mut TrialProgress, time: f64) {
        match self.content {
            Content::PartProgram => progress.set_line(self.track.borrow().lines_read),
            _ => progress.set_time(time),
        }
    }

    /// Returns the name of the scenario or file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the description of a scenario; empty for other files.
    pub fn description(&self) -> &str {
        match &self.content {
            Content::Scenario(scenario) => scenario.description(),
            Content::PartProgram => builtin_text(PROGRAM_DESCRIPTIONS, &self.name).unwrap_or(""),
            _ => "",
        }
    }

    /// Returns notes on the limits of a scenario.
    pub fn notes_on_limits(&self, machine: &MachineConfig) -> Vec<String> {
        match &self.content {
            Content::Scenario(scenario) => scenario.notes_on_limits(machine),
            _ => Vec::new(),
        }
    }

    /// Returns a warning with the line if a CSV file that was read to its end has a gap.
    pub fn gap_warning(&self) -> Option<String> {
        self.gap.get().map(|TimeGap { line, step, median }| {
            format!(
                "{}:{line}: the time step to this row is {} s, the median {} s; setpoints between are interpolated",
                self.name,
                Rounded(step),
                Rounded(median)
            )
        })
    }

    /// Rejects an output file that is the input file.
    pub fn must_not_be(&self, output: &Path) -> Result<(), String> {
        must_not_replace(output, Path::new(&self.name))
    }

    /// Returns path and feed profile of a scenario; `None` for other files.
    pub fn program(
        &self,
        machine: &MachineConfig,
        feed: Option<f64>,
    ) -> Result<Option<Arc<Program>>, Box<dyn Error>> {
        match &self.content {
            Content::Scenario(scenario) => Ok(Some(Arc::new(scenario.program(machine, feed)?))),
            _ if feed.is_some() => {
                Err(format!("{}: --feed requires a scenario file; a part program has --override", self.name)
                    .into())
            }
            _ => Ok(None),
        }
    }

    /// Returns the setpoints. `program` is the result of [`Self::program`].
    pub fn setpoints(
        &self,
        machine: &MachineConfig,
        program: Option<&Arc<Program>>,
    ) -> Result<SetpointSource<'_>, Box<dyn Error>> {
        let (limits, period) = (joint_limits(machine, ""), machine.periods().position);
        if let Some(program) = program {
            let source = ProgramSource::new(Arc::clone(program), &self.name, &limits, period);
            return Ok(SetpointSource::Grid(Box::new(source)));
        }
        match &self.content {
            Content::Scenario(_) => Err(format!("{}: a scenario without its program", self.name).into()),
            Content::PartProgram => {
                if !self.is_surveyed.get() {
                    self.survey(machine, &mut |_| ())?;
                }
                let source =
                    PartProgramSource::open(&self.name, PROGRAMS, machine, &self.options, &self.track)?;
                Ok(SetpointSource::Grid(Box::new(source)))
            }
            Content::Csv(opened) => {
                let file = match opened.take() {
                    Some(file) => file,
                    None => files::Input::open(Path::new(&self.name))?,
                };
                let psec = PsecCsvReader::new(file.into_reader(), &self.name, period, &limits)?;
                Ok(self.rows_of(psec))
            }
            Content::Log(log) => {
                let recorded = log.open(&self.name, machine, !self.is_surveyed.replace(true))?;
                let psec = PsecCsvReader::recorded(recorded, &self.name, period, &limits)?;
                Ok(self.rows_of(psec))
            }
            Content::Yaml(requests) => Ok(SetpointSource::Requests(Box::new(
                requests.iter().map(|request| Ok((0, request.clone()))),
            ))),
            Content::Mcap { topic } => {
                let trajectories = McapTrajectories::open(Path::new(&self.name), topic.as_deref())?;
                Ok(SetpointSource::Requests(Box::new(
                    trajectories.map(|next| next.map_err(SourceError::from)),
                )))
            }
        }
    }

    /// Returns the setpoints of rows, which start at rest in the first one.
    fn rows_of<'a>(&'a self, psec: PsecCsvReader<impl Read + 'a>) -> SetpointSource<'a> {
        let psec = psec.with_start_at_first_row();
        SetpointSource::Grid(Box::new(CsvSource {
            psec: if self.rows.is_some() { psec.with_kept_rows() } else { psec },
            gap: &self.gap,
            rows: self.rows.as_ref(),
        }))
    }

    /// Returns the programmed path of the part program `name`, read with the options of this one.
    ///
    /// # Errors
    ///
    /// Returns an error if this input is no part program, or the other is invalid.
    pub fn path_of(&self, name: &str, machine: &MachineConfig) -> Result<ProgrammedPath, Box<dyn Error>> {
        if !self.is_part_program() {
            return Err(format!("{}: --reference requires a part program", self.name).into());
        }
        let track = RefCell::default();
        let mut source = PartProgramSource::open(name, PROGRAMS, machine, &self.options, &track)?;
        let mut row = vec![0.0; machine.axes().len()];
        while source.next(&mut row).map_err(|error| -> Box<dyn Error> { error })? {
            interrupt::check()?;
        }
        drop(source);
        Ok(track.into_inner().programmed)
    }

    /// Interprets a part program as a whole, without planning. `on_line` receives the lines that were read.
    ///
    /// # Errors
    ///
    /// All errors and the travel excess of the program as one text.
    pub fn survey(
        &self,
        machine: &MachineConfig,
        on_line: &mut dyn FnMut(usize),
    ) -> Result<ProgramSurvey, Box<dyn Error>> {
        let survey = ProgramSurvey::new(&self.name, PROGRAMS, machine, &self.options, |line| {
            interrupt::check()?;
            on_line(line);
            Ok::<(), Box<dyn Error>>(())
        })?;
        self.is_surveyed.set(true);
        match survey.page(&self.name, machine) {
            Some(mut page) => {
                if let Some(name) = machine_with(machine, &survey.missing_axes) {
                    page += &format!(
                        "\na built-in machine with these axes as a template: virtual_axes machines --new {name} > mine.yaml"
                    );
                }
                for (line, note) in survey.notes() {
                    print_error(&format!("note: {}:{line}: {note}", self.name));
                }
                Err(page.into())
            }
            None => Ok(survey),
        }
    }

    /// Adds the name of the input to an error that does not name a file.
    pub fn name_error(&self, error: TrialError) -> Box<dyn Error> {
        match error {
            TrialError::Callback(error) => error.into(),
            TrialError::Source(error) => error,
            error => format!("{}: {error}", self.name).into(),
        }
    }
}

/// Returns the built-in machine with the fewest axes that has those of `machine` and the missing ones; `None` without a
/// missing one.
fn machine_with(machine: &MachineConfig, missing: &BTreeSet<char>) -> Option<&'static str> {
    let axes = |machine: &MachineConfig| -> BTreeSet<String> {
        machine.axes().iter().map(|axis| axis.name().to_ascii_uppercase()).collect()
    };
    let mut wanted = axes(machine);
    wanted.extend(missing.iter().map(char::to_string));
    let candidate = |name: &'static str| {
        let found = axes(&Parameters::load(name, MACHINES).ok()?.machine_config().ok()?);
        found.is_superset(&wanted).then_some((found.len(), name))
    };
    let candidates = MACHINES.iter().filter(|_| !missing.is_empty()).filter_map(|(name, _)| candidate(name));
    candidates.min_by_key(|(count, _)| *count).map(|(_, name)| name)
}

/// Adds the built-in part programs to the error of a name that is not known.
pub fn with_programs(mut error: ScenarioError) -> ScenarioError {
    if let ScenarioError::Unknown { name, nearest, known, .. } = &mut error {
        *nearest = nearest_input(name, builtin_names(SCENARIOS).chain(builtin_names(PROGRAMS)));
        if !known.is_empty() {
            known.push_str(&builtin_names(PROGRAMS).map(|name| format!(", {name}")).collect::<String>());
        }
    }
    error
}

/// Rejects an output file that is the same file as `input`.
pub fn must_not_replace(output: &Path, input: &Path) -> Result<(), String> {
    let same = fs::canonicalize(output).is_ok_and(|out| fs::canonicalize(input).is_ok_and(|i| i == out));
    if same && fs::metadata(output).is_ok_and(|m| m.is_file()) {
        return Err(format!("{}: the output would replace an input file", output.display()));
    }
    Ok(())
}

fn content_of(file: files::Input, topic: Option<&str>) -> Result<Content, Box<dyn Error>> {
    let name = file.name().to_owned();
    Ok(match file.kind() {
        FileKind::Scenario => {
            let text = file.text().unwrap_or_default();
            Content::Scenario(Box::new(Scenario::from_yaml(text, &name)?))
        }
        FileKind::PsecCsv => Content::Csv(RefCell::new(Some(file))),
        FileKind::PsecYaml => {
            let requests = read_psec_yaml(file.text().unwrap_or_default(), &name)?;
            if requests.iter().all(|request| request.points() == 0) {
                return Err(format!("{name}: no setpoints: no trajectory has points").into());
            }
            Content::Yaml(requests)
        }
        FileKind::Mcap => Content::Mcap { topic: topic.map(str::to_owned) },
        kind @ FileKind::Machine => {
            return Err(format!("{name}: is {kind}; use --machine for it").into());
        }
    })
}

/// Setpoints of a CSV file, read row by row.
struct CsvSource<'a, R> {
    psec: PsecCsvReader<R>,
    gap: &'a Cell<Option<TimeGap>>,
    rows: Option<&'a RefCell<Vec<PsecRow>>>,
}

impl<R: Read> GridSource for CsvSource<'_, R> {
    fn joints(&self) -> &[usize] {
        self.psec.joints()
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        let has_row = self.psec.next(row)?;
        if let Some(rows) = self.rows {
            rows.borrow_mut().extend(self.psec.take_rows());
        }
        if !has_row {
            self.gap.set(self.psec.gap());
        }
        Ok(has_row)
    }
}
