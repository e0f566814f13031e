//! Time steps between the rows of a CSV file with setpoints.

use virtual_axes_core::units::{Nanoseconds, seconds};

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
