//! Backlash compensation: an offset of the motor that changes its sign at each reversal of the setpoint.

use crate::config::AxisConfig;
use crate::state_codec::StateCodec;

/// Backlash compensation of one axis, in motor units.
///
/// The offset is half the width of the gap in the direction of the last motion of the setpoint, so that it changes by the
/// width at a reversal. Its velocity is limited. The position controller reads the motor without the offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BacklashCompensation {
    /// Half the width of the gap, rad.
    half_width: f64,
    /// Largest change of the offset in a position cycle, rad.
    max_change: f64,
}

/// State of the backlash compensation of one axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BacklashOffset {
    /// Offset, rad of the motor.
    angle: f64,
    /// Sign of the last change of the setpoint; 0 before the first one.
    direction: f64,
}

impl BacklashCompensation {
    /// Creates the compensation of an axis with position cycles of `period` seconds.
    pub fn new(axis: &AxisConfig, period: f64) -> Self {
        let compensation = &axis.position_loop.backlash_compensation;
        BacklashCompensation {
            half_width: compensation.width / 2.0 / axis.transmission_ratio,
            max_change: compensation.velocity * period / axis.transmission_ratio,
        }
    }
}

impl BacklashOffset {
    /// Moves the offset in a position cycle in which the setpoint changes by `change`, with its sign.
    #[inline]
    pub fn update(&mut self, compensation: &BacklashCompensation, change: f64) {
        if change != 0.0 {
            self.direction = change.signum();
        }
        if compensation.half_width == 0.0 && self.angle == 0.0 {
            return;
        }
        let wanted = self.direction * compensation.half_width;
        let (low, high) = (self.angle - compensation.max_change, self.angle + compensation.max_change);
        self.angle = wanted.max(low).min(high);
    }

    /// Returns the offset, rad of the motor.
    #[inline]
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// Writes or replaces the state.
    pub(crate) fn code(&mut self, codec: &mut StateCodec<'_>) {
        codec.numbers([&mut self.angle, &mut self.direction]);
    }
}
