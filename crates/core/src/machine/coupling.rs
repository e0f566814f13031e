//! Mechanical couplings between two axes: workpiece on the tables of A and C, beam of a gantry.
//!
//! An axis of a coupling runs tick by tick, its forces held over each tick. They are those of the coupling in the middle
//! of the tick, with the accelerations over the tick: the implicit midpoint rule, of second order. The forces depend on
//! the state that they lead to, so the tick is repeated until they agree.

use crate::config::{AxisConfig, GantryConfig, MachineConfig};
use crate::drive::{Plant, WorkpieceDynamics};
use crate::kinematics::{AxisRole, Kinematics};
use crate::units::seconds;

/// Largest number of runs of a tick. Three or four are usual; more are needed while friction begins or ceases to hold.
pub(super) const MAX_RUNS: usize = 12;
/// Difference of forces that is neglected, in units of the force and the largest force of the motor.
const TOLERANCE: f64 = 1e-11;

/// Positions and velocities of both axes, m and m/s or rad and rad/s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct PairMotion {
    pub position: [f64; 2],
    pub velocity: [f64; 2],
}

/// Forces of a coupling by the motion of its axes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum CouplingLaw {
    /// Workpiece on the tables of A and C.
    Workpiece(WorkpieceDynamics),
    /// Spring and damper between two linear axes.
    Gantry {
        /// Stiffness, N/m.
        stiffness: f64,
        /// Damping, N/(m/s).
        damping: f64,
    },
}

/// Mechanical coupling of two axes of a machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisCoupling {
    pub axes: [usize; 2],
    law: CouplingLaw,
    /// Bound on the change of velocity over a tick per force at the axis, (m/s)/N or (rad/s)/(N·m).
    response: [f64; 2],
    /// Differences of forces that are neglected beside their relative part, N or N·m.
    tolerance: [f64; 2],
    /// Tick, s.
    period: f64,
}

/// Forces of a coupling over a tick while they are sought.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct CouplingStep {
    /// Motion at the start of the tick.
    start: PairMotion,
    /// Forces on the axes in the next run of the tick, N or N·m.
    pub forces: [f64; 2],
    /// Change of velocity per force, as found so far.
    slopes: [f64; 2],
    /// Forces and velocities at the end of the previous run.
    previous: Option<([f64; 2], [f64; 2])>,
    /// True if the forces agree with the state that they lead to.
    pub is_solved: bool,
}

impl AxisCoupling {
    /// Creates the couplings of a machine among its axes at `indices`; a coupling needs both of its axes.
    pub fn of_machine(config: &MachineConfig, indices: &[usize]) -> Vec<Self> {
        let create = |axes: [usize; 2], law| {
            let selected = axes.map(|axis| indices.iter().position(|&index| index == axis));
            let [Some(first), Some(second)] = selected else { return None };
            let [one, other] = axes.map(|axis| config.axes.get(axis));
            Some(Self::new([one?, other?], [first, second], law, seconds(config.periods.current)))
        };
        let workpiece = config.workpiece.and_then(|workpiece| {
            let axes = table_axes(config)?;
            create(axes, CouplingLaw::Workpiece(WorkpieceDynamics::new(&config.kinematics, &workpiece)))
        });
        let gantry = config.gantry.and_then(|GantryConfig { axes, stiffness, damping }| {
            create(axes, CouplingLaw::Gantry { stiffness, damping })
        });
        workpiece.into_iter().chain(gantry).collect()
    }

    fn new(configs: [&AxisConfig; 2], axes: [usize; 2], law: CouplingLaw, period: f64) -> Self {
        let response = configs.map(|axis| {
            let inertia = Plant::deviating_transmission(axis)
                .map_or(Plant::deviating_motor(axis).inertia, |transmission| transmission.load_inertia);
            period * axis.transmission_ratio.powi(2) / inertia
        });
        let tolerance = configs.map(|axis| TOLERANCE * axis.max_effort());
        AxisCoupling { axes, law, response, tolerance, period }
    }

    /// Returns the coupling of a machine whose axes come after `count` others.
    pub fn behind(&self, count: usize) -> Self {
        AxisCoupling { axes: self.axes.map(|axis| axis + count), ..*self }
    }

    /// Returns the forces on both axes at rest at `position`, N or N·m towards plus.
    pub fn forces_at_rest(&self, position: [f64; 2]) -> [f64; 2] {
        let at_rest = PairMotion { position, velocity: [0.0; 2] };
        self.forces(&at_rest, &at_rest)
    }

    /// Returns the forces on both axes over a tick between two states, N or N·m towards plus.
    fn forces(&self, start: &PairMotion, end: &PairMotion) -> [f64; 2] {
        let middle = |start: [f64; 2], end: [f64; 2]| [0, 1].map(|k| 0.5 * (start[k] + end[k]));
        let (position, velocity) =
            (middle(start.position, end.position), middle(start.velocity, end.velocity));
        match &self.law {
            CouplingLaw::Workpiece(workpiece) => {
                let acceleration = [0, 1].map(|k| (end.velocity[k] - start.velocity[k]) / self.period);
                let inertia = apply(&workpiece.mass_matrix(position[1]), acceleration);
                let gravity = workpiece.gravity_torques(position);
                let motion = workpiece.velocity_torques(position[1], velocity);
                [0, 1].map(|k| -(inertia[k] + motion[k] + gravity[k]))
            }
            CouplingLaw::Gantry { stiffness, damping } => {
                let force = stiffness * (position[0] - position[1]) + damping * (velocity[0] - velocity[1]);
                [-force, force]
            }
        }
    }

    /// Returns the forces against a change of the velocities over the tick, per change: the derivative of the forces
    /// without the small parts by gravity and by the velocities of the tables.
    fn impedance(&self, position: [f64; 2]) -> [[f64; 2]; 2] {
        match &self.law {
            CouplingLaw::Workpiece(workpiece) => {
                workpiece.mass_matrix(position[1]).map(|row| row.map(|entry| entry / self.period))
            }
            CouplingLaw::Gantry { stiffness, damping } => {
                let force = 0.5 * damping + 0.25 * self.period * stiffness;
                [[force, -force], [-force, force]]
            }
        }
    }

    /// Begins a tick with the forces over the previous one.
    pub fn begin(&self, start: PairMotion, forces: [f64; 2]) -> CouplingStep {
        CouplingStep { start, forces, slopes: self.response, previous: None, is_solved: false }
    }

    /// Compares the forces with those by the state `end` of a run of the tick, and improves them if they differ.
    ///
    /// ```text
    /// R(F) = F − F_coupling(end(F)) = 0        F ← F − (1 + B D)⁻¹ R
    /// ```
    ///
    /// B is the [`impedance`](Self::impedance), D the diagonal matrix of the changes of velocity per force: at first those
    /// of the bare inertias, then those found between two runs. An axis that friction holds has D = 0.
    pub fn improve(&self, step: &mut CouplingStep, end: &PairMotion) {
        let wanted = self.forces(&step.start, end);
        let residual = [0, 1].map(|k| step.forces[k] - wanted[k]);
        step.is_solved = (0..2).all(|k| residual[k].abs() <= self.tolerance[k] + TOLERANCE * wanted[k].abs());
        if step.is_solved {
            return;
        }
        if let Some((forces, velocities)) = step.previous {
            for k in 0..2 {
                let (force, velocity) = (step.forces[k] - forces[k], end.velocity[k] - velocities[k]);
                if force.abs() > self.tolerance[k] {
                    step.slopes[k] = (velocity / force).clamp(0.0, self.response[k]);
                }
            }
        }
        step.previous = Some((step.forces, end.velocity));
        let [[b11, b12], [b21, b22]] = self.impedance(end.position);
        let [d1, d2] = step.slopes;
        let [[a11, a12], [a21, a22]] = [[1.0 + b11 * d1, b12 * d2], [b21 * d1, 1.0 + b22 * d2]];
        // At least 1: B is positive semidefinite and D is not negative.
        let determinant = a11 * a22 - a12 * a21;
        let [r1, r2] = residual;
        step.forces[0] -= (a22 * r1 - a12 * r2) / determinant;
        step.forces[1] -= (a11 * r2 - a21 * r1) / determinant;
    }
}

fn apply(matrix: &[[f64; 2]; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    matrix.map(|[by_x, by_y]| by_x * x + by_y * y)
}

/// Returns the indices of the joints A and C of a machine.
fn table_axes(config: &MachineConfig) -> Option<[usize; 2]> {
    let kinematics = Kinematics::new(config);
    Some([kinematics.role(AxisRole::A)?, kinematics.role(AxisRole::C)?])
}

impl MachineConfig {
    /// Returns the indices `axes` and behind them those of the axes that are coupled to one of them.
    pub(crate) fn with_coupled_axes(&self, axes: &[usize]) -> Vec<usize> {
        let mut all = axes.to_vec();
        for coupling in AxisCoupling::of_machine(self, &Vec::from_iter(0..self.axes.len())) {
            let [one, other] = coupling.axes;
            for (present, absent) in [(one, other), (other, one)] {
                if all.contains(&present) && !all.contains(&absent) {
                    all.push(absent);
                }
            }
        }
        all
    }
}

/// Torques of a coupling on one axis, N·m at the motor; empty for an axis without coupling.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct CouplingTorques {
    /// Torque over the last tick of the previous position cycle, then over each tick of the present one.
    ticks: Vec<f64>,
}

impl CouplingTorques {
    /// Creates the torques of an axis that rests under `torque`.
    pub fn new(is_coupled: bool, ticks_per_position: u64, torque: f64) -> Self {
        CouplingTorques {
            ticks: if is_coupled { vec![torque; 1 + ticks_per_position as usize] } else { Vec::new() },
        }
    }

    /// Begins a position cycle.
    pub fn begin_cycle(&mut self) {
        if let [first, .., last] = &mut self.ticks[..] {
            *first = *last;
        }
    }

    /// Sets the torque over a tick of the position cycle.
    pub fn set(&mut self, tick: usize, torque: f64) {
        if let Some(value) = self.ticks.get_mut(tick + 1) {
            *value = torque;
        }
    }

    /// Returns the torque over the tick before `tick`; `None` without coupling.
    pub fn before(&self, tick: usize) -> Option<f64> {
        self.ticks.get(tick).copied()
    }

    /// Returns all torques, to write or replace them.
    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.ticks.iter_mut()
    }
}
