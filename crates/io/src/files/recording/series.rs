//! Values of one joint from the messages of one topic.

use std::collections::{BTreeMap, BTreeSet};

use mcap::Message;
use serde::Deserialize;

use crate::files::error::FileError;
use crate::files::mcap_reader::decode;
use crate::messages::builtin_interfaces::msg::Time;
use crate::messages::sensor_msgs::msg::JointState;
use crate::messages::std_msgs::msg::Header;
use crate::messages::{DriveStates, MotorCurrents};
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS, seconds};

/// Maximum number of joints in an error message.
const MAX_NAMES: usize = 60;

virtual_axes_core::named_values! {
    /// Message types with values of an axis, with their ROS names.
    #[derive(PartialOrd, Ord)]
    pub(super) enum MessageKind {
        /// Positions, velocities and efforts.
        JointState = "sensor_msgs/msg/JointState",
        /// Currents of the motors.
        MotorCurrents = "virtual_axes/msg/MotorCurrents",
        /// Signals of the drives.
        DriveStates = "virtual_axes/msg/DriveStates",
    }
}

impl MessageKind {
    /// Index of the position in a row.
    pub const POSITION: usize = 0;
    /// Index of the velocity in a row.
    pub const VELOCITY: usize = 1;
    /// Index of the effort in a row of joint states.
    pub const EFFORT: usize = 2;
    /// Index of PSEC in a row of drive states.
    pub const PSEC: usize = 2;
    /// Index of the velocity feedforward in a row of drive states.
    pub const VELOCITY_FEEDFORWARD: usize = 3;
    /// Index of the torque feedforward in a row of drive states.
    pub const TORQUE_FEEDFORWARD: usize = 4;
    /// Index of the wind-up in a row of drive states; NaN in recordings of versions without it.
    pub const WIND_UP: usize = 5;
    /// Index of the current in a row of motor currents.
    pub const CURRENT: usize = 0;

    fn decode(self, message: &Message<'_>) -> Result<Decoded, String> {
        Ok(match self {
            MessageKind::JointState => {
                let m: JointState = decode(message)?;
                let fields = vec![("position", m.position), ("velocity", m.velocity), ("effort", m.effort)];
                Decoded { stamp: m.header.stamp, names: m.name, fields }
            }
            MessageKind::MotorCurrents => {
                let m: MotorCurrents = decode(message)?;
                Decoded { stamp: m.header.stamp, names: m.name, fields: vec![("current", m.current)] }
            }
            MessageKind::DriveStates => {
                // Recordings of earlier versions have no wind-up.
                let wind_up = decode::<DriveStates>(message).map(|m| m.wind_up).unwrap_or_default();
                let m: RecordedDriveStates = decode(message)?;
                let fields = vec![
                    ("position", m.position),
                    ("velocity", m.velocity),
                    ("psec", m.psec),
                    ("velocity_feedforward", m.velocity_feedforward),
                    ("torque_feedforward", m.torque_feedforward),
                    ("wind_up", wind_up),
                ];
                Decoded { stamp: m.header.stamp, names: m.name, fields }
            }
        })
    }
}

/// Fields of `virtual_axes/msg/DriveStates` that recordings of all versions have.
#[allow(dead_code, reason = "the fields in between take their place in a message")]
#[derive(Deserialize)]
struct RecordedDriveStates {
    header: Header,
    name: Vec<String>,
    psec: Vec<f64>,
    position: Vec<f64>,
    tracking_error: Vec<f64>,
    synchronized_tracking_error: Vec<f64>,
    velocity: Vec<f64>,
    velocity_setpoint: Vec<f64>,
    velocity_feedforward: Vec<f64>,
    torque_feedforward: Vec<f64>,
}

/// Decoded message of any kind.
struct Decoded {
    stamp: Time,
    names: Vec<String>,
    /// Field names and values per joint, in the order of a row.
    fields: Vec<(&'static str, Vec<f64>)>,
}

/// Values of one joint in one message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Log time, ns.
    pub log_time: Nanoseconds,
    /// Field `header.stamp`, ns.
    pub stamp: Nanoseconds,
    /// Values at the indices of [`MessageKind`]; NaN if missing.
    pub values: [f64; 6],
}

/// Messages of one type on one topic.
#[derive(Debug)]
pub(super) struct Series {
    pub kind: MessageKind,
    pub topic: String,
    /// Rows of the joints whose names match.
    candidates: BTreeMap<String, Vec<Row>>,
    /// First joint names of the topic, for errors.
    names: BTreeSet<String>,
    messages: u64,
    is_stamped: bool,
}

impl Series {
    pub fn new(kind: MessageKind, topic: &str) -> Self {
        let (candidates, names) = Default::default();
        Series { kind, topic: topic.to_owned(), candidates, names, messages: 0, is_stamped: false }
    }

    /// Adds a message and returns the number of rows added.
    ///
    /// # Errors
    /// Returns an error if the message cannot be decoded.
    pub fn add(
        &mut self,
        message: &Message<'_>,
        file: &str,
        joint: &str,
        is_full_name: bool,
    ) -> Result<usize, FileError> {
        let number = self.messages;
        self.messages += 1;
        let log_time = Nanoseconds::try_from(message.log_time).unwrap_or(Nanoseconds::MAX);
        self.add_rows(message, log_time, joint, is_full_name).map_err(|reason| {
            let (topic, time) = (shortened(&self.topic), seconds(log_time));
            let at = format!("{file}: {topic}, message {number}, log time {time} s");
            FileError::new(at, reason)
        })
    }

    fn add_rows(
        &mut self,
        message: &Message<'_>,
        log_time: Nanoseconds,
        joint: &str,
        is_full_name: bool,
    ) -> Result<usize, String> {
        let Decoded { stamp, names, fields } = self.kind.decode(message)?;
        if i64::from(stamp.nanosec) >= SECOND_NS {
            return Err(format!("header.stamp: nanosec is {}, must be below {SECOND_NS}", stamp.nanosec));
        }
        let stamp = i64::from(stamp.sec) * SECOND_NS + i64::from(stamp.nanosec);
        self.is_stamped |= stamp != 0;
        if let Some((field, values)) = fields.iter().find(|(_, v)| !v.is_empty() && v.len() != names.len()) {
            return Err(format!("{field} has {} values for {} joints", values.len(), names.len()));
        }
        let mut rows = 0;
        for (index, found) in names.iter().enumerate() {
            if self.names.len() < MAX_NAMES && !self.names.contains(found) {
                self.names.insert(found.clone());
            }
            let is_match = found == joint || (!is_full_name && found.ends_with(joint));
            if !is_match || names[..index].contains(found) {
                continue;
            }
            let mut row = Row { log_time, stamp, values: [f64::NAN; 6] };
            for (value, (field, values)) in row.values.iter_mut().zip(&fields) {
                let Some(found) = values.get(index) else { continue };
                if found.is_infinite() {
                    return Err(format!("{field} of {} is {found}", shortened(&names[index])));
                }
                *value = *found;
            }
            match self.candidates.get_mut(found) {
                Some(rows) => rows.push(row),
                None => _ = self.candidates.insert(found.clone(), vec![row]),
            }
            rows += 1;
        }
        Ok(rows)
    }

    /// Returns true if at least one message has a stamp.
    pub fn is_stamped(&self) -> bool {
        self.is_stamped
    }

    /// Returns the full name and the rows of the joint: `preferred` if present, else `joint`, else the only joint
    /// whose name ends in `joint`.
    ///
    /// # Errors
    /// Returns an error if the joint does not exist or is ambiguous.
    pub fn into_rows(
        mut self,
        file: &str,
        joint: &str,
        preferred: Option<&str>,
    ) -> Result<(String, Vec<Row>), FileError> {
        for name in preferred.into_iter().chain([joint]) {
            if let Some(rows) = self.candidates.remove(name) {
                return Ok((name.to_owned(), rows));
            }
        }
        let several = self.candidates.len() > 1;
        if !several && let Some(found) = self.candidates.pop_first() {
            return Ok(found);
        }
        let names: Vec<&String> = if several {
            self.candidates.keys().take(MAX_NAMES).collect()
        } else {
            self.names.iter().collect()
        };
        let (reason, nearest) = match several {
            true => ("several joints end in", None),
            false => ("there is no joint", nearest_name(joint, names.iter().map(|name| name.as_str()))),
        };
        let names: Vec<String> = names.iter().map(|name| shortened(name)).collect();
        Err(FileError::new(
            format_args!("{file}: {}", shortened(&self.topic)),
            format_args!("{reason} {joint}; there are {}{}", names.join(", "), nearest_hint(&nearest)),
        ))
    }
}
