//! Errors that prevent the node from starting.

use crate::ros::services::{ServiceError, ServiceNameConflict};
use crate::ros::topics::{EndpointError, RecordError};
use virtual_axes_core::config::ConfigError;
use virtual_axes_core::simulation::SimulationError;
use virtual_axes_dds::ContextError;

/// Failure to start the node.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The parameters do not define a valid machine.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The machine cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The DDS participant or the node cannot be created.
    #[error(transparent)]
    Context(#[from] ContextError),
    /// A topic cannot be created.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// A service cannot be created.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// Two services have the same resolved name.
    #[error(transparent)]
    ServiceNameConflict(#[from] ServiceNameConflict),
    /// The operating system does not provide a thread, timer or signal handler.
    #[error("cannot {what}: {source}")]
    System {
        /// Failed action.
        what: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The recording cannot be started.
    #[error(transparent)]
    Record(#[from] RecordError),
}

impl NodeError {
    /// Returns true for an error of the user's input, as opposed to one of the system or the middleware.
    #[must_use]
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Record(_)
                | Self::Endpoint(EndpointError::TopicTypeConflict { .. })
                | Self::ServiceNameConflict(_)
        )
    }
}
