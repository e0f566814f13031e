//! The node's parameters: what is set goes to the simulation as a command.

use std::sync::Arc;

use tokio::sync::mpsc;

use super::pace::Command;
use crate::config::Parameters;
pub use crate::door::parameters::LiveNodeParameters;
use crate::door::parameters::{Descriptor, ParameterHost, ParameterValue, Settings};

/// Checks what is set against the schema, and hands it to the simulation as a command.
pub struct Host {
    settings: Settings,
    commands: mpsc::Sender<Command>,
}

impl Host {
    /// A host of `parameters` whose changes go to `commands` and `live`.
    pub fn new(
        parameters: Parameters,
        commands: mpsc::Sender<Command>,
        live: Arc<LiveNodeParameters>,
    ) -> Self {
        Host { settings: Settings::new(parameters, live), commands }
    }
}

impl ParameterHost for Host {
    fn names(&self) -> Vec<String> {
        self.settings.names()
    }

    fn get(&self, name: &str) -> Option<ParameterValue> {
        self.settings.get(name)
    }

    fn describe(&self, name: &str) -> Option<Descriptor> {
        self.settings.describe(name)
    }

    fn set(&mut self, changes: Vec<(String, ParameterValue)>) -> Result<(), String> {
        let (changed, machine) = self.settings.check(changes)?;
        self.commands
            .try_send(Command::Adopt(Arc::new(machine)))
            .map_err(|_| "too many commands wait for the next position period; try again".to_owned())?;
        self.settings.adopt(changed);
        Ok(())
    }
}
