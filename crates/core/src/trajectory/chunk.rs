//! Chunk of a motion that is planned while it runs, and its column for one joint.

use std::fmt::Debug;
use std::sync::Arc;

use super::path_time::PathTime;
use super::spline::KinematicState;
use crate::units::{Nanoseconds, SECOND_NS};

/// Chunk of a planned motion of all joints.
///
/// Times count from the start of the chunk, s; beyond its ends it is at rest there.
pub trait MotionChunk: Debug + Send + Sync {
    /// Returns the duration, position cycles, at least 1.
    fn cycles(&self) -> i64;
    /// Writes the positions of all joints at `time` into `joints`, m or rad.
    fn positions(&self, time: f64, joints: &mut [f64]);
    /// Returns the state of `joint` at `time`.
    fn state(&self, joint: usize, time: f64) -> KinematicState;
    /// Returns the place on the path at `time`.
    fn place(&self, time: f64) -> PathPlace;
}

/// Place on the path of a part program.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PathPlace {
    /// Source line, from 1; 0 before the first motion.
    pub line: usize,
    /// Programmed feed, m/s or rad/s; infinite at rapid traverse.
    pub programmed_feed: f64,
    /// Planned rate of the path position, m/s.
    pub path_rate: f64,
    /// Path position from the start of the program, m.
    pub path_position: f64,
}

/// Standstill before the first chunk.
#[derive(Debug)]
pub(super) struct RestChunk(pub Vec<f64>);

impl MotionChunk for RestChunk {
    fn cycles(&self) -> i64 {
        0
    }

    fn positions(&self, _: f64, joints: &mut [f64]) {
        joints.copy_from_slice(&self.0);
    }

    fn state(&self, joint: usize, _: f64) -> KinematicState {
        KinematicState::at_rest(self.0[joint])
    }

    fn place(&self, _: f64) -> PathPlace {
        PathPlace::default()
    }
}

/// Column of a chunk, executed by one joint.
#[derive(Debug, Clone)]
pub(super) struct ChunkColumn {
    pub chunk: Arc<dyn MotionChunk>,
    pub joint: usize,
    /// Instant of the path time at the start of the chunk.
    pub start_k: i64,
}

impl ChunkColumn {
    /// Returns the time in the chunk at `path`, s.
    pub fn local_time(&self, path: PathTime, period: Nanoseconds) -> f64 {
        path.since(self.start_k.saturating_mul(period)) / SECOND_NS as f64
    }

    /// Returns the state at `path`.
    pub fn state(&self, path: PathTime, period: Nanoseconds) -> KinematicState {
        self.chunk.state(self.joint, self.local_time(path, period))
    }

    /// Returns the instant of the path time at the end of the chunk.
    pub fn end_k(&self) -> i64 {
        self.start_k.saturating_add(self.chunk.cycles())
    }
}
