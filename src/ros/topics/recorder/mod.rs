//! Recording of all topics of the node, in and out, in one MCAP file (parameter `record`).
//!
//! Each topic has a [`Tap`], which serializes its messages into a queue that is bounded in bytes; one thread writes
//! them to the file. In real time messages are left out and counted when the queue is full; in `fast` the taps wait.
//! A failure of the file does not stop the axes.

mod shared;
mod status;
mod tap;
mod thread;

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use tokio::sync::{Semaphore, oneshot};
use tracing::{info, warn};

use self::shared::{QUEUE_BYTES, RecordingClock, RecordingEntry, Shared};
pub use self::status::RecordingStatus;
use self::status::number;
pub use self::tap::Tap;
use self::thread::RecordingWriter;
use crate::ros_interface::TopicDirection;
use virtual_axes_core::config::{NodeConfig, QosConfig};
use virtual_axes_io::files::{BoundedRecording, RecordedTopic};
use virtual_axes_io::messages::Recorded;

/// Longest time for which shutdown waits until the file is closed.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// Failure to start a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file name has another extension than `.mcap`.
    #[error("record: {path}: a recording is an MCAP file; use the extension .mcap")]
    Name {
        /// Path of the file.
        path: String,
    },
    /// The file exists.
    #[error("record: {path} exists already and is not overwritten; use a new file name")]
    Exists {
        /// Path of the file.
        path: String,
    },
    /// The file cannot be created.
    #[error("record: cannot create {path} in the folder {folder}: {source}")]
    Create {
        /// Path of the file.
        path: String,
        /// Folder of the file.
        folder: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The header cannot be written or the thread cannot be started.
    #[error("record: cannot start writing {path}: {source}")]
    Start {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Recording before it starts, to which topics are added.
pub struct TopicRecorder {
    prepared: Option<Prepared>,
}

struct Prepared {
    path: PathBuf,
    file: File,
    max_bytes: u64,
    topics: Vec<RecordedTopic>,
    shared: Arc<Shared>,
    entries: mpsc::Receiver<RecordingEntry>,
}

impl TopicRecorder {
    /// Creates the file that the parameter `record` names; records nothing if it is not set. Full queues are waited for if
    /// `is_blocking`; `clock` returns the log time of a message.
    ///
    /// # Errors
    /// [`RecordError`] if the extension is not `.mcap`, or the file exists or cannot be created.
    pub fn open(config: &NodeConfig, is_blocking: bool, clock: RecordingClock) -> Result<Self, RecordError> {
        let Some(path) = config.record.clone() else { return Ok(TopicRecorder { prepared: None }) };
        let name = path.display().to_string();
        if path.extension().is_some_and(|extension| !extension.eq_ignore_ascii_case("mcap")) {
            return Err(RecordError::Name { path: name });
        }
        let file = File::options().write(true).create_new(true).open(&path).map_err(|source| {
            let path = name.clone();
            match source.kind() {
                ErrorKind::AlreadyExists => RecordError::Exists { path },
                _ => RecordError::Create { folder: folder(&config.record), path, source },
            }
        })?;
        let (sender, entries) = mpsc::channel();
        let shared = Shared {
            path: name,
            entries: sender,
            free_bytes: Arc::new(Semaphore::new(QUEUE_BYTES as usize)),
            is_blocking,
            clock,
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            left_out: AtomicU64::new(0),
            end_reason: OnceLock::new(),
        };
        let shared = Arc::new(shared);
        let topics = Vec::new();
        Ok(TopicRecorder {
            prepared: Some(Prepared { path, file, max_bytes: config.record_max, topics, shared, entries }),
        })
    }

    /// Adds the topic `name` with its QoS. Returns the tap that records its messages.
    pub fn tap<M: Recorded>(&mut self, name: &str, qos: QosConfig, direction: TopicDirection) -> Tap<M> {
        let Some(prepared) = &mut self.prepared else { return Tap::none() };
        let topic = RecordedTopic { name: name.to_owned(), schema: M::schema(), qos };
        let index = prepared.topics.iter().position(|known| *known == topic).unwrap_or_else(|| {
            prepared.topics.push(topic);
            prepared.topics.len() - 1
        });
        Tap::new(Arc::clone(&prepared.shared), index, direction)
    }

    /// Starts the writing thread. Returns `None` if nothing is recorded.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written or the thread cannot be started.
    pub fn start(mut self) -> Result<Option<TopicRecording>, RecordError> {
        let Some(prepared) = self.prepared.take() else { return Ok(None) };
        let Prepared { path, file, max_bytes, topics, shared, entries } = prepared;
        let failed = |source| {
            // The file is still empty.
            let _ = std::fs::remove_file(&path);
            RecordError::Start { path: path.display().to_string(), source }
        };
        let truncate = file.try_clone().map_err(failed)?;
        let recording = BoundedRecording::new(file, max_bytes, &topics).map_err(failed)?;
        let (done, is_done) = oneshot::channel();
        let writer = RecordingWriter { recording, entries, truncate, shared: Arc::clone(&shared), done };
        std::thread::Builder::new().name("recording".into()).spawn(move || writer.run()).map_err(failed)?;
        info!("recording {} topics in {}", topics.len(), shared.path);
        Ok(Some(TopicRecording { shared, is_done }))
    }
}

impl Drop for TopicRecorder {
    fn drop(&mut self) {
        if let Some(prepared) = &self.prepared {
            // The node did not start; the file is empty.
            let _ = std::fs::remove_file(&prepared.path);
        }
    }
}

/// Returns the folder of a file.
fn folder(path: &Option<PathBuf>) -> String {
    let parent = path.as_deref().and_then(Path::parent).filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).display().to_string()
}

/// Recording in progress.
pub struct TopicRecording {
    shared: Arc<Shared>,
    is_done: oneshot::Receiver<()>,
}

impl TopicRecording {
    /// Creates the source of its diagnostics.
    pub fn status(&self) -> RecordingStatus {
        RecordingStatus::new(Arc::clone(&self.shared))
    }

    /// Writes the queued messages and the footer, and closes the file.
    pub async fn close(self) {
        // If the thread has ended, it has closed the file.
        let _ = self.shared.entries.send(RecordingEntry::Close);
        let path = &self.shared.path;
        if tokio::time::timeout(CLOSE_TIMEOUT, self.is_done).await.is_err() {
            warn!("recording {path} was not closed in time; it is readable up to its last chunk");
            return;
        }
        let (messages, left_out) = (number(&self.shared.messages), number(&self.shared.left_out));
        info!("recording {path}: {messages} messages, {left_out} left out");
    }
}
