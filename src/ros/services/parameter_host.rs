//! Parameters of the node: validation of changes and their transfer to the simulation.

use std::sync::Arc;

use tokio::sync::mpsc;

use crate::ros::axes::Command;
use crate::validation::parameters::{
    LiveNodeParameters, ParameterDescriptor, ParameterHost, ParameterStore, ParameterValue,
};
use virtual_axes_core::config::Parameters;

/// Function that changes the clock of a running node: to `/clock` if true, else to the wall clock. Its error is a reason.
pub type SetClock = Box<dyn FnMut(bool) -> Result<(), String> + Send>;

/// Parameter host that validates changes against the schema and sends them to the simulation.
pub struct NodeParameterHost {
    store: ParameterStore,
    commands: mpsc::Sender<Command>,
    /// Permit for the command of the next change.
    permit: Option<mpsc::OwnedPermit<Command>>,
    set_clock: SetClock,
}

impl NodeParameterHost {
    /// Creates a host of `parameters` that sends changes to `commands` and stores them in `live`; `set_clock`
    /// follows `use_sim_time`.
    pub fn new(
        parameters: Parameters,
        commands: mpsc::Sender<Command>,
        live: Arc<LiveNodeParameters>,
        set_clock: SetClock,
    ) -> Self {
        NodeParameterHost { store: ParameterStore::new(parameters, live), commands, permit: None, set_clock }
    }
}

impl ParameterHost for NodeParameterHost {
    fn names(&self) -> Vec<String> {
        self.store.names()
    }

    fn get(&self, name: &str) -> Option<ParameterValue> {
        self.store.get(name)
    }

    fn describe(&self, name: &str) -> Option<ParameterDescriptor> {
        self.store.describe(name)
    }

    async fn ready(&mut self) {
        if self.permit.is_none() {
            // The channel is closed only at shutdown.
            self.permit = self.commands.clone().reserve_owned().await.ok();
        }
    }

    fn set(&mut self, changes: Vec<(String, ParameterValue)>) -> Result<(), String> {
        // The design of a predictive controller takes long; other tasks continue meanwhile.
        let (changed, machine) = tokio::task::block_in_place(|| self.store.check(changes))?;
        let permit = self.permit.take().ok_or("the node is shutting down")?;
        let uses_sim_time = changed.node_config().use_sim_time;
        if uses_sim_time != self.store.parameters().node_config().use_sim_time {
            (self.set_clock)(uses_sim_time)?;
        }
        permit.send(Command::UpdateParameters(Arc::new(machine)));
        self.store.replace(changed);
        Ok(())
    }
}

/// Parameter that no node can set, since it limits which files other nodes can run.
const PROGRAM_FOLDER: &str = "program_folder";

/// Parameter host of a managed node that is not configured: every parameter but `program_folder` can be set.
pub struct UnconfiguredParameterHost {
    store: ParameterStore,
    /// Changes since the start.
    changes: Vec<(String, ParameterValue)>,
}

impl UnconfiguredParameterHost {
    /// Creates a host of `parameters`.
    pub fn new(parameters: Parameters) -> Self {
        UnconfiguredParameterHost {
            store: ParameterStore::new(parameters, Arc::default()),
            changes: Vec::new(),
        }
    }

    /// Returns `parameters` with the changes since the start.
    ///
    /// # Errors
    /// Text with name, value and allowed values of a change that is invalid with these parameters.
    pub fn apply_to(&self, parameters: Parameters) -> Result<Parameters, String> {
        let store = ParameterStore::new(parameters, Arc::default());
        store.check_all(self.changes.clone()).map(|(changed, _)| changed)
    }
}

impl ParameterHost for UnconfiguredParameterHost {
    fn names(&self) -> Vec<String> {
        self.store.names()
    }

    fn get(&self, name: &str) -> Option<ParameterValue> {
        self.store.get(name)
    }

    fn describe(&self, name: &str) -> Option<ParameterDescriptor> {
        self.store.describe(name)
    }

    async fn ready(&mut self) {}

    fn set(&mut self, changes: Vec<(String, ParameterValue)>) -> Result<(), String> {
        if changes.iter().any(|(name, _)| name == PROGRAM_FOLDER) {
            return Err(format!(
                "{PROGRAM_FOLDER} cannot be set by other nodes, whose access to files it limits; set it at the start with -p \
                 or --params-file"
            ));
        }
        let (changed, _) = tokio::task::block_in_place(|| self.store.check_all(changes.clone()))?;
        self.store.replace(changed);
        // Of several changes of a parameter the last one counts.
        self.changes.retain(|(name, _)| changes.iter().all(|(changed, _)| changed != name));
        self.changes.extend(changes);
        Ok(())
    }
}
