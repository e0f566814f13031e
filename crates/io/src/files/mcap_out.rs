//! MCAP recordings as rosbag2 writes them: profile `ros2`, encoding `cdr`, schemas `ros2msg`.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, McapError, WriteOptions, Writer};
use serde::Serialize;

use super::cdr;
use crate::messages::Schema;
use virtual_axes_core::config::QosConfig;
use virtual_axes_core::units::Nanoseconds;

/// How the whole file is to be understood.
pub(super) const PROFILE: &str = "ros2";
/// Who writes it.
pub(super) const LIBRARY: &str = concat!("virtual_axes ", env!("CARGO_PKG_VERSION"));
/// How messages are encoded.
pub(super) const ENCODING: &str = "cdr";
/// How their definitions are written.
pub(super) const SCHEMAS: &str = "ros2msg";
/// Where a channel says what it was offered with.
pub(super) const QOS_KEY: &str = "offered_qos_profiles";

/// The time that stands for none, in seconds and nanoseconds: 2^63 - 1 ns.
const INFINITE: &str = "\n    sec: 9223372036\n    nsec: 854775807";

/// The quality of service of topics that no node offers: reliable, volatile, keep last 10.
pub(super) const USUAL_QOS: QosConfig = QosConfig { is_reliable: true, is_transient_local: false, depth: 10 };

/// What `ros2 bag play` offers a topic with, in the words of rosbag2 since Jazzy; the times are infinite.
pub(super) fn qos_text(qos: QosConfig) -> String {
    let reliability = if qos.is_reliable { "reliable" } else { "best_effort" };
    let durability = if qos.is_transient_local { "transient_local" } else { "volatile" };
    format!(
        "- history: keep_last\n  depth: {}\n  reliability: {reliability}\n  durability: {durability}\n  \
         deadline:{INFINITE}\n  lifespan:{INFINITE}\n  liveliness: automatic\n  \
         liveliness_lease_duration:{INFINITE}\n  avoid_ros_namespace_conventions: false",
        qos.depth
    )
}

/// A recording that is being written.
pub(super) struct Recording<W: Write> {
    writer: Writer<NoSeek<W>>,
    /// A message as bytes.
    bytes: Vec<u8>,
}

impl<W: Write> fmt::Debug for Recording<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recording").finish_non_exhaustive()
    }
}

/// A topic of a recording.
#[derive(Debug)]
pub(super) struct Topic {
    channel: u16,
    /// Number of the next message.
    sequence: u32,
}

impl Topic {
    fn next(&mut self, log_time: u64, publish_time: u64) -> MessageHeader {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        MessageHeader { channel_id: self.channel, sequence, log_time, publish_time }
    }
}

impl<W: Write> Recording<W> {
    /// Begins a recording; `output` need not be able to seek.
    ///
    /// It is compressed by LZ4, three times as fast as zstd for a file that is a seventh longer (traces at each tick):
    /// who computes a trace waits for it.
    pub fn new(output: W) -> io::Result<Self> {
        Self::with_chunks(output, Some(WriteOptions::DEFAULT_CHUNK_SIZE), Compression::Lz4)
    }

    /// Likewise, with chunks that end when they hold `chunk` bytes, or at each [`flush`](Self::flush) only.
    pub fn with_chunks(output: W, chunk: Option<u64>, compression: Compression) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile(PROFILE)
            .library(LIBRARY)
            .disable_seeking(true)
            .chunk_size(chunk)
            .compression(Some(compression))
            // In the thread that writes: the same bytes on each machine.
            .compression_threads(0);
        let writer = options.create(NoSeek::new(output)).map_err(into_io)?;
        Ok(Recording { writer, bytes: Vec::new() })
    }

    /// Adds a topic with the profile that it is offered with.
    pub fn topic(&mut self, name: &str, schema: &Schema, qos: QosConfig) -> io::Result<Topic> {
        let schema =
            self.writer.add_schema(&schema.name, SCHEMAS, schema.text.as_bytes()).map_err(into_io)?;
        let metadata = BTreeMap::from([(QOS_KEY.to_owned(), qos_text(qos))]);
        let channel = self.writer.add_channel(schema, name, ENCODING, &metadata).map_err(into_io)?;
        Ok(Topic { channel, sequence: 0 })
    }

    /// Adds a message that was published and recorded at `time` (ns since the Unix epoch).
    pub fn write(
        &mut self,
        topic: &mut Topic,
        time: Nanoseconds,
        message: &impl Serialize,
    ) -> io::Result<()> {
        let Ok(time) = u64::try_from(time) else {
            let text = format!("{time} ns: a recording has no times before the Unix epoch");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        };
        cdr::encode(message, &mut self.bytes).map_err(io::Error::other)?;
        let header = topic.next(time, time);
        self.writer.write_to_known_channel(&header, &self.bytes).map_err(into_io)
    }

    /// Adds a message that was recorded and published at these times (ns since the Unix epoch).
    pub fn write_bytes(&mut self, topic: &mut Topic, log: u64, publish: u64, cdr: &[u8]) -> io::Result<()> {
        let header = topic.next(log, publish);
        self.writer.write_to_known_channel(&header, cdr).map_err(into_io)
    }

    /// Ends the chunk and hands it over, so that all of it can be read.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(into_io)
    }

    /// Writes the summary and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.writer.finish().map_err(into_io)?;
        Ok(self.writer.into_inner().into_inner())
    }
}

fn into_io(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        error => io::Error::other(error),
    }
}
