//! PSEC from CSV: `time,x,y,z,a,c` in s, m and rad, as a stream on the grid of positions.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::lines::{Lines, fields};
use super::psec_error::PsecError;
use virtual_axes_core::text::nearest_name;
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::trajectory::spline::{SplineDegree, Segment, KinematicState};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS, seconds};

/// The column of times.
pub(super) const TIME: &str = "time";
/// The largest time, s: three years, more than anybody waits for.
pub(super) const LONGEST: f64 = 1e8;

/// A row of the file.
#[derive(Debug, Clone, Default)]
struct Point {
    /// ns.
    time: Nanoseconds,
    /// m or rad, one per column.
    positions: Vec<f64>,
    line: u64,
    /// Number of the row, from 0.
    index: usize,
}

/// PSEC of a file at the instants k·Tsp, k = 0, 1, …, read as they are asked for: two rows are held,
/// however long the file is.
///
/// Between rows it interpolates linearly, with the arithmetic of a trajectory of positions: rows on
/// the grid are used bit for bit. The time of the first row may be later than 0: the axes go there in
/// a straight line from where they stand, at home (0) unless [`starting_at`](Self::starting_at) says
/// otherwise. The last instant is the first that is not before the last row.
///
/// Each row is checked when it is read, each setpoint before it is given: strokes, and speeds from
/// instant to instant, the first from where the axes stand.
#[derive(Debug)]
pub struct PsecCsv<R> {
    lines: Lines<R>,
    name: String,
    period: Nanoseconds,
    columns: Vec<String>,
    limits: Vec<JointLimits>,
    places: Vec<usize>,
    /// The row not after the instant, once the first has been reached; before it, the start at time 0.
    before: Point,
    /// The row after it; with the one before it, the segment.
    after: Point,
    /// Number of the instant that comes next.
    next_k: i64,
    /// What was given last.
    given: Vec<f64>,
    first_time: Nanoseconds,
    /// Whether there is no row after `after`.
    at_end: bool,
    done: bool,
}

impl PsecCsv<File> {
    /// Opens a file; see [`PsecCsv::new`].
    ///
    /// # Errors
    /// [`PsecError`].
    pub fn open(path: &Path, period: Nanoseconds, joints: &[JointLimits]) -> Result<Self, PsecError> {
        let name = path.display().to_string();
        let unreadable =
            |error: std::io::Error| PsecError::Unreadable { at: name.clone(), reason: error.to_string() };
        let file = File::open(path).map_err(unreadable)?;
        Self::new(file, &name, period, joints)
    }
}

impl<R: Read> PsecCsv<R> {
    /// Reads the header and the first row; `name` is for messages, `period` (Tsp) more than 0 ns, `joints`
    /// are the machine's.
    ///
    /// # Errors
    /// [`PsecError`].
    pub fn new(input: R, name: &str, period: Nanoseconds, joints: &[JointLimits]) -> Result<Self, PsecError> {
        debug_assert!(period > 0, "a period lasts");
        let mut psec = PsecCsv {
            lines: Lines::new(input),
            name: name.to_owned(),
            period,
            columns: Vec::new(),
            limits: Vec::new(),
            places: Vec::new(),
            before: Point::default(),
            after: Point::default(),
            next_k: 0,
            given: Vec::new(),
            first_time: 0,
            at_end: false,
            done: false,
        };
        psec.read_header(joints)?;
        if !psec.read_point()? {
            return Err(PsecError::Empty { at: psec.name });
        }
        psec.first_time = psec.after.time;
        psec.given = vec![0.0; psec.places.len()];
        psec.before = Point { positions: psec.given.clone(), ..psec.after.clone() };
        psec.before.time = 0;
        Ok(psec)
    }

    /// Where the axes stand before the first instant, m or rad, one value per joint of the machine; to be
    /// said before the first row is asked for.
    #[must_use]
    pub fn starting_at(mut self, positions: &[f64]) -> Self {
        for (column, &place) in self.places.iter().enumerate() {
            let position = positions.get(place).copied().unwrap_or_default();
            self.given[column] = position;
            self.before.positions[column] = position;
        }
        self
    }

    /// With a first row at time 0 the axes stand there before the first instant.
    #[must_use]
    pub fn starting_at_first_row(mut self) -> Self {
        if self.first_time == 0 {
            self.given.copy_from_slice(&self.after.positions);
            self.before.positions.copy_from_slice(&self.after.positions);
        }
        self
    }

    /// The joints that it moves, as places in the machine, one per value of a row.
    pub fn joints(&self) -> &[usize] {
        &self.places
    }

    /// Time of the first row, ns: later than 0 if the axes first go there.
    pub fn first_time(&self) -> Nanoseconds {
        self.first_time
    }

    /// Number of the instant that comes next, from 0.
    pub fn next_instant(&self) -> i64 {
        self.next_k
    }

    /// PSEC at the next instant, m or rad, into `row`, which has a value for each of
    /// [`joints`](Self::joints); `false` after the last instant.
    ///
    /// # Errors
    /// [`PsecError`], the first fault from the top. There is nothing after it.
    // An iterator could not lend the row.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self, row: &mut [f64]) -> Result<bool, PsecError> {
        debug_assert_eq!(row.len(), self.places.len(), "a value per joint");
        if self.done {
            return Ok(false);
        }
        // Faults are told once.
        self.done = true;
        let time = self.next_k * self.period;
        while self.after.time <= time && !self.at_end {
            self.advance()?;
        }
        self.interpolate(time, row);
        self.check(time, row)?;
        self.given.copy_from_slice(row);
        self.next_k += 1;
        self.done = self.at_end && self.after.time <= time;
        Ok(true)
    }

    fn advance(&mut self) -> Result<(), PsecError> {
        std::mem::swap(&mut self.before, &mut self.after);
        if !self.read_point()? {
            // The last row stays where it was.
            std::mem::swap(&mut self.before, &mut self.after);
            self.at_end = true;
        }
        Ok(())
    }

    fn interpolate(&self, time: Nanoseconds, row: &mut [f64]) {
        if time >= self.after.time {
            row.copy_from_slice(&self.after.positions);
            return;
        }
        if time == self.before.time {
            row.copy_from_slice(&self.before.positions);
            return;
        }
        let duration = self.after.time - self.before.time;
        for (value, (&from, &to)) in
            row.iter_mut().zip(self.before.positions.iter().zip(&self.after.positions))
        {
            let segment = Segment::new(KinematicState::at_rest(from), KinematicState::at_rest(to), duration, SplineDegree::Linear);
            *value = segment.position(time - self.before.time);
        }
    }

    fn check(&self, time: Nanoseconds, row: &[f64]) -> Result<(), PsecError> {
        let period = seconds(self.period);
        // The row that the way to this instant leads to.
        let point = if self.before.time == time { &self.before } else { &self.after };
        for ((joint, &position), &before) in self.limits.iter().zip(row).zip(&self.given) {
            let speed = (position - before) / period;
            let checked = if time == 0 {
                joint.check_jump(point.index, before, position, period)
            } else if time - self.period < self.first_time {
                joint.check_speed(point.index, speed, "speed on the approach to it")
            } else {
                joint.check_speed(point.index, speed, "speed")
            };
            checked.map_err(|rejection| PsecError::Point { at: self.at(point.line), rejection })?;
        }
        Ok(())
    }

    fn at(&self, line: u64) -> String {
        format!("{}:{line}", self.name)
    }

    fn read_header(&mut self, joints: &[JointLimits]) -> Result<(), PsecError> {
        let name = self.name.clone();
        let (line, text) = match self.lines.next() {
            Ok(found) => found.unwrap_or((1, "")),
            Err((line, reason)) => {
                return Err(PsecError::Unreadable { at: format!("{name}:{line}"), reason });
            }
        };
        let at = format!("{name}:{line}");
        let mut header = fields(text);
        let time = header.next();
        self.columns = header.map(str::to_owned).collect();
        if time != Some(TIME) || self.columns.is_empty() || self.columns.iter().any(String::is_empty) {
            return Err(PsecError::Header { at, found: super::shortened(text.trim()) });
        }
        for column in &self.columns {
            let Some(place) = joints.iter().position(|joint| joint.name == *column) else {
                let names = joints.iter().map(|joint| joint.name.as_str());
                return Err(PsecError::UnknownJoint {
                    at,
                    found: super::shortened(column),
                    known: names.clone().collect::<Vec<_>>().join(", "),
                    nearest: nearest_name(column, names),
                });
            };
            if self.places.contains(&place) {
                return Err(PsecError::DuplicateJoint { at, joint: column.clone() });
            }
            self.places.push(place);
            self.limits.push(joints[place].clone());
        }
        Ok(())
    }

    /// Reads the next row into `after`, checked by itself and against `before`; `false` at the end.
    fn read_point(&mut self) -> Result<bool, PsecError> {
        let PsecCsv { lines, name, columns, limits, before, after, .. } = self;
        let found = lines.next().map_err(|(line, reason)| {
            let at = format!("{name}:{line}");
            PsecError::Unreadable { at, reason }
        })?;
        let Some((line, text)) = found else { return Ok(false) };
        let at = || format!("{name}:{line}");
        let wanted = columns.len() + 1;
        let mut values = fields(text).map(number);
        let time = values.next().unwrap_or(f64::NAN);
        after.positions.clear();
        after.positions.extend(values.by_ref().take(columns.len()));
        let found = 1 + after.positions.len() + values.count();
        if found != wanted {
            return Err(PsecError::Columns { at: at(), found, wanted });
        }
        let no_number = |column: usize| {
            let name = column.checked_sub(1).and_then(|column| columns.get(column));
            PsecError::Number {
                at: at(),
                column: name.map_or(TIME, String::as_str).to_owned(),
                found: super::shortened(fields(text).nth(column).unwrap_or_default()),
            }
        };
        if !time.is_finite() {
            return Err(no_number(0));
        }
        if !(0.0..=LONGEST).contains(&time) {
            return Err(PsecError::Time { at: at(), found: time });
        }
        let first = before.positions.is_empty();
        after.line = line;
        after.index = if first { 0 } else { before.index + 1 };
        after.time = nearest_nanosecond(time);
        if !first && after.time <= before.time {
            return Err(PsecError::NotIncreasing { at: at(), found: time, before: seconds(before.time) });
        }
        for (column, (joint, &position)) in limits.iter().zip(&after.positions).enumerate() {
            if !position.is_finite() {
                return Err(no_number(column + 1));
            }
            joint
                .check_travel_limits(after.index, position)
                .map_err(|rejection| PsecError::Point { at: at(), rejection })?;
        }
        Ok(true)
    }
}

/// A number, or NaN.
fn number(text: &str) -> f64 {
    text.parse().unwrap_or(f64::NAN)
}

/// A time in s as ns.
fn nearest_nanosecond(time: f64) -> Nanoseconds {
    let whole = time.floor();
    let rest = ((time - whole) * SECOND_NS as f64).round() as Nanoseconds;
    whole as Nanoseconds * SECOND_NS + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_on_the_position_grid_are_whole_nanoseconds() {
        assert_eq!(nearest_nanosecond(0.006 * 1111.0), 6_666_000_000);
    }
}
