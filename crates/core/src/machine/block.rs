//! Axes side by side: their inner loops and plants, stepped through a position period.
//!
//! This is the only place where the recurrence of an axis is run. What happens to an axis is said once, over
//! vectors of as many axes as the processor reckons with at a time.

use std::hint::black_box;

use pulp::Simd;

use crate::control::{Pi, PiState};
use crate::drive::{Expansion, Incline, MotorState, Plant};
use crate::simd::{Fetch, Number, Twice, Vector, numbers};

numbers! {
    /// What an axis is, inside its position loop.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Loops {
        pub plant: Plant<N>,
        pub velocity: Pi<N>,
        pub current: Pi<N>,
    }
}

numbers! {
    /// What goes on from tick to tick.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct LoopsState {
        pub motor: MotorState<N>,
        pub velocity: PiState<N>,
        pub current: PiState<N>,
        /// i*, A.
        pub current_setpoint: N,
        /// Friction over the last tick, N·m.
        pub friction: N,
        /// Gravity over the last tick, N·m.
        pub gravity: N,
        /// By how much i* was over its limit at most since the position instant, A.
        pub current_excess: N,
    }
}

numbers! {
    /// What is asked of an axis for a position period.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Demand {
        /// Ω* after its limit, rad/s.
        pub velocity_setpoint: N,
        /// By how much it was over that, rad/s.
        pub velocity_excess: N,
        /// VFFWS, rad/s.
        pub velocity: Stair<N>,
        /// TFFWS, N·m.
        pub torque: Stair<N>,
        /// External load at the motor, N·m.
        pub load: N,
    }
}

numbers! {
    /// A value that changes once in a position period.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Stair {
        pub before: N,
        pub behind: N,
        /// Instant of the velocity loop from which on it is the second one.
        pub step: N,
    }
}

impl<N: Number> Stair<N> {
    /// Its value at an instant of the velocity loop, counted from the position instant.
    #[inline(always)]
    pub fn at(&self, instant: f64) -> N {
        self.before.select(self.step.constant(instant).less(self.step), self.behind)
    }
}

numbers! {
    /// What is kept of the position instant, and of every tick if it is asked for: what the controllers
    /// make of it, and the torques of the tick before.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Done {
        pub current_setpoint: N,
        pub voltage: N,
        pub friction: N,
        pub gravity: N,
        /// 1 where a setpoint was at its limit, else 0.
        pub saturated: N,
    }
}

numbers! {
    /// What the ticks of a period come to.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct Tally {
        /// Largest |i|, A.
        pub peak_current: N,
        /// Largest |ω|, rad/s.
        pub peak_speed: N,
        /// Ticks with speed, current or voltage setpoint at its limit.
        pub saturated_ticks: N,
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
    loops: Row<Loops<[f64; L]>>,
    state: Row<LoopsState<[f64; L]>>,
    demand: Row<Demand<[f64; L]>>,
    /// The friction laws near the speeds at hand.
    near: Row<Expansion<[f64; L]>>,
    /// Gravity near the angles at hand.
    incline: Row<Incline<[f64; L]>>,
    pub tally: Row<Tally<[f64; L]>>,
    /// Whether gravity of any axis depends on where it stands.
    tilting: bool,
    /// Torque feedforward on top, at each instant of the velocity loop, N·m; none if it is nothing.
    compensation: Vec<Row<[f64; L]>>,
    /// The motors as the controllers find them, one for each tick.
    pub seen: Vec<Row<MotorState<[f64; L]>>>,
    /// One for the position instant, or one for each tick.
    pub done: Vec<Row<Done<[f64; L]>>>,
}

impl<const L: usize> Block<L> {
    /// A block whose every lane is an axis of `loops`; the lanes that stand for none do as that one does.
    pub fn new(loops: &Loops, timing: Timing) -> Self {
        Block {
            loops: Row(loops.fill()),
            state: Row(LoopsState::default().fill()),
            demand: Row(Demand::default().fill()),
            near: Row(loops.plant.slowing.near(0.0).fill()),
            incline: Row(loops.plant.gravity.near(0.0).fill()),
            tally: Row(Tally::default().fill()),
            tilting: loops.plant.gravity.is_tilting(),
            compensation: Vec::new(),
            seen: vec![Row(MotorState::default().fill()); timing.ticks_per_position],
            done: vec![Row(Done::default().fill())],
        }
    }

    /// Where an axis is.
    pub fn state(&self, lane: usize) -> LoopsState {
        self.state.0.lane(lane)
    }

    /// Puts an axis there.
    pub fn set_state(&mut self, lane: usize, state: &LoopsState) {
        self.state.0.set_lane(lane, state);
        self.expand(lane);
    }

    /// What is asked of an axis in the next position period.
    pub fn set_demand(&mut self, lane: usize, demand: &Demand) {
        self.demand.0.set_lane(lane, demand);
    }

    /// Puts the parameters of an axis into a lane.
    pub fn set_loops(&mut self, lane: usize, loops: &Loops) {
        self.loops.0.set_lane(lane, loops);
        self.expand(lane);
        self.tilting = (0..L).any(|lane| self.loops.0.lane(lane).plant.gravity.is_tilting());
    }

    /// Expands friction and gravity of an axis at the speed and the angle that it has.
    fn expand(&mut self, lane: usize) {
        let (plant, motor) = (&self.loops.0.plant, &self.state.0.motor);
        self.near.0.set_lane(lane, &plant.slowing.lane(lane).near(motor.speed[lane]));
        self.incline.0.set_lane(lane, &plant.gravity.lane(lane).near(motor.angle[lane]));
    }

    /// Torque feedforward of one lane on top, N·m, by the instant of the velocity loop.
    pub fn set_compensation(&mut self, lane: usize, timing: Timing, torque: impl Fn(usize) -> f64) {
        self.compensation.resize_with(timing.instants(), || Row([0.0; L]));
        for (instant, row) in self.compensation.iter_mut().enumerate() {
            row.0[lane] = torque(instant);
        }
    }

    /// Runs a position period, and keeps every tick if it is `traced`.
    #[inline(always)]
    pub fn run<S: Simd>(&mut self, simd: S, timing: Timing, traced: bool) {
        if L.is_multiple_of(Twice::<Vector<S>>::LANES) {
            self.run_by::<S, Twice<Vector<S>>>(simd, timing, traced);
        } else {
            self.run_by::<S, Vector<S>>(simd, timing, traced);
        }
    }

    #[inline(always)]
    fn run_by<S: Simd, N: Fetch<S>>(&mut self, simd: S, timing: Timing, traced: bool) {
        assert!(L.is_multiple_of(N::LANES), "a vector is no wider than a block");
        for place in 0..L / N::LANES {
            if self.tilting {
                self.run_lanes::<S, N, true>(simd, place, timing, traced);
            } else {
                self.run_lanes::<S, N, false>(simd, place, timing, traced);
            }
        }
    }

    /// Runs a position period of the lanes at `place`, counted in as many as `N` are.
    #[inline(always)]
    fn run_lanes<S: Simd, N: Fetch<S>, const TILTING: bool>(
        &mut self,
        simd: S,
        place: usize,
        timing: Timing,
        traced: bool,
    ) {
        // Where something on it asks for that, the compiler aligns the whole stack: vectors that find no register
        // do not lie across two lines of the cache then.
        black_box(&mut Row(0_u8));
        let loops: Loops<N> = self.loops.0.fetch(simd, place);
        let demand: Demand<N> = self.demand.0.fetch(simd, place);
        let mut near: Expansion<N> = self.near.0.fetch(simd, place);
        let mut state: LoopsState<N> = self.state.0.fetch(simd, place);
        let nothing = state.friction.constant(0.0);
        let one = nothing.constant(1.0);
        state.current_excess = nothing;
        let mut saturated_ticks = nothing;
        let mut incline: Incline<N> = self.incline.0.fetch(simd, place);
        let mut gravity = match TILTING {
            true => loops.plant.gravity_near(&mut incline, state.motor.angle),
            false => loops.plant.weight(),
        };
        let mut external = demand.load - gravity;
        // From the speed by friction, in the tick before.
        let mut taken = nothing;
        for instant in 0..timing.instants() {
            let compensation = match self.compensation.get(instant) {
                Some(row) => N::fetch(simd, &row.0, place),
                None => nothing,
            };
            let excess = loops.control_velocity(&demand, &mut state, instant as f64, compensation);
            let ticks = instant * timing.ticks_per_velocity;
            for tick in ticks..ticks + timing.ticks_per_velocity {
                let slowing = loops.plant.slowing.bound_near(&mut near, state.motor.speed);
                self.seen[tick].0.put(place, &state.motor);
                if tick > 0 && (traced || TILTING) {
                    state.friction = loops.plant.friction_taking(taken);
                    state.gravity = gravity;
                    if TILTING {
                        gravity = loops.plant.gravity_near(&mut incline, state.motor.angle);
                        external = demand.load - gravity;
                    }
                }
                let (voltage, saturated) = loops.control_current(&mut state, excess);
                saturated_ticks = (saturated_ticks + one).select(saturated, saturated_ticks);
                taken = loops.plant.step_under(&mut state.motor, voltage, external, slowing);
                if traced || tick == 0 {
                    let LoopsState { current_setpoint, friction, gravity, .. } = state;
                    let saturated = one.select(saturated, nothing);
                    let done = Done { current_setpoint, voltage, friction, gravity, saturated };
                    self.done[tick].0.put(place, &done);
                }
            }
        }
        state.friction = loops.plant.friction_taking(taken);
        state.gravity = gravity;
        self.near.0.put(place, &near);
        if TILTING {
            self.incline.0.put(place, &incline);
        }
        self.state.0.put(place, &state);
        // In a loop of its own: the one above has no register left for it.
        let mut tally = Tally { peak_current: nothing, peak_speed: nothing, saturated_ticks };
        for row in &self.seen {
            let motor: MotorState<N> = row.0.fetch(simd, place);
            tally.peak_current = motor.current.abs().max(tally.peak_current);
            tally.peak_speed = motor.speed.abs().max(tally.peak_speed);
        }
        self.tally.0.put(place, &tally);
    }
}

impl<N: Number> Loops<N> {
    /// The velocity loop: torque from the error of the speed, and i* from that. By how much the setpoints
    /// of speed and current were over their limits comes back.
    #[inline(always)]
    fn control_velocity(&self, demand: &Demand<N>, state: &mut LoopsState<N>, instant: f64, more: N) -> N {
        let asked = demand.velocity_setpoint + demand.velocity.at(instant);
        let torque = demand.torque.at(instant) + more;
        let error = asked - state.motor.speed;
        state.current_setpoint = self.velocity.update_with(&mut state.velocity, error, torque);
        let excess = state.velocity.excess.abs();
        state.current_excess = excess.max(state.current_excess);
        excess + demand.velocity_excess.abs()
    }

    /// The current loop: the voltage comes back, and where a setpoint was at its limit. `excess` is that of the
    /// outer loops.
    #[inline(always)]
    fn control_current(&self, state: &mut LoopsState<N>, excess: N) -> (N, N::Mask) {
        let error = state.current_setpoint - state.motor.current;
        let voltage = self.current.update(&mut state.current, error);
        let nothing = excess.constant(0.0);
        (voltage, nothing.less(excess + state.current.excess.abs()))
    }
}
