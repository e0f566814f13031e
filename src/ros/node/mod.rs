//! Node: start of the simulation and the tasks, and ordered shutdown.

mod error;
mod managed;
mod requests;
mod setup;
mod shutdown;
mod start_screen;
mod tasks;
mod thread;

pub use error::NodeError;

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use futures::FutureExt;
use tokio::runtime::Handle;
use tokio::sync::{Mutex, mpsc, watch};
use tokio::task::JoinSet;

use super::axes::{CooperativeTasks, Health, MotionIds, Pace};
use super::log::LogRecord;
use super::publication::{Rosout, publish_diagnostics};
use super::services::{ParameterServices, check_names};
use super::topics::{OverflowPolicy, TopicFactory, TopicRecording};
use crate::ros_interface::{DIAGNOSTICS, LIFECYCLE_SERVICES, SERVICES};
use crate::validation::args::RosArgs;
use managed::{ManagedNode, OperationEnd};
use setup::NodeSetup;
use shutdown::{ShutdownSequence, ShutdownSignals};
use tasks::{NodeTasks, create_results};
use thread::{AxesThread, AxesThreadEnds};
use virtual_axes_core::config::Parameters;
use virtual_axes_core::text::BuiltinFiles;
use virtual_axes_dds::{ClosedGate, Context, Environment, RequestId, Security};

/// Runs the node until SIGINT, SIGTERM or SIGHUP; the records of `log` are published on `/rosout`. `read` reads the
/// parameters again, at each configuration of a managed node; `builtin` are the built-in part programs.
///
/// # Errors
/// [`NodeError`] if the node cannot start; its endpoints are removed from the network then.
pub fn run(
    args: &RosArgs,
    environment: &Environment,
    security: &Security,
    read: &(dyn Fn() -> Result<Parameters, String> + Sync),
    parameters: Parameters,
    builtin: &'static BuiltinFiles,
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
    let (context, result) = loop {
        let gate = ClosedGate::new();
        let context = Context::open(environment, security)?;
        let (start, log) = (parameters.clone(), Arc::clone(&log));
        let begin = Begin { parameters: start, builtin, gate, cleanup };
        let result = runtime.block_on(serve(args, &context, begin, read, &mut signals, log));
        match result {
            Ok(OperationEnd::Cleanup(request)) => {
                context.shutdown();
                cleanup = Some(request);
            }
            Ok(OperationEnd::Signal) => break (context, Ok(())),
            Err(error) => break (context, Err(error)),
        }
    };
    // Tasks and endpoints have ended; remaining blocking threads are not waited for.
    runtime.shutdown_timeout(Duration::from_millis(50));
    context.shutdown();
    result
}

/// Begin of the operation with a participant.
struct Begin {
    /// Parameters of the start.
    parameters: Parameters,
    /// Built-in part programs.
    builtin: &'static BuiltinFiles,
    /// Gate that opens when all endpoints exist.
    gate: ClosedGate,
    /// Request of the cleanup that has ended the operation before.
    cleanup: Option<RequestId>,
}

/// Creates the node, runs it until a signal or a cleanup, and shuts it down. Other participants discover it with all
/// its endpoints, when the gate opens; a managed node with those of its lifecycle and parameters.
async fn serve(
    args: &RosArgs,
    context: &Context,
    Begin { parameters, builtin, gate, cleanup }: Begin,
    read: &(dyn Fn() -> Result<Parameters, String> + Sync),
    signals: &mut ShutdownSignals,
    log: Arc<Mutex<mpsc::Receiver<LogRecord>>>,
) -> Result<OperationEnd, NodeError> {
    let lifecycle = if args.is_managed() { LIFECYCLE_SERVICES } else { &[] };
    check_names(args, SERVICES.iter().chain(lifecycle).map(|service| service.label))?;
    let (health_out, health) = watch::channel(Health::default());
    let configure = |parameters: Parameters| {
        let setup = NodeSetup::new(&parameters)?;
        let recorder = setup.recorder(&health)?;
        Ok::<_, NodeError>((parameters, setup, recorder))
    };
    let node = context.create_node(args.node().namespace(), args.node().name())?;
    let mut join_set = JoinSet::new();
    join_set.spawn(node.spin());
    let services = ParameterServices::new(&node, args)?;
    let mut gate = Some(gate);
    let (configured, mut managed) = if args.is_managed() {
        let mut managed = ManagedNode::start(&node, args, cleanup)?;
        gate = None;
        match managed.wait_for_configuration(&services, parameters, read, signals, configure).await {
            Some((configured, done)) => (configured, Some((managed, Some(done)))),
            None => return Ok(OperationEnd::Signal),
        }
    } else {
        (configure(parameters)?, None)
    };
    let (parameters, setup, mut recorder) = configured;

    let dropped = Arc::new(AtomicU64::new(0));
    let mut topics = TopicFactory::new(&node, args, &parameters, &mut recorder, &dropped, &mut join_set);
    if let Some(rosout) = Rosout::create(&mut topics, args)? {
        topics.tasks.spawn(rosout.run(log));
    }
    let (axes_thread, AxesThreadEnds { commands, frames, reports }) = AxesThread::new(&setup, health_out)?;
    let (results, events) = create_results(&mut topics, &setup)?;
    let tasks = NodeTasks {
        args,
        setup: &setup,
        builtin,
        commands,
        health: health.clone(),
        results: Arc::new(results),
        ids: MotionIds::default(),
        live: Arc::default(),
    };
    let (validator, other_clocks) = (tasks.validator(), Arc::default());
    let inputs = tasks.start_inputs(&mut topics, &validator)?;
    let (clock, clock_subscription) = tasks.start_clock(&mut topics)?;
    let (fan_out, actions) = tasks.start_outputs(&mut topics, validator, events, &other_clocks)?;
    let diagnostics = topics.output(&DIAGNOSTICS, OverflowPolicy::Drop)?;
    let screen = start_screen::start_screen(args, &topics, setup.config.name(), setup.mode);
    let served =
        tasks.start_services(&node, services, parameters.clone(), clock_subscription, &mut join_set)?;
    let recording = recorder.start()?;
    let status = recording.as_ref().map(TopicRecording::status);
    let text = tasks.diagnostics(&node, other_clocks);
    join_set.spawn(publish_diagnostics(text, diagnostics, health, dropped, status));
    join_set.spawn(NodeTasks::publish_reports(Arc::clone(&tasks.results), reports));
    let cooperative = CooperativeTasks { inputs, outputs: fan_out.run(frames).boxed() };
    let pace = Pace { clock, tasks: cooperative, runtime: Handle::current() };
    start_screen::print(&screen);
    if managed.is_some() {
        tasks.deactivate().await;
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
            managed.run(&tasks.commands, tasks.stop(), Some(&served), signals).await
        }
    };
    let NodeTasks { commands, .. } = tasks;
    ShutdownSequence { actions, commands, tasks: join_set, thread_ended, recording }.run().await;
    Ok(end)
}
