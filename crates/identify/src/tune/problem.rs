//! Tuning problem: a machine, a workload and a cost on which tunings are evaluated.

use rayon::prelude::*;

use super::cost::Cost;
use super::error::TuneError;
use super::margin_limits::{MarginLimits, worst_margins};
use super::progress::Progress;
use super::tuning::Tuning;
use super::workload::Workload;
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{DesignError, Margins, PredictionModel, check_stable, gpc};
use virtual_axes_core::machine::{
    MachineError, contour_axes, design_contour_controller, design_controller, prediction_model,
    with_contour_gain,
};
use virtual_axes_core::trial::{Figures, TrialError, TrialOutcome};
use virtual_axes_core::units::POSITION_GAIN;

/// Tunings simulated side by side: enough to fill SIMD vectors, few enough for the caches.
const CHUNK: usize = 32;

/// Evaluated tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct TuningCandidate {
    /// Tuning.
    pub tuning: Tuning,
    /// Margins of the worst axis; none if a loop is unstable.
    pub margins: Option<Margins>,
    /// Cost.
    pub cost: f64,
    /// True if speed, current or voltage of an axis reached its limit.
    pub is_saturated: bool,
    /// Figures of the run; tunings simulated side by side lack circles.
    pub figures: Figures,
}

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// Candidate with the lowest cost.
    pub best: TuningCandidate,
    /// Candidates within the limits in order of rising cost.
    pub tried: Vec<TuningCandidate>,
    /// Number of designs.
    pub designs: usize,
    /// Number of runs.
    pub runs: usize,
}

/// Machine on a workload with a cost; the axes that move on it are tuned.
pub struct TuningProblem<'a> {
    parameters: &'a Parameters,
    workload: &'a Workload,
    cost: &'a Cost,
    progress: &'a dyn Progress,
    config: MachineConfig,
    /// Indices of the moving axes.
    moving: Vec<usize>,
    joints: Vec<String>,
    /// Prediction models of the moving axes.
    models: Vec<PredictionModel>,
    /// Indices and prediction models of the standing axes on which cross-coupled control can act.
    standing: Vec<(usize, PredictionModel)>,
    present: TuningCandidate,
}

impl<'a> TuningProblem<'a> {
    /// Creates a tuning problem and runs the present tuning.
    ///
    /// # Errors
    /// [`TuneError`] if the machine cannot be run or no axis moves.
    pub fn new(
        parameters: &'a Parameters,
        workload: &'a Workload,
        cost: &'a Cost,
        progress: &'a dyn Progress,
    ) -> Result<Self, TuneError> {
        let config = parameters.machine_config()?;
        progress.begin("present tuning", 1);
        let figures = run(parameters, workload, progress, false)?.figures;
        progress.finish_run();
        let moving: Vec<usize> = (0..config.axes().len()).filter(|&axis| figures.axes[axis].moves).collect();
        if moving.is_empty() {
            return Err(TuneError::NothingMoves);
        }
        let axes: Vec<&AxisConfig> = moving.iter().map(|&axis| &config.axes()[axis]).collect();
        let model = |axis: &&AxisConfig| {
            prediction_model(axis, &config.periods())
                .map_err(|source| MachineError::Axis { axis: axis.name().to_owned(), source })
        };
        let models = axes.iter().map(model).collect::<Result<Vec<_>, _>>()?;
        let coupled = contour_axes(f64::MIN_POSITIVE, config.axes().iter()).into_iter();
        let standing = coupled.filter(|index| !moving.contains(index));
        let standing = standing
            .map(|index| Ok((index, model(&&config.axes()[index])?)))
            .collect::<Result<_, MachineError>>()?;
        let joints = axes.iter().map(|axis| axis.name().to_owned()).collect();
        let present = candidate(Tuning::Present, None, figures, cost, &config);
        let mut problem = TuningProblem {
            parameters,
            workload,
            cost,
            progress,
            config,
            moving,
            joints,
            models,
            standing,
            present,
        };
        problem.present.margins = problem.margins(&Tuning::Present);
        Ok(problem)
    }

    /// Returns the present tuning of the machine.
    pub fn present(&self) -> &TuningCandidate {
        &self.present
    }

    /// Returns the names of the moving axes.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// Returns the machine configuration.
    pub fn config(&self) -> &MachineConfig {
        &self.config
    }

    /// Returns the parameters with the present tuning.
    pub fn parameters(&self) -> &Parameters {
        self.parameters
    }

    /// Returns the cost.
    pub fn cost(&self) -> &Cost {
        self.cost
    }

    /// Returns the workload.
    pub fn workload(&self) -> &Workload {
        self.workload
    }

    pub(super) fn progress(&self) -> &dyn Progress {
        self.progress
    }

    /// Returns the configurations of the moving axes.
    pub(super) fn axes(&self) -> impl Iterator<Item = &AxisConfig> {
        self.moving.iter().filter_map(|&axis| self.config.axes().get(axis))
    }

    /// Returns the margins of the worst moving axis with `tuning`, with cross-coupled control along and across the path; none
    /// if a loop is unstable or has no design.
    pub fn margins(&self, tuning: &Tuning) -> Option<Margins> {
        let present = || self.axes().zip(&self.models).map(|(axis, model)| design_controller(axis, model));
        let along: Vec<Result<Rst, DesignError>> = match tuning {
            Tuning::Present | Tuning::ContourGain(_) => present().collect(),
            Tuning::Gpc { .. } => {
                let design = tuning.gpc()?;
                self.models.iter().map(|model| gpc(model, &design)).collect()
            }
            Tuning::Cascade(axes) => {
                let proportional = |gain: f64| Rst::proportional(gain * POSITION_GAIN);
                axes.iter().map(|(_, gains)| proportional(gains.gain).map_err(DesignError::from)).collect()
            }
        };
        let gain = match tuning {
            Tuning::ContourGain(gain) => gain * POSITION_GAIN,
            _ => self.config.contour_gain(),
        };
        let coupled = contour_axes(gain, self.config.axes().iter());
        // A machine whose standing axis is unstable is rejected.
        let is_stable = |(index, model): &(usize, PredictionModel)| {
            let across = design_contour_controller(&self.config.axes()[*index], model, gain);
            across.and_then(|rst| check_stable(model, &rst)).is_ok()
        };
        if !coupled.is_empty() && !self.standing.iter().all(is_stable) {
            return None;
        }
        let designs = || self.models.iter().zip(&along);
        let across = self
            .moving
            .iter()
            .zip(designs())
            .filter(|(axis, _)| coupled.contains(axis))
            .map(|(_, (model, rst))| (model, rst.clone().and_then(|rst| with_contour_gain(&rst, gain))));
        worst_margins(designs().map(|(model, rst)| (model, rst.clone())).chain(across))
    }

    /// Runs `tuning` on the workload; `margins` is the result of [`Self::margins`].
    ///
    /// # Errors
    /// [`TuneError`] if the tuning cannot be applied or the run fails.
    pub fn run(&self, tuning: &Tuning, margins: Option<Margins>) -> Result<TuningCandidate, TuneError> {
        let tuned = tuning.apply(self.parameters, &self.joints)?;
        let figures = run(&tuned, self.workload, self.progress, false)?.figures;
        self.progress.finish_run();
        Ok(candidate(tuning.clone(), margins, figures, self.cost, &self.config))
    }

    /// Runs `candidate` again by itself on `workload`, which gives complete figures.
    pub(super) fn with_complete_figures(
        &self,
        workload: &Workload,
        candidate: &TuningCandidate,
    ) -> Result<TuningCandidate, TuneError> {
        let tuned = candidate.tuning.apply(self.parameters, &self.joints)?;
        let figures = run(&tuned, workload, self.progress, false)?.figures;
        Ok(TuningCandidate { figures, ..candidate.clone() })
    }

    /// Runs `tuning` on another workload with a recording.
    ///
    /// # Errors
    /// [`TuneError`] if the tuning cannot be applied or the run fails.
    pub fn record_on(&self, workload: &Workload, tuning: &Tuning) -> Result<TrialOutcome, TuneError> {
        run(&tuning.apply(self.parameters, &self.joints)?, workload, self.progress, true)
    }

    /// Runs `tuning` on another workload; the tuned axes are those that move on the workload of the problem.
    ///
    /// # Errors
    /// [`TuneError`] if the tuning cannot be applied or the run fails.
    pub fn run_on(&self, workload: &Workload, tuning: &Tuning) -> Result<TuningCandidate, TuneError> {
        let tuned = tuning.apply(self.parameters, &self.joints)?;
        let figures = run(&tuned, workload, self.progress, false)?.figures;
        self.progress.finish_run();
        Ok(candidate(tuning.clone(), self.margins(tuning), figures, self.cost, &self.config))
    }

    /// Runs `tunings` on a workload in parallel, in their order.
    pub(super) fn runs_on(
        &self,
        workload: &Workload,
        tunings: Vec<Tuning>,
    ) -> Result<Vec<TuningCandidate>, TuneError> {
        let with_margins = |tuning: Tuning| {
            let margins = self.margins(&tuning);
            (tuning, margins)
        };
        self.progress.begin("both paths", tunings.len());
        self.run_all(workload, tunings.into_par_iter().map(with_margins).collect())
    }

    /// Computes the margins of `tunings` in parallel.
    pub(super) fn designs(&self, tunings: Vec<Tuning>) -> Result<Vec<(Tuning, Option<Margins>)>, TuneError> {
        let with_margins = |tuning: Tuning| {
            self.progress.check_interrupt().map_err(TrialError::Callback)?;
            let margins = self.margins(&tuning);
            Ok((tuning, margins))
        };
        tunings.into_par_iter().map(with_margins).collect()
    }

    /// Runs `designs` on the workload in parallel, in their order.
    pub(super) fn runs(
        &self,
        part: &'static str,
        designs: Vec<(Tuning, Margins)>,
    ) -> Result<Vec<TuningCandidate>, TuneError> {
        self.progress.begin(part, designs.len());
        let with_margins = designs.into_iter().map(|(tuning, margins)| (tuning, Some(margins)));
        self.run_all(self.workload, with_margins.collect())
    }

    /// Runs tunings in parallel, in chunks that are simulated side by side.
    fn run_all(
        &self,
        workload: &Workload,
        tunings: Vec<(Tuning, Option<Margins>)>,
    ) -> Result<Vec<TuningCandidate>, TuneError> {
        // `with_max_len` lets idle cores take single chunks.
        let some = tunings.par_chunks(CHUNK).with_max_len(1).map(|tunings| self.run_chunk(workload, tunings));
        Ok(some.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }

    fn run_chunk(
        &self,
        workload: &Workload,
        tunings: &[(Tuning, Option<Margins>)],
    ) -> Result<Vec<TuningCandidate>, TuneError> {
        let tuned =
            |(tuning, _): &_| Ok(Tuning::apply(tuning, self.parameters, &self.joints)?.machine_config()?);
        let variants = tunings.iter().map(tuned).collect::<Result<Vec<_>, TuneError>>()?;
        let allow = self.parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
        let go_on = || self.progress.check_interrupt();
        let figures = workload.run_variants(&self.config, &variants, &self.moving, allow, go_on)?;
        let candidates = tunings.iter().zip(figures).map(|((tuning, margins), figures)| {
            self.progress.finish_run();
            candidate(tuning.clone(), *margins, figures, self.cost, &self.config)
        });
        Ok(candidates.collect())
    }
}

/// Returns the `designs` within `limits`.
pub(super) fn within_limits(
    designs: Vec<(Tuning, Option<Margins>)>,
    limits: &MarginLimits,
) -> Vec<(Tuning, Margins)> {
    let kept = designs.into_iter().filter_map(|(tuning, margins)| Some((tuning, margins?)));
    kept.filter(|(_, margins)| limits.allows(margins)).collect()
}

/// Removes saturated candidates and sorts the others by cost; the sort is stable.
pub(super) fn ranked(mut candidates: Vec<TuningCandidate>) -> Vec<TuningCandidate> {
    candidates.retain(|candidate| !candidate.is_saturated && candidate.cost.is_finite());
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    candidates
}

/// Runs a machine on a workload.
fn run(
    parameters: &Parameters,
    workload: &Workload,
    progress: &dyn Progress,
    record: bool,
) -> Result<TrialOutcome, TuneError> {
    let config = parameters.machine_config()?;
    let allow = parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
    Ok(workload.run(&config, allow, record, |_| progress.check_interrupt())?)
}

fn candidate(
    tuning: Tuning,
    margins: Option<Margins>,
    figures: Figures,
    cost: &Cost,
    config: &MachineConfig,
) -> TuningCandidate {
    TuningCandidate {
        tuning,
        margins,
        cost: cost.of(&figures, config),
        is_saturated: figures.axes.iter().any(|axis| axis.report.saturation_time > 0.0),
        figures,
    }
}
