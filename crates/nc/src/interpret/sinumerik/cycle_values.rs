//! Values of cycles, and the motions that cycles are made of.

use virtual_axes_core::units::{INCH, MILLIMETER};

use super::super::error::Outcome;
use super::super::limits::MAX_RATE;
use super::super::state::State;
use super::value::ProgramValue;
use crate::motion::ProgramEvent;

/// Metric coarse threads: diameter and pitch, mm.
const METRIC: [(f64, f64); 25] = [
    (1.0, 0.25),
    (1.2, 0.25),
    (1.4, 0.3),
    (1.6, 0.35),
    (2.0, 0.4),
    (2.5, 0.45),
    (3.0, 0.5),
    (4.0, 0.7),
    (5.0, 0.8),
    (6.0, 1.0),
    (8.0, 1.25),
    (10.0, 1.5),
    (12.0, 1.75),
    (14.0, 2.0),
    (16.0, 2.0),
    (18.0, 2.5),
    (20.0, 2.5),
    (22.0, 2.5),
    (24.0, 3.0),
    (27.0, 3.0),
    (30.0, 3.5),
    (33.0, 3.5),
    (36.0, 4.0),
    (42.0, 4.5),
    (48.0, 5.0),
];

/// Dwell of a cycle.
#[derive(Debug, Clone, Copy)]
pub(super) enum Dwell {
    /// Time, s.
    Time(f64),
    /// Revolutions of the spindle.
    Revolutions(f64),
}

/// Values of a call by position.
pub(super) struct CycleValues<'a> {
    pub cycle: &'a str,
    pub values: &'a [Option<ProgramValue>],
    pub length: f64,
}

impl CycleValues<'_> {
    /// Returns the number at a position.
    pub(super) fn get(&self, index: usize) -> Outcome<Option<f64>> {
        match self.values.get(index).cloned().flatten() {
            Some(value) => value
                .number()
                .map(Some)
                .map_err(|reason| format!("{}: value {}: {reason}", self.cycle, index + 1)),
            None => Ok(None),
        }
    }

    /// Returns a length, m; 0 without a value.
    pub(super) fn length(&self, index: usize) -> Outcome<f64> {
        Ok(self.get(index)?.unwrap_or(0.0) * self.length)
    }

    /// Returns a length that the cycle requires, m.
    pub(super) fn required(&self, index: usize, name: &str) -> Outcome<f64> {
        let value = self.get(index)?;
        let value =
            value.ok_or_else(|| format!("{} requires {name}, its value {}", self.cycle, index + 1))?;
        Ok(value * self.length)
    }

    /// Returns a dwell: seconds, or revolutions if negative.
    pub(super) fn dwell(&self, index: usize) -> Outcome<Option<Dwell>> {
        Ok(match self.get(index)? {
            Some(value) if value > 0.0 => Some(Dwell::Time(value)),
            Some(value) if value < 0.0 => Some(Dwell::Revolutions(-value)),
            _ => None,
        })
    }

    /// Returns the pitch of a thread, m: PIT, or by the metric size MPIT.
    pub(super) fn pitch(&self, size: usize, pitch: usize, unit: Option<usize>) -> Outcome<Option<f64>> {
        let unit = unit.map_or(Ok(None), |index| self.get(index))?.unwrap_or(0.0);
        if let Some(pitch) = self.get(pitch)?.map(f64::abs).filter(|pitch| *pitch > 0.0) {
            return Ok(Some(match unit as i32 {
                1 => pitch * MILLIMETER,
                2 => INCH / pitch,
                3 => pitch * INCH,
                4 => pitch * std::f64::consts::PI * MILLIMETER,
                _ => pitch * self.length,
            }));
        }
        let Some(size) = self.get(size)?.map(f64::abs).filter(|size| *size > 0.0) else { return Ok(None) };
        let thread = METRIC.iter().find(|(diameter, _)| (diameter - size).abs() < 1e-6);
        let thread = thread.ok_or_else(|| {
            format!("{}: MPIT {size} is no metric thread from M1 to M48; program PIT, the pitch", self.cycle)
        })?;
        Ok(Some(thread.1 * MILLIMETER))
    }
}

/// Moves along the normal of the plane at rapid traverse.
pub(super) fn rapid(level: f64, state: &mut State) -> Outcome<()> {
    let mut end = state.programmed();
    end[state.modal.plane.axes()[2]] = level;
    state.rapid_to(&end)
}

/// Moves along the normal of the plane at feed.
pub(super) fn feed_to(level: f64, state: &mut State) -> Outcome<()> {
    let mut end = state.programmed();
    end[state.modal.plane.axes()[2]] = level;
    state.line_to(&end)
}

/// Appends a dwell.
pub(super) fn pause(dwell: Option<Dwell>, state: &mut State) -> Outcome<()> {
    let time = match dwell {
        None => return Ok(()),
        Some(Dwell::Time(time)) => time,
        Some(Dwell::Revolutions(revolutions)) if state.modal.spindle_speed > 0.0 => {
            60.0 * revolutions / state.modal.spindle_speed
        }
        Some(Dwell::Revolutions(_)) => {
            return Err("a dwell in revolutions requires the spindle speed S".to_owned());
        }
    };
    state.push_event(ProgramEvent::Dwell(time.min(MAX_RATE)));
    Ok(())
}
