//! Chunks of planned motion: a part program that runs in a timeline.

use std::sync::Arc;

use virtual_axes_core::trajectory::{KinematicState, MotionChunk, PathPlace};

use super::error::FeedPlanError;
use super::interval_motion::{IntervalMotion, PathState};
use super::machine_model::MachineModel;
use super::piece::Piece;
use super::pieces::Mark;
use super::planner::PartProgramPlanner;
use super::vector::JointVector;

/// Motion along one interval of the path, from a time in the chunk on.
#[derive(Debug, Clone)]
struct ChunkPart {
    /// Time at which the part begins, from the start of the chunk, s.
    begin: f64,
    /// Time from the start of the interval to the start of the part, s.
    offset: f64,
    piece: Option<Arc<Piece>>,
    /// Start of the interval from the start of the piece.
    from: f64,
    motion: IntervalMotion,
}

/// Chunk of the planned motion of a part program, from one position cycle to a later one.
#[derive(Debug)]
pub struct PlannedChunk {
    model: Arc<MachineModel>,
    /// Parts in order of time, at least one.
    parts: Vec<ChunkPart>,
    /// Joints before the first motion of the program.
    start: JointVector,
    /// Lines and feeds along the chunk.
    marks: Vec<Mark>,
    cycles: i64,
    /// True for the last chunk of the program.
    is_last: bool,
}

impl PlannedChunk {
    /// Returns the part at `time`, s, and the state of the path parameter there, from the start of its interval.
    fn at(&self, time: f64) -> (&ChunkPart, PathState) {
        let index = self.parts.partition_point(|part| part.begin <= time).saturating_sub(1);
        let part = &self.parts[index];
        let local = (part.offset + (time - part.begin).max(0.0)).min(part.motion.duration);
        let mut state = part.motion.at(local);
        if self.is_last && index + 1 == self.parts.len() && local >= part.motion.duration {
            let length = part.piece.as_ref().map_or(0.0, |piece| piece.length);
            state = PathState { u: length - part.from, rate: 0.0, acceleration: 0.0 };
        }
        (part, state)
    }
}

impl MotionChunk for PlannedChunk {
    fn cycles(&self) -> i64 {
        self.cycles
    }

    fn positions(&self, time: f64, joints: &mut [f64]) {
        let (part, state) = self.at(time);
        let position =
            |piece: &Arc<Piece>| self.model.joints(piece, (part.from + state.u).min(piece.length))[0];
        let values = part.piece.as_ref().map_or(self.start, position);
        joints.iter_mut().zip(values).for_each(|(joint, value)| *joint = value);
    }

    fn state(&self, joint: usize, time: f64) -> KinematicState {
        let (part, PathState { u, rate, acceleration }) = self.at(time);
        let Some(piece) = &part.piece else { return KinematicState::at_rest(self.start[joint]) };
        let [position, first, second, _] = self.model.joints(piece, (part.from + u).min(piece.length));
        KinematicState {
            position: position[joint],
            velocity: first[joint] * rate,
            acceleration: first[joint] * acceleration + second[joint] * rate * rate,
        }
    }

    fn place(&self, time: f64) -> PathPlace {
        let (part, state) = self.at(time);
        let start = part.piece.as_ref().map_or(0.0, |piece| piece.start);
        let path_position = start + part.from + state.u;
        let index = self.marks.partition_point(|mark| mark.end < path_position);
        let mark = self.marks.get(index).or(self.marks.last());
        PathPlace {
            line: mark.map_or(0, |mark| mark.line),
            programmed_feed: mark.map_or(f64::INFINITY, |mark| mark.feed),
            path_rate: state.rate,
            path_position,
        }
    }
}

impl PartProgramPlanner<'_> {
    /// Returns the next chunk of the motion as planned, of at least `cycles` position cycles unless it is the last one, or
    /// `None` after the end of the program. Chunks and [`next_setpoint`](Self::next_setpoint) are not mixed.
    ///
    /// # Errors
    /// Returns [`FeedPlanError`] with the source line, or for a control with filters of the setpoints.
    pub fn next_chunk(&mut self, cycles: u32) -> Result<Option<PlannedChunk>, FeedPlanError> {
        if !self.filters.is_empty() {
            self.is_finished = true;
            let (name, allowed) =
                ("control.filter_1_ms or control.filter_2_ms", "0 where the path is executed in chunks");
            return Err(FeedPlanError::InvalidOption { name, value: 1e3 * self.filter_time, allowed });
        }
        if self.is_finished {
            return Ok(None);
        }
        let result = self.chunk(cycles.max(1));
        self.is_finished |= result.is_err();
        result
    }

    fn chunk(&mut self, cycles: u32) -> Result<Option<PlannedChunk>, FeedPlanError> {
        if !self.is_started && !self.start()? {
            return Ok(None);
        }
        let (mut parts, mut elapsed) = (Vec::<ChunkPart>::new(), 0.0);
        for _ in 0..cycles {
            // At the same times as for single setpoints, so that the plan is the same.
            self.pass(1.0, |entry, offset, time| {
                if let Some(motion) = entry.motion
                    && (parts.is_empty() || offset == 0.0)
                {
                    let piece = entry.piece.clone();
                    parts.push(ChunkPart { begin: elapsed, offset, piece, from: entry.from, motion });
                }
                elapsed += time;
            })?;
            if self.is_finished {
                break;
            }
        }
        self.ahead.renew(self.passed, self.local + self.reserve)?;
        self.is_finished = self.ahead.entries.is_empty();
        if parts.is_empty() {
            return Ok(None);
        }
        let cycles =
            if self.is_finished { (elapsed / self.period).ceil().max(1.0) as i64 } else { i64::from(cycles) };
        let mut chunk = PlannedChunk {
            model: Arc::clone(&self.ahead.model),
            parts,
            marks: Vec::new(),
            start: self.last.psec,
            cycles,
            is_last: self.is_finished,
        };
        self.take_marks(&mut chunk);
        self.check_chunk(&chunk)?;
        Ok(Some(chunk))
    }

    /// Moves lines and feeds of the path passed to `chunk`; those at its end are also kept.
    fn take_marks(&mut self, chunk: &mut PlannedChunk) {
        let end = chunk.place(chunk.cycles as f64 * self.period).path_position;
        let marks = &mut self.ahead.source.marks;
        let passed = marks.partition_point(|mark| mark.end < end);
        chunk.marks = marks.iter().take(passed + 1).copied().collect();
        marks.drain(..passed.min(marks.len().saturating_sub(1)));
    }

    fn check_chunk(&mut self, chunk: &PlannedChunk) -> Result<(), FeedPlanError> {
        for cycle in 0..=chunk.cycles {
            let time = cycle as f64 * self.period;
            chunk.positions(time, &mut self.last.psec[..self.ahead.model.joints.len()]);
            self.last.place.line = chunk.place(time).line;
            self.check_travel_limits()?;
        }
        Ok(())
    }
}
