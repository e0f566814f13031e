//! Endpoints of other processes: those present now, and the numbers that have come and gone since the start.
//!
//! RustDDS keeps some data of each discovered endpoint until its participant is dropped, so the number of departed ones
//! determines memory use.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, RTPSEntity};
use tracing::warn;

/// Number of departed endpoints between two warnings about their memory use.
const WARN_EVERY: u64 = 100_000;
/// Memory that the middleware keeps for an endpoint that has left, kB (docs/internals/middleware.md).
const RETAINED_KB: f64 = 0.83;

/// Shared counts of the remote endpoints that have come and gone.
///
/// A publisher and a subscription count as one endpoint each, a service and a client as two.
#[derive(Debug, Clone, Default)]
pub struct EndpointCounts(Arc<[AtomicU64; 2]>);

impl EndpointCounts {
    /// Returns the number of discovered endpoints since the start; one that returns counts again.
    pub fn discovered(&self) -> u64 {
        self.0[0].load(Ordering::Relaxed)
    }

    /// Returns the number of departed endpoints since the start.
    pub fn departed(&self) -> u64 {
        self.0[1].load(Ordering::Relaxed)
    }

    fn add_discovered(&self) {
        self.0[0].fetch_add(1, Ordering::Relaxed);
    }

    /// Updates the number of departed endpoints from that of the `present` ones; logs a warning every [`WARN_EVERY`].
    pub(super) fn update_departed(&self, present: usize) {
        let now = self.discovered().saturating_sub(present as u64);
        let before = self.0[1].fetch_max(now, Ordering::Relaxed);
        if now / WARN_EVERY > before / WARN_EVERY {
            warn!(
                "{now} remote endpoints have departed (one per publisher and subscription, two per service and client); \
                 the middleware retains up to {:.0} MB for them until this node exits: restart it at rest",
                now as f64 * RETAINED_KB * 1e-3
            );
        }
    }
}

/// Returns the number of endpoints of other participants that `participant` knows now.
pub(super) fn count_present(participant: &DomainParticipant) -> usize {
    let own = participant.guid().prefix;
    let readers =
        participant.discovered_readers().into_iter().map(|found| found.reader_proxy.remote_reader_guid);
    let writers =
        participant.discovered_writers().into_iter().map(|found| found.writer_proxy.remote_writer_guid);
    readers.chain(writers).filter(|guid| guid.prefix != own).count()
}

/// Remote endpoints that are present now, according to the status events of the middleware.
///
/// The middleware repeats the event of an endpoint when its announcement is repeated, and when a matching local
/// endpoint is created. An endpoint that leaves before its event stays until its participant leaves. Events beyond
/// 2048 at a time are lost.
pub struct RemoteEndpoints {
    /// GUID of the participant, whose own endpoints are ignored.
    own: GUID,
    present: HashSet<GUID>,
    counts: EndpointCounts,
}

impl RemoteEndpoints {
    /// Creates an empty set of the participant `own`, which updates `counts`.
    pub fn new(own: GUID, counts: EndpointCounts) -> Self {
        RemoteEndpoints { own, present: HashSet::new(), counts }
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
        if guid.prefix != self.own.prefix && self.present.insert(guid) {
            self.counts.add_discovered();
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
        let counts = EndpointCounts::default();
        let found = || counts.discovered();
        let mut remote = RemoteEndpoints::new(own, counts.clone());
        [own, one, other, one, one, other].into_iter().for_each(|guid| remote.insert(guid));
        assert_eq!(found(), 2);
        remote.update(&ReaderLost { guid: one, reason: LostReason::Disposed });
        remote.insert(one);
        remote.update(&WriterLost { guid: other, reason: LostReason::Disposed });
        remote.insert(other);
        assert_eq!(found(), 4);
        remote.update(&ParticipantLost { id: own.prefix, reason: LostReason::Disposed });
        remote.insert(one);
        assert_eq!(found(), 4);
        remote.update(&ParticipantLost { id: one.prefix, reason: LostReason::Disposed });
        assert_eq!(remote.present.len(), 0);
        [one, other].into_iter().for_each(|guid| remote.insert(guid));
        assert_eq!(found(), 6);
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
        let counts = EndpointCounts::default();
        tracing::subscriber::with_default(subscriber, || {
            (0..250_000).for_each(|_| {
                counts.add_discovered();
                counts.update_departed(0);
            })
        });
        let log = String::from_utf8(text.0.lock().expect("not poisoned").clone()).expect("text");
        assert_eq!(counts.departed(), 250_000);
        assert_eq!(log.lines().count(), 2, "{log}");
        assert!(log.contains("100000 remote endpoints") && log.contains("83 MB"), "{log}");
    }
}
