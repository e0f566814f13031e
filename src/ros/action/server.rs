//! Server of an action: its services and topics, and the task that owns the goals.

use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::{FuturesUnordered, select_all};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::service::RmwRequestId;
use ros2_client::{MessageTypeName, Node, ServiceTypeName};
use rustdds::TopicKind;
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::sync::{mpsc, oneshot, watch};
use tracing::{info, warn};

use super::GoalId;
use super::goals::{GoalState, GoalTable, ResultReply};
use crate::ingress::args::RosArgs;
use crate::interface::NodeAction;
use crate::ros::axes_interface::Command;
use crate::ros::endpoints::{
    BLOCKING_WINDOW, MAX_UNACKNOWLEDGED, Publisher, create_topic, with_sample_limit,
};
use crate::ros::goal_event::goal_name;
use crate::ros::health::Health;
use crate::ros::outputs::Output;
use crate::ros::renewable::EndpointContext;
use crate::ros::response_limiter::{ResponseLimiter, ResponsePermit};
use crate::ros::service::{Service, ServiceError};
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages::action_msgs::msg::GoalStatusArray;
use virtual_axes_io::messages::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use virtual_axes_io::messages::{
    FeedbackMessage, GetResultRequest, GetResultResponse, SendGoalRequest, SendGoalResponse, stamp,
};

/// Number of requests that may wait, rmw's default for services.
const SERVICE_DEPTH: usize = 10;
/// History depth of feedback.
const FEEDBACK_DEPTH: usize = 10;
/// Longest time for which shutdown waits until the results of the goals are sent.
const LAST_RESPONSES_TIMEOUT: Duration = Duration::from_millis(100);

/// Action with the execution of its goals.
pub trait GoalHandler: Send {
    /// Goal of the action.
    type Goal: Serialize + DeserializeOwned + Send + Sync + 'static;
    /// Result of the action.
    type Result: Serialize + DeserializeOwned + Clone + Default + Send + Sync + 'static;
    /// Feedback of the action.
    type Feedback: Serialize + Clone + Send + Sync + 'static;
    /// Event of a goal.
    type Event: Send;

    /// Description of the action.
    const ACTION: NodeAction;

    /// Submits a goal at `now`, ns; `active` are the ids of the other active goals. Returns its motion, or its result if
    /// it is rejected.
    fn submit(
        &mut self,
        id: GoalId,
        goal: Self::Goal,
        now: Nanoseconds,
        active: &[GoalId],
    ) -> impl Future<Output = Result<MotionId, Self::Result>> + Send;

    /// Returns the update of a goal by an event.
    fn update(&mut self, event: Self::Event) -> GoalUpdate<Self::Result>;

    /// Returns the result of a goal that ends with the node.
    fn shut_down(&self, text: &str) -> Self::Result;
}

/// Update of a goal of an action with the result `R`.
#[derive(Debug)]
pub enum GoalUpdate<R> {
    /// The simulation accepted the goal's motion.
    Started(GoalId),
    /// The goal has ended.
    Ended(GoalId, GoalState, R),
}

type Goals<H> = GoalTable<<H as GoalHandler>::Result>;
type GoalRequest<H> = SendGoalRequest<<H as GoalHandler>::Goal>;
type ResultResponse<H> = GetResultResponse<<H as GoalHandler>::Result>;

/// Services of an action.
pub struct ActionServer<H: GoalHandler> {
    send_goal: Service<GoalRequest<H>, SendGoalResponse>,
    cancel_goal: Service<CancelGoalRequest, CancelGoalResponse>,
    get_result: Service<GetResultRequest, ResultResponse<H>>,
}

/// Topics of an action with the feedback `F`.
pub struct ActionTopics<F: Serialize> {
    /// Publisher `_action/status`.
    pub status: Publisher<GoalStatusArray>,
    /// Publisher `_action/feedback`.
    pub feedback: Publisher<FeedbackMessage<F>>,
    /// Name of the action in the graph.
    pub name: String,
}

impl<H: GoalHandler> ActionServer<H> {
    /// Creates services and topics of `node`, which belongs to `context`.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create a service or topic.
    pub fn new(
        node: &mut Node,
        context: &EndpointContext,
        args: &RosArgs,
    ) -> Result<(Self, ActionTopics<H::Feedback>), ServiceError> {
        let failed = |reason: String| failure::<H>(reason);
        let name = args.resolve_service(H::ACTION.name).map_err(|e| failed(e.to_string()))?;
        let server = Self::create_services(node, context, &name)?;
        let topics = create_topics::<H>(node, context, name).map_err(failed)?;
        Ok((server, topics))
    }

    fn create_services(node: &mut Node, context: &EndpointContext, name: &str) -> Result<Self, ServiceError> {
        let send_goal = Service::for_action(
            node,
            context,
            &part_name(name, "send_goal"),
            "send_goal",
            &type_name::<H>("SendGoal"),
            SERVICE_DEPTH,
        )?;
        let cancel_goal = Service::with_name(
            node,
            context,
            &part_name(name, "cancel_goal"),
            "cancel_goal",
            &ServiceTypeName::new("action_msgs", "CancelGoal"),
            SERVICE_DEPTH,
        )?;
        let get_result = Service::for_action(
            node,
            context,
            &part_name(name, "get_result"),
            "get_result",
            &type_name::<H>("GetResult"),
            SERVICE_DEPTH,
        )?;
        Ok(ActionServer { send_goal, cancel_goal, get_result })
    }

    /// Serves until the node shuts down.
    pub async fn serve(self, channels: ActionChannels<H>) {
        let ActionServer { send_goal, cancel_goal, get_result } = &self;
        let mut requests = select_all([
            send_goal.requests_as(|id, request| Request::Goal(id, Box::new(request))),
            cancel_goal.requests_as(Request::Cancel),
            get_result.requests_as(Request::Result),
        ]);
        let ActionChannels { handler, mut events, commands, health, status, shutdown } = channels;
        let mut task = Task {
            server: &self,
            goals: GoalTable::default(),
            responses: FuturesUnordered::new(),
            handler,
            commands,
            health,
            status,
        };
        let (requested, done) = shutdown;
        let limiter = ResponseLimiter::default();
        tokio::pin!(requested);
        loop {
            tokio::select! {
                biased;
                _ = &mut requested => break,
                Some(()) = task.responses.next(), if !task.responses.is_empty() => {}
                Some(event) = events.recv() => task.handle_event(event).await,
                Some((permit, request)) = limiter.next(&mut requests) => match request {
                    Ok(request) => task.handle_request(request, permit).await,
                    Err(reason) => warn!("{reason}"),
                },
                else => break,
            }
        }
        task.abort_all().await;
        let _ = done.send(());
    }
}

/// Returns the name of a service or topic of the action `name`.
fn part_name(name: &str, part: &str) -> String {
    format!("{name}/_action/{part}")
}

/// Returns the DDS name of a type of the action.
fn type_name<H: GoalHandler>(part: &str) -> String {
    let NodeAction { package, action, .. } = H::ACTION;
    format!("{package}::action::dds_::{action}_{part}")
}

fn failure<H: GoalHandler>(reason: String) -> ServiceError {
    ServiceError { name: H::ACTION.name.to_owned(), reason }
}

fn create_topics<H: GoalHandler>(
    node: &mut Node,
    context: &EndpointContext,
    name: String,
) -> Result<ActionTopics<H::Feedback>, String> {
    let qos = |durability: Durability, depth: usize| QosProfile {
        reliability: Reliability::Reliable { when_full: WhenFull::Block },
        durability,
        history: History::KeepLast { depth },
        ..QosProfile::publisher_default()
    };
    let participant = context.domain_participant();
    let status_type = MessageTypeName::new("action_msgs", "GoalStatusArray");
    let status_qos = with_sample_limit(&qos(Durability::TransientLocal, 1), BLOCKING_WINDOW);
    let status_topic = create_topic(&participant, &part_name(&name, "status"), &status_type, &status_qos)?;
    let status = node.create_publisher(&status_topic, None).map_err(|e| e.to_string())?;
    // ros2-client cannot name the type of this topic.
    let feedback_qos = (&qos(Durability::Volatile, FEEDBACK_DEPTH)).into();
    let feedback_topic = participant
        .create_topic(
            format!("rt{}", part_name(&name, "feedback")),
            format!("{}_", type_name::<H>("FeedbackMessage")),
            &feedback_qos,
            TopicKind::NoKey,
        )
        .map_err(|e| e.to_string())?;
    let feedback = node.create_publisher(&feedback_topic, None).map_err(|e| e.to_string())?;
    let status = Publisher::unrecorded(status, status_topic, BLOCKING_WINDOW);
    let feedback = Publisher::unrecorded(feedback, feedback_topic, MAX_UNACKNOWLEDGED);
    Ok(ActionTopics { status, feedback, name })
}

/// Channels and handler of an action server's task.
pub struct ActionChannels<H: GoalHandler> {
    /// Execution of goals.
    pub handler: H,
    /// Receiver of goal events.
    pub events: mpsc::UnboundedReceiver<H::Event>,
    /// Sender of commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// State of the axes' thread, with the simulation time.
    pub health: watch::Receiver<Health>,
    /// Output `_action/status`.
    pub status: Output<GoalStatusArray>,
    /// Request and confirmation of the shutdown.
    pub shutdown: (oneshot::Receiver<()>, oneshot::Sender<()>),
}

/// Shutdown of the server's task: active goals are aborted and their results sent.
pub struct ShutdownHandle {
    request: oneshot::Sender<()>,
    done: oneshot::Receiver<()>,
}

impl ShutdownHandle {
    /// Creates a handle and the channel ends of the task.
    pub fn new() -> (Self, (oneshot::Receiver<()>, oneshot::Sender<()>)) {
        let ((request, requested), (confirm, done)) = (oneshot::channel(), oneshot::channel());
        (ShutdownHandle { request, done }, (requested, confirm))
    }

    /// Requests the shutdown and waits until the results are sent.
    pub async fn shut_down(self) {
        let _ = self.request.send(());
        let _ = self.done.await;
    }
}

enum Request<G> {
    Goal(RmwRequestId, Box<SendGoalRequest<G>>),
    Cancel(RmwRequestId, CancelGoalRequest),
    Result(RmwRequestId, GetResultRequest),
}

struct Task<'a, H: GoalHandler> {
    server: &'a ActionServer<H>,
    goals: Goals<H>,
    /// Pending responses. They are sent concurrently, so that a client that is discovered late does not delay others.
    responses: FuturesUnordered<BoxFuture<'a, ()>>,
    handler: H,
    commands: mpsc::Sender<Command>,
    health: watch::Receiver<Health>,
    status: Output<GoalStatusArray>,
}

impl<H: GoalHandler> Task<'_, H> {
    async fn handle_request(&mut self, request: Request<H::Goal>, permit: ResponsePermit) {
        match request {
            Request::Goal(request, message) => self.submit_goal(request, *message, permit).await,
            Request::Cancel(request, message) => self.cancel(request, &message, permit).await,
            Request::Result(request, message) => {
                if let ResultReply::Ready(response) =
                    self.goals.request_result(&message.goal_id.uuid, request)
                {
                    self.responses.push(self.server.get_result.respond(request, response, permit));
                }
            }
        }
    }

    async fn submit_goal(
        &mut self,
        request: RmwRequestId,
        message: SendGoalRequest<H::Goal>,
        permit: ResponsePermit,
    ) {
        let id = message.goal_id.uuid;
        let now = self.health.borrow().time;
        let accepted = !self.goals.contains(&id);
        let response = SendGoalResponse { accepted, stamp: stamp(now) };
        self.responses.push(self.server.send_goal.respond(request, response, permit));
        if !accepted {
            warn!("{} rejected: its id is in use; use a new UUID for each goal", goal_name(&id));
            return;
        }
        let active = self.goals.active_ids();
        self.goals.accept(id, now);
        match self.handler.submit(id, message.goal, now, &active).await {
            Ok(motion) => self.goals.set_motion(&id, motion),
            Err(result) => self.end(&id, GoalState::Aborted, result),
        }
        self.publish_status().await;
    }

    async fn cancel(&mut self, request: RmwRequestId, message: &CancelGoalRequest, permit: ResponsePermit) {
        let (response, motions) = self.goals.cancel(message);
        if !motions.is_empty() {
            info!("goals being canceled: {}", motions.len());
        }
        for motion in motions {
            // The end of the motion reports the outcome.
            let (done, _) = oneshot::channel();
            let _ = self.commands.send(Command::Cancel(motion, done)).await;
        }
        self.responses.push(self.server.cancel_goal.respond(request, response, permit));
        self.publish_status().await;
    }

    /// Updates a goal for an event.
    async fn handle_event(&mut self, event: H::Event) {
        match self.handler.update(event) {
            GoalUpdate::Started(id) => self.goals.start(&id),
            GoalUpdate::Ended(id, state, result) => self.end(&id, state, result),
        }
        self.publish_status().await;
    }

    /// Ends a goal and answers its waiting result requests.
    fn end(&mut self, id: &GoalId, state: GoalState, result: H::Result) {
        let (waiting, response) = self.goals.end(id, state, result, Instant::now());
        for request in waiting {
            self.responses.push(self.server.get_result.respond(request, response.clone(), None));
        }
    }

    async fn publish_status(&mut self) {
        self.status.send(self.goals.status_message()).await;
    }

    /// Aborts all active goals at shutdown and sends their results.
    async fn abort_all(&mut self) {
        let ids = self.goals.active_ids();
        if ids.is_empty() {
            return;
        }
        for id in &ids {
            self.end(id, GoalState::Aborted, self.handler.shut_down("the node is shutting down"));
        }
        let last = async {
            self.publish_status().await;
            while self.responses.next().await.is_some() {}
        };
        // Large responses are repeated for seconds; shutdown does not wait for that.
        let _ = tokio::time::timeout(LAST_RESPONSES_TIMEOUT, last).await;
    }
}
