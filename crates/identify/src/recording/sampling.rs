//! The sampling period, and whether it can be that of a drive.

use super::RecordingFault;
use super::order::{median, quantile};
use virtual_axes_core::config::Periods;
use virtual_axes_core::units::seconds;

/// Longest sampling period, s: ten samples in the shortest acceleration of 0.5 s.
const LONGEST_PERIOD: f64 = 0.05;
/// Shortest sampling period as a part of the current loop's: nothing in a drive is sampled faster.
const SHORTEST_PERIOD: f64 = 0.25;
/// Intervals within this part of their median are regular.
pub(super) const REGULAR: f64 = 0.3;
/// Part of regular intervals from which on their mean is the period.
const MOSTLY: f64 = 0.6;

/// Refuses what is not the period of a drive.
///
/// # Errors
/// [`RecordingFault::TimeUnit`] with the unit that it looks like.
pub(super) fn check_period(name: &str, period: f64, periods: &Periods) -> Result<(), RecordingFault> {
    let shortest = SHORTEST_PERIOD * seconds(periods.current);
    if period >= shortest && period <= LONGEST_PERIOD {
        return Ok(());
    }
    let fits = |factor: f64| (shortest..=LONGEST_PERIOD).contains(&(period * factor));
    let looks_like = if fits(1e-3) {
        "the time looks like ms read as s: time=COLUMN[ms]"
    } else if fits(1e-6) {
        "the time looks like us read as s: time=COLUMN[us]"
    } else if fits(1e-9) {
        "the time looks like ns read as s: time=COLUMN[ns]"
    } else if fits(1e3) {
        "the time looks like s read as ms: time=COLUMN[s]"
    } else if fits(1e6) || fits(1e9) {
        "the time looks like s read as a far smaller unit: time=COLUMN[s]"
    } else {
        ""
    };
    let looks_like = looks_like.to_owned();
    Err(RecordingFault::TimeUnit {
        name: name.to_owned(),
        period,
        shortest,
        longest: LONGEST_PERIOD,
        looks_like,
    })
}

/// First guess of the period, s.
pub(super) fn nominal(intervals: &[f64], coarse: bool) -> f64 {
    let mean = |kept: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = kept.fold((0.0, 0_usize), |(sum, count), d| (sum + d, count + 1));
        sum / count.max(1) as f64
    };
    if coarse {
        let mut steps: Vec<f64> = intervals.iter().copied().filter(|d| *d > 0.0).collect();
        let step = median(&mut steps);
        return mean(&mut intervals.iter().copied().filter(|d| *d <= 3.0 * step));
    }
    let mut sorted = intervals.to_vec();
    let middle = median(&mut sorted);
    let regular = |d: &f64| (d - middle).abs() <= REGULAR * middle;
    let count = intervals.iter().filter(|d| regular(d)).count();
    if count as f64 >= MOSTLY * intervals.len() as f64 {
        return mean(&mut intervals.iter().copied().filter(regular));
    }
    let (low, high) = (quantile(&mut sorted, 0.05), quantile(&mut sorted, 0.95));
    mean(&mut intervals.iter().copied().filter(|d| (low..=high).contains(d)))
}

/// Common step of a clock that repeats stamps, s.
pub(super) fn coarse_step(stamps: &[f64]) -> f64 {
    let mut steps: Vec<f64> = stamps.windows(2).map(|p| p[1] - p[0]).filter(|d| *d > 0.0).collect();
    median(&mut steps)
}
