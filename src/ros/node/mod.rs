//! Node: creation of its endpoints, start of the simulation and the tasks, and ordered shutdown.

mod endpoints;
mod error;
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
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;

use super::args::RosArgs;
use super::clock::ClockState;
use super::discovery_gate::ClosedGate;
use super::environment::Environment;
use super::health::Health;
use super::log::LogRecord;
use super::own_participants::OwnParticipants;
use super::parameter_host::LiveNodeParameters;
use super::participant::Participant;
use super::recorder::{TopicRecorder, TopicRecording};
use super::renewable::EndpointContext;
use super::security::Security;
use super::service;
use super::static_peers;
use super::topics::Topics;
use crate::interface::SERVICES;
use endpoints::NodeEndpoints;
use outputs::{NodeOutputs, NodePublishers, start_outputs};
use setup::NodeSetup;
use shutdown::{ShutdownSequence, ShutdownSignals};
use tasks::NodeTasks;
use thread::{AxesThread, AxesThreadEnds};
use virtual_axes_core::config::{Parameters, TimeMode};

/// Runs the node until SIGINT, SIGTERM or SIGHUP; the records of `log` are published on `/rosout`.
///
/// # Errors
/// [`NodeError`] if the node cannot start; its endpoints are removed from the network then.
pub fn run(
    args: &RosArgs,
    environment: &Environment,
    security: &Security,
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    // With two workers, the second would be woken with the first each time without work to do.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(|source| NodeError::System { what: "start the runtime", source })?;
    let gate = ClosedGate::new();
    let participants = OwnParticipants::new(Participant::open_with(environment, security)?);
    let result = runtime.block_on(serve(args, &participants, gate, parameters, log));
    // Tasks and endpoints have ended; remaining blocking threads are not waited for.
    runtime.shutdown_timeout(Duration::from_millis(50));
    participants.shutdown();
    result
}

/// Creates the node, runs it until a signal, and shuts it down. Other participants discover it with all its endpoints,
/// when `gate` opens.
async fn serve(
    args: &RosArgs,
    participants: &OwnParticipants,
    gate: ClosedGate,
    parameters: Parameters,
    log: mpsc::Receiver<LogRecord>,
) -> Result<(), NodeError> {
    service::check_names(args, SERVICES.iter().map(|service| service.label))?;
    let signals = ShutdownSignals::new()?;
    let setup = NodeSetup::new(&parameters)?;
    let (health_out, health) = watch::channel(Health::default());
    let mut recorder = TopicRecorder::open(&setup.node_config, setup.overflow, &health)?;
    let context = EndpointContext::new(participants.context()?);
    let endpoints = NodeEndpoints::create(&context, args, &parameters, &setup, &mut recorder)?;
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
    };
    tasks.spawn_log_output(rosout, log);
    let recording = recorder.start()?;
    let discovered = tasks.spawn_discovery(tracker, rotated, node, context);
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
    let thread_ended = axes_thread.spawn(pace)?;
    drop(gate);

    signals.wait().await;
    let NodeTasks { commands, tasks, .. } = tasks;
    ShutdownSequence { actions: [action, program], commands, tasks, thread_ended, recording }.run().await;
    Ok(())
}
