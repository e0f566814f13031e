//! Response to a client whose response reader is not discovered yet.
//!
//! **Symptom:** the first call of a client has no response: a request can arrive before the announcement of the client's
//! response reader, and a response that is written then reaches no reader.
//!
//! **Upstream:** ros2-client 0.12.1, `src/service/server.rs`, `async_send_response`, which writes at once. rmw waits.
//!
//! **Test:** `test_py/test_services.py`.
//!
//! **Superfluous when** ros2-client waits for the response reader.

use std::time::Duration;

use rustdds::DomainParticipant;
use tokio::time::Instant;

use crate::rtps::Guid as Gid;

/// Period at which the discovery of the client is checked.
const CLIENT_POLL: Duration = Duration::from_millis(5);
/// Time from the discovery of a reader until the writer serves it.
const CLIENT_SETTLE: Duration = Duration::from_millis(10);

/// Waits until a reader of `topic` (its name in DDS) of the participant of `client` is discovered. Returns false after the
/// timeout.
pub(crate) async fn wait(
    participant: &DomainParticipant,
    topic: &String,
    client: &Gid,
    timeout: Duration,
) -> bool {
    // A request contains an endpoint of the client, and all of them have the GUID prefix of its participant.
    let is_discovered = || {
        participant.discovered_readers().iter().any(|reader| {
            reader.subscription_topic_data.topic_name() == topic
                && reader.reader_proxy.remote_reader_guid.to_bytes()[..12] == client[..12]
        })
    };
    if is_discovered() {
        return true;
    }
    let deadline = Instant::now() + timeout;
    while !is_discovered() {
        if Instant::now() >= deadline {
            return false;
        }
        tokio::time::sleep(CLIENT_POLL).await;
    }
    tokio::time::sleep(CLIENT_SETTLE).await;
    true
}
