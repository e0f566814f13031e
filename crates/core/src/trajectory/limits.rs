//! What trajectories may ask of the joints.

use super::rejection::{Code, Rejection};
use crate::config::{AxisConfig, AxisKind, LimitsConfig};
use crate::units::Told;

/// Relative tolerance on speeds: rounding of setpoints that sit exactly on the limit.
pub const SPEED_TOLERANCE: f64 = 1e-9;
/// Tolerance on the stroke, m or rad: a nanometer of rounding is not a collision.
pub const STROKE_TOLERANCE: f64 = 1e-9;

/// A joint of the machine as trajectories see it.
#[derive(Debug, Clone, PartialEq)]
pub struct JointLimits {
    /// Name that trajectories use, prefix included.
    pub name: String,
    /// Whether positions are in m or in rad.
    pub kind: AxisKind,
    /// Limits, m or rad and seconds.
    pub limits: LimitsConfig,
}

impl JointLimits {
    /// The joint of an axis, named after it.
    pub fn of_axis(axis: &AxisConfig) -> Self {
        Self { name: axis.name().to_owned(), kind: axis.kind(), limits: *axis.limits() }
    }

    /// Unit of positions.
    pub fn unit(&self) -> &'static str {
        match self.kind {
            AxisKind::Linear => "m",
            AxisKind::Rotary => "rad",
        }
    }

    /// Largest speed that is let through, m/s or rad/s: Vmax with its tolerance.
    pub fn speed_bound(&self) -> f64 {
        self.limits.velocity * (1.0 + SPEED_TOLERANCE)
    }

    /// Refuses a position beyond the stroke; `index` is the point that it belongs to.
    ///
    /// # Errors
    /// [`Code::OutsideStroke`]; NaN is outside too.
    pub fn check_stroke(&self, index: usize, position: f64) -> Result<(), Rejection> {
        let (min, max) = (self.limits.stroke_min, self.limits.stroke_max);
        if position >= min - STROKE_TOLERANCE && position <= max + STROKE_TOLERANCE {
            return Ok(());
        }
        let limit = if position < min { min } else { max };
        let unit = self.unit();
        Err(Rejection::new(
            Code::OutsideStroke,
            format!(
                "{}, point {index}: position {} {unit} is outside the stroke [{}, {}] {unit}",
                self.name,
                Told(position),
                Told(min),
                Told(max)
            ),
        )
        .joint(&self.name)
        .index(index)
        .numbers(position, limit))
    }

    /// Refuses a speed beyond Vmax; `index` is the point that it belongs to, `what` says which.
    ///
    /// # Errors
    /// [`Code::Speed`]; NaN is too fast too.
    pub fn check_speed(&self, index: usize, velocity: f64, what: &str) -> Result<(), Rejection> {
        let speed = velocity.abs();
        if speed <= self.speed_bound() {
            return Ok(());
        }
        let limit = self.limits.velocity;
        let unit = self.unit();
        Err(Rejection::new(
            Code::Speed,
            format!(
                "{}, point {index}: {what} {} {unit}/s is beyond the limit {} {unit}/s",
                self.name,
                Told(speed),
                Told(limit)
            ),
        )
        .joint(&self.name)
        .index(index)
        .numbers(speed, limit))
    }

    /// Refuses a first setpoint that is not within one period's reach of the one before it.
    ///
    /// # Errors
    /// [`Code::Jump`], with the distance and Vmax·Tsp in m or rad.
    pub fn check_jump(&self, index: usize, before: f64, first: f64, period: f64) -> Result<(), Rejection> {
        let jump = (first - before).abs();
        if jump <= self.speed_bound() * period {
            return Ok(());
        }
        let limit = self.limits.velocity * period;
        let unit = self.unit();
        Err(Rejection::new(
            Code::Jump,
            format!(
                "{}: starts at {} {unit}, {} {unit} away from the setpoint {} {unit} before it; the axis \
                 moves {} {unit} in a position period at most",
                self.name,
                Told(first),
                Told(jump),
                Told(before),
                Told(limit)
            ),
        )
        .joint(&self.name)
        .index(index)
        .numbers(jump, limit))
    }
}
