//! Errors of the inverse kinematics.

use thiserror::Error;

use super::role::AxisRole;
use crate::units::Rounded;

/// Formats a vector for a message.
fn rounded(vector: &[f64; 3]) -> String {
    let [x, y, z] = vector.map(Rounded);
    format!("[{x}, {y}, {z}]")
}

/// Rejection of a pose by the inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum KinematicsError {
    /// NaN or infinity in the pose or in the reference joints.
    #[error("tip {tip:?} m, tool axis {axis:?} or reference joints are not finite")]
    NotFinite {
        /// Tip, m.
        tip: [f64; 3],
        /// Tool axis.
        axis: [f64; 3],
    },
    /// Tool axis of length zero.
    #[error("tool axis {axis:?} has length 0, must be a unit vector")]
    NoDirection {
        /// Tool axis.
        axis: [f64; 3],
    },
    /// Wrong number of joints.
    #[error("found {found} joints, the machine has {wanted}")]
    WrongSize {
        /// Number of joints found.
        found: usize,
        /// Number of joints of the machine.
        wanted: usize,
    },
    /// Tool axis that requires a missing rotary axis.
    #[error(
        "tool axis {} is unreachable without a rotary axis {missing}; the nearest reachable direction differs by {} deg",
        rounded(.axis), Rounded(.angle.to_degrees())
    )]
    AxisUnreachable {
        /// Tool axis.
        axis: [f64; 3],
        /// Role of the missing joint.
        missing: AxisRole,
        /// Angle to the nearest reachable direction, rad.
        angle: f64,
    },
    /// Tip that requires a missing linear axis.
    #[error(
        "tip {} m is unreachable without a linear axis {missing}, which would be at {} mm",
        rounded(.tip), Rounded(.position * 1e3)
    )]
    TipUnreachable {
        /// Tip, m.
        tip: [f64; 3],
        /// Role of the missing joint.
        missing: AxisRole,
        /// Required position of the missing joint, m.
        position: f64,
    },
}
