//! Errors that prevent the node from starting.

use crate::ros::endpoints::EndpointError;
use crate::ros::participant::ParticipantError;
use crate::ros::recorder::RecordError;
use crate::ros::service::{ServiceError, ServiceNameConflict};
use virtual_axes_core::config::ConfigError;
use virtual_axes_core::simulation::SimulationError;

/// Failure to start the node.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The parameters do not define a valid machine.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The machine cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The DDS participant cannot be created.
    #[error(transparent)]
    Participant(#[from] ParticipantError),
    /// The middleware cannot create the node.
    #[error("the node {name} cannot be created: {reason}")]
    Node {
        /// Fully qualified name of the node.
        name: String,
        /// Message of the middleware.
        reason: String,
    },
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
