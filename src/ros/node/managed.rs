//! Lifecycle of a managed node: waits for its configuration, then executes transitions.

use std::sync::Arc;
use std::time::Duration;

use futures::future::Either;
use tokio::sync::{mpsc, oneshot};
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::timeout;
use tracing::{error, info, warn};

use super::error::NodeError;
use super::shutdown::ShutdownSignals;
use crate::ros::axes::Command;
use crate::ros::services::{
    LifecycleServer, ParameterServices, RequestedTransition, TransitionRequest, UnconfiguredParameterHost,
};
use crate::validation::args::RosArgs;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::trajectory::{MotionId, Trajectory};
use virtual_axes_dds::{Node, RequestId};
use virtual_axes_io::messages::stamp;

/// Longest duration of a deactivation; a clock that stands still prevents its stop.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest time in which the services of the lifecycle end.
const SERVER_TIMEOUT: Duration = Duration::from_secs(2);

/// Reason for which a node has ended its operation.
#[derive(Debug, Clone, Copy)]
pub(super) enum OperationEnd {
    /// Signal: the process ends.
    Signal,
    /// Transition cleanup by this request: the node starts again, unconfigured.
    Cleanup(RequestId),
}

/// Lifecycle services and the requested transitions.
pub(super) struct ManagedNode {
    transitions: mpsc::Receiver<TransitionRequest>,
    /// Task of the services, which ends with this value.
    server: JoinSet<()>,
}

impl ManagedNode {
    /// Creates the lifecycle services of `node` and starts them; they respond to the request `cleanup` that has led here.
    ///
    /// # Errors
    /// [`NodeError`] naming the service that cannot be created.
    pub(super) fn start(node: &Node, args: &RosArgs, cleanup: Option<RequestId>) -> Result<Self, NodeError> {
        let lifecycle = LifecycleServer::new(node, args)?;
        let (transitions_out, transitions) = mpsc::channel(1);
        let mut server = JoinSet::new();
        server.spawn(lifecycle.serve(transitions_out, cleanup));
        Ok(ManagedNode { transitions, server })
    }

    /// Serves the parameters that `read` returns until `configure` succeeds; `parameters` are those of the start, served
    /// if `read` fails. Returns its result with the sender of the transition's result,
    /// or `None` at a signal.
    pub(super) async fn wait_for_configuration<T>(
        &mut self,
        services: &ParameterServices,
        parameters: Parameters,
        read: &(dyn Fn() -> Result<Parameters, String> + Sync),
        signals: &mut ShutdownSignals,
        mut configure: impl FnMut(Parameters) -> Result<T, NodeError>,
    ) -> Option<(T, oneshot::Sender<bool>)> {
        let mut host = UnconfiguredParameterHost::new(read().unwrap_or_else(|error| {
            warn!("{error}");
            parameters
        }));
        info!("unconfigured; waiting for the transition configure");
        loop {
            let (end_serving, is_ended) = oneshot::channel::<()>();
            let now = || stamp(0);
            let ended = async { _ = is_ended.await };
            let serving = services.serve(&mut host, now, ended);
            let request = tokio::select! {
                () = signals.wait() => return None,
                request = next_with(&mut self.transitions, serving, end_serving) => request?,
            };
            let TransitionRequest { transition, done, .. } = request;
            match transition {
                RequestedTransition::Configure => {
                    let configured = read().and_then(|parameters| host.apply_to(parameters));
                    match configured.and_then(|machine| configure(machine).map_err(|error| error.to_string()))
                    {
                        Ok(configured) => return Some((configured, done)),
                        Err(reason) => {
                            error!("not configured: {reason}");
                            _ = done.send(false);
                        }
                    }
                }
                RequestedTransition::Shutdown => _ = done.send(true),
                // The server rejects these in this state.
                _ => _ = done.send(false),
            }
        }
    }

    /// Executes transitions until a signal or a cleanup. `stop` returns a controlled stop and its identifier;
    /// `parameters` is the task that serves the parameters, which ends at a cleanup.
    pub(super) async fn run(
        &mut self,
        commands: &mpsc::Sender<Command>,
        stop: impl Fn() -> (MotionId, Option<Arc<Trajectory>>),
        parameters: Option<&AbortHandle>,
        signals: &mut ShutdownSignals,
    ) -> OperationEnd {
        loop {
            let request = tokio::select! {
                () = signals.wait() => return OperationEnd::Signal,
                request = self.transitions.recv() => request,
            };
            let Some(TransitionRequest { transition, id, done }) = request else {
                return OperationEnd::Signal;
            };
            match transition {
                RequestedTransition::Activate => {
                    info!("active");
                    _ = done.send(commands.send(Command::Activate).await.is_ok());
                }
                RequestedTransition::Deactivate => {
                    let is_stopped = tokio::select! {
                        () = signals.wait() => return OperationEnd::Signal,
                        is_stopped = deactivate(commands, stop()) => is_stopped,
                    };
                    if is_stopped {
                        info!("inactive");
                    } else {
                        warn!("the axes did not stop within {} s; still active", STOP_TIMEOUT.as_secs());
                        _ = commands.send(Command::Activate).await;
                    }
                    _ = done.send(is_stopped);
                }
                RequestedTransition::Cleanup => {
                    // This participant does not answer with values of the past.
                    parameters.inspect(|task| task.abort());
                    _ = done.send(true);
                    let _ = timeout(SERVER_TIMEOUT, self.server.join_next()).await;
                    return OperationEnd::Cleanup(id);
                }
                RequestedTransition::Shutdown => {
                    tokio::select! {
                        () = signals.wait() => return OperationEnd::Signal,
                        _ = deactivate(commands, stop()) => {}
                    }
                    info!("finalized; a signal ends the process");
                    _ = done.send(true);
                }
                // The server rejects it in this state.
                RequestedTransition::Configure => _ = done.send(false),
            }
        }
    }
}

/// Returns the next transition while `serving` runs, which `end_serving` ends.
async fn next_with(
    transitions: &mut mpsc::Receiver<TransitionRequest>,
    serving: impl Future<Output = ()>,
    end_serving: oneshot::Sender<()>,
) -> Option<TransitionRequest> {
    let (serving, next) = (std::pin::pin!(serving), std::pin::pin!(transitions.recv()));
    match futures::future::select(next, serving).await {
        Either::Left((request, serving)) => {
            _ = end_serving.send(());
            serving.await;
            request
        }
        Either::Right(((), next)) => next.await,
    }
}

/// Stops the axes and waits until they are at rest; false after a timeout.
pub(super) async fn deactivate(
    commands: &mpsc::Sender<Command>,
    (id, stop): (MotionId, Option<Arc<Trajectory>>),
) -> bool {
    let (done, is_done) = oneshot::channel();
    if commands.send(Command::Deactivate { id, stop, done }).await.is_err() {
        return false;
    }
    timeout(STOP_TIMEOUT, is_done).await.is_ok_and(|done| done.is_ok())
}
