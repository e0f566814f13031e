//! The six parameter services of a node, and `/parameter_events`.
//!
//! The crate's own services describe no parameter, and come with its spinner, which subscribes to
//! `/clock` with a wrong type. So the node is created with
//! `NodeOptions::new().start_parameter_services(false)`, its spinner stays unused, and the services
//! are these.

mod list;
mod types;
mod wire;

use std::{future::Future, time::Duration};

use futures::{
    FutureExt, StreamExt,
    future::BoxFuture,
    stream::{BoxStream, FuturesUnordered, select_all},
};
use ros2_client::{
    Message, MessageTypeName, Name, Node, Publisher, Server, ServiceMapping, ServiceTypeName,
    qos::{History, QosProfile, WhenFull},
    service::RmwRequestId,
};
use ros2_interfaces_jazzy_serde::{
    builtin_interfaces::msg::Time,
    rcl_interfaces::{
        msg,
        srv::{
            DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
            GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
            ListParametersResponse, SetParametersAtomicallyRequest, SetParametersAtomicallyResponse,
            SetParametersRequest, SetParametersResponse,
        },
    },
};
use rustdds::DomainParticipant;

pub use self::types::{Descriptor, ParameterHost, ParameterType, ParameterValue, Range};
use super::args::RosArgs;

/// rmw's profile for parameter services and events keeps this many, so that a client may send that
/// many requests at once.
const QUEUE_DEPTH: usize = 1000;
/// How long a write may wait for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);
/// A client's request can arrive before its response reader is known here, and a response that is
/// written then reaches nobody. So long a response is held back,
const CLIENT_TIMEOUT: Duration = Duration::from_secs(1);
/// and so often it is looked whether the reader has come.
const CLIENT_POLL: Duration = Duration::from_millis(5);
/// From a reader's discovery until the writer serves it.
const CLIENT_SETTLE: Duration = Duration::from_millis(10);

/// A service or topic of the parameter interface could not be created.
#[derive(Debug, thiserror::Error)]
#[error("cannot create '{name}': {reason}")]
pub struct ParameterServicesError {
    /// Its name.
    pub name: String,
    /// Why not.
    pub reason: String,
}

enum Request {
    Get(RmwRequestId, GetParametersRequest),
    Types(RmwRequestId, GetParameterTypesRequest),
    Set(RmwRequestId, SetParametersRequest),
    SetAtomically(RmwRequestId, SetParametersAtomicallyRequest),
    List(RmwRequestId, ListParametersRequest),
    Describe(RmwRequestId, DescribeParametersRequest),
    Unreadable(&'static str, String),
}

/// One service: its server, and the DDS topic on which its responses go out.
struct Service<Q: Message, A: Message> {
    label: &'static str,
    server: Server<Q, A>,
    response_topic: String,
    participant: DomainParticipant,
}

/// The services of one node, ready to [`Self::serve`].
pub struct ParameterServices {
    get: Service<GetParametersRequest, GetParametersResponse>,
    types: Service<GetParameterTypesRequest, GetParameterTypesResponse>,
    set: Service<SetParametersRequest, SetParametersResponse>,
    set_atomically: Service<SetParametersAtomicallyRequest, SetParametersAtomicallyResponse>,
    list: Service<ListParametersRequest, ListParametersResponse>,
    describe: Service<DescribeParametersRequest, DescribeParametersResponse>,
    events: Publisher<msg::ParameterEvent>,
    node_name: String,
}

impl ParameterServices {
    /// Creates the services under the node's name, and the publisher of `/parameter_events`.
    /// `participant` is the one that `node` lives on.
    ///
    /// # Errors
    /// The first one that the middleware refuses.
    pub fn new(
        node: &mut Node,
        participant: &DomainParticipant,
        args: &RosArgs,
    ) -> Result<Self, ParameterServicesError> {
        let mut door = Door { node, participant, args };
        Ok(Self {
            get: door.service("get_parameters", "GetParameters")?,
            types: door.service("get_parameter_types", "GetParameterTypes")?,
            set: door.service("set_parameters", "SetParameters")?,
            set_atomically: door.service("set_parameters_atomically", "SetParametersAtomically")?,
            list: door.service("list_parameters", "ListParameters")?,
            describe: door.service("describe_parameters", "DescribeParameters")?,
            events: door.events()?,
            node_name: args.node().to_string(),
        })
    }

    /// Answers requests from `host` until `stop` is done. `now` stamps the events.
    pub async fn serve<H: ParameterHost>(
        self,
        mut host: H,
        now: impl Fn() -> Time + Send,
        stop: impl Future<Output = ()> + Send,
    ) {
        let mut requests = select_all([
            self.get.requests(Request::Get),
            self.types.requests(Request::Types),
            self.set.requests(Request::Set),
            self.set_atomically.requests(Request::SetAtomically),
            self.list.requests(Request::List),
            self.describe.requests(Request::Describe),
        ]);
        // Responses are sent side by side: one client that is slow to be discovered holds up no other.
        let mut responses: FuturesUnordered<BoxFuture<'_, ()>> = FuturesUnordered::new();
        tokio::pin!(stop);
        loop {
            tokio::select! {
                biased;
                () = &mut stop => break,
                Some(()) = responses.next(), if !responses.is_empty() => {}
                Some(request) = requests.next() => {
                    let response = self.answer(&mut host, &now, request).await;
                    responses.extend(response);
                }
                else => break,
            }
        }
    }

    /// Does what `request` asks; the future that comes back sends the response.
    async fn answer<'a, H: ParameterHost>(
        &'a self,
        host: &mut H,
        now: &(impl Fn() -> Time + Send),
        request: Request,
    ) -> Option<BoxFuture<'a, ()>> {
        Some(match request {
            Request::Get(id, request) => {
                let values = request.names.iter().map(|name| host.get(name));
                let values = values.map(wire::value_to_wire).collect();
                self.get.respond(id, GetParametersResponse { values })
            }
            Request::Types(id, request) => {
                let kinds = request
                    .names
                    .iter()
                    .map(|name| wire::type_number(host.get(name).map(|value| value.kind())));
                let types = kinds.collect();
                self.types.respond(id, GetParameterTypesResponse { types })
            }
            Request::Set(id, request) => {
                let mut results = Vec::with_capacity(request.parameters.len());
                for parameter in request.parameters {
                    let result = self.set(host, now, vec![parameter]).await;
                    results.push(wire::result_to_wire(result));
                }
                self.set.respond(id, SetParametersResponse { results })
            }
            Request::SetAtomically(id, request) => {
                let result = self.set(host, now, request.parameters).await;
                let result = wire::result_to_wire(result);
                self.set_atomically.respond(id, SetParametersAtomicallyResponse { result })
            }
            Request::List(id, request) => {
                let result = list::list(&host.names(), &request.prefixes, request.depth);
                self.list.respond(id, ListParametersResponse { result })
            }
            Request::Describe(id, request) => {
                let descriptors = request.names.into_iter().map(|name| {
                    let descriptor = host.describe(&name);
                    wire::descriptor_to_wire(name, descriptor)
                });
                let descriptors = descriptors.collect();
                self.describe.respond(id, DescribeParametersResponse { descriptors })
            }
            Request::Unreadable(label, reason) => {
                tracing::warn!("a request to {label} could not be read: {reason}");
                return None;
            }
        })
    }

    /// Sets all of `parameters` or none, and publishes the event.
    async fn set<H: ParameterHost>(
        &self,
        host: &mut H,
        now: &(impl Fn() -> Time + Send),
        parameters: Vec<msg::Parameter>,
    ) -> Result<(), String> {
        let changes = parameters.into_iter().map(wire::parameter_from_wire).collect::<Result<Vec<_>, _>>()?;
        if changes.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = changes.iter().map(|(name, _)| name.clone()).collect();
        host.set(changes)?;
        // What the host made of a value is what counts: it may have turned 4 into 4.0.
        let changed_parameters = names
            .into_iter()
            .map(|name| msg::Parameter { value: wire::value_to_wire(host.get(&name)), name });
        let event = msg::ParameterEvent {
            stamp: now(),
            node: self.node_name.clone(),
            changed_parameters: changed_parameters.collect(),
            ..Default::default()
        };
        if let Err(error) = self.events.async_publish(event).await {
            tracing::warn!("a parameter event could not be published: {error:?}");
        }
        Ok(())
    }
}

impl<Q, A> Service<Q, A>
where
    Q: Message + Send + Sync + 'static,
    A: Message + Send + Sync + 'static,
{
    fn requests<'a>(
        &'a self,
        wrap: impl Fn(RmwRequestId, Q) -> Request + Send + 'a,
    ) -> BoxStream<'a, Request> {
        let label = self.label;
        self.server
            .receive_request_stream()
            .map(move |received| match received {
                Ok((id, request)) => wrap(id, request),
                Err(error) => Request::Unreadable(label, format!("{error:?}")),
            })
            .boxed()
    }

    fn respond<'a>(&'a self, id: RmwRequestId, response: A) -> BoxFuture<'a, ()> {
        async move {
            self.wait_for_client(&id).await;
            if let Err(error) = self.server.async_send_response(id, response).await {
                tracing::warn!("the response of {} could not be sent: {error:?}", self.label);
            }
        }
        .boxed()
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

/// Where services and topics are created.
struct Door<'a> {
    node: &'a mut Node,
    participant: &'a DomainParticipant,
    args: &'a RosArgs,
}

impl Door<'_> {
    fn profile() -> QosProfile {
        QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Wait(WRITE_TIMEOUT))
            .history(History::KeepLast { depth: QUEUE_DEPTH })
    }

    fn service<Q: Message + Clone + 'static, A: Message + 'static>(
        &mut self,
        label: &'static str,
        type_name: &str,
    ) -> Result<Service<Q, A>, ParameterServicesError> {
        let error = |reason: String| ParameterServicesError { name: label.to_owned(), reason };
        let resolved = self.args.resolve_service(&format!("~/{label}")).map_err(|e| error(e.to_string()))?;
        let name = Name::parse(&resolved).map_err(|e| error(e.to_string()))?;
        let server = self
            .node
            .create_server(
                ServiceMapping::Enhanced,
                &name,
                &ServiceTypeName::new("rcl_interfaces", type_name),
                Self::profile(),
                Self::profile(),
            )
            .map_err(|e| error(e.to_string()))?;
        Ok(Service {
            label,
            server,
            response_topic: format!("rr{resolved}Reply"),
            participant: self.participant.clone(),
        })
    }

    fn events(&mut self) -> Result<Publisher<msg::ParameterEvent>, ParameterServicesError> {
        let error = |reason: String| ParameterServicesError { name: "/parameter_events".to_owned(), reason };
        let resolved = self.args.resolve_topic("/parameter_events").map_err(|e| error(e.to_string()))?;
        let name = Name::parse(&resolved).map_err(|e| error(e.to_string()))?;
        let topic = self
            .node
            .create_topic(&name, MessageTypeName::new("rcl_interfaces", "ParameterEvent"), &Self::profile())
            .map_err(|e| error(e.to_string()))?;
        self.node.create_publisher(&topic, None).map_err(|e| error(e.to_string()))
    }
}
