//! The node's parameters: what is set goes to the simulation as a command.

use std::sync::Arc;

use tokio::sync::mpsc;

use super::pace::Command;
pub use crate::ingress::parameters::LiveNodeParameters;
use crate::ingress::parameters::{ParameterDescriptor, ParameterHost, ParameterStore, ParameterValue};
use virtual_axes_core::config::Parameters;

/// Checks what is set against the schema, and hands it to the simulation as a command.
pub struct Host {
    settings: ParameterStore,
    commands: mpsc::Sender<Command>,
    /// Room among the commands for the next change.
    room: Option<mpsc::OwnedPermit<Command>>,
}

impl Host {
    /// A host of `parameters` whose changes go to `commands` and `live`.
    pub fn new(
        parameters: Parameters,
        commands: mpsc::Sender<Command>,
        live: Arc<LiveNodeParameters>,
    ) -> Self {
        Host { settings: ParameterStore::new(parameters, live), commands, room: None }
    }
}

impl ParameterHost for Host {
    fn names(&self) -> Vec<String> {
        self.settings.names()
    }

    fn get(&self, name: &str) -> Option<ParameterValue> {
        self.settings.get(name)
    }

    fn describe(&self, name: &str) -> Option<ParameterDescriptor> {
        self.settings.describe(name)
    }

    async fn ready(&mut self) {
        if self.room.is_none() {
            // None only when the node shuts down.
            self.room = self.commands.clone().reserve_owned().await.ok();
        }
    }

    fn set(&mut self, changes: Vec<(String, ParameterValue)>) -> Result<(), String> {
        // A predictive controller takes a while to design; other tasks go on meanwhile.
        let (changed, machine) = tokio::task::block_in_place(|| self.settings.check(changes))?;
        let room = self.room.take().ok_or("the node is shutting down")?;
        room.send(Command::Adopt(Arc::new(machine)));
        self.settings.replace(changed);
        Ok(())
    }
}
