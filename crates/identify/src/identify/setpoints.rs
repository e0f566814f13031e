//! The grid of position setpoints under a recording.

use crate::recording::Span;

/// Part of the changes of PSEC that must fall on one phase for a staircase.
const STAIRCASE: f64 = 0.9;
/// Deviation of the ratio of two periods from an integer that is rounding.
const COMMENSURATE: f64 = 1e-4;

/// PSEC at the position instants of a span.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Setpoints {
    /// Time of the first instant from the span's start, s.
    pub first: f64,
    /// PSEC_k, m or rad.
    pub values: Vec<f64>,
}

impl Setpoints {
    /// Of a span that is sampled with `period`, on the grid of the position period `tsp` (both s).
    ///
    /// A recording that is finer than the grid shows PSEC as a staircase, whose steps are the instants. None where
    /// the period is no whole fraction of the grid's: the instants cannot be told then.
    pub fn of(span: &Span, period: f64, tsp: f64) -> Option<Self> {
        let psec = span.psec.as_ref().filter(|psec| psec.len() > 1)?;
        let stride = stride(period, tsp)?;
        let first = phase(psec, stride);
        let values = psec.iter().skip(first).step_by(stride).copied().collect();
        Some(Setpoints { first: first as f64 * period, values })
    }
}

/// Samples in a position period; none if that is no whole number.
pub(super) fn stride(period: f64, tsp: f64) -> Option<usize> {
    let (ratio, whole) = (tsp / period, (tsp / period).round());
    (whole >= 1.0 && (ratio - whole).abs() < COMMENSURATE * whole).then_some(whole as usize)
}

/// The sample, of the first `stride`, at which a staircase changes; 0 if it is none.
fn phase(psec: &[f64], stride: usize) -> usize {
    let mut changes = vec![0_usize; stride];
    for (i, pair) in psec.windows(2).enumerate() {
        if pair[0] != pair[1] {
            changes[(i + 1) % stride] += 1;
        }
    }
    let all: usize = changes.iter().sum();
    let most = changes.iter().enumerate().max_by_key(|(_, count)| **count);
    most.filter(|(_, count)| **count as f64 >= STAIRCASE * all as f64 && all > 0)
        .map_or(0, |(phase, _)| phase)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_of_a_staircase_are_its_instants() {
        // Steps of 6 samples, the first one after 2.
        let psec: Vec<f64> = (0..60).map(|i| f64::from((i + 4) / 6)).collect();
        let span = Span { psec: Some(psec), ..Span::default() };
        let found = Setpoints::of(&span, 1e-3, 6e-3).expect("a grid");
        assert!((found.first - 2e-3).abs() < 1e-12);
        assert_eq!(found.values[..4], [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn a_recording_beside_the_grid_has_no_instants() {
        let span = Span { psec: Some(vec![0.0, 10.0, 20.0]), ..Span::default() };
        assert_eq!([5e-3, 7e-3, 12e-3].map(|period| Setpoints::of(&span, period, 6e-3)), [None, None, None]);
    }
}
