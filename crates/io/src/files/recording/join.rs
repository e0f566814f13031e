//! Resampling of the values of one topic at the stamps of another.

use super::series::Row;
use virtual_axes_core::units::{MILLISECOND, Nanoseconds, seconds};
use virtual_axes_identify::recording::Finding;

/// Source of message times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeSource {
    /// Field `header.stamp`.
    Stamp,
    /// Log time of the recorder.
    Log,
}

impl TimeSource {
    /// Returns the time of a row, ns.
    pub fn time_of(self, row: &Row) -> Nanoseconds {
        match self {
            TimeSource::Stamp => row.stamp,
            TimeSource::Log => row.log_time,
        }
    }
}

/// Minimum difference of stamps that is reported, as a fraction of the period.
const REPORTED_DIFFERENCE: f64 = 0.01;

/// Stamps at which values are resampled.
#[derive(Debug)]
pub(super) struct TargetStamps {
    stamps: Vec<Nanoseconds>,
    /// Source of the stamps, also of rows to resample.
    source: TimeSource,
    /// Median interval between stamps, ns.
    period: Nanoseconds,
}

impl TargetStamps {
    pub fn new(stamps: Vec<Nanoseconds>, source: TimeSource) -> Self {
        let mut steps: Vec<Nanoseconds> =
            stamps.windows(2).map(|pair| pair[1].saturating_sub(pair[0]).saturating_abs()).collect();
        let middle = steps.len() / 2;
        let period = if steps.is_empty() { 0 } else { *steps.select_nth_unstable(middle).1 };
        TargetStamps { stamps, source, period }
    }

    /// Returns the values at `index` of the nearest of `rows` for each stamp; NaN if the nearest row is half a period or
    /// more away. `what` names file and topic in findings.
    pub fn nearest_values(
        &self,
        rows: &[Row],
        index: usize,
        what: &str,
        findings: &mut Vec<Finding>,
    ) -> Vec<f64> {
        let mut others: Vec<(Nanoseconds, f64)> =
            rows.iter().map(|row| (self.source.time_of(row), row.values[index])).collect();
        others.sort_by_key(|(time, _)| *time);
        let mut missing = 0_usize;
        let mut farthest = 0;
        let mut at = |stamp: Nanoseconds| {
            let after = others.partition_point(|(time, _)| *time < stamp);
            let near = others[after.saturating_sub(1)..].iter().take(2);
            let distance = |time: Nanoseconds| time.saturating_sub(stamp).saturating_abs();
            let nearest = near.min_by_key(|(time, _)| distance(*time));
            match nearest {
                Some((time, value)) if distance(*time) == 0 || distance(*time) < self.period / 2 => {
                    farthest = farthest.max(distance(*time));
                    *value
                }
                _ => {
                    missing += 1;
                    f64::NAN
                }
            }
        };
        let values = self.stamps.iter().map(|stamp| at(*stamp)).collect();
        if missing > 0 {
            findings.push(Finding::warning(
                "unmatched",
                format!("{what}: no value at {missing} of {} stamps of the positions", self.stamps.len()),
                "record every message of both topics with equal stamps",
            ));
        }
        if farthest as f64 > REPORTED_DIFFERENCE * self.period as f64 {
            findings.push(Finding::note(
                "stamps-differ",
                format!(
                    "{what}: stamps differ from those of the positions by up to {:.3} ms: the nearest value is used",
                    seconds(farthest) / MILLISECOND
                ),
            ));
        }
        values
    }
}
