//! PSEC from MCAP recordings (rosbag2, profile `ros2`): messages `trajectory_msgs/JointTrajectory`.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use mcap::Message;

use super::mcap_in::{
    Ending, McapFault, check_chunks, damaged, decode_with, start, type_of, unfinished, unreadable,
};
use super::mcap_messages::Messages;
use super::listed;
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use crate::messages::RequestSeed;
use virtual_axes_core::trajectory::{Rejection, TrajectoryRequest};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// The type of message that is read.
const TYPE: &str = "trajectory_msgs/msg/JointTrajectory";

/// Why a recording cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read, or is not whole.
    #[error(transparent)]
    File(#[from] McapFault),
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
    #[error("{at}: there is no trajectory on {topic}; there are some on {}{}", .topics.join(", "), nearest_hint(.nearest))]
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
    messages: Messages<BufReader<R>>,
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
        if check_chunks(&mut input, name)? == Ending::Unfinished {
            // What was still to come would be left out of the motion.
            return Err(unfinished(name).into());
        }
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
                return Err(RecordingError::NoTrajectory { at, topics: listed(&others) });
            }
            (None, [topic]) => topic.clone(),
            (None, _) => return Err(RecordingError::SeveralTopics { at, topics: listed(&topics) }),
            (Some(topic), _) => topic.to_owned(),
        };
        let Some(times) = found.remove(&topic) else {
            let nearest = nearest_name(&topic, topics.iter().map(String::as_str));
            return Err(RecordingError::UnknownTopic {
                at,
                topic: shortened(&topic),
                topics: listed(&topics),
                nearest,
            });
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
        Err(McapFault::Damaged { at: self.name.clone(), reason }.into())
    }

    fn request(
        &self,
        number: usize,
        message: &Message<'_>,
    ) -> Result<(Nanoseconds, TrajectoryRequest), RecordingError> {
        let log_time = Nanoseconds::try_from(message.log_time).unwrap_or(Nanoseconds::MAX);
        let at = || {
            format!(
                "{}: {}, message {number}, log time {} s",
                self.name,
                shortened(&self.topic),
                seconds(log_time)
            )
        };
        let request = decode_with(RequestSeed, message)
            .map_err(|reason| RecordingError::Message { at: at(), reason })?
            .map_err(|rejection| RecordingError::Rejected { at: at(), rejection })?;
        Ok((log_time, request))
    }
}

impl<R: Read + Seek> Iterator for Trajectories<R> {
    type Item = Result<(Nanoseconds, TrajectoryRequest), RecordingError>;

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
    type_of(message) == Some(TYPE)
}
