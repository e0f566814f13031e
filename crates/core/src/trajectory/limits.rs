//! Joint limits of trajectories: travel limits, Vmax, jump, NaN.

use super::rejection::{Rejection, RejectionCode};
use crate::config::{AxisConfig, AxisKind, LimitsConfig};
use crate::units::{Rounded, position_text, speed_text, velocity_limit_key};

/// Relative tolerance of speed checks, for the rounding of setpoints exactly at the limit.
pub const SPEED_TOLERANCE: f64 = 1e-9;
/// Tolerance of travel limit checks, m or rad, for rounding.
pub const TRAVEL_TOLERANCE: f64 = 1e-9;

/// Name, unit and limits of a joint, as used by trajectories.
#[derive(Debug, Clone, PartialEq)]
pub struct JointLimits {
    /// Joint name in trajectories, with prefix.
    pub name: String,
    /// Kind of axis: positions in m or rad.
    pub kind: AxisKind,
    /// Limits in m or rad and s.
    pub limits: LimitsConfig,
}

impl JointLimits {
    /// Creates the limits of an axis; the joint has the name of the axis.
    pub fn from_axis(axis: &AxisConfig) -> Self {
        Self { name: axis.name().to_owned(), kind: axis.kind(), limits: *axis.limits() }
    }

    /// Returns the unit of positions: `m` or `rad`.
    pub fn unit(&self) -> &'static str {
        match self.kind {
            AxisKind::Linear => "m",
            AxisKind::Rotary => "rad",
        }
    }

    /// Returns true for a rotary joint without travel limits, on which angles that differ by whole turns are the same place.
    pub fn is_continuous(&self) -> bool {
        let is_unlimited = self.limits.travel_min.is_infinite() && self.limits.travel_max.is_infinite();
        self.kind == AxisKind::Rotary && is_unlimited
    }

    /// Returns the largest accepted speed, m/s or rad/s: Vmax plus its tolerance.
    pub fn speed_bound(&self) -> f64 {
        self.limits.velocity * (1.0 + SPEED_TOLERANCE)
    }

    /// Returns true if a position, m or rad, is within the travel limits; false for NaN.
    #[inline]
    pub fn is_within_travel(&self, position: f64) -> bool {
        let (min, max) = (self.limits.travel_min, self.limits.travel_max);
        position >= min - TRAVEL_TOLERANCE && position <= max + TRAVEL_TOLERANCE
    }

    /// Rejects a position outside the travel limits. `index` is the index of the point; a single setpoint has none.
    ///
    /// # Errors
    /// [`RejectionCode::OutsideTravelLimits`], also for NaN.
    #[inline]
    pub fn check_travel_limits(&self, index: Option<usize>, position: f64) -> Result<(), Rejection> {
        if self.is_within_travel(position) { Ok(()) } else { Err(self.travel_rejection(index, position)) }
    }

    #[cold]
    fn travel_rejection(&self, index: Option<usize>, position: f64) -> Rejection {
        let (min, max) = (self.limits.travel_min, self.limits.travel_max);
        let limit = if position < min { min } else { max };
        let unit = self.unit();
        let point = index.map(|index| format!(", point {index}")).unwrap_or_default();
        let rejection = Rejection::new(
            RejectionCode::OutsideTravelLimits,
            format!(
                "{}{point}: position {} is outside the travel limits, {} to {}",
                self.name,
                position_text(position, unit),
                position_text(min, unit),
                position_text(max, unit)
            ),
        );
        Rejection { index, ..rejection.joint(&self.name).numbers(position, limit) }
    }

    /// Rejects a position that is NaN or infinite.
    ///
    /// # Errors
    /// [`RejectionCode::NotFinite`].
    pub(super) fn check_finite(&self, position: f64) -> Result<(), Rejection> {
        if position.is_finite() {
            return Ok(());
        }
        let text = format!("{}: position is {position}, not a finite number", self.name);
        Err(Rejection::new(RejectionCode::NotFinite, text).joint(&self.name).numbers(position, 0.0))
    }

    /// Rejects a speed beyond Vmax. `index` is the index of the point, `what` the checked quantity.
    ///
    /// # Errors
    /// [`RejectionCode::Speed`], also for NaN.
    #[inline]
    pub fn check_speed(&self, index: usize, velocity: f64, what: &str) -> Result<(), Rejection> {
        let speed = velocity.abs();
        if speed <= self.speed_bound() {
            return Ok(());
        }
        Err(self.speed_rejection(index, speed, what))
    }

    #[cold]
    fn speed_rejection(&self, index: usize, speed: f64, what: &str) -> Rejection {
        let limit = self.limits.velocity;
        let unit = self.unit();
        Rejection::new(
            RejectionCode::Speed,
            format!(
                "{}, point {index}: {what} {} exceeds {}, {}",
                self.name,
                speed_text(speed, unit),
                velocity_limit_key(unit),
                speed_text(limit, unit)
            ),
        )
        .joint(&self.name)
        .index(index)
        .numbers(speed, limit)
    }

    /// Rejects a first setpoint that is more than Vmax·Tsp away from the previous one.
    ///
    /// # Errors
    /// [`RejectionCode::Jump`], with the distance and Vmax·Tsp in m or rad.
    pub fn check_jump(&self, index: usize, before: f64, first: f64, period: f64) -> Result<(), Rejection> {
        let jump = (first - before).abs();
        if jump <= self.speed_bound() * period {
            return Ok(());
        }
        let limit = self.limits.velocity * period;
        let unit = self.unit();
        Err(Rejection::new(
            RejectionCode::Jump,
            format!(
                "{}: starts at {} {unit}, {} {unit} away from the previous setpoint {} {unit}; at most \
                 {} {unit} is allowed in one position cycle",
                self.name,
                Rounded(first),
                Rounded(jump),
                Rounded(before),
                Rounded(limit)
            ),
        )
        .joint(&self.name)
        .index(index)
        .numbers(jump, limit))
    }
}
