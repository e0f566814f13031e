//! Signals that end the node, and its shutdown sequence.

use std::time::Duration;

use futures::future::join_all;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinSet;
use tokio::time::timeout;
use tracing::{info, warn};

use super::error::NodeError;
use crate::ros::actions::ShutdownHandle;
use crate::ros::axes::Command;
use crate::ros::topics::TopicRecording;

/// Longest duration of each step of the shutdown.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(300);

/// Handlers of the signals that end the node, installed at construction.
pub(super) struct ShutdownSignals {
    interrupt: Signal,
    terminate: Signal,
    hangup: Signal,
}

impl ShutdownSignals {
    pub(super) fn new() -> Result<Self, NodeError> {
        let handler =
            |kind| signal(kind).map_err(|source| NodeError::System { what: "handle signals", source });
        Ok(ShutdownSignals {
            interrupt: handler(SignalKind::interrupt())?,
            terminate: handler(SignalKind::terminate())?,
            hangup: handler(SignalKind::hangup())?,
        })
    }

    /// Waits for SIGINT, SIGTERM or SIGHUP.
    pub(super) async fn wait(&mut self) {
        let name = tokio::select! {
            _ = self.interrupt.recv() => "SIGINT",
            _ = self.terminate.recv() => "SIGTERM",
            _ = self.hangup.recv() => "SIGHUP",
        };
        info!("{name}: shutting down");
    }
}

/// Ordered shutdown of the node.
pub(super) struct ShutdownSequence {
    pub(super) actions: [ShutdownHandle; 2],
    pub(super) commands: mpsc::Sender<Command>,
    pub(super) tasks: JoinSet<()>,
    /// Confirmation that the axes' thread has ended.
    pub(super) thread_ended: oneshot::Receiver<()>,
    pub(super) recording: Option<TopicRecording>,
}

impl ShutdownSequence {
    /// Aborts active goals, ends the tasks and the axes' thread, and closes the recording.
    pub(super) async fn run(mut self) {
        let actions = self.actions.map(ShutdownHandle::shut_down);
        let _ = timeout(SHUTDOWN_TIMEOUT, join_all(actions)).await;
        // The tasks end before the thread, so that it cannot wait for an output.
        let _ = timeout(SHUTDOWN_TIMEOUT, self.commands.send(Command::Shutdown)).await;
        if timeout(SHUTDOWN_TIMEOUT, self.tasks.shutdown()).await.is_err() {
            warn!("a task did not end in time");
        }
        if timeout(SHUTDOWN_TIMEOUT, self.thread_ended).await.is_err() {
            warn!("the axes' thread did not end in time");
        }
        if let Some(recording) = self.recording {
            recording.close().await;
        }
    }
}
