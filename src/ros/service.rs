//! Services under their resolved names.
//!
//! A response is sent when the response reader of its client has been discovered, and is delivered at any length up to
//! some 65 kB (see [`super::large_response`]).

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::future::ready;
use std::sync::Arc;
use std::time::Duration;

use futures::future::BoxFuture;
use futures::stream::{BoxStream, FuturesUnordered};
use futures::{FutureExt, StreamExt};
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::service::RmwRequestId;
use ros2_client::{Context, Message, MessageTypeName, Name, Node, Publisher, ServiceTypeName};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::args::RosArgs;
use super::large_response::LargeResponses;
use super::renewable::{DeliveredSamples, EndpointContext, Renewable};
use super::response_limiter::{ResponseLimiter, ResponsePermit};
use super::service_endpoints::ServiceOfParticipant;
use crate::interface::{NodeService, Topic};

/// Longest time for which a write waits for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

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

/// Longest time for which a response waits for the discovery of its client. A request can arrive before the client's
/// response reader is discovered, and a response written then would be lost.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(1);
/// Depth of response writers, which limits acknowledged samples only: the middleware keeps unacknowledged samples at
/// any depth. A list of all parameters has 20 kB.
pub const RESPONSE_DEPTH: usize = 1;

/// Returns the QoS profile of a service: reliable, volatile, keep last `depth`.
pub fn profile(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Wait(WRITE_TIMEOUT))
        .history(History::KeepLast { depth })
}

/// Creates the publisher of a topic with the QoS of [`profile`].
///
/// # Errors
/// [`ServiceError`] with the name of the topic if it cannot be resolved or created.
pub fn publisher<M: Message + Send + Sync + 'static>(
    node: &mut Node,
    context: &EndpointContext,
    args: &RosArgs,
    topic: &Topic,
    depth: usize,
) -> Result<Arc<Renewable<Publisher<M>>>, ServiceError> {
    let Topic { name, package, message, .. } = *topic;
    let error = |reason: String| ServiceError { name: name.to_owned(), reason };
    let resolved = args.resolve_topic(name).map_err(|e| error(e.to_string()))?;
    let name = Name::parse(&resolved).map_err(|e| error(e.to_string()))?;
    let create = move |node: &mut Node, _: &Context| {
        let topic = node.create_topic(&name, MessageTypeName::new(package, message), &profile(depth));
        topic.and_then(|topic| node.create_publisher(&topic, None)).map_err(|e| e.to_string())
    };
    Renewable::create(node, context, create).map_err(error)
}

/// Service with its response writer.
pub struct Service<Q: Serialize + DeserializeOwned, A: Serialize + DeserializeOwned> {
    label: &'static str,
    network: Arc<Renewable<ServiceOfParticipant<Q, A>>>,
}

impl<Q, A> Service<Q, A>
where
    Q: Serialize + DeserializeOwned + Send + Sync + 'static,
    A: Serialize + DeserializeOwned + Send + Sync + 'static,
{
    /// Creates `service` of `node`, which belongs to `context`.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create the service.
    pub fn new(
        node: &mut Node,
        context: &EndpointContext,
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
        context: &EndpointContext,
        resolved: &str,
        label: &'static str,
        type_name: &ServiceTypeName,
        depth: usize,
    ) -> Result<Self, ServiceError>
    where
        Q: Clone,
    {
        let (resolved, type_name) = (resolved.to_owned(), type_name.clone());
        let create = move |node: &mut Node, context: &Context| {
            ServiceOfParticipant::of_server(node, context, &resolved, &type_name, depth)
        };
        Self::create(node, context, label, create)
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
        context: &EndpointContext,
        resolved: &str,
        label: &'static str,
        type_name: &str,
        depth: usize,
    ) -> Result<Self, ServiceError> {
        let (resolved, type_name) = (resolved.to_owned(), type_name.to_owned());
        let create = move |node: &mut Node, context: &Context| {
            ServiceOfParticipant::of_topics(node, context, &resolved, &type_name, depth)
        };
        Self::create(node, context, label, create)
    }

    fn create(
        node: &mut Node,
        context: &EndpointContext,
        label: &'static str,
        create: impl Fn(&mut Node, &Context) -> Result<ServiceOfParticipant<Q, A>, String> + Send + Sync + 'static,
    ) -> Result<Self, ServiceError> {
        let network = Renewable::create(node, context, create)
            .map_err(|reason| ServiceError { name: label.to_owned(), reason })?;
        Ok(Service { label, network })
    }

    /// Returns the requests in order of reception. An item is an error if a request could not be decoded.
    pub fn requests(&self) -> BoxStream<'_, Result<(RmwRequestId, Q), String>> {
        let label = self.label;
        let mut delivered = DeliveredSamples::default();
        let received = self.network.items(|service| async move { service.receive().await });
        received
            .filter_map(move |(reader, received)| {
                let is_new = received.as_ref().map_or(true, |(id, _)| {
                    delivered.insert(id.writer_gid.to_bytes16(), id.sequence_number, reader)
                });
                ready(is_new.then_some(received))
            })
            .map(move |received| received.map_err(|e| format!("cannot decode a request to {label}: {e:?}")))
            .boxed()
    }

    /// Returns the requests, each converted by `wrap` to a type that several services share.
    pub fn requests_as<'a, R: 'a>(
        &'a self,
        wrap: impl Fn(RmwRequestId, Q) -> R + Send + 'a,
    ) -> BoxStream<'a, Result<R, String>> {
        self.requests().map(move |received| received.map(|(id, request)| wrap(id, request))).boxed()
    }

    /// Serves until the node shuts down; `answer` executes a request and returns its response.
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
    pub fn respond<'a>(&'a self, id: RmwRequestId, response: A, permit: ResponsePermit) -> BoxFuture<'a, ()> {
        self.respond_within(id, response, permit, CLIENT_TIMEOUT)
    }

    /// Sends a response as [`Service::respond`] does, when its client is discovered or after `timeout`.
    pub fn respond_within<'a>(
        &'a self,
        id: RmwRequestId,
        response: A,
        permit: ResponsePermit,
        timeout: Duration,
    ) -> BoxFuture<'a, ()> {
        async move {
            let service = self.network.current();
            let large = match LargeResponses::encode(&response) {
                Ok(large) => large,
                Err(error) => {
                    tracing::error!("no response of {} is sent: {error}", self.label);
                    return;
                }
            };
            if !service.wait_for_client(&id, timeout).await {
                tracing::debug!("the client of {} has left or was not discovered", self.label);
            }
            match service.write(id, response, large).await {
                Ok(None) => {}
                // The permit is held during the repetitions.
                Ok(Some((datagram, number))) => service.large_responses.repeat(datagram, number).await,
                Err(reason) => {
                    tracing::warn!("the response of {} could not be sent: {reason}", self.label);
                }
            }
            drop(permit);
        }
        .boxed()
    }
}
