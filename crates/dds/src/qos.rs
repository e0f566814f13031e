//! Quality of service of topics and services.

use std::time::Duration;

use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use rustdds::policy::ResourceLimits;
use rustdds::{QosPolicies, QosPolicyBuilder};

/// Number of unacknowledged samples at which a RustDDS writer blocks by default (`DEFAULT_WRITER_MAX_SAMPLES`).
const MAX_UNACKNOWLEDGED: usize = 8192;

/// Quality of service of a topic, with a history of the last samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QoSProfile {
    /// True if reliable, false if best effort.
    pub is_reliable: bool,
    /// True if transient local, false if volatile.
    pub is_transient_local: bool,
    /// History depth.
    pub depth: usize,
    /// Time for which a sample is sent to late joiners; `None` without limit.
    pub lifespan: Option<Duration>,
    /// Longest time for which a write waits for slow readers; `None` without limit.
    pub max_blocking_time: Option<Duration>,
    /// Number of unacknowledged samples, those for late joiners included, at which a publisher blocks.
    pub max_unacknowledged: usize,
}

impl QoSProfile {
    /// Creates a reliable, volatile profile.
    #[must_use]
    pub const fn reliable(depth: usize) -> Self {
        QoSProfile {
            is_reliable: true,
            is_transient_local: false,
            depth,
            lifespan: None,
            max_blocking_time: None,
            max_unacknowledged: MAX_UNACKNOWLEDGED,
        }
    }

    /// Returns the profile of ros2-client.
    pub(crate) fn profile(&self) -> QosProfile {
        let when_full = self.max_blocking_time.map_or(WhenFull::Block, WhenFull::Wait);
        let reliability =
            if self.is_reliable { Reliability::Reliable { when_full } } else { Reliability::BestEffort };
        let durability =
            if self.is_transient_local { Durability::TransientLocal } else { Durability::Volatile };
        QosProfile {
            reliability,
            durability,
            history: History::KeepLast { depth: self.depth },
            lifespan: self.lifespan,
            ..QosProfile::publisher_default()
        }
    }

    /// Returns the policies of a reader.
    pub(crate) fn of_reader(&self) -> QosPolicies {
        QosPolicies::from(&self.profile())
    }

    /// Returns the policies of a writer.
    pub(crate) fn of_writer(&self) -> QosPolicies {
        let limit = i32::try_from(self.max_unacknowledged).unwrap_or(i32::MAX);
        let limits = ResourceLimits { max_samples: limit, max_instances: 1, max_samples_per_instance: limit };
        self.of_reader().modify_by(&QosPolicyBuilder::new().resource_limits(limits).build())
    }
}
