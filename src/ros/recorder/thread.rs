//! The thread that writes the file.

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use tokio::sync::{OwnedSemaphorePermit, oneshot};
use tracing::warn;

use super::Shared;
use super::status::MEGABYTE;
use virtual_axes_io::files::BoundedRecording;

/// The longest that a message waits until it can be read from the file, whatever happens to the node.
const FLUSH_PERIOD: Duration = Duration::from_millis(500);

/// What the thread is told.
pub(super) enum Entry {
    /// A message.
    Message {
        /// Place of its topic.
        topic: usize,
        /// When it was recorded, ns.
        log: u64,
        /// What it says its time is, ns.
        publish: u64,
        /// CDR.
        data: Vec<u8>,
        /// Its room in the queue, free again when it has been written.
        room: Option<OwnedSemaphorePermit>,
    },
    /// The end of the file.
    Close,
}

/// Why nothing more is written.
enum End {
    Closed,
    Bound,
}

/// What the thread owns.
pub(super) struct Writing {
    pub(super) recording: BoundedRecording<File>,
    pub(super) entries: Receiver<Entry>,
    /// The file, to cut off what could not be written whole.
    pub(super) cut: File,
    pub(super) shared: Arc<Shared>,
    /// Told when the file is closed.
    pub(super) done: oneshot::Sender<()>,
}

impl Writing {
    /// Writes until the file ends.
    pub(super) fn run(mut self) {
        let written = self.write();
        // From here on whoever waits for room leaves its message out.
        self.shared.room.close();
        let Writing { recording, entries, cut, shared, done } = self;
        let whole = recording.whole();
        let finished = written.and_then(|end| {
            if matches!(end, End::Bound) {
                _ = shared.ended.set(format!("it has reached {} MB", recording.bound() / MEGABYTE));
            }
            recording.finish()
        });
        match finished {
            Ok(file) => shared.bytes.store(file.metadata().map_or(0, |file| file.len()), Ordering::Relaxed),
            Err(error) => {
                // The part of a chunk is of no use to readers; they go as far as they can if it stays.
                let _ = cut.set_len(whole);
                shared.bytes.store(whole, Ordering::Relaxed);
                _ = shared.ended.set(error.to_string());
            }
        }
        if let Some(reason) = shared.ended.get() {
            warn!("recording {} has ended: {reason}; the axes go on", shared.path);
        }
        let queued = entries.try_iter().filter(|entry| matches!(entry, Entry::Message { .. })).count();
        shared.left_out.fetch_add(queued as u64, Ordering::Relaxed);
        // The node may be gone already.
        let _ = done.send(());
    }

    /// Writes what comes.
    fn write(&mut self) -> io::Result<End> {
        let mut flushed = Instant::now();
        loop {
            match self.entries.recv_timeout(FLUSH_PERIOD.saturating_sub(flushed.elapsed())) {
                Ok(Entry::Message { topic, log, publish, data, room }) => {
                    let is_written = self.recording.write(topic, log, publish, &data);
                    drop(room);
                    if !matches!(is_written, Ok(true)) {
                        self.shared.left_out.fetch_add(1, Ordering::Relaxed);
                    }
                    if !is_written? {
                        return Ok(End::Bound);
                    }
                    self.shared.messages.fetch_add(1, Ordering::Relaxed);
                }
                Ok(Entry::Close) | Err(RecvTimeoutError::Disconnected) => return Ok(End::Closed),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if flushed.elapsed() >= FLUSH_PERIOD {
                self.recording.flush()?;
                self.shared.bytes.store(self.recording.written(), Ordering::Relaxed);
                flushed = Instant::now();
            }
        }
    }
}
