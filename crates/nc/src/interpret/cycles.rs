//! Canned cycles: G73, G81, G82, G83, G85, G89, with G98 and G99.

use virtual_axes_core::units::MILLIMETER;

use super::codes::g_name;
use super::error::Outcome;
use super::execute::take_rate;
use super::limits::MAX_PECKS;
use super::line_words::LineWords;
use super::state::{FeedMode, State};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, MotionKind, PathControl, ProgramEvent};

/// Distance above the last depth to which a peck returns at rapid traverse, as in LinuxCNC, m.
const CLEARANCE: f64 = 0.254 * MILLIMETER;

/// Canned cycle with the words that stay in effect for its next lines.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cycle {
    /// G code, in tenths.
    code: u16,
    /// Position of the drilling axis before the first line of the cycle, m.
    initial: f64,
    /// Word R, m.
    retract: Option<f64>,
    /// Word of the depth, m.
    bottom: Option<f64>,
    /// Dwell P, s.
    dwell: Option<f64>,
    /// Peck Q, m.
    peck: Option<f64>,
}

/// Positions of the drilling axis in one line of a cycle, m.
struct Levels {
    retract: f64,
    bottom: f64,
    /// Position after each hole.
    clear: f64,
}

impl State {
    /// Executes a line of the cycle `code`, in tenths.
    pub(super) fn cycle(&mut self, block: &mut LineWords, code: u16) -> Outcome<()> {
        let [first, second, drill] = self.modal.plane.axes();
        let name = g_name(code);
        let others = (0..AXIS_COUNT).filter(|axis| ![first, second, drill].contains(axis));
        if let Some(axis) = others.into_iter().find(|axis| block.get(AXIS_LETTERS[*axis]).is_some()) {
            return Err(format!("word {}: {name} moves X, Y and Z only", AXIS_LETTERS[axis]));
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            return Err(format!("{name} requires G94 or G95"));
        }
        let mut cycle = self.modal.cycle.filter(|cycle| cycle.code == code).unwrap_or(Cycle {
            code,
            initial: self.position[drill],
            retract: None,
            bottom: None,
            dwell: None,
            peck: None,
        });
        let levels = self.read_cycle(block, &mut cycle)?;
        let repeats = block.take_integer('L')?.unwrap_or(1);
        let pecks = cycle
            .peck
            .filter(|_| matches!(code, 730 | 830))
            .map_or(1.0, |peck| (levels.retract - levels.bottom) / peck);
        if repeats == 0 {
            return Err(format!("{name}: word L: 0 repetitions, must be 1 or more"));
        }
        let strokes = (f64::from(repeats) * pecks).ceil();
        if strokes > MAX_PECKS {
            let what = if cycle.peck.is_some() { "pecks" } else { "repetitions" };
            return Err(format!("{name}: {strokes} {what} in one line; at most {MAX_PECKS} are allowed"));
        }
        let step = self.targets(block, false)?;
        let step = [first, second].map(|axis| step[axis] - self.position[axis]);
        self.modal.cycle = Some(cycle);

        let mut level = if self.modal.retracts_to_initial { cycle.initial } else { self.position[drill] };
        if level < levels.retract {
            level = levels.retract;
            self.rapid_to(drill, level)?;
        }
        let path_control = std::mem::replace(&mut self.modal.path_control, PathControl::ExactPath);
        let levels =
            Levels { clear: if self.modal.retracts_to_initial { level } else { levels.retract }, ..levels };
        for repeat in 0..repeats {
            let mut end = self.position;
            if repeat == 0 || self.modal.is_incremental {
                end[first] += step[0];
                end[second] += step[1];
            }
            end[drill] = if repeat == 0 { level } else { levels.clear };
            self.push_rapid(end)?;
            self.rapid_to(drill, levels.retract)?;
            self.hole(&cycle, &levels, drill)?;
            self.rapid_to(drill, levels.clear)?;
        }
        self.modal.path_control = path_control;
        Ok(())
    }

    /// Reads the words of a line into the cycle.
    fn read_cycle(&self, block: &mut LineWords, cycle: &mut Cycle) -> Outcome<Levels> {
        let drill = self.modal.plane.axes()[2];
        let (letter, length, name) = (AXIS_LETTERS[drill], self.modal.length, g_name(cycle.code));
        let origin = self.origin(drill);
        let is_incremental = self.modal.is_incremental;
        cycle.retract = block.take('R').map(|retract| retract * length).or(cycle.retract);
        let retract = cycle.retract.ok_or_else(|| format!("{name} requires R, the plane of retraction"))?;
        let retract = retract + if is_incremental { cycle.initial } else { origin };
        cycle.bottom = block.take(letter).map(|bottom| bottom * length).or(cycle.bottom);
        let bottom = cycle.bottom.ok_or_else(|| format!("{name} requires {letter}, the depth"))?;
        let bottom = bottom + if is_incremental { retract } else { origin };
        if retract < bottom {
            return Err(format!("{name}: the plane R is below the depth {letter}"));
        }
        if matches!(cycle.code, 820 | 890) {
            cycle.dwell = take_rate(block, 'P')?.or(cycle.dwell);
            cycle.dwell.ok_or_else(|| format!("{name} requires P, the dwell in s"))?;
        }
        if matches!(cycle.code, 730 | 830) {
            cycle.peck =
                take_rate(block, 'Q')?.filter(|peck| *peck > 0.0).map(|peck| peck * length).or(cycle.peck);
            cycle.peck.ok_or_else(|| format!("{name} requires Q above 0, the depth of a peck"))?;
        }
        Ok(Levels { retract, bottom, clear: retract })
    }

    /// Appends one hole from the R plane to the depth, and what the cycle does at the depth.
    fn hole(&mut self, cycle: &Cycle, levels: &Levels, drill: usize) -> Outcome<()> {
        if let (730 | 830, Some(peck)) = (cycle.code, cycle.peck) {
            let mut depth = levels.retract - peck;
            while depth > levels.bottom {
                self.feed_to(drill, depth)?;
                if cycle.code == 830 {
                    self.rapid_to(drill, levels.retract)?;
                }
                self.rapid_to(drill, depth + CLEARANCE)?;
                depth -= peck;
            }
        }
        self.feed_to(drill, levels.bottom)?;
        if let Some(dwell) = cycle.dwell {
            self.push_event(ProgramEvent::Dwell(dwell));
        }
        if matches!(cycle.code, 850 | 890) { self.feed_to(drill, levels.retract) } else { Ok(()) }
    }

    fn rapid_to(&mut self, axis: usize, value: f64) -> Outcome<()> {
        let mut end = self.position;
        end[axis] = value;
        self.push_rapid(end)
    }

    fn feed_to(&mut self, axis: usize, value: f64) -> Outcome<()> {
        let mut end = self.position;
        end[axis] = value;
        self.push_feed(MotionKind::Line, end)
    }
}
