//! Services of the lifecycle and `~/transition_event`.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::{FuturesUnordered, select_all};
use ros2_interfaces_jazzy_serde::lifecycle_msgs::msg::{Transition, TransitionDescription, TransitionEvent};
use ros2_interfaces_jazzy_serde::lifecycle_msgs::srv::{
    ChangeStateRequest, ChangeStateResponse, GetAvailableStatesRequest, GetAvailableStatesResponse,
    GetAvailableTransitionsRequest, GetAvailableTransitionsResponse, GetStateRequest, GetStateResponse,
};
use tokio::sync::{mpsc, oneshot};

use super::states::{self, PrimaryState, RequestedTransition};
use crate::ros::services::create::{ServiceError, create_publisher, create_service};
use crate::ros_interface::{
    CHANGE_STATE, GET_AVAILABLE_STATES, GET_AVAILABLE_TRANSITIONS, GET_STATE, GET_TRANSITION_GRAPH,
    TRANSITION_EVENT, TRANSITION_EVENT_QOS,
};
use crate::validation::args::RosArgs;
use virtual_axes_dds::{Node, Publisher, RequestId, ResponseLimiter, ResponsePermit, Service};

/// Number of requests that may wait.
const DEPTH: usize = 10;
/// Longest time for which the response to a cleanup waits until the new participant has discovered the client.
const CLEANUP_TIMEOUT: Duration = Duration::from_secs(10);

/// Request to execute a transition.
#[derive(Debug)]
pub struct TransitionRequest {
    /// Transition.
    pub transition: RequestedTransition,
    /// Identity of the request.
    pub id: RequestId,
    /// Receiver of the result: true if the transition succeeded.
    pub done: oneshot::Sender<bool>,
}

/// Services of the lifecycle and the publisher of its transitions.
pub struct LifecycleServer {
    change: Service<ChangeStateRequest, ChangeStateResponse>,
    state: Service<GetStateRequest, GetStateResponse>,
    states: Service<GetAvailableStatesRequest, GetAvailableStatesResponse>,
    transitions: Service<GetAvailableTransitionsRequest, GetAvailableTransitionsResponse>,
    graph: Service<GetAvailableTransitionsRequest, GetAvailableTransitionsResponse>,
    events: Publisher<TransitionEvent>,
}

/// Received request.
enum Request {
    Change(RequestId, ChangeStateRequest),
    State(RequestId),
    States(RequestId),
    Transitions(RequestId),
    Graph(RequestId),
}

/// Transition that is being executed.
struct Execution {
    description: TransitionDescription,
    id: RequestId,
    permit: ResponsePermit,
    done: oneshot::Receiver<bool>,
}

impl LifecycleServer {
    /// Creates the services of `node`, and the publisher.
    ///
    /// # Errors
    /// [`ServiceError`] naming the first that cannot be created.
    pub fn new(node: &Node, args: &RosArgs) -> Result<Self, ServiceError> {
        Ok(Self {
            change: create_service(node, args, &CHANGE_STATE, DEPTH)?,
            state: create_service(node, args, &GET_STATE, DEPTH)?,
            states: create_service(node, args, &GET_AVAILABLE_STATES, DEPTH)?,
            transitions: create_service(node, args, &GET_AVAILABLE_TRANSITIONS, DEPTH)?,
            graph: create_service(node, args, &GET_TRANSITION_GRAPH, DEPTH)?,
            events: create_publisher(node, args, &TRANSITION_EVENT, TRANSITION_EVENT_QOS.depth)?,
        })
    }

    /// Serves until a cleanup or until the node shuts down, from the state unconfigured on; sends each transition to
    /// `transitions`. Responds to `cleanup`, the request that has led to this state: its response comes when the next
    /// request can be served.
    pub async fn serve(self, transitions: mpsc::Sender<TransitionRequest>, cleanup: Option<RequestId>) {
        let mut state = PrimaryState::Unconfigured;
        let mut execution: Option<Execution> = None;
        let mut requests = select_all([
            self.change.requests_as(Request::Change),
            self.state.requests_as(|id, _| Request::State(id)),
            self.states.requests_as(|id, _| Request::States(id)),
            self.transitions.requests_as(|id, _| Request::Transitions(id)),
            self.graph.requests_as(|id, _| Request::Graph(id)),
        ]);
        let mut responses: FuturesUnordered<BoxFuture<'_, ()>> = FuturesUnordered::new();
        if let Some(id) = cleanup {
            let response = ChangeStateResponse { success: true };
            responses.push(self.change.respond_within(id, response, None, CLEANUP_TIMEOUT));
        }
        let limiter = ResponseLimiter::default();
        loop {
            tokio::select! {
                biased;
                Some(()) = responses.next(), if !responses.is_empty() => {}
                is_successful = ended(&mut execution) => {
                    let Some(Execution { description, id, permit, .. }) = execution.take() else { continue };
                    if let Some((end, after)) = states::end(&description.goal_state, is_successful) {
                        self.publish(end).await;
                        state = after;
                    }
                    if is_successful && description.transition.id == Transition::TRANSITION_CLEANUP {
                        // Another participant responds, and serves the next requests.
                        return;
                    }
                    responses.push(self.change.respond(id, ChangeStateResponse { success: is_successful }, permit));
                }
                Some((permit, request)) = limiter.next(&mut requests) => match request {
                    Ok(Request::Change(id, request)) => {
                        let found = state.find(&request.transition).filter(|_| execution.is_none());
                        let Some((description, transition)) =
                            found.and_then(|row| RequestedTransition::of(&row).map(|transition| (row, transition)))
                        else {
                            let label = &request.transition.label;
                            let given = if label.is_empty() { request.transition.id.to_string() } else { label.clone() };
                            tracing::warn!("transition {given} rejected: {}", allowed(state, execution.as_ref()));
                            responses.push(self.change.respond(id, ChangeStateResponse { success: false }, permit));
                            continue;
                        };
                        self.publish(description.clone()).await;
                        let (done, result) = oneshot::channel();
                        // The receiver is dropped only at shutdown.
                        let _ = transitions.send(TransitionRequest { transition, id, done }).await;
                        execution = Some(Execution { description, id, permit, done: result });
                    }
                    Ok(Request::State(id)) => {
                        let current_state = match &execution {
                            Some(execution) => execution.description.goal_state.clone(),
                            None => state.message(),
                        };
                        responses.push(self.state.respond(id, GetStateResponse { current_state }, permit));
                    }
                    Ok(Request::States(id)) => {
                        let response = GetAvailableStatesResponse { available_states: states::states() };
                        responses.push(self.states.respond(id, response, permit));
                    }
                    Ok(Request::Transitions(id)) => {
                        let available_transitions =
                            if execution.is_some() { Vec::new() } else { state.available() };
                        let response = GetAvailableTransitionsResponse { available_transitions };
                        responses.push(self.transitions.respond(id, response, permit));
                    }
                    Ok(Request::Graph(id)) => {
                        let response =
                            GetAvailableTransitionsResponse { available_transitions: states::transitions() };
                        responses.push(self.graph.respond(id, response, permit));
                    }
                    Err(reason) => tracing::warn!("{reason}"),
                },
                else => break,
            }
        }
    }

    /// Publishes the beginning or the end of a transition.
    async fn publish(&self, row: TransitionDescription) {
        let TransitionDescription { transition, start_state, goal_state } = row;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let timestamp = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
        let event = TransitionEvent { timestamp, transition, start_state, goal_state };
        if !self.events.publish(event).await {
            tracing::warn!("transition event not published");
        }
    }
}

/// Waits for the end of a transition; false if it was given up. Without one, waits forever.
async fn ended(execution: &mut Option<Execution>) -> bool {
    match execution {
        Some(execution) => (&mut execution.done).await.unwrap_or(false),
        None => std::future::pending().await,
    }
}

/// Returns the transitions that are possible, as text.
fn allowed(state: PrimaryState, execution: Option<&Execution>) -> String {
    if let Some(execution) = execution {
        return format!("the node is {}", execution.description.goal_state.label);
    }
    let labels: Vec<String> = state.available().into_iter().map(|row| row.transition.label).collect();
    match labels.is_empty() {
        true => format!("the node is {}; no transition is possible", state.message().label),
        false => format!("the node is {}; possible are {}", state.message().label, labels.join(", ")),
    }
}
