//! What must be said of a result.

use super::closed_loop::{Experiment, Simulated};
use super::delays::Delay;
use super::gravity::GravityCurrent;
use super::identification::{Identification, Input};
use super::inertia::inertia;
use super::segments::{Segment, segments};
use crate::recording::{Finding, Gaussian, Signals, Span};

/// R² of the current below which a model is not what was recorded.
const LEAST_DETERMINATION: f64 = 0.9;
/// Part by which eq. 5 can differ from the refined inertia before it is told.
const UNSEEN: f64 = 0.03;

/// Says which delays were not seen, and why.
pub(super) fn tell_delays(experiments: &[Experiment], found: &mut Identification) {
    for which in [Delay::Alpha, Delay::Beta, Delay::Gamma] {
        if found.delays.iter().any(|fit| fit.delay == which) {
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
pub(super) fn tell(inputs: &[Input<'_>], found: &mut Identification) {
    let truth = found.axis.motor.inertia;
    if let (Some(by_steps), Some(replayed)) = (&found.inertia, found.replayed_inertia)
        && (by_steps.value / truth - 1.0).abs() > UNSEEN
    {
        found.findings.push(Finding::note(
            "unseen-current",
            format!(
                "eq. 5 gives {:.4e} of the recorded axis and {replayed:.4e} of the simulated one, whose inertia is \
                 {truth:.4e}: between two samples the current swings with each set-point; the refined value counts",
                by_steps.value
            ),
        ));
    }
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
