//! Iterations of learning.

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::trial::{Figures, GridRows, Measures, SetpointSource, Tick, Trial, TrialOutcome};

use super::axis::LearningAxis;
use super::error::LearningError;
use super::learner::{Learner, LearningIteration, LearningOptions};
use super::setpoint_limits::SetpointExcess;
use crate::tune::{Progress, Workload};

/// Largest number of iterations.
pub const MAX_ITERATIONS: usize = 1000;
/// Number of successive iterations with a growing largest error that ends the learning.
const GROWTHS: usize = 2;

/// Reason for the end of the iterations.
#[derive(Debug, Clone, PartialEq)]
pub enum LearningEnd {
    /// All iterations were computed.
    Complete,
    /// The largest error grew in two successive iterations.
    Diverged,
    /// The next compensated setpoints would exceed a limit.
    Limit(SetpointExcess),
}

/// Result of iterative learning.
#[derive(Debug, Clone, PartialEq)]
pub struct LearningResult {
    /// Moving axes with their filters.
    pub axes: Vec<LearningAxis>,
    /// Runs in order; the first one is that of the programmed setpoints.
    pub iterations: Vec<LearningIteration>,
    /// Index of the run with the smallest error.
    pub best: usize,
    /// Reason for the end.
    pub end: LearningEnd,
    /// Delay of the setpoints with which positions are compared, position cycles: the longest α of a moving axis.
    pub delay: usize,
    /// Outcomes of the run of the programmed setpoints and of the best run, with recordings if they were requested.
    pub outcomes: [TrialOutcome; 2],
    /// Programmed setpoints, m or rad: a row of all axes of the machine per position cycle.
    pub programmed: Vec<f64>,
    /// Setpoints of the best run, m or rad: a row of all axes of the machine per position cycle.
    pub psec: Vec<f64>,
}

/// Learns compensated setpoints of `workload` on `machine`.
///
/// `record` requests recordings of the first and the best run.
///
/// # Errors
/// [`LearningError`] if a filter does not converge, a run fails, no axis moves, an option is out of range, or the setpoints
/// of the first iteration exceed a limit of an axis.
pub fn learn(
    machine: &MachineConfig,
    workload: &Workload,
    options: &LearningOptions,
    allow_nonzero_end_velocity: bool,
    record: bool,
    progress: &dyn Progress,
) -> Result<LearningResult, LearningError> {
    let LearningOptions { iterations, encoder_step, .. } = *options;
    if !(1..=MAX_ITERATIONS).contains(&iterations) {
        return Err(LearningError::Iterations { iterations, most: MAX_ITERATIONS });
    }
    if !(encoder_step.is_finite() && encoder_step >= 0.0) {
        return Err(LearningError::EncoderStep { step: encoder_step });
    }
    progress.begin("iterations", iterations + 1);
    let mut runner = Runner {
        machine,
        workload,
        allow: allow_nonzero_end_velocity,
        record,
        progress,
        positions: Vec::new(),
    };
    let (mut programmed, first) = runner.run_programmed()?;
    let count = machine.axes().len();
    if let Some(last) = programmed.len().checked_sub(count) {
        // The position holds after the end.
        let last = programmed[last..].to_vec();
        programmed.extend(last);
    }
    let learner = Learner::new(machine, programmed, &first.figures, options)?;
    let mut compensation = vec![Vec::new(); learner.axes.len()];
    compensation.iter_mut().for_each(|v| v.resize(learner.rows(), 0.0));
    let errors = learner.errors(&runner.positions);
    let mut found = LearningResult {
        iterations: vec![learner.iteration(&first, &errors, &compensation)],
        best: 0,
        end: LearningEnd::Complete,
        delay: learner.delay,
        outcomes: [first.clone(), first],
        psec: learner.programmed.clone(),
        programmed: learner.programmed.clone(),
        axes: Vec::new(),
    };
    let (mut errors, mut growths) = (errors, 0);
    for number in 1..=iterations {
        learner.update(&mut compensation, &errors);
        let psec = learner.compensated(&compensation);
        if let Some(excess) = learner.first_excess(&psec) {
            if number == 1 {
                return Err(LearningError::Excess(excess));
            }
            found.end = LearningEnd::Limit(excess);
            break;
        }
        let outcome = runner.run(&psec, &learner.programmed)?;
        errors = learner.errors(&runner.positions);
        let iteration = learner.iteration(&outcome, &errors, &compensation);
        let before = found.iterations.last().map_or(0.0, LearningIteration::error);
        growths = if iteration.error() > before { growths + 1 } else { 0 };
        if iteration.error() < found.iterations[found.best].error() {
            found.best = number;
            found.outcomes[1] = outcome;
            found.psec = psec;
        }
        found.iterations.push(iteration);
        if growths == GROWTHS {
            found.end = LearningEnd::Diverged;
            break;
        }
    }
    found.axes = learner.axes;
    Ok(found)
}

impl LearningResult {
    /// Runs the programmed setpoints and those of the best run on another `machine` with the same joints and periods.
    ///
    /// # Errors
    /// [`LearningError::Trial`] if a run fails.
    pub fn run_on(
        &self,
        machine: &MachineConfig,
        workload: &Workload,
        allow_nonzero_end_velocity: bool,
        progress: &dyn Progress,
    ) -> Result<[Figures; 2], LearningError> {
        let allow = allow_nonzero_end_velocity;
        let mut runner = Runner { machine, workload, allow, record: false, progress, positions: Vec::new() };
        let programmed = runner.run(&self.programmed, &self.programmed)?.figures;
        Ok([programmed, runner.run(&self.psec, &self.programmed)?.figures])
    }
}

/// Runs of the machine; the positions of all axes at the position cycles of the last run are kept.
struct Runner<'a> {
    machine: &'a MachineConfig,
    workload: &'a Workload,
    allow: bool,
    record: bool,
    progress: &'a dyn Progress,
    positions: Vec<f64>,
}

impl Runner<'_> {
    /// Runs the workload; returns its setpoints, a row of all axes per position cycle, and the outcome.
    fn run_programmed(&mut self) -> Result<(Vec<f64>, TrialOutcome), LearningError> {
        let (mut psec, positions) = (Vec::new(), &mut self.positions);
        let outcome = self.workload.run(self.machine, self.allow, self.record, |tick: Tick<'_>| {
            let samples = || tick.machine.axes().iter().map(|axis| axis.sample());
            psec.extend(samples().map(|sample| sample.psec));
            positions.extend(samples().map(|sample| sample.position));
            self.progress.check_interrupt()
        })?;
        self.progress.finish_run();
        Ok((psec, outcome))
    }

    /// Runs `psec`; contour errors are those against the path or the `programmed` setpoints.
    fn run(&mut self, psec: &[f64], programmed: &[f64]) -> Result<TrialOutcome, LearningError> {
        let trial = Trial {
            machine: self.machine,
            program: self.workload.program().cloned(),
            allow_nonzero_end_velocity: self.allow,
            record: self.record,
            measures: Measures::ALL,
        };
        let joints: Vec<usize> = (0..self.machine.axes().len()).collect();
        let positions = &mut self.positions;
        positions.clear();
        let outcome = virtual_axes_core::trial::run_compensated(
            &trial,
            SetpointSource::Grid(Box::new(GridRows::new(&joints, psec).with_rapid(self.workload.rapid()))),
            programmed,
            |tick| {
                positions.extend(tick.machine.axes().iter().map(|axis| axis.sample().position));
                self.progress.check_interrupt()
            },
        )?;
        self.progress.finish_run();
        Ok(outcome)
    }
}
