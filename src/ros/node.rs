//! The node: parameters in, endpoints made, the simulation started, and everything ended in order.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::thread;
use std::time::Duration;

use futures::future::{join, pending};
use futures::stream::FuturesUnordered;
use futures::{FutureExt, StreamExt};
use ros2_client::{NodeName, NodeOptions};
use tokio::runtime::Handle;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinSet;
use tracing::{info, warn};

use super::action::{
    ActionServer, Feedback, GoalValidator, ServerContext, ShutdownHandle, Work, feedback_period,
};
use super::args::RosArgs;
use super::clock::{ClockInput, ClockOutput, ClockState};
use super::convert;
use super::diagnostics::Diagnostics;
use super::duplicate_node_name;
use super::endpoints::{EndpointError, Endpoints};
use super::environment::Environment;
use super::fan_out::{FanOut, publish_diagnostics};
use super::inputs::{PsecInput, TrajectoryValidator, next_id, take_loads, take_stream};
use super::log::LogRecord;
use super::matched_subscriptions::{self, MatchedSubscriptionTracker};
use super::outputs::{OutputFactory, OverflowPolicy, queue_length};
use super::pace::{self, Channels, Command, CooperativeTasks, Health, Pace};
use super::parameter_host::{Host, LiveNodeParameters};
use super::parameter_services::{self, ParameterServices};
use super::participant::{Participant, ParticipantError};
use super::recorder::{RecordError, TopicRecorder};
use super::remote_endpoints::DiscoveredEndpoints;
use super::results::Results;
use super::rosout;
use super::security::Security;
use super::service::{self, ServiceError, ServiceNameConflict};
use super::tool::ToolTopics;
use super::topics::Topics;
use super::trigger::{RESET, STOP, Trigger};
use super::writer_rotation::{RotatedTopics, RotationContext};
use virtual_axes_core::config::{ConfigError, Parameters, TimeMode};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::simulation::{self, Simulation, SimulationError};
use virtual_axes_core::trajectory::{
    JointLimits, MotionId, Start, Trajectory, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// How long the end of the simulation's thread is waited for.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(300);

/// Why the node cannot run.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The parameters make no machine.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The machine cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The network cannot be joined.
    #[error(transparent)]
    Participant(#[from] ParticipantError),
    /// The node is refused by the middleware.
    #[error("the node {name} cannot be created: {reason}")]
    Node {
        /// Its fully qualified name.
        name: String,
        /// The middleware's own words.
        reason: String,
    },
    /// A topic is refused.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// A service is refused.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// Two services have one name.
    #[error(transparent)]
    ServiceNameConflict(#[from] ServiceNameConflict),
    /// The operating system gives no thread, timer or signal handler.
    #[error("cannot {what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
    /// There is nothing to record to.
    #[error(transparent)]
    Record(#[from] RecordError),
}

impl NodeError {
    /// Whether what the user asked for is wrong, not what the system or the middleware makes of it.
    #[must_use]
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Record(_)
                | Self::Endpoint(EndpointError::TopicTypeConflict { .. })
                | Self::ServiceNameConflict(_)
        )
    }
}

/// Runs the node until SIGINT, SIGTERM or SIGHUP; what comes through `log` goes to `/rosout`.
///
/// # Errors
/// [`NodeError`] if it cannot start; nothing is left on the network then.
pub fn run(
    args: &RosArgs,
    environment: &Environment,
    security: &Security,
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    // A second worker would be woken with the first each time, and find nothing to do.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(|source| NodeError::System { what: "start the runtime", source })?;
    let participant = Participant::open_with(environment, security)?;
    let result = runtime.block_on(serve(args, &participant, parameters, log));
    // Tasks and endpoints are gone; what is left of the runtime is not waited for.
    runtime.shutdown_timeout(Duration::from_millis(50));
    participant.shutdown();
    result
}

async fn serve(
    args: &RosArgs,
    participant: &Participant,
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    service::check_names(args, parameter_services::LABELS.into_iter().chain([RESET, STOP]))?;
    let signals = Signals::new()?;
    let config = parameters.machine_config()?;
    let node_config = parameters.node_config();
    let mode = node_config.time;
    let joint_limits = simulation::joint_limits(&config, &node_config.joint_prefix);
    let joints: Vec<String> = joint_limits.iter().map(|j| j.name.clone()).collect();
    let period = config.periods().position;
    let (overflow, of_results) = match mode {
        TimeMode::Real => (OverflowPolicy::Drop, OverflowPolicy::BlockWithTimeout),
        TimeMode::Fast | TimeMode::SimTime => (OverflowPolicy::Block, OverflowPolicy::Block),
    };
    let (health_out, health) = watch::channel(Health::default());
    let mut recorder = TopicRecorder::open(&node_config, overflow, &health)?;

    let context = participant.context()?;
    let dds = context.domain_participant();
    let node_error = |reason: String| NodeError::Node { name: args.node().to_string(), reason };
    let name = NodeName::new(args.node().namespace(), args.node().name())
        .map_err(|e| node_error(format!("{e:?}")))?;
    let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
    let mut node = context.new_node(name, options).map_err(|e| node_error(e.to_string()))?;

    let rosout_publisher = rosout::publisher(&mut node, &dds, args, &mut recorder)?;
    let mut endpoints = Endpoints::new(&mut node, &dds, args, &parameters, &mut recorder);
    let mut topics = Topics::create(&mut endpoints, args, mode)?;
    let tool = ToolTopics::create(&mut endpoints, Kinematics::new(&config))?;
    topics.names.add_published(tool.as_ref().map_or(&[], |tool| &tool.names));
    let (action, action_topics) = ActionServer::new(&mut node, &context, args)?;
    topics.names.actions.push(action_topics.name);
    let reset = Trigger::new(&mut node, &context, args, RESET)?;
    let stop = Trigger::new(&mut node, &context, args, STOP)?;
    let parameter_services = ParameterServices::new(&mut node, &context, args)?;

    let simulation = Simulation::new(&config, joint_limits.clone(), pace::origin(mode, period))?;
    let (commands, commands_in) = mpsc::channel(pace::COMMAND_QUEUE);
    let (frames_out, frames) = mpsc::channel(queue_length(overflow));
    let (reports_out, mut reports) = mpsc::unbounded_channel();
    let channels =
        Channels { commands: commands_in, frames: frames_out, reports: reports_out, health: health_out };

    let (clock_out, clock) = watch::channel(ClockState::new(mode == TimeMode::Fast));

    let mut tasks = JoinSet::new();
    let dropped = Arc::new(AtomicU64::new(0));
    let live = Arc::new(LiveNodeParameters::default());
    let ids = Arc::new(AtomicU64::new(1));

    // What goes out.
    let mut tracker = MatchedSubscriptionTracker::default();
    let mut rotated = RotatedTopics::default();
    let mut publishing = OutputFactory {
        participant: &dds,
        dropped: &dropped,
        tracker: &mut tracker,
        tasks: &mut tasks,
        rotated: &mut rotated,
    };
    let (goal_events, events) = mpsc::unbounded_channel();
    let results_output = publishing.start(topics.results, of_results);
    let results =
        Arc::new(Results::new(results_output, joint_limits.clone(), goal_events, node_config.max_points));
    let diagnostics = publishing.start(topics.diagnostics, OverflowPolicy::Drop);
    let every = node_config.publish_rate.map_or(1, |rate| (1.0 / (rate * seconds(period))).round() as i64);
    let (running, running_goals) = watch::channel(Arc::from([]));
    let status = publishing.start(action_topics.status, of_results);
    let outputs = FanOut {
        joint_states: publishing.start(topics.joint_states, overflow),
        motor_currents: publishing.start(topics.motor_currents, overflow),
        drive_states: publishing.start(topics.drive_states, overflow),
        controller_state: publishing.start(topics.controller_state, overflow),
        feedback: Feedback {
            goals: running_goals,
            output: publishing.start(action_topics.feedback, overflow),
            joints: joints.clone(),
            every: feedback_period(node_config.action_monitor_rate, period),
        },
        tool: tool.map(|tool| tool.start(&mut publishing, node_config.tool.clone(), overflow)),
        clock: topics.clock.map(|publisher| ClockOutput {
            output: publishing.start(publisher, overflow),
            state: clock.clone(),
        }),
        joints: joints.clone(),
        every: every.max(1),
    };

    if let Some(publisher) = rosout_publisher {
        tasks.spawn(rosout::publish(publisher, log));
    }
    tasks.spawn(duplicate_node_name::watch(dds.clone(), args.node().clone()));
    let recording = recorder.start()?;

    // What comes in.
    let discovered = DiscoveredEndpoints::default();
    tasks.spawn(matched_subscriptions::run(dds.clone(), tracker, discovered.clone()));
    let owner = RotationContext { node, context: context.clone(), range: participant.range() };
    tasks.spawn(rotated.run(owner));
    if let Some((subscription, name)) = topics.clock_input {
        let (participant, health) = (dds.clone(), health.clone());
        let input = ClockInput { subscription, name, participant, period, health, state: clock_out };
        tasks.spawn(input.run(mode == TimeMode::Fast));
    }
    let stop_all = stop_request(&joint_limits, period, node_config.max_points);
    let checks = Arc::new(TrajectoryValidator {
        joints: joint_limits,
        period,
        max_points: node_config.max_points,
        live: Arc::clone(&live),
    });
    let (action_end, end) = ShutdownHandle::pair();
    let server_context = ServerContext {
        checks: GoalValidator { trajectories: Arc::clone(&checks) },
        commands: commands.clone(),
        results: Arc::clone(&results),
        health: health.clone(),
        ids: Arc::clone(&ids),
    };
    tasks.spawn(action.serve(Work { server_context, events, running, status, end }));
    let psec_input = PsecInput {
        checks,
        commands: commands.clone(),
        results: Arc::clone(&results),
        health: health.clone(),
        ids: Arc::clone(&ids),
    };
    tasks.spawn(psec_input.run(topics.psec));
    let streamed = take_stream(topics.psec_stream, joints.clone(), commands.clone());
    let loads = take_loads(topics.load, joints.clone(), node_config.load_timeout, commands.clone());
    let clock_health = health.clone();
    let now = move || convert::stamp(clock_health.borrow().time);
    let host = Host::new(parameters, commands.clone(), live);
    tasks.spawn(parameter_services.serve(host, now, std::future::pending()));
    let to_stop = commands.clone();
    tasks.spawn(stop.serve(move || stop_axes(to_stop.clone(), next_id(&ids), stop_all.clone())));
    let to_reset = commands.clone();
    tasks.spawn(reset.serve(move || reset_axes(to_reset.clone())));

    // What the axes say.
    let diagnostics_text = Diagnostics {
        node: args.node().to_string(),
        machine: config.name().to_owned(),
        joints: joints.clone(),
        time_mode: match mode {
            TimeMode::Real => "real",
            TimeMode::Fast => "fast",
            TimeMode::SimTime => "sim",
        },
        discovered,
    };
    let recording_status = recording.as_ref().map(|recording| recording.status());
    let dropped = Arc::clone(&dropped);
    tasks.spawn(publish_diagnostics(diagnostics_text, diagnostics, health, dropped, recording_status));
    tasks.spawn(async move {
        while let Some(report) = reports.recv().await {
            results.report(report).await;
        }
    });
    let input = join(streamed, loads).then(|_| pending()).boxed();
    let published = outputs.run(frames).boxed();
    let pace = match mode {
        TimeMode::Real => Pace::Real(CooperativeTasks { input, output: published }),
        TimeMode::Fast | TimeMode::SimTime => {
            // On a thread of their own, until there are no frames any more: what publishes may wait for subscribers.
            let woken_alone = FuturesUnordered::from_iter([published, input]);
            let runtime = Handle::current();
            tasks.spawn_blocking(move || {
                let _ = runtime.block_on(woken_alone.into_future());
            });
            Pace::Clock { state: clock, runtime: Handle::current() }
        }
    };

    topics.names.print(args, config.name(), mode);
    let (ended, has_ended) = oneshot::channel();
    thread::Builder::new()
        .name("axes".into())
        .spawn(move || {
            pace::run(simulation, pace, channels);
            let _ = ended.send(());
        })
        .map_err(|source| NodeError::System { what: "start the axes' thread", source })?;

    signals.wait().await;
    let _ = tokio::time::timeout(SHUTDOWN_TIMEOUT, action_end.end()).await;
    // Outputs stop taking, so that the thread cannot wait for them; then the thread, then the rest.
    let _ = tokio::time::timeout(SHUTDOWN_TIMEOUT, commands.send(Command::Shutdown)).await;
    if tokio::time::timeout(SHUTDOWN_TIMEOUT, tasks.shutdown()).await.is_err() {
        warn!("a task did not end in time");
    }
    if tokio::time::timeout(SHUTDOWN_TIMEOUT, has_ended).await.is_err() {
        warn!("the axes' thread did not end in time");
    }
    if let Some(recording) = recording {
        recording.close().await;
    }
    drop(dds);
    drop(context);
    Ok(())
}

/// The signals that end the node; from the moment that this exists, they end it in order.
struct Signals {
    interrupt: Signal,
    terminate: Signal,
    hangup: Signal,
}

impl Signals {
    fn new() -> Result<Self, NodeError> {
        let handler =
            |kind| signal(kind).map_err(|source| NodeError::System { what: "handle signals", source });
        Ok(Signals {
            interrupt: handler(SignalKind::interrupt())?,
            terminate: handler(SignalKind::terminate())?,
            hangup: handler(SignalKind::hangup())?,
        })
    }

    async fn wait(mut self) {
        let name = tokio::select! {
            _ = self.interrupt.recv() => "SIGINT",
            _ = self.terminate.recv() => "SIGTERM",
            _ = self.hangup.recv() => "SIGHUP",
        };
        info!("{name}: shutting down");
    }
}

/// What a service says that came too late.
fn shutting_down<E>(_: E) -> String {
    "the node is shutting down".to_owned()
}

/// `~/stop`.
async fn stop_axes(
    commands: mpsc::Sender<Command>,
    id: MotionId,
    stop: Option<Arc<Trajectory>>,
) -> Result<String, String> {
    let trajectory = stop.ok_or("this machine has no joint to stop")?;
    commands.send(Command::Stop(id, trajectory)).await.map_err(shutting_down)?;
    Ok("stopping every axis within its limits".to_owned())
}

/// `~/reset`.
async fn reset_axes(commands: mpsc::Sender<Command>) -> Result<String, String> {
    let (done, is_done) = oneshot::channel();
    commands.send(Command::Reset(done)).await.map_err(shutting_down)?;
    is_done.await.map_err(shutting_down)?;
    Ok("at rest at home".to_owned())
}

/// A controlled stop of every joint.
fn stop_request(joints: &[JointLimits], period: Nanoseconds, max_points: usize) -> Option<Arc<Trajectory>> {
    let context = ValidationContext { joints, period, max_points, allow_nonzero_end_velocity: false };
    Trajectory::new(TrajectoryRequest::new(Start::Now, Vec::new()), &context).ok().map(Arc::new)
}
