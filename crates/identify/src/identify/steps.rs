//! Sequence of the identification steps and the closed-loop refinement.

use rayon::prelude::*;

use super::closed_loop::{Experiment, find_experiments, position_residuals};
use super::delays::{DelayParameter, fit_delay};
use super::feedforward::{FeedforwardFit, fit_feedforward};
use super::feedforward_mode::FeedforwardMode;
use super::findings::{inertia_of_simulation, report_delays, report_result};
use super::friction::{Breakaway, FrictionLaw, fit_friction};
use super::gravity::{GravityCurrent, SteadyMeasurements, fit_gravity};
use super::identification::Identification;
use super::inertia::fit_inertia;
use super::options::{IdentificationInput, IdentificationOptions, RefinementScope};
use super::production::{are_production_traces, identify_production};
use super::refine::{RefinedParameter, refine, with_parameters};
use super::sanity::report_invalid;
use super::segments::{MotionSegment, SegmentKind, find_segments};
use super::setpoints::stride;
use super::validate::compute_agreement;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, DeviationConfig, Periods, PositionControllerConfig};
use virtual_axes_core::units::seconds;

/// Change of a nuisance parameter, relative to its scale, for the delay identification.
const NUISANCE: f64 = 1e-2;
/// Trial inertias relative to the start value. Eq. 5 misses most of the inertia with a fast drive and slow
/// sampling.
const LADDER: [f64; 13] = [0.06, 0.12, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0];

/// Identifies `axis` from recordings, starting from the parameters of its machine file.
pub fn identify(
    inputs: &[IdentificationInput<'_>],
    axis: &AxisConfig,
    periods: &Periods,
    options: &IdentificationOptions,
) -> Identification {
    let mut steps = IdentificationSteps::new(inputs, axis, periods, options);
    if are_production_traces(inputs, &steps.found.axis, periods) {
        identify_production(inputs, periods, options.refine, &mut steps.found);
        steps.find_production_experiments();
    } else {
        steps.fit_plant();
        steps.fit_feedforward_weights();
        steps.fit_closed_loop();
    }
    steps.finish()
}

/// Identification in progress.
struct IdentificationSteps<'a> {
    inputs: &'a [IdentificationInput<'a>],
    periods: &'a Periods,
    options: &'a IdentificationOptions,
    /// Segments of each recording.
    segments: Vec<Vec<MotionSegment>>,
    /// Sections of the recordings that can be simulated.
    experiments: Vec<Experiment>,
    found: Identification,
}

impl<'a> IdentificationSteps<'a> {
    fn new(
        inputs: &'a [IdentificationInput<'a>],
        axis: &AxisConfig,
        periods: &'a Periods,
        options: &'a IdentificationOptions,
    ) -> Self {
        let mut findings = Vec::new();
        let as_designed = DeviationConfig { inertia: 1.0, friction: 1.0, torque_constant: 1.0 };
        let mut found = axis.clone();
        if found.deviation != as_designed {
            findings.push(Finding::note(
                "deviation-reset",
                "the `deviation` factors of the machine are set to 1: the identified values describe the real plant",
            ));
            found.deviation = as_designed;
        }
        IdentificationSteps {
            inputs,
            periods,
            options,
            segments: inputs.iter().map(|input| find_segments(input.signals)).collect(),
            experiments: Vec::new(),
            found: Identification {
                initial: axis.clone(),
                axis: found,
                steady: SteadyMeasurements::default(),
                gravity: None,
                friction: None,
                inertia: None,
                replayed_inertia: None,
                feedforward: FeedforwardFit::default(),
                delays: Vec::new(),
                refinement: None,
                agreements: Vec::new(),
                periods: None,
                inferred_feedforward: None,
                findings,
            },
        }
    }

    /// Fits gravity, friction and inertia in two passes; the second corrects for residual accelerations with
    /// the inertia.
    fn fit_plant(&mut self) {
        let found = &mut self.found;
        if !self.segments.iter().flatten().any(|segment| segment.kind == SegmentKind::Static) {
            found.findings.push(Finding::warning(
                "no-standstill",
                "no recording contains a standstill: gravity is not verified at rest",
                "record 0.5 s of rest at several positions, each approached from both sides",
            ));
        }
        let recordings: Vec<(&Signals, &[MotionSegment])> = self
            .inputs
            .iter()
            .zip(&self.segments)
            .filter(|(input, _)| input.signals.spans.iter().any(|span| span.current.is_some()))
            .map(|(input, segments)| (input.signals, segments.as_slice()))
            .collect();
        if recordings.is_empty() {
            found.findings.push(Finding::missing(
                "no-current",
                "no recording contains a current: friction, gravity and inertia are identified from positions only",
                "record the motor current",
            ));
            return;
        }
        let axis = &mut found.axis;
        let per_acceleration = 1.0 / (axis.motor.torque_constant * axis.transmission_ratio);
        let mut current_per_acceleration = 0.0;
        for last in [false, true] {
            let mut findings = Vec::new();
            let (steady, gravity) = fit_gravity(&recordings, axis, current_per_acceleration);
            let weight = gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
            let friction = fit_friction(&steady.levels, axis, &mut findings);
            let inertia = friction
                .as_ref()
                .and_then(|friction| fit_inertia(&recordings, axis, &friction.law, &weight, &mut findings));
            current_per_acceleration = inertia.as_ref().map_or(0.0, |found| found.value * per_acceleration);
            (found.steady, found.gravity, found.friction, found.inertia) =
                (steady, gravity, friction, inertia);
            if last {
                found.findings.append(&mut findings);
            }
        }
        if let Some(gravity) = &found.gravity {
            gravity.apply(axis);
        }
        if let Some(friction) = &found.friction {
            axis.friction = friction.law.config;
        }
        if let Some(inertia) = &found.inertia {
            axis.motor.inertia = inertia.value;
        }
    }

    fn fit_feedforward_weights(&mut self) {
        let found = &mut self.found;
        let signals: Vec<&Signals> = self.inputs.iter().map(|input| input.signals).collect();
        let (tsp, ratio) = (seconds(self.periods.position), found.axis.transmission_ratio);
        found.feedforward = fit_feedforward(&signals, tsp, ratio, &mut found.findings);
        if let Some(velocity) = &found.feedforward.velocity {
            found.axis.feedforward.velocity = velocity.value.max(0.0);
        }
        if let Some(torque) = &found.feedforward.torque {
            found.axis.feedforward.torque = torque.value.max(0.0);
        } else if let Some(input) = self.inputs.iter().find(|input| is_torque_feedforward_zero(input)) {
            let what =
                format!("{}: TFFWS is always 0 with torque feedforward on: TFFW is 0", input.signals.name);
            found.findings.push(Finding::note("no-torque-feedforward", what));
            found.axis.feedforward.torque = 0.0;
            found.feedforward.is_torque_zero = true;
        }
    }

    /// Fits delays and refines parameters in closed loop.
    fn fit_closed_loop(&mut self) {
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
                "no delays and no refinement: the position controller of the machine file is not the cascade",
                "record with the cascade and set `--set <joint>.position_loop.controller=cascade`",
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

    /// Prepares the comparison of the identified axis with production traces.
    fn find_production_experiments(&mut self) {
        let (axis, periods) = (&self.found.axis, self.found.periods.unwrap_or(*self.periods));
        let inferred = self.found.inferred_feedforward.unwrap_or(FeedforwardMode::Both);
        let of = |(k, input): (usize, &IdentificationInput<'_>)| {
            find_experiments(input.signals, k, axis, &periods, input.feedforward.unwrap_or(inferred))
        };
        self.experiments = self.inputs.iter().enumerate().flat_map(of).collect();
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

    fn finish(mut self) -> Identification {
        for (number, input) in self.inputs.iter().enumerate() {
            let segments = self.segments.get(number).cloned().unwrap_or_default();
            let of_it = |e: &&Experiment| e.recording == number;
            let experiments = self.experiments.iter().filter(of_it).cloned().collect();
            let periods = self.found.periods.as_ref().unwrap_or(self.periods);
            let found = compute_agreement(input.signals, segments, experiments, &self.found.axis, periods);
            // An axis that was simulated before can be simulated here.
            self.found.agreements.extend(found.ok());
        }
        let refined = |parameter| {
            let refinement = self.found.refinement.as_ref();
            refinement.is_some_and(|r| r.parameters.iter().any(|refined| refined.parameter == parameter))
        };
        if self.options.i0 == Breakaway::Freed && !refined(RefinedParameter::Breakaway) {
            self.found.findings.push(Finding::warning(
                "i0-held",
                "i0 = a + c: only the closed-loop refinement identifies i0 separately",
                "record PSEC with slow starts from rest",
            ));
        }
        let replayed = inertia_of_simulation(self.inputs, &self.found);
        self.found.replayed_inertia = replayed;
        report_result(self.inputs, seconds(self.periods.position), &mut self.found);
        report_invalid(self.inputs, &mut self.found);
        self.found
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

/// Returns true if a recording with active torque feedforward shows a weight of zero.
fn is_torque_feedforward_zero(input: &IdentificationInput<'_>) -> bool {
    let channels = || input.signals.spans.iter().map(|span| span.torque_feedforward.as_ref());
    let is_nothing =
        |channel: Option<&Vec<f64>>| channel.is_some_and(|c| c.iter().all(|value| *value == 0.0));
    input.feedforward == Some(FeedforwardMode::Both)
        && !input.signals.spans.is_empty()
        && channels().all(is_nothing)
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
