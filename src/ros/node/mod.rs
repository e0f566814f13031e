//! Node: creation of its endpoints, start of the simulation and the tasks, and ordered shutdown.

mod endpoints;
mod error;
mod managed;
mod outputs;
mod requests;
mod setup;
mod shutdown;
mod tasks;
mod thread;

pub use error::NodeError;

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use futures::FutureExt;
use ros2_client::service::RmwRequestId;
use tokio::sync::{Mutex, mpsc, oneshot, watch};
use tokio::task::JoinSet;

use super::args::RosArgs;
use super::axes_interface::Command;
use super::clock::ClockState;
use super::discovery_gate::ClosedGate;
use super::environment::Environment;
use super::health::Health;
use super::inputs::next_motion_id;
use super::log::LogRecord;
use super::own_participants::OwnParticipants;
use super::parameter_host::LiveNodeParameters;
use super::parameter_services::ParameterServices;
use super::participant::Participant;
use super::participant::create_node;
use super::recorder::{TopicRecorder, TopicRecording};
use super::renewable::EndpointContext;
use super::renewal::DiscoveryWatch;
use super::security::Security;
use super::service;
use super::static_peers;
use super::topics::Topics;
use crate::interface::{LIFECYCLE_SERVICES, SERVICES};
use endpoints::NodeEndpoints;
use managed::{ManagedNode, OperationEnd};
use outputs::{NodeOutputs, NodePublishers, start_outputs};
use setup::NodeSetup;
use shutdown::{ShutdownSequence, ShutdownSignals};
use tasks::NodeTasks;
use thread::{AxesThread, AxesThreadEnds};
use virtual_axes_core::config::{Parameters, TimeMode};

/// Runs the node until SIGINT, SIGTERM or SIGHUP; the records of `log` are published on `/rosout`. `read` reads the
/// parameters again, at each configuration of a managed node.
///
/// # Errors
/// [`NodeError`] if the node cannot start; its endpoints are removed from the network then.
pub fn run(
    args: &RosArgs,
    environment: &Environment,
    security: &Security,
    read: &(dyn Fn() -> Result<Parameters, String> + Sync),
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    // With two workers, the second would be woken with the first each time without work to do.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(|source| NodeError::System { what: "start the runtime", source })?;
    let log = Arc::new(Mutex::new(log));
    let mut signals = {
        let _context = runtime.enter();
        ShutdownSignals::new()?
    };
    let mut cleanup = None;
    let (participants, result) = loop {
        let gate = ClosedGate::new();
        let participants = OwnParticipants::new(Participant::open_with(environment, security)?);
        let (start, log) = (parameters.clone(), Arc::clone(&log));
        let begin = Begin { parameters: start, gate, cleanup };
        let result = runtime.block_on(serve(args, &participants, begin, read, &mut signals, log));
        match result {
            Ok(OperationEnd::Cleanup(request)) => {
                participants.shutdown();
                cleanup = Some(request);
            }
            Ok(OperationEnd::Signal) => break (participants, Ok(())),
            Err(error) => break (participants, Err(error)),
        }
    };
    // Tasks and endpoints have ended; remaining blocking threads are not waited for.
    runtime.shutdown_timeout(Duration::from_millis(50));
    participants.shutdown();
    result
}

/// Begin of the operation with a participant.
struct Begin {
    /// Parameters of the start.
    parameters: Parameters,
    /// Gate that opens when all endpoints exist.
    gate: ClosedGate,
    /// Request of the cleanup that has ended the operation before.
    cleanup: Option<RmwRequestId>,
}

/// Creates the node, runs it until a signal or a cleanup, and shuts it down. Other participants discover it with all
/// its endpoints, when the gate opens; a managed node with those of its lifecycle and parameters.
async fn serve(
    args: &RosArgs,
    participants: &OwnParticipants,
    Begin { parameters, gate, cleanup }: Begin,
    read: &(dyn Fn() -> Result<Parameters, String> + Sync),
    signals: &mut ShutdownSignals,
    log: Arc<Mutex<mpsc::Receiver<LogRecord>>>,
) -> Result<OperationEnd, NodeError> {
    let lifecycle = if args.is_managed() { LIFECYCLE_SERVICES } else { &[] };
    service::check_names(args, SERVICES.iter().chain(lifecycle).map(|service| service.label))?;
    let (health_out, health) = watch::channel(Health::default());
    let configure = |parameters: Parameters| {
        let setup = NodeSetup::new(&parameters)?;
        let recorder = TopicRecorder::open(&setup.node_config, setup.overflow, &health)?;
        Ok::<_, NodeError>((parameters, setup, recorder))
    };
    let context = EndpointContext::new(participants.context()?);
    let mut node = create_node(&context, args)
        .map_err(|reason| NodeError::Node { name: args.node().to_string(), reason })?;
    let services = ParameterServices::new(&mut node, &context, args)?;
    let discovery = DiscoveryWatch::of_first(participants, args, context.domain_participant());
    let mut gate = Some(gate);
    let (configured, mut managed) = if args.is_managed() {
        let mut managed = ManagedNode::start(&mut node, &context, args, cleanup)?;
        gate = None;
        match managed.wait_for_configuration(&services, parameters, read, signals, configure).await {
            Some((configured, done)) => (configured, Some((managed, Some(done)))),
            None => return Ok(OperationEnd::Signal),
        }
    } else {
        (configure(parameters)?, None)
    };
    let (parameters, setup, mut recorder) = configured;
    let endpoints =
        NodeEndpoints::create(node, services, &context, args, &parameters, &setup, &mut recorder)?;
    let NodeEndpoints {
        node,
        rosout,
        topics,
        tool,
        action,
        action_topics,
        program,
        program_topics,
        services,
    } = endpoints;
    let Topics { subscriptions, publishers: topics, names } = topics;

    let (axes_thread, AxesThreadEnds { commands, frames, reports }) = AxesThread::new(&setup, health_out)?;
    let (clock_out, clock) = watch::channel(ClockState::new(setup.mode == TimeMode::Fast));
    let dropped = Arc::new(AtomicU64::new(0));
    let mut tasks = JoinSet::new();
    let publishers = NodePublishers {
        rosout,
        topics,
        tool,
        action_status: action_topics.status,
        action_feedback: action_topics.feedback,
        program_status: program_topics.status,
        program_feedback: program_topics.feedback,
    };
    let dds = context.domain_participant();
    let outputs = start_outputs(publishers, &dds, &setup, &clock, &dropped, &mut tasks);
    static_peers::announce(participants.clone(), dds.domain_id());
    // A renewal drops this participant.
    drop(dds);
    let NodeOutputs {
        rosout,
        fan_out,
        results,
        diagnostics,
        action: action_outputs,
        program: program_outputs,
        tracker,
        rotated,
    } = outputs;
    let mut tasks = NodeTasks {
        args,
        setup: &setup,
        participants: participants.clone(),
        commands,
        health,
        results,
        ids: Arc::new(AtomicU64::new(1)),
        live: Arc::new(LiveNodeParameters::default()),
        tasks,
        parameters: None,
    };
    tasks.spawn_log_output(rosout, log);
    let recording = recorder.start()?;
    let discovered = tasks.spawn_discovery(discovery, tracker, rotated, node, context);
    tasks.spawn_clock_input(subscriptions.clock, clock_out);
    let action = tasks.spawn_trajectory_inputs(action, action_outputs, subscriptions.psec);
    let program = tasks.spawn_program_server(program, program_outputs);
    let inputs = tasks.stream_and_load_inputs(subscriptions.psec_stream, subscriptions.load);
    tasks.spawn_feed_override_input(subscriptions.feed_override);
    tasks.spawn_services(services, parameters);
    let recording_status = recording.as_ref().map(TopicRecording::status);
    tasks.spawn_diagnostics(diagnostics, discovered, dropped, recording_status);
    tasks.spawn_reports(reports);
    let pace = tasks.pace(inputs, fan_out.run(frames).boxed(), clock);
    names.print(args, setup.config.name(), setup.mode);
    if managed.is_some() {
        // The thread executes it before its first position cycle.
        let (done, _) = oneshot::channel();
        let deactivate = Command::Deactivate { id: next_motion_id(&tasks.ids), stop: None, done };
        _ = tasks.commands.send(deactivate).await;
    }
    let thread_ended = axes_thread.spawn(pace)?;
    drop(gate);

    let end = match &mut managed {
        None => {
            signals.wait().await;
            OperationEnd::Signal
        }
        Some((managed, done)) => {
            // The receiver is dropped only with its server.
            _ = done.take().map(|done| done.send(true));
            managed.run(&tasks.commands, tasks.stop(), tasks.parameters.as_ref(), signals).await
        }
    };
    let NodeTasks { commands, tasks, .. } = tasks;
    ShutdownSequence { actions: [action, program], commands, tasks, thread_ended, recording }.run().await;
    Ok(end)
}
