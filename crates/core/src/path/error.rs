//! What is wrong with a path or with its time law.

use std::fmt;

use thiserror::Error;

use crate::units::Told;

/// Which derivative of a setpoint a limit is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// m/s or rad/s.
    Speed,
    /// m/s² or rad/s².
    Acceleration,
    /// m/s³ or rad/s³.
    Jerk,
}

impl Quantity {
    /// What it is divided by.
    fn time(self) -> &'static str {
        match self {
            Self::Speed => "s",
            Self::Acceleration => "s²",
            Self::Jerk => "s³",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
        })
    }
}

/// A path that cannot be. Coordinates and points count from 1; values are in m or rad.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PathError {
    /// No block at all.
    #[error("a path needs at least one block")]
    Empty,
    /// A point with another number of coordinates than there are joints.
    #[error("{what} has {found} coordinates; there are {wanted} joints")]
    WrongSize {
        /// Which point.
        what: &'static str,
        /// Its number of coordinates.
        found: usize,
        /// Number of joints.
        wanted: usize,
    },
    /// NaN or infinity.
    #[error("{what}, coordinate {coordinate}: {value} is not a finite number")]
    NotFinite {
        /// Which point.
        what: &'static str,
        /// From 1.
        coordinate: usize,
        /// What was found.
        value: f64,
    },
    /// No coordinate moves.
    #[error("the block starts and ends at the same point and has no length")]
    StandsStill,
    /// A length, or a slope along it, that is no number any more.
    #[error("a length of {length} cannot be computed with; a block must be neither that long nor that short")]
    Unmeasurable {
        /// m or rad.
        length: f64,
    },
    /// An arc's plane that is not two linear coordinates.
    #[error(
        "the plane of an arc needs two different linear coordinates out of {joints}; found {first} and {second}"
    )]
    Plane {
        /// From 1.
        first: usize,
        /// From 1.
        second: usize,
        /// Number of joints.
        joints: usize,
    },
    /// An arc without a radius.
    #[error("an arc that starts at its center, {center:?} m, has no radius")]
    Radius {
        /// m.
        center: [f64; 2],
    },
    /// An arc without a sweep.
    #[error("the sweep of an arc must be finite and not 0; found {sweep} rad")]
    Sweep {
        /// rad.
        sweep: f64,
    },
    /// A spline of too few control points.
    #[error("a cubic spline needs at least {needed} control points after its start; found {found}")]
    TooFewPoints {
        /// Points after the start.
        found: usize,
        /// How many there must be.
        needed: usize,
    },
    /// A spline that stops on its way: its direction is not defined there.
    #[error(
        "the spline stands still or turns back on the spot in its piece {piece} of {pieces}: \
         control points coincide or fold there"
    )]
    Cusp {
        /// From 1.
        piece: usize,
        /// How many pieces there are.
        pieces: usize,
    },
    /// Two blocks that do not meet.
    #[error(
        "block {block} starts at {start}, coordinate {coordinate}, where the block before it ends at \
         {end}: the path must have no gap"
    )]
    Gap {
        /// From 1.
        block: usize,
        /// From 1.
        coordinate: usize,
        /// m or rad.
        end: f64,
        /// m or rad.
        start: f64,
    },
}

/// A time law that cannot be. Moves count from 1.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The path itself.
    #[error(transparent)]
    Path(#[from] PathError),
    /// Another number of limits than of coordinates.
    #[error("limits of {found} joints for a path of {wanted} coordinates")]
    Joints {
        /// Limits given.
        found: usize,
        /// Coordinates.
        wanted: usize,
    },
    /// A limit of a joint that is not one.
    #[error("joint {joint}: the largest {quantity} must be finite and larger than 0; found {value}")]
    Limit {
        /// Its name.
        joint: String,
        /// Which limit.
        quantity: Quantity,
        /// What was found.
        value: f64,
    },
    /// A position period that is not one.
    #[error("the position period must be larger than 0; found {found} ns")]
    Period {
        /// ns.
        found: i64,
    },
    /// A rest before the first move that is not a time.
    #[error("the rest before the first move must be finite and not negative; found {found} s")]
    Rest {
        /// s.
        found: f64,
    },
    /// A value of a move that is out of its range.
    #[error("move {index}: {what} must be {allowed}; found {}", Told(*found))]
    Value {
        /// From 1.
        index: usize,
        /// What it is, with its unit.
        what: &'static str,
        /// What is allowed.
        allowed: &'static str,
        /// What was found.
        found: f64,
    },
    /// A move too short for its cosine ramps.
    #[error("move {index}: its length of {} is shorter than its two ramps need, {}", Told(*length), Told(*needed))]
    TooShort {
        /// From 1.
        index: usize,
        /// m or rad.
        length: f64,
        /// m or rad.
        needed: f64,
    },
    /// A cosine move at which an axis is too fast; its law is as prescribed.
    #[error(
        "move {index}: {joint} would run at {} {unit}/s; its largest speed is {} {unit}/s",
        Told(*found),
        Told(*allowed)
    )]
    TooFast {
        /// From 1.
        index: usize,
        /// The joint.
        joint: String,
        /// Its unit: m or rad.
        unit: &'static str,
        /// m/s or rad/s.
        found: f64,
        /// m/s or rad/s.
        allowed: f64,
    },
    /// A move whose time, or whose kinematics, is no number any more.
    #[error("move {index}: its duration cannot be computed ({found} s)")]
    Unmeasurable {
        /// From 1.
        index: usize,
        /// s.
        found: f64,
    },
    /// Sampled setpoints that exceed a limit however slow the path is passed.
    #[error(
        "move {index}, {} s: {quantity} of {joint} reaches {} {unit}/{}; allowed is {} {unit}/{}",
        Told(*time),
        Told(*found),
        quantity.time(),
        Told(*allowed),
        quantity.time()
    )]
    Exceeds {
        /// From 1.
        index: usize,
        /// s.
        time: f64,
        /// The joint.
        joint: String,
        /// Its unit: m or rad.
        unit: &'static str,
        /// Which limit.
        quantity: Quantity,
        /// What was found.
        found: f64,
        /// What is allowed.
        allowed: f64,
    },
}
