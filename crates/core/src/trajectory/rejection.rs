//! Why a trajectory was refused, with the numbers.

use std::fmt;

use crate::config::{breaks_line, shortened};

/// Longest sentence, characters: what it quotes comes from whoever sent the trajectory, in any length.
const LONGEST_TEXT: usize = 500;

/// Reason of a refusal; the numbers are those of the message `TrajectoryResult` and never change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Code {
    /// A joint that the machine does not have.
    UnknownJoint = 1,
    /// A joint that is named twice.
    DuplicateJoint = 2,
    /// An array with the wrong number of values.
    WrongSize = 3,
    /// A point that is not later than the one before it.
    TimesNotIncreasing = 4,
    /// A first point before the start of its own trajectory.
    NegativeTime = 5,
    /// NaN or infinity.
    NotFinite = 6,
    /// A position beyond the stroke.
    OutsideStroke = 7,
    /// A first setpoint further from the present one than the axis moves in one period.
    Jump = 8,
    /// A speed beyond that of the axis.
    Speed = 9,
    /// A trajectory whose last instant is over.
    EndedInThePast = 10,
    /// More points than allowed.
    TooManyPoints = 11,
    /// A last point that asks for a velocity, which is not allowed by default.
    VelocityAtEnd = 12,
    /// A time that cannot be counted in 64-bit nanoseconds.
    InvalidTime = 13,
    /// Too many trajectories wait for the same joint.
    QueueFull = 14,
    /// A tolerance that cannot be kept to.
    InvalidTolerance = 15,
    /// Joints with several degrees of freedom, which the machine does not have.
    MultiDof = 16,
    /// More goals at once than the node keeps.
    TooManyGoals = 17,
}

impl Code {
    /// Its name in the message `TrajectoryResult`.
    pub fn name(self) -> &'static str {
        match self {
            Code::UnknownJoint => "UNKNOWN_JOINT",
            Code::DuplicateJoint => "DUPLICATE_JOINT",
            Code::WrongSize => "WRONG_SIZE",
            Code::TimesNotIncreasing => "TIMES_NOT_INCREASING",
            Code::NegativeTime => "NEGATIVE_TIME",
            Code::NotFinite => "NOT_FINITE",
            Code::OutsideStroke => "OUTSIDE_STROKE",
            Code::Jump => "JUMP",
            Code::Speed => "SPEED",
            Code::EndedInThePast => "ENDED_IN_THE_PAST",
            Code::TooManyPoints => "TOO_MANY_POINTS",
            Code::VelocityAtEnd => "VELOCITY_AT_END",
            Code::InvalidTime => "INVALID_TIME",
            Code::QueueFull => "QUEUE_FULL",
            Code::InvalidTolerance => "INVALID_TOLERANCE",
            Code::MultiDof => "MULTI_DOF",
            Code::TooManyGoals => "TOO_MANY_GOALS",
        }
    }
}

/// A refused trajectory: what broke which limit, where.
///
/// [`fmt::Display`] prints `text`, which names joint, point, value and limit with their units.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejection {
    /// Reason.
    pub code: Code,
    /// Joint concerned, if it is one.
    pub joint: Option<String>,
    /// Index of the point concerned, if it is one.
    pub index: Option<usize>,
    /// What was found, in the unit that `text` names; 0 where there is no number.
    pub value: f64,
    /// The limit that `value` broke, same unit; 0 where there is no number.
    pub limit: f64,
    /// One sentence for a person.
    pub text: String,
}

impl Rejection {
    /// A refusal with `code` and the sentence `text`, which becomes one line that is not long; the rest is
    /// filled in by the methods below.
    pub fn new(code: Code, text: impl Into<String>) -> Self {
        let mut text = text.into();
        if let Some((end, _)) = text.char_indices().nth(LONGEST_TEXT) {
            text.truncate(end);
            text.push('…');
        }
        if text.contains(breaks_line) {
            text = text.replace(breaks_line, " ");
        }
        Self { code, joint: None, index: None, value: 0.0, limit: 0.0, text }
    }

    /// Names the joint; a name that is too long for one is cut.
    #[must_use]
    pub fn joint(mut self, name: &str) -> Self {
        self.joint = Some(shortened(name));
        self
    }

    /// Names the point.
    #[must_use]
    pub fn index(mut self, index: usize) -> Self {
        self.index = Some(index);
        self
    }

    /// Gives what was found and what is allowed.
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

    /// A joint's name in a message can be as long as the message, and hold line ends.
    #[test]
    fn a_name_without_end_does_not_come_back_in_the_refusal() {
        let name = "x\n[INFO] forged ".repeat(100_000);
        let rejection = Rejection::new(Code::UnknownJoint, format!("unknown joint {name}")).joint(&name);
        let joint = rejection.joint.as_deref().unwrap_or_default();
        assert!(rejection.text.len() < 600 && joint.len() < 600, "{} {}", rejection.text.len(), joint.len());
        assert!(!rejection.text.contains('\n') && !joint.contains('\n'), "{rejection}");
        assert!(rejection.text.starts_with("unknown joint x [INFO] forged"), "{rejection}");
    }
}
