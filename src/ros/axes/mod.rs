//! Thread that owns the simulation, its commands, frames and reports. It paces the position cycles; the only module that reads the wall clock for them.
//!
//! In real time ([`real`]) position cycle k is computed and released when the wall clock reaches it. A late instant
//! is computed at once and counted; none is skipped. With a ROS clock ([`paced`]), published by this node in `fast` or
//! by another node, the simulation steps on the same time grid; the clock only determines the time of each step.

mod arc_pool;
mod clock_follower;
mod commands;
mod health;
mod paced;
mod program_monitor;
mod real;
mod stepper;
mod stream;
#[cfg(test)]
mod tests;
mod throttle;
mod wall;

pub use arc_pool::ArcPool;
pub use clock_follower::{ClockFollower, ClockState};
pub use commands::{
    Accepted, COMMAND_QUEUE, Command, MotionIds, PlannedSetpoints, SampleFrame, SimulationReport,
};
pub use health::{AxisHealth, ClockSource, Health};
pub use program_monitor::ProgramRunFigures;
pub use real::CooperativeTasks;
pub use throttle::Throttle;
pub use wall::origin;

use std::sync::Arc;

use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};

use virtual_axes_core::simulation::Simulation;

/// Channel ends of the axes' thread.
pub struct AxesChannels {
    /// Receiver of commands.
    pub commands: mpsc::Receiver<Command>,
    /// Sender of frames, bounded.
    pub frames: mpsc::Sender<Arc<SampleFrame>>,
    /// Sender of reports: at most two for each admitted trajectory, and a bounded number for streams.
    pub reports: mpsc::UnboundedSender<SimulationReport>,
    /// Sender of counters and state.
    pub health: watch::Sender<Health>,
}

/// Clock that paces the thread.
pub enum Pace {
    /// Wall clock.
    Real(CooperativeTasks),
    /// `/clock`.
    Clock {
        /// State of the followed clock; `None` in `fast`.
        followed: Option<watch::Receiver<ClockState>>,
        /// Runtime that drives timers and channels.
        runtime: Handle,
    },
}

/// Runs the simulation until [`Command::Shutdown`] or until a channel is closed.
pub fn run(simulation: Simulation, pace: Pace, channels: AxesChannels) {
    let AxesChannels { commands, frames, reports, health } = channels;
    let axes = stepper::Axes::new(simulation, reports, health);
    match pace {
        Pace::Real(tasks) => real::run(axes, commands, &frames, tasks),
        Pace::Clock { followed, runtime } => runtime.block_on(paced::run(axes, commands, &frames, followed)),
    }
}
