//! What a campaign has: places, speeds, time to settle.

use virtual_axes_core::config::{AxisConfig, AxisKind, LimitsConfig, MachineConfig};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, REVOLUTION, RPM, seconds};

use super::{CampaignError, Options};

/// Part of the range at each of its ends that setpoints stay away from: room for what the axis overshoots.
const MARGIN: f64 = 0.05;
/// Part of Vmax and of the motor's speed that is used: the rest is for the controller.
pub(super) const SPEED_RESERVE: f64 = 0.95;
/// Highest speed unless another is asked for, m/min or rev/min: as far as the friction law is fitted (Prévost
/// Appendix 2).
const HIGHEST_SPEED: f64 = 20.0;
/// Time of constant speed of a leg, s, besides what the axis needs to settle.
pub(super) const CONSTANT: f64 = 1.8;
/// The least that a leg must have.
const LEAST_CONSTANT: f64 = 0.4;
/// Least time that an axis is given to settle at a speed, s.
const LEAST_SETTLING: f64 = 0.3;
/// Time constants 1/Kp of the position loop that it is given: 0.03 % of the step are left.
const SETTLING_CONSTANTS: f64 = 8.0;
/// Most time to settle, s: a loop that is slower than that is not waited for.
const MOST_SETTLING: f64 = 2.0;
/// Acceleration between places, as part of Amax.
pub(super) const MOVING_ACCELERATION: f64 = 0.5;
/// Speeds of the sweeps over the whole range, as parts of the highest.
pub(super) const SWEEPS: [f64; 2] = [0.25, 0.5];
/// What a leg is longer than its window by rounding, and what is no way to go, relative to the window.
pub(super) const ROUNDING: f64 = 1e-9;

/// Units in which a user thinks of an axis.
pub(super) struct Units {
    pub length: (&'static str, f64),
    pub speed: (&'static str, f64),
}

impl Units {
    pub fn of(axis: &AxisConfig) -> Self {
        match axis.kind {
            AxisKind::Linear => Units { length: ("mm", MILLIMETER), speed: ("m/min", METER_PER_MINUTE) },
            AxisKind::Rotary => Units { length: ("deg", DEGREE), speed: ("rpm", RPM) },
        }
    }
}

/// What a campaign has: places, speeds, time to settle.
pub(super) struct Room<'a> {
    pub axis: &'a AxisConfig,
    pub start: f64,
    pub window: [f64; 2],
    pub highest: f64,
    pub settling: f64,
}

impl<'a> Room<'a> {
    pub fn of(machine: &'a MachineConfig, place: usize, options: &Options) -> Result<Self, CampaignError> {
        let count = machine.axes().len();
        let axis = machine
            .axes()
            .get(place)
            .ok_or(CampaignError::NoAxis { place: place.saturating_add(1), count })?;
        let range = allowed_range(axis, options)?;
        let highest = highest_speed(axis, options)?;
        let delay = seconds(axis.alpha());
        let settling =
            (SETTLING_CONSTANTS / axis.position_loop.gain + delay).clamp(LEAST_SETTLING, MOST_SETTLING);
        let mut room = Room { axis, start: 0.0, window: range, highest, settling };
        let [min, max] = range;
        let extent = max - min;
        let margin = MARGIN * if extent.is_finite() { extent } else { room.wanted() };
        let (low, high) = (min + margin, max - margin);
        room.start = if min <= 0.0 && max >= 0.0 { 0.0 } else { 0.0_f64.clamp(low, high) };
        let needed = room.leg(highest, 1.0, LEAST_CONSTANT);
        if needed > high - low {
            return Err(room.too_short(extent, needed));
        }
        let wanted = room.wanted().min(high - low);
        let low = (room.start - 0.5 * wanted).max(low).min(high - wanted);
        room.window = [low, low + wanted];
        Ok(room)
    }

    pub fn limits(&self) -> &LimitsConfig {
        &self.axis.limits
    }

    pub fn length(&self) -> f64 {
        self.window[1] - self.window[0]
    }

    /// Length of window that a campaign has use for.
    fn wanted(&self) -> f64 {
        let longest_leg = self.leg(self.highest, 1.0, CONSTANT);
        match self.axis.kind {
            AxisKind::Linear => longest_leg,
            // Gravity shows in a full turn at constant speed.
            AxisKind::Rotary => {
                let sweep = SWEEPS.map(|part| self.leg(part * self.highest, MOVING_ACCELERATION, 0.0));
                sweep.into_iter().fold(longest_leg, |longest, ends| longest.max(REVOLUTION + ends))
            }
        }
    }

    /// Way from rest to `speed` with `part` of Amax, m or rad.
    pub fn ramp(&self, speed: f64, part: f64) -> f64 {
        let (acceleration, jerk) = (part * self.limits().acceleration, self.limits().jerk);
        let duration = if speed >= self.reached(part) {
            speed / acceleration + acceleration / jerk
        } else {
            2.0 * (speed / jerk).sqrt()
        };
        0.5 * speed * duration
    }

    /// Speed from which on a ramp from rest reaches `part` of Amax, m/s or rad/s.
    pub fn reached(&self, part: f64) -> f64 {
        (part * self.limits().acceleration).powi(2) / self.limits().jerk
    }

    /// Length of a leg from rest to rest with `constant` seconds at `speed` after it has settled.
    pub fn leg(&self, speed: f64, part: f64, constant: f64) -> f64 {
        2.0 * self.ramp(speed, part) + speed * (self.settling + constant)
    }

    /// Settled time at constant `speed` that fits into the window, at most `wanted`.
    pub fn constant(&self, speed: f64, wanted: f64) -> f64 {
        ((self.length() - self.leg(speed, 1.0, 0.0)) / speed).min(wanted)
    }

    fn too_short(&self, found: f64, needed: f64) -> CampaignError {
        let usable = (1.0 - 2.0 * MARGIN) * found;
        // Legs grow with their speed, so bisection finds the speed that just fits.
        let (mut low, mut high) = (0.0, self.highest);
        for _ in 0..f64::MANTISSA_DIGITS {
            let middle = 0.5 * (low + high);
            if self.leg(middle, 1.0, LEAST_CONSTANT) <= usable { low = middle } else { high = middle }
        }
        let Units { length: (unit, length), speed: (feed_unit, speed) } = Units::of(self.axis);
        CampaignError::TooShort {
            axis: self.axis.name().to_owned(),
            found: rounded(found / length, f64::round),
            needed: rounded(needed / (1.0 - 2.0 * MARGIN) / length, f64::ceil),
            unit,
            feed: rounded(self.highest / speed, f64::round),
            possible: rounded(low / speed, f64::floor),
            feed_unit,
        }
    }
}

/// `value` with four digits, so that what is told can be typed and is enough.
fn rounded(value: f64, round: fn(f64) -> f64) -> f64 {
    const DIGITS: i32 = 4;
    // A hair beyond a round number is that number.
    let last = 10.0_f64.powi(value.log10().ceil() as i32 - DIGITS);
    let steps = value / last;
    let near = steps.round();
    let steps = if (steps - near).abs() < ROUNDING * near { near } else { round(steps) };
    // Dividing by a power of ten gives the nearest number to the decimal one.
    if last < 1.0 { steps / (1.0 / last).round() } else { steps * last }
}

/// The range of the options, within the stroke; the stroke without.
fn allowed_range(axis: &AxisConfig, options: &Options) -> Result<[f64; 2], CampaignError> {
    let LimitsConfig { stroke_min, stroke_max, .. } = axis.limits;
    let Some([min, max]) = options.range else { return Ok([stroke_min, stroke_max]) };
    if min.is_finite() && max.is_finite() && min < max && min >= stroke_min && max <= stroke_max {
        return Ok([min, max]);
    }
    let (unit, length) = Units::of(axis).length;
    // Without the last digits, which are the rounding of the units.
    let told = |value: f64| (value / length * 1e6).round() / 1e6;
    let end = |value: f64| match value.is_finite() {
        true => format!("{} {unit}", told(value)),
        false => "unlimited".to_owned(),
    };
    Err(CampaignError::Range {
        min: told(min),
        max: told(max),
        unit,
        axis: axis.name().to_owned(),
        stroke: format!("{} … {}", end(stroke_min), end(stroke_max)),
    })
}

fn highest_speed(axis: &AxisConfig, options: &Options) -> Result<f64, CampaignError> {
    let by_motor = axis.motor.max_speed * axis.transmission_ratio;
    let allowed = SPEED_RESERVE * axis.limits.velocity.min(by_motor);
    let (unit, speed) = Units::of(axis).speed;
    let Some(feed) = options.max_feed else { return Ok(allowed.min(HIGHEST_SPEED * speed)) };
    if feed > 0.0 && feed <= allowed * (1.0 + ROUNDING) {
        return Ok(feed.min(allowed));
    }
    let axis = axis.name().to_owned();
    Err(CampaignError::Feed {
        found: feed / speed,
        allowed: rounded(allowed / speed, f64::floor),
        unit,
        axis,
    })
}
