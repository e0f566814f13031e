//! DDS participant of the node: domain, network range and security from the environment; dispose at shutdown.

use std::time::{Duration, Instant};

use ros2_client::{Context, Node, NodeName, NodeOptions};
use rustdds::DomainParticipant;
#[cfg(feature = "security")]
use rustdds::DomainParticipantSecurityConfigFiles;

use super::args::RosArgs;
use super::environment::{DiscoveryRange, Environment};
#[cfg(not(feature = "security"))]
use super::security::SecurityError;
use super::{dispose, security::Security};

/// Failure to join the network.
#[derive(Debug, thiserror::Error)]
pub enum ParticipantError {
    /// The participant could not be created, mostly because no port is free.
    #[error("cannot open a DDS participant in domain {domain_id}: {reason}")]
    Open {
        /// Domain id.
        domain_id: u16,
        /// Reason of the middleware.
        reason: String,
    },
    /// The ROS context on the participant could not be created.
    #[error("cannot set up ROS on the DDS participant: {reason}")]
    Context {
        /// Reason of the middleware.
        reason: String,
    },
}

/// Creates a ROS node with the name in `args`; parameter services and `/rosout` are not those of ros2-client. Returns
/// the reason of the middleware if it fails.
pub(super) fn create_node(context: &Context, args: &RosArgs) -> Result<Node, String> {
    let name =
        NodeName::new(args.node().namespace(), args.node().name()).map_err(|error| format!("{error:?}"))?;
    let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
    context.new_node(name, options).map_err(|error| error.to_string())
}

/// Owner of the DDS participant, which is disposed of on drop.
///
/// Drop publishers, subscriptions, the node and the [`Context`] first, then call [`Self::shutdown`] or drop this
/// value. A remaining clone of the participant continues to announce it, and it would be discovered again after the
/// dispose.
#[derive(Debug)]
pub struct Participant {
    participant: Option<DomainParticipant>,
    environment: Environment,
    security: Security,
}

impl Participant {
    /// Opens a participant in the domain and on the networks that `environment` names, without DDS Security.
    ///
    /// # Errors
    /// [`ParticipantError::Open`] if sockets or threads are not available.
    pub fn open(environment: &Environment) -> Result<Self, ParticipantError> {
        Self::open_with(environment, &Security::Off)
    }

    /// Opens a participant in the domain and on the networks that `environment` names, with the given DDS Security.
    ///
    /// # Errors
    /// [`ParticipantError::Open`] if sockets or threads are not available, if this build has no DDS Security, or if
    /// the files of the enclave do not permit the domain.
    pub fn open_with(environment: &Environment, security: &Security) -> Result<Self, ParticipantError> {
        let builder = environment.participant_builder();
        #[cfg(feature = "security")]
        let builder = match security {
            Security::Off | Security::Unprotected(_) => builder,
            Security::Enclave(folder) => {
                super::rtps::set_secured();
                // Private keys of SROS2 have no password.
                let files =
                    DomainParticipantSecurityConfigFiles::with_ros_default_names(folder, String::new());
                builder.builtin_security(files)
            }
        };
        #[cfg(not(feature = "security"))]
        if let Security::Enclave(_) = security {
            let reason = SecurityError::NotBuilt.to_string();
            return Err(ParticipantError::Open { domain_id: environment.domain_id(), reason });
        }
        if let Security::Unprotected(reason) = security {
            tracing::warn!("communication of this node is not protected: {reason}");
        }
        let participant = builder.build().map_err(|error| ParticipantError::Open {
            domain_id: environment.domain_id(),
            reason: error.to_string(),
        })?;
        Ok(Self {
            participant: Some(participant),
            environment: environment.clone(),
            security: security.clone(),
        })
    }

    /// Opens another participant in the same domain, on the same networks and with the same DDS Security.
    ///
    /// # Errors
    /// [`ParticipantError::Open`] if sockets or threads are not available.
    pub fn open_another(&self) -> Result<Self, ParticipantError> {
        Self::open_with(&self.environment, &self.security)
    }

    /// Returns the DDS participant, or `None` after the shutdown.
    pub fn dds(&self) -> Option<&DomainParticipant> {
        self.participant.as_ref()
    }

    /// Creates a ROS context on this participant.
    ///
    /// # Errors
    /// [`ParticipantError::Context`] if the participant is shut down or the context cannot be created.
    pub fn context(&self) -> Result<Context, ParticipantError> {
        let participant = self
            .participant
            .clone()
            .ok_or_else(|| ParticipantError::Context { reason: "the participant is shut down".to_owned() })?;
        Context::from_domain_participant(participant)
            .map_err(|error| ParticipantError::Context { reason: error.to_string() })
    }

    /// Returns the network range in which the participant is announced.
    pub fn range(&self) -> DiscoveryRange {
        self.environment.range()
    }

    /// Returns the hosts to which the participant is announced by name.
    pub fn static_peers(&self) -> &[String] {
        self.environment.static_peers()
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

impl Drop for Participant {
    fn drop(&mut self) {
        self.dispose();
    }
}
