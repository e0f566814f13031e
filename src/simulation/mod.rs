//! The machine under way: trajectories in, samples and figures out, one position period at a time.
//!
//! The node and the offline command run the same [`Simulation`]; the node paces it and computes
//! nothing that the offline run does not.

mod load;
mod motion;
mod tolerance;

pub use load::MAX_LOAD;
pub use motion::{Abort, MotionEnd, Outcome};
pub use tolerance::{Quantity, Tolerance, Tolerances, Violation};

use std::sync::Arc;

use crate::config::{AxisKind, MachineConfig, Periods};
use crate::machine::{AxisSample, Machine, MachineError, MachineParameters};
use crate::trajectory::{
    Admission, Event, JointLimits, JointSet, MotionId, Rejection, StreamCounts, StreamEnd, Timeline,
    TimelineError, Trajectory,
};
use crate::units::{MILLISECOND_NS, Nanoseconds, SECOND_NS, seconds};

use load::Loads;
use motion::Motions;

/// Velocity below which an axis counts as standing, m/s or rad/s.
const STANDSTILL: f64 = 1e-4;
/// How far an axis may overshoot its stroke before that is said, m or rad.
const OVERSHOOT: f64 = 1e-3;
/// How long after the last motion the axes count as settling.
const SETTLING: Nanoseconds = SECOND_NS;
/// How far contour errors look ahead of the set-point: longer than an axis runs ahead of it.
const LOOK_AHEAD: Nanoseconds = 100 * MILLISECOND_NS;
/// Most set-points that contour errors look ahead, well inside what they remember.
const MOST_AHEAD: u32 = 128;

/// Why there is no simulation of a machine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// An axis cannot be discretised.
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
    /// Set-points of the next periods, as many for each axis.
    ahead: Vec<f64>,
    origin: Nanoseconds,
    period: Nanoseconds,
    /// The position instant that the next step computes.
    next: i64,
    /// Whether anything has moved the machine since it was last put at rest.
    awake: bool,
    loads: Loads,
    motions: Motions,
    /// The instant after which nothing is settling any more.
    settled_from: i64,
    samples: Vec<AxisSample>,
    /// Whether an axis was at a limit at any tick since the last sample.
    saturated: Vec<bool>,
    ends: Vec<MotionEnd>,
}

impl Simulation {
    /// The machine of `config` at rest at home, its first position instant at `origin` (ns), for
    /// trajectories checked against `joints` (see [`joints`]).
    ///
    /// # Errors
    /// [`SimulationError`] if an axis cannot be discretised or there are too many joints.
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
            origin,
            period,
            next: 0,
            awake: false,
            settled_from: 0,
            samples,
            ends: Vec::new(),
        })
    }

    /// Time of position instant k, ns.
    pub fn time_of(&self, k: i64) -> Nanoseconds {
        self.origin + k * self.period
    }

    /// The position instant that the next [`step`](Self::step) computes.
    pub fn next_instant(&self) -> i64 {
        self.next
    }

    /// Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.period
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Gives the axes a trajectory; it takes effect at its start.
    ///
    /// # Errors
    /// [`Rejection`] if it cannot follow what is commanded at its start; nothing changes then.
    pub fn offer(&mut self, id: MotionId, trajectory: Arc<Trajectory>) -> Result<Admission, Rejection> {
        let places = trajectory.joints().to_vec();
        let admission = self.timeline.offer(id, trajectory, self.origin)?;
        self.motions.accept(id, &places);
        Ok(admission)
    }

    /// Likewise, and the motion ends as soon as it does not keep `tolerances`; see [`Outcome`].
    ///
    /// # Errors
    /// As [`offer`](Self::offer).
    pub fn offer_within(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        tolerances: Tolerances,
    ) -> Result<Admission, Rejection> {
        let _ = tolerances;
        self.offer(id, trajectory)
    }

    /// Calls a motion off: its joints come to rest within their limits, and it ends as
    /// [`Outcome::Cancelled`] when they are commanded to rest. One that waits is discarded. `false` if
    /// there is no such motion.
    pub fn cancel(&mut self, id: MotionId) -> bool {
        let _ = id;
        false
    }

    /// Continues at `time` (ns) with the next position instant, because the clock that is followed
    /// jumped there: motions end as aborted, the axes come to rest where they are commanded to be.
    pub fn jump_to(&mut self, time: Nanoseconds) {
        let _ = time;
    }

    /// Sets one set-point of a stream, m or rad, for the next position instant; `false` while a
    /// trajectory or a stop has the joint, and after a stop until the stream has paused. It is commanded
    /// [`stream_delay`](Self::stream_delay) later. A stream is no motion: it has no figures and no end.
    ///
    /// # Errors
    /// [`Rejection`] as of [`Timeline::stream`]; nothing changes then.
    pub fn stream(&mut self, place: usize, position: f64) -> Result<bool, Rejection> {
        self.timeline.stream(place, position)
    }

    /// Likewise, `sent` (ns) by the sender's clock; see [`Timeline::stream_sent`].
    ///
    /// # Errors
    /// As [`stream`](Self::stream).
    pub fn stream_sent(
        &mut self,
        place: usize,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<bool, Rejection> {
        self.timeline.stream_sent(place, position, sent)
    }

    /// Whether set-points come that are ignored after a stop.
    pub fn is_stream_held_off(&self) -> bool {
        self.timeline.is_stream_held_off()
    }

    /// What the streams did, since the beginning.
    pub fn stream_counts(&self) -> StreamCounts {
        self.timeline.stream_counts()
    }

    /// What last took joints away from a stream that drove them, and which; told once.
    pub fn take_stream_end(&mut self) -> Option<(StreamEnd, JointSet)> {
        self.timeline.take_stream_end()
    }

    /// Delay of streamed set-points that is in effect, ns: as many position periods as the controllers
    /// look ahead. After [`adopt`](Self::adopt) it changes when the stream pauses, see
    /// [`Timeline::set_stream_delay`].
    pub fn stream_delay(&self) -> Nanoseconds {
        Nanoseconds::from(self.timeline.stream_delay()) * self.period
    }

    /// Whether a stream drives, moving or not: see [`Timeline::is_streaming`].
    pub fn is_streaming(&self) -> bool {
        self.timeline.is_streaming()
    }

    /// External force or torque on an axis (N or N·m, positive towards plus) from the next position
    /// instant on, for `hold` ns; limited to ±[`MAX_LOAD`], and none if it is NaN.
    pub fn set_load(&mut self, axis: usize, load: f64, hold: Nanoseconds) {
        let until = self.next + hold.max(0).div_euclid(self.period).max(1);
        self.loads.set(axis, load, until);
    }

    /// Takes over changed gains, weights or delays at the next position instant.
    ///
    /// # Errors
    /// [`MachineError::AnotherMachine`] if joints or periods differ; nothing changes then.
    pub fn adopt(&mut self, parameters: Arc<MachineParameters>) -> Result<(), MachineError> {
        self.machine.adopt(parameters)?;
        self.timeline.set_stream_delay(stream_delay(&self.machine));
        Ok(())
    }

    /// Puts the machine back to rest at home; motions under way end as aborted.
    pub fn reset(&mut self) {
        let home = vec![0.0; self.machine.axis_count()];
        // Home is finite and has one value per joint: this cannot be refused.
        let _ = self.reset_to(&home);
    }

    /// Puts the machine to rest at `positions` (m or rad, one per joint); motions under way end as
    /// aborted.
    ///
    /// # Errors
    /// [`Rejection`] for a position that is not finite or not one per joint; nothing changes then.
    pub fn reset_to(&mut self, positions: &[f64]) -> Result<(), Rejection> {
        self.timeline.reset(positions)?;
        self.machine.reset(positions);
        self.loads.clear();
        self.motions.abort_all(Abort::Reset, self.time_of(self.next), &mut self.ends);
        self.saturated.fill(false);
        self.awake = false;
        self.settled_from = self.next;
        self.take_samples();
        Ok(())
    }

    /// Computes the next position instant: its samples, and the ticks up to the one after.
    pub fn step(&mut self) {
        self.step_with(|_, _| ());
    }

    /// Likewise, showing the machine to `observe` at every tick, as [`Machine::advance_with`] does;
    /// its second argument tells the first tick of the period. A machine that nothing has moved yet
    /// has no ticks to show.
    pub fn step_with(&mut self, observe: impl FnMut(&Machine, bool)) {
        let k = self.next;
        self.timeline.next();
        self.follow_timeline_events(k);
        self.awake |= self.motions.any_running() || self.loads.any();
        if !self.awake && self.timeline.is_stream_moving() {
            self.wake_at_rest();
        }
        if self.awake {
            self.motions.look_ahead(&self.timeline);
            self.loads.apply(&mut self.machine, k);
            self.look_ahead();
            self.run_ticks(observe);
        }
        self.motions.finish(k, self.origin + k * self.period, &mut self.ends);
        if self.is_asked() {
            self.settled_from = k + 1 + SETTLING / self.period;
        }
        self.next = k + 1;
    }

    /// A position period at rest: of a machine that has moved nothing the first set-point counts as the
    /// one before it too, and a stream's first need not be where the machine stands.
    fn wake_at_rest(&mut self) {
        let rest: Vec<f64> = self.samples.iter().map(|sample| sample.psec).collect();
        self.machine.advance(&rest);
        self.awake = true;
    }

    fn follow_timeline_events(&mut self, k: i64) {
        let now = self.time_of(k);
        let delay = self.longest_delay();
        for event in self.timeline.events() {
            match *event {
                Event::Started(id) => self.motions.start(id),
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

    /// Position periods until the last set-point has passed every delay.
    fn longest_delay(&self) -> i64 {
        let tick = self.machine.periods().current;
        let delay = self.machine.longest_delay() as Nanoseconds * tick;
        delay.unsigned_abs().div_ceil(self.period.unsigned_abs()) as i64
    }

    /// The set-points that controllers read ahead, as they are known now.
    fn look_ahead(&mut self) {
        let horizon = self.machine.horizon();
        self.ahead.clear();
        for joint in 0..self.machine.axis_count() {
            self.ahead.extend((1..=horizon).filter_map(|j| self.timeline.psec_ahead(joint, j as u32)));
        }
    }

    fn run_ticks(&mut self, mut observe: impl FnMut(&Machine, bool)) {
        let Simulation { machine, timeline, ahead, motions, samples, saturated, .. } = self;
        let mut position_instant = true;
        machine.advance_with(timeline.psec(), ahead, |m: &Machine| {
            for ((axis, sample), saturated) in m.axes().iter().zip(samples.iter_mut()).zip(&mut *saturated) {
                *saturated |= axis.sample().saturated;
                if position_instant {
                    *sample = AxisSample { saturated: *saturated, ..*axis.sample() };
                    *saturated = false;
                }
            }
            motions.observe(m, position_instant);
            observe(m, position_instant);
            position_instant = false;
        });
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
        let inside = joint.limits.stroke_min - OVERSHOOT..=joint.limits.stroke_max + OVERSHOOT;
        !inside.contains(&sample.position)
    }

    /// Set-point of a joint `periods` instants after the next one, m or rad, by what is known now;
    /// none for a joint that there is not.
    pub fn psec_ahead(&self, joint: usize, periods: u32) -> Option<f64> {
        self.timeline.psec_ahead(joint, periods.saturating_add(1))
    }

    /// Whether a trajectory or a stop moves the set-points.
    pub fn is_moving(&self) -> bool {
        self.timeline.is_moving()
    }
}

/// Position periods that contour errors look ahead of the set-point.
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
