//! A path that is run many times: its setpoints, read once.

use std::io;
use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::path::Program;
use virtual_axes_core::trajectory::Request;
use virtual_axes_core::trial::{
    self, Figures, GridSource, Outcome, Setpoints, SourceError, Tick, Trial, TrialError,
};
use virtual_axes_core::units::Nanoseconds;

/// Setpoints in memory, with the path behind them if it is known. They serve machines of the same joints,
/// strokes and periods, whatever their controllers.
#[derive(Debug, Clone)]
pub struct Course {
    name: String,
    program: Option<Arc<Program>>,
    content: Content,
}

#[derive(Debug, Clone)]
enum Content {
    /// PSEC of `joints` at one position instant after the other.
    Rows { joints: Vec<usize>, rows: Vec<f64> },
    /// Trajectories with the times at which they arrive, ns.
    Requests(Vec<(Nanoseconds, Request)>),
}

impl Course {
    /// Reads `setpoints` to their end; `go_on` is asked at every row.
    ///
    /// # Errors
    /// Those of the setpoints, and of `go_on`.
    pub fn read(
        name: &str,
        program: Option<Arc<Program>>,
        setpoints: Setpoints<'_>,
        go_on: impl Fn() -> io::Result<()>,
    ) -> Result<Self, SourceError> {
        let content = match setpoints {
            Setpoints::Grid(mut source) => {
                let joints = source.joints().to_vec();
                let mut row = vec![0.0; joints.len()];
                let mut rows = Vec::new();
                while source.next(&mut row)? {
                    go_on()?;
                    rows.extend_from_slice(&row);
                }
                Content::Rows { joints, rows }
            }
            Setpoints::Requests(requests) => Content::Requests(requests.collect::<Result<_, _>>()?),
        };
        Ok(Course { name: name.to_owned(), program, content })
    }

    /// Name of the scenario or the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Runs it on `machine`, as [`trial::run`].
    ///
    /// # Errors
    /// [`TrialError`].
    pub fn run(
        &self,
        machine: &MachineConfig,
        allow_nonzero_end_velocity: bool,
        record: bool,
        watch: impl FnMut(Tick<'_>) -> io::Result<()>,
    ) -> Result<Outcome, TrialError> {
        let program = self.program.clone();
        let trial = Trial { machine, program, allow_nonzero_end_velocity, record };
        trial::run(&trial, self.setpoints(), watch)
    }

    /// Runs it on `variants` of `machine` that have axes at `own` of their own, as [`trial::run_together`].
    ///
    /// # Errors
    /// [`TrialError`].
    pub fn run_together(
        &self,
        machine: &MachineConfig,
        variants: &[MachineConfig],
        own: &[usize],
        allow_nonzero_end_velocity: bool,
        watch: impl Fn() -> io::Result<()>,
    ) -> Result<Vec<Figures>, TrialError> {
        let program = self.program.clone();
        let trial = Trial { machine, program, allow_nonzero_end_velocity, record: false };
        trial::run_together(&trial, self.setpoints(), variants, own, watch)
    }

    fn setpoints(&self) -> Setpoints<'_> {
        match &self.content {
            Content::Rows { joints, rows } => Setpoints::Grid(Box::new(Rows { joints, rows })),
            Content::Requests(requests) => {
                Setpoints::Requests(Box::new(requests.iter().map(|request| Ok(request.clone()))))
            }
        }
    }
}

/// What is left of the rows.
struct Rows<'a> {
    joints: &'a [usize],
    rows: &'a [f64],
}

impl GridSource for Rows<'_> {
    fn joints(&self) -> &[usize] {
        self.joints
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        let Some((first, rest)) = self.rows.split_at_checked(row.len()) else { return Ok(false) };
        row.copy_from_slice(first);
        self.rows = rest;
        // A row without joints would never end.
        Ok(!row.is_empty())
    }
}
