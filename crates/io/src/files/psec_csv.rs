//! Streaming reader of PSEC (position setpoint at the entrance of the controller) from CSV: `time,x,y,z,a,c` in s,
//! m and rad, interpolated at position cycles.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::error::FileError;
use super::lines::{Lines, fields};
use super::psec_error::{MAX_TIME, MAX_VALUE, TIME, header_unit_hint, separator_hint, unit_hint};
use super::psec_row::{PsecRow, TimeGap, TimeSteps};
use super::recording::recorded_psec::RecordedPsec;
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use virtual_axes_core::trajectory::spline::{KinematicState, Segment, SplineDegree};
use virtual_axes_core::trajectory::{JointLimits, Rejection};
use virtual_axes_core::units::{Nanoseconds, Rounded, SECOND_NS, seconds};

/// Row of the file.
#[derive(Debug, Clone, Default)]
struct Point {
    /// Time, ns.
    time: Nanoseconds,
    /// Position per column, m or rad.
    positions: Vec<f64>,
    line: u64,
    /// Row index, from 0.
    index: usize,
}

/// Streaming reader of the position setpoints of a CSV file at the times k·Tsp, k = 0, 1, …, with constant memory.
///
/// Rows are interpolated linearly with the arithmetic of a trajectory of positions; rows at a position cycle are used
/// bit for bit. If the first row is later than 0, the axes move there in a straight line from their start positions,
/// which are 0 unless set by [`with_start_positions`](Self::with_start_positions). The last cycle is the first that is
/// not before the last row.
///
/// Rows are checked against the travel limits, setpoints against the velocity limits from cycle to cycle.
#[derive(Debug)]
pub struct PsecCsvReader<R> {
    lines: Lines<R>,
    name: String,
    period: Nanoseconds,
    columns: Vec<String>,
    limits: Vec<JointLimits>,
    joint_indices: Vec<usize>,
    /// Last row not after the current cycle; before the first row, the start positions at time 0.
    before: Point,
    /// Next row: end of the interpolated segment.
    after: Point,
    /// Index of the next position cycle.
    next_k: i64,
    /// Last setpoints returned, m or rad.
    previous: Vec<f64>,
    first_time: Nanoseconds,
    steps: TimeSteps,
    /// True if `after` is the last row.
    is_last_row: bool,
    is_done: bool,
    /// Rows read since the last [`take_rows`](Self::take_rows), if they are kept.
    rows: Option<Vec<PsecRow>>,
    /// Values of the last digits of the columns of a recording, m or rad; its errors name samples in place of lines.
    recorded: Option<Vec<f64>>,
}

impl PsecCsvReader<File> {
    /// Opens a file; see [`PsecCsvReader::new`].
    ///
    /// # Errors
    /// Returns a [`FileError`] if the file, its header or its first row is invalid.
    pub fn open(path: &Path, period: Nanoseconds, joints: &[JointLimits]) -> Result<Self, FileError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|error| FileError::new(&name, error))?;
        Self::new(file, &name, period, joints)
    }
}

impl PsecCsvReader<RecordedPsec> {
    /// Reads the setpoints of a recording; see [`PsecCsvReader::new`].
    ///
    /// # Errors
    /// Returns a [`FileError`] if the first sample is invalid.
    pub fn recorded(
        recorded: RecordedPsec,
        name: &str,
        period: Nanoseconds,
        joints: &[JointLimits],
    ) -> Result<Self, FileError> {
        let resolutions = recorded.resolutions().to_vec();
        Self::with_recorded(recorded, (name, Some(resolutions)), period, joints)
    }
}

impl<R: Read> PsecCsvReader<R> {
    /// Reads the header and the first row. `name` is the file name in errors, `period` is Tsp in ns and positive,
    /// `joints` are all joints of the machine.
    ///
    /// # Errors
    /// Returns a [`FileError`] if the header or the first row is invalid.
    pub fn new(input: R, name: &str, period: Nanoseconds, joints: &[JointLimits]) -> Result<Self, FileError> {
        Self::with_recorded(input, (name, None), period, joints)
    }

    fn with_recorded(
        input: R,
        (name, recorded): (&str, Option<Vec<f64>>),
        period: Nanoseconds,
        joints: &[JointLimits],
    ) -> Result<Self, FileError> {
        debug_assert!(period > 0, "the period is positive");
        let mut psec = PsecCsvReader {
            lines: Lines::new(input),
            name: name.to_owned(),
            period,
            columns: Vec::new(),
            limits: Vec::new(),
            joint_indices: Vec::new(),
            before: Point::default(),
            after: Point::default(),
            next_k: 0,
            previous: Vec::new(),
            first_time: 0,
            steps: TimeSteps::default(),
            is_last_row: false,
            is_done: false,
            rows: None,
            recorded,
        };
        psec.read_header(joints)?;
        if !psec.read_point()? {
            return Err(FileError::new(psec.name, "there is no setpoint below the header"));
        }
        psec.first_time = psec.after.time;
        psec.previous = vec![0.0; psec.joint_indices.len()];
        psec.before = Point { positions: psec.previous.clone(), ..psec.after.clone() };
        psec.before.time = 0;
        Ok(psec)
    }

    /// Sets the positions before the first cycle, m or rad, one value per joint of the machine. Call it before
    /// [`next`](Self::next).
    #[must_use]
    pub fn with_start_positions(mut self, positions: &[f64]) -> Self {
        for (column, &index) in self.joint_indices.iter().enumerate() {
            let position = positions.get(index).copied().unwrap_or_default();
            self.previous[column] = position;
            self.before.positions[column] = position;
        }
        self
    }

    /// Sets the positions before the first cycle to the first row, if its time is 0.
    #[must_use]
    pub fn with_start_at_first_row(mut self) -> Self {
        if self.first_time == 0 {
            self.previous.copy_from_slice(&self.after.positions);
            self.before.positions.copy_from_slice(&self.after.positions);
        }
        self
    }

    /// Keeps rows for [`take_rows`](Self::take_rows), beginning with the start positions if the first row is later than
    /// 0. Call it after the other `with` functions.
    #[must_use]
    pub fn with_kept_rows(mut self) -> Self {
        let Point { line, time, positions, .. } = &self.after;
        let start = (*time > 0).then(|| PsecRow::new(*line, 0, &self.before.positions));
        self.rows = Some(start.into_iter().chain([PsecRow::new(*line, *time, positions)]).collect());
        self
    }

    /// Returns the rows read since the last call; empty without [`with_kept_rows`](Self::with_kept_rows). The digits of
    /// the first row are unknown.
    pub fn take_rows(&mut self) -> Vec<PsecRow> {
        self.rows.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Returns the joint index in the machine of each value of a row.
    pub fn joints(&self) -> &[usize] {
        &self.joint_indices
    }

    /// Returns the time of the first row, ns. A time after 0 includes an approach motion.
    pub fn first_time(&self) -> Nanoseconds {
        self.first_time
    }

    /// Returns the longest time step with motion among the rows read so far, if it is more than 10 times the median of
    /// the first 1000 steps.
    pub fn gap(&self) -> Option<TimeGap> {
        self.steps.gap()
    }

    /// Returns the index of the next position cycle, from 0.
    pub fn next_instant(&self) -> i64 {
        self.next_k
    }

    /// Writes the setpoints of the next position cycle, m or rad, to `row`, one value per element of
    /// [`joints`](Self::joints). Returns false after the last cycle.
    ///
    /// # Errors
    /// Returns a [`FileError`] for the first invalid row or setpoint; later calls return false.
    // An iterator could not lend the row.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self, row: &mut [f64]) -> Result<bool, FileError> {
        debug_assert_eq!(row.len(), self.joint_indices.len(), "a value per joint");
        if self.is_done {
            return Ok(false);
        }
        // An error is returned once.
        self.is_done = true;
        let time = self.next_k * self.period;
        while self.after.time <= time && !self.is_last_row {
            self.advance()?;
        }
        self.interpolate(time, row);
        self.check(time, row)?;
        self.previous.copy_from_slice(row);
        self.next_k += 1;
        self.is_done = self.is_last_row && self.after.time <= time;
        Ok(true)
    }

    fn advance(&mut self) -> Result<(), FileError> {
        std::mem::swap(&mut self.before, &mut self.after);
        if !self.read_point()? {
            // The last row stays in `after`.
            std::mem::swap(&mut self.before, &mut self.after);
            self.is_last_row = true;
        } else {
            let moves = self.before.positions != self.after.positions;
            self.steps.add(self.after.time - self.before.time, self.after.line, moves);
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
            let segment = Segment::new(
                KinematicState::at_rest(from),
                KinematicState::at_rest(to),
                duration,
                SplineDegree::Linear,
            );
            *value = segment.position(time - self.before.time);
        }
    }

    fn check(&self, time: Nanoseconds, row: &[f64]) -> Result<(), FileError> {
        let period = seconds(self.period);
        // End of the segment of this cycle.
        let point = if self.before.time == time { &self.before } else { &self.after };
        for ((joint, &position), &before) in self.limits.iter().zip(row).zip(&self.previous) {
            let speed = (position - before) / period;
            let checked = if time == 0 {
                joint.check_jump(point.index, before, position, period)
            } else if time - self.period < self.first_time {
                joint.check_speed(point.index, speed, "speed on the approach to it")
            } else {
                joint.check_speed(point.index, speed, "speed")
            };
            checked.map_err(|rejection| point_error(self.at(point.line), &rejection))?;
        }
        Ok(())
    }

    fn at(&self, line: u64) -> String {
        place(&self.name, line, self.recorded.is_some())
    }

    fn read_header(&mut self, joints: &[JointLimits]) -> Result<(), FileError> {
        let name = self.name.clone();
        let (line, text) = match self.lines.next() {
            Ok(found) => found.unwrap_or((1, "")),
            Err((line, reason)) => {
                return Err(FileError::new(format_args!("{name}:{line}"), reason));
            }
        };
        let at = format!("{name}:{line}");
        let mut header = fields(text);
        let time = header.next();
        self.columns = header.map(str::to_owned).collect();
        if time != Some(TIME) || self.columns.is_empty() || self.columns.iter().any(String::is_empty) {
            let reason = format!(
                "the header is \"{}\", must be \"{TIME}\", then one joint name per column",
                shortened(text.trim())
            );
            return Err(FileError::new(at, reason));
        }
        for column in &self.columns {
            let Some(index) = joints.iter().position(|joint| joint.name == *column) else {
                let names = joints.iter().map(|joint| joint.name.as_str());
                let nearest = names.clone().find(|name| name.eq_ignore_ascii_case(column)).map(str::to_owned);
                let found = shortened(column);
                let reason = format!(
                    "there is no joint \"{found}\"; there are {}{}{}",
                    names.clone().collect::<Vec<_>>().join(", "),
                    nearest_hint(&nearest.or_else(|| nearest_name(column, names))),
                    header_unit_hint(&found)
                );
                return Err(FileError::new(at, reason));
            };
            if self.joint_indices.contains(&index) {
                return Err(FileError::new(at, format_args!("joint {column} has two columns")));
            }
            self.joint_indices.push(index);
            self.limits.push(joints[index].clone());
        }
        Ok(())
    }

    /// Reads and checks the next row into `after`; returns false at the end of the file.
    fn read_point(&mut self) -> Result<bool, FileError> {
        let PsecCsvReader { lines, name, columns, limits, before, after, rows, recorded, .. } = self;
        let found =
            lines.next().map_err(|(line, reason)| FileError::new(format_args!("{name}:{line}"), reason))?;
        let Some((line, text)) = found else { return Ok(false) };
        let at = || place(name, line, recorded.is_some());
        let wanted = columns.len() + 1;
        let mut values = fields(text).map(parse_number);
        let time = values.next().unwrap_or(f64::NAN);
        after.positions.clear();
        after.positions.extend(values.by_ref().take(columns.len()));
        let found = 1 + after.positions.len() + values.count();
        if found != wanted {
            let hint = separator_hint(found, wanted, text.contains(';'));
            let reason = format!("{found} values, the header names {wanted} columns{hint}");
            return Err(FileError::new(at(), reason));
        }
        let number_error = |column: usize| {
            let name = column.checked_sub(1).and_then(|column| columns.get(column));
            let name = name.map_or(TIME, String::as_str);
            let found = shortened(fields(text).nth(column).unwrap_or_default());
            FileError::new(at(), format_args!("{name} is \"{found}\", must be a finite number"))
        };
        if !time.is_finite() {
            return Err(number_error(0));
        }
        if !(0.0..=MAX_TIME).contains(&time) {
            let reason = format!(
                "{TIME} is {} s, must lie in 0 … {MAX_TIME} s (100 h); is the column in s?",
                Rounded(time)
            );
            return Err(FileError::new(at(), reason));
        }
        let first = before.positions.is_empty();
        after.line = line;
        after.index = if first { 0 } else { before.index + 1 };
        after.time = nearest_nanosecond(time);
        if !first && after.time <= before.time {
            let before = seconds(before.time);
            let reason = format!("{TIME} is {time} s, must be later than {before} s of the previous row");
            return Err(FileError::new(at(), reason));
        }
        for (column, (joint, &position)) in limits.iter().zip(&after.positions).enumerate() {
            if !position.is_finite() {
                return Err(number_error(column + 1));
            }
            joint
                .check_travel_limits(Some(after.index), position)
                .map_err(|rejection| point_error(at(), &rejection))?;
            // Of an axis without travel limits.
            if position.abs() > MAX_VALUE {
                let (name, position) = (&joint.name, Rounded(position));
                let reason = format!("{name} is {position}, must lie in ±{MAX_VALUE:e} (m or rad)");
                return Err(FileError::new(at(), reason));
            }
        }
        if let Some(rows) = rows {
            let row = |line| PsecRow::new(line, after.time, &after.positions);
            rows.push(match recorded {
                Some(resolutions) => row(line.saturating_sub(1)).with_resolutions(resolutions),
                None => row(line).with_digits_of(text),
            });
        }
        Ok(true)
    }
}

/// Returns the line, or the sample of a recording, below the header, for errors.
fn place(name: &str, line: u64, is_recorded: bool) -> String {
    if is_recorded { format!("{name}: sample {}", line.saturating_sub(1)) } else { format!("{name}:{line}") }
}

/// Returns the error of a setpoint that the joint does not permit.
fn point_error(at: String, rejection: &Rejection) -> FileError {
    FileError::new(at, format_args!("{rejection}{}", unit_hint(rejection)))
}

/// Parses a number; NaN if invalid.
fn parse_number(text: &str) -> f64 {
    text.parse().unwrap_or(f64::NAN)
}

/// Converts a time from s to ns, rounded to nearest.
fn nearest_nanosecond(time: f64) -> Nanoseconds {
    let whole = time.floor();
    let rest = ((time - whole) * SECOND_NS as f64).round() as Nanoseconds;
    whole as Nanoseconds * SECOND_NS + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_position_cycles_are_integer_nanoseconds() {
        assert_eq!(nearest_nanosecond(0.006 * 1111.0), 6_666_000_000);
    }
}
