//! The action's services and topics, and the task that serves them: it alone knows the goals.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::{FuturesUnordered, select_all};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::service::RmwRequestId;
use ros2_client::{Context, MessageTypeName, Node, ServiceTypeName};
use rustdds::TopicKind;
use tokio::sync::{mpsc, oneshot, watch};
use tracing::{info, warn};

use super::feedback::Running;
use super::goals::{Answer, Goals, MOST_LIVE, State};
use super::outcome::{self, GoalEvent};
use super::{GoalId, GoalValidator, goal_name};
use crate::ingress::args::RosArgs;
use crate::ros::endpoints::{
    BLOCKING_WINDOW, MAX_UNACKNOWLEDGED, Publisher, create_topic, with_sample_limit,
};
use crate::ros::inputs::next_id;
use crate::ros::outputs::Output;
use crate::ros::pace::{Command, Health};
use crate::ros::response_limiter::{ResponseLimiter, ResponsePermit};
use crate::ros::results::{Origin, Results};
use crate::ros::service::{Service, ServiceError};
use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_io::messages::action_msgs::msg::GoalStatusArray;
use virtual_axes_io::messages::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use virtual_axes_io::messages::{
    CONTROL_PACKAGE, FeedbackMessage, FollowJointTrajectoryResult, GetResultRequest, GetResultResponse,
    SendGoalRequest, SendGoalResponse, stamp,
};

/// The action's own name.
const ACTION: &str = "~/follow_joint_trajectory";
/// Its type.
const TYPE: &str = "FollowJointTrajectory";
/// Requests that may wait, rmw's default for services.
const SERVICE_DEPTH: usize = 10;
/// Feedback messages that a slow reader may be behind.
const FEEDBACK_DEPTH: usize = 10;
/// How long a node that shuts down waits for the results of its goals to be sent.
const LAST_RESPONSES: Duration = Duration::from_millis(100);

/// The endpoints of the action.
pub struct ActionServer {
    send_goal: Service<SendGoalRequest, SendGoalResponse>,
    cancel_goal: Service<CancelGoalRequest, CancelGoalResponse>,
    get_result: Service<GetResultRequest, GetResultResponse>,
}

/// The topics of the action.
pub struct ActionTopics {
    /// `_action/status`.
    pub status: Publisher<GoalStatusArray>,
    /// `_action/feedback`.
    pub feedback: Publisher<FeedbackMessage>,
    /// Name of the action in the graph.
    pub name: String,
}

impl ActionServer {
    /// Creates services and topics; `context` is the one that `node` lives in.
    ///
    /// # Errors
    /// [`ServiceError`] for the first that the middleware refuses.
    pub fn new(
        node: &mut Node,
        context: &Context,
        args: &RosArgs,
    ) -> Result<(Self, ActionTopics), ServiceError> {
        let failed = |reason: String| ServiceError { name: ACTION.to_owned(), reason };
        let name = args.resolve_service(ACTION).map_err(|e| failed(e.to_string()))?;
        let part = |part: &str| format!("{name}/_action/{part}");
        let kind = |part: &str| format!("{CONTROL_PACKAGE}::action::dds_::{TYPE}_{part}");
        let cancel_type = ServiceTypeName::new("action_msgs", "CancelGoal");
        let server = ActionServer {
            send_goal: Service::for_action(
                node,
                context,
                &part("send_goal"),
                "send_goal",
                &kind("SendGoal"),
                SERVICE_DEPTH,
            )?,
            cancel_goal: Service::with_name(
                node,
                context,
                &part("cancel_goal"),
                "cancel_goal",
                &cancel_type,
                SERVICE_DEPTH,
            )?,
            get_result: Service::for_action(
                node,
                context,
                &part("get_result"),
                "get_result",
                &kind("GetResult"),
                SERVICE_DEPTH,
            )?,
        };
        let qos = |durability: Durability, depth: usize| QosProfile {
            reliability: Reliability::Reliable { when_full: WhenFull::Block },
            durability,
            history: History::KeepLast { depth },
            ..QosProfile::publisher_default()
        };
        let status_type = MessageTypeName::new("action_msgs", "GoalStatusArray");
        let status_qos = with_sample_limit(&qos(Durability::TransientLocal, 1), BLOCKING_WINDOW);
        let status_topic =
            create_topic(&context.domain_participant(), &part("status"), &status_type, &status_qos)
                .map_err(failed)?;
        let status = node.create_publisher(&status_topic, None).map_err(|e| failed(e.to_string()))?;
        // A topic of a type that the crate cannot name.
        let feedback_qos = (&qos(Durability::Volatile, FEEDBACK_DEPTH)).into();
        let feedback_topic = context
            .domain_participant()
            .create_topic(
                format!("rt{}", part("feedback")),
                format!("{}_", kind("FeedbackMessage")),
                &feedback_qos,
                TopicKind::NoKey,
            )
            .map_err(|e| failed(e.to_string()))?;
        let feedback = node.create_publisher(&feedback_topic, None).map_err(|e| failed(e.to_string()))?;
        let status = Publisher::unrecorded(status, status_topic, BLOCKING_WINDOW);
        let feedback = Publisher::unrecorded(feedback, feedback_topic, MAX_UNACKNOWLEDGED);
        Ok((server, ActionTopics { status, feedback, name }))
    }

    /// Serves until the node shuts down.
    pub async fn serve(self, work: Work) {
        let ActionServer { send_goal, cancel_goal, get_result } = &self;
        let mut requests = select_all([
            send_goal.requests_as(|id, request| Request::Goal(id, Box::new(request))),
            cancel_goal.requests_as(Request::Cancel),
            get_result.requests_as(Request::Result),
        ]);
        let Work { mut events, end, .. } = work;
        let mut task = Task {
            server: &self,
            goals: Goals::default(),
            responses: FuturesUnordered::new(),
            running: Vec::new(),
            server_context: work.server_context,
            running_out: work.running,
            status: work.status,
        };
        let (asked, done) = end;
        let limiter = ResponseLimiter::default();
        tokio::pin!(asked);
        loop {
            tokio::select! {
                biased;
                _ = &mut asked => break,
                Some(()) = task.responses.next(), if !task.responses.is_empty() => {}
                Some(event) = events.recv() => task.note(event).await,
                Some((permit, request)) = limiter.next(&mut requests) => match request {
                    Ok(request) => task.answer(request, permit).await,
                    Err(reason) => warn!("{reason}"),
                },
                else => break,
            }
        }
        task.abort_all().await;
        let _ = done.send(());
    }
}

/// What the task works with.
pub struct Work {
    /// Whom it asks and tells.
    pub server_context: ServerContext,
    /// What becomes of goals.
    pub events: mpsc::UnboundedReceiver<GoalEvent>,
    /// The goals that have feedback, some of them over already.
    pub running: watch::Sender<Arc<[Running]>>,
    /// `_action/status`.
    pub status: Output<GoalStatusArray>,
    /// Ends it, and says so.
    pub end: (oneshot::Receiver<()>, oneshot::Sender<()>),
}

/// Handles through which the action task reaches the rest of the node.
pub struct ServerContext {
    /// Validation that needs no state of the axes.
    pub checks: GoalValidator,
    /// Commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// Results of trajectories.
    pub results: Arc<Results>,
    /// Simulation time and health.
    pub health: watch::Receiver<Health>,
    /// Counter of motion ids.
    pub ids: Arc<AtomicU64>,
}

/// Handle that shuts the action task down: active goals are aborted and their clients get a result.
pub struct ShutdownHandle {
    request: oneshot::Sender<()>,
    done: oneshot::Receiver<()>,
}

impl ShutdownHandle {
    /// Creates the handle and the channel ends of the task: shutdown request and completion.
    pub fn pair() -> (Self, (oneshot::Receiver<()>, oneshot::Sender<()>)) {
        let ((request, requested), (completed, done)) = (oneshot::channel(), oneshot::channel());
        (ShutdownHandle { request, done }, (requested, completed))
    }

    /// Requests the shutdown and waits until the results have been sent.
    pub async fn end(self) {
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
    goals: Goals,
    /// Responses are sent side by side: a client that is slow to be discovered holds up no other.
    responses: FuturesUnordered<BoxFuture<'a, ()>>,
    running: Vec<Running>,
    server_context: ServerContext,
    running_out: watch::Sender<Arc<[Running]>>,
    status: Output<GoalStatusArray>,
}

impl Task<'_> {
    async fn answer(&mut self, request: Request, permit: ResponsePermit) {
        match request {
            Request::Goal(request, message) => self.take_goal(request, *message, permit).await,
            Request::Cancel(request, message) => self.cancel(request, &message, permit).await,
            Request::Result(request, message) => {
                if let Answer::Now(response) = self.goals.result(&message.goal_id.uuid, request) {
                    self.responses.push(self.server.get_result.respond(request, response, permit));
                }
            }
        }
    }

    async fn take_goal(&mut self, request: RmwRequestId, message: SendGoalRequest, permit: ResponsePermit) {
        let id = message.goal_id.uuid;
        let now = self.server_context.health.borrow().time;
        let accepted = !self.goals.knows(&id);
        let response = SendGoalResponse { accepted, stamp: stamp(now) };
        self.responses.push(self.server.send_goal.respond(request, response, permit));
        if !accepted {
            warn!("{} refused: its id is in use", goal_name(&id));
            return;
        }
        let origin = Origin::Action { stamp: message.goal.trajectory.header.stamp.clone(), goal_id: id };
        let live = self.goals.live();
        self.goals.accept(id, now);
        let checked = if live < MOST_LIVE {
            // A large trajectory takes a while to check; other tasks go on meanwhile.
            tokio::task::block_in_place(|| self.server_context.checks.validate(&message.goal))
                .and_then(|(trajectory, tolerances)| Ok((self.server_context.results.hold(trajectory)?, tolerances)))
        } else {
            let text = format!("{live} goals are under way; at most {MOST_LIVE} are taken");
            Err(Rejection::new(RejectionCode::TooManyGoals, text).numbers(live as f64, MOST_LIVE as f64))
        };
        drop(message);
        match checked {
            Ok((trajectory, tolerances)) => {
                let motion = next_id(&self.server_context.ids);
                self.goals.offered(&id, motion);
                // Before the simulation is asked, and longer than the goal lasts: its first samples and its
                // last ones find it here. Frames say themselves which motions they belong to.
                let live = self.goals.live_ids();
                self.running.retain(|running| live.contains(&running.id));
                self.running.push(Running { id, motion, places: trajectory.joints().to_vec() });
                self.show_running();
                self.server_context.results.remember(motion, origin, Arc::clone(&trajectory)).await;
                let offer = Command::Offer { id: motion, trajectory, tolerances: Some(Box::new(tolerances)) };
                // The simulation is gone only when the node shuts down.
                let _ = self.server_context.commands.send(offer).await;
            }
            Err(rejection) => {
                self.server_context.results.rejected(&origin, now, &rejection).await;
                self.end(&id, State::Aborted, outcome::refused(&rejection));
            }
        }
        self.publish_status().await;
    }

    async fn cancel(&mut self, request: RmwRequestId, message: &CancelGoalRequest, permit: ResponsePermit) {
        let (response, motions) = self.goals.cancel(message);
        if !motions.is_empty() {
            info!("goals to be canceled: {}", motions.len());
        }
        for motion in motions {
            // What came of it is told by the motion's end.
            let (done, _) = oneshot::channel();
            let _ = self.server_context.commands.send(Command::Cancel(motion, done)).await;
        }
        self.responses.push(self.server.cancel_goal.respond(request, response, permit));
        self.publish_status().await;
    }

    /// Follows what becomes of goals.
    async fn note(&mut self, event: GoalEvent) {
        match event {
            GoalEvent::Started(id) => self.goals.started(&id),
            GoalEvent::Refused(id, rejection) => {
                self.end(&id, State::Aborted, outcome::refused(&rejection));
            }
            GoalEvent::Ended(id, how, text) => {
                let (state, result) = outcome::ended(&how, text);
                self.end(&id, state, result);
            }
        }
        self.publish_status().await;
    }

    /// Ends a goal and answers those who wait for its result.
    fn end(&mut self, id: &GoalId, state: State, result: FollowJointTrajectoryResult) {
        let (waiting, response) = self.goals.end(id, state, result, Instant::now());
        for request in waiting {
            self.responses.push(self.server.get_result.respond(request, response.clone(), None));
        }
    }

    fn show_running(&self) {
        // Without a reader the node is shutting down.
        let _ = self.running_out.send(self.running.as_slice().into());
    }

    async fn publish_status(&mut self) {
        self.status.send(self.goals.statuses()).await;
    }

    /// Aborts what is under way because the node shuts down.
    async fn abort_all(&mut self) {
        let ids = self.goals.live_ids();
        if ids.is_empty() {
            return;
        }
        for id in &ids {
            self.end(id, State::Aborted, outcome::aborted("the node is shutting down".to_owned()));
        }
        let last = async {
            self.publish_status().await;
            while self.responses.next().await.is_some() {}
        };
        // Large responses are given again for seconds, which is not waited for.
        let _ = tokio::time::timeout(LAST_RESPONSES, last).await;
    }
}
