//! Deserializes a trajectory message directly into a request.

use std::fmt;

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Duration;
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use serde::de::{DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};

use super::trajectory::{point_time, start};
use virtual_axes_core::trajectory::{Rejection, TrajectoryPoint, TrajectoryRequest};

/// Fields of `trajectory_msgs/JointTrajectory`, in their order.
const MESSAGE_FIELDS: &[&str] = &["header", "joint_names", "points"];
/// Fields of `trajectory_msgs/JointTrajectoryPoint`, in their order.
const POINT_FIELDS: &[&str] = &["positions", "velocities", "accelerations", "effort", "time_from_start"];

/// Deserializes a `trajectory_msgs/JointTrajectory` into a request, or into the rejection of an invalid one.
///
/// The result equals that of [`request`](super::request), without allocation per point. Reading stops at the first
/// invalid field.
#[derive(Debug, Clone, Copy, Default)]
pub struct RequestSeed;

impl<'de> DeserializeSeed<'de> for RequestSeed {
    type Value = Result<TrajectoryRequest, Rejection>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_struct("JointTrajectory", MESSAGE_FIELDS, self)
    }
}

impl<'de> Visitor<'de> for RequestSeed {
    type Value = Result<TrajectoryRequest, Rejection>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JointTrajectory")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> Result<Self::Value, A::Error> {
        let header: Header = required(fields.next_element()?, "header")?;
        let joints: Vec<String> = required(fields.next_element()?, "joint_names")?;
        let start = match start(&header) {
            Ok(start) => start,
            Err(rejection) => return Ok(Err(rejection)),
        };
        let request = TrajectoryRequest::new(start, joints);
        required(fields.next_element_seed(Points(request))?, "points")
    }
}

fn required<T, E: Error>(field: Option<T>, name: &'static str) -> Result<T, E> {
    field.ok_or_else(|| E::missing_field(name))
}

/// Visitor that appends the points to a request.
struct Points(TrajectoryRequest);

impl<'de> DeserializeSeed<'de> for Points {
    type Value = Result<TrajectoryRequest, Rejection>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Points {
    type Value = Result<TrajectoryRequest, Rejection>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("points")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut points: A) -> Result<Self::Value, A::Error> {
        let Points(mut request) = self;
        let mut point = Point::default();
        let mut index = 0;
        while let Some(time) = points.next_element_seed(&mut point)? {
            let row = TrajectoryPoint {
                positions: &point.positions,
                velocities: &point.velocities,
                accelerations: &point.accelerations,
                effort: &point.effort,
            };
            if let Err(rejection) = point_time(&time, index).and_then(|time| request.push(time, row)) {
                return Ok(Err(rejection));
            }
            index += 1;
        }
        Ok(Ok(request))
    }
}

/// Reused buffers of one point; deserializing returns its time.
#[derive(Default)]
struct Point {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    effort: Vec<f64>,
}

impl<'de> DeserializeSeed<'de> for &mut Point {
    type Value = Duration;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Duration, D::Error> {
        deserializer.deserialize_struct("JointTrajectoryPoint", POINT_FIELDS, self)
    }
}

impl<'de> Visitor<'de> for &mut Point {
    type Value = Duration;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JointTrajectoryPoint")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> Result<Duration, A::Error> {
        required(fields.next_element_seed(Values(&mut self.positions))?, "positions")?;
        required(fields.next_element_seed(Values(&mut self.velocities))?, "velocities")?;
        required(fields.next_element_seed(Values(&mut self.accelerations))?, "accelerations")?;
        required(fields.next_element_seed(Values(&mut self.effort))?, "effort")?;
        required(fields.next_element()?, "time_from_start")
    }
}

/// Visitor that overwrites a list.
struct Values<'a>(&'a mut Vec<f64>);

impl<'de> DeserializeSeed<'de> for Values<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Values<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("numbers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<(), A::Error> {
        self.0.clear();
        while let Some(value) = values.next_element()? {
            self.0.push(value);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use byteorder::{BigEndian, ByteOrder, LittleEndian};
    use cdr_encoding::{CdrDeserializer, to_vec};
    use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
    use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};

    use super::*;

    /// Returns the results of the seed and of the conversion of the complete message.
    fn both<O: ByteOrder>(message: &JointTrajectory) -> [Result<TrajectoryRequest, Rejection>; 2] {
        let bytes = to_vec::<_, O>(message).expect("a message");
        let read = RequestSeed.deserialize(&mut CdrDeserializer::<O>::new(&bytes)).expect("complete message");
        [read, super::super::request(message, usize::MAX)]
    }

    fn point(sec: i32, values: [&[f64]; 4]) -> JointTrajectoryPoint {
        let [positions, velocities, accelerations, effort] = values.map(<[f64]>::to_vec);
        let time_from_start = Duration { sec, nanosec: 7 };
        JointTrajectoryPoint { positions, velocities, accelerations, effort, time_from_start }
    }

    fn message() -> JointTrajectory {
        let mut message = JointTrajectory {
            joint_names: vec!["x".into(), "spindle".into()],
            points: vec![
                point(1, [&[0.1, -0.2], &[], &[], &[]]),
                point(2, [&[0.3, 0.4], &[0.5, 0.6], &[], &[1.0, 2.0]]),
                point(3, [&[0.7, 0.8], &[0.9, 1.0], &[1.1, 1.2], &[]]),
                point(4, [&[1.3, 1.4], &[], &[], &[]]),
            ],
            ..JointTrajectory::default()
        };
        // Strings of odd lengths, so that numbers are padded.
        message.header.frame_id = "cell 7".into();
        message.header.stamp = Time { sec: 5, nanosec: 6 };
        message
    }

    #[test]
    fn seed_gives_the_request_of_the_complete_message() {
        let mut without = message();
        without.points.clear();
        for message in [message(), without, JointTrajectory::default()] {
            for [read, whole] in [both::<LittleEndian>(&message), both::<BigEndian>(&message)] {
                assert_eq!(read.expect("a request"), whole.expect("a request"));
            }
        }
    }

    #[test]
    fn seed_gives_the_rejection_of_the_complete_message() {
        type Change = fn(&mut JointTrajectory);
        let changes: [Change; 6] = [
            |message| message.header.stamp.nanosec = 1_000_000_000,
            |message| message.points[1].time_from_start.nanosec = 1_000_000_000,
            |message| message.points[2].accelerations = vec![0.0; 3],
            |message| message.points[3].positions.clear(),
            |message| message.points[1].effort[1] = f64::INFINITY,
            |message| message.joint_names.clear(),
        ];
        for change in changes {
            let mut message = message();
            change(&mut message);
            let [read, whole] = both::<LittleEndian>(&message);
            assert_eq!(read.expect_err("rejected"), whole.expect_err("rejected"));
        }
    }

    #[test]
    fn truncated_message_is_an_error() {
        let bytes = to_vec::<_, LittleEndian>(&message()).expect("a message");
        for length in 0..bytes.len() {
            let mut reader = CdrDeserializer::<LittleEndian>::new(&bytes[..length]);
            assert!(RequestSeed.deserialize(&mut reader).is_err(), "{length} bytes");
        }
    }
}
