//! Travel limits, speeds and settling time of a campaign.

use virtual_axes_core::config::{AxisConfig, AxisKind, AxisUnits, LimitsConfig, MachineConfig};
use virtual_axes_core::units::{REVOLUTION, seconds};

use super::error::CampaignError;
use super::options::{CampaignOptions, SPEED_RESERVE};

/// Distance of the setpoints from each end of the range, relative to the range, as margin for overshoot.
const MARGIN: f64 = 0.05;
/// Default highest speed, m/min or rev/min: the range of the friction law (Prévost Appendix 2).
const DEFAULT_MAX_SPEED: f64 = 20.0;
/// Constant-speed time of a leg after settling, s.
pub(super) const CONSTANT: f64 = 1.8;
/// Shortest constant-speed time of a leg after settling, s.
const LEAST_CONSTANT: f64 = 0.4;
/// Shortest settling time at a speed, s.
const LEAST_SETTLING: f64 = 0.3;
/// Settling time in time constants 1/Kp of the position loop: 0.03 % of a step remain.
const SETTLING_CONSTANTS: f64 = 8.0;
/// Longest settling time, s.
const MOST_SETTLING: f64 = 2.0;
/// Acceleration of positioning legs, relative to Amax.
pub(super) const MOVING_ACCELERATION: f64 = 0.5;
/// Speeds of the sweeps over the whole range, relative to the highest.
pub(super) const SWEEPS: [f64; 2] = [0.25, 0.5];
/// Rounding tolerance of lengths, relative to the window.
pub(super) const ROUNDING: f64 = 1e-9;

/// Usable range, highest speed and settling time of a campaign.
pub(super) struct TravelLimits<'a> {
    pub axis: &'a AxisConfig,
    /// Start and end position of each part, m or rad.
    pub start: f64,
    /// Range of motion, m or rad.
    pub window: [f64; 2],
    /// Highest speed, m/s or rad/s.
    pub max_speed: f64,
    /// Settling time at a speed, s.
    pub settling_time: f64,
}

impl<'a> TravelLimits<'a> {
    pub fn new(
        machine: &'a MachineConfig,
        index: usize,
        options: &CampaignOptions,
    ) -> Result<Self, CampaignError> {
        let count = machine.axes().len();
        let axis = machine
            .axes()
            .get(index)
            .ok_or(CampaignError::NoAxis { number: index.saturating_add(1), count })?;
        let range = allowed_range(axis, options)?;
        let max_speed = max_speed(axis, options)?;
        let delay = seconds(axis.alpha());
        let settling_time =
            (SETTLING_CONSTANTS / axis.position_loop.gain + delay).clamp(LEAST_SETTLING, MOST_SETTLING);
        let mut limits = TravelLimits { axis, start: 0.0, window: range, max_speed, settling_time };
        let [min, max] = range;
        let extent = max - min;
        let margin = MARGIN * if extent.is_finite() { extent } else { limits.wanted_length() };
        let (low, high) = (min + margin, max - margin);
        limits.start = if min <= 0.0 && max >= 0.0 { 0.0 } else { 0.0_f64.clamp(low, high) };
        let needed = limits.leg_length(max_speed, 1.0, LEAST_CONSTANT);
        if needed > high - low {
            return Err(limits.too_short(extent, needed));
        }
        let wanted = limits.wanted_length().min(high - low);
        let low = (limits.start - 0.5 * wanted).max(low).min(high - wanted);
        limits.window = [low, low + wanted];
        Ok(limits)
    }

    pub fn axis_limits(&self) -> &LimitsConfig {
        &self.axis.limits
    }

    pub fn length(&self) -> f64 {
        self.window[1] - self.window[0]
    }

    /// Returns the longest window that a campaign uses, m or rad.
    fn wanted_length(&self) -> f64 {
        let longest_leg = self.leg_length(self.max_speed, 1.0, CONSTANT);
        match self.axis.kind {
            AxisKind::Linear => longest_leg,
            // Identifying gravity needs a full turn at constant speed.
            AxisKind::Rotary => {
                let sweep =
                    SWEEPS.map(|part| self.leg_length(part * self.max_speed, MOVING_ACCELERATION, 0.0));
                sweep.into_iter().fold(longest_leg, |longest, ends| longest.max(REVOLUTION + ends))
            }
        }
    }

    /// Returns the distance from rest to `speed` with `part` of Amax, m or rad.
    pub fn ramp_length(&self, speed: f64, part: f64) -> f64 {
        let (acceleration, jerk) = (part * self.axis_limits().acceleration, self.axis_limits().jerk);
        let duration = if speed >= self.saturating_speed(part) {
            speed / acceleration + acceleration / jerk
        } else {
            2.0 * (speed / jerk).sqrt()
        };
        0.5 * speed * duration
    }

    /// Returns the speed above which a ramp from rest reaches `part` of Amax, m/s or rad/s.
    pub fn saturating_speed(&self, part: f64) -> f64 {
        (part * self.axis_limits().acceleration).powi(2) / self.axis_limits().jerk
    }

    /// Returns the length of a leg from rest to rest with `constant` seconds at `speed` after settling, m or
    /// rad.
    pub fn leg_length(&self, speed: f64, part: f64, constant: f64) -> f64 {
        2.0 * self.ramp_length(speed, part) + speed * (self.settling_time + constant)
    }

    /// Returns the settled time at constant `speed` that fits into the window, at most `wanted`, s.
    pub fn constant_speed_time(&self, speed: f64, wanted: f64) -> f64 {
        ((self.length() - self.leg_length(speed, 1.0, 0.0)) / speed).min(wanted)
    }

    fn too_short(&self, found: f64, needed: f64) -> CampaignError {
        let usable = (1.0 - 2.0 * MARGIN) * found;
        // The leg length increases with speed; bisection finds the highest speed that fits.
        let (mut low, mut high) = (0.0, self.max_speed);
        for _ in 0..f64::MANTISSA_DIGITS {
            let middle = 0.5 * (low + high);
            if self.leg_length(middle, 1.0, LEAST_CONSTANT) <= usable { low = middle } else { high = middle }
        }
        let AxisUnits { length, length_key: unit, speed, speed_name: feed_unit, .. } = self.axis.units();
        CampaignError::TooShort {
            axis: self.axis.name().to_owned(),
            found: round_to_four_digits(found / length, f64::round),
            needed: round_to_four_digits(needed / (1.0 - 2.0 * MARGIN) / length, f64::ceil),
            unit,
            feed: round_to_four_digits(self.max_speed / speed, f64::round),
            possible: round_to_four_digits(low / speed, f64::floor),
            feed_unit,
        }
    }
}

/// Rounds `value` with `round` to four significant digits, so that the number in a message is valid as input.
fn round_to_four_digits(value: f64, round: fn(f64) -> f64) -> f64 {
    const DIGITS: i32 = 4;
    // Values within the tolerance of a round number are that number.
    let last = 10.0_f64.powi(value.log10().ceil() as i32 - DIGITS);
    let steps = value / last;
    let near = steps.round();
    let steps = if (steps - near).abs() < ROUNDING * near { near } else { round(steps) };
    // Dividing by a power of ten gives the nearest number to the decimal one.
    if last < 1.0 { steps / (1.0 / last).round() } else { steps * last }
}

/// Returns the range of the options, which must lie within the travel limits; the travel limits by default.
fn allowed_range(axis: &AxisConfig, options: &CampaignOptions) -> Result<[f64; 2], CampaignError> {
    let LimitsConfig { travel_min, travel_max, .. } = axis.limits;
    let Some([min, max]) = options.range else { return Ok([travel_min, travel_max]) };
    if min.is_finite() && max.is_finite() && min < max && min >= travel_min && max <= travel_max {
        return Ok([min, max]);
    }
    let AxisUnits { length, length_key: unit, .. } = axis.units();
    // Removes rounding errors of the unit conversion.
    let rounded = |value: f64| (value / length * 1e6).round() / 1e6;
    let end = |value: f64| match value.is_finite() {
        true => format!("{} {unit}", rounded(value)),
        false => "unlimited".to_owned(),
    };
    Err(CampaignError::Range {
        min: rounded(min),
        max: rounded(max),
        unit,
        axis: axis.name().to_owned(),
        limits: format!("{} … {}", end(travel_min), end(travel_max)),
    })
}

fn max_speed(axis: &AxisConfig, options: &CampaignOptions) -> Result<f64, CampaignError> {
    let by_motor = axis.motor.max_speed * axis.transmission_ratio;
    let allowed = SPEED_RESERVE * axis.limits.velocity.min(by_motor);
    let AxisUnits { speed, speed_name: unit, .. } = axis.units();
    let Some(feed) = options.max_feed else { return Ok(allowed.min(DEFAULT_MAX_SPEED * speed)) };
    if feed > 0.0 && feed <= allowed * (1.0 + ROUNDING) {
        return Ok(feed.min(allowed));
    }
    let axis = axis.name().to_owned();
    Err(CampaignError::Feed {
        found: feed / speed,
        allowed: round_to_four_digits(allowed / speed, f64::floor),
        unit,
        axis,
    })
}
