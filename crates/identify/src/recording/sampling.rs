//! Estimation and plausibility check of the sampling period.

use super::ConditioningError;
use virtual_axes_core::config::Periods;
use virtual_axes_core::statistics::{median, quantile};
use virtual_axes_core::units::{Rounded, seconds};

/// Longest sampling period, s: ten samples within the shortest acceleration of 0.5 s.
const LONGEST_PERIOD: f64 = 0.05;
/// Sampling period, s, of slow recordings in seconds: in ms the samples of a drive are rarely that close.
const SLOW: f64 = 0.5;
/// Shortest sampling period relative to the current period; drives are not sampled faster.
const SHORTEST_PERIOD: f64 = 0.25;
/// Relative deviation from the median up to which an interval is regular.
pub(super) const REGULAR: f64 = 0.3;
/// Share of regular intervals above which their mean is the period.
const MOSTLY: f64 = 0.6;

/// Rejects a sampling period that is not plausible for a drive.
///
/// # Errors
/// [`ConditioningError`] with the likely time unit.
pub(super) fn check_period(name: &str, period: f64, periods: &Periods) -> Result<(), ConditioningError> {
    let shortest = SHORTEST_PERIOD * seconds(periods.current);
    if period >= shortest && period <= LONGEST_PERIOD {
        return Ok(());
    }
    let fits = |factor: f64| (shortest..=LONGEST_PERIOD).contains(&(period * factor));
    let looks_like = if period > LONGEST_PERIOD && period < SLOW {
        "record faster, or give --column time=COLUMN[ms] if the time is in ms"
    } else if fits(1e-3) {
        "the time is likely in ms; give --column time=COLUMN[ms]"
    } else if fits(1e-6) {
        "the time is likely in us; give --column time=COLUMN[us]"
    } else if fits(1e-9) {
        "the time is likely in ns; give --column time=COLUMN[ns]"
    } else if fits(1e3) || fits(1e6) || fits(1e9) {
        "the time is likely in s; give --column time=COLUMN[s]"
    } else {
        ""
    };
    let reason = format!(
        "sampling period {} s, must be {} … {} s",
        Rounded(period),
        Rounded(shortest),
        Rounded(LONGEST_PERIOD)
    );
    Err(ConditioningError::new(name, reason).with_cause(looks_like))
}

/// Returns a first estimate of the sampling period, s.
pub(super) fn estimate_period(intervals: &[f64], coarse: bool) -> f64 {
    let mean = |kept: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = kept.fold((0.0, 0_usize), |(sum, count), d| (sum + d, count + 1));
        sum / count.max(1) as f64
    };
    if coarse {
        let mut steps: Vec<f64> = intervals.iter().copied().filter(|d| *d > 0.0).collect();
        let step = median(&mut steps).unwrap_or(0.0);
        return mean(&mut intervals.iter().copied().filter(|d| *d <= 3.0 * step));
    }
    let mut sorted = intervals.to_vec();
    let middle = median(&mut sorted).unwrap_or(0.0);
    let regular = |d: &f64| (d - middle).abs() <= REGULAR * middle;
    let count = intervals.iter().filter(|d| regular(d)).count();
    if count as f64 >= MOSTLY * intervals.len() as f64 {
        return mean(&mut intervals.iter().copied().filter(regular));
    }
    let (low, high) =
        (quantile(&mut sorted, 0.05).unwrap_or(0.0), quantile(&mut sorted, 0.95).unwrap_or(0.0));
    mean(&mut intervals.iter().copied().filter(|d| (low..=high).contains(d)))
}

/// Returns the median step of a clock that repeats stamps, s.
pub(super) fn coarse_step(stamps: &[f64]) -> f64 {
    let mut steps: Vec<f64> = stamps.windows(2).map(|p| p[1] - p[0]).filter(|d| *d > 0.0).collect();
    median(&mut steps).unwrap_or(0.0)
}
