//! Position-cycle grid of recorded setpoints.

use std::f64::consts::TAU;

use crate::recording::{SignalSpan, Signals};

/// Share of the travel of PSEC within position cycles up to which PSEC is zero-order-held, and relative to that of a motion
/// without hold.
const WITHIN: f64 = 0.1;
const WITHIN_MOTION: f64 = 0.2;
/// Fewest repeated setpoints of a motion that show a hold.
const FEWEST_REPEATED: f64 = 3.0;
/// Sampling period relative to the position cycle below which the setpoints of the cycles are among the samples.
pub(super) const HELD: f64 = 0.9;
/// Step of the position cycles that are compared, s, and number of phases of each.
const CYCLE_STEP: f64 = 1e-3;
const PHASES: usize = 48;
/// Longest position cycle of a control, s.
const LONGEST_CYCLE: f64 = 0.02;
/// Tolerance of an integer ratio of two periods.
const COMMENSURATE: f64 = 1e-4;

/// PSEC at the position cycles of a span.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SetpointGrid {
    /// Time of the first position cycle from the start of the span, s.
    pub first: f64,
    /// PSEC of each position cycle, m or rad.
    pub values: Vec<f64>,
}

impl SetpointGrid {
    /// Extracts the position cycles of a span sampled with `period`; `tsp` is the position cycle (both s).
    ///
    /// A recording finer than the grid shows zero-order-held setpoints whose steps are the position cycles.
    /// Returns none if `period` is no integer fraction of `tsp` and the recording does not show each setpoint.
    pub fn of(span: &SignalSpan, period: f64, tsp: f64) -> Option<Self> {
        let psec = span.psec.as_ref().filter(|psec| psec.len() > 1)?;
        let Some(stride) = stride(period, tsp) else { return Self::between_samples(psec, period, tsp) };
        let first = phase(psec, stride);
        let values = psec.iter().skip(first).step_by(stride).copied().collect();
        Some(SetpointGrid { first: first as f64 * period, values })
    }

    /// Extracts cycles that begin between samples: each is seen by at least one sample.
    fn between_samples(psec: &[f64], period: f64, tsp: f64) -> Option<Self> {
        let phase = staircase(psec, period, tsp)?;
        let cycle = |i: usize| cycle_of(i, period, tsp, phase);
        let first = if phase > 0.0 { 1 } else { 0 };
        let mut values: Vec<f64> = Vec::new();
        for (i, value) in psec.iter().enumerate().filter(|(i, _)| cycle(*i) >= first) {
            match values.get_mut(cycle(i) - first) {
                Some(known) => *known = *value,
                None => values.push(*value),
            }
        }
        Some(SetpointGrid { first: first as f64 * tsp - phase, values })
    }
}

/// Returns the position cycle in which sample `i` lies, if the first sample is `phase` s behind the beginning of cycle 0.
fn cycle_of(i: usize, period: f64, tsp: f64, phase: f64) -> usize {
    ((i as f64 * period + phase) / tsp + 1e-9) as usize
}

/// Returns the time of the first sample behind the beginning of a cycle, s, if setpoints are held for cycles of `tsp` s,
/// longer than the sampling period.
fn staircase(psec: &[f64], period: f64, tsp: f64) -> Option<f64> {
    if period >= HELD * tsp {
        return None;
    }
    let steps: Vec<f64> = psec.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let travel: f64 = steps.iter().sum();
    // A motion shows the hold by the samples that repeat a setpoint.
    let moving = steps.iter().filter(|step| **step > 0.0).count() as f64;
    if moving * (tsp / period - 1.0) < FEWEST_REPEATED {
        return None;
    }
    let phases: Vec<f64> = (0..PHASES).map(|k| k as f64 / PHASES as f64 * tsp).collect();
    let within = |phase: &f64| {
        let cycle = |i: usize| cycle_of(i, period, tsp, *phase);
        let held = steps.iter().enumerate().filter(|(i, _)| cycle(*i) == cycle(i + 1));
        held.map(|(_, step)| step).sum::<f64>() / travel
    };
    let shares: Vec<f64> = phases.iter().map(within).collect();
    let least = shares.iter().copied().fold(f64::INFINITY, f64::min);
    let allowed = WITHIN.min(WITHIN_MOTION * (1.0 - period / tsp));
    // Some phases explain the samples alike: the middle of them, on the circle, is taken.
    let alike = phases.iter().zip(&shares).filter(|(_, share)| **share <= least + 1e-6);
    let (sine, cosine) = alike.fold((0.0, 0.0), |(sine, cosine), (phase, _)| {
        let angle = TAU * phase / tsp;
        (sine + angle.sin(), cosine + angle.cos())
    });
    (least <= allowed).then(|| sine.atan2(cosine).rem_euclid(TAU) / TAU * tsp)
}

/// Returns the number of samples per position cycle; none if it is not an integer.
pub(super) fn stride(period: f64, tsp: f64) -> Option<usize> {
    let (ratio, whole) = (tsp / period, (tsp / period).round());
    (whole >= 1.0 && (ratio - whole).abs() < COMMENSURATE * whole).then_some(whole as usize)
}

/// Returns the longest position cycle, s, that the recorded setpoints permit, and true if it is certain: setpoints that
/// are held for several samples show their cycle, others change at least with each sample.
pub(super) fn longest_cycle(signals: &Signals) -> (f64, bool) {
    let holds = |tsp: f64| {
        let mut is_moving = false;
        let all = signals.spans.iter().filter_map(|span| span.psec.as_ref()).all(|psec| {
            let moves = psec.windows(2).any(|pair| pair[0] != pair[1]);
            is_moving |= moves;
            !moves
                || match stride(signals.period, tsp) {
                    Some(stride) => held_phase(psec, stride).1.is_some_and(|share| share >= 1.0 - WITHIN),
                    None => staircase(psec, signals.period, tsp).is_some(),
                }
        });
        all && is_moving
    };
    let most = ((LONGEST_CYCLE / signals.period) as usize).max(1);
    let multiples = (2..=most).map(|stride| stride as f64 * signals.period);
    let steps = (1..=(LONGEST_CYCLE / CYCLE_STEP) as usize).map(|k| k as f64 * CYCLE_STEP);
    let mut cycles: Vec<f64> = multiples.chain(steps.filter(|tsp| signals.period < HELD * tsp)).collect();
    cycles.sort_by(f64::total_cmp);
    let found = cycles.into_iter().rev().find(|tsp| holds(*tsp));
    (found.unwrap_or(signals.period), found.is_some())
}

/// Returns the sample, among the first `stride`, at which zero-order-held setpoints change; 0 without a hold. Steps count
/// by their size, so that noise does not hide the hold.
fn phase(psec: &[f64], stride: usize) -> usize {
    let (phase, share) = held_phase(psec, stride);
    if share.is_some_and(|share| share >= 1.0 - WITHIN) { phase } else { 0 }
}

/// Returns the sample, among the first `stride`, at which most of the travel happens, and its share; none without travel.
fn held_phase(psec: &[f64], stride: usize) -> (usize, Option<f64>) {
    let mut travel = vec![0.0; stride];
    for (i, pair) in psec.windows(2).enumerate() {
        travel[(i + 1) % stride] += (pair[1] - pair[0]).abs();
    }
    let all: f64 = travel.iter().sum();
    let most = travel.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    most.map_or((0, None), |(phase, part)| (phase, (all > 0.0).then(|| part / all)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_zero_order_held_setpoints_are_the_position_cycles() {
        // Steps of 6 samples, the first one after 2.
        let psec: Vec<f64> = (0..60).map(|i| f64::from((i + 4) / 6)).collect();
        let span = SignalSpan { psec: Some(psec), ..SignalSpan::default() };
        let found = SetpointGrid::of(&span, 1e-3, 6e-3).expect("a grid");
        assert!((found.first - 2e-3).abs() < 1e-12);
        assert_eq!(found.values[..4], [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn noise_does_not_hide_the_hold_of_setpoints() {
        let noise = |i: i32| 1e-3 * f64::from(i * 7 % 11);
        let psec: Vec<f64> = (0..60).map(|i| f64::from((i + 4) / 6) + noise(i)).collect();
        let span = SignalSpan { psec: Some(psec), ..SignalSpan::default() };
        let found = SetpointGrid::of(&span, 1e-3, 6e-3).expect("a grid");
        assert!((found.first - 2e-3).abs() < 1e-12);
    }

    #[test]
    fn the_longest_cycle_is_that_of_held_setpoints_or_the_sampling_period() {
        let signals = |psec: Vec<f64>| Signals {
            name: String::new(),
            period: 1e-3,
            renewal: None,
            cutoff: 100.0,
            trace_filter: None,
            torque_constant: None,
            current_lag: 0.0,
            spans: vec![SignalSpan { psec: Some(psec), ..SignalSpan::default() }],
        };
        for held in [1, 2, 6] {
            let psec = (0..600).map(|i| (f64::from((i + 4) / held * held) * 0.01).sin()).collect();
            let (cycle, is_certain) = longest_cycle(&signals(psec));
            assert!((cycle - 1e-3 * f64::from(held)).abs() < 1e-12, "{held}: {cycle}");
            assert_eq!(is_certain, held > 1);
        }
        assert_eq!(longest_cycle(&signals(vec![0.0; 99])), (1e-3, false));
    }

    #[test]
    fn held_setpoints_between_the_samples_show_their_cycle() {
        // Samples every 4 ms, 1 ms behind the beginning of a cycle of 6 ms: two cycles have one sample, the third has two.
        let setpoint = |cycle: f64| (0.05 * cycle).sin();
        let psec: Vec<f64> =
            (0..300).map(|i| setpoint(((f64::from(i) * 4e-3 + 1e-3) / 6e-3).floor())).collect();
        let span = SignalSpan { psec: Some(psec.clone()), ..SignalSpan::default() };
        let found = SetpointGrid::of(&span, 4e-3, 6e-3).expect("a grid");
        assert!((found.first - 5e-3).abs() <= 1.1e-3, "{}", found.first);
        for (k, value) in found.values.iter().enumerate() {
            assert_eq!(*value, setpoint(1.0 + k as f64));
        }
        let signals = Signals {
            name: String::new(),
            period: 4e-3,
            renewal: None,
            cutoff: 100.0,
            trace_filter: None,
            torque_constant: None,
            current_lag: 0.0,
            spans: vec![span],
        };
        let (cycle, is_certain) = longest_cycle(&signals);
        assert!(is_certain && (cycle - 6e-3).abs() < 1e-12, "{cycle}");
        let moving = (0..300).map(|i| setpoint(f64::from(i) * 4e-3 / 6e-3)).collect();
        let spans = vec![SignalSpan { psec: Some(moving), ..SignalSpan::default() }];
        assert_eq!(longest_cycle(&Signals { spans, ..signals }), (4e-3, false));
    }

    #[test]
    fn a_recording_off_the_grid_has_no_position_cycles() {
        let span = SignalSpan { psec: Some(vec![0.0, 10.0, 20.0]), ..SignalSpan::default() };
        assert_eq!(
            [5e-3, 7e-3, 12e-3].map(|period| SetpointGrid::of(&span, period, 6e-3)),
            [None, None, None]
        );
    }
}
