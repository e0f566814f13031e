//! Canned cycles: G73, G74, G76, G77, G81 to G89, G174, G184, with G98 and G99; patterns of holes: G70, G71, G72.

use std::f64::consts::TAU;

use virtual_axes_core::units::{DEGREE, MILLIMETER, Rounded};

use super::codes::{FeedMode, HolePattern, Motion, ReturnLevel, g_name};
use super::dialect::Dialect;
use super::error::Outcome;
use super::limits::MAX_PECKS;
use super::line_words::LineWords;
use super::state::{Cycle, State};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, PathControl, ProgramEvent};

/// Milliseconds in a second.
const MILLISECOND: f64 = 1e-3;
/// Distance above the last depth to which a peck returns at rapid traverse, as in LinuxCNC, m.
const CLEARANCE: f64 = 0.254 * MILLIMETER;
/// Rounding of a sum of pecks, m.
const ROUNDING: f64 = 1e-12;

/// Programmed coordinates of the drilling axis in one line of a cycle, m.
struct Levels {
    retract: f64,
    bottom: f64,
    /// Coordinate after each hole.
    clear: f64,
}

impl State {
    /// Executes a line of the cycle `code`.
    pub(super) fn cycle(&mut self, block: &mut LineWords, code: Motion) -> Outcome<()> {
        self.cycle_at(block, code, None)
    }

    /// Executes the holes of a pattern of Haas with the cycle of its line or that in effect: L holes at the radius I from
    /// the angle J on (G70 with equal distances, G71 K degrees apart; a negative I turns clockwise), or at distances I
    /// from the position along the angle J (G72). BHC of Okuma is G70 with K holes.
    pub(super) fn hole_pattern(&mut self, block: &mut LineWords, pattern: HolePattern) -> Outcome<()> {
        let (name, number) = match self.dialect {
            Dialect::Okuma => ("BHC".to_owned(), 'K'),
            _ => (g_name(pattern.number()), 'L'),
        };
        let Some(code) = self.modal.motion.filter(|code| is_canned(*code)) else {
            return Err(format!(
                "{name} requires a canned cycle in a line before, as in {}",
                if number == 'K' { "NCYL G81 Z-5 R1 F100" } else { "G81 Z-5. R1. F100. L0" }
            ));
        };
        let mut required = |letter: char, what: &str| {
            block.take(letter).ok_or_else(|| format!("{name} requires {letter}, the {what}"))
        };
        let distance = required('I', "radius of the circle or distance of the holes")? * self.modal.length;
        let spacing = match pattern {
            HolePattern::Arc => required('K', "angle between the holes")? * DEGREE,
            HolePattern::Circle | HolePattern::Row => 0.0,
        };
        let angle = block.take('J').unwrap_or(0.0) * DEGREE;
        let count = block
            .take_integer(number)?
            .ok_or_else(|| format!("{name} requires {number}, the number of holes"))?;
        if f64::from(count) > MAX_PECKS {
            return Err(format!("{name}: {count} holes; at most {MAX_PECKS} are allowed"));
        }
        let offset = |index: u32| {
            let index = f64::from(index);
            let (radius, turn) = match pattern {
                HolePattern::Circle => (distance.abs(), index * TAU / f64::from(count)),
                HolePattern::Arc => (distance.abs(), index * spacing),
                HolePattern::Row => (index * distance, 0.0),
            };
            let (sine, cosine) = (angle + if distance < 0.0 { -turn } else { turn }).sin_cos();
            [radius * cosine, radius * sine]
        };
        let offsets: Vec<_> = (0..count).map(offset).collect();
        self.cycle_at(block, code, Some(&offsets))
    }

    /// Executes a line of a cycle, with holes at `offsets` from its target in place of repetitions.
    fn cycle_at(&mut self, block: &mut LineWords, code: Motion, offsets: Option<&[[f64; 2]]>) -> Outcome<()> {
        self.finish_contour()?;
        let [first, second, drill] = self.modal.plane.axes();
        let name = g_name(code.number());
        if self.dialect == Dialect::Grbl {
            self.assume(format!("{name}: grblHAL has canned cycles, grbl 1.1 rejects them (error 20)"));
        }
        let is_linuxcnc = self.dialect == Dialect::LinuxCnc;
        let others = (0..AXIS_COUNT).filter(|axis| ![first, second, drill].contains(axis));
        if let Some(axis) =
            others.into_iter().find(|axis| is_linuxcnc && block.get(AXIS_LETTERS[*axis]).is_some())
        {
            return Err(format!("word {}: {name} moves X, Y and Z only", AXIS_LETTERS[axis]));
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            return Err(format!("{name} requires G94 or G95"));
        }
        let mut cycle = self.started_cycle(code);
        let levels = self.read_cycle(block, &mut cycle)?;
        let pecks = pecks(&cycle, levels.retract - levels.bottom, is_linuxcnc);
        let repeats = match offsets {
            Some(offsets) => offsets.len() as u32,
            None => self.repetitions(block, &name)?,
        };
        let strokes = f64::from(repeats) * pecks.count;
        if strokes > MAX_PECKS {
            let what = if cycle.peck.is_some() { "pecks" } else { "repetitions" };
            return Err(format!(
                "{name}: {} {what} in one line; at most {MAX_PECKS} are allowed",
                Rounded(strokes)
            ));
        }
        let polar = self.polar_words(block);
        let (start, target) = (self.programmed(), self.targets(block)?);
        self.modal.cycle = Some(cycle);

        let is_okuma = self.dialect == Dialect::Okuma;
        let to_initial = self.modal.retracts_to_initial && !is_okuma;
        let is_below = is_back_boring(code);
        let is_above = start[drill] > levels.retract;
        let rises = match is_linuxcnc {
            // LinuxCNC compares the plane R with the initial level.
            true => cycle.initial < levels.retract,
            false => start[drill] < levels.retract && !is_below,
        };
        // From the plane R, LinuxCNC rises to the level of retraction on the way to the hole.
        let level = match rises || (is_linuxcnc && !is_above) {
            true if is_linuxcnc && to_initial => cycle.initial.max(levels.retract),
            true => levels.retract,
            false => start[drill],
        };
        if rises && repeats > 0 {
            self.rapid_along(drill, level)?;
        }
        let path_control = std::mem::replace(&mut self.modal.path_control, PathControl::ExactPath);
        let clear = match self.modal.return_level {
            _ if to_initial || is_below => cycle.initial.max(levels.retract),
            (ReturnLevel::Specified, Some(specified)) if is_okuma => specified.max(levels.retract),
            (ReturnLevel::UpperLimit, _) if is_okuma && self.options.upper_limits[drill].is_finite() => {
                self.options.upper_limits[drill] - self.origin(drill)
            }
            _ => levels.retract,
        };
        let levels = Levels { clear, ..levels };
        if is_okuma && repeats == 0 {
            // NCYL moves to the hole.
            let mut end = target;
            end[drill] = level;
            self.rapid_to(&end)?;
        }
        for repeat in 0..repeats {
            let hole = self.programmed();
            let mut end = hole;
            if let Some(offset) = offsets.and_then(|offsets| offsets.get(repeat as usize)) {
                end[first] = target[first] + offset[0];
                end[second] = target[second] + offset[1];
            } else if repeat == 0 || self.modal.is_incremental {
                for axis in (0..AXIS_COUNT).filter(|axis| *axis != drill) {
                    end[axis] += target[axis] - start[axis];
                }
                if repeat > 0 && self.modal.polar.is_some() {
                    (end[first], end[second]) = (hole[first], hole[second]);
                    self.replace_polar(polar, [first, second], &mut end);
                }
            }
            end[drill] = if repeat == 0 { level } else { levels.clear };
            self.rapid_to(&end)?;
            if is_below {
                self.bore_from_below(&cycle, &levels, [first, drill])?;
                continue;
            }
            self.rapid_along(drill, levels.retract)?;
            self.hole(&cycle, &levels, &pecks, [first, drill])?;
            self.rapid_along(drill, levels.clear)?;
        }
        self.modal.path_control = path_control;
        Ok(())
    }

    /// Returns the cycle in effect with a code. The initial level of another code remains; Fanuc keeps depth, plane R, peck
    /// and dwell, too.
    fn started_cycle(&self, code: Motion) -> Cycle {
        let drill = self.modal.plane.axes()[2];
        let keeps_words = self.dialect == Dialect::Fanuc;
        match self.modal.cycle {
            Some(cycle) if cycle.code == code => cycle,
            Some(cycle) if keeps_words => Cycle { code, extra: [None; 3], retraction_factor: None, ..cycle },
            before => Cycle {
                code,
                initial: before.map_or_else(|| self.programmed()[drill], |cycle| cycle.initial),
                retract: None,
                bottom: None,
                dwell: None,
                peck: None,
                extra: [None; 3],
                retraction_factor: None,
            },
        }
    }

    /// Returns the number of holes of a line: word L, or K of Fanuc.
    fn repetitions(&self, block: &mut LineWords, name: &str) -> Outcome<u32> {
        let is_macro_b = self.dialect.has_macro_b();
        let by_k = if self.dialect == Dialect::Fanuc { block.take_integer('K')? } else { None };
        match block.take_integer('L')?.or(by_k) {
            None => Ok(1),
            // The cycle takes effect with the next line.
            Some(0) if is_macro_b => Ok(0),
            Some(0) => Err(format!("{name}: word L: 0 repetitions, must be 1 or more")),
            Some(repeats) => Ok(repeats),
        }
    }

    /// Reads the words of a line into the cycle.
    fn read_cycle(&mut self, block: &mut LineWords, cycle: &mut Cycle) -> Outcome<Levels> {
        let drill = self.modal.plane.axes()[2];
        let (letter, length, name) = (AXIS_LETTERS[drill], self.modal.length, g_name(cycle.code.number()));
        let is_incremental = self.modal.is_incremental;
        let [is_linuxcnc, is_haas] =
            [Dialect::LinuxCnc, Dialect::Haas].map(|dialect| self.dialect == dialect);
        let is_changed = self.modal.cycle.is_some_and(|before| before.code != cycle.code);
        // Controls with macro B keep the levels of the line that has the words, also for lines with G91.
        let keeps_levels = self.dialect.has_macro_b();
        let word = block.take('R').map(|retract| retract * length);
        let base = if is_incremental { cycle.initial } else { 0.0 };
        let retract = match (word, cycle.retract) {
            (None, Some(retract)) if keeps_levels => retract,
            (Some(retract), _) | (None, Some(retract)) => retract + base,
            // After another cycle of Haas, the plane R would be a guess.
            (None, None) if is_linuxcnc || (is_haas && is_changed) => {
                return Err(format!("{name} requires R, the plane of retraction"));
            }
            (None, None) => cycle.initial,
        };
        cycle.retract = if keeps_levels { word.and(Some(retract)) } else { word }.or(cycle.retract);
        let word = block.take(letter).map(|bottom| bottom * length);
        let base = if is_incremental { retract } else { 0.0 };
        let bottom = match (word, cycle.bottom) {
            (None, Some(bottom)) if keeps_levels => bottom,
            (Some(bottom), _) | (None, Some(bottom)) => bottom + base,
            (None, None) => return Err(format!("{name} requires {letter}, the depth")),
        };
        cycle.bottom = if keeps_levels { word.and(Some(bottom)) } else { word }.or(cycle.bottom);
        if retract < bottom && !is_back_boring(cycle.code) {
            return Err(format!("{name}: the plane R is below the depth {letter}"));
        }
        let has_dwell = matches!(
            cycle.code,
            Motion::DwellDrilling | Motion::DwellBoring | Motion::StopBoring | Motion::ManualBoring
        );
        if (has_dwell || !is_linuxcnc || is_tapping(cycle.code)) && block.get('P').is_some() {
            let is_ms = self.dialect == Dialect::Okuma && !block.has_point('P');
            let dwell = self.dwell_time(block)?;
            cycle.dwell = if is_ms { dwell.map(|dwell| dwell * MILLISECOND) } else { dwell };
        }
        if is_linuxcnc && matches!(cycle.code, Motion::DwellDrilling | Motion::DwellBoring) {
            cycle.dwell.ok_or_else(|| format!("{name} requires P, the dwell in s"))?;
        }
        if is_tapping(cycle.code) && block.get('Q').is_some_and(|peck| peck > 0.0) {
            self.assume(format!(
                "{name} Q: the pecks of tapping are not simulated, the thread is cut in one stroke"
            ));
        }
        if has_pecks(cycle.code) || !is_linuxcnc {
            cycle.peck =
                block.take_rate('Q')?.filter(|peck| *peck > 0.0).map(|peck| peck * length).or(cycle.peck);
        }
        if has_pecks(cycle.code) && is_linuxcnc {
            cycle.peck.ok_or_else(|| format!("{name} requires Q above 0, the depth of a peck"))?;
        }
        if !is_linuxcnc {
            if is_tapping(cycle.code) && is_haas {
                cycle.retraction_factor = block.take_rate('J')?.filter(|factor| *factor > 0.0);
            }
            let last = if self.dialect == Dialect::Fanuc { 2 } else { 3 };
            for (extra, letter) in cycle.extra.iter_mut().zip(['I', 'J', 'K']).take(last) {
                *extra = block.take(letter).map(|value| value * length).or(*extra);
            }
            if is_tapping(cycle.code) {
                block.skip("JE");
            }
        }
        Ok(Levels { retract, bottom, clear: retract })
    }

    /// Appends one hole from the R plane to the depth, and what the cycle does at the depth.
    fn hole(
        &mut self,
        cycle: &Cycle,
        levels: &Levels,
        pecks: &Pecks,
        [lateral, drill]: [usize; 2],
    ) -> Outcome<()> {
        if pecks.count > 1.0 {
            let mut peck = pecks.first;
            let mut depth = levels.retract - peck;
            let mut since_retraction = 0.0;
            while depth > levels.bottom {
                self.feed_along(drill, depth)?;
                since_retraction += peck;
                let is_due = pecks.retraction.is_some_and(|depth| since_retraction >= depth - ROUNDING);
                if cycle.code == Motion::PeckDrilling || is_due {
                    self.rapid_along(drill, levels.retract)?;
                    since_retraction = 0.0;
                }
                self.rapid_along(drill, depth + CLEARANCE)?;
                peck = (peck - pecks.reduction).max(pecks.least);
                depth -= peck;
            }
        }
        self.feed_along(drill, levels.bottom)?;
        // Drilling and boring of Fanuc and Haas have no dwell.
        let has_none = matches!(self.dialect, Dialect::Fanuc | Dialect::Haas)
            && matches!(cycle.code, Motion::Drilling | Motion::Boring);
        if let Some(dwell) = cycle.dwell.filter(|_| !has_none) {
            self.push_event(ProgramEvent::Dwell(dwell));
        }
        match cycle.code {
            Motion::Boring | Motion::DwellBoring => self.feed_along(drill, levels.retract),
            code if is_tapping(code) => {
                let (feed, speed) = (self.modal.feed, self.modal.spindle_speed);
                let factor = cycle.retraction_factor.unwrap_or(1.0);
                if self.modal.feed_mode == FeedMode::PerMinute {
                    self.modal.feed = feed.map(|feed| feed.map(|feed| feed * factor));
                }
                self.modal.spindle_speed = speed * factor;
                self.push_spindle(-1.0);
                let result = self.feed_along(drill, levels.retract);
                (self.modal.feed, self.modal.spindle_speed) = (feed, speed);
                self.push_spindle(1.0);
                result
            }
            Motion::StopBoring | Motion::ManualBoring => {
                self.push_spindle(0.0);
                self.rapid_along(drill, levels.clear)?;
                self.push_spindle(1.0);
                Ok(())
            }
            Motion::FineBoring => {
                self.push_spindle(0.0);
                let shift = lateral_shift(cycle);
                self.shift_laterally(shift, lateral)?;
                self.rapid_along(drill, levels.clear)?;
                self.shift_laterally(shift.map(|value| -value), lateral)?;
                self.push_spindle(1.0);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Bores from R below the workpiece up to the depth: the tool passes the hole with a lateral shift.
    fn bore_from_below(
        &mut self,
        cycle: &Cycle,
        levels: &Levels,
        [lateral, drill]: [usize; 2],
    ) -> Outcome<()> {
        let shift = lateral_shift(cycle);
        self.push_spindle(0.0);
        self.shift_laterally(shift, lateral)?;
        self.rapid_along(drill, levels.retract)?;
        self.shift_laterally(shift.map(|value| -value), lateral)?;
        self.push_spindle(1.0);
        self.feed_along(drill, levels.bottom)?;
        if let Some(dwell) = cycle.dwell {
            self.push_event(ProgramEvent::Dwell(dwell));
        }
        self.push_spindle(0.0);
        self.shift_laterally(shift, lateral)?;
        self.rapid_along(drill, levels.clear)?;
        self.shift_laterally(shift.map(|value| -value), lateral)?;
        self.push_spindle(1.0);
        Ok(())
    }

    /// Appends a rapid traverse by a distance along the first and second axis of the plane.
    fn shift_laterally(&mut self, shift: [f64; 2], lateral: usize) -> Outcome<()> {
        let mut end = self.programmed();
        end[lateral] += shift[0];
        let second = self.modal.plane.axes()[1];
        end[second] += shift[1];
        self.rapid_to(&end)
    }

    fn rapid_along(&mut self, axis: usize, value: f64) -> Outcome<()> {
        let mut end = self.programmed();
        end[axis] = value;
        self.rapid_to(&end)
    }

    fn feed_along(&mut self, axis: usize, value: f64) -> Outcome<()> {
        let mut end = self.programmed();
        end[axis] = value;
        self.line_to(&end)
    }
}

/// Pecks of a hole, m.
struct Pecks {
    count: f64,
    first: f64,
    /// Reduction from one peck to the next, and the least peck.
    reduction: f64,
    least: f64,
    /// Depth after which G73 of Haas with Q and K retracts to the plane R.
    retraction: Option<f64>,
}

/// Returns the pecks of a hole by Q, or by I, J and K of Haas.
fn pecks(cycle: &Cycle, depth: f64, is_linuxcnc: bool) -> Pecks {
    let none = Pecks { count: 1.0, first: depth, reduction: 0.0, least: depth, retraction: None };
    if !has_pecks(cycle.code) {
        return none;
    }
    let [first, reduction, least] = cycle.extra;
    match (first.filter(|first| *first > 0.0 && !is_linuxcnc), cycle.peck) {
        (Some(first), _) => {
            let least = least.filter(|least| *least > 0.0).unwrap_or(first);
            let count = (depth / least.min(first)).ceil();
            Pecks { count, first, reduction: reduction.unwrap_or(0.0).max(0.0), least, retraction: None }
        }
        (None, Some(peck)) => Pecks {
            count: (depth / peck).ceil(),
            first: peck,
            reduction: 0.0,
            least: peck,
            retraction: least.filter(|depth| *depth > 0.0 && cycle.code == Motion::ChipBreaking),
        },
        (None, None) => none,
    }
}

/// Returns the lateral shift of boring cycles by I and J, or by Q along the first axis of the plane.
fn lateral_shift(cycle: &Cycle) -> [f64; 2] {
    match cycle.extra {
        [None, None, _] => [cycle.peck.unwrap_or(0.0), 0.0],
        [first, second, _] => [first, second].map(|shift| shift.unwrap_or(0.0)),
    }
}

/// Returns true for the code of a canned cycle.
pub(super) fn is_canned(code: Motion) -> bool {
    code.number() >= Motion::ChipBreaking.number() && code != Motion::Cancel
}

/// Returns true if a cycle drills in pecks of Q.
fn has_pecks(code: Motion) -> bool {
    matches!(code, Motion::ChipBreaking | Motion::PeckDrilling)
}

fn is_tapping(code: Motion) -> bool {
    matches!(
        code,
        Motion::Tapping
            | Motion::LeftTapping
            | Motion::RigidTapping
            | Motion::LeftRigidTapping
            | Motion::Tapping184
            | Motion::LeftTapping174
            | Motion::Tapping284
            | Motion::LeftTapping274
    )
}

fn is_back_boring(code: Motion) -> bool {
    matches!(code, Motion::BackBoring | Motion::BackBoring77)
}
