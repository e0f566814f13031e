//! Thread that owns the simulation and paces its position cycles; the only module that reads the wall clock for them.
//!
//! In real time ([`real`]) position cycle k is computed and released when the wall clock reaches it. A late instant
//! is computed at once and counted; none is skipped. With a ROS clock ([`paced`]), published by this node in `fast` or
//! by another node, the simulation steps on the same time grid; the clock only determines the time of each step.

mod axes;
mod paced;
mod real;
#[cfg(test)]
mod tests;
mod wall;

pub use wall::origin;

use std::sync::Arc;

use futures::future::BoxFuture;
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};

use super::axes_interface::{Command, SampleFrame, SimulationReport};
use super::clock::ClockState;
use super::health::Health;
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

/// Tasks that the axes' thread polls once per position cycle. They must neither block nor end.
///
/// A separate thread would be woken each cycle, which takes longer than the tasks themselves.
pub struct CooperativeTasks {
    /// Reception of streamed setpoints and loads, polled before each instant.
    pub inputs: BoxFuture<'static, ()>,
    /// Publication of the frames, polled after each instant.
    pub outputs: BoxFuture<'static, ()>,
}

/// Clock that paces the thread.
pub enum Pace {
    /// Wall clock.
    Real(CooperativeTasks),
    /// ROS clock.
    Clock {
        /// State of the clock.
        state: watch::Receiver<ClockState>,
        /// Runtime that drives timers and channels.
        runtime: Handle,
    },
}

/// Runs the simulation until [`Command::Shutdown`] or until a channel is closed.
pub fn run(simulation: Simulation, pace: Pace, channels: AxesChannels) {
    let AxesChannels { commands, frames, reports, health } = channels;
    let axes = axes::Axes::new(simulation, reports, health);
    match pace {
        Pace::Real(tasks) => real::run(axes, commands, &frames, tasks),
        Pace::Clock { state, runtime } => runtime.block_on(paced::run(axes, commands, &frames, state)),
    }
}
