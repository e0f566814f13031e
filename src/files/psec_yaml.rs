//! PSEC from YAML: messages `trajectory_msgs/JointTrajectory` as `ros2 topic pub` takes them and
//! `ros2 topic echo` prints them.

use std::fmt;

use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde_saphyr::Spanned;

use super::yaml;
use crate::messages::builtin_interfaces::msg::{Duration, Time};
use crate::messages::std_msgs::msg::Header;
use crate::messages::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};
use crate::messages::{self};
use crate::trajectory::{Rejection, Request};

/// What `ros2 topic echo` prints in place of what it leaves out.
const LEFT_OUT: &str = "'...'";

/// Why YAML is not set-points; each names the file, and the line where there is one.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrajectoryYamlError {
    /// Not YAML, or not a message.
    #[error("{at}: {reason}")]
    Syntax {
        /// File and line.
        at: String,
        /// What the reader says.
        reason: String,
    },
    /// A message that no machine could run.
    #[error("{at}: {rejection}")]
    Rejected {
        /// File and line.
        at: String,
        /// Why.
        rejection: Rejection,
    },
    /// There is no message.
    #[error("{at}: there is no trajectory; it is a mapping with joint_names and points")]
    Empty {
        /// The file.
        at: String,
    },
}

/// The trajectories of a text, one per document; fields that are missing have their defaults. `file` is
/// for messages.
///
/// # Errors
/// [`TrajectoryYamlError`], the first fault.
pub fn read_psec_yaml(text: &str, file: &str) -> Result<Vec<Request>, TrajectoryYamlError> {
    let at = |line: u64| if line > 0 { format!("{file}:{line}") } else { file.to_owned() };
    let documents: Vec<Spanned<Message>> = yaml::documents(text).map_err(|(line, mut reason)| {
        if text.lines().nth(line.saturating_sub(1) as usize).is_some_and(|text| text.contains(LEFT_OUT)) {
            reason += "; `ros2 topic echo --full-length` leaves nothing out";
        }
        TrajectoryYamlError::Syntax { at: at(line), reason }
    })?;
    if documents.is_empty() {
        return Err(TrajectoryYamlError::Empty { at: file.to_owned() });
    }
    documents
        .into_iter()
        .map(|document| {
            let begin = document.referenced.line();
            let lines: Vec<u64> = document.value.points.iter().map(|p| p.referenced.line()).collect();
            let message = JointTrajectory::from(document.value);
            messages::request(&message, usize::MAX).map_err(|rejection| {
                let line = rejection.index.and_then(|index| lines.get(index).copied());
                TrajectoryYamlError::Rejected { at: at(line.unwrap_or(begin)), rejection }
            })
        })
        .collect()
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Message {
    header: Stamped,
    joint_names: Vec<String>,
    points: Vec<Spanned<Point>>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct HeaderFields {
    stamp: Stamp,
    frame_id: String,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Point {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    effort: Vec<f64>,
    time_from_start: TimeFields,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct TimeFields {
    sec: i32,
    nanosec: u32,
}

/// A header, or `auto`, which `ros2 topic pub` fills in: here it is the default.
#[derive(Default)]
struct Stamped(HeaderFields);

/// A stamp, or `now`, likewise.
#[derive(Default)]
struct Stamp(TimeFields);

impl<'de> Deserialize<'de> for Stamped {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WordOr { word: "auto", build: Stamped })
    }
}

impl<'de> Deserialize<'de> for Stamp {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WordOr { word: "now", build: Stamp })
    }
}

/// A mapping, or a word or nothing in its place.
struct WordOr<F, T> {
    word: &'static str,
    build: fn(F) -> T,
}

impl<'de, F: Deserialize<'de> + Default, T> Visitor<'de> for WordOr<F, T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a mapping or `{}`", self.word)
    }

    fn visit_unit<E>(self) -> Result<T, E> {
        Ok((self.build)(F::default()))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
        match text == self.word {
            true => self.visit_unit(),
            false => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        F::deserialize(MapAccessDeserializer::new(map)).map(self.build)
    }
}

impl From<Message> for JointTrajectory {
    fn from(message: Message) -> Self {
        let HeaderFields { stamp: Stamp(stamp), frame_id } = message.header.0;
        JointTrajectory {
            header: Header { stamp: Time { sec: stamp.sec, nanosec: stamp.nanosec }, frame_id },
            joint_names: message.joint_names,
            points: message.points.into_iter().map(|point| point.value.into()).collect(),
        }
    }
}

impl From<Point> for JointTrajectoryPoint {
    fn from(point: Point) -> Self {
        let TimeFields { sec, nanosec } = point.time_from_start;
        JointTrajectoryPoint {
            positions: point.positions,
            velocities: point.velocities,
            accelerations: point.accelerations,
            effort: point.effort,
            time_from_start: Duration { sec, nanosec },
        }
    }
}
