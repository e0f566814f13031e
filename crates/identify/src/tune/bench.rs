//! A machine on a path, that tunings are tried on.

use rayon::prelude::*;

use super::cost::Cost;
use super::course::Course;
use super::loops::{MarginLimits, worst};
use super::tuning::Tuning;
use super::{TuneError, Watch};
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{DesignError, Margins, PredictionModel, gpc};
use virtual_axes_core::machine::{MachineError, designed, prediction_model};
use virtual_axes_core::trial::{Figures, Outcome};
use virtual_axes_core::units::POSITION_GAIN;

/// Tunings that are run side by side: enough to fill vectors and to share what they have in common, few
/// enough for the caches.
const TOGETHER: usize = 32;

/// A tuning that was run.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// What was run.
    pub tuning: Tuning,
    /// Margins of its worst axis; none where a loop is unstable.
    pub margins: Option<Margins>,
    /// What it costs.
    pub cost: f64,
    /// Whether speed, current or voltage of an axis reached its limit.
    pub saturated: bool,
    /// What was measured: of one that was run side by side with others, all but the circles.
    pub figures: Figures,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// The one that costs least.
    pub best: Candidate,
    /// All that keep the limits, the best first.
    pub tried: Vec<Candidate>,
    /// Designs whose margins were looked at.
    pub designs: usize,
    /// Tunings that were run.
    pub runs: usize,
}

/// A machine on a path. The axes that move on it are those that are tuned.
pub struct Bench<'a> {
    parameters: &'a Parameters,
    course: &'a Course,
    cost: &'a Cost,
    watch: &'a dyn Watch,
    config: MachineConfig,
    /// Places of the axes that move, and their names.
    moving: Vec<usize>,
    joints: Vec<String>,
    /// Of the axes that move.
    models: Vec<PredictionModel>,
    present: Candidate,
}

impl<'a> Bench<'a> {
    /// Runs the machine as it is.
    ///
    /// # Errors
    /// [`TuneError`] if it cannot be run, or nothing moves.
    pub fn new(
        parameters: &'a Parameters,
        course: &'a Course,
        cost: &'a Cost,
        watch: &'a dyn Watch,
    ) -> Result<Self, TuneError> {
        let config = parameters.machine_config()?;
        watch.begin("as it is", 1);
        let figures = run(parameters, course, watch, false)?.figures;
        watch.done();
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
        let margins = worst(models.iter().zip(&axes).map(|(model, axis)| (model, designed(axis, model))));
        let joints = axes.iter().map(|axis| axis.name().to_owned()).collect();
        let present = candidate(Tuning::Present, margins, figures, cost, &config);
        Ok(Bench { parameters, course, cost, watch, config, moving, joints, models, present })
    }

    /// The machine as it is.
    pub fn present(&self) -> &Candidate {
        &self.present
    }

    /// Names of the axes that move.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// The machine.
    pub fn config(&self) -> &MachineConfig {
        &self.config
    }

    /// The parameters of the machine as it is.
    pub fn parameters(&self) -> &Parameters {
        self.parameters
    }

    /// What is minimized.
    pub fn cost(&self) -> &Cost {
        self.cost
    }

    /// The path.
    pub fn course(&self) -> &Course {
        self.course
    }

    pub(super) fn watch(&self) -> &dyn Watch {
        self.watch
    }

    /// Configurations of the axes that move.
    pub(super) fn axes(&self) -> impl Iterator<Item = &AxisConfig> {
        self.moving.iter().filter_map(|&axis| self.config.axes().get(axis))
    }

    /// Margins of the worst axis under `tuning`; none where a loop is unstable or there is no design.
    pub fn margins(&self, tuning: &Tuning) -> Option<Margins> {
        match tuning {
            Tuning::Present => self.present.margins,
            Tuning::Gpc { .. } => {
                let design = tuning.gpc()?;
                worst(self.models.iter().map(|model| (model, gpc(model, &design))))
            }
            Tuning::Cascade(axes) => worst(self.models.iter().zip(axes).map(|(model, (_, gains))| {
                (model, Rst::proportional(gains.gain * POSITION_GAIN).map_err(DesignError::from))
            })),
        }
    }

    /// Runs `tuning`; `margins` are those of [`Self::margins`].
    ///
    /// # Errors
    /// [`TuneError`].
    pub fn run(&self, tuning: &Tuning, margins: Option<Margins>) -> Result<Candidate, TuneError> {
        let tuned = tuning.apply(self.parameters, &self.joints)?;
        let figures = run(&tuned, self.course, self.watch, false)?.figures;
        self.watch.done();
        Ok(candidate(tuning.clone(), margins, figures, self.cost, &self.config))
    }

    /// `candidate` of a run side by side with others, with everything that is measured on `course`.
    pub(super) fn completed(&self, course: &Course, candidate: &Candidate) -> Result<Candidate, TuneError> {
        let tuned = candidate.tuning.apply(self.parameters, &self.joints)?;
        let figures = run(&tuned, course, self.watch, false)?.figures;
        Ok(Candidate { figures, ..candidate.clone() })
    }

    /// Runs `tuning` on a path with a recording.
    ///
    /// # Errors
    /// [`TuneError`].
    pub fn record_on(&self, course: &Course, tuning: &Tuning) -> Result<Outcome, TuneError> {
        run(&tuning.apply(self.parameters, &self.joints)?, course, self.watch, true)
    }

    /// Runs `tuning` on another path; the axes that are tuned are those that move on the bench's own.
    ///
    /// # Errors
    /// [`TuneError`].
    pub fn run_on(&self, course: &Course, tuning: &Tuning) -> Result<Candidate, TuneError> {
        let tuned = tuning.apply(self.parameters, &self.joints)?;
        let figures = run(&tuned, course, self.watch, false)?.figures;
        self.watch.done();
        Ok(candidate(tuning.clone(), self.margins(tuning), figures, self.cost, &self.config))
    }

    /// Runs of `tunings` on a path, over all cores, in their order.
    pub(super) fn runs_on(&self, course: &Course, tunings: Vec<Tuning>) -> Result<Vec<Candidate>, TuneError> {
        let with_margins = |tuning: Tuning| {
            let margins = self.margins(&tuning);
            (tuning, margins)
        };
        self.watch.begin("both paths", tunings.len());
        self.run_all(course, tunings.into_par_iter().map(with_margins).collect())
    }

    /// The margins of each of `tunings`, over all cores.
    pub(super) fn designs(&self, tunings: Vec<Tuning>) -> Vec<(Tuning, Option<Margins>)> {
        let with_margins = |tuning: Tuning| {
            let margins = self.margins(&tuning);
            (tuning, margins)
        };
        tunings.into_par_iter().map(with_margins).collect()
    }

    /// Runs of `designs`, over all cores, in their order.
    pub(super) fn runs(
        &self,
        part: &'static str,
        designs: Vec<(Tuning, Margins)>,
    ) -> Result<Vec<Candidate>, TuneError> {
        self.watch.begin(part, designs.len());
        let with_margins = designs.into_iter().map(|(tuning, margins)| (tuning, Some(margins)));
        self.run_all(self.course, with_margins.collect())
    }

    /// Runs of tunings that may have margins, over all cores, some of them side by side on each.
    fn run_all(
        &self,
        course: &Course,
        tunings: Vec<(Tuning, Option<Margins>)>,
    ) -> Result<Vec<Candidate>, TuneError> {
        // A core takes what another has left piece by piece: unasked, rayon hands out several at a time.
        let some = tunings.par_chunks(TOGETHER).with_max_len(1).map(|tunings| self.run_some(course, tunings));
        Ok(some.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }

    fn run_some(
        &self,
        course: &Course,
        tunings: &[(Tuning, Option<Margins>)],
    ) -> Result<Vec<Candidate>, TuneError> {
        let tuned =
            |(tuning, _): &_| Ok(Tuning::apply(tuning, self.parameters, &self.joints)?.machine_config()?);
        let variants = tunings.iter().map(tuned).collect::<Result<Vec<_>, TuneError>>()?;
        let allow = self.parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
        let go_on = || self.watch.go_on();
        let figures = course.run_together(&self.config, &variants, &self.moving, allow, go_on)?;
        let candidates = tunings.iter().zip(figures).map(|((tuning, margins), figures)| {
            self.watch.done();
            candidate(tuning.clone(), *margins, figures, self.cost, &self.config)
        });
        Ok(candidates.collect())
    }
}

/// Those of `designs` that keep `limits`.
pub(super) fn keeping(
    designs: Vec<(Tuning, Option<Margins>)>,
    limits: &MarginLimits,
) -> Vec<(Tuning, Margins)> {
    let kept = designs.into_iter().filter_map(|(tuning, margins)| Some((tuning, margins?)));
    kept.filter(|(_, margins)| limits.are_kept_by(margins)).collect()
}

/// `candidates` without those that saturate, the cheapest first; equals stay in their order.
pub(super) fn ranked(mut candidates: Vec<Candidate>) -> Vec<Candidate> {
    candidates.retain(|candidate| !candidate.saturated && candidate.cost.is_finite());
    candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    candidates
}

/// Runs a machine on a path.
fn run(
    parameters: &Parameters,
    course: &Course,
    watch: &dyn Watch,
    record: bool,
) -> Result<Outcome, TuneError> {
    let config = parameters.machine_config()?;
    let allow = parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
    Ok(course.run(&config, allow, record, |_| watch.go_on())?)
}

fn candidate(
    tuning: Tuning,
    margins: Option<Margins>,
    figures: Figures,
    cost: &Cost,
    config: &MachineConfig,
) -> Candidate {
    Candidate {
        tuning,
        margins,
        cost: cost.of(&figures, config),
        saturated: figures.axes.iter().any(|axis| axis.report.saturation_time > 0.0),
        figures,
    }
}
