//! Which topics somebody listens to: what nobody hears is not made.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures::StreamExt;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, RTPSEntity, StatusEvented};

use super::ask_again::Asker;
use super::footprint::{Discovered, Present};

/// How often it is looked whether those who listened have gone; a reader that comes is told of at once.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

/// Whether anybody listens to a topic.
#[derive(Debug, Clone)]
pub struct Heard(Arc<AtomicBool>);

impl Heard {
    /// A topic whose messages are made whoever listens.
    pub fn always() -> Self {
        Heard(Arc::new(AtomicBool::new(true)))
    }

    /// Whether it is worth while to make a message.
    pub fn is(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    fn set(&self, heard: bool) {
        self.0.store(heard, Ordering::Relaxed);
    }
}

/// The topics that are looked after.
#[derive(Debug, Default)]
pub struct Listeners(Vec<Topic>);

#[derive(Debug)]
struct Topic {
    writer: GUID,
    /// As DDS has it.
    name: String,
    heard: Heard,
}

impl Listeners {
    /// Looks after the topic of a writer, by its name in DDS; nobody listens yet.
    pub fn of(&mut self, writer: GUID, name: String) -> Heard {
        let heard = Heard(Arc::new(AtomicBool::new(false)));
        self.0.push(Topic { writer, name, heard: heard.clone() });
        heard
    }

    /// A reader has been matched with `writer`; whether that is the first one of a topic.
    fn matched(&self, writer: GUID) -> bool {
        let topic = self.0.iter().find(|topic| topic.writer == writer);
        topic.inspect(|topic| topic.heard.set(true)).is_some()
    }

    /// Looks which topics have readers.
    fn look(&self, participant: &DomainParticipant) {
        let readers = participant.discovered_readers();
        self.update(&readers.iter().map(|r| r.subscription_topic_data.topic_name().as_str()).collect());
    }

    /// The topics that have readers are those of `names`.
    fn update(&self, names: &HashSet<&str>) {
        self.0.iter().for_each(|topic| topic.heard.set(names.contains(topic.name.as_str())));
    }
}

/// Follows what the middleware tells of readers, asks writers that it has matched for what they sent before, and
/// counts what is discovered, until the task is ended. A participant tells each event once, to one that listens.
pub(super) async fn run(participant: DomainParticipant, listeners: Listeners, discovered: Discovered) {
    let asker = Asker::open();
    let mut present = Present::new(participant.guid(), discovered);
    let status = participant.status_listener();
    let mut events = status.as_async_status_stream();
    let mut timer = tokio::time::interval(LOOK_PERIOD);
    loop {
        tokio::select! {
            event = events.next() => match event {
                Some(DomainParticipantStatusEvent::RemoteReaderMatched { local_writer, .. }) => {
                    // One that has been renewed is not known.
                    if !listeners.matched(local_writer) {
                        listeners.look(&participant);
                    }
                }
                Some(DomainParticipantStatusEvent::RemoteWriterMatched { local_reader, remote_writer }) => {
                    if let Some(asker) = &asker {
                        asker.matched(&participant, local_reader, remote_writer);
                    }
                }
                Some(event) => present.tell(&event),
                None => return,
            },
            _ = timer.tick() => listeners.look(&participant),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_is_heard_from_its_first_reader_until_the_last_has_gone() {
        let writer = |n: u8| GUID::from_bytes([n; 16]);
        let mut listeners = Listeners::default();
        let (states, pose) =
            (listeners.of(writer(1), "rt/states".to_owned()), listeners.of(writer(2), "rt/pose".to_owned()));
        assert_eq!((states.is(), pose.is()), (false, false));
        listeners.matched(writer(1));
        assert_eq!((states.is(), pose.is()), (true, false));
        listeners.update(&HashSet::from(["rt/states", "rt/pose"]));
        assert_eq!((states.is(), pose.is()), (true, true));
        listeners.update(&HashSet::from(["rt/pose"]));
        assert_eq!((states.is(), pose.is()), (false, true));
        listeners.update(&HashSet::new());
        assert!(Heard::always().is() && !pose.is());
    }
}
