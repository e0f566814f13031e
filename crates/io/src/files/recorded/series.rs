//! What the messages of one topic say of one joint.

use std::collections::{BTreeMap, BTreeSet};

use mcap::Message;

use super::error::AxisRecordingError;
use crate::files::mcap_in::decode;
use virtual_axes_core::text::{nearest_name, shortened};
use crate::messages::builtin_interfaces::msg::Time;
use crate::messages::sensor_msgs::msg::JointState;
use crate::messages::{DriveStates, MotorCurrents};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS, seconds};

/// Most joints that a message about an unknown one lists.
const MOST_NAMES: usize = 60;

/// A type of message that is of use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// `sensor_msgs/msg/JointState`.
    JointState,
    /// `virtual_axes/msg/MotorCurrents`.
    MotorCurrents,
    /// `virtual_axes/msg/DriveStates`.
    DriveStates,
}

impl Kind {
    /// Places in a row.
    pub const POSITION: usize = 0;
    pub const VELOCITY: usize = 1;
    pub const EFFORT: usize = 2;
    pub const PSEC: usize = 2;
    pub const VELOCITY_FEEDFORWARD: usize = 3;
    pub const TORQUE_FEEDFORWARD: usize = 4;
    pub const CURRENT: usize = 0;

    /// Name of the type.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::JointState => "sensor_msgs/msg/JointState",
            Kind::MotorCurrents => "virtual_axes/msg/MotorCurrents",
            Kind::DriveStates => "virtual_axes/msg/DriveStates",
        }
    }

    /// The one of this name.
    pub fn named(name: &str) -> Option<Self> {
        [Kind::JointState, Kind::MotorCurrents, Kind::DriveStates].into_iter().find(|k| k.name() == name)
    }

    fn decode(self, message: &Message<'_>) -> Result<Decoded, String> {
        Ok(match self {
            Kind::JointState => {
                let m: JointState = decode(message)?;
                let fields = vec![("position", m.position), ("velocity", m.velocity), ("effort", m.effort)];
                Decoded { stamp: m.header.stamp, names: m.name, fields }
            }
            Kind::MotorCurrents => {
                let m: MotorCurrents = decode(message)?;
                Decoded { stamp: m.header.stamp, names: m.name, fields: vec![("current", m.current)] }
            }
            Kind::DriveStates => {
                let m: DriveStates = decode(message)?;
                let fields = vec![
                    ("position", m.position),
                    ("velocity", m.velocity),
                    ("psec", m.psec),
                    ("velocity_feedforward", m.velocity_feedforward),
                    ("torque_feedforward", m.torque_feedforward),
                ];
                Decoded { stamp: m.header.stamp, names: m.name, fields }
            }
        })
    }
}

/// A message, whatever its type.
struct Decoded {
    stamp: Time,
    names: Vec<String>,
    /// Names and values, in the order of the places in a row.
    fields: Vec<(&'static str, Vec<f64>)>,
}

/// One joint in one message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// ns.
    pub log_time: Nanoseconds,
    /// `header.stamp`, ns.
    pub stamp: Nanoseconds,
    /// Values at the places that [`Kind`] names, NaN where there are none.
    pub values: [f64; 5],
}

/// The messages of one type on one topic.
#[derive(Debug)]
pub(super) struct Series {
    pub kind: Kind,
    pub topic: String,
    /// Joints that can be the one, with what is said of them.
    candidates: BTreeMap<String, Vec<Row>>,
    /// The first of the joints that there are.
    names: BTreeSet<String>,
    messages: u64,
    stamped: bool,
}

impl Series {
    pub fn new(kind: Kind, topic: &str) -> Self {
        let (candidates, names) = Default::default();
        Series { kind, topic: topic.to_owned(), candidates, names, messages: 0, stamped: false }
    }

    /// Takes a message in; how many rows it gave.
    ///
    /// # Errors
    /// [`AxisRecordingError::Message`].
    pub fn add(
        &mut self,
        message: &Message<'_>,
        file: &str,
        joint: &str,
        is_whole: bool,
    ) -> Result<usize, AxisRecordingError> {
        let number = self.messages;
        self.messages += 1;
        let log_time = Nanoseconds::try_from(message.log_time).unwrap_or(Nanoseconds::MAX);
        self.take(message, log_time, joint, is_whole).map_err(|reason| AxisRecordingError::Message {
            at: format!(
                "{file}: {}, message {number}, log time {} s",
                shortened(&self.topic),
                seconds(log_time)
            ),
            reason,
        })
    }

    fn take(
        &mut self,
        message: &Message<'_>,
        log_time: Nanoseconds,
        joint: &str,
        is_whole: bool,
    ) -> Result<usize, String> {
        let Decoded { stamp, names, fields } = self.kind.decode(message)?;
        if i64::from(stamp.nanosec) >= SECOND_NS {
            return Err(format!("header.stamp: nanosec is {}, must be below {SECOND_NS}", stamp.nanosec));
        }
        let stamp = i64::from(stamp.sec) * SECOND_NS + i64::from(stamp.nanosec);
        self.stamped |= stamp != 0;
        if let Some((field, values)) = fields.iter().find(|(_, v)| !v.is_empty() && v.len() != names.len()) {
            return Err(format!("{field} has {} values for {} joints", values.len(), names.len()));
        }
        let mut rows = 0;
        for (place, found) in names.iter().enumerate() {
            if self.names.len() < MOST_NAMES && !self.names.contains(found) {
                self.names.insert(found.clone());
            }
            let is_meant = found == joint || (!is_whole && found.ends_with(joint));
            if !is_meant || names[..place].contains(found) {
                continue;
            }
            let mut row = Row { log_time, stamp, values: [f64::NAN; 5] };
            for (value, (field, values)) in row.values.iter_mut().zip(&fields) {
                let Some(found) = values.get(place) else { continue };
                if found.is_infinite() {
                    return Err(format!("{field} of {} is {found}", shortened(&names[place])));
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

    /// Whether some message has a stamp.
    pub fn is_stamped(&self) -> bool {
        self.stamped
    }

    /// The rows of the joint and its whole name: `alike` if that is there, `joint` itself, or the only one
    /// that ends so.
    ///
    /// # Errors
    /// [`AxisRecordingError::Joint`].
    pub fn into_rows(
        mut self,
        file: &str,
        joint: &str,
        alike: Option<&str>,
    ) -> Result<(String, Vec<Row>), AxisRecordingError> {
        for name in alike.into_iter().chain([joint]) {
            if let Some(rows) = self.candidates.remove(name) {
                return Ok((name.to_owned(), rows));
            }
        }
        let several = self.candidates.len() > 1;
        if !several && let Some(found) = self.candidates.pop_first() {
            return Ok(found);
        }
        let names: Vec<&String> = if several {
            self.candidates.keys().take(MOST_NAMES).collect()
        } else {
            self.names.iter().collect()
        };
        let (reason, nearest) = match several {
            true => ("several joints end in", None),
            false => ("there is no joint", nearest_name(joint, names.iter().map(|name| name.as_str()))),
        };
        Err(AxisRecordingError::Joint {
            at: format!("{file}: {}", shortened(&self.topic)),
            reason,
            joint: joint.to_owned(),
            joints: names.iter().map(|name| shortened(name)).collect(),
            nearest,
        })
    }
}
