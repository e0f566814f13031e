//! The node: parameters in, endpoints made, the simulation started, and everything ended in order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use ros2_client::{MessageTypeName, NodeName, NodeOptions};
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use rustdds::{DomainParticipant, RTPSEntity};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinSet;
use tracing::{info, warn};

use super::args::RosArgs;
use super::ask_again;
use super::convert;
use super::diagnostics::Diagnostics;
use super::endpoints::{EndpointError, Endpoints, Profile};
use super::environment::Environment;
use super::inputs::{PsecInput, next_id, take_loads};
use super::log::LogRecord;
use super::messages::{self, DriveStates, MotorCurrents};
use super::outputs::{Output, WhenFull, queue_length};
use super::pace::{self, Channels, Command, Frame, Health};
use super::parameter_host::{Host, LiveNodeParameters};
use super::parameter_services::ParameterServices;
use super::participant::{Participant, ParticipantError};
use super::results::Results;
use super::rosout;
use super::service::ServiceError;
use super::trigger::Trigger;
use crate::config::{ConfigError, Parameters, TimeMode};
use crate::simulation::{self, Simulation, SimulationError};
use crate::trajectory::{Context, Request, Start, Trajectory};
use crate::units::seconds;

/// Period of `/diagnostics` (REP-107).
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);
/// How often it is looked whether somebody else publishes `/clock`.
const CLOCK_WATCH_PERIOD: Duration = Duration::from_millis(500);
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
    /// The operating system gives no thread, timer or signal handler.
    #[error("cannot {what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
    /// `use_sim_time` is asked for.
    #[error(
        "use_sim_time is true, but the axes do not follow /clock of others; leave it false, with time: real \
         or time: fast"
    )]
    SimTime,
}

/// Runs the node until SIGINT or SIGTERM; what comes through `log` goes to `/rosout`.
///
/// # Errors
/// [`NodeError`] if it cannot start; nothing is left on the network then.
pub fn run(
    args: &RosArgs,
    environment: &Environment,
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|source| NodeError::System { what: "start the runtime", source })?;
    let participant = Participant::open(environment)?;
    let result = runtime.block_on(serve(args, &participant, parameters, log));
    // Tasks and endpoints are gone; what is left of the runtime is not waited for.
    runtime.shutdown_timeout(Duration::from_millis(50));
    participant.shutdown();
    result
}

/// What the node says about itself when it starts.
struct Listing {
    subscribes: Vec<String>,
    publishes: Vec<String>,
    serves: Vec<String>,
}

async fn serve(
    args: &RosArgs,
    participant: &Participant,
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    let config = parameters.machine_config()?;
    let node_config = parameters.node_config();
    if node_config.time == TimeMode::SimTime {
        return Err(NodeError::SimTime);
    }
    let joint_limits = simulation::joints(&config, &node_config.joint_prefix);
    let joints: Vec<String> = joint_limits.iter().map(|j| j.name.clone()).collect();
    let period = config.periods().position;
    let fast = node_config.time == TimeMode::Fast;
    let when_full = if fast { WhenFull::Wait } else { WhenFull::Drop };

    let context = participant.context()?;
    let dds = context.domain_participant();
    let node_error = |reason: String| NodeError::Node { name: args.node().to_string(), reason };
    let name = NodeName::new(args.node().namespace(), args.node().name())
        .map_err(|e| node_error(format!("{e:?}")))?;
    let options = NodeOptions::new().start_parameter_services(false).enable_rosout(args.log_sinks().rosout);
    let mut node = context.new_node(name, options).map_err(|e| node_error(e.to_string()))?;

    let mut endpoints = Endpoints { node: &mut node, args };
    let joint_state_type = || MessageTypeName::new("sensor_msgs", "JointState");
    let (psec, psec_name) = endpoints.subscription(
        "psec",
        MessageTypeName::new("trajectory_msgs", "JointTrajectory"),
        Profile::Psec,
    )?;
    let (load, load_name) = endpoints.subscription("load", joint_state_type(), Profile::Load)?;
    let (joint_states, joint_states_name) =
        endpoints.publisher::<JointState>("joint_states", joint_state_type(), Profile::Output)?;
    let (currents, currents_name) = endpoints.publisher::<MotorCurrents>(
        "~/motor_currents",
        messages::type_name("MotorCurrents"),
        Profile::Output,
    )?;
    let (states, states_name) = endpoints.publisher::<DriveStates>(
        "~/drive_states",
        messages::type_name("DriveStates"),
        Profile::Output,
    )?;
    let (results, results_name) = endpoints.publisher(
        "~/trajectory_result",
        messages::type_name("TrajectoryResult"),
        Profile::Result,
    )?;
    let (diagnostics, diagnostics_name) = endpoints.publisher(
        "/diagnostics",
        MessageTypeName::new("diagnostic_msgs", "DiagnosticArray"),
        Profile::Output,
    )?;
    let clock = if fast {
        let clock_type = MessageTypeName::new("rosgraph_msgs", "Clock");
        Some(endpoints.publisher::<Clock>("/clock", clock_type, Profile::Output)?)
    } else {
        None
    };
    let listing = Listing {
        subscribes: vec![psec_name, load_name],
        publishes: [joint_states_name, currents_name, states_name, results_name, diagnostics_name]
            .into_iter()
            .chain(clock.iter().map(|(_, name)| name.clone()))
            .collect(),
        serves: ["~/reset", "~/stop"].iter().filter_map(|s| args.resolve_service(s).ok()).collect(),
    };
    let reset = Trigger::new(&mut node, &dds, args, "reset")?;
    let stop = Trigger::new(&mut node, &dds, args, "stop")?;
    let parameter_services = ParameterServices::new(&mut node, &dds, args)?;

    let simulation = Simulation::new(&config, joint_limits.clone(), pace::grid_origin(period))?;
    let (commands, commands_in) = mpsc::channel(pace::COMMAND_QUEUE);
    let (frames_out, frames) = mpsc::channel(queue_length(when_full));
    let (reports_out, mut reports) = mpsc::unbounded_channel();
    let (health_out, health) = watch::channel(Health::default());
    let channels =
        Channels { commands: commands_in, frames: frames_out, reports: reports_out, health: health_out };

    let mut tasks = JoinSet::new();
    let dropped = Arc::new(AtomicU64::new(0));
    let live = Arc::new(LiveNodeParameters::default());
    let ids = Arc::new(AtomicU64::new(1));
    let results = Results::new(Output::start(results, WhenFull::Wait, &dropped, &mut tasks), joints.clone());
    let results = Arc::new(results);

    tasks.spawn(rosout::publish(&node, log));

    // What comes in.
    tasks.spawn(ask_again::run(dds.clone()));
    let stop_all = stop_request(&joint_limits, period, node_config.max_points);
    let psec_input = PsecInput {
        joints: joint_limits,
        period,
        node: node_config.clone(),
        live: Arc::clone(&live),
        commands: commands.clone(),
        results: Arc::clone(&results),
        health: health.clone(),
        ids: Arc::clone(&ids),
    };
    tasks.spawn(psec_input.run(psec));
    tasks.spawn(take_loads(load, joints.clone(), node_config.load_timeout, commands.clone()));
    let clock_health = health.clone();
    let now = move || convert::stamp(clock_health.borrow().time);
    let host = Host::new(parameters, commands.clone(), live);
    tasks.spawn(parameter_services.serve(host, now, std::future::pending()));
    let stop_commands = commands.clone();
    tasks.spawn(stop.serve(move || {
        let (commands, id, trajectory) = (stop_commands.clone(), next_id(&ids), stop_all.clone());
        async move {
            let trajectory = trajectory.ok_or("this machine has no joint to stop")?;
            let command = Command::Offer { id, trajectory };
            commands.send(command).await.map_err(|_| "the node is shutting down".to_owned())?;
            Ok("stopping every axis within its limits".to_owned())
        }
    }));
    let reset_commands = commands.clone();
    tasks.spawn(reset.serve(move || {
        let commands = reset_commands.clone();
        async move {
            let gone = || "the node is shutting down".to_owned();
            let (done, is_done) = oneshot::channel();
            commands.send(Command::Reset(done)).await.map_err(|_| gone())?;
            is_done.await.map_err(|_| gone())?;
            Ok("at rest at home".to_owned())
        }
    }));

    // What goes out.
    let diagnostics_text = Diagnostics {
        node: args.node().to_string(),
        machine: config.name().to_owned(),
        joints: joints.clone(),
        time_mode: if fast { "fast" } else { "real" },
    };
    let diagnostics = Output::start(diagnostics, WhenFull::Drop, &dropped, &mut tasks);
    tasks.spawn(publish_diagnostics(diagnostics_text, diagnostics, health, Arc::clone(&dropped)));
    tasks.spawn(async move {
        while let Some(report) = reports.recv().await {
            results.report(report).await;
        }
    });
    let others_clock = Arc::new(AtomicBool::new(false));
    let clock = clock.map(|(publisher, name)| {
        tasks.spawn(watch_clock(dds.clone(), name, Arc::clone(&others_clock)));
        Output::start(publisher, when_full, &dropped, &mut tasks)
    });
    let every = node_config.publish_rate.map_or(1, |rate| (1.0 / (rate * seconds(period))).round() as i64);
    let outputs = Outputs {
        joint_states: Output::start(joint_states, when_full, &dropped, &mut tasks),
        motor_currents: Output::start(currents, when_full, &dropped, &mut tasks),
        drive_states: Output::start(states, when_full, &dropped, &mut tasks),
        clock,
        others_clock,
        joints,
        every: every.max(1),
    };
    tasks.spawn(outputs.run(frames));

    listing.print(args, config.name(), node_config.time);
    let (ended, has_ended) = oneshot::channel();
    let mode = node_config.time;
    thread::Builder::new()
        .name("axes".into())
        .spawn(move || {
            pace::run(simulation, mode, channels);
            let _ = ended.send(());
        })
        .map_err(|source| NodeError::System { what: "start the axes' thread", source })?;

    wait_for_signal().await?;
    // Outputs stop taking, so that the thread cannot wait for them; then the thread, then the rest.
    let _ = tokio::time::timeout(SHUTDOWN_TIMEOUT, commands.send(Command::Shutdown)).await;
    tasks.shutdown().await;
    if tokio::time::timeout(SHUTDOWN_TIMEOUT, has_ended).await.is_err() {
        warn!("the axes' thread did not end in time");
    }
    drop(dds);
    drop(node);
    drop(context);
    Ok(())
}

async fn wait_for_signal() -> Result<(), NodeError> {
    let handler = |kind| signal(kind).map_err(|source| NodeError::System { what: "handle signals", source });
    let (mut interrupt, mut terminate) =
        (handler(SignalKind::interrupt())?, handler(SignalKind::terminate())?);
    let name = tokio::select! {
        _ = interrupt.recv() => "SIGINT",
        _ = terminate.recv() => "SIGTERM",
    };
    info!("{name}: shutting down");
    Ok(())
}

/// A controlled stop of every joint.
fn stop_request(
    joints: &[crate::trajectory::JointLimits],
    period: crate::units::Nanoseconds,
    max_points: usize,
) -> Option<Arc<Trajectory>> {
    let context = Context { joints, period, max_points, allow_nonzero_end_velocity: false };
    Trajectory::new(Request::new(Start::Now, Vec::new()), &context).ok().map(Arc::new)
}

/// The outputs of every position instant.
struct Outputs {
    joint_states: Output<JointState>,
    motor_currents: Output<MotorCurrents>,
    drive_states: Output<DriveStates>,
    clock: Option<Output<Clock>>,
    others_clock: Arc<AtomicBool>,
    joints: Vec<String>,
    /// Position instants from one publication to the next.
    every: i64,
}

impl Outputs {
    async fn run(self, mut frames: mpsc::Receiver<Frame>) {
        while let Some(frame) = frames.recv().await {
            if let Some(clock) = &self.clock
                && !self.others_clock.load(Ordering::Relaxed)
            {
                clock.send(Clock { clock: convert::stamp(frame.time) }).await;
            }
            if frame.instant % self.every == 0 {
                self.joint_states.send(convert::joint_state(&frame, &self.joints)).await;
                self.motor_currents.send(convert::motor_currents(&frame, &self.joints)).await;
                self.drive_states.send(convert::drive_states(&frame, &self.joints)).await;
            }
        }
    }
}

async fn publish_diagnostics(
    text: Diagnostics,
    output: Output<ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray>,
    health: watch::Receiver<Health>,
    dropped: Arc<AtomicU64>,
) {
    let mut timer = tokio::time::interval(DIAGNOSTICS_PERIOD);
    let (mut before, mut dropped_before) = (Health::default(), 0);
    loop {
        timer.tick().await;
        let now = health.borrow().clone();
        let dropped_now = dropped.load(Ordering::Relaxed);
        output.send(text.message(now.time, &before, &now, (dropped_before, dropped_now))).await;
        (before, dropped_before) = (now, dropped_now);
    }
}

/// Notes whether another participant publishes the clock.
async fn watch_clock(participant: DomainParticipant, name: String, others: Arc<AtomicBool>) {
    let topic = format!("rt{name}");
    let own = participant.guid().prefix;
    loop {
        let found = participant.discovered_writers().iter().any(|writer| {
            writer.publication_topic_data.topic_name == topic
                && writer.writer_proxy.remote_writer_guid.prefix != own
        });
        if found != others.swap(found, Ordering::Relaxed) {
            let what = if found { "somebody else publishes it; holding back" } else { "publishing it" };
            info!("{name}: {what}");
        }
        tokio::time::sleep(CLOCK_WATCH_PERIOD).await;
    }
}

impl Listing {
    /// One screen for whoever started the node.
    fn print(&self, args: &RosArgs, machine: &str, time: TimeMode) {
        let time = match time {
            TimeMode::Fast => "as fast as subscribers take it",
            TimeMode::Real | TimeMode::SimTime => "real",
        };
        println!("{}: {machine}, time: {time}", args.node());
        for (what, names) in
            [("listens to", &self.subscribes), ("publishes", &self.publishes), ("serves", &self.serves)]
        {
            for (place, name) in names.iter().enumerate() {
                println!("  {:<11}{name}", if place == 0 { what } else { "" });
            }
        }
        println!("  and the parameter services; stop it with Ctrl-C");
    }
}
