//! Services under their resolved names, whose responses wait for the client to be known and reach it
//! at (almost) any length.

use std::time::Duration;

use futures::{FutureExt, StreamExt, future::BoxFuture, stream::BoxStream};
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::service::RmwRequestId;
use ros2_client::{Context, Message, Name, Node, Server, ServiceMapping, ServiceTypeName};
use rustdds::DomainParticipant;
use tokio::sync::Mutex;

use super::args::RosArgs;
use super::large_response::{self, LargeResponses};

/// How long a write may wait for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// A client's request can arrive before its response reader is known here, and a response that is
/// written then reaches nobody. So long a response is held back,
const CLIENT_TIMEOUT: Duration = Duration::from_secs(1);
/// and so often it is looked whether the reader has come.
const CLIENT_POLL: Duration = Duration::from_millis(5);
/// From a reader's discovery until the writer serves it.
const CLIENT_SETTLE: Duration = Duration::from_millis(10);

/// A service, or a topic that goes with one, could not be created.
#[derive(Debug, thiserror::Error)]
#[error("service {name} cannot be created: {reason}")]
pub struct ServiceError {
    /// Its name.
    pub name: String,
    /// Why not.
    pub reason: String,
}

/// Reliable, volatile, keep last `depth`.
pub fn profile(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Wait(WRITE_TIMEOUT))
        .history(History::KeepLast { depth })
}

/// One service: its server, and the DDS topic on which its responses go out.
pub struct Service<Q: Message, A: Message> {
    label: &'static str,
    server: Server<Q, A>,
    response_topic: String,
    participant: DomainParticipant,
    large: LargeResponses,
    /// How many responses the server has written: the sequence number of the last one.
    written: Mutex<i64>,
}

impl<Q: Message + 'static, A: Message + 'static> Service<Q, A> {
    /// The service `~/label`; `context` is the one that `node` lives in.
    ///
    /// # Errors
    /// [`ServiceError`] when the middleware refuses it.
    pub fn new(
        node: &mut Node,
        context: &Context,
        args: &RosArgs,
        label: &'static str,
        type_name: &ServiceTypeName,
        depth: usize,
    ) -> Result<Self, ServiceError>
    where
        Q: Clone,
    {
        let failed = |reason: String| ServiceError { name: label.to_owned(), reason };
        let resolved = args.resolve_service(&format!("~/{label}")).map_err(|e| failed(e.to_string()))?;
        let name = Name::parse(&resolved).map_err(|e| failed(e.to_string()))?;
        let before = large_response::writers(context);
        let server = node
            .create_server(ServiceMapping::Enhanced, &name, type_name, profile(depth), profile(depth))
            .map_err(|e| failed(e.to_string()))?;
        let response_topic = format!("rr{resolved}Reply");
        let participant = context.domain_participant();
        // A server has one writer, and keeps its GUID to itself.
        let writer = large_response::writers(context).difference(&before).next().copied();
        let writer = writer.ok_or_else(|| failed("its response writer is not announced".to_owned()))?;
        let large = LargeResponses::new(writer, response_topic.clone(), participant.clone())
            .map_err(|error| failed(format!("no socket: {error}")))?;
        Ok(Service { label, server, response_topic, participant, large, written: Mutex::new(0) })
    }

    /// Requests as they come, or why one could not be read.
    pub fn requests(&self) -> BoxStream<'_, Result<(RmwRequestId, Q), String>>
    where
        Q: Send + Sync,
        A: Send + Sync,
    {
        let label = self.label;
        self.server
            .receive_request_stream()
            .map(move |received| {
                received.map_err(|error| format!("a request to {label} could not be read: {error:?}"))
            })
            .boxed()
    }

    /// Sends the response to a request, once its client is known.
    pub fn respond<'a>(&'a self, id: RmwRequestId, response: A) -> BoxFuture<'a, ()>
    where
        Q: Send + Sync,
        A: Send + Sync,
    {
        async move {
            let large = match LargeResponses::encode(&response) {
                Ok(large) => large,
                Err(error) => {
                    tracing::error!("the response of {} is not sent: {error}", self.label);
                    return;
                }
            };
            self.wait_for_client(&id).await;
            match self.write(id, response, large).await {
                Ok(None) => {}
                Ok(Some(datagram)) => self.large.repeat(&datagram).await,
                Err(reason) => {
                    tracing::warn!("the response of {} could not be sent: {reason}", self.label);
                }
            }
        }
        .boxed()
    }

    /// Hands a response to RustDDS, and sends it ourselves when it is `large`; comes back with the
    /// datagram of that.
    async fn write(
        &self,
        id: RmwRequestId,
        response: A,
        large: Option<Vec<u8>>,
    ) -> Result<Option<Vec<u8>>, String> {
        // Held while writing, so that the count keeps the order of the writer, and while a large one
        // is sent, so that many of them do not come at once.
        let mut written = self.written.lock().await;
        self.server.async_send_response(id, response).await.map_err(|error| format!("{error:?}"))?;
        *written += 1;
        let Some(payload) = large else { return Ok(None) };
        let datagram = self.large.datagram(&id, *written, &payload);
        self.large.send(&datagram).await;
        Ok(Some(datagram))
    }

    /// Waits until the response reader of the client behind `id` is known.
    async fn wait_for_client(&self, id: &RmwRequestId) {
        if self.knows_client(id) {
            return;
        }
        let deadline = tokio::time::Instant::now() + CLIENT_TIMEOUT;
        while !self.knows_client(id) {
            if tokio::time::Instant::now() >= deadline {
                tracing::debug!("the client of {} is gone, or never was discovered", self.label);
                return;
            }
            tokio::time::sleep(CLIENT_POLL).await;
        }
        tokio::time::sleep(CLIENT_SETTLE).await;
    }

    fn knows_client(&self, id: &RmwRequestId) -> bool {
        // Requests carry an endpoint of the client: its writer, or with Fast DDS its response reader.
        // What they have in common is the participant.
        let client = id.writer_gid.to_bytes16();
        self.participant.discovered_readers().iter().any(|reader| {
            reader.subscription_topic_data.topic_name() == &self.response_topic
                && reader.reader_proxy.remote_reader_guid.to_bytes()[..12] == client[..12]
        })
    }
}
