//! Axis with hidden random parameters, and its simulation.

use std::sync::Arc;

use virtual_axes_core::config::{AxisConfig, LimitsConfig, MachineConfig, Periods};
use virtual_axes_core::machine::{AxisSample, Machine, MachineParameters};
use virtual_axes_core::units::{METER_PER_MINUTE, Nanoseconds, seconds};

use super::drawn::{draw_axis, draw_periods};
use super::error::TraceError;
use super::program::ProductionProgram;
use crate::fixtures::recordings::stribeck_current;
use crate::stress::random::RandomSource;

/// Numbers of the random streams of a seed.
pub(super) mod stream {
    /// Periods of a machine.
    pub const PERIODS: u64 = 1;
    /// Knowledge of the periods.
    pub const PERIOD_KNOWLEDGE: u64 = 2;
    /// Moves of a program.
    pub const PROGRAM: u64 = 3;
    /// Stamps and gaps of a trace, common to its axes.
    pub const STAMPS: u64 = 4;
    /// Parameters of an axis, plus its joint index.
    pub const AXIS: u64 = 100;
    /// Guess of an axis, plus its joint index.
    pub const GUESS: u64 = 200;
    /// Noise of an axis, plus its joint index.
    pub const NOISE: u64 = 300;
}

/// Names of the joints of a [`ProductionProgram`].
pub(super) const JOINT_NAMES: [&str; 3] = ["x", "y", "z"];

/// Orientation of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisOrientation {
    /// Horizontal axis without weight.
    Horizontal,
    /// Vertical axis with a weight of 3000 to 6000 N.
    Vertical,
}

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
    /// Mean current over one period around each sample, A.
    pub mean_current: Vec<f64>,
    /// Part of the position cycles with speed, current or voltage setpoint at its limit, 0 … 1.
    pub saturated: f64,
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
    /// [`TraceError`] if the duration is out of range or the program cannot be planned.
    pub fn program(&self, seed: u64, duration: f64) -> Result<ProductionProgram, TraceError> {
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

    /// Simulates the axis on a program with one sample every `period` ns, or every position cycle if Tsp is longer.
    ///
    /// # Errors
    /// [`TraceError::Machine`] if the axis cannot be simulated.
    pub fn simulate(
        &self,
        program: &ProductionProgram,
        period: Nanoseconds,
    ) -> Result<SimulatedAxis, TraceError> {
        let mut machine = Machine::new(Arc::new(MachineParameters::new(&self.machine())?));
        let tsp = seconds(self.periods.position);
        machine.reset(&[program.psec(self.joint, 0.0)]);
        let sampling = period.max(self.periods.position);
        let every = (sampling / self.periods.current).max(1) as u64;
        let force_constant = self.config.motor.torque_constant / self.config.transmission_ratio;
        let cycles = (program.duration() / tsp).floor() as u64;
        let (mut samples, mut mean_current, mut saturated) = (Vec::new(), PeriodMeans::new(every), 0_u64);
        for k in 0..=cycles {
            if self.stribeck != 0.0 {
                let velocity = machine.axis(0).sample().velocity / METER_PER_MINUTE;
                machine.set_load(0, -force_constant * stribeck_current(self.stribeck, velocity));
            }
            machine.advance_with(&[program.psec(self.joint, k as f64 * tsp)], &[], |machine| {
                let sample = machine.axis(0).sample();
                mean_current.push(machine.tick(), sample.current);
                if machine.tick().is_multiple_of(every) {
                    samples.push(*sample);
                }
            });
            saturated += u64::from(machine.activity(0).saturated_ticks > 0);
        }
        let saturated = saturated as f64 / (cycles + 1) as f64;
        let mut mean_current = mean_current.values();
        mean_current.truncate(samples.len());
        Ok(SimulatedAxis { period: seconds(sampling), samples, mean_current, saturated })
    }
}

/// Means of a signal over periods of `every` ticks, each centered at a multiple of `every`.
struct PeriodMeans {
    every: u64,
    /// Sum and number of values per period.
    sums: Vec<(f64, u64)>,
}

impl PeriodMeans {
    fn new(every: u64) -> Self {
        PeriodMeans { every, sums: Vec::new() }
    }

    /// Adds the value at `tick`; ticks ascend by one from 0.
    fn push(&mut self, tick: u64, value: f64) {
        if tick == 0 || (tick + self.every / 2).is_multiple_of(self.every) {
            self.sums.push((0.0, 0));
        }
        if let Some((sum, count)) = self.sums.last_mut() {
            *sum += value;
            *count += 1;
        }
    }

    fn values(self) -> Vec<f64> {
        self.sums.into_iter().map(|(sum, count)| sum / count as f64).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::PeriodMeans;

    #[test]
    fn means_are_centered_at_the_samples() {
        let mut means = PeriodMeans::new(4);
        (0..10).for_each(|tick| means.push(tick, tick as f64));
        assert_eq!(means.values(), [0.5, 3.5, 7.5]);
        let mut means = PeriodMeans::new(1);
        (0..3).for_each(|tick| means.push(tick, tick as f64));
        assert_eq!(means.values(), [0.0, 1.0, 2.0]);
    }
}
