//! The steps of the paper one after the other, and the refinement behind them.

use rayon::prelude::*;

use super::closed_loop::{Experiment, deviations, experiments};
use super::delays::{Delay, delay};
use super::feedforward::{FeedforwardFit, feedforward};
use super::friction::{Breakaway, FrictionLaw, friction};
use super::gravity::{GravityCurrent, Steady, gravity};
use super::identification::{Identification, Input, Options, Refine};
use super::inertia::inertia;
use super::mode::FeedforwardMode;
use super::refine::{Parameter, refine, with};
use super::segments::{Segment, SegmentKind, segments};
use super::setpoints::stride;
use super::tell::{replayed_inertia, tell, tell_delays};
use super::validate::agreement;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, DeviationConfig, Periods, PositionControllerConfig};
use virtual_axes_core::units::seconds;

/// Step by which a parameter is moved to see what of a delay it could explain, part of its scale.
const NUISANCE: f64 = 1e-2;
/// Inertias that are tried first, parts of what eq. 5 or the machine file says. Of eq. 5 most is unseen where the
/// drive is quick and the recording slow.
const LADDER: [f64; 13] = [0.06, 0.12, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0];

/// An identification in progress.
pub(super) struct Steps<'a> {
    inputs: &'a [Input<'a>],
    periods: &'a Periods,
    options: &'a Options,
    /// Of each recording.
    segments: Vec<Vec<Segment>>,
    /// Parts of the recordings that can be simulated.
    experiments: Vec<Experiment>,
    found: Identification,
}

impl<'a> Steps<'a> {
    pub(super) fn new(
        inputs: &'a [Input<'a>],
        axis: &AxisConfig,
        periods: &'a Periods,
        options: &'a Options,
    ) -> Self {
        let mut findings = Vec::new();
        let as_designed = DeviationConfig { inertia: 1.0, friction: 1.0, torque_constant: 1.0 };
        let mut found = axis.clone();
        if found.deviation != as_designed {
            findings.push(Finding::note(
                "deviation-reset",
                "the machine's `deviation` is set to 1: what is identified is the plant as it is",
            ));
            found.deviation = as_designed;
        }
        Steps {
            inputs,
            periods,
            options,
            segments: inputs.iter().map(|input| segments(input.signals)).collect(),
            experiments: Vec::new(),
            found: Identification {
                before: axis.clone(),
                axis: found,
                steady: Steady::default(),
                gravity: None,
                friction: None,
                inertia: None,
                replayed_inertia: None,
                feedforward: FeedforwardFit::default(),
                delays: Vec::new(),
                refinement: None,
                agreements: Vec::new(),
                findings,
            },
        }
    }

    /// Gravity, friction, inertia: twice, since the inertia takes what is left of accelerations off the first two.
    pub(super) fn steady_steps(&mut self) {
        let found = &mut self.found;
        if !self.segments.iter().flatten().any(|segment| segment.kind == SegmentKind::Static) {
            found.findings.push(Finding::warning(
                "no-standstill",
                "no recording has a standstill: gravity is not checked at rest",
                "record half a second of rest at several positions, each approached from both sides",
            ));
        }
        let recordings: Vec<(&Signals, &[Segment])> = self
            .inputs
            .iter()
            .zip(&self.segments)
            .filter(|(input, _)| input.signals.spans.iter().any(|span| span.current.is_some()))
            .map(|(input, segments)| (input.signals, segments.as_slice()))
            .collect();
        if recordings.is_empty() {
            found.findings.push(Finding::missing(
                "no-current",
                "no recording has a current: friction, gravity and inertia are seen through the position alone",
                "record the motor current",
            ));
            return;
        }
        let axis = &mut found.axis;
        let per_acceleration = 1.0 / (axis.motor.torque_constant * axis.transmission_ratio);
        let mut current_per_acceleration = 0.0;
        for last in [false, true] {
            let mut findings = Vec::new();
            let (steady, gravity) = gravity(&recordings, axis, current_per_acceleration);
            let weight = gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
            let friction = friction(&steady.levels, axis, &mut findings);
            let inertia = friction
                .as_ref()
                .and_then(|friction| inertia(&recordings, axis, &friction.law, &weight, &mut findings));
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

    pub(super) fn feedforward(&mut self) {
        let found = &mut self.found;
        let signals: Vec<&Signals> = self.inputs.iter().map(|input| input.signals).collect();
        let (tsp, ratio) = (seconds(self.periods.position), found.axis.transmission_ratio);
        found.feedforward = feedforward(&signals, tsp, ratio, &mut found.findings);
        if let Some(velocity) = &found.feedforward.velocity {
            found.axis.feedforward.velocity = velocity.value.max(0.0);
        }
        if let Some(torque) = &found.feedforward.torque {
            found.axis.feedforward.torque = torque.value.max(0.0);
        } else if let Some(input) = self.inputs.iter().find(|input| shows_no_torque(input)) {
            let what = format!(
                "{}: TFFWS is 0 throughout with torque feedforward on: TFFW is 0",
                input.signals.name
            );
            found.findings.push(Finding::note("no-torque-feedforward", what));
            found.axis.feedforward.torque = 0.0;
            found.feedforward.no_torque = true;
        }
    }

    /// Delays and refinement.
    pub(super) fn closed_loop(&mut self) {
        let (axis, default) = (&self.found.axis, FeedforwardMode::Both);
        let experiments: Vec<Experiment> = self
            .inputs
            .iter()
            .enumerate()
            .flat_map(|(k, input)| {
                experiments(input.signals, k, axis, self.periods, input.feedforward.unwrap_or(default))
            })
            .collect();
        if experiments.is_empty() {
            self.found.findings.push(Finding::missing(
                "no-setpoints",
                why_no_experiments(self.inputs, self.periods),
                "record the position setpoints (PSEC) from standstill on, at every position instant or a whole \
                 fraction of the position period",
            ));
            return;
        }
        if self.found.axis.position_loop.controller != PositionControllerConfig::Cascade {
            self.found.findings.push(Finding::missing(
                "not-a-cascade",
                "no delays and no refinement: the machine file's position controller is not the cascade",
                "record with the cascade, and give `--set <joint>.position_loop.controller=cascade`",
            ));
            return;
        }
        self.experiments = experiments;
        let of = |mode: FeedforwardMode, all: &[Experiment]| -> Vec<Experiment> {
            all.iter().filter(|e| e.mode == mode).cloned().collect()
        };
        let off = of(FeedforwardMode::Off, &self.experiments);
        self.take_delay(Delay::Alpha, &[]);
        let first = if off.is_empty() { self.experiments.clone() } else { off };
        if self.options.refine.inertia {
            if let Some(inertia) = start_of_inertia(&self.found.axis, self.periods, &first) {
                self.found.axis.motor.inertia = inertia;
            }
            // The delays ask for an inertia that is about right; everything else can wait for them.
            self.refine(&first, &[Parameter::Inertia]);
        }
        // With a wrong delay the weight comes out a little wrong, which the next step would see.
        for _ in 0..self.rounds(Parameter::VelocityFeedforward) {
            self.take_feedforward(FeedforwardMode::Velocity, Parameter::VelocityFeedforward);
            self.take_delay(Delay::Beta, &[]);
        }
        for _ in 0..self.rounds(Parameter::TorqueFeedforward) {
            self.take_feedforward(FeedforwardMode::Both, Parameter::TorqueFeedforward);
            self.take_delay(Delay::Gamma, &[]);
        }
        let mut parameters = self.parameters(self.options.refine);
        parameters.extend(self.free_feedforward());
        if !parameters.is_empty() {
            let all = self.experiments.clone();
            self.refine(&all, &parameters);
        }
        let nuisance = self.nuisance(&self.parameters(Refine::ALL));
        for which in [Delay::Alpha, Delay::Beta, Delay::Gamma] {
            self.take_delay(which, &nuisance);
        }
        tell_delays(&self.experiments, &mut self.found);
    }

    /// What the closed loop can refine of the plant.
    fn parameters(&self, wanted: Refine) -> Vec<Parameter> {
        let found = &self.found;
        let law = found.friction.as_ref().map_or(FrictionLaw::DoubleExponential, |f| f.law.law);
        let mut parameters = Vec::new();
        if wanted.inertia {
            parameters.push(Parameter::Inertia);
        }
        if wanted.friction {
            parameters.extend(Parameter::of_friction(law));
            parameters.extend((self.options.i0 == Breakaway::Freed).then_some(Parameter::Breakaway));
        }
        let gravity = &found.axis.gravity;
        if wanted.gravity && (gravity.weight != 0.0 || gravity.tilt != 0.0) {
            parameters.extend(Parameter::of_gravity(&found.axis));
        }
        parameters
    }

    /// Weights of the feedforward that no regression has given.
    fn free_feedforward(&self) -> Vec<Parameter> {
        let (found, modes) = (&self.found, |mode| self.experiments.iter().any(|e| e.mode == mode));
        let mut parameters = Vec::new();
        if !self.options.refine.feedforward {
            return parameters;
        }
        if found.feedforward.velocity.is_none() && modes(FeedforwardMode::Velocity) {
            parameters.push(Parameter::VelocityFeedforward);
        }
        if found.feedforward.torque.is_none()
            && modes(FeedforwardMode::Both)
            && found.axis.feedforward.torque != 0.0
        {
            parameters.push(Parameter::TorqueFeedforward);
        }
        parameters
    }

    fn refine(&mut self, experiments: &[Experiment], parameters: &[Parameter]) {
        let held = self.options.i0 == Breakaway::Held;
        let refined = refine(&self.found.axis, self.periods, experiments, parameters, held);
        match &refined {
            Some(refinement) => self.found.axis = refinement.axis.clone(),
            None => self.found.findings.push(Finding::warning(
                "not-refined",
                "the closed loop does not determine the parameters: they stay as the steps found them",
                "record faster and slower moves, with their currents",
            )),
        }
        self.found.refinement = refined;
    }

    /// How often a weight and its delay are looked for one after the other.
    fn rounds(&self, weight: Parameter) -> usize {
        if self.free_feedforward().contains(&weight) { 2 } else { 1 }
    }

    /// A weight that no regression has given, before its delay is looked for: with a wrong weight any delay
    /// may come closest. γ is begun at β, since both are delays of the same card.
    fn take_feedforward(&mut self, mode: FeedforwardMode, parameter: Parameter) {
        if !self.free_feedforward().contains(&parameter) {
            return;
        }
        let mut axis = self.found.axis.clone();
        let known = |delay| self.found.delays.iter().any(|fit| fit.delay == delay);
        if mode == FeedforwardMode::Both && known(Delay::Beta) && !known(Delay::Gamma) {
            axis.delays.gamma = axis.delays.beta;
        }
        let of_mode: Vec<Experiment> = self.experiments.iter().filter(|e| e.mode == mode).cloned().collect();
        let held = self.options.i0 == Breakaway::Held;
        if let Some(refined) = refine(&axis, self.periods, &of_mode, &[parameter], held) {
            self.found.axis = refined.axis;
        }
    }

    fn nuisance(&self, parameters: &[Parameter]) -> Vec<AxisConfig> {
        let axis = &self.found.axis;
        let moved = |parameter: &Parameter| {
            let value = parameter.get(axis) + NUISANCE * parameter.scale(axis);
            with(axis, &[*parameter], &[value], self.options.i0 == Breakaway::Held)
        };
        parameters.iter().map(moved).collect()
    }

    fn take_delay(&mut self, which: Delay, nuisance: &[AxisConfig]) {
        let found = &mut self.found;
        let shows_nothing = match which {
            Delay::Alpha => false,
            Delay::Beta => found.axis.feedforward.velocity == 0.0,
            Delay::Gamma => found.axis.feedforward.torque == 0.0,
        };
        if shows_nothing {
            return;
        }
        let experiments: Vec<Experiment> =
            self.experiments.iter().filter(|e| e.mode == which.mode()).cloned().collect();
        // The long recordings are those that show α, which is found at once.
        let own = which.of(&found.before.delays);
        let around = which == Delay::Alpha && !nuisance.is_empty();
        if let Some(fit) = delay(which, &found.axis, self.periods, &experiments, nuisance, own, around) {
            which.set(&mut found.axis, fit.value);
            found.delays.retain(|known| known.delay != which);
            found.delays.push(fit);
        }
    }

    pub(super) fn finish(mut self) -> Identification {
        for (number, input) in self.inputs.iter().enumerate() {
            let segments = self.segments.get(number).cloned().unwrap_or_default();
            let of_it = |e: &&Experiment| e.recording == number;
            let experiments = self.experiments.iter().filter(of_it).cloned().collect();
            let found = agreement(input.signals, segments, experiments, &self.found.axis, self.periods);
            // An axis that has been simulated all along can be simulated.
            self.found.agreements.extend(found.ok());
        }
        let refined = |parameter| {
            let refinement = self.found.refinement.as_ref();
            refinement.is_some_and(|r| r.parameters.iter().any(|refined| refined.parameter == parameter))
        };
        if self.options.i0 == Breakaway::Freed && !refined(Parameter::Breakaway) {
            self.found.findings.push(Finding::warning(
                "i0-held",
                "i0 is held at a + c: it is freed in the refinement on the closed loop only",
                "record PSEC, with slow starts from rest",
            ));
        }
        let replayed = replayed_inertia(self.inputs, &self.found);
        self.found.replayed_inertia = replayed;
        tell(self.inputs, seconds(self.periods.position), &mut self.found);
        self.found
    }
}

/// Why nothing can be simulated.
fn why_no_experiments(inputs: &[Input<'_>], periods: &Periods) -> String {
    let tsp = seconds(periods.position);
    let with_psec: Vec<&Signals> =
        inputs.iter().map(|i| i.signals).filter(|s| s.spans.iter().any(|span| span.psec.is_some())).collect();
    let why = match with_psec.iter().find(|signals| stride(signals.period, tsp).is_none()) {
        _ if with_psec.is_empty() => "no recording has PSEC".to_owned(),
        Some(signals) => format!(
            "{} is sampled every {:.3} ms, which is no whole fraction of the position period of {:.3} ms",
            signals.name,
            1e3 * signals.period,
            1e3 * tsp
        ),
        None => "no recording has PSEC that begins at rest".to_owned(),
    };
    format!("no delays and no refinement: {why}")
}

/// Whether a recording that was made with torque feedforward shows that it is nothing.
fn shows_no_torque(input: &Input<'_>) -> bool {
    let channels = || input.signals.spans.iter().map(|span| span.torque_feedforward.as_ref());
    let is_nothing =
        |channel: Option<&Vec<f64>>| channel.is_some_and(|c| c.iter().all(|value| *value == 0.0));
    input.feedforward == Some(FeedforwardMode::Both)
        && !input.signals.spans.is_empty()
        && channels().all(is_nothing)
}

/// The inertia, of a ladder of them, whose closed loop moves most like the recorded one.
///
/// Eq. 5 can be far off where the current swings between two samples, and a search from there can end elsewhere.
fn start_of_inertia(axis: &AxisConfig, periods: &Periods, experiments: &[Experiment]) -> Option<f64> {
    let of = |inertia: f64| {
        let mut axis = axis.clone();
        axis.motor.inertia = inertia;
        Some((inertia, deviations(&axis, periods, experiments)?.norm_squared()))
    };
    let ladder = LADDER.map(|factor| factor * axis.motor.inertia);
    let found: Vec<(f64, f64)> = ladder.into_par_iter().filter_map(of).collect();
    found.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(inertia, _)| inertia)
}
