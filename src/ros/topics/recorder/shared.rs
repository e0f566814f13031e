//! State and queue entries that the taps, the thread and the diagnostics share.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock, mpsc};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Capacity of the queue, bytes: more than a minute of all topics at the default rate.
pub(super) const QUEUE_BYTES: u32 = 64 << 20;
/// Clock of the log times in the recording, ns since the Unix epoch.
pub type RecordingClock = Box<dyn Fn() -> u64 + Send + Sync>;

/// State shared by the taps, the thread and the diagnostics.
pub(super) struct Shared {
    pub(super) path: String,
    pub(super) entries: mpsc::Sender<RecordingEntry>,
    /// Semaphore of the free bytes of the queue; closed when writing has ended.
    pub(super) free_bytes: Arc<Semaphore>,
    /// True if the taps wait for a full queue.
    pub(super) is_blocking: bool,
    pub(super) clock: RecordingClock,
    /// Number of messages in the file.
    pub(super) messages: AtomicU64,
    /// Size of the file, bytes.
    pub(super) bytes: AtomicU64,
    /// Number of messages that are not in the file.
    pub(super) left_out: AtomicU64,
    /// Reason why writing ended before shutdown.
    pub(super) end_reason: OnceLock<String>,
}

/// Entry of the queue to the thread.
pub(super) enum RecordingEntry {
    /// Message to be written.
    Message {
        /// Index of its topic.
        topic: usize,
        /// Log time, ns.
        log: u64,
        /// Publish time: stamp of the message, ns.
        publish: u64,
        /// Message in CDR.
        data: Vec<u8>,
        /// Bytes of the queue, released when the message has been written.
        permit: Option<OwnedSemaphorePermit>,
    },
    /// Request to close the file.
    Close,
}
