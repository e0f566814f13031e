//! Sequence of the identification steps and the closed-loop refinement.

mod closed_loop_steps;

use super::closed_loop::position_residuals;
use super::experiment::Experiment;
use super::feedforward::{FeedforwardFit, fit_feedforward};
use super::feedforward_mode::FeedforwardMode;
use super::findings::{inertia_of_simulation, report_aliased_current, report_result};
use super::friction::{Breakaway, fit_friction};
use super::gravity::{GravityCurrent, SteadyMeasurements, fit_gravity};
use super::identification::Identification;
use super::inertia::fit_inertia;
use super::options::{IdentificationInput, IdentificationOptions, RefinementScope};
use super::presliding::fit_presliding;
use super::production::identify_production;
use super::refine::RefinedParameter;
use super::route::takes_steps;
use super::sanity::{report_invalid, report_unstated};
use super::segments::{MotionSegment, SegmentKind, find_segments};
use super::setpoints::stride;
use super::trace_experiments::trace_experiments;
use super::transmission::fit_transmission;
use super::validate::compute_agreement;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, AxisUnits, DeviationConfig, Periods, PositionControllerConfig};
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::seconds;

/// Position residual of the steps, µm and mdeg RMS, from which on they are compared with a joint fit.
const POOR: f64 = 5.0;
/// Residual of the joint fit, relative to that of the steps, up to which it is taken.
const MUCH_BETTER: f64 = 0.5;

/// Identifies `axis` from recordings, starting from the parameters of its machine file.
pub fn identify(
    inputs: &[IdentificationInput<'_>],
    axis: &AxisConfig,
    periods: &Periods,
    options: &IdentificationOptions,
) -> Identification {
    identify_with_transmission(inputs, &[], axis, periods, options)
}

/// Identifies `axis` as [`identify`], and its elastic transmission from recordings with both encoders, `transmission`.
pub fn identify_with_transmission(
    inputs: &[IdentificationInput<'_>],
    transmission: &[&Signals],
    axis: &AxisConfig,
    periods: &Periods,
    options: &IdentificationOptions,
) -> Identification {
    let mut steps = IdentificationSteps::new(inputs, axis, periods, options);
    // The closed loop is that of the elastic axis.
    if !transmission.is_empty() {
        steps.fit_transmission(transmission);
    }
    if !inputs.is_empty() {
        steps.fit_axis();
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
        let torque_constant = inputs.iter().find_map(|input| input.signals.torque_constant);
        if let Some((value, _)) = torque_constant {
            // Both constants are those of one magnetic field.
            found.motor.emf_constant *= value / found.motor.torque_constant;
            found.motor.torque_constant = value;
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
                presliding: None,
                excluded_presliding: None,
                transmission: None,
                replayed_inertia: None,
                feedforward: FeedforwardFit::default(),
                delays: Vec::new(),
                refinement: None,
                agreements: Vec::new(),
                periods: None,
                active_feedforward: Vec::new(),
                torque_constant,
                current_logging: None,
                findings,
            },
        }
    }

    /// Fits the parameters of the rigid axis, with its presliding if the options ask for it.
    fn fit_axis(&mut self) {
        let (inputs, periods) = (self.inputs, self.periods);
        if !takes_steps(inputs, &self.segments, &self.found.axis, periods) {
            identify_production(inputs, periods, self.options.refine, &mut self.found);
            if self.found.current_logging.is_none() {
                let cycle = self.found.periods.unwrap_or(*periods);
                report_aliased_current(inputs, &cycle, &mut self.found.findings);
            }
            self.find_production_experiments();
        } else {
            self.fit_plant();
            // The closed loop needs an approximate presliding only, and the presliding the inertia of the closed loop.
            self.fit_presliding(&mut Vec::new());
            self.fit_feedforward_weights();
            let before = self.found.clone();
            self.fit_closed_loop();
            self.compare_with_joint_fit(before);
        }
        let mut findings = Vec::new();
        self.fit_presliding(&mut findings);
        self.found.findings.append(&mut findings);
    }

    /// Takes the joint fit in place of the steps if these leave a large residual, as with wrong gains of the machine file, and
    /// the joint fit a much smaller one.
    fn compare_with_joint_fit(&mut self, mut joint: Identification) {
        let AxisUnits { error: unit, error_name: name, .. } = joint.axis.units();
        let is_cascade = joint.axis.position_loop.controller == PositionControllerConfig::Cascade;
        let residuals = position_residuals(&self.found.axis, self.periods, &self.experiments);
        let Some(by_steps) = residuals.and_then(|left| rms(left.iter().copied())) else { return };
        if by_steps <= POOR * unit || !is_cascade || self.options.refine == RefinementScope::NONE {
            return;
        }
        identify_production(self.inputs, self.periods, self.options.refine, &mut joint);
        let Some(by_fit) = joint.refinement.as_ref().map(|refinement| refinement.position.1) else { return };
        if by_fit > MUCH_BETTER * by_steps {
            return;
        }
        joint.findings.push(Finding::warning(
            "steps-disagree",
            format!(
                "the steps of the paper leave {:.1} {name} RMS with the gains of the initial machine, a joint fit of gains and \
                 delays {:.1} {name}: its values are used",
                by_steps / unit,
                by_fit / unit
            ),
            "compare gains and periods with the machine data of the control",
        ));
        self.found = joint;
        self.find_production_experiments();
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
                match self.inputs.iter().any(|input| input.signals.spans.iter().any(|span| span.psec.is_some())) {
                    true => "no recording contains a current: friction, gravity and inertia are identified from positions only",
                    false => "no friction, gravity and inertia: no recording contains a current",
                },
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

    /// Fits the presliding if the options ask for it.
    fn fit_presliding(&mut self, findings: &mut Vec<Finding>) {
        if !self.options.presliding {
            return;
        }
        let recordings: Vec<&Signals> = self.inputs.iter().map(|input| input.signals).collect();
        let found = &mut self.found;
        found.axis.presliding = found.initial.presliding;
        (found.presliding, found.excluded_presliding) =
            match fit_presliding(&recordings, &found.axis, findings) {
                Ok(fit) => (Some(fit), None),
                Err(excluded) => (None, excluded),
            };
        if let Some(presliding) = &found.presliding {
            presliding.apply(&mut found.axis);
        }
    }

    /// Fits the transmission; the inertia of the axis is that of motor and load unless the other recordings tell it.
    fn fit_transmission(&mut self, recordings: &[&Signals]) {
        let found = &mut self.found;
        found.transmission = fit_transmission(recordings, (&found.axis, self.periods), &mut found.findings);
        let Some(fit) = &found.transmission else { return };
        fit.apply(&mut found.axis);
        if let Some(total) = found.inertia_of_both_encoders() {
            found.axis.motor.inertia = total.value * found.axis.transmission_ratio.powi(2);
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

    /// Prepares the comparison of the identified axis with production traces.
    fn find_production_experiments(&mut self) {
        let periods = self.found.periods.unwrap_or(*self.periods);
        let logging = self.found.current_logging();
        let of = |(k, input): (usize, &IdentificationInput<'_>)| {
            let active = self.found.active_feedforward.get(k).copied();
            let mode = active.or(input.feedforward).unwrap_or(FeedforwardMode::Both);
            trace_experiments(input.signals, k, &periods, (mode, 0.0, logging))
        };
        self.experiments = self.inputs.iter().enumerate().flat_map(of).collect();
    }

    fn finish(mut self) -> Identification {
        for (number, input) in self.inputs.iter().enumerate() {
            let segments = self.segments.get(number).cloned().unwrap_or_default();
            let of_it = |e: &&Experiment| e.recording == number;
            let experiments = self.experiments.iter().filter(of_it).cloned().collect();
            let periods = self.found.periods.as_ref().unwrap_or(self.periods);
            let is_coarse = stride(input.signals.period, seconds(periods.position)).is_none();
            let signals = (input.signals, is_coarse || self.found.periods.is_some());
            let found = compute_agreement(signals, segments, experiments, &self.found.axis, periods);
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
        report_invalid(self.inputs, self.options.stated, &mut self.found);
        report_unstated(self.options.stated, &mut self.found);
        self.found
    }
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
