//! The legs of a part, one after the other.

use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::path::{Block, Frame, Move, PathLimits, Program};
use virtual_axes_core::trajectory::JointLimits;

use super::CampaignError;
use super::room::{CONSTANT, MOVING_ACCELERATION, ROUNDING, Room, SWEEPS, Units};

/// Lowest speed, m/min or rev/min; at 1 µm or 1 mdeg of resolution still hundreds of increments per second.
const LOWEST_SPEED: f64 = 0.05;
/// The lowest speed is at most this part of the highest, so that a slow axis has a spread of speeds, too.
const LEAST_SPREAD: f64 = 1.0 / 40.0;
/// Speeds of the friction law: three for each of its four coefficients.
const SPEEDS: usize = 12;
/// Speeds are even in ln(V + this · lowest): nearly logarithmic, but with more of the high ones.
const EVEN_BELOW: f64 = 2.0;
/// Settled time at constant speed, s, that is enough; a leg with less is repeated.
const ENOUGH_CONSTANT: f64 = 1.5;
/// Most there-and-backs at one speed: the least constant time four times is enough.
const MOST_REPEATS: f64 = 4.0;
/// Rest at the start and at the end of a part, s.
const REST: f64 = 1.0;
/// Settled standstill at a place, s.
const STANDSTILL: f64 = 0.5;
/// Places of the standstills.
const PLACES: usize = 5;
/// Speed between places, as part of the highest.
const MOVING_SPEED: f64 = 0.5;
/// Speeds of the ramps, as parts of the highest.
const RAMP_SPEEDS: [f64; 3] = [0.5, 0.75, 1.0];
/// Their least speed over that at which the acceleration is just reached, so that it lasts for a while; they
/// are never faster than the highest.
const RAMP_LASTS: f64 = 1.5;
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

/// The legs of a part, one after the other.
pub(super) struct Legs<'a> {
    room: &'a Room<'a>,
    place: usize,
    kinds: Vec<AxisKind>,
    position: f64,
    moves: Vec<Move>,
}

impl<'a> Legs<'a> {
    pub fn new(machine: &MachineConfig, place: usize, room: &'a Room<'a>) -> Self {
        let kinds = machine.axes().iter().map(AxisConfig::kind).collect();
        Legs { room, place, kinds, position: room.start, moves: Vec::new() }
    }

    pub fn off(&mut self) -> Result<Vec<f64>, CampaignError> {
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
            let lasting = (RAMP_LASTS * self.room.reached(acceleration)).min(self.room.highest);
            for part in RAMP_SPEEDS {
                let speed = lasting.max(part * self.room.highest);
                let length = 2.0 * self.room.ramp(speed, acceleration) + speed * RAMP_CONSTANT;
                let length = length.min(self.room.length());
                self.there_and_back(length, speed, acceleration, RAMP_ROUNDS, 0.0)?;
            }
        }
        self.leave()?;
        Ok(speeds)
    }

    pub fn short(&mut self) -> Result<Vec<f64>, CampaignError> {
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
        let near = |a: f64, b: f64| (a - b).abs() <= ROUNDING * self.room.length();
        // An end of the window can be the start but for rounding; parts end where they started, bit for bit.
        let end = if near(end, self.room.start) { self.room.start } else { end };
        if near(end, self.position) {
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

    pub fn program(self, machine: &MachineConfig) -> Result<Program, CampaignError> {
        let limits: Vec<JointLimits> = machine.axes().iter().map(JointLimits::of_axis).collect();
        let period = machine.periods().position;
        Program::plan(Kinematics::new(machine), Frame::Joints, &limits, period, REST, self.moves)
            .map_err(|error| CampaignError::Plan { axis: self.room.axis.name().to_owned(), error })
    }
}
