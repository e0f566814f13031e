//! What a command is given to run: a scenario or a file of setpoints.

use std::cell::RefCell;
use std::error::Error;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::path::Program;
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::simulation::joints;
use virtual_axes_core::trajectory::Request;
use virtual_axes_core::trial::{GridSource, ProgramSource, Setpoints, SourceError};
use virtual_axes_io::files::{self, FileKind, PsecCsv, Trajectories, read_psec_yaml};

/// A scenario or setpoints.
#[derive(Debug)]
pub struct Input {
    name: String,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Scenario(Box<Scenario>),
    /// The opened file serves the first run, so that a pipe will do; the others open it anew.
    Csv(RefCell<Option<files::Input>>),
    Yaml(Vec<Request>),
    Mcap {
        topic: Option<String>,
    },
}

impl Input {
    /// A shipped scenario if `name` is one, otherwise the file `name`; `topic` is that of a recording.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn open(name: &str, topic: Option<&str>) -> Result<Self, Box<dyn Error>> {
        let shipped = Scenario::builtin_names().any(|known| known == name);
        let content = if shipped || !Path::new(name).exists() {
            // What is neither is told with the names that there are.
            Content::Scenario(Box::new(Scenario::load(name)?))
        } else {
            content_of(files::Input::open(Path::new(name))?, topic)?
        };
        if topic.is_some() && !matches!(content, Content::Mcap { .. }) {
            return Err(format!("{name}: --topic is for recordings (MCAP)").into());
        }
        Ok(Input { name: name.to_owned(), content })
    }

    /// Name of the scenario or the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it is, if that is told.
    pub fn description(&self) -> &str {
        match &self.content {
            Content::Scenario(scenario) => scenario.description(),
            _ => "",
        }
    }

    /// Refuses to write where it is read from.
    pub fn must_not_be(&self, output: &Path) -> Result<(), String> {
        must_not_replace(output, Path::new(&self.name))
    }

    /// Path and law of time, of a scenario.
    pub fn program(
        &self,
        machine: &MachineConfig,
        feed: Option<f64>,
    ) -> Result<Option<Arc<Program>>, Box<dyn Error>> {
        match &self.content {
            Content::Scenario(scenario) => Ok(Some(Arc::new(scenario.program(machine, feed)?))),
            _ if feed.is_some() => Err(format!("{}: --feed is for scenarios", self.name).into()),
            _ => Ok(None),
        }
    }

    /// The setpoints; `program` is what [`Self::program`] gave.
    pub fn setpoints(
        &self,
        machine: &MachineConfig,
        program: Option<&Arc<Program>>,
    ) -> Result<Setpoints<'_>, Box<dyn Error>> {
        let (limits, period) = (joints(machine, ""), machine.periods().position);
        if let Some(program) = program {
            let source = ProgramSource::new(Arc::clone(program), &self.name, &limits, period);
            return Ok(Setpoints::Grid(Box::new(source)));
        }
        match &self.content {
            Content::Scenario(_) => Err(format!("{}: a scenario without its program", self.name).into()),
            Content::Csv(opened) => {
                let file = match opened.take() {
                    Some(file) => file,
                    None => files::Input::open(Path::new(&self.name))?,
                };
                let psec = PsecCsv::new(file.into_reader(), &self.name, period, &limits)?;
                Ok(Setpoints::Grid(Box::new(CsvSource(psec.starting_at_first_row()))))
            }
            Content::Yaml(requests) => {
                Ok(Setpoints::Requests(Box::new(requests.iter().map(|request| Ok((0, request.clone()))))))
            }
            Content::Mcap { topic } => {
                let trajectories = Trajectories::open(Path::new(&self.name), topic.as_deref())?;
                Ok(Setpoints::Requests(Box::new(trajectories.map(|next| next.map_err(SourceError::from)))))
            }
        }
    }
}

/// Refuses to write `output` where `input` is read from.
pub fn must_not_replace(output: &Path, input: &Path) -> Result<(), String> {
    let same = fs::canonicalize(output).is_ok_and(|out| fs::canonicalize(input).is_ok_and(|i| i == out));
    if same && fs::metadata(output).is_ok_and(|m| m.is_file()) {
        return Err(format!("{}: the output would replace what is read", output.display()));
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
                return Err(format!("{name}: there is no setpoint: no trajectory has points").into());
            }
            Content::Yaml(requests)
        }
        FileKind::Mcap => Content::Mcap { topic: topic.map(str::to_owned) },
        kind @ FileKind::Machine => {
            return Err(format!("{name}: it is {kind}, to be given to --machine").into());
        }
    })
}

/// Setpoints of a file, row by row.
struct CsvSource<R>(PsecCsv<R>);

impl<R: Read> GridSource for CsvSource<R> {
    fn joints(&self) -> &[usize] {
        self.0.joints()
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        Ok(self.0.next(row)?)
    }
}
