//! MCAP recordings as rosbag2 writes them: profile `ros2`, encoding `cdr`, schemas `ros2msg`.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use super::cdr;
use crate::messages::Schema;
use crate::units::Nanoseconds;

/// What `ros2 bag play` offers the topics with: reliable, volatile, keep last 10, in the words of
/// rosbag2 since Jazzy; the times are infinite.
const QOS: &str = "\
- history: keep_last
  depth: 10
  reliability: reliable
  durability: volatile
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false";

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

impl<W: Write> Recording<W> {
    /// Begins a recording; `output` need not be able to seek.
    pub fn new(output: W) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("virtual_axes ", env!("CARGO_PKG_VERSION")))
            .disable_seeking(true)
            // In the thread that writes: the same bytes on each machine.
            .compression_threads(0);
        let writer = options.create(NoSeek::new(output)).map_err(into_io)?;
        Ok(Recording { writer, bytes: Vec::new() })
    }

    /// Adds a topic.
    pub fn topic(&mut self, name: &str, schema: &Schema) -> io::Result<Topic> {
        let schema =
            self.writer.add_schema(&schema.name, "ros2msg", schema.text.as_bytes()).map_err(into_io)?;
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), QOS.to_owned())]);
        let channel = self.writer.add_channel(schema, name, "cdr", &metadata).map_err(into_io)?;
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
        let header = MessageHeader {
            channel_id: topic.channel,
            sequence: topic.sequence,
            log_time: time,
            publish_time: time,
        };
        topic.sequence = topic.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &self.bytes).map_err(into_io)
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
