//! Energy of a trial: sums over the position cycles, of each axis and of the common DC link.

use crate::config::MachineConfig;
use crate::machine::Machine;
use crate::units::seconds;

use super::figures::{AxisEnergy, DcLinkEnergy};

/// Speed of a motor at rest, as a fraction of its largest speed.
const REST: f64 = 1e-4;

/// Sums of one axis.
#[derive(Debug, Clone, Copy, Default)]
struct AxisSums {
    energy: AxisEnergy,
    /// Magnetic energy at the start of the run and at the end, J.
    magnetic: Option<[f64; 2]>,
    /// Setpoints of the last position cycle, and delayed, m or rad.
    setpoints: Option<[f64; 2]>,
    /// Copper loss (J) and number of the position cycles at rest.
    held: (f64, u64),
}

/// Accumulator of the energy of a trial.
#[derive(Debug, Clone)]
pub(super) struct EnergyMeter {
    axes: Vec<AxisSums>,
    /// Speeds below which the motors are at rest, rad/s (m/s).
    rest: Vec<f64>,
    /// Position period and tick, s.
    periods: [f64; 2],
    link: DcLinkEnergy,
    /// Energy of all axes at each tick of a position cycle, J.
    ticks: Vec<f64>,
}

impl EnergyMeter {
    pub fn new(machine: &MachineConfig) -> Self {
        let (axes, periods) = (machine.axes(), machine.periods());
        EnergyMeter {
            axes: vec![AxisSums::default(); axes.len()],
            rest: axes.iter().map(|axis| REST * axis.motor.max_speed).collect(),
            periods: [periods.position, periods.current].map(seconds),
            link: DcLinkEnergy::default(),
            ticks: vec![0.0; periods.ticks_per_position() as usize],
        }
    }

    /// Adds a position cycle; `axis` returns the machine of an axis and its index there.
    pub fn observe<'m>(&mut self, axis: impl Fn(usize) -> (&'m Machine, usize)) {
        self.ticks.fill(0.0);
        for (index, (sums, rest)) in self.axes.iter_mut().zip(&self.rest).enumerate() {
            let (machine, at) = axis(index);
            let cycle = machine.cycle_energy(at, &mut self.ticks);
            let sample = machine.axis(at).sample();
            let magnetic = |current| machine.motor_energy(at).magnetic(current);
            let start = sums.magnetic.map_or_else(|| magnetic(sample.current), |[start, _]| start);
            sums.magnetic = Some([start, magnetic(machine.motion_at_end(at)[2])]);
            let energy = &mut sums.energy;
            energy.input += cycle.input;
            energy.returned += cycle.returned;
            energy.copper_loss += cycle.copper_loss;
            energy.peak_power = energy.peak_power.max(cycle.peak_power);
            let setpoints = [sample.psec, sample.delayed_psec];
            let stands = sums.setpoints.replace(setpoints).is_none_or(|before| before == setpoints);
            if stands && cycle.peak_speed <= *rest {
                sums.held = (sums.held.0 + cycle.copper_loss, sums.held.1 + 1);
            }
        }
        for &tick in &self.ticks {
            self.link.drawn += tick.max(0.0);
            self.link.returned += (-tick).max(0.0);
            self.link.peak_power = self.link.peak_power.max(tick / self.periods[1]);
        }
    }

    /// Returns the energy of an axis.
    pub fn axis(&self, index: usize) -> AxisEnergy {
        let AxisSums { energy, magnetic, held: (loss, cycles), .. } = self.axes[index];
        let magnetic = magnetic.map_or(0.0, |[start, end]| end - start);
        AxisEnergy {
            magnetic,
            mechanical_work: energy.input - energy.copper_loss - magnetic,
            holding_power: (cycles > 0).then(|| loss / (cycles as f64 * self.periods[0])),
            ..energy
        }
    }

    /// Returns the energy of the DC link.
    pub fn link(&self) -> DcLinkEnergy {
        self.link
    }
}
