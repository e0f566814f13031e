//! Findings about an identification result.

use super::backlash::lost_motion;
use super::delays::DelayParameter;
use super::experiment::{Experiment, SimulatedExperiment};
use super::friction::friction_current;
use super::gravity::GravityCurrent;
use super::identification::Identification;
use super::inertia::fit_inertia;
use super::options::IdentificationInput;
use super::refine::RefinedParameter;
use super::segments::{MotionSegment, find_segments};
use super::setpoints::stride;
use super::validate::Agreement;
use crate::recording::{Finding, GaussianFilter, SignalSpan, Signals};
use virtual_axes_core::config::{AxisUnits, Periods};
use virtual_axes_core::statistics::median;
use virtual_axes_core::units::{MILLISECOND, Rounded, seconds};

/// Largest relative difference between refined and measured friction.
const DISAGREEING: f64 = 0.05;
/// Largest position residual of a valid model, twice that of the paper, µm and mdeg.
const DEVIATING: f64 = 20.0;
/// Smallest lost motion that is reported, µm and mdeg: errors of the fitted loop look like up to 2 µm.
const BACKLASH: f64 = 2.5;
/// Sampling period, relative to the position cycle, above which the current between setpoints is not
/// resolved: at a third of it the inertia by eq. 5 is up to 6 % too small.
const COARSE: f64 = 0.3;
/// Share of the squared position residual that a constant time shift explains, from which on it is reported.
const SHIFTED: f64 = 0.9;
/// Longest position cycle, s, whose ripple hardly changes the inertia from a current of an instant: at 2 ms by less than
/// 1 %, at 6 ms by more than 10 %.
const SHORT_CYCLE: f64 = 3e-3;
/// Largest relative difference between eq. 5 and the refined inertia without a finding.
const UNSEEN: f64 = 0.03;

/// Reports delays that were not identified, with the reason.
pub(super) fn report_delays(experiments: &[Experiment], found: &mut Identification) {
    for which in [DelayParameter::Alpha, DelayParameter::Beta, DelayParameter::Gamma] {
        if let Some(fit) = found.delays.iter().find(|fit| fit.delay == which) {
            if fit.is_at_end {
                found.findings.push(Finding::warning(
                    "delay-at-end",
                    format!("the interval of {} ends at the longest permitted delay", which.name()),
                    "check the gains of the initial machine and the active feedforward",
                ));
            }
            continue;
        }
        let name = which.name();
        let recorded = experiments.iter().any(|e| e.mode == which.feedforward_mode());
        let weights = &found.axis.feedforward;
        let without_effect = match which {
            DelayParameter::Alpha => false,
            DelayParameter::Beta => weights.velocity == 0.0,
            DelayParameter::Gamma => weights.torque == 0.0,
        };
        found.findings.push(if without_effect {
            Finding::note(
                "unseen-delay",
                format!("{name} is unchanged: its feedforward weight is 0, so it has no effect"),
            )
        } else if recorded {
            Finding::warning(
                "unseen-delay",
                format!("{name} is unchanged: the axis cannot be simulated with delays near it"),
                "check the initial machine",
            )
        } else {
            Finding::warning(
                "unseen-delay",
                format!("{name} is unchanged: no recording identifies it"),
                format!(
                    "record with feedforward {} (`virtual_axes psec campaign --part {}`)",
                    which.feedforward_mode().name(),
                    which.feedforward_mode().name()
                ),
            )
        });
    }
}

/// Returns eq. 5 applied to the simulated axis with the same filter and steps; none without simulation.
pub(super) fn inertia_of_simulation(
    inputs: &[IdentificationInput<'_>],
    found: &Identification,
) -> Option<f64> {
    let friction = found.friction.as_ref().filter(|_| found.inertia.is_some())?;
    let replayed: Vec<Signals> = inputs
        .iter()
        .zip(&found.agreements)
        .flat_map(|(input, agreement)| {
            let pairs = agreement.experiments.iter().zip(&agreement.simulated);
            pairs.map(|(e, s)| simulated_signals(input.signals, e, s))
        })
        .collect();
    let segments: Vec<Vec<MotionSegment>> = replayed.iter().map(find_segments).collect();
    let pairs: Vec<(&Signals, &[MotionSegment])> =
        replayed.iter().zip(segments.iter().map(Vec::as_slice)).collect();
    let weight = found.gravity.as_ref().map_or_else(GravityCurrent::default, |g| g.model);
    fit_inertia(&pairs, &found.axis, &friction.law, &weight, &mut Vec::new()).map(|again| again.value)
}

/// Creates a recording from a simulation.
fn simulated_signals(signals: &Signals, experiment: &Experiment, simulated: &SimulatedExperiment) -> Signals {
    let filter = GaussianFilter::new(signals.cutoff, experiment.period());
    let motion = filter.apply(&simulated.position);
    let span = SignalSpan {
        start: experiment.start,
        position: simulated.position.clone(),
        velocity: motion.first,
        acceleration: motion.second,
        smooth_current: Some(filter.apply(&simulated.current).value),
        current: Some(simulated.current.clone()),
        ..SignalSpan::default()
    };
    Signals { name: signals.name.clone(), current_lag: 0.0, spans: vec![span], ..*signals }
}

/// Reports low R², parameters at bounds, correlations, and disagreements of the result.
pub(super) fn report_result(inputs: &[IdentificationInput<'_>], tsp: f64, found: &mut Identification) {
    report_positions(inputs, found);
    report_backlash(inputs, found);
    report_inertia(inputs, tsp, found);
    report_friction(found);
    let Some(refinement) = &found.refinement else { return };
    for refined in refinement.parameters.iter().filter(|p| p.is_at_bound) {
        found.findings.push(Finding::warning(
            "at-bound",
            format!(
                "{} ends at its bound {:.4}",
                refined.parameter,
                refined.value / refined.parameter.unit_size()
            ),
            "record motions that excite it more, or exclude it from the refinement",
        ));
    }
    for (a, b, rho) in refinement.correlated_pairs() {
        found.findings.push(Finding::note(
            "correlated",
            format!(
                "{a} and {b} are strongly correlated ({rho:.3}): only their combination is identified well"
            ),
        ));
    }
}

/// Reports production traces that sample the current at one phase of the position cycle only.
pub(super) fn report_aliased_current(
    inputs: &[IdentificationInput<'_>],
    periods: &Periods,
    findings: &mut Vec<Finding>,
) {
    let tsp = seconds(periods.position);
    for signals in inputs.iter().map(|input| input.signals) {
        let has_current = signals.spans.iter().any(|span| span.current.is_some());
        let Some(cycles) = stride(tsp, signals.period).filter(|_| has_current) else { continue };
        if tsp <= SHORT_CYCLE || signals.trace_filter.is_some() {
            continue;
        }
        findings.push(Finding::warning(
            "unseen-current",
            format!(
                "{}: sampled every {} of {} ms{}, at one phase of the ripple of the current: unless the \
                 control filters the current, inertia and friction can be wrong by more than 10 %",
                signals.name,
                if cycles == 1 { "position cycle".to_owned() } else { format!("{cycles} position cycles") },
                Rounded(tsp / MILLISECOND),
                match has_no_setpoints(signals) {
                    true => ", which is that of the initial machine and not seen in the recording",
                    false => "",
                }
            ),
            "record at a period that is no multiple of the position cycle; give --trace-filter-hz if the control filters all \
             signals but PSEC",
        ));
    }
}

/// Returns true if no part of the recording has setpoints, which show the position cycle.
fn has_no_setpoints(signals: &Signals) -> bool {
    signals.spans.iter().all(|span| span.psec.is_none())
}

/// Returns the position cycle `tsp`, s, in words if it is assumed.
fn assumed_cycle(is_assumed: bool, tsp: f64) -> String {
    match is_assumed {
        true => format!(" (of the initial machine, {} ms)", Rounded(tsp / MILLISECOND)),
        false => String::new(),
    }
}

/// Reports backlash, which the model does not have.
fn report_backlash(inputs: &[IdentificationInput<'_>], found: &mut Identification) {
    let AxisUnits { error: unit, error_name: name, .. } = found.axis.units();
    if found.axis.transmission.is_some_and(|transmission| transmission.backlash > 0.0) {
        return;
    }
    for (input, agreement) in inputs.iter().zip(&found.agreements) {
        let Some(lost) = lost_motion(agreement).filter(|lost| *lost > BACKLASH * unit) else { continue };
        found.findings.push(Finding::warning(
            "backlash",
            format!(
                "{}: the recorded position stays behind the simulated one by {:.1} {name} after each reversal: backlash or \
                 elastic lost motion, which the model does not have",
                input.signals.name,
                lost / unit
            ),
            "compare with the backlash compensation of the control; positions from the motor encoder do not contain it",
        ));
    }
}

/// Reports recordings whose simulated position deviates from the recorded one.
fn report_positions(inputs: &[IdentificationInput<'_>], found: &mut Identification) {
    let AxisUnits { error: unit, error_name: name, .. } = found.axis.units();
    for (input, agreement) in inputs.iter().zip(&found.agreements) {
        // Of production traces, whose setpoints are interpolated, the RMS counts.
        if found.periods.is_some()
            && agreement.baseline.is_some_and(|baseline| baseline.model <= DEVIATING * unit)
        {
            continue;
        }
        let deviations = agreement.comparisons.iter().flat_map(|c| [c.constant_velocity, c.elsewhere]);
        let worst = deviations.flatten().map(|d| d.max).fold(0.0, f64::max);
        if worst > DEVIATING * unit {
            found.findings.push(Finding::warning(
                "poor-position",
                format!(
                    "{}: the simulated position deviates by up to {:.0} {name}: all closed-loop results are unreliable",
                    input.signals.name,
                    worst / unit
                ),
                "check position_loop.gain, the other gains and the periods of the initial machine, the active \
                 feedforward, that PSEC and position have the same zero, and that all signals are sampled at the position \
                 cycles",
            ));
            if found.periods.is_none() {
                report_sampling_phase(&input.signals.name, agreement, &mut found.findings);
            }
        }
    }
}

/// Returns the time, s, by which the simulated position is ahead of the recorded one; none if no constant time explains
/// their difference.
fn time_shift(agreement: &Agreement) -> Option<f64> {
    let pairs = agreement.experiments.iter().zip(&agreement.simulated).flat_map(|(recorded, simulated)| {
        let residuals = simulated.position.iter().zip(&recorded.position).map(|(s, r)| s - r);
        residuals.zip(recorded.velocity.iter().copied())
    });
    let (residual, product, velocity) = pairs
        .filter(|(residual, velocity)| residual.is_finite() && velocity.is_finite())
        .fold((0.0, 0.0, 0.0), |(rr, rv, vv), (r, v)| (rr + r * r, rv + r * v, vv + v * v));
    (product * product > SHIFTED * residual * velocity).then(|| product / velocity)
}

/// Reports samples that seem to lie beside the position cycles, or none.
fn report_sampling_phase(name: &str, agreement: &Agreement, findings: &mut Vec<Finding>) {
    let Some(shift) = time_shift(agreement) else { return };
    findings.push(Finding::warning(
        "sampling-phase",
        format!(
            "{name}: the position deviates as if it were sampled {:.2} ms {} the position cycles: at that phase the current \
             is another one than simulated, and inertia and friction are wrong",
            shift.abs() / MILLISECOND,
            if shift > 0.0 { "before" } else { "after" }
        ),
        "sample PSEC, position and current at the position cycles or every millisecond; a wrong position_loop.gain has the \
         same effect on the position",
    ));
}

/// Reports an inertia by eq. 5 that misses a part of the current.
fn report_inertia(inputs: &[IdentificationInput<'_>], tsp: f64, found: &mut Identification) {
    let refined = found
        .refinement
        .as_ref()
        .is_some_and(|r| r.parameters.iter().any(|p| p.parameter == RefinedParameter::Inertia));
    if refined {
        // The refinement identified what the step did not.
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
            coarse |= tsp > SHORT_CYCLE && input.signals.period > COARSE * tsp;
            parts.push((median(&mut values).unwrap_or(f64::NAN), input.signals.name.as_str()));
        }
    }
    let truth = found.axis.motor.inertia;
    let differs = |a: f64, b: f64| (a / b - 1.0).abs() > UNSEEN;
    let is_reported = if refined { differs(by_steps.value, truth) } else { coarse };
    if !is_reported {
        return;
    }
    let values: Vec<String> = parts.iter().map(|(value, name)| format!("{value:.4} ({name})")).collect();
    let what = format!(
        "the current varies within a position cycle{}, and the recording samples one phase of it only: \
         Prévost eq. 5 gives an inertia of {}",
        assumed_cycle(inputs.iter().all(|input| has_no_setpoints(input.signals)), tsp),
        values.join(", ")
    );
    found.findings.push(if refined {
        let again = found
            .replayed_inertia
            .map_or_else(String::new, |again| format!(", {again:.4} on the simulated axis"));
        Finding::note("unseen-current", format!("{what}{again}; the refined value {truth:.4} is used"))
    } else {
        Finding::warning(
            "unseen-current",
            format!("{what}; the error can exceed 50 %"),
            "record PSEC for the closed-loop refinement, or sample the current every millisecond",
        )
    });
}

/// Reports a refined friction that differs from the friction at constant velocity.
fn report_friction(found: &mut Identification) {
    let Some(friction) = found.friction.as_ref().filter(|_| found.refinement.is_some()) else { return };
    let unit = found.axis.units().speed;
    let part = |velocity: f64| {
        let v = velocity / unit;
        (friction_current(&found.axis.friction, v) / friction.law.at(v) - 1.0).abs()
    };
    let worst = found.steady.levels.iter().map(|level| part(level.velocity)).fold(0.0, f64::max);
    if worst > DISAGREEING {
        found.findings.push(Finding::warning(
            "friction-disagrees",
            format!(
                "the refined friction differs by {:.1} % from the friction at constant velocity: another parameter \
                 of the closed loop is wrong",
                100.0 * worst
            ),
            "check the gains and periods of the initial machine and the active feedforward; record VFFWS and TFFWS",
        ));
    }
}
