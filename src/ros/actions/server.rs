//! Server of an action: its services and topics, and the task that owns the goals.

use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::future::BoxFuture;
use futures::stream::{FuturesUnordered, select_all};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::sync::{mpsc, oneshot, watch};
use tracing::{info, warn};

use super::goals::{GoalState, GoalTable, ResultReply};
use crate::ros::axes::{Command, Health, ProgramRunFigures};
use crate::ros::results::{GoalEvent, goal_name};
use crate::ros::services::ServiceError;
use crate::ros::topics::{Output, OverflowPolicy, TopicFactory};
use crate::ros_interface::NodeAction;
use crate::validation::GoalId;
use crate::validation::args::{NameKind, RosArgs};
use virtual_axes_core::config::QosConfig;
use virtual_axes_core::simulation::MotionEnd;
use virtual_axes_core::trajectory::{MotionId, Rejection};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_dds::{RequestId, ResponseLimiter, ResponsePermit, Service};
use virtual_axes_io::messages::action_msgs::msg::GoalStatusArray;
use virtual_axes_io::messages::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use virtual_axes_io::messages::{
    FeedbackMessage, GetResultRequest, GetResultResponse, SendGoalRequest, SendGoalResponse, stamp,
};

/// Number of requests that may wait, rmw's default for services.
const SERVICE_DEPTH: usize = 10;
/// QoS of the feedback.
const FEEDBACK_QOS: QosConfig = QosConfig { is_reliable: true, is_transient_local: false, depth: 10 };
/// QoS of the status of the goals.
const STATUS_QOS: QosConfig = QosConfig { is_reliable: true, is_transient_local: true, depth: 1 };
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

    /// Returns the result of a goal whose motion the simulation has rejected.
    fn rejected(&mut self, id: &GoalId, rejection: &Rejection) -> Self::Result;

    /// Returns the final state and the result of a goal whose motion has ended; `text` describes the outcome.
    fn ended(
        &mut self,
        id: &GoalId,
        end: MotionEnd,
        figures: ProgramRunFigures,
        text: String,
    ) -> (GoalState, Self::Result);

    /// Returns the result of a goal that ends with the node.
    fn shut_down(&self, text: &str) -> Self::Result;
}

type Goals<H> = GoalTable<<H as GoalHandler>::Result>;
type GoalRequest<H> = SendGoalRequest<<H as GoalHandler>::Goal>;
type ResultResponse<H> = GetResultResponse<<H as GoalHandler>::Result>;
type Feedback<H> = FeedbackMessage<<H as GoalHandler>::Feedback>;

/// Services of an action, and the output of the status of its goals.
pub struct ActionServer<H: GoalHandler> {
    send_goal: Service<GoalRequest<H>, SendGoalResponse>,
    cancel_goal: Service<CancelGoalRequest, CancelGoalResponse>,
    get_result: Service<GetResultRequest, ResultResponse<H>>,
    status: Output<GoalStatusArray>,
}

impl<H: GoalHandler> ActionServer<H> {
    /// Creates services and topics; the output of the feedback has the policy `overflow`, that of the status
    /// `result_overflow`. Returns the server and the output of the feedback.
    ///
    /// # Errors
    /// [`ServiceError`] if the name cannot be resolved or the middleware cannot create a service or topic.
    pub fn new(
        topics: &mut TopicFactory<'_>,
        args: &RosArgs,
        overflow: OverflowPolicy,
        result_overflow: OverflowPolicy,
    ) -> Result<(Self, Output<Feedback<H>>), ServiceError> {
        let failed = |reason: String| ServiceError { name: H::ACTION.name.to_owned(), reason };
        let part = |kind, part| {
            args.resolve_action_part(kind, H::ACTION.name, part).map_err(|e| failed(e.to_string()))
        };
        let service = |name| part(NameKind::Service, name);
        let topic = |name| part(NameKind::Topic, name);
        let own_type = |part: &str| format!("{}_{part}", H::ACTION.type_name());
        let of_service = |label: &str, reason: String| ServiceError { name: label.to_owned(), reason };
        let node = topics.node;
        let server = ActionServer {
            send_goal: node
                .create_service_of_long_requests(&service("send_goal")?, &own_type("SendGoal"), SERVICE_DEPTH)
                .map_err(|reason| of_service("send_goal", reason))?,
            cancel_goal: node
                .create_service(&service("cancel_goal")?, "action_msgs/srv/CancelGoal", SERVICE_DEPTH)
                .map_err(|reason| of_service("cancel_goal", reason))?,
            get_result: node
                .create_service(&service("get_result")?, &own_type("GetResult"), SERVICE_DEPTH)
                .map_err(|reason| of_service("get_result", reason))?,
            status: topics
                .action_output(
                    &topic("status")?,
                    "action_msgs/msg/GoalStatusArray",
                    STATUS_QOS,
                    result_overflow,
                )
                .map_err(failed)?,
        };
        let (topic, type_name) = (topic("feedback")?, own_type("FeedbackMessage"));
        let feedback = topics.action_output(&topic, &type_name, FEEDBACK_QOS, overflow).map_err(failed)?;
        Ok((server, feedback))
    }

    /// Serves until the node shuts down.
    pub async fn serve(self, channels: ActionChannels<H>) {
        let ActionServer { send_goal, cancel_goal, get_result, .. } = &self;
        let mut requests = select_all([
            send_goal.requests_as(|id, request| Request::Goal(id, Box::new(request))),
            cancel_goal.requests_as(Request::Cancel),
            get_result.requests_as(Request::Result),
        ]);
        let ActionChannels { handler, mut events, commands, health, shutdown } = channels;
        let mut task = Task {
            server: &self,
            goals: GoalTable::default(),
            responses: FuturesUnordered::new(),
            handler,
            commands,
            health,
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

/// Channels and handler of an action server's task.
pub struct ActionChannels<H: GoalHandler> {
    /// Execution of goals.
    pub handler: H,
    /// Receiver of goal events.
    pub events: mpsc::UnboundedReceiver<(GoalId, GoalEvent)>,
    /// Sender of commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// State of the axes' thread, with the simulation time.
    pub health: watch::Receiver<Health>,
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
    Goal(RequestId, Box<SendGoalRequest<G>>),
    Cancel(RequestId, CancelGoalRequest),
    Result(RequestId, GetResultRequest),
}

struct Task<'a, H: GoalHandler> {
    server: &'a ActionServer<H>,
    goals: Goals<H>,
    /// Pending responses. They are sent concurrently, so that a client that is discovered late does not delay others.
    responses: FuturesUnordered<BoxFuture<'a, ()>>,
    handler: H,
    commands: mpsc::Sender<Command>,
    health: watch::Receiver<Health>,
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
        request: RequestId,
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

    async fn cancel(&mut self, request: RequestId, message: &CancelGoalRequest, permit: ResponsePermit) {
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
    async fn handle_event(&mut self, (id, event): (GoalId, GoalEvent)) {
        match event {
            GoalEvent::Started => self.goals.start(&id),
            GoalEvent::Rejected(rejection) => {
                let result = self.handler.rejected(&id, &rejection);
                self.end(&id, GoalState::Aborted, result);
            }
            GoalEvent::Ended(end, figures, text) => {
                let (state, result) = self.handler.ended(&id, *end, figures, text);
                self.end(&id, state, result);
            }
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
        self.server.status.send(self.goals.status_message()).await;
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
