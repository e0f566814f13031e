//! Endpoints of other processes: those present now, and the number discovered since the start or the last renewal of
//! the participant.
//!
//! RustDDS keeps some data of each discovered endpoint until its participant is dropped, so the number of departed ones
//! determines memory use.

use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustdds::{DomainParticipantStatusEvent, GUID};
use tracing::warn;

use super::rtps::Guid;

/// Number of discovered endpoints between two warnings about their memory use.
const WARN_EVERY: u64 = 100_000;
/// Memory that the middleware keeps for an endpoint that has left, kB (docs/internals/middleware.md).
const RETAINED_KB: f64 = 0.83;

/// Counter of the remote endpoints that a participant has discovered.
///
/// A publisher and a subscription count as one endpoint each, a service and a client as two.
#[derive(Debug, Default)]
pub struct EndpointCounter(AtomicU64);

impl EndpointCounter {
    /// Returns the number of discovered endpoints.
    pub(super) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Counts one more endpoint; logs a warning every [`WARN_EVERY`] endpoints.
    fn increment(&self) {
        let count = self.0.fetch_add(1, Ordering::Relaxed) + 1;
        if count.is_multiple_of(WARN_EVERY) {
            warn!(
                "{count} remote endpoints discovered (one per publisher and subscription, two per service and client); \
                 the middleware retains up to {:.0} MB for those that have left until the participant is renewed at \
                 rest or this node exits",
                count as f64 * RETAINED_KB * 1e-3
            );
        }
    }
}

/// Shared counter of the current participant, with the number of renewals.
#[derive(Debug, Clone, Default)]
pub struct DiscoveredEndpoints(Arc<Mutex<CurrentCounter>>);

#[derive(Debug, Default)]
struct CurrentCounter {
    counter: Arc<EndpointCounter>,
    renewals: u64,
}

impl DiscoveredEndpoints {
    fn lock(&self) -> MutexGuard<'_, CurrentCounter> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the counter of the first participant.
    pub(super) fn set(&self, counter: Arc<EndpointCounter>) {
        self.lock().counter = counter;
    }

    /// Sets the counter of the participant after a renewal.
    pub(super) fn renew(&self, counter: Arc<EndpointCounter>) {
        let mut current = self.lock();
        *current = CurrentCounter { counter, renewals: current.renewals + 1 };
    }

    /// Returns the number of endpoints discovered since the start or the last renewal of the participant.
    pub fn count(&self) -> u64 {
        self.lock().counter.count()
    }

    /// Returns the number of renewals of the participant since the start.
    pub fn renewals(&self) -> u64 {
        self.lock().renewals
    }
}

/// Remote endpoints that are present now, according to the status events of the middleware.
///
/// The middleware repeats the event of an endpoint when its announcement is repeated, and when a matching local
/// endpoint is created. An endpoint that leaves before its event stays until its participant leaves. Events beyond
/// 2048 at a time are lost.
pub struct RemoteEndpoints<F> {
    /// Function that returns true for endpoints of this process.
    is_own: F,
    present: HashSet<GUID>,
    counter: Arc<EndpointCounter>,
}

impl<F: Fn(&Guid) -> bool> RemoteEndpoints<F> {
    /// Creates an empty set; endpoints of this process, for which `is_own` returns true, are ignored.
    pub fn new(is_own: F, counter: Arc<EndpointCounter>) -> Self {
        RemoteEndpoints { is_own, present: HashSet::new(), counter }
    }

    /// Updates the set by a status event.
    pub fn update(&mut self, event: &DomainParticipantStatusEvent) {
        match event {
            DomainParticipantStatusEvent::ReaderDetected { reader: endpoint }
            | DomainParticipantStatusEvent::WriterDetected { writer: endpoint } => self.insert(endpoint.guid),
            DomainParticipantStatusEvent::ReaderLost { guid, .. }
            | DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                self.present.remove(guid);
            }
            DomainParticipantStatusEvent::ParticipantLost { id, .. } => {
                self.present.retain(|guid| guid.prefix != *id)
            }
            _ => {}
        }
    }

    fn insert(&mut self, guid: GUID) {
        if !(self.is_own)(&guid.to_bytes()) && self.present.insert(guid) {
            self.counter.increment();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endpoint_is_counted_once_per_appearance() {
        use DomainParticipantStatusEvent::{ParticipantLost, ReaderLost, WriterLost};
        use rustdds::LostReason;

        let endpoint = |participant: u8, entity: u8| {
            let mut bytes = [participant; 16];
            bytes[12..].copy_from_slice(&[0, 0, entity, 4]);
            GUID::from_bytes(bytes)
        };
        let (own, one, other) = (endpoint(1, 1), endpoint(2, 1), endpoint(2, 2));
        let (discovered, counter) = (DiscoveredEndpoints::default(), Arc::<EndpointCounter>::default());
        discovered.set(Arc::clone(&counter));
        let mut remote = RemoteEndpoints::new(|guid: &Guid| guid[..12] == own.to_bytes()[..12], counter);
        [own, one, other, one, one, other].into_iter().for_each(|guid| remote.insert(guid));
        assert_eq!(discovered.count(), 2);
        remote.update(&ReaderLost { guid: one, reason: LostReason::Disposed });
        remote.insert(one);
        remote.update(&WriterLost { guid: other, reason: LostReason::Disposed });
        remote.insert(other);
        assert_eq!(discovered.count(), 4);
        remote.update(&ParticipantLost { id: own.prefix, reason: LostReason::Disposed });
        remote.insert(one);
        assert_eq!(discovered.count(), 4);
        remote.update(&ParticipantLost { id: one.prefix, reason: LostReason::Disposed });
        assert_eq!(remote.present.len(), 0);
        [one, other].into_iter().for_each(|guid| remote.insert(guid));
        assert_eq!(discovered.count(), 6);
        discovered.renew(Arc::default());
        assert_eq!((discovered.count(), discovered.renewals()), (0, 1));
    }

    #[test]
    fn a_warning_reports_memory_every_100_000_endpoints() {
        use std::sync::Mutex;
        use tracing_subscriber::fmt::MakeWriter;

        #[derive(Clone, Default)]
        struct Text(Arc<Mutex<Vec<u8>>>);
        impl std::io::Write for Text {
            fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
                self.0.lock().expect("not poisoned").extend_from_slice(bytes);
                Ok(bytes.len())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        impl MakeWriter<'_> for Text {
            type Writer = Text;
            fn make_writer(&self) -> Text {
                self.clone()
            }
        }

        let text = Text::default();
        let subscriber = tracing_subscriber::fmt().with_writer(text.clone()).finish();
        let counter = EndpointCounter::default();
        tracing::subscriber::with_default(subscriber, || (0..250_000).for_each(|_| counter.increment()));
        let log = String::from_utf8(text.0.lock().expect("not poisoned").clone()).expect("text");
        assert_eq!(counter.count(), 250_000);
        assert_eq!(log.lines().count(), 2, "{log}");
        assert!(log.contains("100000 remote endpoints") && log.contains("83 MB"), "{log}");
    }
}
