//! Times and axis positions of one position cycle during evaluation.

use crate::config::Periods;
use crate::machine::Machine;
use crate::path::Program;
use crate::units::{Nanoseconds, seconds};

/// Search range beyond the current setpoint, m or rad: an axis that overshoots a corner is closest to a
/// later part of the path.
const SEARCH_AHEAD: f64 = 5e-3;

/// Times of the ticks of a position cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct TickTimes {
    /// Time of the first tick, ns.
    start: Nanoseconds,
    /// Tsi, ns.
    tick: Nanoseconds,
    count: usize,
}

impl TickTimes {
    /// Returns the number of ticks.
    pub fn count(self) -> usize {
        self.count
    }

    /// Returns the time of a tick, or of the first one after the cycle, s.
    pub fn at(self, tick: usize) -> f64 {
        seconds(self.start + tick as Nanoseconds * self.tick)
    }

    /// Returns the time of the last tick, s.
    pub fn last(self) -> f64 {
        self.at(self.count.saturating_sub(1))
    }
}

/// A position cycle; simultaneously simulated variants share its times and setpoints.
#[derive(Debug)]
pub(super) struct PositionCycle {
    /// True while setpoints are being executed.
    pub is_moving: bool,
    pub times: TickTimes,
    /// Progress along the path up to which the nearest point is searched at each tick; `None` until
    /// computed.
    until: Vec<Option<f64>>,
    /// Positions at its ticks, axis by axis, m or rad.
    pub positions: Vec<f64>,
}

impl PositionCycle {
    pub fn new(periods: Periods, axes: usize) -> Self {
        let ticks = periods.ticks_per_position() as usize;
        PositionCycle {
            is_moving: false,
            times: TickTimes { start: 0, tick: periods.current, count: ticks },
            until: vec![None; ticks],
            positions: vec![0.0; ticks * axes],
        }
    }

    pub fn ticks(&self) -> usize {
        self.times.count()
    }

    /// Starts the cycle at `time`, ns.
    pub fn begin(&mut self, time: Nanoseconds, is_moving: bool) {
        self.is_moving = is_moving;
        self.times.start = time;
        self.until.fill(None);
    }

    /// Stores the positions of axis `at` of `machine` for the axis `index`.
    pub fn store_positions(&mut self, index: usize, machine: &Machine, at: usize) {
        let ticks = self.ticks();
        machine.positions(at, &mut self.positions[index * ticks..][..ticks]);
    }

    /// Returns the progress up to which the nearest point is searched at a tick.
    pub fn until(&mut self, program: &Program, tick: usize) -> f64 {
        let time = self.times.at(tick);
        *self.until[tick].get_or_insert_with(|| program.progress(time) + SEARCH_AHEAD)
    }
}
