//! Planner of the legs of a campaign part.

use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::path::{Block, Frame, Move, PathLimits, Program};
use virtual_axes_core::trajectory::JointLimits;

use super::error::CampaignError;
use super::travel_limits::{CONSTANT, MOVING_ACCELERATION, ROUNDING, SWEEPS, TravelLimits};

/// Lowest speed, m/min or rev/min; at a resolution of 1 µm or 1 mdeg still hundreds of increments per second.
const LOWEST_SPEED: f64 = 0.05;
/// Largest ratio of lowest to highest speed, so that slow axes have a range of speeds, too.
const LEAST_SPREAD: f64 = 1.0 / 40.0;
/// Number of speeds for the friction law: three per coefficient.
const SPEEDS: usize = 12;
/// Offset of the logarithmic speed scale in units of the lowest speed: spacing is uniform in ln(V + offset ·
/// lowest).
const EVEN_BELOW: f64 = 2.0;
/// Sufficient settled time at constant speed, s; shorter legs are repeated.
const ENOUGH_CONSTANT: f64 = 1.5;
/// Largest number of round trips at one speed; four times the shortest time is sufficient.
const MOST_REPEATS: f64 = 4.0;
/// Rest at start and end of a part, s.
const REST: f64 = 1.0;
/// Settled standstill at each position, s.
const STANDSTILL: f64 = 0.5;
/// Number of standstill positions.
const STANDSTILLS: usize = 5;
/// Positioning speed, relative to the highest.
const MOVING_SPEED: f64 = 0.5;
/// Speeds of the ramps, relative to the highest.
const RAMP_SPEEDS: [f64; 3] = [0.5, 0.75, 1.0];
/// Smallest ratio of ramp speed to the speed where the acceleration is just reached, so that it lasts;
/// limited to the highest speed.
const RAMP_LASTS: f64 = 1.5;
/// Accelerations of the ramps, relative to Amax.
const RAMP_ACCELERATIONS: [f64; 2] = [0.5, 1.0];
/// Number of round trips per ramp; together 72 acceleration phases.
const RAMP_ROUNDS: usize = 3;
/// Constant-speed time between two ramps, s.
const RAMP_CONSTANT: f64 = 0.1;
/// Speeds of the short parts, relative to the highest. The lower one is not a simple fraction, so that its
/// phases fall on different points of the sampling grid.
const SHORT_SPEEDS: [f64; 2] = [0.47, 1.0];
/// Number of round trips at each speed of the short parts.
const SHORT_ROUNDS: usize = 2;
/// Settled constant-speed time of the short parts, s.
const SHORT_CONSTANT: f64 = 0.5;

/// Planner of the legs of one part.
pub(super) struct CampaignPlanner<'a> {
    limits: &'a TravelLimits<'a>,
    axis_index: usize,
    kinds: Vec<AxisKind>,
    position: f64,
    moves: Vec<Move>,
}

impl<'a> CampaignPlanner<'a> {
    pub fn new(machine: &MachineConfig, axis_index: usize, limits: &'a TravelLimits<'a>) -> Self {
        let kinds = machine.axes().iter().map(AxisConfig::kind).collect();
        CampaignPlanner { limits, axis_index, kinds, position: limits.start, moves: Vec::new() }
    }

    pub fn plan_off(&mut self) -> Result<Vec<f64>, CampaignError> {
        let speeds = self.speeds();
        self.move_into_window()?;
        for (i, &speed) in speeds.iter().enumerate() {
            let constant = self.limits.constant_speed_time(speed, CONSTANT);
            let rounds = if constant < ENOUGH_CONSTANT { (ENOUGH_CONSTANT / constant).ceil() } else { 1.0 };
            let length = self.limits.leg_length(speed, 1.0, constant);
            // A standstill before the first leg gives a slow start in both directions.
            let dwell = if i == 0 { STANDSTILL } else { 0.0 };
            self.add_round_trips(length, speed, 1.0, rounds.min(MOST_REPEATS) as usize, dwell)?;
        }
        self.add_standstills()?;
        if self.limits.axis.kind == AxisKind::Rotary {
            for part in SWEEPS {
                let [low, high] = self.limits.window;
                self.position_to(low)?;
                for end in [high, low] {
                    self.add_leg(end, part * self.limits.max_speed, MOVING_ACCELERATION, 0.0)?;
                }
            }
        }
        for acceleration in RAMP_ACCELERATIONS {
            let lasting =
                (RAMP_LASTS * self.limits.saturating_speed(acceleration)).min(self.limits.max_speed);
            for part in RAMP_SPEEDS {
                let speed = lasting.max(part * self.limits.max_speed);
                let length = 2.0 * self.limits.ramp_length(speed, acceleration) + speed * RAMP_CONSTANT;
                let length = length.min(self.limits.length());
                self.add_round_trips(length, speed, acceleration, RAMP_ROUNDS, 0.0)?;
            }
        }
        self.return_to_start()?;
        Ok(speeds)
    }

    pub fn plan_short(&mut self) -> Result<Vec<f64>, CampaignError> {
        self.move_into_window()?;
        let speeds = SHORT_SPEEDS.map(|part| part * self.limits.max_speed);
        for speed in speeds {
            let constant = self.limits.constant_speed_time(speed, SHORT_CONSTANT);
            self.add_round_trips(
                self.limits.leg_length(speed, 1.0, constant),
                speed,
                1.0,
                SHORT_ROUNDS,
                0.0,
            )?;
        }
        self.return_to_start()?;
        Ok(speeds.to_vec())
    }

    /// Returns the speeds for the friction law in rising order.
    fn speeds(&self) -> Vec<f64> {
        let highest = self.limits.max_speed;
        let lowest = (LOWEST_SPEED * self.limits.axis.units().speed).min(LEAST_SPREAD * highest);
        let offset = EVEN_BELOW * lowest;
        let ratio = (highest + offset) / (lowest + offset);
        let speed = |i: usize| (lowest + offset) * ratio.powf(i as f64 / (SPEEDS - 1) as f64) - offset;
        (0..SPEEDS).map(|i| speed(i).min(highest)).collect()
    }

    /// Adds standstills at each position, approached from below, then from above.
    fn add_standstills(&mut self) -> Result<(), CampaignError> {
        let [low, high] = self.limits.window;
        let position = |i: usize| low + (high - low) * (i as f64 + 0.5) / STANDSTILLS as f64;
        let dwell = self.limits.settling_time + STANDSTILL;
        self.position_to(low)?;
        for i in 0..STANDSTILLS {
            self.add_leg(position(i), MOVING_SPEED * self.limits.max_speed, MOVING_ACCELERATION, dwell)?;
        }
        self.position_to(high)?;
        for i in (0..STANDSTILLS).rev() {
            self.add_leg(position(i), MOVING_SPEED * self.limits.max_speed, MOVING_ACCELERATION, dwell)?;
        }
        Ok(())
    }

    /// Adds round trips of `length` from the present position, or from the lower end of the window if they do
    /// not fit.
    fn add_round_trips(
        &mut self,
        length: f64,
        speed: f64,
        acceleration: f64,
        rounds: usize,
        dwell: f64,
    ) -> Result<(), CampaignError> {
        let [low, high] = self.limits.window;
        let slack = ROUNDING * (high - low);
        if self.position + length > high + slack && self.position - length < low - slack {
            self.position_to(low)?;
        }
        let from = self.position;
        let end =
            if from + length <= high + slack { (from + length).min(high) } else { (from - length).max(low) };
        for _ in 0..rounds {
            self.add_leg(end, speed, acceleration, dwell)?;
            self.add_leg(from, speed, acceleration, dwell)?;
        }
        Ok(())
    }

    /// Adds a leg from the start into the window.
    fn move_into_window(&mut self) -> Result<(), CampaignError> {
        let [low, high] = self.limits.window;
        self.position_to(self.position.clamp(low, high))
    }

    /// Adds a leg back to the start and a rest there.
    fn return_to_start(&mut self) -> Result<(), CampaignError> {
        self.position_to(self.limits.start)?;
        if let Some(last) = self.moves.last_mut() {
            last.dwell += REST;
        }
        Ok(())
    }

    fn position_to(&mut self, end: f64) -> Result<(), CampaignError> {
        self.add_leg(end, MOVING_SPEED * self.limits.max_speed, MOVING_ACCELERATION, 0.0)
    }

    /// Adds one leg from rest to rest, followed by `dwell` seconds; no leg if the distance is zero.
    fn add_leg(&mut self, end: f64, speed: f64, acceleration: f64, dwell: f64) -> Result<(), CampaignError> {
        let near = |a: f64, b: f64| (a - b).abs() <= ROUNDING * self.limits.length();
        // An end of the window can differ from the start by rounding; parts must end exactly at the start.
        let end = if near(end, self.limits.start) { self.limits.start } else { end };
        if near(end, self.position) {
            return Ok(());
        }
        let point = |value: f64| {
            let mut point = vec![0.0; self.kinds.len()];
            point[self.axis_index] = value;
            point
        };
        let block = Block::line(&point(self.position), &point(end), &self.kinds)
            .map_err(|error| CampaignError::Path { axis: self.limits.axis.name().to_owned(), error })?;
        let limits = PathLimits {
            acceleration: acceleration * self.limits.axis_limits().acceleration,
            jerk: f64::INFINITY,
        };
        self.moves.push(Move { limits, dwell, ..Move::new(block, speed) });
        self.position = end;
        Ok(())
    }

    pub fn program(self, machine: &MachineConfig) -> Result<Program, CampaignError> {
        let limits: Vec<JointLimits> = machine.axes().iter().map(JointLimits::from_axis).collect();
        let period = machine.periods().position;
        Program::plan(Kinematics::new(machine), Frame::Joints, &limits, period, REST, self.moves)
            .map_err(|error| CampaignError::Plan { axis: self.limits.axis.name().to_owned(), error })
    }
}
