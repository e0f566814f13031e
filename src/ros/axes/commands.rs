//! Commands to the thread that owns the simulation, and its frames and reports.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tokio::sync::{oneshot, watch};

use super::clock_follower::ClockState;
use super::program_monitor::{ProgramPlace, ProgramRunFigures};
use crate::validation::StreamSetpoints;
use virtual_axes_core::machine::{AxisSample, MachineParameters};
use virtual_axes_core::simulation::{MotionEnd, Tolerances};
use virtual_axes_core::trajectory::{
    JointSet, KinematicState, MotionChunk, MotionId, Rejection, StreamEnd, Trajectory,
};
use virtual_axes_core::units::Nanoseconds;

/// Capacity of the command queue. A sender waits while the queue is full.
pub const COMMAND_QUEUE: usize = 64;

/// Shared counter of motion ids.
#[derive(Debug, Clone, Default)]
pub struct MotionIds(Arc<AtomicU64>);

impl MotionIds {
    /// Returns the next motion id, from 1 on.
    pub fn next(&self) -> MotionId {
        MotionId(self.0.fetch_add(1, Ordering::Relaxed) + 1)
    }
}

/// Clock that paces the position cycles.
#[derive(Debug)]
pub enum Clock {
    /// Wall clock.
    Wall,
    /// `/clock`: its followed state; `None` in `fast`, where this node publishes it.
    Ros(Option<watch::Receiver<ClockState>>),
}

/// Command to the simulation; takes effect at the next position cycle.
#[derive(Debug)]
pub enum Command {
    /// Submits a trajectory.
    Submit {
        /// Identifier of its motion.
        id: MotionId,
        /// Trajectory that passed all checks that do not depend on the state of the axes.
        trajectory: Arc<Trajectory>,
        /// Path and goal tolerances.
        tolerances: Option<Box<Tolerances>>,
    },
    /// Begins a motion that is planned while it runs.
    BeginMotion {
        /// Identifier of the motion.
        id: MotionId,
        /// Indices of the linear axes.
        linear: Vec<usize>,
        /// Sender of the positions at which it begins, m or rad.
        rest: oneshot::Sender<Vec<f64>>,
    },
    /// Appends a chunk to a motion that is planned while it runs.
    ExtendMotion {
        /// Identifier of the motion.
        id: MotionId,
        /// Chunk.
        chunk: Arc<dyn MotionChunk>,
    },
    /// Ends a motion that is planned while it runs with its last chunk.
    FinishMotion(MotionId),
    /// Stops every joint; the motion is not reported.
    Stop(MotionId, Arc<Trajectory>),
    /// Cancels a motion, and returns true if it was active or waiting.
    Cancel(MotionId, oneshot::Sender<bool>),
    /// Sets the feed override, 0 to 2.
    SetFeedOverride(f64),
    /// Begins or ends a feed hold.
    SetFeedHold(bool),
    /// Applies external loads for a limited time.
    Load {
        /// Index of the axis, and load, N or N·m.
        loads: Arc<Vec<(usize, f64)>>,
        /// Duration, ns.
        hold: Nanoseconds,
    },
    /// Submits the setpoints of a stream.
    Stream(Arc<StreamSetpoints>),
    /// Returns the setpoints planned at a time, ns.
    QueryState(Nanoseconds, oneshot::Sender<PlannedSetpoints>),
    /// Applies changed machine parameters.
    UpdateParameters(Arc<MachineParameters>),
    /// Resets the machine to rest at home.
    Reset(oneshot::Sender<()>),
    /// Accepts motions and publishes samples.
    Activate,
    /// Rejects motions, stops every joint, and publishes no samples once all are at rest.
    Deactivate {
        /// Identifier of the stop, which is not reported.
        id: MotionId,
        /// Controlled stop; `None` if the machine has no joint.
        stop: Option<Arc<Trajectory>>,
        /// Resolves when the setpoints are at rest.
        done: oneshot::Sender<()>,
    },
    /// Changes the clock: motions are aborted, as at a jump of the clock.
    SetClock(Clock),
    /// Ends the thread.
    Shutdown,
}

/// Setpoints planned at a time.
#[derive(Debug)]
pub struct PlannedSetpoints {
    /// Setpoint of each joint.
    pub states: Vec<KinematicState>,
    /// True if a trajectory commands a joint at that time.
    pub is_commanded: bool,
    /// True if a trajectory is active or waiting.
    pub has_trajectory: bool,
}

/// Acceptance of a trajectory.
#[derive(Debug, Clone, Copy)]
pub struct Accepted {
    /// Start time of the trajectory, ns.
    pub start: Nanoseconds,
    /// True if the start time had passed when the trajectory was received.
    pub is_late: bool,
}

/// Report of the simulation.
#[derive(Debug)]
pub enum SimulationReport {
    /// Acceptance or rejection of a trajectory, with its time, ns.
    Decision(MotionId, Nanoseconds, Result<Accepted, Rejection>),
    /// End of a motion.
    MotionEnded(MotionEnd),
    /// End of a part program.
    ProgramEnded(MotionEnd, ProgramRunFigures),
    /// End of a stream on some joints, with its time, ns. The last field counts the unread reports of this kind.
    StreamEnded(Nanoseconds, StreamEnd, JointSet, Arc<()>),
}

/// Samples of all axes at one position cycle.
#[derive(Debug, Clone, Default)]
pub struct SampleFrame {
    /// True if the samples are published; false while a managed node is not active.
    pub is_published: bool,
    /// Number of the position cycle.
    pub instant: i64,
    /// Time of the position cycle, ns.
    pub time: Nanoseconds,
    /// Sample of each axis.
    pub samples: Vec<AxisSample>,
    /// Feed override in effect.
    pub feed_rate: f64,
    /// Place of the active part program.
    pub program: Option<ProgramPlace>,
    /// Number of resets before the instant.
    pub resets: u64,
    /// Accepted motions that had not ended before the instant, with their start times, ns.
    pub motions: Vec<(MotionId, Nanoseconds)>,
}
