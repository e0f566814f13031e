//! Ticks of a machine with coupled axes.

use super::coupling::{AxisCoupling, CouplingStep, MAX_RUNS, PairMotion};
use super::inner_loops::TickSpan;
use super::{Machine, MachineParameters};

impl MachineParameters {
    /// Returns the torque of its coupling on an axis at rest (N·m at the motor), 0 without coupling; `position` returns
    /// the position of an axis, m or rad.
    pub(super) fn coupling_torque_at_rest(&self, axis: usize, position: impl Fn(usize) -> f64) -> f64 {
        let torque = |coupling: &AxisCoupling| {
            let side = coupling.axes.iter().position(|&own| own == axis)?;
            let forces = coupling.forces_at_rest(coupling.axes.map(&position));
            Some(self.axes[axis].loops.plant.load_torque(forces[side]))
        };
        self.couplings.iter().find_map(torque).unwrap_or(0.0)
    }
}

impl Machine {
    /// Runs ticks of a position cycle; those of a machine with couplings one by one.
    pub(super) fn run(&mut self, span: TickSpan) {
        if self.parameters.couplings.is_empty() {
            return self.bank.run_span(span);
        }
        for tick in span.first..span.end {
            self.run_coupled(TickSpan { first: tick, end: tick + 1, ..span });
        }
    }

    /// Runs one tick until the forces of all couplings agree with the state at its end.
    fn run_coupled(&mut self, span: TickSpan) {
        let tick = span.first;
        let parameters = &*self.parameters;
        self.coupling_steps.clear();
        for coupling in &parameters.couplings {
            let forces = coupling.axes.map(|axis| {
                let torque = self.axes[axis].coupling_torques.before(tick).unwrap_or(0.0);
                torque / parameters.axes[axis].loops.plant.load_torque(1.0)
            });
            self.coupling_steps.push(coupling.begin(self.pair_motion(coupling), forces));
        }
        self.bank.store_start();
        for run in 1..=MAX_RUNS {
            if run > 1 {
                self.bank.restore_start();
            }
            for (coupling, step) in parameters.couplings.iter().zip(&self.coupling_steps) {
                for (&index, force) in coupling.axes.iter().zip(step.forces) {
                    let torque = parameters.axes[index].loops.plant.load_torque(force);
                    let axis = &mut self.axes[index];
                    axis.coupling_torques.set(tick, torque);
                    self.bank.set_load_torque(index, axis.external_torque() + torque);
                }
            }
            self.bank.run_span(span);
            for (index, coupling) in parameters.couplings.iter().enumerate() {
                let end = self.pair_motion(coupling);
                let step = &mut self.coupling_steps[index];
                if !step.is_solved {
                    coupling.improve(step, &end);
                }
            }
            if self.coupling_steps.iter().all(|step: &CouplingStep| step.is_solved) {
                break;
            }
        }
        self.bank.discard_start();
        self.coupling_steps.clear();
    }

    /// Returns the present motion of the axes of a coupling.
    fn pair_motion(&self, coupling: &AxisCoupling) -> PairMotion {
        let [[p1, v1, _], [p2, v2, _]] = coupling.axes.map(|axis| self.motion_at_end(axis));
        PairMotion { position: [p1, p2], velocity: [v1, v2] }
    }
}
