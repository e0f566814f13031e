//! PSEC from MCAP recordings (rosbag2, profile `ros2`): messages `trajectory_msgs/JointTrajectory`.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;

use mcap::io::MessageReader;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, Message};

use super::{cdr, nearest, nearest_name};
use crate::messages;
use crate::messages::trajectory_msgs::msg::JointTrajectory;
use crate::trajectory::{Rejection, Request};
use crate::units::{Nanoseconds, seconds};

/// The type of message that is read.
const TYPE: &str = "trajectory_msgs/msg/JointTrajectory";
/// The encoding that is read.
const ENCODING: &str = "cdr";
/// Longest record, bytes: hours of set-points in one message. A damaged length asks for no more memory.
const LONGEST_RECORD: usize = 256 << 20;
/// Opcode and length before a record.
const RECORD_HEAD: usize = 1 + 8;

/// Why a recording cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// It cannot be opened or read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// The file.
        at: String,
        /// What the operating system says.
        reason: String,
    },
    /// It is not MCAP, or not whole.
    #[error("{at}: not a whole MCAP recording: {reason}")]
    Damaged {
        /// The file.
        at: String,
        /// What the reader says.
        reason: String,
    },
    /// There is no trajectory in it.
    #[error("{at}: there is no message {TYPE}; {}", topics_text(.topics))]
    NoTrajectory {
        /// The file.
        at: String,
        /// The topics with messages.
        topics: Vec<String>,
    },
    /// Several topics carry trajectories.
    #[error("{at}: several topics carry trajectories, {}: name one", .topics.join(", "))]
    SeveralTopics {
        /// The file.
        at: String,
        /// The topics.
        topics: Vec<String>,
    },
    /// The topic that was asked for carries none.
    #[error("{at}: there is no trajectory on {topic}; there are some on {}{}", .topics.join(", "), nearest_name(.nearest))]
    UnknownTopic {
        /// The file.
        at: String,
        /// What was asked for.
        topic: String,
        /// The topics that carry trajectories.
        topics: Vec<String>,
        /// The one that looks most like it.
        nearest: Option<String>,
    },
    /// A message cannot be read.
    #[error("{at}: {reason}")]
    Message {
        /// File, topic, number of the message from 0 and log time.
        at: String,
        /// What is wrong.
        reason: String,
    },
    /// A message that no machine could run.
    #[error("{at}: {rejection}")]
    Rejected {
        /// File, topic, number of the message from 0 and log time.
        at: String,
        /// Why.
        rejection: Rejection,
    },
}

fn topics_text(topics: &[String]) -> String {
    match topics {
        [] => "it holds no message at all".to_owned(),
        topics => format!("there are messages on {}", topics.join(", ")),
    }
}

/// The trajectories of one topic of a recording in the order of their log times, each with its log time
/// in ns.
///
/// The file is read three times and never held: chunks are checked, then the log times are taken down, then
/// messages are handed out as they come. Only those are held that come before an earlier one.
pub struct Trajectories<R> {
    messages: MessageReader<BufReader<R>>,
    name: String,
    topic: String,
    /// Numbers of the messages in the file, in the order of log times.
    order: VecDeque<usize>,
    /// Messages read before their turn, by number.
    early: BTreeMap<usize, Message<'static>>,
    /// Number of the message that is read next.
    next: usize,
}

impl<R> fmt::Debug for Trajectories<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("Trajectories");
        out.field("name", &self.name).field("topic", &self.topic).field("left", &self.order.len());
        out.finish_non_exhaustive()
    }
}

impl Trajectories<File> {
    /// Opens a recording; see [`Trajectories::new`].
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn open(path: &Path, topic: Option<&str>) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|error| unreadable(&name, &error))?;
        Self::new(file, &name, topic)
    }
}

impl<R: Read + Seek> Trajectories<R> {
    /// Reads all of a recording and finds the trajectories, those of `topic` if one is named; `name` is for
    /// messages.
    ///
    /// # Errors
    /// [`RecordingError`] if the recording is damaged, or if there is not exactly one topic with
    /// trajectories and none is named.
    pub fn new(mut input: R, name: &str, topic: Option<&str>) -> Result<Self, RecordingError> {
        check_chunks(&mut input, name)?;
        let mut others = Vec::new();
        let mut found: BTreeMap<String, Vec<u64>> = BTreeMap::new();
        let mut reader = start(input, name)?;
        for message in reader.by_ref() {
            let message = message.map_err(|error| damaged(name, &error))?;
            let topic = &message.channel.topic;
            if is_trajectory(&message) {
                match found.get_mut(topic) {
                    Some(times) => times.push(message.log_time),
                    None => _ = found.insert(topic.clone(), vec![message.log_time]),
                }
            } else if !others.contains(topic) {
                others.push(topic.clone());
            }
        }
        let topics: Vec<String> = found.keys().cloned().collect();
        let at = name.to_owned();
        let topic = match (topic, topics.as_slice()) {
            (_, []) => {
                others.sort();
                return Err(RecordingError::NoTrajectory { at, topics: others });
            }
            (None, [topic]) => topic.clone(),
            (None, _) => return Err(RecordingError::SeveralTopics { at, topics }),
            (Some(topic), _) => topic.to_owned(),
        };
        let Some(times) = found.remove(&topic) else {
            let nearest = nearest(&topic, topics.iter().map(String::as_str));
            return Err(RecordingError::UnknownTopic { at, topic, topics, nearest });
        };
        let mut order: Vec<usize> = (0..times.len()).collect();
        // Stable: messages of one time stay in the order of the file.
        order.sort_by_key(|&number| times[number]);
        Ok(Trajectories {
            messages: start(reader.into_inner().into_inner(), name)?,
            name: at,
            topic,
            order: order.into(),
            early: BTreeMap::new(),
            next: 0,
        })
    }

    /// The topic that they are read from.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// How many are left.
    pub fn remaining(&self) -> usize {
        self.order.len()
    }

    /// Message `number` of the topic, in the order of the file.
    fn message(&mut self, number: usize) -> Result<Message<'static>, RecordingError> {
        if let Some(message) = self.early.remove(&number) {
            return Ok(message);
        }
        for message in self.messages.by_ref() {
            let message = message.map_err(|error| damaged(&self.name, &error))?;
            if message.channel.topic != self.topic || !is_trajectory(&message) {
                continue;
            }
            let found = self.next;
            self.next += 1;
            if found == number {
                return Ok(message);
            }
            self.early.insert(found, message);
        }
        let reason = "it has become shorter while it was read".to_owned();
        Err(RecordingError::Damaged { at: self.name.clone(), reason })
    }

    fn request(
        &self,
        number: usize,
        message: &Message<'_>,
    ) -> Result<(Nanoseconds, Request), RecordingError> {
        let log_time = Nanoseconds::try_from(message.log_time).unwrap_or(Nanoseconds::MAX);
        let at =
            || format!("{}: {}, message {number}, log time {} s", self.name, self.topic, seconds(log_time));
        let encoding = &message.channel.message_encoding;
        if encoding != ENCODING {
            let reason = format!("its encoding is \"{encoding}\", must be \"{ENCODING}\"");
            return Err(RecordingError::Message { at: at(), reason });
        }
        let trajectory: JointTrajectory =
            cdr::decode(&message.data).map_err(|reason| RecordingError::Message { at: at(), reason })?;
        let request = messages::request(&trajectory, usize::MAX)
            .map_err(|rejection| RecordingError::Rejected { at: at(), rejection })?;
        Ok((log_time, request))
    }
}

impl<R: Read + Seek> Iterator for Trajectories<R> {
    type Item = Result<(Nanoseconds, Request), RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        let number = self.order.pop_front()?;
        let found = self.message(number).and_then(|message| self.request(number, &message));
        if found.is_err() {
            self.order.clear();
        }
        Some(found)
    }
}

fn is_trajectory(message: &Message<'_>) -> bool {
    message.channel.schema.as_ref().is_some_and(|schema| schema.name == TYPE)
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_record_length_limit(LONGEST_RECORD).with_validate_chunk_crcs(true)
}

/// From the beginning.
fn start<R: Read + Seek>(mut input: R, name: &str) -> Result<MessageReader<BufReader<R>>, RecordingError> {
    input.rewind().map_err(|error| unreadable(name, &error))?;
    Ok(MessageReader::new_with_options(BufReader::new(input), options()))
}

/// Checks that the records of each chunk that is not compressed fill it, which the reader relies upon.
fn check_chunks<R: Read + Seek>(input: &mut R, name: &str) -> Result<(), RecordingError> {
    input.rewind().map_err(|error| match error.kind() {
        io::ErrorKind::NotSeekable => RecordingError::Unreadable {
            at: name.to_owned(),
            reason: "a recording is read more than once: it must be a file, not a pipe".to_owned(),
        },
        _ => unreadable(name, &error),
    })?;
    let mut input = BufReader::new(input);
    let mut reader = LinearReader::new_with_options(options().with_emit_chunks(true));
    while let Some(event) = reader.next_event() {
        match event.map_err(|error| damaged(name, &error))? {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = loop {
                    match input.read(reader.insert(wanted)) {
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        read => break read.map_err(|error| unreadable(name, &error))?,
                    }
                };
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: op::CHUNK, data } => {
                let record = mcap::parse_record(op::CHUNK, data).map_err(|error| damaged(name, &error))?;
                if let Record::Chunk { header, data } = record
                    && header.compression.is_empty()
                    && !is_filled(&data)
                {
                    return Err(damaged(name, &McapError::UnexpectedEoc));
                }
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(())
}

/// Whether `records` are whole records and nothing else.
fn is_filled(mut records: &[u8]) -> bool {
    while !records.is_empty() {
        let Some((head, rest)) = records.split_first_chunk::<RECORD_HEAD>() else { return false };
        let [_, length @ ..] = head;
        let Some(rest) = usize::try_from(u64::from_le_bytes(*length)).ok().and_then(|l| rest.get(l..)) else {
            return false;
        };
        records = rest;
    }
    true
}

fn unreadable(name: &str, error: &io::Error) -> RecordingError {
    RecordingError::Unreadable { at: name.to_owned(), reason: error.to_string() }
}

/// What the reader says, with what stands behind it.
fn damaged(name: &str, error: &McapError) -> RecordingError {
    let reason = match error {
        McapError::Io(error) => return unreadable(name, error),
        McapError::UnexpectedEof => {
            "it ends in the middle of a record (`mcap recover` saves what there is)".to_owned()
        }
        McapError::Parse(error) => {
            format!("a record cannot be read: {}", super::shortened(&error.to_string()))
        }
        McapError::BadMagic => "it does not begin and end as MCAP does".to_owned(),
        error => error.to_string(),
    };
    RecordingError::Damaged { at: name.to_owned(), reason }
}
