//! Preview of a streamed joint: a FIFO buffer of setpoints that a predictive controller reads in advance.

use super::limits::SPEED_TOLERANCE;
use super::spline::KinematicState;
use crate::units::{Nanoseconds, seconds};
use std::collections::VecDeque;

/// FIFO buffer of streamed setpoints that are not commanded yet, the next one first.
///
/// Its length is the stream delay in position cycles. The setpoint that enters at each position cycle
/// approaches the newest accepted setpoint by at most `reach` = Vmax·Tsp.
#[derive(Debug, Default, Clone)]
pub(super) struct PreviewBuffer {
    buffer: VecDeque<f64>,
    /// Last entry before the newest setpoint was accepted, m or rad.
    from: f64,
    /// Position cycles since the newest setpoint was accepted.
    since: i64,
}

impl PreviewBuffer {
    /// Creates an empty buffer at rest at `position`, m or rad.
    pub fn new(position: f64) -> Self {
        Self { from: position, ..Self::default() }
    }

    /// Returns the last entry, m or rad; `commanded` if the buffer is empty.
    pub fn last_entry(&self, commanded: f64) -> f64 {
        self.buffer.back().copied().unwrap_or(commanded)
    }

    /// Starts the approach to another setpoint from the last entry.
    pub fn retarget(&mut self, commanded: f64) {
        (self.from, self.since) = (self.last_entry(commanded), 0);
    }

    /// Advances by one position cycle towards `newest`, m or rad.
    ///
    /// Returns the state to command and true if `newest` has entered the buffer. `commanded` is the
    /// position setpoint of the previous instant.
    pub fn next(
        &mut self,
        newest: f64,
        reach: f64,
        commanded: f64,
        period: Nanoseconds,
    ) -> (KinematicState, bool) {
        self.since = self.since.saturating_add(1);
        let entry = approach(self.from, newest, self.since, reach);
        let position = self.buffer.pop_front().map_or(entry, |position| {
            self.buffer.push_back(entry);
            position
        });
        (state_between(commanded, position, period), entry == newest)
    }

    /// Returns the state commanded `instants` after the next instant if no further setpoint is accepted.
    pub fn state_after(
        &self,
        instants: i64,
        newest: f64,
        reach: f64,
        commanded: f64,
        period: Nanoseconds,
    ) -> KinematicState {
        let length = self.buffer.len() as i64;
        let entry = |index: i64| match usize::try_from(index).ok().and_then(|i| self.buffer.get(i)) {
            Some(&position) => position,
            None => {
                let since = self.since.saturating_add((index - length).saturating_add(1));
                approach(self.from, newest, since, reach)
            }
        };
        let instants = instants.max(0);
        let before = if instants == 0 { commanded } else { entry(instants - 1) };
        state_between(before, entry(instants), period)
    }

    /// Replaces all entries by `position`, m or rad.
    pub fn flush(&mut self, position: f64) {
        self.buffer.iter_mut().for_each(|entry| *entry = position);
        (self.from, self.since) = (position, 0);
    }

    /// Changes the length; new entries are `position`, m or rad.
    pub fn resize(&mut self, length: usize, position: f64) {
        self.buffer.resize(length, position);
    }

    /// Allocates memory for `length` entries.
    pub fn reserve(&mut self, length: usize) {
        let additional = length.saturating_sub(self.buffer.len());
        self.buffer.reserve(additional);
    }
}

/// Returns the entry `instants` after setpoint `newest` was accepted: `newest`, or a position on the
/// way from `from` to `newest` at `reach` (m or rad) per position cycle.
fn approach(from: f64, newest: f64, instants: i64, reach: f64) -> f64 {
    let distance = newest - from;
    let instants = instants as f64;
    if distance.abs() <= reach * (instants + SPEED_TOLERANCE) {
        newest
    } else {
        from + (reach * instants).copysign(distance)
    }
}

/// Returns the state at `position`, one position cycle after `before`.
fn state_between(before: f64, position: f64, period: Nanoseconds) -> KinematicState {
    KinematicState { position, velocity: (position - before) / seconds(period), acceleration: 0.0 }
}
