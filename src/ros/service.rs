//! Services under their resolved names.
//!
//! A response is sent when the response reader of its client has been discovered, and is delivered at any length up to
//! some 65 kB (see [`super::large_response`]).

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::time::Duration;

use futures::{FutureExt, StreamExt, future::BoxFuture, stream::BoxStream};
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::service::RmwRequestId;
use ros2_client::{
    Context, Message, MessageInfo, Name, Node, Server, ServiceMapping, ServiceTypeName, Subscription,
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
use super::args::RosArgs;
use super::large_response::LargeResponses;
use super::readers::Readers;
use super::response_limiter::ResponsePermit;
use super::rtps::Guid;
use crate::interface::NodeService;

/// Longest time for which a write waits for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// Longest time for which a response waits for the discovery of its client. A request can arrive before the client's
/// response reader is discovered, and a response written then would be lost.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(1);
/// Period at which the discovery of the client is checked.
const CLIENT_POLL: Duration = Duration::from_millis(5);
/// Time from the discovery of a reader until the writer serves it.
const CLIENT_SETTLE: Duration = Duration::from_millis(10);

/// Failure to create a service or one of its topics.
#[derive(Debug, thiserror::Error)]
#[error("service {name} cannot be created: {reason}")]
pub struct ServiceError {
    /// Name of the service.
    pub name: String,
    /// Reason.
    pub reason: String,
}

/// Conflict of two services that are remapped to one name; a request would reach both.
#[derive(Debug, thiserror::Error)]
#[error("-r: services ~/{first} and ~/{second} would both be named {resolved}; remap one of them")]
pub struct ServiceNameConflict {
    /// Label of the first service.
    pub first: &'static str,
    /// Label of the second service.
    pub second: &'static str,
    /// Resolved name.
    pub resolved: String,
}

/// Checks that no two services `~/label` have the same resolved name.
///
/// # Errors
/// [`ServiceNameConflict`] for the first conflict. A name that cannot be resolved fails when its service is created.
pub fn check_names(
    args: &RosArgs,
    labels: impl IntoIterator<Item = &'static str>,
) -> Result<(), ServiceNameConflict> {
    let mut known: HashMap<String, &'static str> = HashMap::new();
    for second in labels {
        let Ok(resolved) = args.resolve_service(&format!("~/{second}")) else { continue };
        match known.entry(resolved) {
            Entry::Vacant(free) => _ = free.insert(second),
            Entry::Occupied(taken) => {
                return Err(ServiceNameConflict {
                    first: taken.get(),
                    second,
                    resolved: taken.key().clone(),
                });
            }
        }
    }
    Ok(())
}

/// Depth of response writers, which limits acknowledged samples only: the middleware keeps unacknowledged samples at
/// any depth. A list of all parameters has 20 kB.
pub const RESPONSE_DEPTH: usize = 1;

/// Returns the QoS profile of a service: reliable, volatile, keep last `depth`.
pub fn profile(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Wait(WRITE_TIMEOUT))
        .history(History::KeepLast { depth })
}

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

/// Service with its response writer.
pub struct Service<Q: Serialize + DeserializeOwned, A: Serialize + DeserializeOwned> {
    label: &'static str,
    endpoints: ServiceEndpoints<Q, A>,
    response_topic: String,
    participant: DomainParticipant,
    large_responses: LargeResponses,
    /// Sequence number of the last response, 0 before the first.
    written: Mutex<i64>,
}

impl<Q: Serialize + DeserializeOwned + 'static, A: Serialize + DeserializeOwned + 'static> Service<Q, A> {
    /// Creates `service` of `node`, which belongs to `context`.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create the service.
    pub fn new(
        node: &mut Node,
        context: &Context,
        args: &RosArgs,
        service: &NodeService,
        depth: usize,
    ) -> Result<Self, ServiceError>
    where
        Q: Clone,
    {
        let label = service.label;
        let failed = |reason: String| ServiceError { name: label.to_owned(), reason };
        let resolved = args.resolve_service(&service.name()).map_err(|e| failed(e.to_string()))?;
        let type_name = ServiceTypeName::new(service.package, service.service);
        Self::with_name(node, context, &resolved, label, &type_name, depth)
    }

    /// Creates a service with a resolved name; `label` is its name in log messages.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create the service.
    pub fn with_name(
        node: &mut Node,
        context: &Context,
        resolved: &str,
        label: &'static str,
        type_name: &ServiceTypeName,
        depth: usize,
    ) -> Result<Self, ServiceError>
    where
        Q: Clone,
    {
        let failed = |reason: String| ServiceError { name: label.to_owned(), reason };
        let name = Name::parse(resolved).map_err(|e| failed(e.to_string()))?;
        let before = announced_writers(context);
        let server = node
            .create_server(
                ServiceMapping::Enhanced,
                &name,
                type_name,
                profile(depth),
                profile(RESPONSE_DEPTH),
            )
            .map_err(|e| failed(e.to_string()))?;
        let response_topic = format!("rr{resolved}Reply");
        let participant = context.domain_participant();
        // A server has one writer and does not return its GUID.
        let writer = announced_writers(context).difference(&before).next().copied();
        let writer =
            writer.ok_or_else(|| failed("ros2-client does not list its response writer".to_owned()))?;
        Self::with_endpoints(ServiceEndpoints::Server(server), writer, label, response_topic, participant)
    }

    /// Creates a service of an action with a resolved name; `label` is its name in log messages.
    ///
    /// `type_name` is the beginning of the DDS type name, `package::action::dds_::Action_SendGoal`. ros2-client
    /// supports types of `srv` only.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create the service.
    pub fn for_action(
        node: &mut Node,
        context: &Context,
        resolved: &str,
        label: &'static str,
        type_name: &str,
        depth: usize,
    ) -> Result<Self, ServiceError> {
        let failed = |reason: String| ServiceError { name: label.to_owned(), reason };
        let participant = context.domain_participant();
        let qos = QosPolicies::from(&profile(RESPONSE_DEPTH));
        let topic = |name: &str, kind: &str| {
            participant
                .create_topic(name.to_owned(), format!("{type_name}_{kind}_"), &qos, TopicKind::NoKey)
                .map_err(|e| failed(e.to_string()))
        };
        let requests = topic(&format!("rq{resolved}Request"), "Request")?;
        let response_topic = format!("rr{resolved}Reply");
        let responses = topic(&response_topic, "Response")?;
        let requests =
            node.create_subscription(&requests, Some(profile(depth))).map_err(|e| failed(e.to_string()))?;
        let responses = participant
            .create_publisher(&qos)
            .and_then(|publisher| publisher.create_datawriter_no_key_cdr(&responses, Some(qos.clone())))
            .map_err(|e| failed(e.to_string()))?;
        let writer = responses.guid().to_bytes();
        Self::with_endpoints(
            ServiceEndpoints::Topics { requests, responses },
            writer,
            label,
            response_topic,
            participant,
        )
    }

    fn with_endpoints(
        endpoints: ServiceEndpoints<Q, A>,
        writer: Guid,
        label: &'static str,
        response_topic: String,
        participant: DomainParticipant,
    ) -> Result<Self, ServiceError> {
        let clients = Readers::new(writer, response_topic.clone(), participant.clone());
        let large_responses = clients.map(LargeResponses::new).map_err(|error| ServiceError {
            name: label.to_owned(),
            reason: format!("no socket: {error}"),
        })?;
        Ok(Service { label, endpoints, response_topic, participant, large_responses, written: Mutex::new(0) })
    }

    /// Returns the requests in order of reception. An item is an error if a request could not be decoded.
    pub fn requests(&self) -> BoxStream<'_, Result<(RmwRequestId, Q), String>>
    where
        Q: Send + Sync,
        A: Send + Sync,
    {
        let label = self.label;
        let unreadable = move |error| format!("cannot decode a request to {label}: {error:?}");
        match &self.endpoints {
            ServiceEndpoints::Server(server) => {
                let requests = server.receive_request_stream();
                requests
                    .map(move |received| received.map(|(id, Wire(q))| (id, q)).map_err(unreadable))
                    .boxed()
            }
            ServiceEndpoints::Topics { requests, .. } => requests
                .async_stream()
                .map(move |received| match received {
                    Ok((request, info)) => Ok((request_id(&info), request)),
                    Err(error) => Err(unreadable(error)),
                })
                .boxed(),
        }
    }

    /// Returns the requests, each converted by `wrap` to a type that several services share.
    pub fn requests_as<'a, R: 'a>(
        &'a self,
        wrap: impl Fn(RmwRequestId, Q) -> R + Send + 'a,
    ) -> BoxStream<'a, Result<R, String>>
    where
        Q: Send + Sync,
        A: Send + Sync,
    {
        self.requests().map(move |received| received.map(|(id, request)| wrap(id, request))).boxed()
    }

    /// Sends the response to a request as soon as its client is discovered, then releases `permit`.
    pub fn respond<'a>(&'a self, id: RmwRequestId, response: A, permit: ResponsePermit) -> BoxFuture<'a, ()>
    where
        Q: Send + Sync,
        A: Send + Sync,
    {
        async move {
            let large = match LargeResponses::encode(&response) {
                Ok(large) => large,
                Err(error) => {
                    tracing::error!("no response of {} is sent: {error}", self.label);
                    return;
                }
            };
            self.wait_for_client(&id).await;
            match self.write(id, response, large).await {
                Ok(None) => {}
                // The permit is held during the repetitions.
                Ok(Some((datagram, number))) => self.large_responses.repeat(datagram, number).await,
                Err(reason) => {
                    tracing::warn!("the response of {} could not be sent: {reason}", self.label);
                }
            }
            drop(permit);
        }
        .boxed()
    }

    /// Writes a response by RustDDS and, if it is `large`, as a datagram of this node. Returns that datagram and its
    /// sequence number.
    async fn write(
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

    /// Waits until the response reader of the client of request `id` is discovered.
    async fn wait_for_client(&self, id: &RmwRequestId) {
        if self.is_client_discovered(id) {
            return;
        }
        let deadline = tokio::time::Instant::now() + CLIENT_TIMEOUT;
        while !self.is_client_discovered(id) {
            if tokio::time::Instant::now() >= deadline {
                tracing::debug!("the client of {} has left or was not discovered", self.label);
                return;
            }
            tokio::time::sleep(CLIENT_POLL).await;
        }
        tokio::time::sleep(CLIENT_SETTLE).await;
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
