//! Services: requests, and responses at any length up to some 65 kB when the client can receive them.

mod limiter;

pub use limiter::{ResponseLimiter, ResponsePermit};

use std::time::Duration;

use futures::future::BoxFuture;
use futures::stream::{BoxStream, FuturesUnordered};
use futures::{FutureExt, StreamExt, stream};
use rustdds::no_key::DataWriterCdr;
use rustdds::{
    DomainParticipant, GUID, RTPSEntity, SampleIdentity, SequenceNumber, Timestamp, Topic, TopicDescription,
    WriteOptionsBuilder,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::sync::Mutex;

use crate::defects::client_discovery;
use crate::defects::large_response::{LargeResponseError, LargeResponses};
use crate::qos::QoSProfile;
use crate::rtps::Guid as Gid;
use crate::rtps::readers::Readers;

/// Longest time for which a response waits for the discovery of its client.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest time for which a write waits for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// Profile of responses. The depth limits acknowledged samples only: the middleware keeps unacknowledged samples at any
/// depth. A list of all parameters has 20 kB.
pub(crate) const RESPONSE_QOS: QoSProfile = request_qos(1);

/// Returns the profile of requests.
pub(crate) const fn request_qos(depth: usize) -> QoSProfile {
    QoSProfile { max_blocking_time: Some(WRITE_TIMEOUT), ..QoSProfile::reliable(depth) }
}

/// Identity of a request, which its response repeats.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct RequestId {
    /// Endpoint of the client: its writer, or with Fast DDS its response reader.
    pub writer_guid: Gid,
    /// Number of the request among those of the client.
    pub sequence_number: i64,
}

/// Returns true if a response is short enough to be sent.
pub fn response_fits<A: Serialize>(response: &A) -> bool {
    !matches!(LargeResponses::encode(response), Err(LargeResponseError::TooLong(..)))
}

/// Service.
pub struct Service<Q: DeserializeOwned + 'static, A: Serialize> {
    /// Last part of the name, for the log.
    label: String,
    requests: ros2_client::Subscription<Q>,
    responses: DataWriterCdr<A>,
    /// Name of the response topic in DDS.
    response_topic: String,
    participant: DomainParticipant,
    large_responses: LargeResponses,
    /// Sequence number of the last response, 0 before the first.
    written: Mutex<i64>,
}

impl<Q, A> Service<Q, A>
where
    Q: DeserializeOwned + Send + Sync + 'static,
    A: Serialize + Send + Sync + 'static,
{
    /// Creates the service `name` from its request reader, and its response writer on `topic`.
    pub(crate) fn new(
        name: &str,
        requests: ros2_client::Subscription<Q>,
        responses: DataWriterCdr<A>,
        topic: Topic,
        participant: DomainParticipant,
    ) -> Result<Self, String> {
        let clients = Readers::new(responses.guid().to_bytes(), topic.name(), participant.clone());
        let clients = clients.map_err(|error| format!("no socket: {error}"))?;
        Ok(Service {
            label: name.rsplit('/').next().unwrap_or_default().to_owned(),
            requests,
            responses,
            response_topic: topic.name(),
            participant,
            large_responses: LargeResponses::new(clients),
            written: Mutex::new(0),
        })
    }

    /// Returns the requests in order of reception. An item is an error if a request could not be decoded.
    pub fn requests(&self) -> BoxStream<'_, Result<(RequestId, Q), String>> {
        let received = stream::unfold(self, |service| async move {
            let received = service.requests.async_take().await;
            let received = received.map(|(request, info)| (request_id(&info), request));
            let label = &service.label;
            Some((received.map_err(|e| format!("cannot decode a request to {label}: {e:?}")), service))
        });
        received.boxed()
    }

    /// Returns the requests, each converted by `wrap` to a type that several services share.
    pub fn requests_as<'a, R: 'a>(
        &'a self,
        wrap: impl Fn(RequestId, Q) -> R + Send + 'a,
    ) -> BoxStream<'a, Result<R, String>> {
        self.requests().map(move |received| received.map(|(id, request)| wrap(id, request))).boxed()
    }

    /// Serves until the task is aborted; `answer` executes a request and returns its response.
    pub async fn serve<F>(self, answer: impl Fn(Q) -> F + Send)
    where
        F: Future<Output = A> + Send,
    {
        let mut requests = self.requests();
        // Responses are sent concurrently: a client that has disconnected does not delay the response of another.
        let mut responses: FuturesUnordered<BoxFuture<'_, ()>> = FuturesUnordered::new();
        let limiter = ResponseLimiter::default();
        loop {
            tokio::select! {
                biased;
                Some(()) = responses.next(), if !responses.is_empty() => {}
                Some((permit, request)) = limiter.next(&mut requests) => match request {
                    Ok((id, request)) => {
                        let response = answer(request).await;
                        responses.push(self.respond(id, response, permit));
                    }
                    Err(reason) => tracing::warn!("{reason}"),
                },
                else => break,
            }
        }
    }

    /// Sends the response to a request as soon as its client is discovered, then releases `permit`.
    pub fn respond(&self, id: RequestId, response: A, permit: ResponsePermit) -> BoxFuture<'_, ()> {
        self.respond_within(id, response, permit, CLIENT_TIMEOUT)
    }

    /// Sends a response as [`Service::respond`] does, when its client is discovered or after `timeout`.
    pub fn respond_within(
        &self,
        id: RequestId,
        response: A,
        permit: ResponsePermit,
        timeout: Duration,
    ) -> BoxFuture<'_, ()> {
        async move {
            let label = &self.label;
            let large = match LargeResponses::encode(&response) {
                Ok(large) => large,
                Err(error) => {
                    tracing::error!("no response of {label} is sent: {error}");
                    return;
                }
            };
            if !client_discovery::wait(&self.participant, &self.response_topic, &id.writer_guid, timeout)
                .await
            {
                tracing::debug!("the client of {label} has left or was not discovered");
            }
            match self.write(id, response, large).await {
                Ok(None) => {}
                // The permit is held during the repetitions.
                Ok(Some((datagram, number))) => self.large_responses.repeat(datagram, number).await,
                Err(reason) => tracing::warn!("the response of {label} could not be sent: {reason}"),
            }
            drop(permit);
        }
        .boxed()
    }

    /// Writes a response by RustDDS and, if it is `large`, as a datagram of this node. Returns that datagram and its
    /// sequence number.
    async fn write(
        &self,
        id: RequestId,
        response: A,
        large: Option<Vec<u8>>,
    ) -> Result<Option<(Vec<u8>, i64)>, String> {
        // The lock keeps the count in the order of the writer and spaces large datagrams.
        let mut written = self.written.lock().await;
        let identity = SampleIdentity {
            writer_guid: GUID::from_bytes(id.writer_guid),
            sequence_number: SequenceNumber::from(id.sequence_number),
        };
        let options =
            WriteOptionsBuilder::new().source_timestamp(Timestamp::now()).related_sample_identity(identity);
        let sent = self.responses.async_write_with_options(response, options.build()).await;
        sent.map_err(|error| error.to_string())?;
        *written += 1;
        let Some(payload) = large else { return Ok(None) };
        let datagram = self.large_responses.datagram(&id.writer_guid, id.sequence_number, *written, &payload);
        self.large_responses.send(&datagram).await;
        Ok(Some((datagram, *written)))
    }
}

/// Returns the identity of a request.
fn request_id(info: &ros2_client::MessageInfo) -> RequestId {
    let own =
        RequestId { writer_guid: info.publisher_gid().to_bytes16(), sequence_number: info.sequence_number() };
    match info.related_request_id() {
        // Fast DDS puts its response reader there, and the number only into the sample.
        Some(id) if id.sequence_number == i64::from(SequenceNumber::UNKNOWN) => {
            RequestId { writer_guid: id.writer_gid.to_bytes16(), ..own }
        }
        Some(id) => {
            RequestId { writer_guid: id.writer_gid.to_bytes16(), sequence_number: id.sequence_number }
        }
        None => own,
    }
}
