//! Errors of paths and feed planning.

use thiserror::Error;

use crate::units::{Rounded, speed_text, velocity_limit_key};

crate::named_values! {
    /// A derivative of the setpoint with a limit.
    pub enum SetpointDerivative {
        /// Speed, m/s or rad/s.
        Speed = "speed",
        /// Acceleration, m/s² or rad/s².
        Acceleration = "acceleration",
        /// Jerk, m/s³ or rad/s³.
        Jerk = "jerk",
    }
}

impl SetpointDerivative {
    /// Returns the denominator of its unit.
    fn per_time(self) -> &'static str {
        match self {
            Self::Speed => "s",
            Self::Acceleration => "s²",
            Self::Jerk => "s³",
        }
    }
}

/// An invalid path. Coordinates and points are counted from 1; values are in m or rad.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PathError {
    /// Path without blocks.
    #[error("a path needs at least one block")]
    Empty,
    /// Number of coordinates different from the number of joints.
    #[error("{what} has {found} coordinates; there are {wanted} joints")]
    WrongSize {
        /// Point with the wrong size.
        what: &'static str,
        /// Number of coordinates found.
        found: usize,
        /// Number of joints.
        wanted: usize,
    },
    /// NaN or infinite coordinate.
    #[error("{what}, coordinate {coordinate}: {value} is not a finite number")]
    NotFinite {
        /// Point with the coordinate.
        what: &'static str,
        /// Coordinate, counted from 1.
        coordinate: usize,
        /// Value found.
        value: f64,
    },
    /// Block without motion.
    #[error("the block starts and ends at the same point and has length 0")]
    ZeroLength,
    /// Length, or slope along it, outside the range of floating-point numbers.
    #[error("the length {length} is outside the range of floating-point computation")]
    NotComputable {
        /// Length found, m or rad.
        length: f64,
    },
    /// Arc plane that is not two different linear coordinates.
    #[error(
        "the plane of an arc needs two different linear coordinates out of {joints}; found {first} and {second}"
    )]
    InvalidPlane {
        /// First coordinate, counted from 1.
        first: usize,
        /// Second coordinate, counted from 1.
        second: usize,
        /// Number of joints.
        joints: usize,
    },
    /// Arc with radius 0.
    #[error("the arc starts at its center, {center:?} m; its radius must be larger than 0")]
    ZeroRadius {
        /// Center, m.
        center: [f64; 2],
    },
    /// Arc with sweep 0 or not finite.
    #[error("the sweep of an arc must be finite and not 0; found {sweep} rad")]
    InvalidSweep {
        /// Sweep found, rad.
        sweep: f64,
    },
    /// Spline with too few control points.
    #[error("a cubic spline needs at least {needed} control points after its start; found {found}")]
    TooFewPoints {
        /// Number of points found after the start.
        found: usize,
        /// Smallest number of points.
        needed: usize,
    },
    /// Spline with a cusp, where its tangent vanishes.
    #[error("the spline has a cusp in piece {piece} of {pieces}: control points coincide or fold back there")]
    Cusp {
        /// Piece, counted from 1.
        piece: usize,
        /// Number of pieces.
        pieces: usize,
    },
    /// Gap between two blocks.
    #[error(
        "block {block} starts at {start}, coordinate {coordinate}, where the block before it ends at \
         {end}: the path must not have gaps"
    )]
    Gap {
        /// Block after the gap, counted from 1.
        block: usize,
        /// Coordinate, counted from 1.
        coordinate: usize,
        /// End of the block before, m or rad.
        end: f64,
        /// Start of the block, m or rad.
        start: f64,
    },
}

/// A program that cannot be planned. Moves are counted from 1.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PlanError {
    /// Invalid path.
    #[error(transparent)]
    Path(#[from] PathError),
    /// Number of joint limits different from the number of coordinates.
    #[error("found limits of {found} joints for a path of {wanted} coordinates")]
    JointCount {
        /// Number of limits.
        found: usize,
        /// Number of coordinates.
        wanted: usize,
    },
    /// Value out of range.
    #[error("{what} must be {allowed}; found {}", Rounded(*found))]
    InvalidValue {
        /// Move or joint, name and unit of the value.
        what: String,
        /// Allowed range.
        allowed: &'static str,
        /// Value found.
        found: f64,
    },
    /// Move shorter than its cosine ramps.
    #[error("move {index}: length {} is shorter than its two ramps, {}", Rounded(*length), Rounded(*needed))]
    TooShort {
        /// Move, counted from 1.
        index: usize,
        /// Length of the move, m or rad.
        length: f64,
        /// Length of both ramps, m or rad.
        needed: f64,
    },
    /// Move with a cosine profile, which is not adapted, that exceeds Vmax of a joint.
    #[error(
        "move {index}: {joint} reaches {}; {} is {}; reduce the feed",
        speed_text(*found, unit),
        velocity_limit_key(unit),
        speed_text(*allowed, unit)
    )]
    TooFast {
        /// Move, counted from 1.
        index: usize,
        /// Name of the joint.
        joint: String,
        /// Unit of the joint: m or rad.
        unit: &'static str,
        /// Speed found, m/s or rad/s.
        found: f64,
        /// Largest speed, m/s or rad/s.
        allowed: f64,
    },
    /// Duration or kinematics outside the range of floating-point numbers.
    #[error("move {index}: its duration cannot be computed ({found} s)")]
    NotComputable {
        /// Move, counted from 1.
        index: usize,
        /// Duration found, s.
        found: f64,
    },
    /// Sampled setpoints that exceed a limit at any feed.
    #[error(
        "move {index}, {} s: {quantity} of {joint} reaches {} {unit}/{}; allowed is {} {unit}/{}",
        Rounded(*time),
        Rounded(*found),
        quantity.per_time(),
        Rounded(*allowed),
        quantity.per_time()
    )]
    LimitExceeded {
        /// Move, counted from 1.
        index: usize,
        /// Time, s.
        time: f64,
        /// Name of the joint.
        joint: String,
        /// Unit of the joint: m or rad.
        unit: &'static str,
        /// Exceeded quantity.
        quantity: SetpointDerivative,
        /// Value found.
        found: f64,
        /// Limit.
        allowed: f64,
    },
}
