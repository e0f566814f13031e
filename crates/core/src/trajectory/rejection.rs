//! Rejection of trajectories: code, joint, point, value, limit and text.

use std::fmt;

use crate::text::{is_control, shortened};

/// Largest length of a text, characters; it can contain names of any length from the received message.
const MAX_TEXT_LENGTH: usize = 500;

/// Defines the codes, each with the number and name of the message `TrajectoryResult` and its meaning.
macro_rules! rejection_codes {
    ($($variant:ident = $code:literal, $name:literal, $meaning:literal;)*) => {
        /// Code of a rejection; the values are those of the message `TrajectoryResult` and never change.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum RejectionCode {
            $(#[doc = concat!("`", $name, "`: ", $meaning, ".")] $variant = $code,)*
        }

        impl RejectionCode {
            /// All codes.
            pub const ALL: &[RejectionCode] = &[$(RejectionCode::$variant),*];

            /// Returns the name of the constant in the message `TrajectoryResult`.
            pub fn name(self) -> &'static str {
                match self {
                    $(RejectionCode::$variant => $name,)*
                }
            }

            /// Returns the reason for a rejection with this code.
            pub fn meaning(self) -> &'static str {
                match self {
                    $(RejectionCode::$variant => $meaning,)*
                }
            }
        }
    };
}

rejection_codes! {
    UnknownJoint = 1, "UNKNOWN_JOINT", "a joint that the machine does not have";
    DuplicateJoint = 2, "DUPLICATE_JOINT", "a joint that is given twice";
    WrongSize = 3, "WRONG_SIZE",
        "a point without a position for each joint; velocities or accelerations that are neither none nor one per \
         joint; accelerations without velocities";
    TimesNotIncreasing = 4, "TIMES_NOT_INCREASING",
        "the `time_from_start` of a point is not after that of the previous point";
    NegativeTime = 5, "NEGATIVE_TIME", "the `time_from_start` of the first point is negative";
    NotFinite = 6, "NOT_FINITE", "NaN or infinity";
    OutsideTravelLimits = 7, "OUTSIDE_TRAVEL_LIMITS",
        "a point, or the path between two points, is outside the travel limits";
    Jump = 8, "JUMP", "the first setpoint is further than Vmax·Tsp from the previous one";
    Speed = 9, "SPEED", "faster than Vmax of the axis";
    EndedInThePast = 10, "ENDED_IN_THE_PAST", "the last point is in the past";
    TooManyPoints = 11, "TOO_MANY_POINTS", "more points than `max_points`";
    VelocityAtEnd = 12, "VELOCITY_AT_END",
        "the last velocity exceeds 1e-6 m/s or rad/s, and `allow_nonzero_velocity_at_trajectory_end` is false";
    InvalidTime = 13, "INVALID_TIME", "a time outside the range of 64-bit nanoseconds, an invalid `nanosec` field, or a start more than 100 h ahead";
    QueueFull = 14, "QUEUE_FULL",
        "1024 trajectories wait for the same joint, or 64 for the first `/clock`; or 8192 trajectories, or \
         4 × `max_points` points, are active or waiting in all";
    InvalidTolerance = 15, "INVALID_TOLERANCE", "of a goal: an invalid path or goal tolerance";
    MultiDof = 16, "MULTI_DOF",
        "of a goal: a multi-DOF trajectory or component tolerances, which are not supported";
    TooManyGoals = 17, "TOO_MANY_GOALS", "of a goal: 1024 goals are active";
    NotActive = 18, "NOT_ACTIVE", "the node runs with `--lifecycle` and is not in the state active";
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

    /// Returns the rejection with the index of the point increased by `count`, the number of points before the trajectory
    /// in its source.
    #[must_use]
    pub fn behind(mut self, count: usize) -> Self {
        if let Some(index) = &mut self.index {
            let [here, there] = [*index, *index + count].map(|index| format!(", point {index}:"));
            *index += count;
            self.text = self.text.replacen(&here, &there, 1);
        }
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
