//! What the process holds: its memory, and others that the middleware remembers.

use std::collections::HashSet;
use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rustdds::{DomainParticipantStatusEvent, GUID};
use tracing::warn;

/// So many endpoints more, and the log says what they cost.
const WARN_EVERY: u64 = 100_000;
/// What the middleware keeps of an endpoint that has left, kB (docs/middleware.md).
const KEPT_KB: f64 = 0.83;

/// Endpoints of others that have been discovered since the start: publishers, subscriptions, and both of each
/// service and client. The middleware never forgets one altogether.
#[derive(Debug, Clone, Default)]
pub struct Discovered(Arc<AtomicU64>);

impl Discovered {
    /// How many they are.
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Another one has been discovered.
    fn another(&self) {
        let count = self.0.fetch_add(1, Ordering::Relaxed) + 1;
        if count.is_multiple_of(WARN_EVERY) {
            warn!(
                "{count} endpoints of others (publishers and subscriptions, and two of each service and client) have \
                 come since the start: the middleware keeps up to {:.0} MB of those that have left until this node ends",
                count as f64 * KEPT_KB * 1e-3
            );
        }
    }
}

/// The endpoints of others that are there now, as far as the middleware tells: of one it tells again when its
/// announcement is repeated, and of each that suits when one of the node's own is made. One that goes before it was told
/// of stays until its participant goes, and of more than 2048 events at once some are not told.
#[derive(Debug)]
pub struct Present {
    /// The participant of the node.
    own: GUID,
    there: HashSet<GUID>,
    discovered: Discovered,
}

impl Present {
    /// Nobody's yet; those of the participant `own` are not counted.
    pub fn new(own: GUID, discovered: Discovered) -> Self {
        Present { own, there: HashSet::new(), discovered }
    }

    /// Takes note of what the middleware tells.
    pub fn tell(&mut self, event: &DomainParticipantStatusEvent) {
        match event {
            DomainParticipantStatusEvent::ReaderDetected { reader: endpoint }
            | DomainParticipantStatusEvent::WriterDetected { writer: endpoint } => {
                self.is_there(endpoint.guid)
            }
            DomainParticipantStatusEvent::ReaderLost { guid, .. }
            | DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                self.there.remove(guid);
            }
            DomainParticipantStatusEvent::ParticipantLost { id, .. } => {
                self.there.retain(|guid| guid.prefix != *id)
            }
            _ => {}
        }
    }

    fn is_there(&mut self, guid: GUID) {
        if guid.prefix != self.own.prefix && self.there.insert(guid) {
            self.discovered.another();
        }
    }
}

/// Memory that is the process's own (RssAnon), MB; none where Linux does not tell.
pub fn own_memory_mb() -> Option<f64> {
    fs::read_to_string("/proc/self/status").ok().and_then(|status| anonymous_mb(&status))
}

fn anonymous_mb(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kibibytes: u32 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(f64::from(kibibytes) * 1.024e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_as_linux_tells_it() {
        let status = "Name:\tvirtual_axes\nVmRSS:\t   9000 kB\nRssAnon:\t    1000 kB\nThreads:\t12\n";
        assert_eq!(anonymous_mb(status), Some(1.024));
        assert_eq!(anonymous_mb("Name:\tvirtual_axes\n"), None);
        assert_eq!(anonymous_mb("RssAnon:\tmany kB\n"), None);
    }

    #[test]
    fn an_endpoint_is_counted_once_for_each_time_that_it_comes() {
        use DomainParticipantStatusEvent::{ParticipantLost, ReaderLost, WriterLost};
        use rustdds::LostReason;

        let endpoint = |participant: u8, entity: u8| {
            let mut bytes = [participant; 16];
            bytes[12..].copy_from_slice(&[0, 0, entity, 4]);
            GUID::from_bytes(bytes)
        };
        let (own, one, other) = (endpoint(1, 1), endpoint(2, 1), endpoint(2, 2));
        let discovered = Discovered::default();
        let mut present = Present::new(own, discovered.clone());
        [own, one, other, one, one, other].into_iter().for_each(|guid| present.is_there(guid));
        assert_eq!(discovered.count(), 2);
        present.tell(&ReaderLost { guid: one, reason: LostReason::Disposed });
        present.is_there(one);
        present.tell(&WriterLost { guid: other, reason: LostReason::Disposed });
        present.is_there(other);
        assert_eq!(discovered.count(), 4);
        present.tell(&ParticipantLost { id: own.prefix, reason: LostReason::Disposed });
        present.is_there(one);
        assert_eq!(discovered.count(), 4);
        present.tell(&ParticipantLost { id: one.prefix, reason: LostReason::Disposed });
        assert_eq!(present.there.len(), 0);
        [one, other].into_iter().for_each(|guid| present.is_there(guid));
        assert_eq!(discovered.count(), 6);
    }

    #[test]
    fn the_log_says_what_a_hundred_thousand_endpoints_cost() {
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
        let discovered = Discovered::default();
        tracing::subscriber::with_default(subscriber, || (0..250_000).for_each(|_| discovered.another()));
        let said = String::from_utf8(text.0.lock().expect("not poisoned").clone()).expect("text");
        assert_eq!(discovered.count(), 250_000);
        assert_eq!(said.lines().count(), 2, "{said}");
        assert!(said.contains("100000 endpoints") && said.contains("83 MB"), "{said}");
    }
}
