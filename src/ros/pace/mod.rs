//! The thread that owns the simulation, and the only place that reads the wall clock.
//!
//! In real time ([`real`]) position instant k is computed and released when the wall clock reaches
//! it; an instant that comes late is computed at once and counted, none is left out. By a ROS clock
//! ([`paced`]), the node's own in `fast` or that of somebody else, the simulation steps on the same
//! grid; only when it may step is another question.

mod axes;
mod health;
mod paced;
mod real;
#[cfg(test)]
mod tests;
mod wall;

pub use health::{AxisHealth, ClockHealth, ClockSource, Health};
pub use wall::origin;

use std::sync::Arc;

use futures::future::BoxFuture;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot, watch};

use super::clock::ClockState;
use super::stream::StreamSetpoints;
use virtual_axes_core::machine::{AxisSample, MachineParameters};
use virtual_axes_core::simulation::{MotionEnd, Simulation, Tolerances};
use virtual_axes_core::trajectory::{JointSet, MotionId, Rejection, StreamEnd, Trajectory};
use virtual_axes_core::units::Nanoseconds;

/// Commands that wait for the next position instant; a sender of more waits.
pub const COMMAND_QUEUE: usize = 64;

/// What the ROS side asks of the simulation; takes effect at the next position instant.
#[derive(Debug)]
pub enum Command {
    /// Run a trajectory.
    Offer {
        /// Its name here.
        id: MotionId,
        /// The trajectory, checked as far as it can be without the state of the axes.
        trajectory: Arc<Trajectory>,
        /// How far it may stray.
        tolerances: Option<Box<Tolerances>>,
    },
    /// Stop every joint; nobody is told what becomes of this motion.
    Stop(MotionId, Arc<Trajectory>),
    /// Call a motion off, and say whether there was one.
    Cancel(MotionId, oneshot::Sender<bool>),
    /// Put loads (N or N·m) on axes for a while.
    Load {
        /// Place of the axis, and load.
        loads: Arc<Vec<(usize, f64)>>,
        /// How long, ns.
        hold: Nanoseconds,
    },
    /// Take the setpoints of a stream over, where no trajectory moves.
    Stream(Arc<StreamSetpoints>),
    /// Take changed parameters over.
    Adopt(Arc<MachineParameters>),
    /// Back to rest at home.
    Reset(oneshot::Sender<()>),
    /// End the thread.
    Shutdown,
}

/// An accepted trajectory.
#[derive(Debug, Clone, Copy)]
pub struct Accepted {
    /// When its time 0 is, ns.
    pub start: Nanoseconds,
    /// Whether that was over when it came.
    pub is_late: bool,
}

/// What the simulation answers.
#[derive(Debug)]
pub enum Report {
    /// A trajectory has been accepted or refused at a time (ns).
    Decided(MotionId, Nanoseconds, Result<Accepted, Rejection>),
    /// A motion has ended.
    Ended(MotionEnd),
    /// Joints were taken away from a stream at a time (ns); the last field counts how many of these are on their way.
    StreamEnded(Nanoseconds, StreamEnd, JointSet, Arc<()>),
}

/// The samples of one position instant.
#[derive(Debug, Clone, Default)]
pub struct Frame {
    /// Position instant.
    pub instant: i64,
    /// Its time, ns.
    pub time: Nanoseconds,
    /// One per axis.
    pub samples: Vec<AxisSample>,
    /// How often the axes have been reset before it.
    pub resets: u64,
    /// The accepted motions that had not ended before it, with the times of their starts, ns.
    pub motions: Vec<(MotionId, Nanoseconds)>,
}

/// The thread's ends of the channels.
pub struct Channels {
    /// Commands in.
    pub commands: mpsc::Receiver<Command>,
    /// Frames out; bounded.
    pub frames: mpsc::Sender<Arc<Frame>>,
    /// Reports out: at most two for each trajectory that is held, and some of streams.
    pub reports: mpsc::UnboundedSender<Report>,
    /// Health out.
    pub health: watch::Sender<Health>,
}

/// Tasks that the simulation thread polls in each position cycle; they must neither block nor complete.
///
/// Waking a separate thread in each cycle would take longer than the work itself.
pub struct CooperativeTasks {
    /// Reception of streamed setpoints and loads, polled before each position cycle.
    pub input: BoxFuture<'static, ()>,
    /// Publication of frames, polled after each position cycle.
    pub output: BoxFuture<'static, ()>,
}

/// What the thread keeps step with.
pub enum Pace {
    /// The wall clock.
    Real(CooperativeTasks),
    /// A ROS clock, as the task that watches it tells.
    Clock {
        /// What it tells.
        state: watch::Receiver<ClockState>,
        /// Whose timers and channels are waited for.
        runtime: Handle,
    },
}

/// Runs the simulation until it is told to shut down or the ROS side is gone.
pub fn run(simulation: Simulation, pace: Pace, channels: Channels) {
    let Channels { commands, frames, reports, health } = channels;
    let axes = axes::Axes::new(simulation, reports, health);
    match pace {
        Pace::Real(tasks) => real::run(axes, commands, &frames, tasks),
        Pace::Clock { state, runtime } => runtime.block_on(paced::run(axes, commands, &frames, state)),
    }
}
