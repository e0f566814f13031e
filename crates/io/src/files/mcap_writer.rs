//! Writing of MCAP recordings in the format of rosbag2: profile `ros2`, encoding `cdr`, schemas `ros2msg`.

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

/// MCAP profile.
pub(super) const PROFILE: &str = "ros2";
/// Name and version of the writing library.
pub(super) const LIBRARY: &str = concat!("virtual_axes ", env!("CARGO_PKG_VERSION"));
/// Message encoding.
pub(super) const ENCODING: &str = "cdr";
/// Schema encoding.
pub(super) const SCHEMAS: &str = "ros2msg";
/// Channel metadata key of the offered QoS profiles.
pub(super) const QOS_KEY: &str = "offered_qos_profiles";

/// Infinite duration in seconds and nanoseconds: 2^63 - 1 ns.
const INFINITE: &str = "\n    sec: 9223372036\n    nsec: 854775807";

/// Default QoS of recorded topics without a publishing node: reliable, volatile, keep last 10.
pub(super) const DEFAULT_QOS: QosConfig =
    QosConfig { is_reliable: true, is_transient_local: false, depth: 10 };

/// Formats a QoS profile as metadata of rosbag2 since Jazzy, with infinite durations.
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

/// Writer of an MCAP recording, compressed by LZ4.
pub(super) struct McapWriter<W: Write> {
    writer: Writer<NoSeek<W>>,
    /// Buffer of a serialized message.
    bytes: Vec<u8>,
}

impl<W: Write> fmt::Debug for McapWriter<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("McapWriter").finish_non_exhaustive()
    }
}

/// Topic of a recording that is written.
#[derive(Debug)]
pub(super) struct McapTopic {
    channel: u16,
    /// Sequence number of the next message.
    sequence: u32,
}

impl McapTopic {
    fn next_header(&mut self, log_time: u64, publish_time: u64) -> MessageHeader {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        MessageHeader { channel_id: self.channel, sequence, log_time, publish_time }
    }
}

impl<W: Write> McapWriter<W> {
    /// Starts a recording; `output` does not need to be seekable.
    pub fn new(output: W) -> io::Result<Self> {
        Self::with_chunks(output, Some(WriteOptions::DEFAULT_CHUNK_SIZE))
    }

    /// Starts a recording with chunks of `chunk` bytes, or with a chunk per [`flush`](Self::flush) if `None`.
    pub fn with_chunks(output: W, chunk: Option<u64>) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile(PROFILE)
            .library(LIBRARY)
            .disable_seeking(true)
            .chunk_size(chunk)
            .compression(Some(Compression::Lz4));
        let writer = options.create(NoSeek::new(output)).map_err(into_io)?;
        Ok(McapWriter { writer, bytes: Vec::new() })
    }

    /// Adds a topic with its offered QoS profile.
    pub fn topic(&mut self, name: &str, schema: &Schema, qos: QosConfig) -> io::Result<McapTopic> {
        let schema =
            self.writer.add_schema(&schema.name, SCHEMAS, schema.text.as_bytes()).map_err(into_io)?;
        let metadata = BTreeMap::from([(QOS_KEY.to_owned(), qos_text(qos))]);
        let channel = self.writer.add_channel(schema, name, ENCODING, &metadata).map_err(into_io)?;
        Ok(McapTopic { channel, sequence: 0 })
    }

    /// Adds a message with `time` as log time and publish time, ns since the Unix epoch.
    pub fn write(
        &mut self,
        topic: &mut McapTopic,
        time: Nanoseconds,
        message: &impl Serialize,
    ) -> io::Result<()> {
        let Ok(time) = u64::try_from(time) else {
            let text = format!("the time is {time} ns, must not be before the Unix epoch (0 ns)");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        };
        cdr::encode_cdr(message, &mut self.bytes).map_err(io::Error::other)?;
        let header = topic.next_header(time, time);
        self.writer.write_to_known_channel(&header, &self.bytes).map_err(into_io)
    }

    /// Adds a serialized message with log time and publish time in ns since the Unix epoch.
    pub fn write_bytes(
        &mut self,
        topic: &mut McapTopic,
        log: u64,
        publish: u64,
        cdr: &[u8],
    ) -> io::Result<()> {
        let header = topic.next_header(log, publish);
        self.writer.write_to_known_channel(&header, cdr).map_err(into_io)
    }

    /// Closes the chunk and writes it to the output.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(into_io)
    }

    /// Writes the summary and returns the output.
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
