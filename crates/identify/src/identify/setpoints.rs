//! Position-cycle grid of recorded setpoints.

use crate::recording::{SignalSpan, Signals};

/// Share of the travel of PSEC on one phase above which PSEC is zero-order-held.
const STAIRCASE: f64 = 0.9;
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
    /// Returns none if `period` is not an integer fraction of `tsp`.
    pub fn of(span: &SignalSpan, period: f64, tsp: f64) -> Option<Self> {
        let psec = span.psec.as_ref().filter(|psec| psec.len() > 1)?;
        let stride = stride(period, tsp)?;
        let first = phase(psec, stride);
        let values = psec.iter().skip(first).step_by(stride).copied().collect();
        Some(SetpointGrid { first: first as f64 * period, values })
    }
}

/// Returns the number of samples per position cycle; none if it is not an integer.
pub(super) fn stride(period: f64, tsp: f64) -> Option<usize> {
    let (ratio, whole) = (tsp / period, (tsp / period).round());
    (whole >= 1.0 && (ratio - whole).abs() < COMMENSURATE * whole).then_some(whole as usize)
}

/// Returns the longest position cycle, s, that the recorded setpoints permit, and true if it is certain: setpoints that
/// are held for several samples show their cycle, others change at least with each sample.
pub(super) fn longest_cycle(signals: &Signals) -> (f64, bool) {
    let holds = |stride: usize| {
        let mut is_moving = false;
        let all = signals.spans.iter().filter_map(|span| span.psec.as_ref()).all(|psec| {
            let (_, share) = held_phase(psec, stride);
            is_moving |= share.is_some();
            share.is_none_or(|share| share >= STAIRCASE)
        });
        all && is_moving
    };
    let most = ((LONGEST_CYCLE / signals.period) as usize).max(1);
    let stride = (2..=most).rev().find(|stride| holds(*stride));
    (stride.unwrap_or(1) as f64 * signals.period, stride.is_some())
}

/// Returns the sample, among the first `stride`, at which zero-order-held setpoints change; 0 without a hold. Steps count
/// by their size, so that noise does not hide the hold.
fn phase(psec: &[f64], stride: usize) -> usize {
    let (phase, share) = held_phase(psec, stride);
    if share.is_some_and(|share| share >= STAIRCASE) { phase } else { 0 }
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
    fn a_recording_off_the_grid_has_no_position_cycles() {
        let span = SignalSpan { psec: Some(vec![0.0, 10.0, 20.0]), ..SignalSpan::default() };
        assert_eq!(
            [5e-3, 7e-3, 12e-3].map(|period| SetpointGrid::of(&span, period, 6e-3)),
            [None, None, None]
        );
    }
}
