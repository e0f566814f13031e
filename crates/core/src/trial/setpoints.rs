//! Where the setpoints of a trial come from.

use std::error::Error;
use std::sync::Arc;

use crate::path::Program;
use crate::trajectory::{JointLimits, Rejection, Request};
use crate::units::{Nanoseconds, seconds};

/// What a source of setpoints says when it fails; the text names the file and the place in it.
pub type SourceError = Box<dyn Error + Send + Sync>;

/// Setpoints on the position grid, one instant after the other.
pub trait GridSource {
    /// Places in the machine of the joints that it moves, in the order of its rows.
    fn joints(&self) -> &[usize];

    /// Writes PSEC of the next instant, m or rad; `false` behind the last one. The first is that of
    /// the start.
    ///
    /// # Errors
    /// Whatever keeps it from going on.
    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError>;
}

/// Trajectories with the times at which they arrive, ns, in order.
pub type Requests<'a> = dyn Iterator<Item = Result<(Nanoseconds, Request), SourceError>> + 'a;

/// Setpoints of a trial.
pub enum Setpoints<'a> {
    /// One after the other on the grid, from k = 0.
    Grid(Box<dyn GridSource + 'a>),
    /// Trajectories, as a node would receive them.
    Requests(Box<Requests<'a>>),
}

/// Setpoints of a planned path, computed and checked when they are asked for.
#[derive(Debug, Clone)]
pub struct ProgramSource {
    name: String,
    program: Arc<Program>,
    limits: Vec<JointLimits>,
    joints: Vec<usize>,
    period: Nanoseconds,
    next: i64,
}

/// A setpoint that the machine cannot reach.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name}: move {index}, at {time} s: {rejection}")]
pub struct UnreachableError {
    name: String,
    /// The move, from 1.
    index: usize,
    /// s from the start.
    time: f64,
    rejection: Rejection,
}

impl ProgramSource {
    /// Those of `program`, every `period` ns, for a machine with `limits`; `name` is for messages.
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
            let index = usize::try_from(self.next).unwrap_or(usize::MAX);
            joint.check_stroke(index, position).map_err(|rejection| {
                let (block, _) = self.program.path().locate(self.program.progress(time));
                Box::new(UnreachableError { name: self.name.clone(), index: block + 1, time, rejection })
            })?;
        }
        self.next += 1;
        Ok(true)
    }
}
