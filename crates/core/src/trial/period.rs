//! A position period as it is looked at: its instants, where the axes were, what was commanded.

use crate::config::Periods;
use crate::machine::Machine;
use crate::path::Program;
use crate::units::{Nanoseconds, seconds};

/// How far ahead of the setpoint the nearest point of a path is sought, m or rad: an axis that
/// overshoots a corner is nearest to what comes behind it.
const AHEAD: f64 = 5e-3;

/// A position period; variants that are run together share its instants and what is commanded at them.
#[derive(Debug)]
pub(super) struct Period {
    periods: Periods,
    /// Whether setpoints are under way.
    pub moving: bool,
    /// Its ticks, s.
    pub times: Vec<f64>,
    /// The first tick of the next one, s.
    pub end: f64,
    /// At its ticks, progress along the path up to which the nearest point is sought; none where nobody has
    /// asked yet.
    until: Vec<Option<f64>>,
    /// Positions at its ticks, one axis behind the other, m or rad.
    pub positions: Vec<f64>,
}

impl Period {
    pub fn new(periods: Periods, axes: usize) -> Self {
        let ticks = periods.ticks_per_position() as usize;
        Period {
            periods,
            moving: false,
            times: vec![0.0; ticks],
            end: 0.0,
            until: vec![None; ticks],
            positions: vec![0.0; ticks * axes],
        }
    }

    pub fn ticks(&self) -> usize {
        self.times.len()
    }

    /// The period that begins at `time` ns.
    pub fn begin(&mut self, time: Nanoseconds, moving: bool) {
        self.moving = moving;
        let mut time = time;
        for instant in &mut self.times {
            *instant = seconds(time);
            time += self.periods.current;
        }
        self.end = seconds(time);
        self.until.fill(None);
    }

    /// The axis at `place` was where axis `at` of `machine` was.
    pub fn put(&mut self, place: usize, machine: &Machine, at: usize) {
        let ticks = self.ticks();
        machine.positions(at, &mut self.positions[place * ticks..][..ticks]);
    }

    /// Progress up to which the nearest point is sought at a tick.
    pub fn until(&mut self, program: &Program, tick: usize) -> f64 {
        let time = self.times[tick];
        *self.until[tick].get_or_insert_with(|| program.progress(time) + AHEAD)
    }
}
