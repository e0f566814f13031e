//! Steps in closed loop: delays, feedforward weights without regression result, refinement.

use rayon::prelude::*;

use super::super::closed_loop::{find_experiments, position_residuals};
use super::super::delays::{DelayParameter, fit_delay};
use super::super::experiment::Experiment;
use super::super::feedforward_mode::FeedforwardMode;
use super::super::findings::report_delays;
use super::super::friction::{Breakaway, FrictionLaw};
use super::super::options::{IdentificationInput, RefinementScope};
use super::super::refine::{RefinedParameter, refine, with_parameters};
use super::super::setpoints::stride;
use super::IdentificationSteps;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, Periods, PositionControllerConfig};
use virtual_axes_core::units::seconds;

/// Change of a nuisance parameter, relative to its scale, for the delay identification.
const NUISANCE: f64 = 1e-2;
/// Trial inertias relative to the start value. Eq. 5 misses most of the inertia with a fast drive and slow
/// sampling.
const LADDER: [f64; 13] = [0.06, 0.12, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0];

impl IdentificationSteps<'_> {
    /// Fits delays and refines parameters in closed loop.
    pub(super) fn fit_closed_loop(&mut self) {
        let (axis, default) = (&self.found.axis, FeedforwardMode::Both);
        let experiments: Vec<Experiment> = self
            .inputs
            .iter()
            .enumerate()
            .flat_map(|(k, input)| {
                find_experiments(input.signals, k, axis, self.periods, input.feedforward.unwrap_or(default))
            })
            .collect();
        if experiments.is_empty() {
            self.found.findings.push(Finding::missing(
                "no-setpoints",
                explain_missing_experiments(self.inputs, self.periods),
                "record the position setpoints (PSEC), starting at rest, with the position cycle or an integer \
                 fraction of it",
            ));
            return;
        }
        if self.found.axis.position_loop.controller != PositionControllerConfig::Cascade {
            self.found.findings.push(Finding::missing(
                "not-a-cascade",
                "no delays and no refinement: the position controller of the initial machine is not the cascade",
                "record with the cascade, and set `<joint>.position_loop.controller=cascade`",
            ));
            return;
        }
        self.experiments = experiments;
        let of = |mode: FeedforwardMode, all: &[Experiment]| -> Vec<Experiment> {
            all.iter().filter(|e| e.mode == mode).cloned().collect()
        };
        let off = of(FeedforwardMode::Off, &self.experiments);
        self.fit_one_delay(DelayParameter::Alpha, &[]);
        let first = if off.is_empty() { self.experiments.clone() } else { off };
        if self.options.refine.inertia {
            if let Some(inertia) = initial_inertia(&self.found.axis, self.periods, &first) {
                self.found.axis.motor.inertia = inertia;
            }
            // The delays need an approximate inertia only.
            self.refine_parameters(&first, &[RefinedParameter::Inertia]);
        }
        // A wrong delay biases the weight slightly; a second round corrects it.
        for _ in 0..self.rounds(RefinedParameter::VelocityFeedforward) {
            self.fit_free_weight(FeedforwardMode::Velocity, RefinedParameter::VelocityFeedforward);
            self.fit_one_delay(DelayParameter::Beta, &[]);
        }
        for _ in 0..self.rounds(RefinedParameter::TorqueFeedforward) {
            self.fit_free_weight(FeedforwardMode::Both, RefinedParameter::TorqueFeedforward);
            self.fit_one_delay(DelayParameter::Gamma, &[]);
        }
        let mut parameters = self.plant_parameters(self.options.refine);
        parameters.extend(self.free_weights());
        if !parameters.is_empty() {
            let all = self.experiments.clone();
            self.refine_parameters(&all, &parameters);
        }
        let nuisance = self.nuisance_axes(&self.plant_parameters(RefinementScope::ALL));
        for which in [DelayParameter::Alpha, DelayParameter::Beta, DelayParameter::Gamma] {
            self.fit_one_delay(which, &nuisance);
        }
        report_delays(&self.experiments, &mut self.found);
    }

    /// Returns the plant parameters of the closed-loop refinement.
    fn plant_parameters(&self, wanted: RefinementScope) -> Vec<RefinedParameter> {
        let found = &self.found;
        let law = found.friction.as_ref().map_or(FrictionLaw::DoubleExponential, |f| f.law.law);
        let mut parameters = Vec::new();
        if wanted.inertia {
            parameters.push(RefinedParameter::Inertia);
        }
        if wanted.friction {
            parameters.extend(RefinedParameter::of_friction(law));
            parameters.extend((self.options.i0 == Breakaway::Freed).then_some(RefinedParameter::Breakaway));
        }
        let gravity = &found.axis.gravity;
        if wanted.gravity && (gravity.weight != 0.0 || gravity.tilt != 0.0) {
            parameters.extend(RefinedParameter::of_gravity(&found.axis));
        }
        parameters
    }

    /// Returns the feedforward weights without regression result.
    fn free_weights(&self) -> Vec<RefinedParameter> {
        let (found, modes) = (&self.found, |mode| self.experiments.iter().any(|e| e.mode == mode));
        let mut parameters = Vec::new();
        if !self.options.refine.feedforward {
            return parameters;
        }
        if found.feedforward.velocity.is_none() && modes(FeedforwardMode::Velocity) {
            parameters.push(RefinedParameter::VelocityFeedforward);
        }
        if found.feedforward.torque.is_none()
            && modes(FeedforwardMode::Both)
            && found.axis.feedforward.torque != 0.0
        {
            parameters.push(RefinedParameter::TorqueFeedforward);
        }
        parameters
    }

    fn refine_parameters(&mut self, experiments: &[Experiment], parameters: &[RefinedParameter]) {
        let held = self.options.i0 == Breakaway::Held;
        let refined = refine(&self.found.axis, self.periods, experiments, parameters, held);
        match &refined {
            Some(refinement) => self.found.axis = refinement.axis.clone(),
            None => self.found.findings.push(Finding::warning(
                "not-refined",
                "the closed loop does not determine the parameters: the refinement is skipped",
                "record faster and slower moves with current",
            )),
        }
        self.found.refinement = refined;
    }

    /// Returns the number of alternations between a weight and its delay.
    fn rounds(&self, weight: RefinedParameter) -> usize {
        if self.free_weights().contains(&weight) { 2 } else { 1 }
    }

    /// Fits a weight without regression result before its delay, because with a wrong weight any delay can
    /// fit best.
    ///
    /// γ starts at β, since both are delays of the same controller board.
    fn fit_free_weight(&mut self, mode: FeedforwardMode, parameter: RefinedParameter) {
        if !self.free_weights().contains(&parameter) {
            return;
        }
        let mut axis = self.found.axis.clone();
        let known = |delay| self.found.delays.iter().any(|fit| fit.delay == delay);
        if mode == FeedforwardMode::Both && known(DelayParameter::Beta) && !known(DelayParameter::Gamma) {
            axis.delays.gamma = axis.delays.beta;
        }
        let of_mode: Vec<Experiment> = self.experiments.iter().filter(|e| e.mode == mode).cloned().collect();
        let held = self.options.i0 == Breakaway::Held;
        if let Some(refined) = refine(&axis, self.periods, &of_mode, &[parameter], held) {
            self.found.axis = refined.axis;
        }
    }

    fn nuisance_axes(&self, parameters: &[RefinedParameter]) -> Vec<AxisConfig> {
        let axis = &self.found.axis;
        let moved = |parameter: &RefinedParameter| {
            let value = parameter.get(axis) + NUISANCE * parameter.scale(axis);
            with_parameters(axis, &[*parameter], &[value], self.options.i0 == Breakaway::Held)
        };
        parameters.iter().map(moved).collect()
    }

    fn fit_one_delay(&mut self, which: DelayParameter, nuisance: &[AxisConfig]) {
        let found = &mut self.found;
        let shows_nothing = match which {
            DelayParameter::Alpha => false,
            DelayParameter::Beta => found.axis.feedforward.velocity == 0.0,
            DelayParameter::Gamma => found.axis.feedforward.torque == 0.0,
        };
        if shows_nothing {
            return;
        }
        let experiments: Vec<Experiment> =
            self.experiments.iter().filter(|e| e.mode == which.feedforward_mode()).cloned().collect();
        // The recordings that identify α are the long ones; α is known well after its first fit.
        let own = which.of(&found.initial.delays);
        let around = which == DelayParameter::Alpha && !nuisance.is_empty();
        if let Some(fit) = fit_delay(which, &found.axis, self.periods, &experiments, nuisance, own, around) {
            which.set(&mut found.axis, fit.value);
            found.delays.retain(|known| known.delay != which);
            found.delays.push(fit);
        }
    }
}

/// Returns the reason why no recording can be simulated.
fn explain_missing_experiments(inputs: &[IdentificationInput<'_>], periods: &Periods) -> String {
    let tsp = seconds(periods.position);
    let with_psec: Vec<&Signals> =
        inputs.iter().map(|i| i.signals).filter(|s| s.spans.iter().any(|span| span.psec.is_some())).collect();
    let why = match with_psec.iter().find(|signals| stride(signals.period, tsp).is_none()) {
        _ if with_psec.is_empty() => "no recording contains PSEC".to_owned(),
        Some(signals) => format!(
            "{} is sampled every {:.3} ms, not an integer fraction of the position cycle of {:.3} ms",
            signals.name,
            1e3 * signals.period,
            1e3 * tsp
        ),
        None => "no recording contains PSEC that starts at rest".to_owned(),
    };
    format!("no delays and no refinement: {why}")
}

/// Returns the trial inertia whose closed-loop simulation fits the recordings best.
///
/// Eq. 5 can be far off if the current varies between the samples, and a local search from there can end in
/// another minimum.
fn initial_inertia(axis: &AxisConfig, periods: &Periods, experiments: &[Experiment]) -> Option<f64> {
    let of = |inertia: f64| {
        let mut axis = axis.clone();
        axis.motor.inertia = inertia;
        Some((inertia, position_residuals(&axis, periods, experiments)?.norm_squared()))
    };
    let ladder = LADDER.map(|factor| factor * axis.motor.inertia);
    let found: Vec<(f64, f64)> = ladder.into_par_iter().filter_map(of).collect();
    found.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(inertia, _)| inertia)
}
