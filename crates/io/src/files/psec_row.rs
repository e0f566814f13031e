//! Rows of a CSV file with setpoints, as written, and the time steps between them.

use super::lines::fields;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Row of a CSV file with setpoints.
#[derive(Debug, Clone, PartialEq)]
pub struct PsecRow {
    /// Source line, from 1.
    pub line: u64,
    /// Time, ns.
    pub time: Nanoseconds,
    /// Positions, m or rad, one value per column.
    pub positions: Vec<f64>,
    /// Value of the last digit of the time, s; infinite if unknown.
    pub time_resolution: f64,
    /// Value of the last digit of each position, m or rad; infinite if unknown.
    pub resolutions: Vec<f64>,
}

impl PsecRow {
    /// Creates a row with unknown digits.
    pub(super) fn new(line: u64, time: Nanoseconds, positions: &[f64]) -> Self {
        let positions = positions.to_vec();
        let resolutions = vec![f64::INFINITY; positions.len()];
        Self { line, time, positions, time_resolution: f64::INFINITY, resolutions }
    }

    /// Sets the values of the last digits; the time has all digits.
    pub(super) fn with_resolutions(mut self, resolutions: &[f64]) -> Self {
        (self.time_resolution, self.resolutions) = (1e-9, resolutions.to_vec());
        self
    }

    /// Sets the values of the last digits of `text`, the line of the row.
    pub(super) fn with_digits_of(mut self, text: &str) -> Self {
        let mut digits = fields(text).map(resolution);
        self.time_resolution = digits.next().unwrap_or(f64::INFINITY);
        self.resolutions.iter_mut().zip(digits).for_each(|(value, found)| *value = found);
        self
    }
}

/// Returns the value of the last digit of a valid number.
fn resolution(number: &str) -> f64 {
    let (mantissa, exponent) = number.split_once(['e', 'E']).unwrap_or((number, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let exponent = exponent.parse::<f64>().unwrap_or(0.0);
    10_f64.powf(exponent - decimals as f64)
}

/// Gap between two rows: a time step with motion that is far longer than the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeGap {
    /// Line of the row after the gap.
    pub line: u64,
    /// Time step, s.
    pub step: f64,
    /// Median of the time steps, s.
    pub median: f64,
}

/// Time steps between the rows read so far.
#[derive(Debug, Default)]
pub(super) struct TimeSteps {
    /// First steps, up to [`Self::MOST`].
    first: Vec<Nanoseconds>,
    /// Longest step with motion, and the line after it.
    longest: Nanoseconds,
    line: u64,
}

impl TimeSteps {
    /// Number of steps from which the median is computed.
    const MOST: usize = 1000;
    /// Ratio to the median above which a step is a gap.
    const GAP: i64 = 10;

    /// Adds the step to a row at `line`; `moves` is true if a position changes.
    pub fn add(&mut self, step: Nanoseconds, line: u64, moves: bool) {
        if self.first.len() < Self::MOST {
            self.first.push(step);
        }
        if step > self.longest && moves {
            (self.longest, self.line) = (step, line);
        }
    }

    /// Returns the longest step with motion, if it is far longer than the others.
    pub fn gap(&self) -> Option<TimeGap> {
        let mut first = self.first.clone();
        first.sort_unstable();
        let median = *first.get(first.len() / 2)?;
        (self.longest > Self::GAP * median).then(|| TimeGap {
            line: self.line,
            step: seconds(self.longest),
            median: seconds(median),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_digit_has_its_value() {
        for (number, places) in [("1", 0), ("-0.25", 2), ("2.50e-3", 5), ("1E2", -2), ("+3.", 0), (".125", 3)]
        {
            assert_eq!(resolution(number), 10f64.powi(-places), "{number}");
        }
    }
}
