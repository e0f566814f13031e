//! Thread that owns the simulation, and its channels.

use std::sync::Arc;
use std::thread;

use tokio::sync::{mpsc, oneshot, watch};

use super::error::NodeError;
use super::setup::NodeSetup;
use crate::ros::axes::{
    self, AxesChannels, COMMAND_QUEUE, Command, Health, Pace, SampleFrame, SimulationReport,
};
use crate::ros::topics::queue_length;
use virtual_axes_core::simulation::{Simulation, SimulationError};

/// Axes' thread before its start.
pub(super) struct AxesThread {
    simulation: Simulation,
    channels: AxesChannels,
}

/// Channel ends of the ROS side.
pub(super) struct AxesThreadEnds {
    pub(super) commands: mpsc::Sender<Command>,
    pub(super) frames: mpsc::Receiver<Arc<SampleFrame>>,
    pub(super) reports: mpsc::UnboundedReceiver<SimulationReport>,
}

impl AxesThread {
    /// Creates the simulation and the channels.
    ///
    /// # Errors
    /// [`SimulationError`] if the machine cannot be simulated.
    pub(super) fn new(
        setup: &NodeSetup,
        health: watch::Sender<Health>,
    ) -> Result<(Self, AxesThreadEnds), SimulationError> {
        let origin = axes::origin(setup.mode, setup.period);
        let simulation = Simulation::new(&setup.config, setup.joint_limits.clone(), origin)?;
        let (commands, commands_in) = mpsc::channel(COMMAND_QUEUE);
        let (frames_out, frames) = mpsc::channel(queue_length(setup.overflow));
        let (reports_out, reports) = mpsc::unbounded_channel();
        let channels =
            AxesChannels { commands: commands_in, frames: frames_out, reports: reports_out, health };
        Ok((AxesThread { simulation, channels }, AxesThreadEnds { commands, frames, reports }))
    }

    /// Starts the thread. The returned receiver resolves when it has ended.
    ///
    /// # Errors
    /// [`NodeError::System`] if the operating system does not start it.
    pub(super) fn spawn(self, pace: Pace) -> Result<oneshot::Receiver<()>, NodeError> {
        let AxesThread { simulation, channels } = self;
        let (ended, has_ended) = oneshot::channel();
        thread::Builder::new()
            .name("axes".into())
            .spawn(move || {
                axes::run(simulation, pace, channels);
                let _ = ended.send(());
            })
            .map_err(|source| NodeError::System { what: "start the axes' thread", source })?;
        Ok(has_ended)
    }
}
