//! MCAP recordings of bounded file size, readable up to the last complete chunk at any moment.
//!
//! A message is accepted only if the finished file stays within the bound in the worst case: bytes written, the
//! open chunk at its maximum compressed size, its index, and the summary. Record lengths follow
//! <https://mcap.dev/spec>.

use std::fmt;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::mcap_writer::{ENCODING, McapTopic, McapWriter, QOS_KEY, SCHEMAS, qos_text};
use crate::messages::Schema;
use virtual_axes_core::config::QosConfig;

/// Chunk size, bytes before compression, as in rosbag2.
const CHUNK: u64 = 768 << 10;
/// Record header: opcode and length.
const RECORD: u64 = 1 + 8;
/// Length prefix of a string, an array or a map.
const LENGTH: u64 = 4;
/// Message record without its data: channel, sequence, two times.
const MESSAGE: u64 = RECORD + 2 + 4 + 8 + 8;
/// Message index entry: time and offset in the chunk.
const MESSAGE_INDEX_ENTRY: u64 = 8 + 8;
/// Message index record without its entries: channel, length.
const MESSAGE_INDEX: u64 = RECORD + 2 + LENGTH;
/// Name of the compression in a chunk, `lz4`.
const COMPRESSION: u64 = LENGTH + 3;
/// Chunk record without its records: two times, length, checksum, compression, length.
const CHUNK_HEAD: u64 = RECORD + 8 + 8 + 8 + 4 + COMPRESSION + 8;
/// Chunk index record without its channels: two times, offset, length, a map, length, compression, two lengths.
const CHUNK_INDEX: u64 = RECORD + 8 + 8 + 8 + 8 + LENGTH + 8 + COMPRESSION + 8 + 8;
/// Entry of a channel in a chunk index or in the statistics: channel and a number.
const PER_CHANNEL: u64 = 2 + 8;
/// End of data, footer and magic bytes.
const END: u64 = (RECORD + 4) + (RECORD + 8 + 8 + 4) + 8;
/// Statistics record without its channels: counts, two times, a map.
const STATISTICS: u64 = RECORD + 8 + 2 + 4 + 4 + 4 + 4 + 8 + 8 + LENGTH;
/// Summary offset records of schemas, channels, statistics and chunk indexes.
const OFFSETS: u64 = 4 * (RECORD + 1 + 8 + 8);
/// Maximum constant overhead of LZ4: frame, its end and checksum, bytes.
const COMPRESSED_FRAME: u64 = 128;
/// Input bytes per additional output byte of incompressible data, at least: blocks have a head of 4 bytes.
const COMPRESSED_SHARE: u64 = 256;

/// Topic to record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Name of the topic in the ROS graph.
    pub name: String,
    /// Message type.
    pub schema: Schema,
    /// Offered quality of service.
    pub qos: QosConfig,
}

impl RecordedTopic {
    /// Returns the size of the schema and channel records, bytes.
    fn records(&self) -> u64 {
        let text = |text: &str| LENGTH + text.len() as u64;
        let schema = RECORD + 2 + text(&self.schema.name) + text(SCHEMAS) + text(&self.schema.text);
        let metadata = LENGTH + text(QOS_KEY) + text(&qos_text(self.qos));
        let channel = RECORD + 2 + 2 + text(&self.name) + text(ENCODING) + metadata;
        schema + channel
    }
}

/// Writer that counts the bytes written.
struct CountingWriter<W> {
    output: W,
    count: Arc<AtomicU64>,
}

impl<W: Write> Write for CountingWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.output.write(bytes)?;
        self.count.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

/// MCAP recording of bounded file size.
pub struct BoundedRecording<W: Write> {
    recording: McapWriter<CountingWriter<W>>,
    topics: Vec<McapTopic>,
    bound: u64,
    /// Bytes written to the output.
    count: Arc<AtomicU64>,
    /// Bytes up to the end of the last complete chunk.
    complete_bytes: u64,
    /// Records in the open chunk before compression, bytes.
    open: u64,
    /// Messages in the open chunk.
    messages: u64,
    /// True for each topic with a message in the open chunk.
    present: Vec<bool>,
    /// Size of the summary so far, bytes.
    summary: u64,
}

impl<W: Write> fmt::Debug for BoundedRecording<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("BoundedRecording");
        out.field("bound", &self.bound).field("complete_bytes", &self.complete_bytes).finish_non_exhaustive()
    }
}

impl<W: Write> BoundedRecording<W> {
    /// Starts a recording of at most `bound` bytes; messages refer to `topics` by index.
    ///
    /// # Errors
    /// Returns the errors of the output, and an error if `bound` is too small for a recording without messages.
    pub fn new(output: W, bound: u64, topics: &[RecordedTopic]) -> io::Result<Self> {
        let count = Arc::new(AtomicU64::new(0));
        let counting = CountingWriter { output, count: Arc::clone(&count) };
        let mut writer = McapWriter::with_chunks(counting, None)?;
        let mut open = 0;
        let mut handles = Vec::with_capacity(topics.len());
        for topic in topics {
            handles.push(writer.topic(&topic.name, &topic.schema, topic.qos)?);
            open += topic.records();
        }
        let statistics = STATISTICS + PER_CHANNEL * topics.len() as u64;
        let mut recording = BoundedRecording {
            recording: writer,
            present: vec![false; handles.len()],
            topics: handles,
            bound,
            count,
            complete_bytes: 0,
            open,
            messages: 0,
            summary: open + statistics + OFFSETS + END,
        };
        recording.complete_bytes = recording.written();
        let least = recording.max_finished_bytes();
        if least > bound {
            let text =
                format!("the maximum size of a recording is {bound} bytes, must be at least {least} bytes");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        }
        Ok(recording)
    }

    /// Returns the number of bytes written to the output.
    pub fn written(&self) -> u64 {
        self.count.load(Ordering::Relaxed)
    }

    /// Returns the maximum file size, bytes.
    pub fn bound(&self) -> u64 {
        self.bound
    }

    /// Returns the number of bytes up to the end of the last complete chunk, readable without a summary.
    pub fn complete_bytes(&self) -> u64 {
        self.complete_bytes
    }

    /// Returns the maximum file size if the recording is finished now, bytes.
    fn max_finished_bytes(&self) -> u64 {
        let chunk = CHUNK_HEAD + self.open + self.open / COMPRESSED_SHARE + COMPRESSED_FRAME;
        let index = MESSAGE_INDEX * self.topics.len() as u64 + MESSAGE_INDEX_ENTRY * self.messages;
        let chunk_index = CHUNK_INDEX + PER_CHANNEL * self.topics.len() as u64;
        self.written() + chunk + index + chunk_index + self.summary
    }

    /// Returns true if the finished file stays within its bound after a message of `data` bytes.
    fn fits(&self, data: u64) -> bool {
        let record = MESSAGE + data;
        let more = record + record / COMPRESSED_SHARE + 1 + MESSAGE_INDEX_ENTRY;
        self.max_finished_bytes() + more <= self.bound
    }

    /// Adds a CDR message of the topic at index `topic`, with log time and publish time in ns since the Unix epoch.
    /// Returns false without writing if the file would exceed its bound.
    ///
    /// # Errors
    /// Returns the errors of the output, and an error for an unknown topic. The recording is unusable afterwards.
    pub fn write(&mut self, topic: usize, log: u64, publish: u64, cdr: &[u8]) -> io::Result<bool> {
        let length = cdr.len() as u64;
        if !self.fits(length) {
            // The compressed size of the open chunk is known only after the flush.
            self.flush()?;
            if !self.fits(length) {
                return Ok(false);
            }
        }
        let Some(handle) = self.topics.get_mut(topic) else {
            let text = format!("the topic index is {topic}, must be below {}", self.topics.len());
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        };
        self.recording.write_bytes(handle, log, publish, cdr)?;
        self.open += MESSAGE + length;
        self.messages += 1;
        self.present[topic] = true;
        if self.open >= CHUNK {
            self.flush()?;
        }
        Ok(true)
    }

    /// Writes the open chunk if it contains messages.
    ///
    /// # Errors
    /// Returns the errors of the output. The recording is unusable afterwards.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.messages == 0 {
            return Ok(());
        }
        self.recording.flush()?;
        (self.open, self.messages) = (0, 0);
        let channels = self.present.iter_mut().map(std::mem::take).filter(|present| *present).count();
        self.summary += CHUNK_INDEX + PER_CHANNEL * channels as u64;
        self.complete_bytes = self.written();
        Ok(())
    }

    /// Writes the summary and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        let mut output = self.recording.finish()?.output;
        output.flush()?;
        Ok(output)
    }
}
