//! Identification from recordings of any program, sampled at any rate, usually with feedforward active and with few phases
//! of constant velocity.
//!
//! 1. Inertia, friction and gravity by regression of the current over all samples in motion.
//! 2. Feedforward as recorded; delays, gains and the other weights jointly from the positions, on the closed loop.
//! 3. Inertia, friction and gravity again, with the ripple that the closed loop causes in the current.
//! 4. Checks: results that are worse than a constant lag, or implausibly far from the machine file, are invalid.

use super::delays::{DelayFit, DelayParameter};
use super::experiment::CurrentLogging;
use super::feedforward_mode::FeedforwardMode;
use super::feedforward_search::{FeedforwardSearch, mean_lag};
use super::identification::Identification;
use super::loop_parameter::{LoopParameter, PRIOR};
use super::loop_problem::LoopProblem;
use super::loop_ripple::possible_loggings;
use super::loop_search::LoopMinimum;
use super::loop_values::LoopFit;
use super::options::{IdentificationInput, RefinementScope};
use super::plant_regression::{PlantRegression, fit_plant};
use super::recorded_feedforward::fit_recorded_feedforward;
use super::refine::{RefinedParameter, RefinedValue, Refinement};
use super::resample::interpolation_error;
use super::setpoints::{HELD, SetpointGrid, longest_cycle, stride};
use crate::recording::{Finding, SignalSpan, Signals};
use virtual_axes_core::config::{AxisConfig, AxisKind, AxisUnits, Periods};
use virtual_axes_core::units::{
    DEGREE, MICROSECOND_NS, MILLISECOND, Nanoseconds, POSITION_GAIN, Rounded, seconds,
};

/// Part of the travel in the direction that is seldom, from which on the axis moves in both.
const BOTH_WAYS: f64 = 0.02;
/// Travel of an axis that moves, m or rad.
const SHORTEST_TRAVEL: f64 = 1e-3;
/// Relative change of the gain from which that of the machine file does not fit.
const GAIN_CHANGE: f64 = 0.15;
/// Longest duration of motion of a recording that is simulated for delays and gains, s; all of it is compared at the end.
const FITTED: f64 = 20.0;
/// Part of the sampling period by which interpolated setpoints can move β and γ: they do not show where in a period the
/// acceleration changes.
const INTERPOLATED: f64 = 0.125;
/// Least bound of the error of interpolated setpoints that is printed, µm and mdeg.
const LEAST_BOUND: f64 = 0.1;
/// Standard errors of a value within its interval.
const INTERVAL: f64 = 2.0;

/// Identifies plant and loop; `found` contains the machine file and receives the results.
pub(super) fn identify_production(
    inputs: &[IdentificationInput<'_>],
    periods: &Periods,
    scope: RefinementScope,
    found: &mut Identification,
) {
    if !inputs.iter().any(|input| moves(input.signals)) {
        found.findings.push(Finding::missing(
            "no-motion",
            "the axis does not move in these recordings",
            "record a program with moves in both directions",
        ));
        return;
    }
    let signals: Vec<&Signals> = inputs.iter().map(|input| input.signals).collect();
    let has_current = signals.iter().any(|signals| signals.spans.iter().any(|span| span.current.is_some()));
    if has_current && !moves_both_ways(&signals) {
        found.findings.push(Finding::warning(
            "one-direction",
            "the axis moves in one direction only: the shape of the friction and the standstills alone separate friction and gravity",
            "record each speed in both directions",
        ));
    }
    let plant = fit_plant(&signals, &found.axis, None);
    if let Some(plant) = &plant {
        apply_plant(plant, found);
    } else {
        found.findings.push(Finding::missing(
            "few-moves",
            match has_current {
                true => "no inertia, friction and gravity: the recordings have hardly any motion with current",
                false => {
                    "no inertia, friction and gravity: no recording has a current; those of the initial machine are used, and a gain \
                     of the velocity loop is in proportion to that inertia"
                }
            },
            "record the current of a program with moves in both directions",
        ));
    }
    let has_setpoints = signals.iter().any(|signals| signals.spans.iter().any(|span| span.psec.is_some()));
    if !has_setpoints {
        found.findings.push(Finding::missing(
            "no-setpoints",
            "no delays, gains and feedforward: no recording contains PSEC",
            "record the position setpoints (PSEC)",
        ));
    }
    if scope != RefinementScope::NONE && has_setpoints {
        identify_loop(inputs, periods, (scope, plant.is_some()), found);
    }
    if let Some(plant) = plant {
        report_plant(found, &plant);
        report_ripple(inputs, periods, found);
    }
}

/// Identifies the loop, and the plant again from the current that the loop logs if `has_plant`.
fn identify_loop(
    inputs: &[IdentificationInput<'_>],
    periods: &Periods,
    (scope, has_plant): (RefinementScope, bool),
    found: &mut Identification,
) {
    found.feedforward = fit_recorded_feedforward(inputs, found.axis.transmission_ratio);
    if let Some(velocity) = &found.feedforward.velocity {
        found.axis.feedforward.velocity = velocity.value.max(0.0);
    }
    match (&found.feedforward.torque, found.feedforward.is_torque_zero) {
        (Some(torque), _) => found.axis.feedforward.torque = torque.value.max(0.0),
        (None, true) => found.axis.feedforward.torque = 0.0,
        (None, false) => {}
    }
    let longest_cycle = inputs.iter().map(|input| longest_cycle(input.signals));
    let longest_cycle = match scope.position_cycle {
        true => longest_cycle.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, false)),
        false => (seconds(periods.position), true),
    };
    let given_gain = found.axis.position_loop.gain;
    let problem = LoopProblem {
        recordings: &[],
        longest_cycle,
        noise: PRIOR,
        duration: FITTED,
        fits_gain: scope.gain,
        given_gain,
        has_plant,
    };
    let mut searches: Vec<FeedforwardSearch> =
        inputs.iter().map(|input| FeedforwardSearch::new(input, (&found.axis, periods), problem)).collect();
    let mut modes: Vec<FeedforwardMode> = searches.iter().map(FeedforwardSearch::mode).collect();
    let identified = match searches.as_mut_slice() {
        // The modes of a single recording are compared once plant and loop are those of each.
        [search] => {
            let (mode, identified) = search.converged(|mode, first| {
                fit_loop(&[(inputs[0].signals, mode)], periods, (problem, first), found)
            });
            modes = vec![mode];
            identified
        }
        _ => {
            let recordings: Vec<(&Signals, FeedforwardMode)> =
                inputs.iter().zip(&modes).map(|(input, mode)| (input.signals, *mode)).collect();
            fit_loop(&recordings, periods, (problem, None), found)
        }
    };
    for search in &searches {
        search.report(&found.axis, &mut found.findings);
    }
    found.active_feedforward = modes;
    let Some((fit, plant)) = identified else {
        found.findings.push(Finding::missing(
            "no-loop",
            "no delays and gains: the closed loop cannot be simulated near the recorded motion",
            "check lead, gains and periods of the initial machine; inertia, friction and gravity are those of the current alone",
        ));
        return;
    };
    let before = found.axis.clone();
    if let Some(plant) = plant {
        apply_plant(&plant, found);
        found.current_logging = plant.logging;
    }
    let interpolated =
        inputs.iter().filter(|input| is_interpolated(input.signals, seconds(fit.periods.position)));
    let coarsest = interpolated.map(|input| input.signals.period).fold(0.0, f64::max);
    apply_loop(&fit, (&before, INTERPOLATED * coarsest), found);
    report_interpolation(inputs, seconds(fit.periods.position), found);
}

/// Fits the loop of recordings, from the minimum `first` of a search if there is one, and the plant from the current that this
/// loop logs.
fn fit_loop(
    recordings: &[(&Signals, FeedforwardMode)],
    periods: &Periods,
    (problem, first): (LoopProblem<'_>, Option<LoopMinimum>),
    known: &Identification,
) -> Option<(LoopFit, Option<PlantRegression>)> {
    let problem = LoopProblem { recordings, ..problem };
    let lag = mean_lag(recordings, &known.axis)?;
    let first = match first {
        Some(first) => first,
        None => problem.polished(&known.axis, periods, problem.search(&known.axis, periods, lag)?)?,
    };
    let mut fit = problem.fit(&known.axis, periods, first)?;
    if !problem.has_plant {
        return Some((fit, None));
    }
    let signals: Vec<&Signals> = recordings.iter().map(|(signals, _)| *signals).collect();
    let plant = fit_plant(&signals, &fit.axis, Some(&possible_loggings(recordings, &fit)));
    if let Some(plant) = &plant {
        // The velocity loop keeps its bandwidth.
        plant.apply(&mut fit.axis);
        if let Some(renewed) = problem.renew(&fit.axis, &fit) {
            fit = renewed;
        }
    }
    Some((fit, plant))
}

/// Returns true if setpoints of position cycles of `tsp` s are interpolated between the samples of PSEC.
fn is_interpolated(signals: &Signals, tsp: f64) -> bool {
    let mut spans = signals.spans.iter().filter(|span| span.psec.is_some());
    stride(signals.period, tsp).is_none() && !spans.all(|span| shows_cycles(signals, span, tsp))
}

/// Returns true if the samples lie at several phases of position cycles of `tsp` s, which the setpoints show.
fn shows_cycles(signals: &Signals, span: &SignalSpan, tsp: f64) -> bool {
    signals.period < HELD * tsp && SetpointGrid::of(span, signals.period, tsp).is_some()
}

/// Returns true if a considerable part of the motion has each direction.
fn moves_both_ways(signals: &[&Signals]) -> bool {
    let velocities =
        || signals.iter().flat_map(|signals| &signals.spans).flat_map(|span| span.velocity.iter());
    let travel = |sign: f64| velocities().map(|v| (sign * v).max(0.0)).sum::<f64>();
    let (forward, backward) = (travel(1.0), travel(-1.0));
    forward.min(backward) > BOTH_WAYS * forward.max(backward)
}

/// Returns true if the position covers more than some encoder increments.
fn moves(signals: &Signals) -> bool {
    let positions = signals.spans.iter().flat_map(|span| span.position.iter().copied());
    let (low, high) = positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    high - low > SHORTEST_TRAVEL
}

/// Reports the error of the interpolated setpoints.
fn report_interpolation(inputs: &[IdentificationInput<'_>], tsp: f64, found: &mut Identification) {
    let AxisUnits { error: unit, error_name: name, .. } = found.axis.units();
    for input in inputs.iter().filter(|input| is_interpolated(input.signals, tsp)) {
        let psec = input.signals.spans.iter().filter_map(|span| span.psec.as_deref());
        let error = psec.map(interpolation_error).fold(0.0, f64::max);
        found.findings.push(Finding::note(
            "resampled",
            format!(
                "{}: sampled every {} ms, PSEC is interpolated at the position cycles, with an error of at most about {:.1} {name} RMS",
                input.signals.name,
                Rounded(input.signals.period / MILLISECOND),
                // 0.0 would be no bound.
                (error / unit).max(LEAST_BOUND)
            ),
        ));
    }
}

/// Sets inertia, friction and gravity by the regression.
fn apply_plant(plant: &PlantRegression, found: &mut Identification) {
    plant.apply(&mut found.axis);
    // A constant does not describe the gravity of a rotary axis, which stays that of the machine file.
    found.gravity = Some(plant.gravity.clone()).filter(|_| found.axis.kind() == AxisKind::Linear);
    found.inertia = plant.is_inertia_known().then(|| plant.inertia.clone());
    found.friction = Some(plant.friction.clone());
}

/// Reports correlated values of the plant, and what was not identified.
fn report_plant(found: &mut Identification, plant: &PlantRegression) {
    for (a, b, rho) in &plant.collinear {
        found.findings.push(Finding::note(
            "correlated",
            format!(
                "{a} and {b} are strongly correlated ({rho:.3}): only their combination is identified well"
            ),
        ));
    }
    let axis = &found.axis;
    if found.inertia.is_none() {
        found.findings.push(Finding::missing(
            "no-acceleration",
            format!(
                "the current gives an inertia of {:.4} ± {:.4}, an interval wider than the value: that of the initial machine is used",
                plant.inertia.value, plant.inertia.error
            ),
            "record faster moves with stronger accelerations",
        ));
    }
    if axis.kind() == AxisKind::Rotary {
        let what = format!(
            "gravity.tilt_nm {} and gravity.tilt_phase_deg {} are those of the initial machine: gravity of a rotary axis is \
             identified from a campaign only",
            Rounded(axis.gravity.tilt),
            Rounded(axis.gravity.phase / DEGREE)
        );
        found.findings.push(Finding::note("gravity-kept", what));
    }
}

/// Reports how the control logs the current, where the recordings sample each position cycle at one phase.
fn report_ripple(inputs: &[IdentificationInput<'_>], periods: &Periods, found: &mut Identification) {
    let tsp = seconds(found.periods.unwrap_or(*periods).position);
    if found.inertia.is_none() {
        return;
    }
    let is_at_one_phase = inputs.iter().any(|input| stride(tsp, input.signals.period).is_some());
    let Some(logging) = found.current_logging.filter(|_| is_at_one_phase) else { return };
    let what = match logging {
        CurrentLogging::MEAN => "the mean over a position cycle".to_owned(),
        _ => format!("the current {:.1} ms behind the sample", logging.offset / MILLISECOND),
    };
    found.findings.push(Finding::note(
        "current-ripple",
        format!(
            "the setpoints of the position cycles cause a ripple of the current, and {what} explains the recorded one best; the \
             standard error of the inertia includes other instants that explain it alike"
        ),
    ));
}

/// Sets delays, gains and weights by the closed loop; β and γ have the additional `uncertainty`, s.
fn apply_loop(fit: &LoopFit, (before, uncertainty): (&AxisConfig, f64), found: &mut Identification) {
    found.axis = fit.axis.clone();
    let of = |parameter: LoopParameter| fit.values.iter().find(|value| value.parameter == parameter);
    let tsp = seconds(fit.periods.position);
    if let Some(lag) = of(LoopParameter::Lag) {
        let cycles = (lag.value / tsp).round();
        found.delays.push(delay(DelayParameter::Alpha, (cycles - 1.0) * tsp, cycles * tsp, fit));
    }
    for (parameter, which) in
        [(LoopParameter::Beta, DelayParameter::Beta), (LoopParameter::Gamma, DelayParameter::Gamma)]
    {
        if let Some(value) = of(parameter) {
            // β and γ act at velocity cycles only: true and fitted value lie anywhere within the same cycle.
            let half = INTERVAL * value.error + seconds(fit.periods.velocity) + uncertainty;
            found.delays.push(delay(which, value.value - half, value.value + half, fit));
        }
    }
    let inertia = fit.axis.motor.inertia;
    // Positions show the ratio to the inertia of the current.
    let of_inertia = found.inertia.as_ref().map_or(0.0, |inertia| inertia.error / inertia.value);
    let refined = [
        (LoopParameter::Gain, RefinedParameter::PositionGain, 1.0, 0.0),
        (LoopParameter::Bandwidth, RefinedParameter::VelocityGain, inertia, of_inertia),
        (LoopParameter::IntegralTime, RefinedParameter::VelocityIntegralTime, 1.0, 0.0),
        (LoopParameter::TorqueRatio, RefinedParameter::TorqueFeedforward, inertia, of_inertia),
    ];
    let weight = RefinedParameter::VelocityFeedforward;
    let gain = fit.axis.position_loop.gain;
    let gain_error = of(LoopParameter::Gain).map_or(0.0, |gain| gain.error);
    let changed = of(LoopParameter::Lag).filter(|_| weight.get(before) != weight.get(&fit.axis));
    let changed = changed.map(|lag| RefinedValue {
        parameter: weight,
        before: weight.get(before),
        value: weight.get(&fit.axis),
        error: (lag.error * gain).hypot((lag.value - (lag.value / tsp).round() * tsp) * gain_error),
        is_at_bound: false,
    });
    if let Some(value) = changed {
        found.findings.push(Finding::warning(
            "lag-between-cycles",
            format!(
                "the fitted lag of {:.2} ms is no whole number of position cycles of {} ms: feedforward.velocity \
                 {:.4} in place of {:.4} represents the rest",
                of(LoopParameter::Lag).map_or(f64::NAN, |lag| lag.value / MILLISECOND),
                Rounded(tsp / MILLISECOND),
                value.value,
                value.before
            ),
            "check periods.position_ms, and the weight in the machine data of the control",
        ));
    }
    let parameters: Vec<(LoopParameter, RefinedValue)> = refined
        .into_iter()
        .filter_map(|(parameter, refined, scale, of_scale)| {
            let value = of(parameter)?;
            let found = refined.get(&fit.axis);
            let refined = RefinedValue {
                parameter: refined,
                before: refined.get(before),
                value: found,
                error: (value.error * scale).hypot(of_scale * found),
                is_at_bound: false,
            };
            Some((parameter, refined))
        })
        .chain(changed.map(|changed| (LoopParameter::Lag, changed)))
        .collect();
    let correlation = |a: LoopParameter, b: LoopParameter| {
        let index = |wanted| fit.values.iter().position(|value| value.parameter == wanted);
        index(a).zip(index(b)).and_then(|at| fit.correlations.get(at)).copied().unwrap_or(f64::NAN)
    };
    let row = |(a, _): &(LoopParameter, RefinedValue)| {
        parameters.iter().map(|(b, _)| correlation(*a, *b)).collect::<Vec<f64>>()
    };
    found.refinement = Some(Refinement {
        axis: fit.axis.clone(),
        correlations: parameters.iter().map(row).collect(),
        parameters: parameters.iter().map(|(_, refined)| *refined).collect(),
        position: (fit.rms_with_given_gain.unwrap_or(fit.rms), fit.rms),
        current: None,
    });
    found.periods = Some(fit.periods);
    report_loop(fit, before, found);
}

fn delay(delay: DelayParameter, low: f64, high: f64, fit: &LoopFit) -> DelayFit {
    let value = delay.of(&fit.axis.delays);
    DelayFit {
        delay,
        interval: (nanoseconds(low.max(0.0)), nanoseconds(high)),
        value,
        is_at_end: false,
        is_unchanged: false,
        is_joint: true,
        profile: vec![(value, fit.rms)],
    }
}

fn nanoseconds(time: f64) -> Nanoseconds {
    // A microsecond is less than the uncertainty of any delay.
    (time * 1e6).round() as Nanoseconds * MICROSECOND_NS
}

/// Reports the position cycle, the valley of VFFW and α, and a gain that does not fit.
fn report_loop(fit: &LoopFit, before: &AxisConfig, found: &mut Identification) {
    let tsp = seconds(fit.periods.position) / MILLISECOND;
    let is_fitted = |parameter| fit.values.iter().any(|value| value.parameter == parameter);
    found.findings.push(match is_fitted(LoopParameter::Beta) {
        true => Finding::note(
            "position-cycle",
            format!(
                "β and γ are counted with a position cycle of {} ms: a trace shows the sum of β and the cycle, so that β of \
                 a control with another cycle is shorter or longer by the difference",
                Rounded(tsp)
            ),
        ),
        false => Finding::note(
            "unseen-delay",
            "VFFW, TFFW, β and γ are unchanged: no recording with feedforward shows them",
        ),
    });
    if let Some([low, high]) = fit.valley.filter(|_| found.feedforward.velocity.is_none()) {
        found.findings.push(Finding::note(
            "valley",
            format!(
                "VFFW and α compensate each other: from VFFW {:.4} with {:.3} ms to VFFW {:.4} with {:.3} ms the residual hardly \
                 changes; VFFW is set to {}",
                low.0,
                low.1 / MILLISECOND,
                high.0,
                high.1 / MILLISECOND,
                Rounded(fit.axis.feedforward.velocity)
            ),
        ));
    }
    let Some(with_given) = fit.rms_with_given_gain else { return };
    let (given, gain) = (before.position_loop.gain, fit.axis.position_loop.gain);
    let AxisUnits { error: unit, error_name: name, .. } = fit.axis.units();
    let what = format!(
        "position_loop.gain {:.3} of the initial machine leaves {:.1} {name} RMS, {:.3} leaves {:.1} {name}",
        given / POSITION_GAIN,
        with_given / unit,
        gain / POSITION_GAIN,
        fit.rms / unit
    );
    found.findings.push(if with_given < fit.rms {
        Finding::warning(
            "gain-does-not-fit",
            format!("{what}: the fitted gain is no better"),
            "check --trace-filter-hz and the periods; give the servo gain of the control by --set, with --refine without gain",
        )
    } else if (gain / given - 1.0).abs() > GAIN_CHANGE {
        Finding::warning(
            "gain-does-not-fit",
            what,
            "compare with the servo gain in the machine data of the control; --refine without gain keeps the initial one",
        )
    } else {
        Finding::note("gain-does-not-fit", what)
    });
}
