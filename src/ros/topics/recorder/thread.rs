//! Thread that writes the recording.

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;
use tracing::warn;

use super::shared::{RecordingEntry, Shared};
use super::status::MEGABYTE;
use virtual_axes_io::files::BoundedRecording;

/// Longest time until a queued message is readable in the file, even if the node is killed.
const FLUSH_PERIOD: Duration = Duration::from_millis(500);

/// Reason why writing ends.
enum WriteEnd {
    Closed,
    SizeLimit,
}

/// State of the writing thread.
pub(super) struct RecordingWriter {
    pub(super) recording: BoundedRecording<File>,
    pub(super) entries: Receiver<RecordingEntry>,
    /// Second handle of the file, to truncate a chunk that was written in part.
    pub(super) truncate: File,
    pub(super) shared: Arc<Shared>,
    /// Signal that the file is closed.
    pub(super) done: oneshot::Sender<()>,
}

impl RecordingWriter {
    /// Writes entries until the file is closed, has reached its size limit, or fails.
    pub(super) fn run(mut self) {
        let written = self.write();
        // Waiting taps leave their messages out from here on.
        self.shared.free_bytes.close();
        let RecordingWriter { recording, entries, truncate, shared, done } = self;
        let whole = recording.complete_bytes();
        let finished = written.and_then(|end| {
            if matches!(end, WriteEnd::SizeLimit) {
                _ = shared.end_reason.set(format!("it has reached {} MB", recording.bound() / MEGABYTE));
            }
            recording.finish()
        });
        match finished {
            Ok(file) => shared.bytes.store(file.metadata().map_or(0, |file| file.len()), Ordering::Relaxed),
            Err(error) => {
                // An incomplete chunk would be an error for readers.
                let _ = truncate.set_len(whole);
                shared.bytes.store(whole, Ordering::Relaxed);
                _ = shared.end_reason.set(error.to_string());
            }
        }
        if let Some(reason) = shared.end_reason.get() {
            warn!("recording {} has ended: {reason}; the axes go on", shared.path);
        }
        let queued =
            entries.try_iter().filter(|entry| matches!(entry, RecordingEntry::Message { .. })).count();
        shared.left_out.fetch_add(queued as u64, Ordering::Relaxed);
        // The receiver is dropped if the close timed out.
        let _ = done.send(());
    }

    /// Writes entries until the end; flushes every [`FLUSH_PERIOD`].
    fn write(&mut self) -> io::Result<WriteEnd> {
        let mut flushed = Instant::now();
        loop {
            match self.entries.recv_timeout(FLUSH_PERIOD.saturating_sub(flushed.elapsed())) {
                Ok(RecordingEntry::Message { topic, log, publish, data, permit }) => {
                    let is_written = self.recording.write(topic, log, publish, &data);
                    drop(permit);
                    if !matches!(is_written, Ok(true)) {
                        self.shared.left_out.fetch_add(1, Ordering::Relaxed);
                    }
                    if !is_written? {
                        return Ok(WriteEnd::SizeLimit);
                    }
                    self.shared.messages.fetch_add(1, Ordering::Relaxed);
                }
                Ok(RecordingEntry::Close) | Err(RecvTimeoutError::Disconnected) => {
                    return Ok(WriteEnd::Closed);
                }
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
