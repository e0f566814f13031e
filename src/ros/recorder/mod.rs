//! The node's own recording: every topic, in and out, in one MCAP file (parameter `record`).
//!
//! Each topic has a [`Tap`], which makes bytes of its messages and puts them into a queue that is bounded in
//! bytes; one thread writes them. In real time a full queue leaves messages out and counts them, in `fast`
//! the taps wait. Whatever happens to the file, the axes go on.

mod status;
mod tap;
mod thread;

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use tokio::sync::{Semaphore, oneshot, watch};
use tracing::{info, warn};

pub use self::status::RecordingStatus;
use self::status::number;
use self::tap::Clock;
pub use self::tap::{Direction, Tap};
use self::thread::{Entry, Writing};
use super::outputs::WhenFull;
use super::pace::Health;
use virtual_axes_core::config::{NodeConfig, QosConfig};
use virtual_axes_io::files::{BoundedRecording, RecordedTopic};
use virtual_axes_io::messages::Recorded;

/// Bytes that may wait to be written: more than a minute of all topics at the default rate.
const QUEUE_BYTES: u32 = 64 << 20;
/// How long the end of the file is waited for when the node shuts down.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// Why the node does not record as it should.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The name is that of another kind of file.
    #[error("record: {path}: a recording is an MCAP file: .mcap")]
    Name {
        /// The file.
        path: String,
    },
    /// The file is there.
    #[error(
        "record: {path} exists already, and a recording overwrites nothing: name a file that is not there"
    )]
    Exists {
        /// The file.
        path: String,
    },
    /// The file cannot be made.
    #[error("record: {path} cannot be made in the folder {folder}: {source}")]
    Create {
        /// The file.
        path: String,
        /// Where it was to be.
        folder: String,
        /// What the system says.
        source: io::Error,
    },
    /// It cannot be begun.
    #[error("record: {path}: {source}")]
    Begin {
        /// The file.
        path: String,
        /// What is wrong.
        source: io::Error,
    },
}

/// What the taps, the thread and the diagnostics share.
struct Shared {
    path: String,
    entries: mpsc::Sender<Entry>,
    /// Bytes that may still be queued; closed as soon as nothing more is written.
    room: Arc<Semaphore>,
    when_full: WhenFull,
    clock: Clock,
    /// Messages in the file.
    messages: AtomicU64,
    /// Bytes of the file.
    bytes: AtomicU64,
    /// Messages that are not in the file.
    left_out: AtomicU64,
    /// Why it ended before the node did.
    ended: OnceLock<String>,
}

/// A recording before it begins; topics are added.
pub struct Recorder {
    begun: Option<Begun>,
}

struct Begun {
    path: PathBuf,
    file: File,
    bound: u64,
    topics: Vec<RecordedTopic>,
    shared: Arc<Shared>,
    entries: mpsc::Receiver<Entry>,
}

impl Recorder {
    /// Makes the file that the parameters name, or records nothing if they name none.
    ///
    /// # Errors
    /// [`RecordError`] if it is no name for a recording, exists or cannot be made.
    pub fn open(
        config: &NodeConfig,
        when_full: WhenFull,
        health: &watch::Receiver<Health>,
    ) -> Result<Self, RecordError> {
        let Some(path) = config.record.clone() else { return Ok(Recorder { begun: None }) };
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
            room: Arc::new(Semaphore::new(QUEUE_BYTES as usize)),
            when_full,
            clock: Clock { time: config.time, health: health.clone() },
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            left_out: AtomicU64::new(0),
            ended: OnceLock::new(),
        };
        let shared = Arc::new(shared);
        let topics = Vec::new();
        Ok(Recorder { begun: Some(Begun { path, file, bound: config.record_max, topics, shared, entries }) })
    }

    /// What records the messages of the topic `name`, which is offered with `qos`.
    pub fn tap<M: Recorded>(&mut self, name: &str, qos: QosConfig, direction: Direction) -> Tap<M> {
        let Some(begun) = &mut self.begun else { return Tap::none() };
        let topic = RecordedTopic { name: name.to_owned(), schema: M::schema(), qos };
        let place = begun.topics.iter().position(|known| *known == topic).unwrap_or_else(|| {
            begun.topics.push(topic);
            begun.topics.len() - 1
        });
        Tap::new(Arc::clone(&begun.shared), place, direction)
    }

    /// Starts the thread that writes; `None` if nothing is recorded.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be begun or there is no thread.
    pub fn start(mut self) -> Result<Option<Recording>, RecordError> {
        let Some(begun) = self.begun.take() else { return Ok(None) };
        let Begun { path, file, bound, topics, shared, entries } = begun;
        let failed = |source| {
            // Nothing stands in it yet.
            let _ = std::fs::remove_file(&path);
            RecordError::Begin { path: path.display().to_string(), source }
        };
        let cut = file.try_clone().map_err(failed)?;
        let recording = BoundedRecording::new(file, bound, &topics).map_err(failed)?;
        let (done, is_done) = oneshot::channel();
        let writing = Writing { recording, entries, cut, shared: Arc::clone(&shared), done };
        std::thread::Builder::new().name("recording".into()).spawn(move || writing.run()).map_err(failed)?;
        info!("recording {} topics in {}", topics.len(), shared.path);
        Ok(Some(Recording { shared, is_done }))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(begun) = &self.begun {
            // The node did not start: nobody wants an empty file.
            let _ = std::fs::remove_file(&begun.path);
        }
    }
}

/// The folder that a file is in.
fn folder(path: &Option<PathBuf>) -> String {
    let parent = path.as_deref().and_then(Path::parent).filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).display().to_string()
}

/// A recording that is being written.
pub struct Recording {
    shared: Arc<Shared>,
    is_done: oneshot::Receiver<()>,
}

impl Recording {
    /// What the diagnostics say about it.
    pub fn status(&self) -> RecordingStatus {
        RecordingStatus::new(Arc::clone(&self.shared))
    }

    /// Writes what is queued, and the end of the file.
    pub async fn close(self) {
        // A thread that is gone has closed the file.
        let _ = self.shared.entries.send(Entry::Close);
        let path = &self.shared.path;
        if tokio::time::timeout(CLOSE_TIMEOUT, self.is_done).await.is_err() {
            warn!("recording {path} was not closed in time; it can be read up to its last chunk");
            return;
        }
        let (messages, left_out) = (number(&self.shared.messages), number(&self.shared.left_out));
        info!("recording {path}: {messages} messages, {left_out} left out");
    }
}
