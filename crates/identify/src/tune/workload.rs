//! Workload of a tuning problem: setpoints in memory for repeated simulation.

use std::io;
use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::path::Program;
use virtual_axes_core::trajectory::TrajectoryRequest;
use virtual_axes_core::trial::{
    self, Figures, GridRows, Measures, SetpointSource, SourceError, Tick, Trial, TrialError, TrialOutcome,
};
use virtual_axes_core::units::Nanoseconds;

/// Setpoints in memory with their path, if known. They are valid for machines with the same joints, travel
/// limits and periods, with any controller.
#[derive(Debug, Clone)]
pub struct Workload {
    name: String,
    program: Option<Arc<Program>>,
    content: Content,
}

#[derive(Debug, Clone)]
enum Content {
    /// PSEC of `joints`, row by row for each position cycle, and true for each row that is reached at rapid traverse.
    Rows { joints: Vec<usize>, rows: Vec<f64>, rapid: Vec<bool> },
    /// Trajectories with arrival times, ns.
    Requests(Vec<(Nanoseconds, TrajectoryRequest)>),
}

impl Workload {
    /// Reads all `setpoints`; calls `go_on` for every row.
    ///
    /// # Errors
    /// [`SourceError`] of the setpoints or of `go_on`.
    pub fn read(
        name: &str,
        program: Option<Arc<Program>>,
        setpoints: SetpointSource<'_>,
        go_on: impl Fn() -> io::Result<()>,
    ) -> Result<Self, SourceError> {
        let content = match setpoints {
            SetpointSource::Grid(mut source) => {
                let joints = source.joints().to_vec();
                let mut row = vec![0.0; joints.len()];
                let (mut rows, mut rapid) = (Vec::new(), Vec::new());
                while source.next(&mut row)? {
                    go_on()?;
                    rows.extend_from_slice(&row);
                    rapid.push(source.is_rapid());
                }
                Content::Rows { joints, rows, rapid }
            }
            SetpointSource::Requests(requests) => Content::Requests(requests.collect::<Result<_, _>>()?),
        };
        Ok(Workload { name: name.to_owned(), program, content })
    }

    /// Returns the name of the scenario or file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the path, if known.
    pub fn program(&self) -> Option<&Arc<Program>> {
        self.program.as_ref()
    }

    /// Returns true for each row of setpoints that is reached at rapid traverse; empty for trajectories.
    pub fn rapid(&self) -> &[bool] {
        match &self.content {
            Content::Rows { rapid, .. } => rapid,
            Content::Requests(_) => &[],
        }
    }

    /// Runs the workload on `machine` with [`trial::run`].
    ///
    /// # Errors
    /// [`TrialError`] if the machine cannot run the setpoints.
    pub fn run(
        &self,
        machine: &MachineConfig,
        allow_nonzero_end_velocity: bool,
        record: bool,
        observe: impl FnMut(Tick<'_>) -> io::Result<()>,
    ) -> Result<TrialOutcome, TrialError> {
        let program = self.program.clone();
        let measures = Measures::ALL;
        let trial = Trial { machine, program, allow_nonzero_end_velocity, record, measures };
        trial::run(&trial, self.setpoints(), observe)
    }

    /// Runs the workload on `variants` of `machine` that differ in the axes `own`, with
    /// [`trial::run_variants`].
    ///
    /// # Errors
    /// [`TrialError`] if the machine cannot run the setpoints.
    pub fn run_variants(
        &self,
        machine: &MachineConfig,
        variants: &[MachineConfig],
        own: &[usize],
        allow_nonzero_end_velocity: bool,
        go_on: impl Fn() -> io::Result<()>,
    ) -> Result<Vec<Figures>, TrialError> {
        let program = self.program.clone();
        let measures = Measures::WITHOUT_CIRCLES;
        let trial = Trial { machine, program, allow_nonzero_end_velocity, record: false, measures };
        trial::run_variants(&trial, self.setpoints(), variants, own, go_on)
    }

    fn setpoints(&self) -> SetpointSource<'_> {
        match &self.content {
            Content::Rows { joints, rows, rapid } => {
                SetpointSource::Grid(Box::new(GridRows::new(joints, rows).with_rapid(rapid)))
            }
            Content::Requests(requests) => {
                SetpointSource::Requests(Box::new(requests.iter().map(|request| Ok(request.clone()))))
            }
        }
    }
}
