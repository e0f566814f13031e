//! PSEC from MCAP recordings (rosbag2, profile `ros2`): messages `trajectory_msgs/JointTrajectory`.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use mcap::Message;

use super::error::{FileError, shorten_names};
use super::mcap_messages::Messages;
use super::mcap_reader::{
    Completeness, check_chunks, damaged, decode, parse_error, read_messages, type_of, unfinished_error,
};
use super::psec_error::extreme_point;
use crate::messages;
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use virtual_axes_core::trajectory::TrajectoryRequest;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Message type of trajectories.
const TYPE: &str = "trajectory_msgs/msg/JointTrajectory";

fn topics_text(topics: &[String]) -> String {
    match topics {
        [] => "the file contains no messages".to_owned(),
        topics => format!("there are messages on {}", topics.join(", ")),
    }
}

/// Iterator over the trajectories of one topic of an MCAP recording in log time order, each with its log time in ns.
///
/// The file is read three times: to check its chunks, to collect the log times, and to return the messages. Only
/// messages that are out of log time order are kept in memory.
pub struct McapTrajectories<R> {
    messages: Messages<BufReader<R>>,
    name: String,
    topic: String,
    /// Message indices of the topic in log time order.
    order: VecDeque<usize>,
    /// Messages that are out of log time order, by index.
    early: BTreeMap<usize, Message<'static>>,
    /// Index of the next message in the file.
    next: usize,
}

impl<R> fmt::Debug for McapTrajectories<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("McapTrajectories");
        out.field("name", &self.name).field("topic", &self.topic).field("remaining", &self.order.len());
        out.finish_non_exhaustive()
    }
}

impl McapTrajectories<File> {
    /// Opens a recording; see [`McapTrajectories::new`].
    ///
    /// # Errors
    /// Returns a [`FileError`] as [`McapTrajectories::new`].
    pub fn open(path: &Path, topic: Option<&str>) -> Result<Self, FileError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|error| FileError::new(&name, error))?;
        Self::new(file, &name, topic)
    }
}

impl<R: Read + Seek> McapTrajectories<R> {
    /// Reads the whole recording and finds the trajectories of `topic`, or of the only topic with trajectories.
    /// `name` is the file name in errors.
    ///
    /// # Errors
    /// Returns a [`FileError`] if the recording is incomplete or damaged, if `topic` has no trajectory,
    /// or if several topics have trajectories and `topic` is `None`.
    pub fn new(mut input: R, name: &str, topic: Option<&str>) -> Result<Self, FileError> {
        if check_chunks(&mut input, name)? == Completeness::Unfinished {
            // The motion would be incomplete.
            return Err(unfinished_error(name));
        }
        let mut others = Vec::new();
        let mut found: BTreeMap<String, Vec<u64>> = BTreeMap::new();
        let mut reader = read_messages(input, name)?;
        for message in reader.by_ref() {
            let message = message.map_err(|error| parse_error(name, &error))?;
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
                let topics = topics_text(&shorten_names(&others));
                return Err(FileError::new(at, format_args!("there is no message {TYPE}; {topics}")));
            }
            (None, [topic]) => topic.clone(),
            (None, _) => {
                let topics = shorten_names(&topics).join(", ");
                let reason = format!("several topics carry trajectories, {topics}: select one by its name");
                return Err(FileError::new(at, reason));
            }
            (Some(topic), _) => topic.to_owned(),
        };
        let Some(times) = found.remove(&topic) else {
            let nearest = nearest_name(&topic, topics.iter().map(String::as_str));
            let reason = format!(
                "there is no trajectory on {}; there are some on {}{}",
                shortened(&topic),
                shorten_names(&topics).join(", "),
                nearest_hint(&nearest)
            );
            return Err(FileError::new(at, reason));
        };
        let mut order: Vec<usize> = (0..times.len()).collect();
        // Stable sort: messages of equal log time stay in file order.
        order.sort_by_key(|&number| times[number]);
        Ok(McapTrajectories {
            messages: read_messages(reader.into_inner().into_inner(), name)?,
            name: at,
            topic,
            order: order.into(),
            early: BTreeMap::new(),
            next: 0,
        })
    }

    /// Returns the topic of the trajectories.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Returns the number of trajectories not yet returned.
    pub fn remaining(&self) -> usize {
        self.order.len()
    }

    /// Returns the message at index `number` of the topic in file order.
    fn message(&mut self, number: usize) -> Result<Message<'static>, FileError> {
        if let Some(message) = self.early.remove(&number) {
            return Ok(message);
        }
        for message in self.messages.by_ref() {
            let message = message.map_err(|error| parse_error(&self.name, &error))?;
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
        Err(damaged(&self.name, "the file was truncated while it was read"))
    }

    fn request(
        &self,
        number: usize,
        message: &Message<'_>,
    ) -> Result<(Nanoseconds, TrajectoryRequest), FileError> {
        let log_time = Nanoseconds::try_from(message.log_time).unwrap_or(Nanoseconds::MAX);
        let at = || {
            format!(
                "{}: {}, message {number}, log time {} s",
                self.name,
                shortened(&self.topic),
                seconds(log_time)
            )
        };
        let trajectory = decode(message).map_err(|reason| FileError::new(at(), reason))?;
        if let Some((_, reason)) = extreme_point(&trajectory) {
            return Err(FileError::new(at(), reason));
        }
        let request = messages::request(&trajectory, usize::MAX)
            .map_err(|rejection| FileError::new(at(), rejection))?;
        Ok((log_time, request))
    }
}

impl<R: Read + Seek> Iterator for McapTrajectories<R> {
    type Item = Result<(Nanoseconds, TrajectoryRequest), FileError>;

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
