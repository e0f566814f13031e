//! Axes side by side: their inner loops and plants, stepped through a position period.
//!
//! This is the only place where the recurrence of an axis is run. Each loop below goes over lanes, takes the
//! values of one axis, and says what happens to it; vectors are the compiler's business.

#![allow(clippy::needless_range_loop, reason = "a lane is an index into several arrays")]

use crate::control::{Pi, PiState};
use crate::drive::{Friction, MotorState, MotorStateLanes, Plant};
use crate::lanes::{Lane, lanes, select};

lanes! {
    /// What an axis is, inside its position loop.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Loops as LoopsLanes {
        pub plant: Plant,
        pub velocity: Pi,
        pub current: Pi,
    }
}

lanes! {
    /// What goes on from tick to tick.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct LoopsState as LoopsStateLanes {
        pub motor: MotorState,
        pub velocity: PiState,
        pub current: PiState,
        /// i*, A.
        pub current_setpoint: f64,
        /// Friction over the last tick, N·m.
        pub friction: f64,
        /// Gravity over the last tick, N·m.
        pub gravity: f64,
        /// Whether i* was limited at an instant of the velocity loop since the position instant.
        pub was_limited: bool,
        /// Ticks since the position instant with speed, current or voltage set-point at its limit.
        pub saturated_ticks: u64,
    }
}

lanes! {
    /// What is asked of an axis for a position period.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Demand as DemandLanes {
        /// Ω* after its limit, rad/s.
        pub velocity_setpoint: f64,
        pub speed_limited: bool,
        /// VFFWS, rad/s.
        pub velocity: Stair,
        /// TFFWS, N·m.
        pub torque: Stair,
        /// External load at the motor, N·m.
        pub load: f64,
    }
}

lanes! {
    /// A value that changes once in a position period.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Stair as StairLanes {
        pub before: f64,
        pub behind: f64,
        /// Instant of the velocity loop from which on it is the second one.
        pub step: f64,
    }
}

impl Stair {
    /// Its value at an instant of the velocity loop, counted from the position instant.
    #[inline(always)]
    pub fn at(&self, instant: f64) -> f64 {
        select(instant < self.step, self.before, self.behind)
    }
}

lanes! {
    /// What is kept of the position instant, and of every tick if it is asked for: what the controllers
    /// make of it, and the torques of the tick before.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Done as DoneLanes {
        pub current_setpoint: f64,
        pub voltage: f64,
        pub friction: f64,
        pub gravity: f64,
        pub saturated: bool,
    }
}

/// A row of lanes that begins where a vector can be fetched at once.
#[derive(Debug, Clone, PartialEq)]
#[repr(align(64))]
pub(super) struct Row<T>(pub T);

/// Ticks of the inner loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Timing {
    pub ticks_per_position: usize,
    pub ticks_per_velocity: usize,
}

impl Timing {
    /// Instants of the velocity loop in a position period.
    fn instants(self) -> usize {
        self.ticks_per_position / self.ticks_per_velocity
    }
}

/// `L` axes side by side.
#[derive(Debug, Clone, PartialEq)]
#[repr(align(64))]
pub(super) struct Block<const L: usize> {
    loops: Row<LoopsLanes<L>>,
    state: Row<LoopsStateLanes<L>>,
    demand: Row<DemandLanes<L>>,
    /// Gravity over the tick at hand, N·m.
    gravity: Row<[f64; L]>,
    /// Largest |i| and |ω| of any tick of the period.
    pub peak_current: [f64; L],
    pub peak_speed: [f64; L],
    /// Whether gravity of any axis depends on where it stands.
    tilting: bool,
    /// Whether the torque feedforward of any axis changes at every instant of the velocity loop.
    compensating: bool,
    /// Torque feedforward on top, at each instant of the velocity loop, N·m.
    compensation: Vec<Row<[f64; L]>>,
    /// The motors as the controllers find them, one for each tick.
    pub seen: Vec<Row<MotorStateLanes<L>>>,
    /// One for the position instant, or one for each tick.
    pub done: Vec<Row<DoneLanes<L>>>,
}

impl<const L: usize> Block<L> {
    /// A block whose every lane is an axis of `loops`; the lanes that stand for none do as that one does.
    pub fn new(loops: Loops, timing: Timing) -> Self {
        Block {
            loops: Row(loops.fill()),
            state: Row(LoopsState::default().fill()),
            demand: Row(Demand::default().fill()),
            gravity: Row([0.0; L]),
            peak_current: [0.0; L],
            peak_speed: [0.0; L],
            tilting: loops.plant.gravity.is_tilting(),
            compensating: false,
            compensation: vec![Row([0.0; L]); timing.instants()],
            seen: vec![Row(MotorState::default().fill()); timing.ticks_per_position],
            done: vec![Row(Done::default().fill())],
        }
    }

    /// Where an axis is.
    pub fn state(&self, lane: usize) -> LoopsState {
        LoopsState::get(&self.state.0, lane)
    }

    /// Puts an axis there.
    pub fn set_state(&mut self, lane: usize, state: &LoopsState) {
        state.set(&mut self.state.0, lane);
    }

    /// What is asked of an axis in the next position period.
    pub fn set_demand(&mut self, lane: usize, demand: &Demand) {
        demand.set(&mut self.demand.0, lane);
    }

    /// Puts the parameters of an axis into a lane.
    pub fn set_loops(&mut self, lane: usize, loops: Loops) {
        loops.set(&mut self.loops.0, lane);
        self.tilting = (0..L).any(|lane| Loops::get(&self.loops.0, lane).plant.gravity.is_tilting());
    }

    /// Torque feedforward of one lane on top, N·m, by the instant of the velocity loop.
    pub fn set_compensation(&mut self, lane: usize, torque: impl Fn(usize) -> f64) {
        self.compensating = true;
        for (instant, row) in self.compensation.iter_mut().enumerate() {
            row.0[lane] = torque(instant);
        }
    }

    /// Runs a position period, and keeps every tick where `TRACED`.
    #[inline(always)]
    pub fn run<const TRACED: bool>(&mut self, timing: Timing) {
        self.begin();
        // A copy that nothing else points to: it need not be in memory at every tick.
        let mut held = self.state.clone();
        let now = &mut held.0;
        for instant in 0..timing.instants() {
            self.control_velocity(now, instant);
            let first = instant * timing.ticks_per_velocity;
            for tick in first..first + timing.ticks_per_velocity {
                if TRACED || tick == 0 {
                    self.tick::<true>(now, tick);
                } else {
                    self.tick::<false>(now, tick);
                }
            }
        }
        self.state = held;
        self.find_peaks();
    }

    #[inline(always)]
    fn begin(&mut self) {
        self.state.0.was_limited = [0; L];
        self.state.0.saturated_ticks = [0; L];
        for lane in 0..L {
            let plant = Plant::get(&self.loops.0.plant, lane);
            self.gravity.0[lane] = plant.gravity_at(self.state.0.motor.angle[lane]);
        }
    }

    /// The velocity loop: torque from the error of the speed, and i* from that.
    #[inline(always)]
    fn control_velocity(&self, state: &mut LoopsStateLanes<L>, instant: usize) {
        let Block { loops: Row(loops), demand: Row(demand), .. } = self;
        let (compensation, compensating) = (&self.compensation, self.compensating);
        let since_instant = instant as f64;
        let more = if compensating { compensation[instant].0 } else { [0.0; L] };
        for lane in 0..L {
            let demand = Demand::get(demand, lane);
            let asked = demand.velocity_setpoint + demand.velocity.at(since_instant);
            let torque = demand.torque.at(since_instant) + more[lane];
            let error = asked - state.motor.speed[lane];
            let mut memory = PiState::get(&state.velocity, lane);
            let pi = Pi::get(&loops.velocity, lane);
            state.current_setpoint[lane] = pi.update_with(&mut memory, error, torque);
            memory.set(&mut state.velocity, lane);
            state.was_limited[lane] |= u64::from(memory.limited);
        }
    }

    /// The current loop and the plant.
    #[inline(always)]
    fn tick<const KEPT: bool>(&mut self, state: &mut LoopsStateLanes<L>, tick: usize) {
        self.seen[tick].0.clone_from(&state.motor);
        let (friction, gravity) = (state.friction, state.gravity);
        let voltages = if self.tilting { self.step::<true>(state) } else { self.step::<false>(state) };
        if KEPT || self.tilting {
            state.gravity = self.gravity.0;
        }
        if KEPT {
            let Block { demand: Row(demand), done, .. } = self;
            let done = &mut done[tick].0;
            done.current_setpoint = state.current_setpoint;
            (done.voltage, done.friction, done.gravity) = (voltages, friction, gravity);
            for lane in 0..L {
                let limited = demand.speed_limited[lane] | state.velocity.limited[lane];
                done.saturated[lane] = limited | state.current.limited[lane];
            }
        }
    }

    /// Moves the axes by one tick; the voltages come back.
    ///
    /// The bounds of friction come first, for all lanes: their exponentials are a long chain of arithmetic,
    /// and those of the next lanes fill the time that one waits for itself.
    #[inline(always)]
    fn step<const TILTING: bool>(&mut self, state: &mut LoopsStateLanes<L>) -> [f64; L] {
        let Block { loops: Row(loops), demand: Row(demand), gravity: Row(gravity), .. } = self;
        let (mut slowing, mut voltages) = (Row([0.0; L]), Row([0.0; L]));
        for lane in 0..L {
            slowing.0[lane] = Friction::get(&loops.plant.slowing, lane).bound(state.motor.speed[lane]);
            if TILTING {
                gravity[lane] = Plant::get(&loops.plant, lane).gravity_at(state.motor.angle[lane]);
            }
        }
        for lane in 0..L {
            let Loops { plant, current, .. } = Loops::get(loops, lane);
            let mut motor = MotorState::get(&state.motor, lane);
            let mut memory = PiState::get(&state.current, lane);
            let voltage = current.update(&mut memory, state.current_setpoint[lane] - motor.current);
            let external = demand.load[lane] - gravity[lane];
            state.friction[lane] = plant.step_under(&mut motor, voltage, external, slowing.0[lane]);
            voltages.0[lane] = voltage;
            motor.set(&mut state.motor, lane);
            memory.set(&mut state.current, lane);
            state.saturated_ticks[lane] +=
                demand.speed_limited[lane] | state.velocity.limited[lane] | u64::from(memory.limited);
        }
        voltages.0
    }

    /// The largest current and speed of any tick.
    #[inline(always)]
    fn find_peaks(&mut self) {
        let mut current = [0.0_f64; L];
        let mut speed = [0.0_f64; L];
        for row in &self.seen {
            for lane in 0..L {
                current[lane] = larger(current[lane], row.0.current[lane].abs());
                speed[lane] = larger(speed[lane], row.0.speed[lane].abs());
            }
        }
        (self.peak_current, self.peak_speed) = (current, speed);
    }
}

/// One comparison, where `f64::max` also looks for what is not a number.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}
