//! Why no joints bring the tool to a pose.

use thiserror::Error;

use super::chain::Role;

/// A pose that the machine has no joints for.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum KinematicsError {
    /// NaN or infinity in the pose or in the joints near which the solution is sought.
    #[error("the pose with tip {tip:?} m and tool axis {axis:?}, near given joints, is not finite")]
    NotFinite {
        /// Tip, m.
        tip: [f64; 3],
        /// Tool axis.
        axis: [f64; 3],
    },
    /// A tool axis of length zero.
    #[error("the tool axis {axis:?} has no direction; it must have the length 1")]
    NoDirection {
        /// Tool axis.
        axis: [f64; 3],
    },
    /// The wrong number of joints.
    #[error("{found} joints given, the machine has {wanted}")]
    WrongSize {
        /// Joints given.
        found: usize,
        /// Joints of the machine.
        wanted: usize,
    },
    /// A tool axis that needs a rotary axis which the machine does not have.
    #[error(
        "the tool axis {axis:?} needs a rotary axis {missing}, which the machine does not have: \
         the nearest direction it reaches is {} deg away",
        .angle.to_degrees()
    )]
    AxisUnreachable {
        /// Tool axis.
        axis: [f64; 3],
        /// The joint that is missing.
        missing: Role,
        /// Angle to the nearest direction that can be reached, rad.
        angle: f64,
    },
    /// A tip that needs a linear axis which the machine does not have.
    #[error(
        "the tip {tip:?} m needs a linear axis {missing} at {} mm, and the machine has none (it counts as 0)",
        .position * 1e3
    )]
    TipUnreachable {
        /// Tip, m.
        tip: [f64; 3],
        /// The joint that is missing.
        missing: Role,
        /// Where it would have to be, m.
        position: f64,
    },
}
