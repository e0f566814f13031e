//! Reading of position setpoints from YAML: messages `trajectory_msgs/JointTrajectory` in the format of
//! `ros2 topic pub` and `ros2 topic echo`.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde_saphyr::Spanned;

use super::error::FileError;
use super::psec_error::extreme_point;
use crate::messages::builtin_interfaces::msg::{Duration, Time};
use crate::messages::std_msgs::msg::Header;
use crate::messages::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};
use crate::messages::{self};
use virtual_axes_core::trajectory::TrajectoryRequest;
use virtual_axes_core::units::Rounded;
use virtual_axes_core::yaml::{self, YamlNumber};

/// Placeholder of `ros2 topic echo` for omitted values.
const ELLIPSIS: &str = "'...'";

/// Reads the trajectories of a YAML text, one per document; missing fields have default values. `file` is the file
/// name in errors.
///
/// # Errors
/// Returns a [`FileError`] for the first error in the text.
pub fn read_psec_yaml(text: &str, file: &str) -> Result<Vec<TrajectoryRequest>, FileError> {
    let documents: Vec<Spanned<Message>> = yaml::documents(text).map_err(|mut error| {
        if text.lines().nth(error.line.saturating_sub(1) as usize).is_some_and(|text| text.contains(ELLIPSIS))
        {
            error.reason += "; use `ros2 topic echo --full-length` to print all values";
        }
        FileError::new(error.position(file), error.reason)
    })?;
    if documents.is_empty() {
        return Err(FileError::new(
            file,
            "the file contains no trajectory, a mapping with joint_names and points",
        ));
    }
    documents
        .into_iter()
        .map(|document| {
            let begin = document.referenced.line();
            let lines: Vec<u64> = document.value.points.iter().map(|p| p.referenced.line()).collect();
            let message = JointTrajectory::from(document.value);
            let at = |index: Option<usize>| {
                let line = index.and_then(|index| lines.get(index).copied());
                yaml::position(file, line.unwrap_or(begin))
            };
            if let Some((index, reason)) = extreme_point(&message) {
                return Err(FileError::new(at(Some(index)), reason));
            }
            messages::request(&message, usize::MAX)
                .map_err(|rejection| FileError::new(at(rejection.index), rejection))
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
    positions: Vec<YamlNumber>,
    velocities: Vec<YamlNumber>,
    accelerations: Vec<YamlNumber>,
    effort: Vec<YamlNumber>,
    time_from_start: TimeFields,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct TimeFields {
    sec: Whole<i32>,
    nanosec: Whole<u32>,
}

/// Integer; the error for any other value names the expected range.
#[derive(Default)]
struct Whole<T>(T);

impl<'de, T: TryFrom<i128> + Bounded> Deserialize<'de> for Whole<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WholeVisitor(PhantomData))
    }
}

/// Integer type with its range for error messages.
trait Bounded {
    const BOUNDS: (i64, i64);
}

impl Bounded for i32 {
    const BOUNDS: (i64, i64) = (i32::MIN as i64, i32::MAX as i64);
}

impl Bounded for u32 {
    const BOUNDS: (i64, i64) = (0, u32::MAX as i64);
}

struct WholeVisitor<T>(PhantomData<T>);

impl<T: TryFrom<i128> + Bounded> Visitor<'_> for WholeVisitor<T> {
    type Value = Whole<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "an integer from {} to {}", T::BOUNDS.0, T::BOUNDS.1)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Whole<T>, E> {
        Err(E::invalid_value(de::Unexpected::Other(&format!("`{}`", Rounded(value))), &self))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Whole<T>, E> {
        let whole = T::try_from(value.into());
        whole.map(Whole).map_err(|_| E::invalid_value(de::Unexpected::Signed(value), &self))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Whole<T>, E> {
        let whole = T::try_from(value.into());
        whole.map(Whole).map_err(|_| E::invalid_value(de::Unexpected::Unsigned(value), &self))
    }
}

/// Header, or `auto` of `ros2 topic pub`, which is read as the default header.
#[derive(Default)]
struct Stamped(HeaderFields);

/// Stamp, or `now` of `ros2 topic pub`, which is read as 0.
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

/// Visitor of a mapping, a keyword or an empty value.
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
            header: Header { stamp: Time { sec: stamp.sec.0, nanosec: stamp.nanosec.0 }, frame_id },
            joint_names: message.joint_names,
            points: message.points.into_iter().map(|point| point.value.into()).collect(),
        }
    }
}

impl From<Point> for JointTrajectoryPoint {
    fn from(point: Point) -> Self {
        let values = |field: Vec<YamlNumber>| field.into_iter().map(|number| number.0).collect();
        let TimeFields { sec, nanosec } = point.time_from_start;
        JointTrajectoryPoint {
            positions: values(point.positions),
            velocities: values(point.velocities),
            accelerations: values(point.accelerations),
            effort: values(point.effort),
            time_from_start: Duration { sec: sec.0, nanosec: nanosec.0 },
        }
    }
}
