//! Action server: its services and topics, and the task that owns the goals.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::{FuturesUnordered, select_all};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::service::RmwRequestId;
use ros2_client::{MessageTypeName, Node, ServiceTypeName};
use rustdds::TopicKind;
use tokio::sync::{mpsc, oneshot, watch};
use tracing::{info, warn};

use super::feedback::RunningGoal;
use super::goals::{GoalState, GoalTable, MAX_ACTIVE_GOALS, ResultReply};
use super::outcome;
use super::{GoalId, GoalValidator};
use crate::ingress::args::RosArgs;
use crate::interface::{FOLLOW_JOINT_TRAJECTORY, NodeAction};
use crate::ros::axes_interface::Command;
use crate::ros::endpoints::{
    BLOCKING_WINDOW, MAX_UNACKNOWLEDGED, Publisher, create_topic, with_sample_limit,
};
use crate::ros::goal_event::{GoalEvent, goal_name};
use crate::ros::health::Health;
use crate::ros::inputs::next_motion_id;
use crate::ros::outputs::Output;
use crate::ros::renewable::EndpointContext;
use crate::ros::response_limiter::{ResponseLimiter, ResponsePermit};
use crate::ros::results::{Origin, TrajectoryResults};
use crate::ros::service::{Service, ServiceError};
use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_io::messages::action_msgs::msg::GoalStatusArray;
use virtual_axes_io::messages::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use virtual_axes_io::messages::{
    FeedbackMessage, FollowJointTrajectoryResult, GetResultRequest, GetResultResponse, SendGoalRequest,
    SendGoalResponse, stamp,
};

/// Number of requests that may wait, rmw's default for services.
const SERVICE_DEPTH: usize = 10;
/// History depth of feedback.
const FEEDBACK_DEPTH: usize = 10;
/// Longest time for which shutdown waits until the results of the goals are sent.
const LAST_RESPONSES_TIMEOUT: Duration = Duration::from_millis(100);

/// Services of the action.
pub struct ActionServer {
    send_goal: Service<SendGoalRequest, SendGoalResponse>,
    cancel_goal: Service<CancelGoalRequest, CancelGoalResponse>,
    get_result: Service<GetResultRequest, GetResultResponse>,
}

/// Topics of the action.
pub struct ActionTopics {
    /// Publisher `_action/status`.
    pub status: Publisher<GoalStatusArray>,
    /// Publisher `_action/feedback`.
    pub feedback: Publisher<FeedbackMessage>,
    /// Name of the action in the graph.
    pub name: String,
}

impl ActionServer {
    /// Creates services and topics of `node`, which belongs to `context`.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create a service or topic.
    pub fn new(
        node: &mut Node,
        context: &EndpointContext,
        args: &RosArgs,
    ) -> Result<(Self, ActionTopics), ServiceError> {
        let name = args.resolve_service(FOLLOW_JOINT_TRAJECTORY.name).map_err(|e| failure(e.to_string()))?;
        let server = Self::create_services(node, context, &name)?;
        let topics = ActionTopics::new(node, context, name)?;
        Ok((server, topics))
    }

    fn create_services(node: &mut Node, context: &EndpointContext, name: &str) -> Result<Self, ServiceError> {
        let send_goal = Service::for_action(
            node,
            context,
            &part_name(name, "send_goal"),
            "send_goal",
            &type_name("SendGoal"),
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
            &type_name("GetResult"),
            SERVICE_DEPTH,
        )?;
        Ok(ActionServer { send_goal, cancel_goal, get_result })
    }

    /// Serves until the node shuts down.
    pub async fn serve(self, channels: ActionChannels) {
        let ActionServer { send_goal, cancel_goal, get_result } = &self;
        let mut requests = select_all([
            send_goal.requests_as(|id, request| Request::Goal(id, Box::new(request))),
            cancel_goal.requests_as(Request::Cancel),
            get_result.requests_as(Request::Result),
        ]);
        let ActionChannels { context, mut events, running, status, shutdown } = channels;
        let mut task = Task {
            server: &self,
            goals: GoalTable::default(),
            responses: FuturesUnordered::new(),
            running: Vec::new(),
            context,
            running_out: running,
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
fn type_name(part: &str) -> String {
    let NodeAction { package, action, .. } = FOLLOW_JOINT_TRAJECTORY;
    format!("{package}::action::dds_::{action}_{part}")
}

fn failure(reason: String) -> ServiceError {
    ServiceError { name: FOLLOW_JOINT_TRAJECTORY.name.to_owned(), reason }
}

impl ActionTopics {
    fn new(node: &mut Node, context: &EndpointContext, name: String) -> Result<Self, ServiceError> {
        let qos = |durability: Durability, depth: usize| QosProfile {
            reliability: Reliability::Reliable { when_full: WhenFull::Block },
            durability,
            history: History::KeepLast { depth },
            ..QosProfile::publisher_default()
        };
        let participant = context.domain_participant();
        let status_type = MessageTypeName::new("action_msgs", "GoalStatusArray");
        let status_qos = with_sample_limit(&qos(Durability::TransientLocal, 1), BLOCKING_WINDOW);
        let status_topic = create_topic(&participant, &part_name(&name, "status"), &status_type, &status_qos)
            .map_err(failure)?;
        let status = node.create_publisher(&status_topic, None).map_err(|e| failure(e.to_string()))?;
        // ros2-client cannot name the type of this topic.
        let feedback_qos = (&qos(Durability::Volatile, FEEDBACK_DEPTH)).into();
        let feedback_topic = participant
            .create_topic(
                format!("rt{}", part_name(&name, "feedback")),
                format!("{}_", type_name("FeedbackMessage")),
                &feedback_qos,
                TopicKind::NoKey,
            )
            .map_err(|e| failure(e.to_string()))?;
        let feedback = node.create_publisher(&feedback_topic, None).map_err(|e| failure(e.to_string()))?;
        let status = Publisher::unrecorded(status, status_topic, BLOCKING_WINDOW);
        let feedback = Publisher::unrecorded(feedback, feedback_topic, MAX_UNACKNOWLEDGED);
        Ok(ActionTopics { status, feedback, name })
    }
}

/// Channels and context of the server's task.
pub struct ActionChannels {
    /// Validation of goals and access to the simulation.
    pub context: ServerContext,
    /// Receiver of goal events.
    pub events: mpsc::UnboundedReceiver<GoalEvent>,
    /// Sender of the goals that have feedback, including some that have ended.
    pub running: watch::Sender<Arc<[RunningGoal]>>,
    /// Output `_action/status`.
    pub status: Output<GoalStatusArray>,
    /// Request and confirmation of the shutdown.
    pub shutdown: (oneshot::Receiver<()>, oneshot::Sender<()>),
}

/// Validation of goals and access to the simulation.
pub struct ServerContext {
    /// Validator of goals, independent of the state of the axes.
    pub validator: GoalValidator,
    /// Sender of commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// Results of the trajectories.
    pub results: Arc<TrajectoryResults>,
    /// State of the axes' thread, with the simulation time.
    pub health: watch::Receiver<Health>,
    /// Counter of motion ids.
    pub ids: Arc<AtomicU64>,
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

enum Request {
    Goal(RmwRequestId, Box<SendGoalRequest>),
    Cancel(RmwRequestId, CancelGoalRequest),
    Result(RmwRequestId, GetResultRequest),
}

struct Task<'a> {
    server: &'a ActionServer,
    goals: GoalTable,
    /// Pending responses. They are sent concurrently, so that a client that is discovered late does not delay others.
    responses: FuturesUnordered<BoxFuture<'a, ()>>,
    running: Vec<RunningGoal>,
    context: ServerContext,
    running_out: watch::Sender<Arc<[RunningGoal]>>,
    status: Output<GoalStatusArray>,
}

impl Task<'_> {
    async fn handle_request(&mut self, request: Request, permit: ResponsePermit) {
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

    async fn submit_goal(&mut self, request: RmwRequestId, message: SendGoalRequest, permit: ResponsePermit) {
        let id = message.goal_id.uuid;
        let now = self.context.health.borrow().time;
        let accepted = !self.goals.contains(&id);
        let response = SendGoalResponse { accepted, stamp: stamp(now) };
        self.responses.push(self.server.send_goal.respond(request, response, permit));
        if !accepted {
            warn!("{} rejected: its id is in use; use a new UUID for each goal", goal_name(&id));
            return;
        }
        let origin = Origin::Action { stamp: message.goal.trajectory.header.stamp.clone(), goal_id: id };
        let active = self.goals.active_count();
        self.goals.accept(id, now);
        let validated = if active < MAX_ACTIVE_GOALS {
            // Validation of a large trajectory takes long; other tasks continue meanwhile.
            tokio::task::block_in_place(|| self.context.validator.validate(&message.goal)).and_then(
                |(trajectory, tolerances)| Ok((self.context.results.admit(trajectory)?, tolerances)),
            )
        } else {
            let text = format!("{active} goals are active; at most {MAX_ACTIVE_GOALS} are allowed");
            Err(Rejection::new(RejectionCode::TooManyGoals, text)
                .numbers(active as f64, MAX_ACTIVE_GOALS as f64))
        };
        drop(message);
        match validated {
            Ok((trajectory, tolerances)) => {
                let motion = next_motion_id(&self.context.ids);
                self.goals.set_motion(&id, motion);
                // The goal is listed before it is submitted and until after its end, so that its first and last
                // frames find it. Each frame contains the motions that it belongs to.
                let active = self.goals.active_ids();
                self.running.retain(|running| active.contains(&running.id));
                self.running.push(RunningGoal { id, motion, indices: trajectory.joints().to_vec() });
                self.send_running();
                self.context.results.register(motion, origin, Arc::clone(&trajectory)).await;
                let submit =
                    Command::Submit { id: motion, trajectory, tolerances: Some(Box::new(tolerances)) };
                // The channel is closed only at shutdown.
                let _ = self.context.commands.send(submit).await;
            }
            Err(rejection) => {
                self.context.results.publish_rejection(&origin, now, &rejection).await;
                self.end(&id, GoalState::Aborted, outcome::rejected(&rejection));
            }
        }
        self.publish_status().await;
    }

    async fn cancel(&mut self, request: RmwRequestId, message: &CancelGoalRequest, permit: ResponsePermit) {
        let (response, motions) = self.goals.cancel(message);
        if !motions.is_empty() {
            info!("canceling {} goals", motions.len());
        }
        for motion in motions {
            // The end of the motion reports the outcome.
            let (done, _) = oneshot::channel();
            let _ = self.context.commands.send(Command::Cancel(motion, done)).await;
        }
        self.responses.push(self.server.cancel_goal.respond(request, response, permit));
        self.publish_status().await;
    }

    /// Updates a goal for an event.
    async fn handle_event(&mut self, event: GoalEvent) {
        match event {
            GoalEvent::Started(id) => self.goals.start(&id),
            GoalEvent::Rejected(id, rejection) => {
                self.end(&id, GoalState::Aborted, outcome::rejected(&rejection));
            }
            GoalEvent::Ended(id, outcome, text) => {
                let (state, result) = outcome::ended(&outcome, text);
                self.end(&id, state, result);
            }
        }
        self.publish_status().await;
    }

    /// Ends a goal and answers its waiting result requests.
    fn end(&mut self, id: &GoalId, state: GoalState, result: FollowJointTrajectoryResult) {
        let (waiting, response) = self.goals.end(id, state, result, Instant::now());
        for request in waiting {
            self.responses.push(self.server.get_result.respond(request, response.clone(), None));
        }
    }

    fn send_running(&self) {
        // The receiver is dropped only at shutdown.
        let _ = self.running_out.send(self.running.as_slice().into());
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
            self.end(id, GoalState::Aborted, outcome::aborted("the node is shutting down".to_owned()));
        }
        let last = async {
            self.publish_status().await;
            while self.responses.next().await.is_some() {}
        };
        // Large responses are repeated for seconds; shutdown does not wait for that.
        let _ = tokio::time::timeout(LAST_RESPONSES_TIMEOUT, last).await;
    }
}
