//! Axis with hidden random parameters, and its simulation.

use std::error::Error;
use std::sync::Arc;

use virtual_axes_core::config::{AxisConfig, LimitsConfig, MachineConfig, Periods};
use virtual_axes_core::machine::{AxisSample, Machine, MachineParameters};
use virtual_axes_core::units::{METER_PER_MINUTE, Nanoseconds, seconds};

use super::drawn::{AxisOrientation, draw_axis, draw_periods};
use super::program::{JOINT_NAMES, ProductionProgram};
use crate::fixtures::recordings::stribeck_current;
use crate::random::{RandomSource, stream};

/// Axis with parameters that an identification must find.
///
/// Backlash and Stribeck friction are effects beyond the model, 0 after drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenAxis {
    /// Parameters of drive and control, SI units.
    pub config: AxisConfig,
    /// Periods of the control.
    pub periods: Periods,
    /// Index in [`ProductionProgram`]: 0 for X, 1 for Y, 2 for Z.
    pub joint: usize,
    /// True if the recorded current has the opposite sign of the motor current.
    pub is_current_inverted: bool,
    /// Backlash, m: width of the hysteresis between the motor and the load, whose position is recorded. The control
    /// closes its loops on the motor; the recorded velocity is that of the motor.
    pub backlash: f64,
    /// Additional friction near standstill, A (Stribeck effect): peak of an exponential of 0.5 m/min.
    pub stribeck: f64,
}

/// Simulated signals of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedAxis {
    /// Period of the samples, s.
    pub period: f64,
    /// Samples of the motor side, one per period, from the start of the program.
    pub samples: Vec<AxisSample>,
    /// Current at every tick, A.
    pub currents: Vec<f64>,
    /// Ticks per sample.
    pub ticks_per_sample: usize,
}

impl SimulatedAxis {
    /// Returns the mean current over one period around each sample, A.
    pub fn mean_currents(&self) -> Vec<f64> {
        let (every, count) = (self.ticks_per_sample, self.currents.len());
        let mean = |k: usize| {
            let range = (k * every).saturating_sub(every / 2)..(k * every + every.div_ceil(2)).min(count);
            let values = self.currents.get(range).unwrap_or_default();
            values.iter().sum::<f64>() / values.len() as f64
        };
        (0..self.samples.len()).map(mean).collect()
    }

    /// Returns the current at `phase` of the period behind each sample, 0 … 1, A.
    pub fn currents_at(&self, phase: f64) -> Vec<f64> {
        let every = self.ticks_per_sample;
        let offset = (phase.clamp(0.0, 1.0) * every as f64) as usize;
        let last = self.currents.last().copied().unwrap_or(0.0);
        (0..self.samples.len())
            .map(|k| self.currents.get(k * every + offset).copied().unwrap_or(last))
            .collect()
    }
}

impl HiddenAxis {
    /// Draws an axis: X if horizontal, Z if vertical.
    pub fn draw(seed: u64, orientation: AxisOrientation) -> Self {
        let joint = match orientation {
            AxisOrientation::Horizontal => 0,
            AxisOrientation::Vertical => 2,
        };
        Self::draw_joint(seed, joint)
    }

    /// Draws the axis of a joint: X and Y are horizontal, Z is vertical. Joints of one seed have equal periods.
    pub(super) fn draw_joint(seed: u64, joint: usize) -> Self {
        let periods = draw_periods(&mut RandomSource::new(seed, stream::PERIODS));
        let mut random = RandomSource::new(seed, stream::AXIS + joint as u64);
        let orientation = if joint == 2 { AxisOrientation::Vertical } else { AxisOrientation::Horizontal };
        let config = draw_axis(&mut random, JOINT_NAMES[joint], orientation, &periods);
        let is_current_inverted = random.chance(0.5);
        HiddenAxis { config, periods, joint, is_current_inverted, backlash: 0.0, stribeck: 0.0 }
    }

    /// Returns a machine with this axis only.
    pub fn machine(&self) -> MachineConfig {
        MachineConfig::from_axis(self.config.clone(), self.periods)
    }

    /// Plans program `seed` of up to `duration` s within the limits of this axis.
    ///
    /// # Errors
    /// An error if the duration is out of range or the program cannot be planned.
    pub fn program(&self, seed: u64, duration: f64) -> Result<ProductionProgram, Box<dyn Error>> {
        let limits: [LimitsConfig; 3] = [*self.config.limits(); 3];
        ProductionProgram::draw(seed, duration, &limits)
    }

    /// Returns the lag of the position behind the commanded position at constant velocity, s: α rounded up to whole
    /// position cycles, at which the position controller reads its setpoint.
    pub fn lag(&self) -> f64 {
        let ticks = (self.config.delays.alpha + self.periods.current / 2) / self.periods.current;
        let cycles = (ticks as u64).div_ceil(self.periods.ticks_per_position());
        seconds(cycles as Nanoseconds * self.periods.position)
    }

    /// Simulates the axis on a program with one sample every `period` ns, rounded to current cycles.
    ///
    /// # Errors
    /// An error if the axis cannot be simulated.
    pub fn simulate(
        &self,
        program: &ProductionProgram,
        period: Nanoseconds,
    ) -> Result<SimulatedAxis, Box<dyn Error>> {
        let mut machine = Machine::new(Arc::new(MachineParameters::new(&self.machine())?));
        let tsp = seconds(self.periods.position);
        machine.reset(&[program.psec(self.joint, 0.0)]);
        let every = (period / self.periods.current).max(1) as u64;
        let force_constant = self.config.motor.torque_constant / self.config.transmission_ratio;
        let cycles = (program.duration() / tsp).floor() as u64;
        let (mut samples, mut currents) = (Vec::new(), Vec::new());
        for k in 0..=cycles {
            if self.stribeck != 0.0 {
                let velocity = machine.axis(0).sample().velocity / METER_PER_MINUTE;
                machine.set_load(0, -force_constant * stribeck_current(self.stribeck, velocity));
            }
            machine.advance_with(&[program.psec(self.joint, k as f64 * tsp)], &[], |machine| {
                let sample = machine.axis(0).sample();
                currents.push(sample.current);
                if machine.tick().is_multiple_of(every) {
                    samples.push(*sample);
                }
            });
        }
        let period = seconds(every as Nanoseconds * self.periods.current);
        Ok(SimulatedAxis { period, samples, currents, ticks_per_sample: every as usize })
    }
}

/// Machine with hidden axes and one control.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenMachine {
    /// Axes in the order of joints, with equal periods.
    pub axes: Vec<HiddenAxis>,
}

impl HiddenMachine {
    /// Draws the axes X, Y (horizontal) and Z (vertical) of a machine. Each axis is that of [`HiddenAxis::draw`] with
    /// equal seed.
    pub fn draw(seed: u64) -> Self {
        HiddenMachine { axes: (0..3).map(|joint| HiddenAxis::draw_joint(seed, joint)).collect() }
    }

    /// Plans program `seed` of up to `duration` s within the limits of the axes.
    ///
    /// # Errors
    /// An error if the duration is out of range or the program cannot be planned.
    pub fn program(&self, seed: u64, duration: f64) -> Result<ProductionProgram, Box<dyn Error>> {
        ProductionProgram::draw(seed, duration, &self.limits())
    }

    /// Plans program `seed` of `count` rapids of all axes.
    ///
    /// # Errors
    /// An error if the program cannot be planned.
    pub fn rapids(&self, seed: u64, count: usize) -> Result<ProductionProgram, Box<dyn Error>> {
        ProductionProgram::draw_rapids(seed, count, &self.limits())
    }

    fn limits(&self) -> [LimitsConfig; 3] {
        let fallback = HiddenAxis::draw_joint(0, 0).config.limits;
        let mut limits = [self.axes.first().map_or(fallback, |axis| axis.config.limits); 3];
        for axis in &self.axes {
            if let Some(limits) = limits.get_mut(axis.joint) {
                *limits = axis.config.limits;
            }
        }
        limits
    }
}
