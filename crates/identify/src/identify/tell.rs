//! What must be said of a result.

use super::closed_loop::{Experiment, Simulated};
use super::delays::Delay;
use super::fit::median;
use super::friction::{current, speed_unit};
use super::gravity::GravityCurrent;
use super::identification::{Identification, Input};
use super::inertia::inertia;
use super::refine::Parameter;
use super::segments::{Segment, segments};
use crate::recording::{Finding, Gaussian, Signals, Span};
use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::DEGREE;

/// R² of the current below which a model is not what was recorded.
const LEAST_DETERMINATION: f64 = 0.9;
/// Part by which refined and measured friction can differ.
const DISAGREEING: f64 = 0.05;
/// Deviation of the position beyond which a model is not the axis: twice what the paper saw, m and rad.
const DEVIATING: f64 = 20e-6;
const DEVIATING_ANGLE: f64 = 20e-3 * DEGREE;
/// Part of the position period beyond which a sampling period hides what a drive does between setpoints.
const COARSE: f64 = 0.34;
/// Part by which eq. 5 can differ from the refined inertia before it is told.
const UNSEEN: f64 = 0.03;

/// Says which delays were not seen, and why.
pub(super) fn tell_delays(experiments: &[Experiment], found: &mut Identification) {
    for which in [Delay::Alpha, Delay::Beta, Delay::Gamma] {
        if let Some(fit) = found.delays.iter().find(|fit| fit.delay == which) {
            if fit.at_end {
                found.findings.push(Finding::warning(
                    "delay-at-end",
                    format!("{} ends at the end of its range", which.name()),
                    "check the gains of the machine file and the feedforward that acted",
                ));
            }
            continue;
        }
        let name = which.name();
        let recorded = experiments.iter().any(|e| e.mode == which.mode());
        let weights = &found.axis.feedforward;
        let without_effect = match which {
            Delay::Alpha => false,
            Delay::Beta => weights.velocity == 0.0,
            Delay::Gamma => weights.torque == 0.0,
        };
        found.findings.push(if without_effect {
            Finding::note(
                "unseen-delay",
                format!("{name} is left as it is: its feedforward is 0, and any value gives the same motion"),
            )
        } else if recorded {
            Finding::warning(
                "unseen-delay",
                format!("{name} is left as it is: the axis cannot be simulated around it"),
                "check the machine file",
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

/// Eq. 5 on the simulated axis, through the same filter and the same steps; none without simulation.
pub(super) fn replayed_inertia(inputs: &[Input<'_>], found: &Identification) -> Option<f64> {
    let friction = found.friction.as_ref().filter(|_| found.inertia.is_some())?;
    let replayed: Vec<Signals> = inputs
        .iter()
        .zip(&found.agreements)
        .flat_map(|(input, agreement)| {
            let pairs = agreement.experiments.iter().zip(&agreement.simulated);
            pairs.map(|(e, s)| replayed(input.signals, e, s))
        })
        .collect();
    let segments: Vec<Vec<Segment>> = replayed.iter().map(segments).collect();
    let pairs: Vec<(&Signals, &[Segment])> =
        replayed.iter().zip(segments.iter().map(Vec::as_slice)).collect();
    let weight = found.gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
    inertia(&pairs, &found.axis, &friction.law, &weight, &mut Vec::new()).map(|again| again.value)
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

/// Says where eq. 5, the current, bounds and correlations ask for care.
pub(super) fn tell(inputs: &[Input<'_>], tsp: f64, found: &mut Identification) {
    tell_positions(inputs, found);
    tell_inertia(inputs, tsp, found);
    tell_friction(found);
    for (input, agreement) in inputs.iter().zip(&found.agreements) {
        if let Some(r2) = agreement.current_determination().filter(|r2| *r2 < LEAST_DETERMINATION) {
            found.findings.push(Finding::warning(
                "poor-current",
                format!("{}: the model explains {:.1} % of the current", input.signals.name, 100.0 * r2),
                "check units, torque constant and transmission; record without cutting forces",
            ));
        }
    }
    let Some(refinement) = &found.refinement else { return };
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
            format!(
                "{a} and {b} can hardly be told apart (correlation {rho:.3}); what they make together can"
            ),
        ));
    }
}

/// Says where the simulated position is not the recorded one.
fn tell_positions(inputs: &[Input<'_>], found: &mut Identification) {
    let (limit, unit, name) = match found.axis.kind() {
        AxisKind::Linear => (DEVIATING, 1e-6, "µm"),
        AxisKind::Rotary => (DEVIATING_ANGLE, 1e-3 * DEGREE, "mdeg"),
    };
    for (input, agreement) in inputs.iter().zip(&found.agreements) {
        let deviations = agreement.comparisons.iter().flat_map(|c| [c.constant_velocity, c.elsewhere]);
        let worst = deviations.flatten().map(|d| d.max).fold(0.0, f64::max);
        if worst > limit {
            found.findings.push(Finding::warning(
                "poor-position",
                format!(
                    "{}: the simulated position is off by up to {:.0} {name}: no result that rests on the closed loop \
                     can be trusted",
                    input.signals.name,
                    worst / unit
                ),
                "check position_loop.gain, the other gains and the periods of the machine file, the feedforward that \
                 acted, and that PSEC and position have the same zero",
            ));
        }
    }
}

/// Says where eq. 5 does not see all of the current.
fn tell_inertia(inputs: &[Input<'_>], tsp: f64, found: &mut Identification) {
    let refined = found
        .refinement
        .as_ref()
        .is_some_and(|r| r.parameters.iter().any(|p| p.parameter == Parameter::Inertia));
    if refined {
        // What the step did not find the refinement did.
        found.findings.retain(|finding| finding.code != "negative-inertia");
    }
    let Some(by_steps) = &found.inertia else { return };
    let with_current =
        inputs.iter().filter(|input| input.signals.spans.iter().any(|span| span.current.is_some()));
    let mut parts = Vec::new();
    let mut coarse = false;
    for (number, input) in with_current.enumerate() {
        let of_it = by_steps.instants.iter().filter(|instant| instant.0 == number);
        let mut values: Vec<f64> = of_it.map(|instant| instant.2).collect();
        if !values.is_empty() {
            coarse |= input.signals.period > COARSE * tsp;
            parts.push((median(&mut values), input.signals.name.as_str()));
        }
    }
    let truth = found.axis.motor.inertia;
    let differs = |a: f64, b: f64| (a / b - 1.0).abs() > UNSEEN;
    let told = if refined { differs(by_steps.value, truth) } else { coarse };
    if !told {
        return;
    }
    let values: Vec<String> = parts.iter().map(|(value, name)| format!("{value:.4} ({name})")).collect();
    let what = format!(
        "the current swings with each setpoint, and a recording sampled no faster sees it at one phase: eq. 5 gives \
         an inertia of {}",
        values.join(", ")
    );
    found.findings.push(if refined {
        let again = found
            .replayed_inertia
            .map_or_else(String::new, |again| format!(", {again:.4} on the simulated axis"));
        Finding::note("unseen-current", format!("{what}{again}; the refined {truth:.4} counts"))
    } else {
        Finding::warning(
            "unseen-current",
            format!("{what}; it can be wrong by more than half"),
            "record PSEC, for the refinement on the closed loop, or the current every millisecond",
        )
    });
}

/// Says where the refined friction is another one than that of the constant velocities.
fn tell_friction(found: &mut Identification) {
    let Some(friction) = found.friction.as_ref().filter(|_| found.refinement.is_some()) else { return };
    let unit = speed_unit(&found.axis);
    let part = |velocity: f64| {
        let v = velocity / unit;
        (current(&found.axis.friction, v) / friction.law.at(v) - 1.0).abs()
    };
    let worst = found.steady.levels.iter().map(|level| part(level.velocity)).fold(0.0, f64::max);
    if worst > DISAGREEING {
        found.findings.push(Finding::warning(
            "friction-disagrees",
            format!(
                "the refined friction differs by {:.1} % from what constant velocities show: something else of the \
                 closed loop is wrong",
                100.0 * worst
            ),
            "check the gains and periods of the machine file and the feedforward that acted; record VFFWS and TFFWS",
        ));
    }
}
