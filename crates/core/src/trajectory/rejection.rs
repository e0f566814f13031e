//! Rejection of trajectories: code, joint, point, value, limit and text.

use std::fmt;

use crate::text::{is_control, shortened};

/// Largest length of a text, characters; it can contain names of any length from the received message.
const MAX_TEXT_LENGTH: usize = 500;

/// Code of a rejection; the values are those of the message `TrajectoryResult` and never change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum RejectionCode {
    /// Unknown joint.
    UnknownJoint = 1,
    /// Joint given twice.
    DuplicateJoint = 2,
    /// Array with a wrong number of values.
    WrongSize = 3,
    /// Time of a point not after the time of the previous point.
    TimesNotIncreasing = 4,
    /// Negative time of the first point.
    NegativeTime = 5,
    /// NaN or infinity.
    NotFinite = 6,
    /// Position outside the travel limits.
    OutsideTravelLimits = 7,
    /// First setpoint not reachable from the commanded one within one position cycle.
    Jump = 8,
    /// Speed above Vmax of the axis.
    Speed = 9,
    /// Last point in the past.
    EndedInThePast = 10,
    /// More points than `max_points`.
    TooManyPoints = 11,
    /// Velocity at the last point, which is not allowed by default.
    VelocityAtEnd = 12,
    /// Time outside the range of 64-bit nanoseconds, or an invalid nanosec field.
    InvalidTime = 13,
    /// Queue of a joint full, or too many trajectories or points in total (admission control).
    QueueFull = 14,
    /// Invalid path or goal tolerance.
    InvalidTolerance = 15,
    /// Multi-DOF trajectory or component tolerances, which are not supported.
    MultiDof = 16,
    /// Too many goals at the same time.
    TooManyGoals = 17,
}

impl RejectionCode {
    /// Returns the name of the constant in the message `TrajectoryResult`.
    pub fn name(self) -> &'static str {
        match self {
            RejectionCode::UnknownJoint => "UNKNOWN_JOINT",
            RejectionCode::DuplicateJoint => "DUPLICATE_JOINT",
            RejectionCode::WrongSize => "WRONG_SIZE",
            RejectionCode::TimesNotIncreasing => "TIMES_NOT_INCREASING",
            RejectionCode::NegativeTime => "NEGATIVE_TIME",
            RejectionCode::NotFinite => "NOT_FINITE",
            RejectionCode::OutsideTravelLimits => "OUTSIDE_TRAVEL_LIMITS",
            RejectionCode::Jump => "JUMP",
            RejectionCode::Speed => "SPEED",
            RejectionCode::EndedInThePast => "ENDED_IN_THE_PAST",
            RejectionCode::TooManyPoints => "TOO_MANY_POINTS",
            RejectionCode::VelocityAtEnd => "VELOCITY_AT_END",
            RejectionCode::InvalidTime => "INVALID_TIME",
            RejectionCode::QueueFull => "QUEUE_FULL",
            RejectionCode::InvalidTolerance => "INVALID_TOLERANCE",
            RejectionCode::MultiDof => "MULTI_DOF",
            RejectionCode::TooManyGoals => "TOO_MANY_GOALS",
        }
    }
}

/// Rejection of a trajectory: code, joint, point, value and limit.
///
/// [`fmt::Display`] prints `text`, which names joint, point, value and limit with their units.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejection {
    /// Rejection code.
    pub code: RejectionCode,
    /// Name of the joint concerned, if any.
    pub joint: Option<String>,
    /// Index of the point concerned, if any.
    pub index: Option<usize>,
    /// Value found, in the unit given in `text`; 0 if there is none.
    pub value: f64,
    /// Limit that `value` violates, in the same unit; 0 if there is none.
    pub limit: f64,
    /// Description in one line.
    pub text: String,
}

impl Rejection {
    /// Creates a rejection with `code` and `text`; `text` is truncated and becomes a single line.
    pub fn new(code: RejectionCode, text: impl Into<String>) -> Self {
        let mut text = text.into();
        if let Some((end, _)) = text.char_indices().nth(MAX_TEXT_LENGTH) {
            text.truncate(end);
            text.push('…');
        }
        if text.contains(is_control) {
            text = text.replace(is_control, " ");
        }
        Self { code, joint: None, index: None, value: 0.0, limit: 0.0, text }
    }

    /// Sets the joint; a long name is truncated.
    #[must_use]
    pub fn joint(mut self, name: &str) -> Self {
        self.joint = Some(shortened(name));
        self
    }

    /// Sets the index of the point.
    #[must_use]
    pub fn index(mut self, index: usize) -> Self {
        self.index = Some(index);
        self
    }

    /// Sets the value found and its limit.
    #[must_use]
    pub fn numbers(mut self, value: f64, limit: f64) -> Self {
        self.value = value;
        self.limit = limit;
        self
    }
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl std::error::Error for Rejection {}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint name in a message can be as long as the message and contain line breaks.
    #[test]
    fn a_long_name_is_truncated_in_the_rejection() {
        let name = "x\n[INFO] forged ".repeat(100_000);
        let rejection =
            Rejection::new(RejectionCode::UnknownJoint, format!("unknown joint {name}")).joint(&name);
        let joint = rejection.joint.as_deref().unwrap_or_default();
        assert!(rejection.text.len() < 600 && joint.len() < 600, "{} {}", rejection.text.len(), joint.len());
        assert!(!rejection.text.contains('\n') && !joint.contains('\n'), "{rejection}");
        assert!(rejection.text.starts_with("unknown joint x [INFO] forged"), "{rejection}");
    }
}
