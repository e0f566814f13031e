//! Energy of the axes over a position cycle.

use super::Machine;
use crate::drive::MotorEnergy;

/// Energy of one axis over a position cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CycleEnergy {
    /// Electrical input, J: negative if more was fed back than drawn.
    pub input: f64,
    /// Electrical energy fed back to the DC link in the ticks that fed back, J.
    pub returned: f64,
    /// Copper loss, J.
    pub copper_loss: f64,
    /// Largest mean electrical power of a tick, W; 0 if none was drawn.
    pub peak_power: f64,
    /// Largest |ω| at a tick, rad/s (m/s for a linear motor).
    pub peak_speed: f64,
}

impl Machine {
    /// Records the controller outputs of every tick of the following position cycles, or of the first one only, which is
    /// the default. [`cycle_energy`](Self::cycle_energy) needs every tick.
    pub fn record_every_tick(&mut self, every_tick: bool) {
        self.records_every_tick = every_tick;
    }

    /// Returns true if the controller outputs of every tick are recorded.
    pub fn records_every_tick(&self) -> bool {
        self.records_every_tick
    }

    /// Returns the energy balance of the motor of an axis.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    pub fn motor_energy(&self, axis: usize) -> &MotorEnergy {
        &self.parameters.axes[axis].energy
    }

    /// Returns the energy of an axis over the last position cycle, whose ticks were
    /// [recorded](Self::record_every_tick), and adds the energy of each tick (J) to `ticks`.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    pub fn cycle_energy(&self, axis: usize, ticks: &mut [f64]) -> CycleEnergy {
        let motor = self.motor_energy(axis);
        let count = self.ticks_per_period().min(ticks.len());
        let tick_length = crate::units::seconds(self.parameters.periods.current);
        let mut found =
            CycleEnergy { peak_speed: self.bank.statistics(axis).peak_speed, ..CycleEnergy::default() };
        let (mut start, mut peak) = (self.bank.motor(axis, 0), 0.0_f64);
        for (tick, sum) in ticks.iter_mut().enumerate().take(count) {
            let end = match tick + 1 < count {
                true => self.bank.motor(axis, tick + 1),
                false => self.bank.state(axis).motor,
            };
            let energy = motor.over_tick(&start, &end, self.bank.record(axis, tick).voltage);
            *sum += energy.input;
            found.input += energy.input;
            found.returned += (-energy.input).max(0.0);
            found.copper_loss += energy.copper_loss;
            peak = peak.max(energy.input);
            start = end;
        }
        found.peak_power = peak / tick_length;
        found
    }
}
