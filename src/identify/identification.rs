//! The steps of the paper one after the other, and the refinement behind them.

use rayon::prelude::*;

use super::closed_loop::{Experiment, FeedforwardMode, Simulated, deviations, experiments, simulate_all};
use super::delays::{Delay, DelayFit, delay};
use super::feedforward::{FeedforwardFit, feedforward};
use super::filter::Gaussian;
use super::finding::Finding;
use super::friction::{Breakaway, Friction, FrictionLaw, friction};
use super::gravity::{Gravity, GravityCurrent, Steady, gravity};
use super::inertia::{Inertia, inertia};
use super::recording::{Signals, Span};
use super::refine::{Parameter, Refinement, refine, with};
use super::segments::{Segment, segments};
use super::validate::{Comparison, InverseDynamics, compare, inverse_dynamics};
use crate::config::{AxisConfig, DeviationConfig, Periods, PositionControllerConfig};
use crate::units::seconds;

/// R² of the current below which a model is not what was recorded.
const LEAST_DETERMINATION: f64 = 0.9;
/// Step by which a parameter is moved to see what of a delay it could explain, part of its value.
const NUISANCE: f64 = 1e-2;

/// Part by which eq. 5 can differ from the refined inertia before it is told.
const UNSEEN: f64 = 0.03;
/// Inertias that are tried first, parts of that by eq. 5: most of the current is unseen where the drive is quick
/// and the recording slow, never the other way round.
const LADDER: [f64; 8] = [0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0];

/// A recording and what is known about it.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// The recording.
    pub signals: &'a Signals,
    /// The feedforward that acted; needed where the recording does not show VFFWS and TFFWS.
    pub feedforward: Option<FeedforwardMode>,
}

/// What is to be done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Where i0 comes from.
    pub i0: Breakaway,
    /// Whether to refine on the closed loop.
    pub refine: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options { i0: Breakaway::Held, refine: true }
    }
}

/// What the recordings tell about an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The axis as it was taken for.
    pub(crate) before: AxisConfig,
    /// The axis as it was found.
    pub(crate) axis: AxisConfig,
    /// Segments of each recording.
    pub segments: Vec<Vec<Segment>>,
    /// Currents of steady motion and of standstills.
    pub steady: Steady,
    /// Gravity.
    pub gravity: Option<Gravity>,
    /// Friction.
    pub friction: Option<Friction>,
    /// Inertia by eq. 5.
    pub inertia: Option<Inertia>,
    /// What eq. 5 gives on the simulation of the axis as it was found, sampled as the recordings are: where this
    /// agrees with the recorded one and neither with the axis, the current swings between two samples.
    pub replayed_inertia: Option<f64>,
    /// VFFW and TFFW.
    pub feedforward: FeedforwardFit,
    /// α, β, γ.
    pub delays: Vec<DelayFit>,
    /// Parameters refined on the closed loop.
    pub refinement: Option<Refinement>,
    /// Parts of the recordings that were simulated.
    pub experiments: Vec<Experiment>,
    /// Their simulation with the axis as it was found.
    pub simulated: Vec<Simulated>,
    /// How the two agree.
    pub comparisons: Vec<Comparison>,
    /// The currents that the recorded motion asks for, of each recording that has a current.
    pub inverse: Vec<Option<InverseDynamics>>,
    /// What must be said.
    pub findings: Vec<Finding>,
}

impl Identification {
    /// The axis as it was found.
    pub fn axis(&self) -> &AxisConfig {
        &self.axis
    }
}

/// Identifies `axis` from recordings of it, starting from what its machine file says.
pub fn identify(
    inputs: &[Input<'_>],
    axis: &AxisConfig,
    periods: &Periods,
    options: &Options,
) -> Identification {
    let mut work = Work::new(inputs, axis, periods, options);
    work.steady_steps();
    work.feedforward();
    work.closed_loop();
    work.finish()
}

/// An identification in progress.
struct Work<'a> {
    inputs: &'a [Input<'a>],
    periods: &'a Periods,
    options: &'a Options,
    found: Identification,
}

impl<'a> Work<'a> {
    fn new(inputs: &'a [Input<'a>], axis: &AxisConfig, periods: &'a Periods, options: &'a Options) -> Self {
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
        Work {
            inputs,
            periods,
            options,
            found: Identification {
                before: axis.clone(),
                axis: found,
                segments: inputs.iter().map(|input| segments(input.signals)).collect(),
                steady: Steady::default(),
                gravity: None,
                friction: None,
                inertia: None,
                replayed_inertia: None,
                feedforward: FeedforwardFit::default(),
                delays: Vec::new(),
                refinement: None,
                experiments: Vec::new(),
                simulated: Vec::new(),
                comparisons: Vec::new(),
                inverse: Vec::new(),
                findings,
            },
        }
    }

    /// Gravity, friction, inertia: twice, since the inertia takes what is left of accelerations off the first two.
    fn steady_steps(&mut self) {
        let found = &mut self.found;
        let recordings: Vec<(&Signals, &[Segment])> = self
            .inputs
            .iter()
            .zip(&found.segments)
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
            let friction = friction(&steady.levels, axis, None, self.options.i0, &mut findings);
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

    fn feedforward(&mut self) {
        let found = &mut self.found;
        let signals: Vec<&Signals> = self.inputs.iter().map(|input| input.signals).collect();
        let (tsp, ratio) = (seconds(self.periods.position), found.axis.transmission_ratio);
        found.feedforward = feedforward(&signals, tsp, ratio, &mut found.findings);
        if let Some(velocity) = &found.feedforward.velocity {
            found.axis.feedforward.velocity = velocity.value.max(0.0);
        }
        if let Some(torque) = &found.feedforward.torque {
            found.axis.feedforward.torque = torque.value.max(0.0);
        }
    }

    /// Delays and refinement.
    fn closed_loop(&mut self) {
        let tsp = seconds(self.periods.position);
        let default = FeedforwardMode::Both;
        let experiments: Vec<Experiment> = self
            .inputs
            .iter()
            .enumerate()
            .flat_map(|(k, input)| experiments(input.signals, k, tsp, input.feedforward.unwrap_or(default)))
            .collect();
        if experiments.is_empty() {
            self.found.findings.push(Finding::missing(
                "no-setpoints",
                "no delays and no refinement: no recording has PSEC that begins at rest",
                "record the position set-points (PSEC) from standstill on",
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
        self.found.experiments = experiments;
        let of = |mode: FeedforwardMode, all: &[Experiment]| -> Vec<Experiment> {
            all.iter().filter(|e| e.mode == mode).cloned().collect()
        };
        let off = of(FeedforwardMode::Off, &self.found.experiments);
        self.take_delay(Delay::Alpha, &[]);
        let first = if off.is_empty() { self.found.experiments.clone() } else { off };
        let physics = self.physics();
        if self.options.refine {
            if let Some(inertia) = start_of_inertia(&self.found.axis, self.periods, &first) {
                self.found.axis.motor.inertia = inertia;
            }
            self.refine(&first, &physics);
        }
        self.take_delay(Delay::Beta, &[]);
        self.take_delay(Delay::Gamma, &[]);
        if self.options.refine {
            let mut parameters = physics;
            parameters.extend(self.free_feedforward());
            let all = self.found.experiments.clone();
            self.refine(&all, &parameters);
            self.found.delays.clear();
            let nuisance = self.nuisance(&parameters);
            for which in [Delay::Alpha, Delay::Beta, Delay::Gamma] {
                self.take_delay(which, &nuisance);
            }
        }
        self.tell_delays();
    }

    /// What the closed loop can refine of the plant.
    fn physics(&self) -> Vec<Parameter> {
        let found = &self.found;
        let law = found.friction.as_ref().map_or(FrictionLaw::DoubleExponential, |f| f.law.law);
        let mut parameters = vec![Parameter::Inertia];
        parameters.extend(Parameter::of_friction(law));
        let gravity = &found.axis.gravity;
        if gravity.weight != 0.0 || gravity.tilt != 0.0 {
            parameters.extend(Parameter::of_gravity(&found.axis));
        }
        parameters
    }

    /// Weights of the feedforward that no regression has given.
    fn free_feedforward(&self) -> Vec<Parameter> {
        let (found, modes) = (&self.found, |mode| self.found.experiments.iter().any(|e| e.mode == mode));
        let mut parameters = Vec::new();
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

    fn nuisance(&self, parameters: &[Parameter]) -> Vec<AxisConfig> {
        let axis = &self.found.axis;
        let moved = |parameter: &Parameter| {
            let value = parameter.get(axis) * (1.0 + NUISANCE);
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
            found.experiments.iter().filter(|e| e.mode == which.mode()).cloned().collect();
        // The long recordings are those that show α, which is found at once.
        let around = which == Delay::Alpha && !nuisance.is_empty();
        if let Some(fit) = delay(which, &found.axis, self.periods, &experiments, nuisance, around) {
            which.set(&mut found.axis, fit.value);
            found.delays.push(fit);
        }
    }

    fn tell_delays(&mut self) {
        for which in [Delay::Alpha, Delay::Beta, Delay::Gamma] {
            if self.found.delays.iter().any(|fit| fit.delay == which) {
                continue;
            }
            let name = which.name();
            let recorded = self.found.experiments.iter().any(|e| e.mode == which.mode());
            self.found.findings.push(if recorded {
                Finding::note(
                    "unseen-delay",
                    format!(
                        "{name} is left as it is: its feedforward is 0, and any value gives the same motion"
                    ),
                )
            } else {
                Finding::warning(
                    "unseen-delay",
                    format!("{name} is left as it is: no recording shows it"),
                    format!(
                        "record with feedforward {} (`virtual_axes psec campaign --part {}`)",
                        which.mode().name(),
                        which.mode().name()
                    ),
                )
            });
        }
    }

    fn finish(mut self) -> Identification {
        let found = &mut self.found;
        if let Ok(simulated) = simulate_all(&found.axis, self.periods, &found.experiments) {
            let pairs = found.experiments.iter().zip(&simulated).enumerate();
            found.comparisons = pairs
                .map(|(k, (e, s))| {
                    compare(k, e, s, found.segments.get(e.recording).map_or(&[], Vec::as_slice))
                })
                .collect();
            found.simulated = simulated;
        }
        self.replay_inertia();
        let found = &mut self.found;
        found.inverse = self
            .inputs
            .iter()
            .zip(&found.segments)
            .map(|(input, segments)| inverse_dynamics(input.signals, segments, &found.axis))
            .collect();
        self.tell_currents();
        let found = &mut self.found;
        if let Some(refinement) = &found.refinement {
            for refined in refinement.parameters.iter().filter(|p| p.at_bound) {
                found.findings.push(Finding::warning(
                    "at-bound",
                    format!("{} ends at its bound, {:.4}", refined.parameter, refined.value),
                    "record what shows it better, or leave it out of the refinement",
                ));
            }
            for (a, b, rho) in refinement.correlated() {
                found.findings.push(Finding::note(
                    "correlated",
                    format!("{a} and {b} can hardly be told apart (correlation {rho:.3}); what they make together can"),
                ));
            }
        }
        self.found
    }

    /// Eq. 5 on the simulated axis, through the same filter and the same steps.
    fn replay_inertia(&mut self) {
        let found = &mut self.found;
        let (Some(inertia_found), Some(friction_found)) = (&found.inertia, &found.friction) else { return };
        let replayed: Vec<Signals> = found
            .experiments
            .iter()
            .zip(&found.simulated)
            .filter_map(|(e, s)| Some(replayed(self.inputs.get(e.recording)?.signals, e, s)))
            .collect();
        let segments: Vec<Vec<Segment>> = replayed.iter().map(segments).collect();
        let pairs: Vec<(&Signals, &[Segment])> =
            replayed.iter().zip(segments.iter().map(Vec::as_slice)).collect();
        let weight = found.gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
        let again = inertia(&pairs, &found.axis, &friction_found.law, &weight, &mut Vec::new());
        let (Some(again), truth) = (again, found.axis.motor.inertia) else { return };
        found.replayed_inertia = Some(again.value);
        if (inertia_found.value / truth - 1.0).abs() > UNSEEN {
            found.findings.push(Finding::note(
                "unseen-current",
                format!(
                    "eq. 5 gives {:.4e} of the recorded axis and {:.4e} of the simulated one, whose inertia is {truth:.4e}: \
                     between two samples the current swings with each set-point; the refined value counts",
                    inertia_found.value, again.value
                ),
            ));
        }
    }

    /// Says where the model does not explain the current, in closed loop if that was simulated.
    fn tell_currents(&mut self) {
        let found = &mut self.found;
        for (number, input) in self.inputs.iter().enumerate() {
            let simulated =
                found.experiments.iter().zip(&found.comparisons).filter(|(e, _)| e.recording == number);
            let worst = simulated.filter_map(|(_, c)| c.current_determination).reduce(f64::min);
            let inverse = found.inverse.get(number).and_then(|i| i.as_ref()).map(|i| i.determination);
            if let Some(r2) = worst.or(inverse).filter(|r2| *r2 < LEAST_DETERMINATION) {
                found.findings.push(Finding::warning(
                    "poor-current",
                    format!("{}: the model explains {:.1} % of the current", input.signals.name, 100.0 * r2),
                    "check units, torque constant and transmission; record without cutting forces",
                ));
            }
        }
    }
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

/// A simulation as if it had been recorded.
fn replayed(signals: &Signals, experiment: &Experiment, simulated: &Simulated) -> Signals {
    let filter = Gaussian::new(signals.cutoff, experiment.period());
    let motion = filter.apply(&simulated.position);
    let span = Span {
        start: experiment.start,
        position: simulated.position.clone(),
        velocity: motion.first,
        acceleration: motion.second,
        smooth_current: Some(filter.apply(&simulated.current).value),
        current: Some(simulated.current.clone()),
        ..Span::default()
    };
    Signals { name: signals.name.clone(), current_lag: 0.0, spans: vec![span], ..*signals }
}
