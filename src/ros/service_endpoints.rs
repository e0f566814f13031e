//! Request reader and response writer of a service in one participant.

use std::time::Duration;

use ros2_client::service::RmwRequestId;
use ros2_client::{
    Context, Message, MessageInfo, Name, Node, ReadResult, Server, ServiceMapping, ServiceTypeName,
    Subscription,
};
use rustdds::no_key::DataWriterCdr;
use rustdds::{
    DomainParticipant, QosPolicies, RTPSEntity, SampleIdentity, SequenceNumber, Timestamp, TopicKind,
    WriteOptionsBuilder,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tokio::sync::Mutex;

use super::announced_writers::announced_writers;
use super::large_response::LargeResponses;
use super::readers::Readers;
use super::rtps::Guid;
use super::service::{RESPONSE_DEPTH, profile};

/// Period at which the discovery of the client is checked.
const CLIENT_POLL: Duration = Duration::from_millis(5);
/// Time from the discovery of a reader until the writer serves it.
const CLIENT_SETTLE: Duration = Duration::from_millis(10);

/// Wrapper that implements the message trait of ros2-client for a type of another crate.
#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Wire<M>(pub(super) M);

impl<M: Serialize + DeserializeOwned> Message for Wire<M> {}

/// Request reader and response writer of a service.
enum ServiceEndpoints<Q: Serialize + DeserializeOwned, A: Serialize + DeserializeOwned> {
    /// Server of ros2-client.
    Server(Server<Wire<Q>, Wire<A>>),
    /// Subscription and writer, for types that ros2-client cannot name.
    Topics { requests: Subscription<Q>, responses: DataWriterCdr<A> },
}

/// Service in one participant, with its response writer.
pub(super) struct ServiceOfParticipant<Q: Serialize + DeserializeOwned, A: Serialize + DeserializeOwned> {
    endpoints: ServiceEndpoints<Q, A>,
    response_topic: String,
    participant: DomainParticipant,
    pub(super) large_responses: LargeResponses,
    /// Sequence number of the last response, 0 before the first.
    written: Mutex<i64>,
}

impl<Q, A> ServiceOfParticipant<Q, A>
where
    Q: Serialize + DeserializeOwned + Send + Sync + 'static,
    A: Serialize + DeserializeOwned + Send + Sync + 'static,
{
    /// Creates a service by ros2-client.
    pub(super) fn of_server(
        node: &mut Node,
        context: &Context,
        resolved: &str,
        type_name: &ServiceTypeName,
        depth: usize,
    ) -> Result<Self, String>
    where
        Q: Clone,
    {
        let name = Name::parse(resolved).map_err(|e| e.to_string())?;
        let before = announced_writers(context);
        let mapping = ServiceMapping::Enhanced;
        let server = node
            .create_server(mapping, &name, type_name, profile(depth), profile(RESPONSE_DEPTH))
            .map_err(|e| e.to_string())?;
        // A server has one writer and does not return its GUID.
        let writer = announced_writers(context).difference(&before).next().copied();
        let writer = writer.ok_or("ros2-client does not list its response writer")?;
        Self::with_endpoints(
            ServiceEndpoints::Server(server),
            writer,
            response_topic(resolved),
            context.domain_participant(),
        )
    }

    /// Creates a service of an action from a subscription and a writer.
    pub(super) fn of_topics(
        node: &mut Node,
        context: &Context,
        resolved: &str,
        type_name: &str,
        depth: usize,
    ) -> Result<Self, String> {
        let participant = context.domain_participant();
        let qos = QosPolicies::from(&profile(RESPONSE_DEPTH));
        let topic = |name: &str, kind: &str| {
            participant
                .create_topic(name.to_owned(), format!("{type_name}_{kind}_"), &qos, TopicKind::NoKey)
                .map_err(|e| e.to_string())
        };
        let requests = topic(&format!("rq{resolved}Request"), "Request")?;
        let response_topic = response_topic(resolved);
        let responses = topic(&response_topic, "Response")?;
        let requests =
            node.create_subscription(&requests, Some(profile(depth))).map_err(|e| e.to_string())?;
        let responses = participant
            .create_publisher(&qos)
            .and_then(|publisher| publisher.create_datawriter_no_key_cdr(&responses, Some(qos.clone())))
            .map_err(|e| e.to_string())?;
        let writer = responses.guid().to_bytes();
        let endpoints = ServiceEndpoints::Topics { requests, responses };
        Self::with_endpoints(endpoints, writer, response_topic, participant)
    }

    fn with_endpoints(
        endpoints: ServiceEndpoints<Q, A>,
        writer: Guid,
        response_topic: String,
        participant: DomainParticipant,
    ) -> Result<Self, String> {
        let clients = Readers::new(writer, response_topic.clone(), participant.clone());
        let large_responses =
            clients.map(LargeResponses::new).map_err(|error| format!("no socket: {error}"))?;
        let written = Mutex::new(0);
        Ok(ServiceOfParticipant { endpoints, response_topic, participant, large_responses, written })
    }

    /// Waits for the next request.
    pub(super) async fn receive(&self) -> ReadResult<(RmwRequestId, Q)> {
        match &self.endpoints {
            ServiceEndpoints::Server(server) => {
                let (id, Wire(request)) = server.async_receive_request().await?;
                Ok((id, request))
            }
            ServiceEndpoints::Topics { requests, .. } => {
                let (request, info) = requests.async_take().await?;
                Ok((request_id(&info), request))
            }
        }
    }

    /// Writes a response by RustDDS and, if it is `large`, as a datagram of this node. Returns that datagram and its
    /// sequence number.
    pub(super) async fn write(
        &self,
        id: RmwRequestId,
        response: A,
        large: Option<Vec<u8>>,
    ) -> Result<Option<(Vec<u8>, i64)>, String> {
        // The lock keeps the count in the order of the writer and spaces large datagrams.
        let mut written = self.written.lock().await;
        match &self.endpoints {
            ServiceEndpoints::Server(server) => {
                server.async_send_response(id, Wire(response)).await.map_err(|error| format!("{error:?}"))?;
            }
            ServiceEndpoints::Topics { responses, .. } => {
                let options = WriteOptionsBuilder::new()
                    .source_timestamp(Timestamp::now())
                    .related_sample_identity(SampleIdentity::from(id));
                let written = responses.async_write_with_options(response, options.build()).await;
                written.map_err(|error| error.to_string())?;
            }
        }
        *written += 1;
        let Some(payload) = large else { return Ok(None) };
        let datagram = self.large_responses.datagram(&id, *written, &payload);
        self.large_responses.send(&datagram).await;
        Ok(Some((datagram, *written)))
    }

    /// Waits until the response reader of the client of request `id` is discovered. Returns false after the timeout.
    pub(super) async fn wait_for_client(&self, id: &RmwRequestId, timeout: Duration) -> bool {
        if self.is_client_discovered(id) {
            return true;
        }
        let deadline = tokio::time::Instant::now() + timeout;
        while !self.is_client_discovered(id) {
            if tokio::time::Instant::now() >= deadline {
                return false;
            }
            tokio::time::sleep(CLIENT_POLL).await;
        }
        tokio::time::sleep(CLIENT_SETTLE).await;
        true
    }

    fn is_client_discovered(&self, id: &RmwRequestId) -> bool {
        // A request contains an endpoint of the client: its writer, or with Fast DDS its response reader. Both have the
        // GUID prefix of the participant.
        let client = id.writer_gid.to_bytes16();
        self.participant.discovered_readers().iter().any(|reader| {
            reader.subscription_topic_data.topic_name() == &self.response_topic
                && reader.reader_proxy.remote_reader_guid.to_bytes()[..12] == client[..12]
        })
    }
}

/// Returns the DDS name of the response topic of a service with a resolved name.
fn response_topic(resolved: &str) -> String {
    format!("rr{resolved}Reply")
}

/// Returns the identity of a request, which its response repeats.
fn request_id(info: &MessageInfo) -> RmwRequestId {
    let own = RmwRequestId { writer_gid: info.publisher_gid(), sequence_number: info.sequence_number() };
    match info.related_request_id() {
        // Fast DDS puts its response reader there, and the number only into the sample.
        Some(id) if id.sequence_number == i64::from(SequenceNumber::UNKNOWN) => {
            RmwRequestId { sequence_number: own.sequence_number, ..id }
        }
        Some(id) => id,
        None => own,
    }
}
