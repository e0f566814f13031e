//! The set-points of an identification campaign: what an axis is to be moved through.
//!
//! A campaign has up to three parts ([`Part`]). `off` excites everything that the steps of the paper need with the
//! feedforward off: a slow start, legs there and back at constant speeds (Prévost eq. 3), standstills approached
//! from both sides and, on a rotary axis, slow sweeps (gravity), ramps at half and at full acceleration
//! (eq. 5). `velocity` and `both` are short: there and back at a middle and at the highest speed, for the
//! feedforward and its delays (eqs. 6–8).
//!
//! Every part starts and ends at rest at [`Campaign::start`], on the grid of Tsp.

use std::ops::Range;

use crate::config::{
    Assignment, AxisConfig, AxisKind, LimitsConfig, MachineConfig, Parameters, Source, Value,
};
use crate::kinematics::Kinematics;
use crate::path::{Block, Frame, Move, PathError, PathLimits, PlanError, Program};
use crate::trajectory::JointLimits;
use crate::units::{DEGREE, METRE_PER_MINUTE, MILLIMETRE, Nanoseconds, REVOLUTION, RPM, seconds};

/// Part of the range at each of its ends that set-points stay away from: room for what the axis overshoots.
const MARGIN: f64 = 0.05;
/// Part of Vmax and of the motor's speed that is used: the rest is for the controller.
const SPEED_RESERVE: f64 = 0.95;
/// Highest speed unless another is asked for, m/min or rev/min: as far as the friction law is fitted (Prévost
/// Appendix 2).
const HIGHEST_SPEED: f64 = 20.0;
/// Lowest speed, m/min or rev/min; at 1 µm or 1 mdeg of resolution still hundreds of increments per second.
const LOWEST_SPEED: f64 = 0.05;
/// The lowest speed is at most this part of the highest, so that a slow axis has a spread of speeds, too.
const LEAST_SPREAD: f64 = 1.0 / 40.0;
/// Speeds of the friction law: three for each of its four coefficients.
const SPEEDS: usize = 12;
/// Speeds are even in ln(V + this · lowest): nearly logarithmic, but with more of the high ones.
const EVEN_BELOW: f64 = 2.0;

/// Time of constant speed of a leg, s, besides what the axis needs to settle.
const CONSTANT: f64 = 1.8;
/// Enough of it; a leg with less is repeated.
const ENOUGH_CONSTANT: f64 = 1.5;
/// The least that a leg must have.
const LEAST_CONSTANT: f64 = 0.4;
/// Most there-and-backs at one speed: the least constant time four times is enough.
const MOST_REPEATS: f64 = 4.0;
/// Least time that an axis is given to settle at a speed, s.
const LEAST_SETTLING: f64 = 0.3;
/// Time constants 1/Kp of the position loop that it is given: 0.25 % of the step are left.
const SETTLING_CONSTANTS: f64 = 6.0;
/// Most time to settle, s: a loop that is slower than that is not waited for.
const MOST_SETTLING: f64 = 2.0;

/// Rest at the start and at the end of a part, s.
const REST: f64 = 1.0;
/// Rest between two parts, s: time to switch the feedforward.
const PAUSE: f64 = 3.0;
/// Settled standstill at a place, s.
const STANDSTILL: f64 = 0.5;
/// Places of the standstills.
const PLACES: usize = 5;
/// Speed between places, as part of the highest.
const MOVING_SPEED: f64 = 0.5;
/// Acceleration between places, as part of Amax.
const MOVING_ACCELERATION: f64 = 0.5;
/// Speeds of the sweeps over the whole range, as parts of the highest.
const SWEEPS: [f64; 2] = [0.25, 0.5];
/// Speeds of the ramps, as parts of the highest: high, so that Amax is reached and lasts.
const RAMP_SPEEDS: [f64; 3] = [0.5, 0.75, 1.0];
/// Their accelerations, as parts of Amax.
const RAMP_ACCELERATIONS: [f64; 2] = [0.5, 1.0];
/// There-and-backs of each: with the above, 72 phases of acceleration.
const RAMP_ROUNDS: usize = 3;
/// Constant speed between two ramps, s.
const RAMP_CONSTANT: f64 = 0.1;
/// Speeds of the short parts, as parts of the highest; the lower is no simple fraction, so that its phases do
/// not fall on the same places of the sampling grid.
const SHORT_SPEEDS: [f64; 2] = [0.47, 1.0];
/// There-and-backs at each.
const SHORT_ROUNDS: usize = 2;
/// Their settled constant speed, s.
const SHORT_CONSTANT: f64 = 0.5;
/// Longest part, s.
const LONGEST: f64 = 3600.0;
/// What a leg is longer than its window by rounding, and what is no way to go, relative to the window.
const ROUNDING: f64 = 1e-9;

/// A part of a campaign: what of the feedforward is on while it is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// None: the long part, with everything but the feedforward.
    Off,
    /// That of the velocity.
    Velocity,
    /// Those of velocity and torque.
    Both,
}

impl Part {
    /// All of them, in the order in which they are run.
    pub const ALL: [Part; 3] = [Part::Off, Part::Velocity, Part::Both];

    /// `off`, `velocity`, `both`.
    pub fn name(self) -> &'static str {
        match self {
            Part::Off => "off",
            Part::Velocity => "velocity",
            Part::Both => "both",
        }
    }

    /// What to set on `axis` before this part is run: the feedforward, as `parameters` have it or 0, and the
    /// cascade if the axis has another controller. Friction is never compensated.
    pub fn assignments(self, parameters: &Parameters, axis: &str) -> Vec<Assignment> {
        let of_key = |(key, value): (String, Value)| {
            let name = key.strip_prefix(axis)?.strip_prefix('.')?;
            let value = match name.strip_prefix("feedforward.") {
                Some("velocity") if self != Part::Off => value,
                Some(torque) if torque.starts_with("torque_") && self == Part::Both => value,
                Some(_) => Value::Double(0.0),
                None if name == "position_loop.controller" && value != Value::Text("cascade".to_owned()) => {
                    Value::Text("cascade".to_owned())
                }
                None => return None,
            };
            Some(Assignment { key, value, source: Source::named("campaign") })
        };
        parameters.iter().filter_map(of_key).collect()
    }
}

/// What limits a campaign besides the axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Where the set-points have to stay, m or rad; none: the stroke.
    pub range: Option<[f64; 2]>,
    /// Highest speed, m/s or rad/s; none: 20 m/min or 20 rev/min, or what the axis has.
    pub max_feed: Option<f64>,
}

/// A campaign that cannot be. Values are in the units of the axis: mm and m/min, or ° and rev/min.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The machine has no such axis.
    #[error("axis {place}: the machine has {count}")]
    NoAxis {
        /// From 1.
        place: usize,
        /// Axes of the machine.
        count: usize,
    },
    /// A range that is none, or not within the stroke.
    #[error("range {min},{max} {unit}: must rise and lie within the stroke of {axis}, {stroke}")]
    Range {
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
        /// mm or deg.
        unit: &'static str,
        /// Name of the axis.
        axis: String,
        /// The stroke, with its unit.
        stroke: String,
    },
    /// A speed that the axis cannot have.
    #[error("feed {found} {unit}: must be above 0 and at most {allowed}, {SPEED_RESERVE} of what {axis} can")]
    Feed {
        /// What was asked for.
        found: f64,
        /// Largest one.
        allowed: f64,
        /// m/min or rpm.
        unit: &'static str,
        /// Name of the axis.
        axis: String,
    },
    /// No room to reach the speed and to hold it.
    #[error(
        "{axis}: a range of {found} {unit} is too short for {feed} {feed_unit}: it needs {needed} {unit}, or a feed \
         of {possible} {feed_unit} at most"
    )]
    TooShort {
        /// Name of the axis.
        axis: String,
        /// Length of the range.
        found: f64,
        /// Length that the speed needs.
        needed: f64,
        /// mm or deg.
        unit: &'static str,
        /// Highest speed of the campaign.
        feed: f64,
        /// Highest speed that the range has room for.
        possible: f64,
        /// m/min or rpm.
        feed_unit: &'static str,
    },
    /// More than an hour.
    #[error(
        "{axis}: part {part} would last {duration:.0} s, {limit} s at most are allowed: a shorter range or \
             a higher feed is needed"
    )]
    TooLong {
        /// Name of the axis.
        axis: String,
        /// Which part.
        part: &'static str,
        /// s.
        duration: f64,
        /// s.
        limit: f64,
    },
    /// A leg that is no geometry: too short for the numbers that describe it.
    #[error("{axis}: {error}")]
    Path {
        /// Name of the axis.
        axis: String,
        /// What is wrong.
        error: PathError,
    },
    /// Legs that cannot be planned.
    #[error("{axis}: {error}")]
    Plan {
        /// Name of the axis.
        axis: String,
        /// Why.
        error: PlanError,
    },
}

/// A part within the set-points of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Which part.
    pub part: Part,
    /// Its set-points in [`Campaign::psec`].
    pub rows: Range<usize>,
    /// Speeds of its legs, m/s or rad/s, rising.
    pub speeds: Vec<f64>,
}

/// The set-points of one axis, part after part.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    period: Nanoseconds,
    start: f64,
    range: [f64; 2],
    runs: Vec<Run>,
    psec: Vec<f64>,
}

impl Campaign {
    /// Plans `parts`, one after the other with 3 s of standstill between them, for the axis at `place`, from 0.
    ///
    /// Speeds reach up to 20 m/min (rev/min), 95 % of Vmax or of the motor's speed, or `options.max_feed`; set-points
    /// stay 5 % of the range (the stroke, or `options.range`) away from its ends, and within Amax and Jmax. Start and
    /// end of each part are at home, 0, if that is within the range, otherwise at the place nearest to it that the
    /// set-points may have.
    ///
    /// # Errors
    /// [`CampaignError`]: no such axis; a range outside the stroke, or too short; a feed that the axis does not have.
    pub fn plan(
        machine: &MachineConfig,
        place: usize,
        parts: &[Part],
        options: &Options,
    ) -> Result<Self, CampaignError> {
        let room = Room::of(machine, place, options)?;
        let period = machine.periods().position;
        let mut campaign =
            Campaign { period, start: room.start, range: room.window, runs: Vec::new(), psec: Vec::new() };
        for &part in parts {
            if let Some(&last) = campaign.psec.last() {
                let pause = (PAUSE / seconds(period)).round() as usize;
                campaign.psec.resize(campaign.psec.len() + pause, last);
            }
            let mut legs = Legs::new(machine, place, &room);
            let speeds = match part {
                Part::Off => legs.off()?,
                Part::Velocity | Part::Both => legs.short()?,
            };
            let program = legs.program(machine)?;
            let duration = program.duration();
            if duration > LONGEST {
                let axis = room.axis.name().to_owned();
                return Err(CampaignError::TooLong { axis, part: part.name(), duration, limit: LONGEST });
            }
            let from = campaign.psec.len();
            let last = (duration / seconds(period)).ceil() as Nanoseconds;
            let mut joints = vec![0.0; machine.axes().len()];
            campaign.psec.extend((0..=last).map(|k| {
                program.psec(seconds(k * period), &mut joints);
                joints[place]
            }));
            campaign.runs.push(Run { part, rows: from..campaign.psec.len(), speeds });
        }
        Ok(campaign)
    }

    /// The set-points, m or rad, one per position period, from time 0 on.
    pub fn psec(&self) -> &[f64] {
        &self.psec
    }

    /// The parts, in the order of time.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// First and last set-point of `run`, s.
    pub fn times(&self, run: &Run) -> [f64; 2] {
        let time = |row: usize| seconds(row as Nanoseconds * self.period);
        [time(run.rows.start), time(run.rows.end.saturating_sub(1))]
    }

    /// Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.period
    }

    /// Where every part starts and ends, m or rad.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Between which places the axis is moved, m or rad; start and end can lie outside, at home.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }
}

/// Units in which a user thinks of an axis.
struct Units {
    length: (&'static str, f64),
    speed: (&'static str, f64),
}

impl Units {
    fn of(axis: &AxisConfig) -> Self {
        match axis.kind {
            AxisKind::Linear => Units { length: ("mm", MILLIMETRE), speed: ("m/min", METRE_PER_MINUTE) },
            AxisKind::Rotary => Units { length: ("deg", DEGREE), speed: ("rpm", RPM) },
        }
    }
}

/// What a campaign has: places, speeds, time to settle.
struct Room<'a> {
    axis: &'a AxisConfig,
    start: f64,
    window: [f64; 2],
    highest: f64,
    settling: f64,
}

impl<'a> Room<'a> {
    fn of(machine: &'a MachineConfig, place: usize, options: &Options) -> Result<Self, CampaignError> {
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
        // Where there is no stroke there is no end to keep away from.
        let margin = if (max - min).is_finite() { MARGIN * (max - min) } else { 0.0 };
        let (low, high) = (min + margin, max - margin);
        room.start = if min <= 0.0 && max >= 0.0 { 0.0 } else { 0.0_f64.clamp(low, high) };
        let needed = room.leg(highest, 1.0, LEAST_CONSTANT);
        if needed > high - low {
            return Err(room.too_short(max - min, needed));
        }
        let wanted = room.wanted().min(high - low);
        let low = (room.start - 0.5 * wanted).max(low).min(high - wanted);
        room.window = [low, low + wanted];
        Ok(room)
    }

    fn limits(&self) -> &LimitsConfig {
        &self.axis.limits
    }

    fn length(&self) -> f64 {
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
    fn ramp(&self, speed: f64, part: f64) -> f64 {
        let (acceleration, jerk) = (part * self.limits().acceleration, self.limits().jerk);
        let reached = speed >= acceleration * acceleration / jerk;
        let duration =
            if reached { speed / acceleration + acceleration / jerk } else { 2.0 * (speed / jerk).sqrt() };
        0.5 * speed * duration
    }

    /// Length of a leg from rest to rest with `constant` seconds at `speed` after it has settled.
    fn leg(&self, speed: f64, part: f64, constant: f64) -> f64 {
        2.0 * self.ramp(speed, part) + speed * (self.settling + constant)
    }

    /// Settled time at constant `speed` that fits into the window, at most `wanted`.
    fn constant(&self, speed: f64, wanted: f64) -> f64 {
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
    let end = |value: f64| {
        if value.is_finite() { format!("{:.6} {unit}", value / length) } else { "unlimited".to_owned() }
    };
    Err(CampaignError::Range {
        min: min / length,
        max: max / length,
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

/// The legs of a part, one after the other.
struct Legs<'a> {
    room: &'a Room<'a>,
    place: usize,
    kinds: Vec<AxisKind>,
    position: f64,
    /// Before the first leg, s.
    rest: f64,
    moves: Vec<Move>,
}

impl<'a> Legs<'a> {
    fn new(machine: &MachineConfig, place: usize, room: &'a Room<'a>) -> Self {
        let kinds = machine.axes().iter().map(AxisConfig::kind).collect();
        Legs { room, place, kinds, position: room.start, rest: REST, moves: Vec::new() }
    }

    fn off(&mut self) -> Result<Vec<f64>, CampaignError> {
        let speeds = self.speeds();
        self.enter()?;
        for (i, &speed) in speeds.iter().enumerate() {
            let constant = self.room.constant(speed, CONSTANT);
            let rounds = if constant < ENOUGH_CONSTANT { (ENOUGH_CONSTANT / constant).ceil() } else { 1.0 };
            let length = self.room.leg(speed, 1.0, constant);
            // From standstill in either direction first of all: the slowest start there is.
            let dwell = if i == 0 { STANDSTILL } else { 0.0 };
            self.there_and_back(length, speed, 1.0, rounds.min(MOST_REPEATS) as usize, dwell)?;
        }
        self.stand_still_at_places()?;
        if self.room.axis.kind == AxisKind::Rotary {
            for part in SWEEPS {
                let [low, high] = self.room.window;
                self.position_at(low)?;
                for end in [high, low] {
                    self.to(end, part * self.room.highest, MOVING_ACCELERATION, 0.0)?;
                }
            }
        }
        for acceleration in RAMP_ACCELERATIONS {
            for part in RAMP_SPEEDS {
                let speed = part * self.room.highest;
                let length = 2.0 * self.room.ramp(speed, acceleration) + speed * RAMP_CONSTANT;
                let length = length.min(self.room.length());
                self.there_and_back(length, speed, acceleration, RAMP_ROUNDS, 0.0)?;
            }
        }
        self.leave()?;
        Ok(speeds)
    }

    fn short(&mut self) -> Result<Vec<f64>, CampaignError> {
        self.enter()?;
        let speeds = SHORT_SPEEDS.map(|part| part * self.room.highest);
        for speed in speeds {
            let constant = self.room.constant(speed, SHORT_CONSTANT);
            self.there_and_back(self.room.leg(speed, 1.0, constant), speed, 1.0, SHORT_ROUNDS, 0.0)?;
        }
        self.leave()?;
        Ok(speeds.to_vec())
    }

    /// Speeds of the friction law, rising.
    fn speeds(&self) -> Vec<f64> {
        let highest = self.room.highest;
        let lowest = (LOWEST_SPEED * Units::of(self.room.axis).speed.1).min(LEAST_SPREAD * highest);
        let offset = EVEN_BELOW * lowest;
        let ratio = (highest + offset) / (lowest + offset);
        let speed = |i: usize| (lowest + offset) * ratio.powf(i as f64 / (SPEEDS - 1) as f64) - offset;
        (0..SPEEDS).map(|i| speed(i).min(highest)).collect()
    }

    /// At each place from below, then from above.
    fn stand_still_at_places(&mut self) -> Result<(), CampaignError> {
        let [low, high] = self.room.window;
        let place = |i: usize| low + (high - low) * (i as f64 + 0.5) / PLACES as f64;
        let dwell = self.room.settling + STANDSTILL;
        self.position_at(low)?;
        for i in 0..PLACES {
            self.to(place(i), MOVING_SPEED * self.room.highest, MOVING_ACCELERATION, dwell)?;
        }
        self.position_at(high)?;
        for i in (0..PLACES).rev() {
            self.to(place(i), MOVING_SPEED * self.room.highest, MOVING_ACCELERATION, dwell)?;
        }
        Ok(())
    }

    /// Legs of `length` from where the axis is, or from the lower end of the window if there is no room.
    fn there_and_back(
        &mut self,
        length: f64,
        speed: f64,
        acceleration: f64,
        rounds: usize,
        dwell: f64,
    ) -> Result<(), CampaignError> {
        let [low, high] = self.room.window;
        let slack = ROUNDING * (high - low);
        if self.position + length > high + slack && self.position - length < low - slack {
            self.position_at(low)?;
        }
        let from = self.position;
        let end =
            if from + length <= high + slack { (from + length).min(high) } else { (from - length).max(low) };
        for _ in 0..rounds {
            self.to(end, speed, acceleration, dwell)?;
            self.to(from, speed, acceleration, dwell)?;
        }
        Ok(())
    }

    /// From the start into the window.
    fn enter(&mut self) -> Result<(), CampaignError> {
        let [low, high] = self.room.window;
        self.position_at(self.position.clamp(low, high))
    }

    /// Back to the start, to rest there.
    fn leave(&mut self) -> Result<(), CampaignError> {
        self.position_at(self.room.start)?;
        if let Some(last) = self.moves.last_mut() {
            last.dwell += REST;
        }
        Ok(())
    }

    fn position_at(&mut self, end: f64) -> Result<(), CampaignError> {
        self.to(end, MOVING_SPEED * self.room.highest, MOVING_ACCELERATION, 0.0)
    }

    /// One leg, rest to rest, and `dwell` seconds after it; nothing where there is no way to go.
    fn to(&mut self, end: f64, speed: f64, acceleration: f64, dwell: f64) -> Result<(), CampaignError> {
        if (end - self.position).abs() <= ROUNDING * self.room.length() {
            return Ok(());
        }
        let point = |value: f64| {
            let mut point = vec![0.0; self.kinds.len()];
            point[self.place] = value;
            point
        };
        let block = Block::line(&point(self.position), &point(end), &self.kinds)
            .map_err(|error| CampaignError::Path { axis: self.room.axis.name().to_owned(), error })?;
        let limits =
            PathLimits { acceleration: acceleration * self.room.limits().acceleration, jerk: f64::INFINITY };
        self.moves.push(Move { limits, dwell, ..Move::new(block, speed) });
        self.position = end;
        Ok(())
    }

    fn program(self, machine: &MachineConfig) -> Result<Program, CampaignError> {
        let limits: Vec<JointLimits> = machine.axes().iter().map(JointLimits::of_axis).collect();
        let period = machine.periods().position;
        Program::plan(Kinematics::new(machine), Frame::Joints, &limits, period, self.rest, self.moves)
            .map_err(|error| CampaignError::Plan { axis: self.room.axis.name().to_owned(), error })
    }
}
