//! The machine under way: trajectories in, samples and figures out, one position period at a time.
//!
//! The node and the offline command run the same [`Simulation`]; the node paces it and computes
//! nothing that the offline run does not.

mod ask;
mod load;
mod motion;
mod tolerance;

pub use load::MAX_LOAD;
pub use motion::{Abort, MotionEnd, Outcome};
pub use tolerance::{Quantity, Tolerance, Tolerances, Violation};

use std::sync::Arc;

use crate::config::{AxisKind, MachineConfig, Periods};
use crate::machine::{AxisSample, Machine, MachineError, MachineParameters, Width};
use crate::trajectory::{Event, JointLimits, Timeline, TimelineError};
use crate::units::{MILLISECOND_NS, Nanoseconds, SECOND_NS, seconds};

use load::Loads;
use motion::{Grid, Motions};
use tolerance::Errors;

/// Velocity below which an axis counts as standing, m/s or rad/s.
const STANDSTILL: f64 = 1e-4;
/// How long after the last motion the axes count as settling.
const SETTLING: Nanoseconds = SECOND_NS;
/// How far contour errors look ahead of the setpoint: longer than an axis runs ahead of it.
const LOOK_AHEAD: Nanoseconds = 100 * MILLISECOND_NS;
/// Most setpoints that contour errors look ahead, well inside what they remember.
const MOST_AHEAD: u32 = 128;

/// Why there is no simulation of a machine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// An axis cannot be discretized.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Number of joints or position period out of range.
    #[error(transparent)]
    Timeline(#[from] TimelineError),
}

/// A machine with the trajectories that it has been given.
///
/// Position instant k is at `origin + k·Tsp`; the first is k = 0. Until the first trajectory starts, a
/// stream first moves a joint or the first load acts, the machine stands still at its start position, exactly: what a trajectory
/// does afterwards does not depend on how long it was waited for.
#[derive(Debug)]
pub struct Simulation {
    machine: Machine,
    timeline: Timeline,
    /// Setpoints of the next periods, as many for each axis.
    ahead: Vec<f64>,
    grid: Grid,
    /// The position instant that the next step computes.
    next: i64,
    /// Whether anything has moved the machine since it was last put at rest.
    awake: bool,
    loads: Loads,
    motions: Motions,
    /// The instant after which nothing is settling any more.
    settled_from: i64,
    samples: Vec<AxisSample>,
    /// Whether an axis was at a limit at any tick behind the last sample.
    saturated: Vec<bool>,
    ends: Vec<MotionEnd>,
    /// Of each axis, at the last instants.
    errors: Vec<Errors>,
}

impl Simulation {
    /// The machine of `config` at rest at home, its first position instant at `origin` (ns), for
    /// trajectories checked against `joints` (see [`joints`]).
    ///
    /// # Errors
    /// [`SimulationError`] if an axis cannot be discretized or there are too many joints.
    pub fn new(
        config: &MachineConfig,
        joints: Vec<JointLimits>,
        origin: Nanoseconds,
    ) -> Result<Self, SimulationError> {
        let parameters = Arc::new(MachineParameters::new(config)?);
        let machine = Machine::new(parameters);
        let axes = config.axes();
        let kinds: Vec<AxisKind> = axes.iter().map(|a| a.kind()).collect();
        let home = vec![0.0; axes.len()];
        let samples = machine.axes().iter().map(|a| *a.sample()).collect();
        let Periods { position: period, current: tick, .. } = config.periods();
        let mut timeline = Timeline::new(joints, period, &home)?;
        timeline.set_stream_delay(stream_delay(&machine));
        Ok(Simulation {
            timeline,
            loads: Loads::new(axes.len()),
            motions: Motions::new(kinds, seconds(tick), horizon(period)),
            saturated: vec![false; axes.len()],
            ahead: Vec::with_capacity(machine.horizon() * axes.len()),
            machine,
            grid: Grid { origin, period },
            next: 0,
            awake: false,
            settled_from: 0,
            samples,
            ends: Vec::new(),
            errors: vec![Errors::default(); axes.len()],
        })
    }

    /// Whether motions that are accepted from now on are measured, as they are at first: the figures in
    /// the [`MotionEnd`]s of others are 0. For those who measure themselves.
    pub fn set_assessing(&mut self, assessing: bool) {
        self.motions.set_assessing(assessing);
    }

    /// How wide the processor's vectors are used from now on; the results are the same.
    pub fn set_width(&mut self, width: Width) {
        self.machine.set_width(width);
    }

    /// Time of position instant k, ns.
    pub fn time_of(&self, k: i64) -> Nanoseconds {
        self.grid.time_of(k)
    }

    /// The position instant that the next [`step`](Self::step) computes.
    pub fn next_instant(&self) -> i64 {
        self.next
    }

    /// Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.grid.period
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Computes the next position instant: its samples, and the ticks up to the one after.
    ///
    /// Whether the machine has run: one that nothing has moved yet stands still without being computed.
    pub fn step(&mut self) -> bool {
        self.step_by(|machine, psec, ahead| machine.advance(psec, ahead))
    }

    /// Likewise, showing the machine to `observe` at every tick, as [`Machine::advance_with`] does;
    /// its second argument tells the first tick of the period. A machine that nothing has moved yet
    /// has no ticks to show.
    pub fn step_with(&mut self, mut observe: impl FnMut(&Machine, bool)) -> bool {
        self.step_by(|machine, psec, ahead| {
            let mut position_instant = true;
            machine.advance_with(psec, ahead, |machine| {
                observe(machine, position_instant);
                position_instant = false;
            });
        })
    }

    fn step_by(&mut self, advance: impl FnOnce(&mut Machine, &[f64], &[f64])) -> bool {
        let k = self.next;
        self.timeline.next();
        self.follow_timeline_events(k);
        if !self.awake && self.timeline.is_stream_moving() {
            self.wake_at_rest();
        }
        self.awake |= self.motions.any_running() || self.loads.any();
        if self.awake {
            self.motions.look_ahead(&self.timeline);
            self.loads.apply(&mut self.machine, k);
            self.look_ahead();
            advance(&mut self.machine, self.timeline.psec(), &self.ahead);
            self.take_period();
        }
        for (errors, sample) in self.errors.iter_mut().zip(&self.samples) {
            errors.note(sample);
        }
        while let Some((id, violation)) = self.motions.strayed(&self.errors, self.grid.period) {
            self.timeline.cancel(id);
            self.motions.end(id, Outcome::PathTolerance(violation), self.time_of(k), &mut self.ends);
        }
        self.motions.finish(k, &self.errors, self.grid, &mut self.ends);
        if self.is_asked() {
            self.settled_from = k + 1 + SETTLING / self.grid.period;
        }
        self.next = k + 1;
        self.awake
    }

    /// A position period at rest: of a machine that has moved nothing the first setpoint counts as the
    /// one before it too, and a stream's first need not be where the machine stands.
    fn wake_at_rest(&mut self) {
        let rest: Vec<f64> = self.samples.iter().map(|sample| sample.psec).collect();
        self.machine.advance(&rest, &[]);
        self.awake = true;
    }

    fn follow_timeline_events(&mut self, k: i64) {
        let now = self.time_of(k);
        let delay = self.longest_delay();
        for event in self.timeline.events() {
            match *event {
                Event::Started(id) => self.motions.start(id),
                Event::Ended(id) if self.motions.is_canceled(id) => {
                    self.motions.end(id, Outcome::Canceled, now, &mut self.ends);
                }
                Event::Ended(id) => self.motions.finish_at(id, k + delay),
                Event::Displaced { id, by, .. } => {
                    self.motions.end(id, Outcome::Displaced { by }, now, &mut self.ends);
                }
                Event::Stopped { id, .. } => {
                    self.motions.end(id, Outcome::Stopped, now, &mut self.ends);
                }
            }
        }
    }

    /// Position periods until the last setpoint has passed every delay.
    fn longest_delay(&self) -> i64 {
        let tick = self.machine.periods().current;
        let delay = self.machine.longest_delay() as Nanoseconds * tick;
        delay.unsigned_abs().div_ceil(self.grid.period.unsigned_abs()) as i64
    }

    /// The setpoints that controllers read ahead, as they are known now.
    fn look_ahead(&mut self) {
        let horizon = self.machine.horizon();
        self.ahead.clear();
        for joint in 0..self.machine.axis_count() {
            self.ahead.extend((1..=horizon).filter_map(|j| self.timeline.psec_ahead(joint, j as u32)));
        }
    }

    /// Takes the samples of the position instant, and the figures of the period behind it.
    fn take_period(&mut self) {
        let axes = self.machine.axes().iter().enumerate();
        for (((place, axis), sample), saturated) in axes.zip(&mut self.samples).zip(&mut self.saturated) {
            let instant = axis.sample();
            let behind = self.machine.activity(place).saturated_ticks - u64::from(instant.saturated);
            *sample = AxisSample { saturated: *saturated || instant.saturated, ..*instant };
            *saturated = behind > 0;
        }
        self.motions.observe(&self.machine);
    }

    fn take_samples(&mut self) {
        for (sample, axis) in self.samples.iter_mut().zip(self.machine.axes()) {
            *sample = *axis.sample();
        }
    }

    /// Signals of every axis at the position instant that was computed last.
    pub fn samples(&self) -> &[AxisSample] {
        &self.samples
    }

    /// Motions that have ended since the last call.
    pub fn take_ends(&mut self) -> impl Iterator<Item = MotionEnd> + '_ {
        self.ends.drain(..)
    }

    /// Whether a trajectory waits, runs or has just ended, or a load acts. A stream does not count: it
    /// comes at the pace of its sender, which whoever computes ahead would run away from.
    pub fn is_asked(&self) -> bool {
        self.motions.any() || self.timeline.is_moving() || self.timeline.is_waiting() || self.loads.any()
    }

    /// Whether something is asked of the axes, or they still settle.
    pub fn is_busy(&self) -> bool {
        self.is_asked() || self.next < self.settled_from
    }

    /// Whether an axis really moves, faster than it creeps to rest.
    pub fn is_in_motion(&self) -> bool {
        self.samples.iter().any(|s| s.velocity.abs() > STANDSTILL)
    }

    /// Whether an axis stands outside its stroke, which a load or a step can make it do.
    pub fn is_outside_stroke(&self, place: usize) -> bool {
        let (Some(sample), Some(joint)) = (self.samples.get(place), self.timeline.joints().get(place)) else {
            return false;
        };
        joint.limits.is_left_by(sample.position)
    }

    /// Setpoint of a joint `periods` instants after the next one, m or rad, by what is known now;
    /// none for a joint that there is not.
    pub fn psec_ahead(&self, joint: usize, periods: u32) -> Option<f64> {
        self.timeline.psec_ahead(joint, periods.saturating_add(1))
    }

    /// Whether a trajectory or a stop moves the setpoints.
    pub fn is_moving(&self) -> bool {
        self.timeline.is_moving()
    }
}

/// Position periods that contour errors look ahead of the setpoint.
pub fn horizon(period: Nanoseconds) -> u32 {
    u32::try_from(LOOK_AHEAD / period.max(1)).unwrap_or(u32::MAX).clamp(1, MOST_AHEAD)
}

/// Position periods that a stream is delayed, for controllers that look as far ahead.
fn stream_delay(machine: &Machine) -> u32 {
    u32::try_from(machine.horizon()).unwrap_or(u32::MAX)
}

/// The joints of a machine as trajectories name and limit them, `prefix` before each name.
pub fn joints(config: &MachineConfig, prefix: &str) -> Vec<JointLimits> {
    let with_prefix = |joint: JointLimits| JointLimits { name: format!("{prefix}{}", joint.name), ..joint };
    config.axes().iter().map(|axis| with_prefix(JointLimits::of_axis(axis))).collect()
}
