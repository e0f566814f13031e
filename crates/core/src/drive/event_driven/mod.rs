//! Elastic transmission with backlash, with friction at the load, or on a structure that vibrates, stepped from event to
//! event.
//!
//! Equations, in units of the motor:
//!
//! ```text
//! L di/dt = u − R i − Ke ω                       τ = k σ + d (ω − ω_load)
//! Jm (dω/dt + c dv/dt) = Kt i − τ − C_motor      C_motor ≤ (1 − share) C(ω)
//! Jl (dω_load/dt + dv/dt) = τ − C_load + external   C_load ≤ share · C(ω_load)
//! Ms dv/dt = −c (Kt i − C_motor) − (1 − c) τ + C_load − ks f − ds v        df/dt = v
//! ```
//!
//! f is the displacement of the structure, ω_load is relative to it, and c is 1 for a direct drive, else 0. The wind-up
//! δ = θ − θ_load (relative to the structure) is the sum of the twist σ of the spring and the position in the gap of width
//! B, |δ − σ| ≤ B/2 (Nordin, Galic and Gutman, International Journal of Adaptive Control and Signal Processing 11, 1997):
//!
//! - In contact at one side (δ − σ = ±B/2) the spring pushes: ±τ ≥ 0. Contact ends when τ changes its sign.
//! - In the gap τ = 0, and the twist decays: k σ + d dσ/dt = 0. Contact begins when |δ − σ| reaches B/2.

mod linear_system;

use super::motor::MotorState;
use super::transmission::{LoadState, Transmission};
use super::{DriveError, Friction, Plant};
use crate::config::AxisConfig;
use crate::simd::soa_struct;
use linear_system::{
    ANGLE, CURRENT, EXTERNAL, Equations, LOAD_SPEED, LinearSystem, Mode, PLACES, Response, SPEED, SPEED_AT,
    STATES, STRUCTURE, STRUCTURE_SPEED, States, StatesAndInputs, TWIST, VOLTAGE, WIND_UP,
};

/// Largest number of substeps of a tick.
const MAX_SUBSTEPS: f64 = 64.0;
/// Events after which the mode remains to the end of a substep.
const MAX_EVENTS: usize = 8;
/// Tolerance of the instant of an event, relative to a substep.
const EVENT_TOLERANCE: f64 = 1e-13;
/// Iterations of the search for the instant of an event; bisections alone would need 44.
const MAX_ITERATIONS: usize = 100;

soa_struct! {
    /// State of an [`EventDrivenTransmission`] that other axes do not have; 0 for them.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct ContactState {
        /// Side of the contact: 1 if the motor pushes the load in the positive direction, −1 in the negative one, 0 in the
        /// gap.
        pub side: N,
        /// Twist σ of the spring, rad (m for a linear motor) at the motor.
        pub twist: N,
        /// Displacement f of the structure, rad (m for a linear motor) at the motor.
        pub structure: N,
        /// Velocity of the structure, rad/s (m/s for a linear motor) at the motor.
        pub structure_speed: N,
    }
}

/// Elastic transmission with backlash, with friction at the load, or on a structure that vibrates.
#[derive(Debug, Clone, PartialEq)]
pub struct EventDrivenTransmission {
    systems: Box<[LinearSystem; 8]>,
    /// Width B of the gap, rad.
    backlash: f64,
    /// k, N·m/rad.
    stiffness: f64,
    /// Stiffness ks of the structure, N·m/rad; infinite without one.
    structure_stiffness: f64,
    /// k/d, 1/s; infinite without damping.
    relaxation: f64,
    /// Share of the friction that acts at the load.
    load_share: f64,
    /// Friction law in N·m.
    law: Friction,
    /// Change of ω over a tick per torque at the motor, as the [`Motor`](super::Motor) has it, (rad/s)/(N·m).
    speed_per_torque: f64,
    substeps: usize,
    /// Period of a substep, s.
    period: f64,
}

/// State within a tick.
struct State {
    /// States relative to the structure.
    states: States,
    /// Wind-up δ relative to the structure, rad.
    wind_up: f64,
    /// Side of the contact; see [`ContactState`].
    side: f64,
    /// θ, rad.
    angle: f64,
}

/// Time between two events, with the states at its start, held inputs and bounds of friction.
struct Span<'a> {
    transmission: &'a EventDrivenTransmission,
    start: StatesAndInputs,
    /// Largest friction torques, N·m.
    bounds: [f64; PLACES],
    is_in_contact: bool,
}

impl EventDrivenTransmission {
    /// Creates the transmission of an axis with its deviation over ticks of `period` seconds; `None` for an axis without
    /// backlash, friction at the load and structure.
    ///
    /// # Errors
    /// [`DriveError`] if the equations cannot be discretized, or if their oscillations are too fast for a tick.
    pub fn new(axis: &AxisConfig, period: f64) -> Result<Option<Self>, DriveError> {
        let Some(t) = Plant::deviating_transmission(axis) else { return Ok(None) };
        if t.backlash <= 0.0 && t.load_friction <= 0.0 && t.structure.is_none() {
            return Ok(None);
        }
        let motor = Plant::deviating_motor(axis);
        let speed_per_torque = Transmission::new(&motor, &t, period)?.0.speed_per_torque();
        let equations = Equations { motor: &motor, transmission: &t };
        let rate = equations.rate();
        let substeps = (rate * period).ceil().max(1.0);
        // Also false for NaN.
        let is_resolved = substeps <= MAX_SUBSTEPS;
        if !is_resolved {
            return Err(DriveError::TooFast { period_s: period, time_s: 1.0 / rate });
        }
        let substep = period / substeps;
        let systems = Mode::all().map(|mode| equations.system(mode, substep));
        if !Mode::all().iter().zip(&systems).all(|(mode, system)| system.is_valid(*mode)) {
            return Err(DriveError::Discretization { period_s: period, speed_per_torque });
        }
        // The friction law is in amperes of the nominal motor.
        let law = Friction::of_axis(axis, axis.motor.torque_constant * axis.deviation.friction);
        Ok(Some(EventDrivenTransmission {
            systems: Box::new(systems),
            backlash: t.backlash,
            stiffness: t.stiffness,
            structure_stiffness: t.structure.map_or(f64::INFINITY, |s| s.inertia * s.frequency * s.frequency),
            relaxation: t.stiffness / t.damping,
            load_share: t.load_friction,
            law,
            speed_per_torque,
            substeps: substeps as usize,
            period: substep,
        }))
    }

    /// Returns wind-up and contact at rest, with the motor at a `torque` that holds the load (N·m at the motor); in the middle
    /// of the gap without one. The structure has its static displacement.
    pub fn at_rest(&self, torque: f64) -> (f64, ContactState) {
        let side = match torque {
            _ if self.backlash <= 0.0 => 0.0,
            0.0 => 0.0,
            _ => torque.signum(),
        };
        let twist = torque / self.stiffness;
        let structure = -torque / self.structure_stiffness;
        let contact = ContactState { side, twist, structure, structure_speed: 0.0 };
        (twist + side * self.backlash / 2.0 - structure, contact)
    }

    /// Steps motor, load and structure by one tick; returns the mean torque of all friction over it, N·m at the motor.
    ///
    /// `external` is load minus gravity, N·m at the motor. Wind-up and speed of `load` are those against the environment,
    /// with the motion of the structure.
    #[inline(always)]
    pub fn step(
        &self,
        motor: &mut MotorState,
        load: &mut LoadState,
        contact: &mut ContactState,
        voltage: f64,
        external: f64,
    ) -> f64 {
        let mut state = State {
            states: States::zeros(),
            wind_up: load.wind_up + contact.structure,
            side: contact.side,
            angle: motor.angle,
        };
        state.states[CURRENT] = motor.current;
        state.states[SPEED] = motor.speed;
        state.states[TWIST] = contact.twist;
        state.states[LOAD_SPEED] = load.speed - contact.structure_speed;
        state.states[STRUCTURE] = contact.structure;
        state.states[STRUCTURE_SPEED] = contact.structure_speed;
        let bounds = [
            (1.0 - self.load_share) * self.law.bound(motor.speed),
            self.load_share * self.law.bound(state.states[LOAD_SPEED]),
        ];
        let mut friction = 0.0;
        for _ in 0..self.substeps {
            friction += self.substep(&mut state, [voltage, external], bounds);
        }
        let states = &state.states;
        *motor = MotorState { current: states[CURRENT], speed: states[SPEED], angle: state.angle };
        *contact = ContactState {
            side: state.side,
            twist: states[TWIST],
            structure: states[STRUCTURE],
            structure_speed: states[STRUCTURE_SPEED],
        };
        *load = LoadState {
            wind_up: state.wind_up - contact.structure,
            speed: states[LOAD_SPEED] + contact.structure_speed,
        };
        friction / (self.period * self.substeps as f64)
    }

    /// Returns the speed drop over a tick (rad/s) by a friction torque (N·m).
    pub(crate) fn speed_drop_from_torque(&self, torque: f64) -> f64 {
        torque * self.speed_per_torque
    }

    /// Steps by one substep, from event to event; returns the impulse of all friction, N·m·s.
    #[inline(always)]
    fn substep(&self, state: &mut State, [voltage, external]: [f64; 2], bounds: [f64; PLACES]) -> f64 {
        let (mut left, mut impulse) = (self.period, 0.0);
        let mut events = if self.backlash > 0.0 { 0 } else { MAX_EVENTS };
        while left > 0.0 {
            if self.backlash > 0.0 && events == MAX_EVENTS && state.side == 0.0 {
                // The last event was the end of a contact: the load is still at that side.
                self.enter_contact(state);
            }
            let mut start = StatesAndInputs::zeros();
            start.fixed_rows_mut::<STATES>(0).copy_from(&state.states);
            (start[ANGLE], start[WIND_UP]) = (0.0, 0.0);
            (start[VOLTAGE], start[EXTERNAL]) = (voltage, external);
            let is_in_contact = self.backlash <= 0.0 || state.side != 0.0;
            let span = Span { transmission: self, start, bounds, is_in_contact };
            let crossing = |next: &States, time: f64| self.crossing(state, next, time);
            let (mut length, (mut next, mut torques)) = (left, span.end(left));
            let is_event = events < MAX_EVENTS && crossing(&next, left) > 0.0;
            if is_event {
                length = event_instant(left, |time| crossing(&span.end(time).0, time));
                (next, torques) = span.end(length);
            }
            if !is_in_contact {
                next[TWIST] = self.relaxed(state.states[TWIST], length);
            }
            state.wind_up += next[WIND_UP];
            state.angle += next[ANGLE];
            state.states = next;
            if self.backlash > 0.0 && state.side != 0.0 {
                // Without rounding errors of its own.
                state.states[TWIST] = state.wind_up - state.side * self.backlash / 2.0;
            }
            if is_event {
                events += 1;
                match state.side {
                    0.0 => self.enter_contact(state),
                    _ => state.side = 0.0,
                }
            }
            impulse += (torques[0] + torques[1]) * length;
            left -= length;
        }
        impulse
    }

    /// Begins the contact at the nearer side of the gap.
    fn enter_contact(&self, state: &mut State) {
        state.side = (state.wind_up - state.states[TWIST]).signum();
        state.states[TWIST] = state.wind_up - state.side * self.backlash / 2.0;
    }

    /// Returns the twist of a spring without load after `time` seconds, rad.
    fn relaxed(&self, twist: f64, time: f64) -> f64 {
        match self.relaxation {
            rate if rate.is_infinite() => 0.0,
            rate => twist * (-rate * time).exp(),
        }
    }

    /// Returns a function of the states `time` seconds after `state` that is positive beyond the next event: the torque that
    /// pulls at a contact, N·m, or the travel beyond the gap, rad.
    #[inline(always)]
    fn crossing(&self, state: &State, next: &States, time: f64) -> f64 {
        let wind_up = state.wind_up + next[WIND_UP];
        if state.side == 0.0 {
            let position = wind_up - self.relaxed(state.states[TWIST], time);
            return position.abs() - self.backlash / 2.0;
        }
        let spring = self.stiffness * (wind_up - state.side * self.backlash / 2.0);
        // Without damping the relaxation is infinite.
        let damper = self.stiffness / self.relaxation * (next[SPEED] - next[LOAD_SPEED]);
        -state.side * (spring + damper)
    }
}

impl Span<'_> {
    #[inline(always)]
    fn response(&self, mode: Mode, time: f64) -> Response {
        let system = &self.transmission.systems[mode.index()];
        match time == self.transmission.period {
            true => system.whole(&self.start),
            false => system.part(&self.start, time),
        }
    }

    /// Returns the states `time` seconds after the start, and the friction torques, N·m.
    ///
    /// Friction is the torque that brings a place to rest, limited to its bound. What is at rest at the start and would be
    /// at the end is held in between.
    #[inline(always)]
    fn end(&self, time: f64) -> (States, [f64; PLACES]) {
        let free = Mode { is_in_contact: self.is_in_contact, is_held: [false; PLACES] };
        let response = self.response(free, time);
        let mut torques = response.stopping_torques(self.bounds);
        let is_held = std::array::from_fn(|place| {
            self.start[SPEED_AT[place]] == 0.0 && torques[place].abs() < self.bounds[place]
        });
        if is_held == [false; PLACES] {
            return (response.with_friction(torques, self.bounds, is_held, time), torques);
        }
        let response = self.response(Mode { is_held, ..free }, time);
        for place in (0..PLACES).filter(|&place| !is_held[place]) {
            torques[place] = response.stopping_torque(place, self.bounds[place]);
        }
        (response.with_friction(torques, self.bounds, is_held, time), torques)
    }
}

/// Returns an instant up to `end` at which `crossing` has become positive, by the Illinois method with bisection.
/// `crossing` is positive at `end`.
#[inline(never)]
fn event_instant(end: f64, crossing: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, end);
    let (mut below, mut above) = (crossing(0.0).min(0.0), crossing(end));
    let mut was_above = None;
    for iteration in 0..MAX_ITERATIONS {
        if high - low <= EVENT_TOLERANCE * end {
            break;
        }
        let secant = (low * above - high * below) / (above - below);
        // Every third iteration bisects, so that the bracket always shrinks.
        let inside = iteration % 3 != 2 && low < secant && secant < high;
        let middle = if inside { secant } else { low + (high - low) / 2.0 };
        let value = crossing(middle);
        let is_above = value > 0.0;
        if is_above {
            (high, above) = (middle, value);
        } else {
            (low, below) = (middle, value);
        }
        if was_above == Some(is_above) {
            *(if is_above { &mut below } else { &mut above }) /= 2.0;
        }
        was_above = Some(is_above);
    }
    high
}
