//! The DDS participant: opened as the environment asks, closed so that everybody notices.

use std::time::{Duration, Instant};

use ros2_client::Context;
use rustdds::DomainParticipant;
#[cfg(feature = "security")]
use rustdds::DomainParticipantSecurityConfigFiles;

use super::environment::{DiscoveryRange, Environment};
#[cfg(not(feature = "security"))]
use super::security::SecurityError;
use super::{goodbye::Goodbye, security::Security};

/// The node could not join the network.
#[derive(Debug, thiserror::Error)]
pub enum ParticipantError {
    /// No participant: no free port, mostly.
    #[error("cannot open a DDS participant in domain {domain_id}: {reason}")]
    Open {
        /// The domain asked for.
        domain_id: u16,
        /// The middleware's own words.
        reason: String,
    },
    /// The participant is there, but the ROS layer on it is not.
    #[error("cannot set up ROS on the DDS participant: {reason}")]
    Context {
        /// The middleware's own words.
        reason: String,
    },
}

/// Owns the DDS participant and says goodbye for it when it goes.
///
/// Drop publishers, subscriptions, the node and the [`Context`] first, then call
/// [`Self::shutdown`]; dropping the guard does the same. A clone of the participant that lives on
/// elsewhere keeps announcing it, and it would be discovered again after the goodbye.
#[derive(Debug)]
pub struct Participant {
    participant: Option<DomainParticipant>,
    environment: Environment,
}

impl Participant {
    /// Opens a participant in the domain and on the networks that `environment` names, without DDS Security.
    ///
    /// # Errors
    /// [`ParticipantError::Open`] when the sockets or threads cannot be had.
    pub fn open(environment: &Environment) -> Result<Self, ParticipantError> {
        Self::open_with(environment, &Security::Off)
    }

    /// Likewise, secured as `security` says.
    ///
    /// # Errors
    /// Also where this build has no DDS Security, or the files of the enclave do not allow it to take part in the
    /// domain.
    pub fn open_with(environment: &Environment, security: &Security) -> Result<Self, ParticipantError> {
        let builder = environment.participant_builder();
        #[cfg(feature = "security")]
        let builder = match security {
            Security::Off | Security::Open(_) => builder,
            Security::Enclave(folder) => {
                super::rtps::secure();
                // SROS2 keeps keys without a password.
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
        if let Security::Open(reason) = security {
            tracing::warn!("nothing of what this node says or hears is protected: {reason}");
        }
        let participant = builder.build().map_err(|error| ParticipantError::Open {
            domain_id: environment.domain_id(),
            reason: error.to_string(),
        })?;
        Ok(Self { participant: Some(participant), environment: environment.clone() })
    }

    /// A ROS context on this participant.
    ///
    /// # Errors
    /// [`ParticipantError::Context`] when the middleware refuses its own topics.
    pub fn context(&self) -> Result<Context, ParticipantError> {
        let participant = self
            .participant
            .clone()
            .ok_or_else(|| ParticipantError::Context { reason: "the participant is shut down".to_owned() })?;
        Context::from_domain_participant(participant)
            .map_err(|error| ParticipantError::Context { reason: error.to_string() })
    }

    /// Where it is known.
    pub fn range(&self) -> DiscoveryRange {
        self.environment.range()
    }

    /// Leaves the network: disposes of the participant and tells everybody who may know it.
    /// Returns the time that it took, some 40 ms.
    pub fn shutdown(mut self) -> Duration {
        self.leave()
    }

    fn leave(&mut self) -> Duration {
        let start = Instant::now();
        if let Some(participant) = self.participant.take() {
            let goodbye = Goodbye::of(&participant, self.environment.range());
            // The other way round, RustDDS might announce itself once more after the goodbye.
            drop(participant);
            goodbye.send();
        }
        start.elapsed()
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        self.leave();
    }
}
