//! Setpoint sources of a trial: grid, trajectories, or a planned program.

use std::error::Error;
use std::sync::Arc;

use crate::path::Program;
use crate::trajectory::{JointLimits, Rejection, TrajectoryRequest};
use crate::units::{Nanoseconds, seconds};

/// Error of a setpoint source; its text names the file and the position in it.
pub type SourceError = Box<dyn Error + Send + Sync>;

/// Setpoints on the position grid, one instant after the other.
pub trait GridSource {
    /// Returns the machine indices of the moved joints, in the order of the rows.
    fn joints(&self) -> &[usize];

    /// Writes the position setpoints (PSEC) of the next instant, m or rad, and returns false after the last
    /// one. The first row is the start position.
    ///
    /// # Errors
    /// Returns an error if the setpoints cannot be read or are invalid.
    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError>;

    /// Returns true if the row written last is reached at rapid traverse.
    fn is_rapid(&self) -> bool {
        false
    }
}

/// Setpoints in memory, row by row.
#[derive(Debug, Clone, Copy)]
pub struct GridRows<'a> {
    joints: &'a [usize],
    rows: &'a [f64],
    /// True for each row that is reached at rapid traverse; further rows are as the last one.
    rapid: &'a [bool],
    is_rapid: bool,
}

impl<'a> GridRows<'a> {
    /// Creates the source of `rows`, m or rad, one value per joint in the order of `joints` (machine indices), row after
    /// row; an incomplete last row is ignored.
    pub fn new(joints: &'a [usize], rows: &'a [f64]) -> Self {
        GridRows { joints, rows, rapid: &[], is_rapid: false }
    }

    /// Sets for each row whether it is reached at rapid traverse; further rows are as the last one.
    #[must_use]
    pub fn with_rapid(self, rapid: &'a [bool]) -> Self {
        GridRows { rapid, ..self }
    }
}

impl GridSource for GridRows<'_> {
    fn joints(&self) -> &[usize] {
        self.joints
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        let Some((first, rest)) = self.rows.split_at_checked(row.len()) else { return Ok(false) };
        row.copy_from_slice(first);
        self.rows = rest;
        if let Some((is_rapid, rest)) = self.rapid.split_first() {
            (self.is_rapid, self.rapid) = (*is_rapid, rest);
        }
        // A row without joints would never end.
        Ok(!row.is_empty())
    }

    fn is_rapid(&self) -> bool {
        self.is_rapid
    }
}

/// Trajectories with their arrival times, ns, in order.
pub type Requests<'a> = dyn Iterator<Item = Result<(Nanoseconds, TrajectoryRequest), SourceError>> + 'a;

/// Setpoints of a trial.
pub enum SetpointSource<'a> {
    /// Rows on the position grid, from k = 0.
    Grid(Box<dyn GridSource + 'a>),
    /// Trajectories as received by a node.
    Requests(Box<Requests<'a>>),
}

/// Setpoints of a planned path, computed and checked row by row.
#[derive(Debug, Clone)]
pub struct ProgramSource {
    name: String,
    program: Arc<Program>,
    limits: Vec<JointLimits>,
    joints: Vec<usize>,
    period: Nanoseconds,
    next: i64,
}

/// A setpoint outside the travel limits.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name}: move {index}, at {time} s: {rejection}")]
pub struct UnreachableError {
    name: String,
    /// Move, counted from 1.
    index: usize,
    /// Time from the start, s.
    time: f64,
    rejection: Rejection,
}

impl ProgramSource {
    /// Creates the setpoints of `program`, every `period` ns, for a machine with `limits`; `name` is used
    /// in messages.
    pub fn new(program: Arc<Program>, name: &str, limits: &[JointLimits], period: Nanoseconds) -> Self {
        let (limits, joints) = (limits.to_vec(), (0..limits.len()).collect());
        ProgramSource { name: name.to_owned(), program, limits, joints, period, next: 0 }
    }
}

impl GridSource for ProgramSource {
    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        let time = seconds(self.next * self.period);
        if self.next > 0 && seconds((self.next - 1) * self.period) >= self.program.duration() {
            return Ok(false);
        }
        self.program.psec(time, row);
        for (joint, &position) in self.limits.iter().zip(&*row) {
            joint.check_travel_limits(None, position).map_err(|rejection| {
                let (block, _) = self.program.path().locate(self.program.progress(time));
                Box::new(UnreachableError { name: self.name.clone(), index: block + 1, time, rejection })
            })?;
        }
        self.next += 1;
        Ok(true)
    }
}
