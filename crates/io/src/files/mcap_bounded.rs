//! MCAP recordings of many topics that never grow beyond a bound, and that can be read up to their last
//! chunk at any moment.
//!
//! Before a message is taken in it is known that the file would still end within its bound: what has been
//! written, the open chunk as long as compression could leave it, its index, and the summary. The lengths
//! are those of <https://mcap.dev/spec>.

use std::fmt;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::Compression;

use super::mcap_out::{ENCODING, QOS_KEY, Recording, SCHEMAS, Topic, qos_text};
use crate::messages::Schema;
use virtual_axes_core::config::QosConfig;

/// Length at which a chunk ends, bytes before compression: as in the files of rosbag2.
const CHUNK: u64 = 768 << 10;
/// Opcode and length before each record.
const RECORD: u64 = 1 + 8;
/// Length before a text, an array or a map.
const LENGTH: u64 = 4;
/// A message without its data: channel, sequence, two times.
const MESSAGE: u64 = RECORD + 2 + 4 + 8 + 8;
/// Where a message stands in its chunk: a time and an offset.
const MESSAGE_INDEX_ENTRY: u64 = 8 + 8;
/// The index of a channel in a chunk without its entries: channel, length.
const MESSAGE_INDEX: u64 = RECORD + 2 + LENGTH;
/// The name of the compression in a chunk, `zstd`.
const COMPRESSION: u64 = LENGTH + 4;
/// A chunk without its records: two times, length, checksum, compression, length.
const CHUNK_HEAD: u64 = RECORD + 8 + 8 + 8 + 4 + COMPRESSION + 8;
/// The index of a chunk without its channels: two times, offset, length, a map, length, compression, two lengths.
const CHUNK_INDEX: u64 = RECORD + 8 + 8 + 8 + 8 + LENGTH + 8 + COMPRESSION + 8 + 8;
/// A channel in the index of a chunk, and in the statistics: channel and a number.
const PER_CHANNEL: u64 = 2 + 8;
/// End of data, footer and magic.
const END: u64 = (RECORD + 4) + (RECORD + 8 + 8 + 4) + 8;
/// Statistics without their channels: five counts, two times, a map.
const STATISTICS: u64 = RECORD + 8 + 2 + 4 + 4 + 4 + 4 + 8 + 8 + LENGTH;
/// Where schemas, channels, statistics and indexes of chunks stand in the summary.
const OFFSETS: u64 = 4 * (RECORD + 1 + 8 + 8);
/// What zstd adds at most, whatever it is given: frame, checksum and last block,
const COMPRESSED_FRAME: u64 = 128;
/// and beside that a byte in so many (`ZSTD_compressBound`: one in 256).
const COMPRESSED_SHARE: u64 = 256;

/// A topic to record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Its name in the graph.
    pub name: String,
    /// The type of its messages.
    pub schema: Schema,
    /// What it is offered with.
    pub qos: QosConfig,
}

impl RecordedTopic {
    /// The records of schema and channel, bytes.
    fn records(&self) -> u64 {
        let text = |text: &str| LENGTH + text.len() as u64;
        let schema = RECORD + 2 + text(&self.schema.name) + text(SCHEMAS) + text(&self.schema.text);
        let metadata = LENGTH + text(QOS_KEY) + text(&qos_text(self.qos));
        let channel = RECORD + 2 + 2 + text(&self.name) + text(ENCODING) + metadata;
        schema + channel
    }
}

/// Counts what passes.
struct Counting<W> {
    output: W,
    count: Arc<AtomicU64>,
}

impl<W: Write> Write for Counting<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.output.write(bytes)?;
        self.count.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

/// A recording of at most so many bytes, whole as soon as it is finished.
pub struct BoundedRecording<W: Write> {
    recording: Recording<Counting<W>>,
    topics: Vec<Topic>,
    bound: u64,
    /// Bytes that have been handed over.
    count: Arc<AtomicU64>,
    /// Bytes up to the end of the last whole chunk.
    whole: u64,
    /// Bytes of records in the open chunk before compression.
    open: u64,
    /// Messages in the open chunk.
    messages: u64,
    /// Which topics they are of.
    present: Vec<bool>,
    /// Bytes of the summary so far.
    summary: u64,
}

impl<W: Write> fmt::Debug for BoundedRecording<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("BoundedRecording");
        out.field("bound", &self.bound).field("whole", &self.whole).finish_non_exhaustive()
    }
}

impl<W: Write> BoundedRecording<W> {
    /// Begins a recording of at most `bound` bytes; messages name `topics` by their places.
    ///
    /// # Errors
    /// Those of the output; a bound that is too small for a recording without a message.
    pub fn new(output: W, bound: u64, topics: &[RecordedTopic]) -> io::Result<Self> {
        let count = Arc::new(AtomicU64::new(0));
        let counting = Counting { output, count: Arc::clone(&count) };
        let mut recording = Recording::with_chunks(counting, None, Compression::Zstd)?;
        let mut open = 0;
        let mut handles = Vec::with_capacity(topics.len());
        for topic in topics {
            handles.push(recording.topic(&topic.name, &topic.schema, topic.qos)?);
            open += topic.records();
        }
        let statistics = STATISTICS + PER_CHANNEL * topics.len() as u64;
        let mut begun = BoundedRecording {
            recording,
            present: vec![false; handles.len()],
            topics: handles,
            bound,
            count,
            whole: 0,
            open,
            messages: 0,
            summary: open + statistics + OFFSETS + END,
        };
        begun.whole = begun.written();
        let least = begun.longest();
        if least > bound {
            let text = format!("{bound} bytes are too few for a recording, it needs {least}");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        }
        Ok(begun)
    }

    /// Bytes that have been handed over.
    pub fn written(&self) -> u64 {
        self.count.load(Ordering::Relaxed)
    }

    /// The most bytes that there will ever be.
    pub fn bound(&self) -> u64 {
        self.bound
    }

    /// Bytes up to the end of the last whole chunk: what can be read even if nothing follows.
    pub fn whole(&self) -> u64 {
        self.whole
    }

    /// The longest that the file can be if it is finished now.
    fn longest(&self) -> u64 {
        let chunk = CHUNK_HEAD + self.open + self.open / COMPRESSED_SHARE + COMPRESSED_FRAME;
        let index = MESSAGE_INDEX * self.topics.len() as u64 + MESSAGE_INDEX_ENTRY * self.messages;
        let chunk_index = CHUNK_INDEX + PER_CHANNEL * self.topics.len() as u64;
        self.written() + chunk + index + chunk_index + self.summary
    }

    /// Whether a message of so many bytes would surely leave the file within its bound.
    fn fits(&self, data: u64) -> bool {
        let record = MESSAGE + data;
        let more = record + record / COMPRESSED_SHARE + 1 + MESSAGE_INDEX_ENTRY;
        self.longest() + more <= self.bound
    }

    /// Adds a message (CDR) of the topic at place `topic`, recorded and published at these times (ns since the
    /// Unix epoch), unless the file would become too long: then it is `false`, and the file stays as it is.
    ///
    /// # Errors
    /// Those of the output; a topic that is not there. Nothing more can be written then.
    pub fn write(&mut self, topic: usize, log: u64, publish: u64, cdr: &[u8]) -> io::Result<bool> {
        let length = cdr.len() as u64;
        if !self.fits(length) {
            // How long the open chunk really becomes is known once it is compressed.
            self.flush()?;
            if !self.fits(length) {
                return Ok(false);
            }
        }
        let Some(handle) = self.topics.get_mut(topic) else {
            let text = format!("topic {topic} of {}", self.topics.len());
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

    /// Hands everything over as a whole chunk, if there are messages that have not been.
    ///
    /// # Errors
    /// Those of the output; nothing more can be written then.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.messages == 0 {
            return Ok(());
        }
        self.recording.flush()?;
        (self.open, self.messages) = (0, 0);
        let channels = self.present.iter_mut().map(std::mem::take).filter(|present| *present).count();
        self.summary += CHUNK_INDEX + PER_CHANNEL * channels as u64;
        self.whole = self.written();
        Ok(())
    }

    /// Writes the summary and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        let mut output = self.recording.finish()?.output;
        output.flush()?;
        Ok(output)
    }
}
