//! Simulation of a machine: trajectories and streamed setpoints in, samples and figures out, one position
//! cycle at a time.
//!
//! The node and the offline commands run the same [`Simulation`]; the node paces it and adds no
//! computation of its own.

mod commands;
mod loads;
mod motions;
mod tolerance;

pub use motions::{AbortReason, MotionEnd, MotionOutcome};
pub use tolerance::{Quantity, Tolerance, ToleranceViolation, Tolerances};

use std::sync::Arc;

use crate::config::{AxisKind, MachineConfig};
use crate::machine::{AxisSample, Machine, MachineError, MachineParameters, SimdWidth};
use crate::trajectory::{JointLimits, MotionId, PathPlace, Timeline, TimelineError, TimelineEvent};
use crate::units::{MILLISECOND_NS, Nanoseconds, SECOND_NS};

use loads::AxisLoads;
use motions::{ActiveMotions, PositionGrid};
use tolerance::ErrorHistory;

/// Velocity below which an axis is at standstill, m/s or rad/s.
const STANDSTILL: f64 = 1e-4;
/// Settling time after the last command, ns.
const SETTLING: Nanoseconds = SECOND_NS;
/// Preview of the contour error, ns; longer than the lead of an axis ahead of its setpoint.
const CONTOUR_PREVIEW: Nanoseconds = 100 * MILLISECOND_NS;
/// Largest preview of the contour error, position cycles; well within the memory of the assessor.
const MAX_CONTOUR_PREVIEW: u32 = 128;

/// Failed construction of a [`Simulation`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// An axis cannot be discretized.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Number of joints or position cycle out of range.
    #[error(transparent)]
    Timeline(#[from] TimelineError),
}

/// Simulated machine with its accepted trajectories.
///
/// Position cycle k is at `origin + k·Tsp`; the first one is k = 0. Until the first trajectory starts, a
/// stream first moves a joint or the first load acts, the machine is exactly at rest at its start position.
/// Therefore the result of a trajectory does not depend on the waiting time before it.
#[derive(Debug, Clone)]
pub struct Simulation {
    machine: Machine,
    timeline: Timeline,
    /// Preview of setpoints for the controllers, m or rad, the same number for each axis.
    preview: Vec<f64>,
    grid: PositionGrid,
    /// Next position cycle.
    next: i64,
    /// The machine has moved since it was last reset.
    has_moved: bool,
    loads: AxisLoads,
    motions: ActiveMotions,
    /// First instant after settling.
    settled_from: i64,
    samples: Vec<AxisSample>,
    /// Saturation of each axis at any tick after the last sample.
    saturated: Vec<bool>,
    finished: Vec<MotionEnd>,
    errors: Vec<ErrorHistory>,
}

impl Simulation {
    /// Creates the simulation of the machine `config` at rest at home, with its first position cycle at
    /// `origin` (ns), for trajectories validated against `joints` (see [`joint_limits`]).
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
        let periods = config.periods();
        let period = periods.position;
        let mut timeline = Timeline::new(joints, period, &home)?;
        timeline.set_stream_delay(stream_delay(&machine));
        Ok(Simulation {
            timeline,
            loads: AxisLoads::new(axes.len()),
            motions: ActiveMotions::new(kinds, periods, contour_preview_cycles(period)),
            saturated: vec![false; axes.len()],
            preview: Vec::with_capacity(machine.preview_length() * axes.len()),
            machine,
            grid: PositionGrid { origin, period },
            next: 0,
            has_moved: false,
            settled_from: 0,
            samples,
            finished: Vec::new(),
            errors: vec![ErrorHistory::default(); axes.len()],
        })
    }

    /// Enables or disables the assessment of motions accepted from now on; it is enabled at first. Without
    /// assessment the figures of [`MotionEnd`] are 0.
    pub fn set_assessing(&mut self, is_assessing: bool) {
        self.motions.set_assessing(is_assessing);
    }

    /// Sets the SIMD width used from now on; the results do not depend on it.
    pub fn set_simd_width(&mut self, width: SimdWidth) {
        self.machine.set_simd_width(width);
    }

    /// Returns the time of position cycle k, ns.
    pub fn time_of(&self, k: i64) -> Nanoseconds {
        self.grid.time_of(k)
    }

    /// Returns the position cycle that the next [`step`](Self::step) computes.
    pub fn next_instant(&self) -> i64 {
        self.next
    }

    /// Returns the position cycle Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.grid.period
    }

    /// Records the controller outputs of every tick, for the energy of the axes; see
    /// [`Machine::record_every_tick`](crate::machine::Machine::record_every_tick).
    pub fn record_every_tick(&mut self, every_tick: bool) {
        self.machine.record_every_tick(every_tick);
    }

    /// Returns the simulated machine.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Steps the simulation by one position cycle: samples of the next instant and the ticks after it.
    ///
    /// Returns true if the machine was computed. A machine that has not moved since its reset is not
    /// computed.
    pub fn step(&mut self) -> bool {
        self.step_by(|machine, psec, preview| machine.advance(psec, preview))
    }

    /// Steps the simulation by one position cycle and calls `observe` at each tick, as
    /// [`Machine::advance_with`]; its second argument is true at the first tick of the cycle.
    ///
    /// Returns true if the machine was computed. A machine that has not moved since its reset has no
    /// ticks.
    pub fn step_with(&mut self, mut observe: impl FnMut(&Machine, bool)) -> bool {
        self.step_by(|machine, psec, preview| {
            let mut is_position_instant = true;
            machine.advance_with(psec, preview, |machine| {
                observe(machine, is_position_instant);
                is_position_instant = false;
            });
        })
    }

    fn step_by(&mut self, advance: impl FnOnce(&mut Machine, &[f64], &[f64])) -> bool {
        let k = self.next;
        self.timeline.next();
        self.process_timeline_events(k);
        if !self.has_moved && self.timeline.is_stream_moving() {
            self.advance_at_rest();
        }
        self.has_moved |= self.motions.is_any_running() || self.loads.is_any_acting();
        if self.has_moved {
            self.motions.push_preview(&self.timeline);
            self.loads.apply(&mut self.machine, k);
            self.collect_preview();
            advance(&mut self.machine, self.timeline.psec(), &self.preview);
            self.record_cycle();
        }
        for (errors, sample) in self.errors.iter_mut().zip(&self.samples) {
            errors.push(sample);
        }
        while let Some((id, violation)) = self.motions.path_violation(&self.errors, self.grid.period) {
            self.timeline.cancel(id);
            let outcome = MotionOutcome::PathTolerance(violation);
            self.motions.end(id, outcome, self.time_of(k), &mut self.finished);
        }
        self.motions.finish(k, &self.errors, self.grid, &mut self.finished);
        if self.has_active_commands() {
            self.settled_from = k + 1 + SETTLING / self.grid.period;
        }
        self.next = k + 1;
        self.has_moved
    }

    /// Computes one position cycle at rest before a stream moves the machine.
    ///
    /// A machine that has not moved takes its first setpoint for the previous one too, and the first
    /// setpoint of a stream can differ from its position.
    fn advance_at_rest(&mut self) {
        let rest: Vec<f64> = self.samples.iter().map(|sample| sample.psec).collect();
        self.machine.advance(&rest, &[]);
        self.has_moved = true;
    }

    fn process_timeline_events(&mut self, k: i64) {
        let now = self.time_of(k);
        let delay = self.longest_delay();
        for event in self.timeline.events() {
            match *event {
                TimelineEvent::Started(id) => self.motions.start(id),
                TimelineEvent::Completed(id) if self.motions.is_canceled(id) => {
                    self.motions.end(id, MotionOutcome::Canceled, now, &mut self.finished);
                }
                TimelineEvent::Completed(id) => self.motions.finish_at(id, k + delay),
                TimelineEvent::Preempted { id, by, .. } => {
                    self.motions.end(id, MotionOutcome::Preempted { by }, now, &mut self.finished);
                }
                TimelineEvent::Stopped { id, .. } => {
                    self.motions.end(id, MotionOutcome::Stopped, now, &mut self.finished);
                }
            }
        }
    }

    /// Returns the longest delay of the axes, position cycles, rounded up.
    fn longest_delay(&self) -> i64 {
        let tick = self.machine.periods().current;
        let delay = self.machine.longest_delay() as Nanoseconds * tick;
        delay.unsigned_abs().div_ceil(self.grid.period.unsigned_abs()) as i64
    }

    /// Collects the preview of setpoints for the controllers.
    fn collect_preview(&mut self) {
        let length = self.machine.preview_length();
        self.preview.clear();
        for joint in 0..self.machine.axis_count() {
            self.preview.extend((1..=length).filter_map(|j| self.timeline.psec_ahead(joint, j as u32)));
        }
    }

    /// Copies the samples of the position cycle and updates saturation and figures.
    fn record_cycle(&mut self) {
        let axes = self.machine.axes().iter().enumerate();
        for (((index, axis), sample), saturated) in axes.zip(&mut self.samples).zip(&mut self.saturated) {
            let instant = axis.sample();
            let later_ticks = self.machine.activity(index).saturated_ticks - u64::from(instant.saturated);
            *sample = AxisSample { saturated: *saturated || instant.saturated, ..*instant };
            *saturated = later_ticks > 0;
        }
        self.motions.observe(&self.machine);
    }

    fn copy_samples(&mut self) {
        for (sample, axis) in self.samples.iter_mut().zip(self.machine.axes()) {
            *sample = *axis.sample();
        }
    }

    /// Returns the samples of all axes at the last position cycle.
    pub fn samples(&self) -> &[AxisSample] {
        &self.samples
    }

    /// Returns the motions that have finished since the last call.
    pub fn drain_finished(&mut self) -> impl Iterator<Item = MotionEnd> + '_ {
        self.finished.drain(..)
    }

    /// Returns true if a trajectory waits, runs or has not finished, or a load acts.
    ///
    /// A stream does not count: its setpoints arrive at the rate of the sender, so the simulation must not
    /// run faster than it. Trajectories that a feed hold has stopped do not count either.
    pub fn has_active_commands(&self) -> bool {
        let has_trajectories =
            !self.motions.is_empty() || self.timeline.is_moving() || self.timeline.is_waiting();
        has_trajectories && !self.timeline.is_feed_stopped() || self.loads.is_any_active()
    }

    /// Returns true if commands are active or the axes are settling.
    pub fn is_busy(&self) -> bool {
        self.has_active_commands() || self.next < self.settled_from
    }

    /// Returns true if the velocity of an axis exceeds the standstill velocity.
    pub fn is_in_motion(&self) -> bool {
        self.samples.iter().any(|s| s.velocity.abs() > STANDSTILL)
    }

    /// Returns true if the actual position of an axis is outside its travel limits, e.g. because of a load.
    pub fn is_outside_travel_limits(&self, axis: usize) -> bool {
        let (Some(sample), Some(joint)) = (self.samples.get(axis), self.timeline.joints().get(axis)) else {
            return false;
        };
        joint.limits.is_outside_travel(sample.position)
    }

    /// Returns the previewed setpoint of a joint, `cycles` position cycles after the next instant, m or
    /// rad; `None` for an unknown joint.
    pub fn psec_ahead(&self, joint: usize, cycles: u32) -> Option<f64> {
        self.timeline.psec_ahead(joint, cycles.saturating_add(1))
    }

    /// Writes the previewed setpoints of all joints to `psec`, as [`psec_ahead`](Self::psec_ahead) returns them.
    pub fn all_psec_ahead(&self, cycles: u32, psec: &mut [f64]) {
        self.timeline.all_psec_ahead(cycles.saturating_add(1), psec);
    }

    /// Returns true if the active motion that is planned while it runs needs its next chunk, see
    /// [`Timeline::needs_chunk`]. In real time it stops on its path until the chunk is appended.
    pub fn needs_chunk(&self) -> bool {
        self.timeline.needs_chunk()
    }

    /// Returns the place on the path of the active motion that is planned while it runs.
    pub fn path_place(&self) -> Option<PathPlace> {
        self.timeline.path_place()
    }

    /// Returns the distance of the linear axes from the path of the setpoints of the running motion `id` at the end of the
    /// last position cycle, m; `None` if there is none.
    pub fn contour_error(&self, id: MotionId) -> Option<f64> {
        self.motions.contour_error(id)
    }

    /// Returns true if a trajectory or a stop moves the setpoints.
    pub fn is_moving(&self) -> bool {
        self.timeline.is_moving()
    }
}

/// Returns the preview of the contour error, position cycles; `period` is Tsp, ns.
pub fn contour_preview_cycles(period: Nanoseconds) -> u32 {
    u32::try_from(CONTOUR_PREVIEW / period.max(1)).unwrap_or(u32::MAX).clamp(1, MAX_CONTOUR_PREVIEW)
}

/// Returns the delay of a stream, position cycles: the preview of the controllers.
fn stream_delay(machine: &Machine) -> u32 {
    u32::try_from(machine.preview_length()).unwrap_or(u32::MAX)
}

/// Returns the joint limits of a machine for trajectories, with `prefix` before each joint name.
pub fn joint_limits(config: &MachineConfig, prefix: &str) -> Vec<JointLimits> {
    let with_prefix = |joint: JointLimits| JointLimits { name: format!("{prefix}{}", joint.name), ..joint };
    config.axes().iter().map(|axis| with_prefix(JointLimits::from_axis(axis))).collect()
}
