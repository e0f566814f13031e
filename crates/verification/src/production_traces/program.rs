//! Random part programs for three linear axes.

use std::error::Error;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::RangeInclusive;

use virtual_axes_core::config::{AxisKind, LimitsConfig, Parameters, Value, ValueSource};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::path::{Block, Frame, Move, PathError, PlanError, Program};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::{METER_PER_MINUTE, MILLISECOND_NS};

use crate::random::{RandomSource, stream};

/// Names of the joints of a program.
pub(super) const JOINT_NAMES: [&str; 3] = ["x", "y", "z"];
const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;
const KINDS: [AxisKind; 3] = [AxisKind::Linear; 3];
/// Range of the duration of a program, s.
const DURATION: RangeInclusive<f64> = 3.0..=60.0;
/// Period of the setpoints that satisfy the limits; Tsp is a multiple of it.
const PLANNING_PERIOD: i64 = MILLISECOND_NS;
/// Rest before the first move, s.
const REST: f64 = 0.4;
/// Half width of the working area in X and Y, m.
const WORKING_AREA: f64 = 0.1;

/// Random part program of rapids, short feeds, arcs and dwells in X, Y and Z, limited in jerk.
///
/// Long rapids have a constant-velocity phase of 0.1 to 0.3 s at rapid feed, mostly in one direction per axis; the
/// opposite way consists of shorter rapids. Drilling moves Z, milling moves X and Y in short lines and arcs.
#[derive(Debug, Clone, PartialEq)]
pub struct ProductionProgram {
    program: Program,
    duration: f64,
}

impl ProductionProgram {
    /// Draws program `seed` for axes X, Y, Z with `limits`, cut off after `duration` s, 3 to 60 s.
    ///
    /// # Errors
    /// An error if the duration is out of range or the program cannot be planned.
    pub fn draw(seed: u64, duration: f64, limits: &[LimitsConfig; 3]) -> Result<Self, Box<dyn Error>> {
        if !DURATION.contains(&duration) {
            return Err(format!("the duration is {duration} s, must be from 3 to 60").into());
        }
        let mut draft = ProgramDraft::new(seed, limits);
        draft.draw(duration).map_err(PlanError::from)?;
        let mut program = Self::plan(draft, limits)?;
        program.duration = program.duration.min(duration);
        Ok(program)
    }

    /// Draws program `seed` of `count` rapids of all axes, 20 to 200 mm long, in alternating directions, each with a dwell.
    ///
    /// # Errors
    /// An error if the program cannot be planned.
    pub fn draw_rapids(seed: u64, count: usize, limits: &[LimitsConfig; 3]) -> Result<Self, Box<dyn Error>> {
        let mut draft = ProgramDraft::new(seed, limits);
        for k in 0..count {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let step = draft.direction.map(|direction| sign * direction * draft.random.between(0.02, 0.2));
            draft.rapid_by(step).map_err(PlanError::from)?;
            draft.dwell(0.2, 0.5);
        }
        Self::plan(draft, limits)
    }

    fn plan(draft: ProgramDraft, limits: &[LimitsConfig; 3]) -> Result<Self, Box<dyn Error>> {
        let names = JOINT_NAMES.map(str::to_owned).to_vec();
        let mut parameters = Parameters::embedded_default()?;
        parameters.set("joints", Value::TextList(names), &ValueSource::named("program"))?;
        let kinematics = Kinematics::new(&parameters.machine_config()?);
        let joint = |(name, limits): (&str, &LimitsConfig)| JointLimits {
            name: name.to_owned(),
            kind: AxisKind::Linear,
            limits: *limits,
        };
        let joints: Vec<JointLimits> = JOINT_NAMES.into_iter().zip(limits).map(joint).collect();
        let program = Program::plan(kinematics, Frame::Joints, &joints, PLANNING_PERIOD, REST, draft.moves)?;
        Ok(ProductionProgram { duration: program.duration(), program })
    }

    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the position setpoint of joint 0 (X), 1 (Y) or 2 (Z) at time `t` in s, m; 0 for other joints.
    pub fn psec(&self, joint: usize, t: f64) -> f64 {
        let mut joints = [0.0; 3];
        self.program.psec(t, &mut joints);
        joints.get(joint).copied().unwrap_or(0.0)
    }
}

/// Moves of a program under construction.
struct ProgramDraft {
    random: RandomSource,
    limits: [LimitsConfig; 3],
    /// Direction of most long rapids per axis, −1 or 1.
    direction: [f64; 3],
    position: [f64; 3],
    moves: Vec<Move>,
    /// Estimated duration of the moves, s.
    time: f64,
}

impl ProgramDraft {
    fn new(seed: u64, limits: &[LimitsConfig; 3]) -> Self {
        let mut random = RandomSource::new(seed, stream::PROGRAM);
        let direction = [(); 3].map(|()| random.sign());
        ProgramDraft { random, limits: *limits, direction, position: [0.0; 3], moves: Vec::new(), time: REST }
    }

    /// Draws operations until the estimated duration exceeds `duration` s.
    fn draw(&mut self, duration: f64) -> Result<(), PathError> {
        if self.random.chance(0.5) {
            self.excursion(&[Z])?;
            self.excursion(&[X, Y])?;
        } else {
            self.excursion(&[X, Y])?;
            self.excursion(&[Z])?;
        }
        while self.time < duration {
            match self.random.below(10) {
                0..5 => self.drilling()?,
                5..8 => self.milling()?,
                _ => self.tool_change()?,
            }
        }
        Ok(())
    }

    /// Adds a long rapid of `joints` together and the way back in two or three shorter rapids, or the reverse.
    fn excursion(&mut self, joints: &[usize]) -> Result<(), PathError> {
        let constant = self.random.between(0.1, 0.3);
        let is_usual = self.random.chance(0.85);
        let mut step = [0.0; 3];
        for &joint in joints {
            let length = ramp_length(&self.limits[joint]) + constant * self.limits[joint].velocity;
            step[joint] = self.direction[joint] * length;
        }
        let pieces = 2 + self.random.below(2);
        // The long rapid leads in the usual direction. Otherwise it leads back, after shorter ones in that direction.
        if is_usual {
            self.rapid_by(step)?;
            self.dwell(0.1, 0.4);
        }
        let sign = if is_usual { -1.0 } else { 1.0 };
        for _ in 0..pieces {
            self.rapid_by(step.map(|length| sign * length / pieces as f64))?;
            self.dwell(0.05, 0.3);
        }
        if !is_usual {
            self.rapid_by(step.map(|length| -length))?;
            self.dwell(0.1, 0.4);
        }
        Ok(())
    }

    /// Adds one to five holes: a short rapid in X and Y, then Z down, through the hole, and up.
    fn drilling(&mut self) -> Result<(), PathError> {
        for _ in 0..1 + self.random.below(5) {
            self.rapid_in_working_area(0.04)?;
            let (approach, depth) = (self.random.between(0.02, 0.08), self.random.between(0.005, 0.02));
            self.rapid_by([0.0, 0.0, -approach])?;
            let feed = self.random.between(0.3, 2.0);
            self.feed_by([0.0, 0.0, -depth], feed)?;
            if self.random.chance(0.5) {
                self.dwell(0.1, 0.5);
            }
            self.rapid_by([0.0, 0.0, approach + depth])?;
        }
        Ok(())
    }

    /// Adds a contour of short lines and arcs in X and Y, with Z down.
    fn milling(&mut self) -> Result<(), PathError> {
        self.rapid_in_working_area(2.0 * WORKING_AREA)?;
        let depth = self.random.between(0.02, 0.1);
        self.rapid_by([0.0, 0.0, -depth])?;
        for _ in 0..2 + self.random.below(4) {
            let feed = self.random.between(2.0, 8.0);
            if self.random.chance(0.4) {
                self.arc(feed)?;
            } else {
                let (length, angle) = (self.random.between(0.005, 0.06), TAU * self.random.unit());
                // Half of the lines are parallel to an axis.
                let angle =
                    if self.random.chance(0.5) { (angle / FRAC_PI_2).floor() * FRAC_PI_2 } else { angle };
                self.feed_by([length * angle.cos(), length * angle.sin(), 0.0], feed)?;
            }
        }
        self.dwell(0.1, 0.8);
        self.rapid_by([0.0, 0.0, depth])
    }

    /// Adds the way to the tool changer and back, with a dwell.
    fn tool_change(&mut self) -> Result<(), PathError> {
        self.excursion(&[Z])?;
        self.dwell(0.3, 1.5);
        if self.random.chance(0.6) {
            let joints: &[usize] = [&[X, Y][..], &[X], &[Y]][self.random.below(3)];
            self.excursion(joints)?;
        }
        Ok(())
    }

    fn arc(&mut self, feed: f64) -> Result<(), PathError> {
        let (radius, angle) = (self.random.between(0.005, 0.03), TAU * self.random.unit());
        let sweep = self.random.sign() * self.random.between(FRAC_PI_2, TAU);
        let center = [self.position[X] + radius * angle.cos(), self.position[Y] + radius * angle.sin()];
        let block = Block::arc(&self.position, [X, Y], center, sweep, &self.position, &KINDS)?;
        self.add(block, feed * METER_PER_MINUTE);
        Ok(())
    }

    /// Adds a rapid in X and Y by up to `distance` m per axis within the working area.
    fn rapid_in_working_area(&mut self, distance: f64) -> Result<(), PathError> {
        let mut step = [0.0; 3];
        for joint in [X, Y] {
            let from = self.position[joint];
            let target = from + self.random.between(-distance, distance);
            step[joint] = target.clamp(-WORKING_AREA, WORKING_AREA) - from;
        }
        // Many holes lie in a row.
        if self.random.chance(0.6) {
            step[self.random.below(2)] = 0.0;
        }
        self.rapid_by(step)
    }

    fn rapid_by(&mut self, step: [f64; 3]) -> Result<(), PathError> {
        // The axis limits bound the feed.
        let feed = self.limits.iter().map(|limits| limits.velocity).sum();
        self.line_by(step, feed)
    }

    fn feed_by(&mut self, step: [f64; 3], feed: f64) -> Result<(), PathError> {
        self.line_by(step, feed * METER_PER_MINUTE)
    }

    fn line_by(&mut self, step: [f64; 3], feed: f64) -> Result<(), PathError> {
        if step.iter().all(|length| length.abs() < 1e-6) {
            return Ok(());
        }
        let mut target = self.position;
        target.iter_mut().zip(step).for_each(|(value, length)| *value += length);
        let block = Block::line(&self.position, &target, &KINDS)?;
        self.add(block, feed);
        Ok(())
    }

    fn add(&mut self, block: Block, feed: f64) {
        let limits = &self.limits[X];
        let feed_reached = feed.min(limits.velocity);
        self.time +=
            block.length() / feed_reached + feed_reached / limits.acceleration + ramp_jerk_time(limits);
        self.position.copy_from_slice(block.end());
        self.moves.push(Move::new(block, feed));
    }

    /// Adds a random dwell of `low` to `high` s after the last move.
    fn dwell(&mut self, low: f64, high: f64) {
        let dwell = self.random.between(low, high);
        if let Some(last) = self.moves.last_mut() {
            last.dwell += dwell;
            self.time += dwell;
        }
    }
}

fn ramp_jerk_time(limits: &LimitsConfig) -> f64 {
    limits.acceleration / limits.jerk
}

/// Returns the length of acceleration to Vmax and deceleration, m.
fn ramp_length(limits: &LimitsConfig) -> f64 {
    let acceleration = limits.acceleration.min((limits.velocity * limits.jerk).sqrt());
    limits.velocity * (limits.velocity / acceleration + acceleration / limits.jerk)
}
