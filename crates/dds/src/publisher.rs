//! Publisher of a topic.

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::defects::writer_rotation::TopicWriters;
use crate::discovery::MatchedSubscriptions;

/// Publisher of a topic. Clones share it.
pub struct Publisher<M: Serialize> {
    writers: Arc<TopicWriters<M>>,
    matched: MatchedSubscriptions,
}

impl<M: Serialize> Clone for Publisher<M> {
    fn clone(&self) -> Self {
        Publisher { writers: Arc::clone(&self.writers), matched: self.matched.clone() }
    }
}

impl<M: Serialize + Send + Sync + 'static> Publisher<M> {
    pub(crate) fn new(writers: Arc<TopicWriters<M>>, matched: MatchedSubscriptions) -> Self {
        Publisher { writers, matched }
    }

    /// Publishes a message as soon as the middleware has space for it. Returns false if the middleware rejects it.
    pub async fn publish(&self, message: M) -> bool {
        self.writers.write(message).await
    }

    /// Returns true if the topic is transient local or has a matched subscription; otherwise a message need not be built.
    pub fn has_subscriptions(&self) -> bool {
        self.matched.has_any()
    }

    /// Discards the oldest half of the unacknowledged samples, so that a subscription that has acknowledged nothing for
    /// `waited` does not stop the others; logs a warning.
    pub fn discard_unacknowledged(&self, waited: Duration) {
        self.writers.current().readers.send_gap(waited.as_secs());
    }
}
