//! Current that a control can log, by the ripple of the simulated loop, and the plant by it.

use super::closed_loop::CurrentHistory;
use super::current_logging::{CurrentLoggings, LoggedInstant};
use super::experiment::CurrentLogging;
use super::feedforward_mode::FeedforwardMode;
use super::loop_parameter::LoopParameter;
use super::loop_values::LoopFit;
use super::moving_data::CurrentRipple;
use super::plant_regression::fit_plant;
use super::setpoints::HELD;
use super::trace_experiments::trace_experiments;
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::seconds;

/// Largest number of instants of a position cycle that are compared; probability of the first one, and of the others together.
const PHASES: usize = 48;
const AT_SAMPLE: f64 = 1.0 / 3.0;
const AT_OTHERS: f64 = 1.0 / 3.0;
/// Standard errors by which β is moved.
const BETA_SHIFTS: [i64; 5] = [-2, -1, 0, 1, 2];
/// Bounds of the relative standard error of a simulated ripple, which is that of the bandwidth of the velocity loop.
const LEAST_RIPPLE_ERROR: f64 = 0.05;
const LARGEST_RIPPLE_ERROR: f64 = 0.5;
/// That of a loop that has not converged.
const USUAL_RIPPLE_ERROR: f64 = 0.1;

/// Returns the ways in which the control can log the current: a mean over a position cycle, or an instant, most probably
/// that of the sample. The position cycles are those that the positions permit.
pub(super) fn possible_loggings(
    recordings: &[(&Signals, FeedforwardMode)],
    fit: &LoopFit,
) -> CurrentLoggings {
    let others = fit.alternatives.iter().map(|(axis, periods)| (axis, periods));
    let cycles: Vec<(&AxisConfig, &Periods)> =
        std::iter::once((&fit.exact_axis, &fit.periods)).chain(others).collect();
    let of = |parameter: LoopParameter| fit.values.iter().find(|value| value.parameter == parameter);
    // The velocity feedforward steps once β has passed, within a position cycle.
    let tsv = seconds(fit.periods.velocity);
    let uncertain = of(LoopParameter::Beta).map_or(0.0, |beta| beta.error.hypot(tsv));
    let error = of(LoopParameter::Bandwidth)
        .map_or(LARGEST_RIPPLE_ERROR, |bandwidth| bandwidth.error / bandwidth.value);
    CurrentLoggings {
        instants: logged_instants(recordings, &cycles, uncertain),
        error: error.clamp(LEAST_RIPPLE_ERROR, LARGEST_RIPPLE_ERROR),
        is_of_identified_loop: true,
    }
}

/// Returns `axis` with the plant that the current shows if the loop causes the ripple of the simulated `moved` axis, and the
/// share of the current that remains, 1 − R².
pub(super) fn with_plant_of_loop(
    recordings: &[(&Signals, FeedforwardMode)],
    axis: &AxisConfig,
    (moved, periods): (&AxisConfig, &Periods),
) -> Option<(AxisConfig, f64)> {
    let loggings = CurrentLoggings {
        instants: logged_instants(recordings, &[(moved, periods)], 0.0),
        error: USUAL_RIPPLE_ERROR,
        is_of_identified_loop: false,
    };
    let signals: Vec<&Signals> = recordings.iter().map(|(signals, _)| *signals).collect();
    let plant = fit_plant(&signals, axis, Some(&loggings))?;
    let mut found = axis.clone();
    plant.apply(&mut found);
    Some((found, 1.0 - plant.r_squared))
}

/// Returns the instants at which a control can log the current, with the ripple of the simulated axes, the identified one first,
/// whose β is `uncertain` s.
fn logged_instants(
    recordings: &[(&Signals, FeedforwardMode)],
    cycles: &[(&AxisConfig, &Periods)],
    uncertain: f64,
) -> Vec<LoggedInstant> {
    let shifts: &[i64] = if uncertain > 0.0 { &BETA_SHIFTS } else { &[0] };
    let tsv = cycles.first().map_or(0.0, |(_, periods)| seconds(periods.velocity));
    // β acts at velocity cycles only.
    let step = ((uncertain / tsv).round() as i64).max(1);
    let probability = |shift: i64| match shift {
        0 => 1.0,
        _ => (-0.5 * ((shift * step) as f64 * tsv / uncertain).powi(2)).exp(),
    };
    let all: f64 = shifts.iter().map(|shift| probability(*shift)).sum();
    let mut instants = Vec::new();
    for (cycle, (axis, periods)) in cycles.iter().enumerate() {
        for shift in shifts {
            let mut shifted = (*axis).clone();
            shifted.delays.beta = (shifted.delays.beta + shift * step * periods.velocity).max(0);
            let ripples = simulated_ripples(recordings, (&shifted, periods));
            let later = ripples.len().saturating_sub(1).max(1) as f64;
            for (offset, ripple) in ripples {
                let share = if offset == 0.0 { AT_SAMPLE } else { AT_OTHERS / later };
                let prior = share * probability(*shift) / (all * cycles.len() as f64);
                let (inertia, is_identified) = (axis.motor.inertia, cycle == 0 && *shift == 0);
                instants.push(LoggedInstant { offset, prior, is_identified, ripple, inertia });
            }
        }
    }
    instants
}

/// Returns true if the samples of a recording are interpolated between those of the renewals of its signals.
fn is_between_renewals(signals: &Signals) -> bool {
    signals.renewal.is_some_and(|renewal| renewal < HELD * signals.period)
}

/// Returns the ripple of the current at the samples for each instant at which it can be logged, with its time behind the
/// sample, s: the simulated current of that instant minus the mean over a position cycle around the sample.
fn simulated_ripples(
    recordings: &[(&Signals, FeedforwardMode)],
    (axis, periods): (&AxisConfig, &Periods),
) -> Vec<(f64, CurrentRipple)> {
    let tsp = seconds(periods.position);
    // Samples within position cycles have their own renewal.
    let renewal = recordings.iter().map(|(signals, _)| signals.period).fold(tsp, f64::min);
    let unknown = |(signals, _): &(&Signals, FeedforwardMode)| -> Vec<Vec<f64>> {
        signals.spans.iter().map(|span| vec![f64::NAN; span.position.len()]).collect()
    };
    let phases = ((renewal / seconds(periods.current)).round() as usize).clamp(1, PHASES);
    let mut found: Vec<(f64, CurrentRipple)> = (0..phases)
        .map(|k| (k as f64 / phases as f64 * renewal, recordings.iter().map(unknown).collect()))
        .collect();
    for (k, (signals, mode)) in recordings.iter().enumerate() {
        for experiment in trace_experiments(signals, k, periods, (*mode, 0.0, CurrentLogging::MEAN)) {
            let Ok(history) = CurrentHistory::new(axis, periods, &experiment) else { continue };
            // Samples between the renewals are interpolated from samples at the beginnings of cycles.
            let is_interpolated = is_between_renewals(signals);
            let times = (0..experiment.position.len()).map(|i| {
                let time = experiment.first + i as f64 * experiment.period;
                if is_interpolated { (time / tsp).round() * tsp } else { time }
            });
            let mean = history.logged_at(times.clone(), CurrentLogging::MEAN);
            for (offset, ripple) in &mut found {
                let logging = CurrentLogging { offset: *offset, ..CurrentLogging::INSTANT };
                let at = history.logged_at(times.clone(), logging);
                let to = ripple[k][experiment.span].iter_mut().skip(experiment.sample);
                to.zip(at.iter().zip(&mean)).for_each(|(to, (at, mean))| *to = at - mean);
            }
        }
    }
    found
}
