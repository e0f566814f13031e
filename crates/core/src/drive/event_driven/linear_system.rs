//! Linear equations of motor, load and structure between two events, and their exact solution.

use nalgebra::{Matrix3, SMatrix, SVector};

use crate::config::{MotorConfig, TransmissionConfig};
use crate::simd::clamp_abs;

/// Number of states.
pub(super) const STATES: usize = 8;
/// Number of states and held inputs.
const ORDER: usize = STATES + 4;
/// Terms of the power series of an exponential. The rates of a system over a substep are at most 1 in all, so that the
/// remainder is below 1/21! = 2·10⁻²⁰.
const TERMS: usize = 20;

/// Index of i, A.
pub(super) const CURRENT: usize = 0;
/// Index of ω, rad/s.
pub(super) const SPEED: usize = 1;
/// Index of the twist σ of the spring, rad.
pub(super) const TWIST: usize = 2;
/// Index of ω_load relative to the structure, rad/s.
pub(super) const LOAD_SPEED: usize = 3;
/// Index of the velocity of the structure, rad/s.
pub(super) const STRUCTURE_SPEED: usize = 4;
/// Index of the displacement of the structure, rad.
pub(super) const STRUCTURE: usize = 5;
/// Index of the change of θ, rad.
pub(super) const ANGLE: usize = 6;
/// Index of the change of the wind-up relative to the structure, rad.
pub(super) const WIND_UP: usize = 7;
/// Index of the held voltage, V.
pub(super) const VOLTAGE: usize = 8;
/// Index of the held torque at the motor, N·m.
const MOTOR_TORQUE: usize = 9;
/// Index of the held torque between load and structure, N·m.
const LOAD_TORQUE: usize = 10;
/// Index of the held external torque at the load, N·m at the motor.
pub(super) const EXTERNAL: usize = 11;

/// States at the motor.
pub(super) type States = SVector<f64, STATES>;
/// States and held inputs.
pub(super) type StatesAndInputs = SVector<f64, ORDER>;

/// Places of friction: between motor and ground, and between load and structure.
pub(super) const PLACES: usize = 2;
/// Index of the speed at each place of friction.
pub(super) const SPEED_AT: [usize; PLACES] = [SPEED, LOAD_SPEED];

/// Linear system of an axis in one of its modes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearSystem {
    /// Derivatives of the states by each state and input.
    derivative: [[f64; STATES]; ORDER],
    /// States after a whole substep by each state and input.
    substep: [[f64; STATES]; ORDER],
    /// Changes of the speeds of motor, load and structure by an impulse at each of them, (rad/s)/(N·m·s).
    mobility: Matrix3<f64>,
}

/// Solution of a linear system at an instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response {
    /// States without friction.
    pub free: States,
    /// Change of the states by a torque of 1 N·m at each place of friction.
    pub by_torque: [States; PLACES],
    /// Changes of the speeds by an impulse; see [`LinearSystem`].
    mobility: Matrix3<f64>,
}

/// Mode of an axis, which selects its linear system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mode {
    /// True if the spring touches the load.
    pub is_in_contact: bool,
    /// True where friction holds motor and load.
    pub is_held: [bool; PLACES],
}

impl Mode {
    /// Returns all modes, in the order of [`index`](Self::index).
    pub fn all() -> [Self; 8] {
        std::array::from_fn(|index| Mode {
            is_in_contact: index & 4 != 0,
            is_held: [index & 2 != 0, index & 1 != 0],
        })
    }

    /// Returns the index in [`all`](Self::all).
    pub fn index(self) -> usize {
        let [motor, load] = self.is_held;
        4 * usize::from(self.is_in_contact) + 2 * usize::from(motor) + usize::from(load)
    }
}

/// Parameters of the equations, in units of the motor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Equations<'a> {
    pub motor: &'a MotorConfig,
    pub transmission: &'a TransmissionConfig,
}

impl Equations<'_> {
    /// Returns the largest sum of the rates of the equations, 1/s.
    pub fn rate(&self) -> f64 {
        let (m, t) = (self.motor, self.transmission);
        let own = m.inertia - t.load_inertia;
        let inverse = 1.0 / own + 1.0 / t.load_inertia;
        let structure = t.structure.map_or(0.0, |s| {
            // Motor and load are lighter than with the structure held: at most by the sum of the inverse inertias.
            (t.stiffness / s.inertia).sqrt()
                + t.damping / s.inertia
                + (1.0 + 2.0 * s.damping_ratio) * s.frequency
        });
        m.resistance / m.inductance
            + (m.torque_constant * m.emf_constant / (m.inductance * own)).sqrt()
            + (t.stiffness * inverse).sqrt()
            + t.damping * inverse
            + structure
    }

    /// Returns the inverse of the inertia of motor, load and structure, with zeros for those that do not move.
    fn mobility(&self, mode: Mode) -> Matrix3<f64> {
        let t = self.transmission;
        let load = t.load_inertia;
        let own = self.motor.inertia - load;
        let moving_motor = if t.structure.is_some_and(|s| s.carries_motor) { own } else { 0.0 };
        let structure = t.structure.map_or(0.0, |s| s.inertia);
        let inertia = Matrix3::new(
            own,
            0.0,
            moving_motor, //
            0.0,
            load,
            load, //
            moving_motor,
            load,
            structure + load + moving_motor,
        );
        let [motor_held, load_held] = mode.is_held;
        let is_fixed = [motor_held, load_held, t.structure.is_none()];
        let mut reduced = inertia;
        for (k, _) in is_fixed.iter().enumerate().filter(|(_, is_fixed)| **is_fixed) {
            reduced.row_mut(k).fill(0.0);
            reduced.column_mut(k).fill(0.0);
            reduced[(k, k)] = 1.0;
        }
        // Positive definite; an inverse that is not finite is found with the weights.
        let mut mobility = reduced.try_inverse().unwrap_or(Matrix3::repeat(f64::NAN));
        for (k, _) in is_fixed.iter().enumerate().filter(|(_, is_fixed)| **is_fixed) {
            mobility.row_mut(k).fill(0.0);
            mobility.column_mut(k).fill(0.0);
        }
        mobility
    }

    /// Returns the linear system of a mode with its weights over a substep of `period` seconds.
    pub fn system(&self, mode: Mode, period: f64) -> LinearSystem {
        let (m, t) = (self.motor, self.transmission);
        let mobility = self.mobility(mode);
        // Torques on the speeds of motor, load and structure by states and inputs.
        let mut torques = SMatrix::<f64, 3, ORDER>::zeros();
        torques[(0, CURRENT)] = m.torque_constant;
        torques[(0, MOTOR_TORQUE)] = 1.0;
        torques[(1, LOAD_TORQUE)] = 1.0;
        torques[(1, EXTERNAL)] = 1.0;
        torques[(2, EXTERNAL)] = 1.0;
        if let Some(s) = t.structure {
            torques[(2, STRUCTURE)] = -s.inertia * s.frequency * s.frequency;
            torques[(2, STRUCTURE_SPEED)] = -2.0 * s.damping_ratio * s.inertia * s.frequency;
        }
        if mode.is_in_contact {
            for (row, sign) in [(0, -1.0), (1, 1.0)] {
                torques[(row, TWIST)] = sign * t.stiffness;
                torques[(row, SPEED)] = sign * t.damping;
                torques[(row, LOAD_SPEED)] = -sign * t.damping;
            }
        }
        let accelerations = mobility * torques;
        let mut derivative = SMatrix::<f64, STATES, ORDER>::zeros();
        derivative[(CURRENT, CURRENT)] = -m.resistance / m.inductance;
        derivative[(CURRENT, SPEED)] = -m.emf_constant / m.inductance;
        derivative[(CURRENT, VOLTAGE)] = 1.0 / m.inductance;
        for (row, state) in [SPEED, LOAD_SPEED, STRUCTURE_SPEED].into_iter().enumerate() {
            derivative.set_row(state, &accelerations.row(row));
        }
        derivative[(STRUCTURE, STRUCTURE_SPEED)] = 1.0;
        derivative[(ANGLE, SPEED)] = 1.0;
        for row in [TWIST, WIND_UP] {
            derivative[(row, SPEED)] = 1.0;
            derivative[(row, LOAD_SPEED)] = -1.0;
        }
        if !mode.is_in_contact {
            // The twist of a spring without load is not linear in these states.
            derivative.row_mut(TWIST).fill(0.0);
        }
        let derivative = std::array::from_fn(|column| derivative.column(column).into_owned().into());
        let mut system = LinearSystem { derivative, substep: [[0.0; STATES]; ORDER], mobility };
        system.substep = std::array::from_fn(|column| system.after_unit(column, period).into());
        system
    }
}

/// Returns the sum of the columns with the weights `values`, one for each of the first columns.
#[inline(always)]
fn weighted<'a>(columns: &[[f64; STATES]; ORDER], values: impl Iterator<Item = &'a f64>) -> States {
    let mut sum = [0.0; STATES];
    for (column, value) in columns.iter().zip(values) {
        for (sum, entry) in sum.iter_mut().zip(column) {
            *sum += entry * value;
        }
    }
    sum.into()
}

impl LinearSystem {
    /// Returns the states `time` seconds after `start`, by the power series of the exponential.
    fn after(&self, start: &StatesAndInputs, time: f64) -> States {
        let mut term = weighted(&self.derivative, start.iter()) * time;
        let mut sum: States = start.fixed_rows::<STATES>(0) + term;
        for order in 2..=TERMS {
            term = weighted(&self.derivative, term.iter()) * (time / order as f64);
            sum += term;
        }
        sum
    }

    /// Returns the states `time` seconds after a start at 0 with 1 for one state or input.
    fn after_unit(&self, index: usize, time: f64) -> States {
        let mut unit = StatesAndInputs::zeros();
        unit[index] = 1.0;
        self.after(&unit, time)
    }

    /// Returns the response after a whole substep.
    #[inline(always)]
    pub fn whole(&self, start: &StatesAndInputs) -> Response {
        Response {
            free: weighted(&self.substep, start.iter()),
            by_torque: [self.substep[MOTOR_TORQUE].into(), self.substep[LOAD_TORQUE].into()],
            mobility: self.mobility,
        }
    }

    /// Returns the response after `time` seconds, a part of a substep.
    #[inline(never)]
    pub fn part(&self, start: &StatesAndInputs, time: f64) -> Response {
        Response {
            free: self.after(start, time),
            by_torque: [MOTOR_TORQUE, LOAD_TORQUE].map(|input| self.after_unit(input, time)),
            mobility: self.mobility,
        }
    }

    /// Returns true if all weights are finite, and torques at motor and load accelerate them where they are not held.
    pub fn is_valid(&self, mode: Mode) -> bool {
        let accelerates = |place: usize| {
            let input = [MOTOR_TORQUE, LOAD_TORQUE][place];
            mode.is_held[place] || self.substep[input][SPEED_AT[place]] > 0.0
        };
        self.substep.as_flattened().iter().all(|weight| weight.is_finite()) && (0..PLACES).all(accelerates)
    }
}

impl Response {
    /// Returns the displacement at each place of friction in `states`, rad.
    #[inline(always)]
    fn displacements(states: &States) -> [f64; PLACES] {
        [states[ANGLE], states[ANGLE] - states[WIND_UP]]
    }

    /// Returns the friction torques, N·m, that bring motor and load to rest, limited to `bounds`: where a torque is at its
    /// bound, the rest of the speed has its sign.
    #[inline(always)]
    pub fn stopping_torques(&self, bounds: [f64; PLACES]) -> [f64; PLACES] {
        let free = SPEED_AT.map(|at| self.free[at]);
        let effect = |on: usize, of: usize| self.by_torque[of][SPEED_AT[on]];
        let determinant = effect(0, 0) * effect(1, 1) - effect(0, 1) * effect(1, 0);
        let both = [
            (effect(1, 1) * free[0] - effect(0, 1) * free[1]) / determinant,
            (effect(0, 0) * free[1] - effect(1, 0) * free[0]) / determinant,
        ];
        if both[0].abs() < bounds[0] && both[1].abs() < bounds[1] {
            return both;
        }
        // One torque at its bound; the other one may be at its own.
        for (place, limit) in [(0, bounds[0]), (0, -bounds[0]), (1, bounds[1]), (1, -bounds[1])] {
            let other = 1 - place;
            let speed = free[other] - effect(other, place) * limit;
            let mut torques = [limit; PLACES];
            torques[other] = self.torque_for(other, speed, bounds[other]);
            let rest = free[place] - effect(place, place) * limit - effect(place, other) * torques[other];
            if rest * limit >= 0.0 {
                return torques;
            }
        }
        // Rounding errors at a bound.
        std::array::from_fn(|place| clamp_abs(both[place], bounds[place]))
    }

    /// Returns the friction torque, N·m, that brings one place to rest while the other has none, limited to `bound`.
    pub fn stopping_torque(&self, place: usize, bound: f64) -> f64 {
        self.torque_for(place, self.free[SPEED_AT[place]], bound)
    }

    /// Returns the torque that changes the speed at a place by −`speed`, N·m, limited to `bound`.
    #[inline(always)]
    fn torque_for(&self, place: usize, speed: f64, bound: f64) -> f64 {
        clamp_abs(speed / self.by_torque[place][SPEED_AT[place]], bound)
    }

    /// Returns the states with friction of `torques` over `time` seconds, within `bounds`; places that are held have no
    /// friction.
    ///
    /// Friction never supplies energy: where a constant torque would act along the displacement, it acts as an impulse at
    /// the end.
    #[inline(always)]
    pub fn with_friction(
        &self,
        mut torques: [f64; PLACES],
        bounds: [f64; PLACES],
        is_held: [bool; PLACES],
        time: f64,
    ) -> States {
        let mut acts_at_end = [false; PLACES];
        let is_unlimited = |place: usize| bounds[place] > 0.0 && torques[place].abs() < bounds[place];
        let comes_to_rest: [bool; PLACES] =
            std::array::from_fn(|place| !is_held[place] && is_unlimited(place));
        for place in 0..PLACES {
            if is_held[place] {
                torques[place] = 0.0;
            }
        }
        loop {
            let mut states = self.free;
            for (torque, change) in torques.iter().zip(&self.by_torque) {
                states -= *torque * change;
            }
            let displacements = Self::displacements(&states);
            let along = (0..PLACES).find(|&place| torques[place] * displacements[place] < 0.0);
            if let Some(place) = along {
                (torques[place], acts_at_end[place]) = (0.0, true);
                continue;
            }
            for place in 0..PLACES {
                if acts_at_end[place] {
                    self.stop(&mut states, place, bounds[place] * time);
                } else if comes_to_rest[place] && !acts_at_end[1 - place] {
                    // The rounding error.
                    states[SPEED_AT[place]] = 0.0;
                }
            }
            return states;
        }
    }

    /// Applies the impulse that brings a place of friction to rest, limited to `largest`, N·m·s.
    fn stop(&self, states: &mut States, place: usize, largest: f64) {
        let own = self.mobility[(place, place)];
        let impulse = clamp_abs(states[SPEED_AT[place]] / own, largest);
        for (row, state) in [SPEED, LOAD_SPEED, STRUCTURE_SPEED].into_iter().enumerate() {
            states[state] -= self.mobility[(row, place)] * impulse;
        }
        if impulse.abs() < largest {
            states[SPEED_AT[place]] = 0.0;
        }
    }
}
