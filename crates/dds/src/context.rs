//! DDS participant: domain, network range and security from the environment; dispose at shutdown.

use std::time::{Duration, Instant};

use ros2_client::{NodeName, NodeOptions};
use rustdds::DomainParticipant;
#[cfg(feature = "security")]
use rustdds::DomainParticipantSecurityConfigFiles;

use crate::defects::{dispose, static_peers};
use crate::environment::Environment;
use crate::hosts;
use crate::node::Node;
use crate::security::Security;
#[cfg(not(feature = "security"))]
use crate::security::SecurityError;

/// Failure to join the network or to create a node.
#[derive(Debug, thiserror::Error)]
pub enum ContextError {
    /// The participant could not be created, mostly because no port is free.
    #[error("cannot open a DDS participant in domain {domain_id}: {reason}")]
    Open {
        /// Domain id.
        domain_id: u16,
        /// Reason of the middleware.
        reason: String,
    },
    /// The ROS context on the participant could not be created.
    #[error("cannot set up ROS on the DDS participant: {0}")]
    Setup(String),
    /// The node could not be created.
    #[error("the node {name} cannot be created: {reason}")]
    Node {
        /// Fully qualified name of the node.
        name: String,
        /// Reason of the middleware.
        reason: String,
    },
}

/// Owner of the DDS participant, which is disposed of on drop.
///
/// Drop publishers, subscriptions, services and the node first, then call [`Self::shutdown`] or drop this value. A
/// remaining one continues to announce the participant, and it would be discovered again after the dispose.
#[derive(Debug)]
pub struct Context {
    participant: Option<DomainParticipant>,
    environment: Environment,
}

impl Context {
    /// Opens a participant in the domain and on the networks that `environment` names, with the given DDS Security.
    ///
    /// # Errors
    /// [`ContextError::Open`] if sockets or threads are not available, if this build has no DDS Security, or if the files
    /// of the enclave do not permit the domain.
    pub fn open(environment: &Environment, security: &Security) -> Result<Self, ContextError> {
        let domain_id = environment.domain_id();
        let failed = |reason| ContextError::Open { domain_id, reason };
        let builder = environment.participant_builder();
        #[cfg(feature = "security")]
        let builder = match security {
            Security::Off | Security::Unprotected(_) => builder,
            Security::Enclave(folder) => {
                crate::rtps::set_secured();
                // Private keys of SROS2 have no password.
                let files =
                    DomainParticipantSecurityConfigFiles::with_ros_default_names(folder, String::new());
                builder.builtin_security(files)
            }
        };
        #[cfg(not(feature = "security"))]
        if let Security::Enclave(_) = security {
            return Err(failed(SecurityError::NotBuilt.to_string()));
        }
        if let Security::Unprotected(reason) = security {
            tracing::warn!("communication of this node is not protected: {reason}");
        }
        hosts::set_range(environment.range());
        let participant = builder.build().map_err(|error| failed(error.to_string()))?;
        static_peers::announce(&participant, environment.static_peers());
        Ok(Self { participant: Some(participant), environment: environment.clone() })
    }

    /// Creates a node; its name and namespace must be valid.
    ///
    /// The parameter services, `/rosout` and the spinner of ros2-client are not used: they lack descriptions, lose
    /// responses to unmatched clients, keep one message for late joiners, and subscribe to `/clock` with another type.
    ///
    /// # Errors
    /// [`ContextError::Setup`], [`ContextError::Node`] with the reason of the middleware.
    pub fn create_node(&self, namespace: &str, name: &str) -> Result<Node, ContextError> {
        let participant = self.participant.clone().ok_or_else(closed)?;
        let context = ros2_client::Context::from_domain_participant(participant)
            .map_err(|error| ContextError::Setup(error.to_string()))?;
        let failed = |reason| ContextError::Node {
            name: format!("{}/{name}", namespace.trim_end_matches('/')),
            reason,
        };
        let node_name = NodeName::new(namespace, name).map_err(|error| failed(format!("{error:?}")))?;
        let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
        let node = context.new_node(node_name.clone(), options).map_err(|error| failed(error.to_string()))?;
        Ok(Node::new(node, node_name, context, self.environment.range()))
    }

    /// Disposes of the participant and sends the dispose message to all participants that may know it. Returns the time
    /// taken, about 40 ms.
    pub fn shutdown(mut self) -> Duration {
        self.dispose()
    }

    fn dispose(&mut self) -> Duration {
        let start = Instant::now();
        if let Some(participant) = self.participant.take() {
            let message = dispose::of_participant(&participant, self.environment.range());
            // Dropped first, because RustDDS could announce the participant again after the dispose.
            drop(participant);
            message.send();
        }
        start.elapsed()
    }
}

fn closed() -> ContextError {
    ContextError::Setup("the participant is shut down".to_owned())
}

impl Drop for Context {
    fn drop(&mut self) {
        self.dispose();
    }
}
