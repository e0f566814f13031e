//! Parameter services of a node (`~/get_parameters` and five others) and `/parameter_events`.

use std::future::Future;

use futures::{
    StreamExt,
    future::BoxFuture,
    stream::{FuturesUnordered, select_all},
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

use super::create::{ServiceError, create_publisher, create_service};
use super::shortened::shortened;
use crate::ros_interface::{self, PARAMETER_EVENTS, PARAMETER_EVENTS_QOS};
use crate::validation::args::RosArgs;
use crate::validation::parameters::{self as wire, ParameterHost, list_parameters};
use virtual_axes_dds::{Node, Publisher, RequestId, ResponseLimiter, ResponsePermit, Service};

/// Depth of rmw's profile for parameter services: number of requests that a client may send at once.
const QUEUE_DEPTH: usize = 1000;

enum Request {
    Get(RequestId, GetParametersRequest),
    Types(RequestId, GetParameterTypesRequest),
    Set(RequestId, SetParametersRequest),
    SetAtomically(RequestId, SetParametersAtomicallyRequest),
    List(RequestId, ListParametersRequest),
    Describe(RequestId, DescribeParametersRequest),
}

/// Parameter services of a node.
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
    /// Creates the services of `node`, and the publisher of `/parameter_events`.
    ///
    /// # Errors
    /// `ServiceError` naming the first that cannot be created.
    pub fn new(node: &Node, args: &RosArgs) -> Result<Self, ServiceError> {
        Ok(Self {
            get: create_service(node, args, &ros_interface::GET_PARAMETERS, QUEUE_DEPTH)?,
            types: create_service(node, args, &ros_interface::GET_PARAMETER_TYPES, QUEUE_DEPTH)?,
            set: create_service(node, args, &ros_interface::SET_PARAMETERS, QUEUE_DEPTH)?,
            set_atomically: create_service(
                node,
                args,
                &ros_interface::SET_PARAMETERS_ATOMICALLY,
                QUEUE_DEPTH,
            )?,
            list: create_service(node, args, &ros_interface::LIST_PARAMETERS, QUEUE_DEPTH)?,
            describe: create_service(node, args, &ros_interface::DESCRIBE_PARAMETERS, QUEUE_DEPTH)?,
            events: create_publisher(node, args, &PARAMETER_EVENTS, PARAMETER_EVENTS_QOS.depth)?,
            node_name: args.node().to_string(),
        })
    }

    /// Answers requests with the parameters of `host` until `stop` completes; `now` returns the time stamp of an event.
    pub async fn serve<H: ParameterHost>(
        &self,
        host: &mut H,
        now: impl Fn() -> Time + Send,
        stop: impl Future<Output = ()> + Send,
    ) {
        let mut requests = select_all([
            self.get.requests_as(Request::Get),
            self.types.requests_as(Request::Types),
            self.set.requests_as(Request::Set),
            self.set_atomically.requests_as(Request::SetAtomically),
            self.list.requests_as(Request::List),
            self.describe.requests_as(Request::Describe),
        ]);
        // Responses are sent concurrently, so that a client that is discovered late does not delay others.
        let mut responses: FuturesUnordered<BoxFuture<'_, ()>> = FuturesUnordered::new();
        let limiter = ResponseLimiter::default();
        tokio::pin!(stop);
        loop {
            tokio::select! {
                biased;
                () = &mut stop => break,
                Some(()) = responses.next(), if !responses.is_empty() => {}
                Some((permit, request)) = limiter.next(&mut requests) => match request {
                    Ok(request) => {
                        let response = self.handle_request(host, &now, request, permit).await;
                        responses.push(response);
                    }
                    Err(reason) => tracing::warn!("{reason}"),
                },
                else => break,
            }
        }
    }

    /// Executes a request and returns the future that sends the response.
    async fn handle_request<'a, H: ParameterHost>(
        &'a self,
        host: &mut H,
        now: &(impl Fn() -> Time + Send),
        request: Request,
        permit: ResponsePermit,
    ) -> BoxFuture<'a, ()> {
        match request {
            Request::Get(id, request) => {
                let values = limit_count(&request.names).iter().map(|name| host.get(name));
                let values = values.map(wire::value_to_wire).collect();
                self.get.respond(id, GetParametersResponse { values }, permit)
            }
            Request::Types(id, request) => {
                let kinds = limit_count(&request.names)
                    .iter()
                    .map(|name| wire::type_number(host.get(name).map(|value| value.kind())));
                let types = kinds.collect();
                self.types.respond(id, GetParameterTypesResponse { types }, permit)
            }
            Request::Set(id, request) => {
                if let Err(reason) = wire::check_count(request.parameters.len()) {
                    let results = vec![wire::result_to_wire(Err(reason))];
                    return self.set.respond(id, SetParametersResponse { results }, permit);
                }
                let mut results = Vec::with_capacity(request.parameters.len());
                for parameter in request.parameters {
                    let result = self.set(host, now, vec![parameter]).await;
                    results.push(wire::result_to_wire(result));
                }
                self.set.respond(id, SetParametersResponse { results }, permit)
            }
            Request::SetAtomically(id, request) => {
                let result = self.set(host, now, request.parameters).await;
                let result = wire::result_to_wire(result);
                self.set_atomically.respond(id, SetParametersAtomicallyResponse { result }, permit)
            }
            Request::List(id, request) => {
                let result = list_limited(&host.names(), &request.prefixes, request.depth);
                self.list.respond(id, ListParametersResponse { result }, permit)
            }
            Request::Describe(id, request) => {
                let descriptors = limit_count(&request.names).iter().map(|name| {
                    let descriptor = host.describe(name);
                    wire::descriptor_to_wire(name.clone(), descriptor)
                });
                let descriptors = descriptors.collect();
                let response = shortened(DescribeParametersResponse { descriptors });
                self.describe.respond(id, response, permit)
            }
        }
    }

    /// Sets all of `parameters` or none, and publishes the event.
    async fn set<H: ParameterHost>(
        &self,
        host: &mut H,
        now: &(impl Fn() -> Time + Send),
        parameters: Vec<msg::Parameter>,
    ) -> Result<(), String> {
        wire::check_count(parameters.len())?;
        let changes = parameters.into_iter().map(wire::parameter_from_wire).collect::<Result<Vec<_>, _>>()?;
        if changes.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = changes.iter().map(|(name, _)| name.clone()).collect();
        host.ready().await;
        host.set(changes)?;
        // The event contains the stored values: the host may have converted 4 to 4.0.
        let changed_parameters = names
            .into_iter()
            .map(|name| msg::Parameter { value: wire::value_to_wire(host.get(&name)), name });
        let event = msg::ParameterEvent {
            stamp: now(),
            node: self.node_name.clone(),
            changed_parameters: changed_parameters.collect(),
            ..Default::default()
        };
        if !self.events.publish(event).await {
            tracing::warn!("parameter event not published");
        }
        Ok(())
    }
}

/// Returns the names of a request, or none if there are too many: the response to all of them is built in memory.
fn limit_count(names: &[String]) -> &[String] {
    match wire::check_count(names.len()) {
        Ok(()) => names,
        Err(reason) => {
            tracing::warn!("parameter request answered with an empty response: {reason}");
            &[]
        }
    }
}

/// Returns the parameters under `prefixes`, or none if there are too many prefixes; an empty list would select all.
fn list_limited(names: &[String], prefixes: &[String], depth: u64) -> msg::ListParametersResult {
    if limit_count(prefixes).len() < prefixes.len() {
        return msg::ListParametersResult::default();
    }
    list_parameters(names, prefixes, depth)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A descriptor is about ten times as long as a name, and a request can contain millions of names.
    #[test]
    fn requests_with_too_many_names_are_not_answered() {
        let names = vec!["x.velocity_loop.gain".to_owned(); 1001];
        assert_eq!(limit_count(&names[..1000]).len(), 1000);
        assert!(limit_count(&names).is_empty());
        let known = ["x.velocity_loop.gain".to_owned()];
        assert_eq!(list_limited(&known, &names[..1000], 0).names, known);
        assert!(list_limited(&known, &names, 0).names.is_empty());
    }
}
