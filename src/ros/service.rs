//! Services under their resolved names, whose responses wait for the client to be known and reach it
//! at (almost) any length.

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

use super::args::RosArgs;
use super::large_response::{self, LargeResponses};
use super::readers::Readers;
use super::rtps::Guid;
use super::unsent::Place;

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

/// Two services that are remapped to one name: a request would reach both.
#[derive(Debug, thiserror::Error)]
#[error("-r: services ~/{first} and ~/{second} would both be {resolved}")]
pub struct TwoServices {
    /// One of them.
    pub first: &'static str,
    /// The other.
    pub second: &'static str,
    /// The name in the graph.
    pub resolved: String,
}

/// Refuses two of the services `~/label` under one name.
///
/// # Errors
/// [`TwoServices`]. A name that cannot be resolved is refused when its service is made.
pub fn check_names(
    args: &RosArgs,
    labels: impl IntoIterator<Item = &'static str>,
) -> Result<(), TwoServices> {
    let mut known: HashMap<String, &'static str> = HashMap::new();
    for second in labels {
        let Ok(resolved) = args.resolve_service(&format!("~/{second}")) else { continue };
        match known.entry(resolved) {
            Entry::Vacant(free) => _ = free.insert(second),
            Entry::Occupied(taken) => {
                return Err(TwoServices { first: taken.get(), second, resolved: taken.key().clone() });
            }
        }
    }
    Ok(())
}

/// How much the middleware keeps of what every reader has acknowledged and nobody asks for again; what a reader has
/// not acknowledged it keeps whatever is said here. A list of all parameters has 20 kB.
pub const ACKNOWLEDGED: usize = 1;

/// Reliable, volatile, keep last `depth`.
pub fn profile(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Wait(WRITE_TIMEOUT))
        .history(History::KeepLast { depth })
}

/// Message of a service, for which ros2-client requires a trait of its own that other crates' types do not have.
#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
struct Wire<M>(M);

impl<M: Serialize + DeserializeOwned> Message for Wire<M> {}

/// The two ends of a service.
enum Ends<Q: Serialize + DeserializeOwned, A: Serialize + DeserializeOwned> {
    /// The crate's.
    Server(Server<Wire<Q>, Wire<A>>),
    /// Of a type that the crate cannot name: a subscription and a writer.
    Topics { requests: Subscription<Q>, responses: DataWriterCdr<A> },
}

/// One service: its server, and the DDS topic on which its responses go out.
pub struct Service<Q: Serialize + DeserializeOwned, A: Serialize + DeserializeOwned> {
    label: &'static str,
    ends: Ends<Q, A>,
    response_topic: String,
    participant: DomainParticipant,
    large: LargeResponses,
    /// How many responses the server has written: the sequence number of the last one.
    written: Mutex<i64>,
}

impl<Q: Serialize + DeserializeOwned + 'static, A: Serialize + DeserializeOwned + 'static> Service<Q, A> {
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
        Self::named(node, context, &resolved, label, type_name, depth)
    }

    /// The service of this name in the graph, called `label` in the log.
    ///
    /// # Errors
    /// [`ServiceError`] when the middleware refuses it.
    pub fn named(
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
        let before = large_response::writers(context);
        let server = node
            .create_server(ServiceMapping::Enhanced, &name, type_name, profile(depth), profile(ACKNOWLEDGED))
            .map_err(|e| failed(e.to_string()))?;
        let response_topic = format!("rr{resolved}Reply");
        let participant = context.domain_participant();
        // A server has one writer, and keeps its GUID to itself.
        let writer = large_response::writers(context).difference(&before).next().copied();
        let writer = writer.ok_or_else(|| failed("its response writer is not announced".to_owned()))?;
        Self::of_ends(Ends::Server(server), writer, label, response_topic, participant)
    }

    /// Likewise, of a type that an action brings with it, whose name in DDS `type_name` begins:
    /// `package::action::dds_::Action_SendGoal`. The crate has names for types of `srv` only.
    ///
    /// # Errors
    /// [`ServiceError`] when the middleware refuses it.
    pub fn of_action(
        node: &mut Node,
        context: &Context,
        resolved: &str,
        label: &'static str,
        type_name: &str,
        depth: usize,
    ) -> Result<Self, ServiceError> {
        let failed = |reason: String| ServiceError { name: label.to_owned(), reason };
        let participant = context.domain_participant();
        let qos = QosPolicies::from(&profile(ACKNOWLEDGED));
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
        Self::of_ends(Ends::Topics { requests, responses }, writer, label, response_topic, participant)
    }

    fn of_ends(
        ends: Ends<Q, A>,
        writer: Guid,
        label: &'static str,
        response_topic: String,
        participant: DomainParticipant,
    ) -> Result<Self, ServiceError> {
        let clients = Readers::new(writer, response_topic.clone(), participant.clone());
        let large = clients.map(LargeResponses::new).map_err(|error| ServiceError {
            name: label.to_owned(),
            reason: format!("no socket: {error}"),
        })?;
        Ok(Service { label, ends, response_topic, participant, large, written: Mutex::new(0) })
    }

    /// Requests as they come, or why one could not be read.
    pub fn requests(&self) -> BoxStream<'_, Result<(RmwRequestId, Q), String>>
    where
        Q: Send + Sync,
        A: Send + Sync,
    {
        let label = self.label;
        let unreadable = move |error| format!("a request to {label} could not be read: {error:?}");
        match &self.ends {
            Ends::Server(server) => {
                let requests = server.receive_request_stream();
                requests
                    .map(move |received| received.map(|(id, Wire(q))| (id, q)).map_err(unreadable))
                    .boxed()
            }
            Ends::Topics { requests, .. } => requests
                .async_stream()
                .map(move |received| match received {
                    Ok((request, info)) => Ok((request_id(&info), request)),
                    Err(error) => Err(unreadable(error)),
                })
                .boxed(),
        }
    }

    /// Likewise, each made one of the requests that several services share.
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

    /// Sends the response to a request, once its client is known; its place is free again then.
    pub fn respond<'a>(&'a self, id: RmwRequestId, response: A, place: Place) -> BoxFuture<'a, ()>
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
                // Kept until it need not be said again.
                Ok(Some((datagram, number))) => self.large.repeat(datagram, number).await,
                Err(reason) => {
                    tracing::warn!("the response of {} could not be sent: {reason}", self.label);
                }
            }
            drop(place);
        }
        .boxed()
    }

    /// Hands a response to RustDDS, and sends it ourselves when it is `large`; comes back with the
    /// datagram of that and its sequence number.
    async fn write(
        &self,
        id: RmwRequestId,
        response: A,
        large: Option<Vec<u8>>,
    ) -> Result<Option<(Vec<u8>, i64)>, String> {
        // Held while writing, so that the count keeps the order of the writer, and while a large one
        // is sent, so that many of them do not come at once.
        let mut written = self.written.lock().await;
        match &self.ends {
            Ends::Server(server) => {
                server.async_send_response(id, Wire(response)).await.map_err(|error| format!("{error:?}"))?;
            }
            Ends::Topics { responses, .. } => {
                let options = WriteOptionsBuilder::new()
                    .source_timestamp(Timestamp::now())
                    .related_sample_identity(SampleIdentity::from(id));
                let written = responses.async_write_with_options(response, options.build()).await;
                written.map_err(|error| error.to_string())?;
            }
        }
        *written += 1;
        let Some(payload) = large else { return Ok(None) };
        let datagram = self.large.datagram(&id, *written, &payload);
        self.large.send(&datagram).await;
        Ok(Some((datagram, *written)))
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

/// The identity of a request, which its response repeats.
fn request_id(info: &MessageInfo) -> RmwRequestId {
    let own = RmwRequestId { writer_gid: info.publisher_gid(), sequence_number: info.sequence_number() };
    match info.related_request_id() {
        // Fast DDS names its response reader there, and leaves the number to the sample.
        Some(id) if id.sequence_number == i64::from(SequenceNumber::UNKNOWN) => {
            RmwRequestId { sequence_number: own.sequence_number, ..id }
        }
        Some(id) => id,
        None => own,
    }
}
