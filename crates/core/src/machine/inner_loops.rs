//! Inner loops (velocity and current PI controllers with anti-windup) and plants of several axes in SIMD lanes,
//! stepped through one position cycle.
//!
//! [`AxisBlock::run`] is the only code that runs the recurrence of an axis: one generic function over [`SimdReal`],
//! compiled once per SIMD width. Its documentation lists the equations.

use std::hint::black_box;
use std::sync::Arc;

use pulp::Simd;

use super::elements::Elements;
use crate::control::{CurrentFilterState, CurrentFilters, Pi, PiState};
use crate::drive::{
    ContactState, EventDrivenTransmission, FrictionExpansion, GravityExpansion, LoadState, MaxwellSlip,
    MaxwellSlipState, MotorState, Plant,
};
use crate::simd::{Aligned, LANES, SimdLoad, SimdReal, Unroll2, Vector, soa_struct};
use crate::state_codec::StateCodec;

soa_struct! {
    /// Parameters of one axis inside its position loop: plant, velocity controller, current controller.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct InnerLoops {
        pub plant: Plant<N>,
        pub velocity: Pi<N>,
        pub filters: CurrentFilters<N>,
        pub current: Pi<N>,
    }
}

soa_struct! {
    /// State of one axis that the inner loops carry from tick to tick.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct InnerLoopState {
        pub motor: MotorState<N>,
        pub load: LoadState<N>,
        pub contact: ContactState<N>,
        /// Deflection of the bristles of friction, rad of the motor; 0 without presliding.
        pub deflection: N,
        pub velocity: PiState<N>,
        pub filters: CurrentFilterState<N>,
        pub current: PiState<N>,
        /// i*, A.
        pub current_setpoint: N,
        /// Friction torque over the last tick, N·m.
        pub friction: N,
        /// Gravity torque over the last tick, N·m.
        pub gravity: N,
        /// Largest amount by which i* exceeded its limit since the start of the position cycle, A.
        pub max_current_excess: N,
    }
}

soa_struct! {
    /// Inputs to the inner loops for one position cycle.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct InnerLoopInputs {
        /// Ω* after its limit, rad/s of the motor.
        pub velocity_setpoint: N,
        /// Amount by which Ω* exceeded its limit, rad/s.
        pub velocity_excess: N,
        /// VFFWS, rad/s of the motor.
        pub velocity: ZeroOrderHold<N>,
        /// TFFWS, N·m at the motor.
        pub torque: ZeroOrderHold<N>,
        /// Load torque, N·m at the motor, positive towards plus.
        pub load: N,
    }
}

soa_struct! {
    /// Zero-order-held input that switches once per position cycle, at velocity cycle `step`.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct ZeroOrderHold {
        /// Value before the switch.
        pub before: N,
        /// Value from the switch on.
        pub after: N,
        /// First velocity cycle with the second value, counted from the start of the position cycle.
        pub step: N,
    }
}

impl<N: SimdReal> ZeroOrderHold<N> {
    /// Returns the value in a velocity cycle, counted from the start of the position cycle.
    #[inline(always)]
    pub fn at(&self, velocity_cycle: f64) -> N {
        self.before.select(self.step.splat(velocity_cycle).simd_lt(self.step), self.after)
    }
}

soa_struct! {
    /// Controller outputs of one tick and torques over the tick before.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct TickRecord {
        /// i*, A.
        pub current_setpoint: N,
        /// u, V.
        pub voltage: N,
        /// Friction torque, N·m.
        pub friction: N,
        /// Gravity torque, N·m.
        pub gravity: N,
        /// 1 if speed, current or voltage setpoint is at its limit, else 0.
        pub saturated: N,
    }
}

soa_struct! {
    /// Statistics over the ticks of one position cycle.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(super) struct CycleStatistics {
        /// Largest |i|, A.
        pub peak_current: N,
        /// Largest |ω|, rad/s.
        pub peak_speed: N,
        /// Ticks with speed, current or voltage setpoint at its limit.
        pub saturated_ticks: N,
    }
}

soa_struct! {
    /// Values within a velocity cycle, for a position cycle that is run in several spans.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    struct SpanState {
        /// Amounts by which the speed and current setpoints exceeded their limits, added up.
        excess: N,
        /// Speed drop by friction over the last tick, rad/s.
        speed_drop: N,
        /// Ticks of the position cycle so far with a setpoint at its limit.
        saturated_ticks: N,
    }
}

soa_struct! {
    /// Step of the axes with an event-driven transmission: inputs and results.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    struct EventDrivenStep {
        motor: MotorState<N>,
        load: LoadState<N>,
        contact: ContactState<N>,
        speed_drop: N,
        voltage: N,
        /// Load minus gravity, N·m at the motor.
        external: N,
    }
}

/// Aligns the stack frame of the calling function to 64 bytes; returns the address of a local aligned that way.
///
/// The compiler aligns a stack frame as its most aligned local requires. SIMD vectors that are spilled to an aligned
/// frame do not cross cache lines (docs/internals/performance.md, block sizes). [`black_box`] keeps the local from being
/// optimized away. The function is always inlined: a call would align only its own frame.
#[inline(always)]
fn align_stack_frame() -> usize {
    std::ptr::from_mut(black_box(&mut Aligned(0_u8))).addr()
}

/// Lengths of the control cycles in ticks; a tick is one current cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct CycleTicks {
    /// Ticks per position cycle.
    pub position: usize,
    /// Ticks per velocity cycle.
    pub velocity: usize,
}

impl CycleTicks {
    /// Returns the number of velocity cycles per position cycle.
    fn velocity_cycles(self) -> usize {
        self.position / self.velocity
    }
}

/// Ticks of a position cycle to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TickSpan {
    /// First tick, counted from the start of the position cycle.
    pub first: usize,
    /// Tick after the last one.
    pub end: usize,
    /// True to record every tick, otherwise the first one of the position cycle only.
    pub record_all: bool,
}

impl TickSpan {
    /// Returns the span of a whole position cycle.
    pub fn whole(ticks: CycleTicks, record_all: bool) -> Self {
        TickSpan { first: 0, end: ticks.position, record_all }
    }
}

/// State of an axis that its position loop reads.
#[derive(Debug, Clone, Copy)]
pub(super) struct DriveFeedback {
    /// Angle of the motor, rad.
    pub angle: f64,
    /// Speed of the motor, rad/s.
    pub speed: f64,
    /// Wind-up of the transmission and the structure, rad of the motor.
    pub wind_up: f64,
    /// Largest amount by which i* exceeded its limit in the last position cycle, A.
    pub max_current_excess: f64,
}

/// State of motor and load; that of the load is 0 for a rigid axis.
pub(super) type DriveState = (MotorState, LoadState);

/// State of a block at the start of a tick.
#[derive(Debug, Clone, PartialEq)]
struct TickStart {
    state: Aligned<InnerLoopState<[f64; LANES]>>,
    friction_expansion: Aligned<FrictionExpansion<[f64; LANES]>>,
    gravity_expansion: Aligned<GravityExpansion<[f64; LANES]>>,
    span_state: Aligned<SpanState<[f64; LANES]>>,
    elements: Elements,
}

/// Parameters, inputs, state and results of up to [`LANES`] axes, one per SIMD lane.
#[derive(Debug, Clone, PartialEq)]
#[repr(align(64))]
pub(super) struct AxisBlock {
    /// Number of axes; the other lanes repeat the first one.
    axes: usize,
    loops: Aligned<InnerLoops<[f64; LANES]>>,
    state: Aligned<InnerLoopState<[f64; LANES]>>,
    inputs: Aligned<InnerLoopInputs<[f64; LANES]>>,
    /// Expansions of the friction laws near the present speeds.
    friction_expansion: Aligned<FrictionExpansion<[f64; LANES]>>,
    /// Expansions of gravity near the present angles.
    gravity_expansion: Aligned<GravityExpansion<[f64; LANES]>>,
    pub statistics: Aligned<CycleStatistics<[f64; LANES]>>,
    /// Values to continue within a position cycle.
    span_state: Aligned<SpanState<[f64; LANES]>>,
    /// True if gravity of any axis depends on its position.
    has_tilting_axis: bool,
    /// True if the transmission of any axis is elastic.
    has_elastic_axis: bool,
    /// Transmissions of the axes with backlash, friction at the load or a structure.
    event_driven: [Option<Arc<EventDrivenTransmission>>; LANES],
    /// True if there is an event-driven transmission.
    has_event_driven_axis: bool,
    /// Elements of the friction of the axes with the generalized Maxwell-slip model.
    elements: Elements,
    /// True if the friction of any axis has presliding.
    has_presliding: bool,
    /// True if the friction law of any axis has a Stribeck or viscous term.
    has_stribeck_terms: bool,
    /// True if the current setpoint of any axis is filtered.
    has_filters: bool,
    /// Friction compensation of each velocity cycle, N·m at the motor; empty without compensation.
    compensation: Vec<Aligned<[f64; LANES]>>,
    /// Motor states at the start of each tick.
    pub motors: Vec<Aligned<MotorState<[f64; LANES]>>>,
    /// States of the loads at the start of each tick; empty without an elastic axis.
    pub loads: Vec<Aligned<LoadState<[f64; LANES]>>>,
    /// Record of the first tick, or of each tick if all are recorded.
    pub records: Vec<Aligned<TickRecord<[f64; LANES]>>>,
    /// State at the start of a tick that can be repeated; empty at other times.
    start: Vec<TickStart>,
}

impl AxisBlock {
    /// Creates a block of the axes `axes`, at least one and at most [`LANES`].
    pub fn new(axes: &[InnerLoops], ticks: CycleTicks) -> Self {
        let loops = &axes[0];
        let mut block = AxisBlock {
            axes: axes.len(),
            loops: Aligned(loops.fill()),
            state: Aligned(InnerLoopState::default().fill()),
            inputs: Aligned(InnerLoopInputs::default().fill()),
            friction_expansion: Aligned(loops.plant.friction_speed_drop.expand(0.0).fill()),
            gravity_expansion: Aligned(loops.plant.gravity.expand(0.0).fill()),
            statistics: Aligned(CycleStatistics::default().fill()),
            span_state: Aligned(SpanState::default().fill()),
            has_tilting_axis: loops.plant.gravity.is_position_dependent(),
            has_elastic_axis: false,
            event_driven: [const { None }; LANES],
            has_event_driven_axis: false,
            elements: Elements::none(),
            has_presliding: false,
            has_stribeck_terms: false,
            has_filters: false,
            compensation: Vec::new(),
            motors: vec![Aligned(MotorState::default().fill()); ticks.position],
            loads: Vec::new(),
            records: vec![Aligned(TickRecord::default().fill())],
            start: Vec::new(),
        };
        axes.iter().enumerate().for_each(|(lane, loops)| block.set_loops(lane, loops));
        block
    }

    /// Returns the state in a lane.
    pub fn state(&self, lane: usize) -> InnerLoopState {
        self.state.0.lane(lane)
    }

    /// Returns the part of the state in a lane that the position loop reads.
    pub fn feedback(&self, lane: usize) -> DriveFeedback {
        let InnerLoopState { motor, load, contact, max_current_excess, .. } = &self.state.0;
        DriveFeedback {
            angle: motor.angle[lane],
            speed: motor.speed[lane],
            wind_up: load.wind_up[lane] + contact.structure[lane],
            max_current_excess: max_current_excess[lane],
        }
    }

    /// Sets the state in a lane.
    pub fn set_state(&mut self, lane: usize, state: &InnerLoopState) {
        self.state.0.set_lane(lane, state);
        self.expand(lane);
    }

    /// Writes or replaces the state in a lane, with that within a position cycle and the records of its ticks.
    pub fn code(&mut self, lane: usize, ticks: CycleTicks, codec: &mut StateCodec<'_>) {
        macro_rules! code {
            ($values:expr) => {
                let values = $values.0.lane(lane).map(&mut |value| codec.number(*value));
                $values.0.set_lane(lane, &values);
            };
        }
        code!(self.state);
        code!(self.inputs);
        code!(self.friction_expansion);
        code!(self.gravity_expansion);
        code!(self.statistics);
        code!(self.span_state);
        self.elements.code(lane, codec);
        let rows = codec.integer(self.compensation.len() as u64, ticks.velocity_cycles() as u64) as usize;
        let records = codec.integer(self.records.len() as u64, ticks.position as u64) as usize;
        // Another axis of the block can have more rows.
        self.compensation.resize_with(rows.max(self.compensation.len()), || Aligned([0.0; LANES]));
        let record = || Aligned(TickRecord::default().fill());
        self.records.resize_with(records.max(self.records.len()), record);
        codec.numbers(self.compensation[..rows].iter_mut().map(|row| &mut row.0[lane]));
        for row in &mut self.motors {
            code!(row);
        }
        for row in &mut self.loads {
            code!(row);
        }
        for row in &mut self.records[..records] {
            code!(row);
        }
    }

    /// Sets the inputs of a lane for the next position cycle.
    pub fn set_inputs(&mut self, lane: usize, inputs: &InnerLoopInputs) {
        self.inputs.0.set_lane(lane, inputs);
    }

    /// Sets the load torque of a lane for the rest of the position cycle, N·m at the motor.
    pub fn set_load_torque(&mut self, lane: usize, torque: f64) {
        self.inputs.0.load[lane] = torque;
    }

    /// Stores the state at the start of a tick that can be repeated.
    pub fn store_start(&mut self) {
        self.start.clear();
        self.start.push(TickStart {
            state: self.state.clone(),
            friction_expansion: self.friction_expansion.clone(),
            gravity_expansion: self.gravity_expansion.clone(),
            span_state: self.span_state.clone(),
            elements: self.elements.clone(),
        });
    }

    /// Restores the state at the start of the tick.
    pub fn restore_start(&mut self) {
        if let Some(start) = self.start.last() {
            self.state.clone_from(&start.state);
            self.friction_expansion.clone_from(&start.friction_expansion);
            self.gravity_expansion.clone_from(&start.gravity_expansion);
            self.span_state.clone_from(&start.span_state);
            self.elements.clone_from(&start.elements);
        }
    }

    /// Discards the state at the start of the tick.
    pub fn discard_start(&mut self) {
        self.start.clear();
    }

    /// Sets the parameters of a lane.
    pub fn set_loops(&mut self, lane: usize, loops: &InnerLoops) {
        self.loops.0.set_lane(lane, loops);
        self.expand(lane);
        let any = |is: fn(&InnerLoops) -> bool| (0..LANES).any(|lane| is(&self.loops.0.lane(lane)));
        self.has_tilting_axis = any(|loops| loops.plant.gravity.is_position_dependent());
        self.has_elastic_axis = any(|loops| loops.plant.transmission.is_elastic());
        self.has_filters = any(|loops| loops.filters.is_enabled());
        self.has_presliding = any(|loops| loops.plant.presliding.is_present());
        self.has_stribeck_terms = any(|loops| loops.plant.friction_speed_drop.has_stribeck_terms());
        let rows = if self.has_elastic_axis { self.motors.len() } else { 0 };
        self.loads.resize_with(rows, || Aligned(LoadState::default().fill()));
    }

    /// Sets the event-driven transmission of a lane, in place of that of its plant.
    pub fn set_event_driven(&mut self, lane: usize, transmission: Option<Arc<EventDrivenTransmission>>) {
        self.event_driven[lane] = transmission;
        self.has_event_driven_axis = self.event_driven.iter().any(Option::is_some);
    }

    /// Sets the elements of the friction of a lane, in place of the bristles of its plant, and keeps their forces.
    pub fn set_elements(&mut self, lane: usize, elements: Option<Arc<MaxwellSlip>>) {
        self.elements.set(lane, elements);
    }

    /// Sets the forces of the elements of a lane to 0.
    pub fn reset_elements(&mut self, lane: usize) {
        self.elements.states[lane] = MaxwellSlipState::default();
    }

    /// Returns true if an axis has a property that the paper's model leaves out.
    fn is_extended(&self) -> bool {
        self.has_elastic_axis || self.has_presliding || self.has_stribeck_terms || self.has_filters
    }

    /// Expands friction and gravity of a lane at its present speed and angle.
    fn expand(&mut self, lane: usize) {
        let (plant, motor, load) = (&self.loops.0.plant, &self.state.0.motor, &self.state.0.load);
        self.friction_expansion
            .0
            .set_lane(lane, &plant.friction_speed_drop.lane(lane).expand(motor.speed[lane]));
        self.gravity_expansion
            .0
            .set_lane(lane, &plant.gravity.lane(lane).expand(motor.angle[lane] - load.wind_up[lane]));
    }

    /// Sets the friction compensation of a lane; `torque` returns N·m at the motor for each velocity cycle.
    pub fn set_compensation(&mut self, lane: usize, ticks: CycleTicks, torque: impl Fn(usize) -> f64) {
        self.compensation.resize_with(ticks.velocity_cycles(), || Aligned([0.0; LANES]));
        for (velocity_cycle, row) in self.compensation.iter_mut().enumerate() {
            row.0[lane] = torque(velocity_cycle);
        }
    }

    /// Runs a position cycle or, tick by tick, a part of it. Parts in order have the results of the whole, bit by bit.
    ///
    /// Each velocity cycle (period Tsv) executes the velocity PI controller with feedforward, current limit and
    /// anti-windup (Prévost fig. 3 and eqs. 6 to 8):
    ///
    /// ```text
    /// e = Ω* + VFFWS − ω                    J = Iv + (Kv Tsv/Tv) e
    /// w = F((Kv e + J + TFFWS + C_comp)/Kt) i* = clamp(w, ±imax)         Iv ← Iv if (w − i*) e > 0, else J
    /// ```
    ///
    /// F is the filters of the current setpoint in series; without filters, w is not filtered.
    ///
    /// Each tick (current cycle, period Tsi) executes the current PI controller with voltage limit and anti-windup,
    /// then steps the plant by its zero-order-hold discretization (Prévost eq. 1), with the friction law of
    /// Prévost eq. 3:
    ///
    /// ```text
    /// e = i* − i                            J = Ii + (Ki Tsi/Ti) e
    /// w = Ki e + J                          u = clamp(w, ±umax)          Ii ← Ii if (w − u) e > 0, else J
    /// τ = r F_load − C_gravity(θₙ) − C_friction
    /// [i ω]ₙ₊₁ = Φ [i ω]ₙ + Γu u + Γτ τ     θₙ₊₁ = θₙ + φ [i ω]ₙ + γu u + γτ τ
    /// C_friction: torque that gives ωₙ₊₁ = 0, clamped to ±Kt i_f(|ωₙ|)
    /// ```
    #[inline(always)]
    pub fn run<S: Simd>(&mut self, simd: S, ticks: CycleTicks, span: TickSpan) {
        // The latencies of one vector overlap with the operations of the other.
        if 2 * S::F64_LANES <= LANES && S::F64_LANES < self.axes {
            self.run_chunks::<S, Unroll2<Vector<S>>>(simd, ticks, span);
        } else {
            self.run_chunks::<S, Vector<S>>(simd, ticks, span);
        }
    }

    #[inline(always)]
    fn run_chunks<S: Simd, N: SimdLoad<S>>(&mut self, simd: S, ticks: CycleTicks, span: TickSpan) {
        let is_whole = span.first == 0 && span.end == ticks.position;
        for index in 0..self.axes.div_ceil(N::LANES) {
            // With more of the three true, only the time differs.
            match (is_whole, self.has_tilting_axis) {
                _ if self.is_extended() => self.run_chunk::<S, N, true, true, true>(simd, index, ticks, span),
                (true, false) => self.run_chunk::<S, N, false, false, false>(simd, index, ticks, span),
                (true, true) => self.run_chunk::<S, N, true, false, false>(simd, index, ticks, span),
                (false, _) => self.run_chunk::<S, N, true, true, false>(simd, index, ticks, span),
            }
        }
    }

    /// Runs the lanes `index`·`N::LANES` … (`index` + 1)·`N::LANES` − 1; see [`run`](Self::run). With `IS_PART` false,
    /// the span is a whole position cycle; with `IS_EXTENDED` false, no axis has what the paper's model leaves out.
    #[inline(always)]
    fn run_chunk<
        S: Simd,
        N: SimdLoad<S>,
        const HAS_TILTING_AXIS: bool,
        const IS_PART: bool,
        const IS_EXTENDED: bool,
    >(
        &mut self,
        simd: S,
        index: usize,
        ticks: CycleTicks,
        span: TickSpan,
    ) {
        align_stack_frame();
        let record_all = span.record_all;
        let continues = IS_PART && span.first > 0;
        let loops: InnerLoops<N> = self.loops.0.load(simd, index);
        let inputs: InnerLoopInputs<N> = self.inputs.0.load(simd, index);
        let mut friction_expansion: FrictionExpansion<N> = self.friction_expansion.0.load(simd, index);
        let mut state: InnerLoopState<N> = self.state.0.load(simd, index);
        let zero = state.friction.splat(0.0);
        let one = zero.splat(1.0);
        let mut saturated_ticks = zero;
        let mut gravity_expansion: GravityExpansion<N> = self.gravity_expansion.0.load(simd, index);
        // Speed drop by friction over the previous tick, rad/s.
        let mut speed_drop = zero;
        let mut excess = zero;
        let mut gravity = if continues {
            let kept: SpanState<N> = self.span_state.0.load(simd, index);
            (excess, speed_drop, saturated_ticks) = (kept.excess, kept.speed_drop, kept.saturated_ticks);
            state.gravity
        } else {
            state.max_current_excess = zero;
            match HAS_TILTING_AXIS {
                true => loops
                    .plant
                    .gravity_torque_with_expansion(&mut gravity_expansion, state.load_angle::<IS_EXTENDED>()),
                false => loops.plant.weight_torque(),
            }
        };
        let mut external = inputs.load - gravity;
        for velocity_cycle in 0..ticks.velocity_cycles() {
            let (mut first, mut end) =
                (velocity_cycle * ticks.velocity, (velocity_cycle + 1) * ticks.velocity);
            let is_begun = IS_PART && first < span.first;
            if IS_PART {
                (first, end) = (first.max(span.first), end.min(span.end));
                if first >= end {
                    continue;
                }
            }
            if !is_begun {
                let compensation = match self.compensation.get(velocity_cycle) {
                    Some(row) => N::load(simd, &row.0, index),
                    None => zero,
                };
                let has_filters = IS_EXTENDED && self.has_filters;
                let cycle = velocity_cycle as f64;
                excess = loops.control_velocity(&inputs, &mut state, cycle, compensation, has_filters);
            }
            for tick in first..end {
                let (law, speed) = (&loops.plant.friction_speed_drop, state.motor.speed);
                let max_speed_drop = match IS_EXTENDED && self.has_stribeck_terms {
                    true => law.bound_with_stribeck_terms(&mut friction_expansion, speed),
                    false => law.bound_with_expansion(&mut friction_expansion, speed),
                };
                self.motors[tick].0.store(index, &state.motor);
                if IS_EXTENDED && self.has_elastic_axis {
                    self.loads[tick].0.store(index, &state.load);
                }
                if tick > 0 && (record_all || HAS_TILTING_AXIS) {
                    state.friction = loops.plant.torque_from_speed_drop(speed_drop);
                    state.gravity = gravity;
                    if HAS_TILTING_AXIS {
                        let angle = state.load_angle::<IS_EXTENDED>();
                        gravity = loops.plant.gravity_torque_with_expansion(&mut gravity_expansion, angle);
                        external = inputs.load - gravity;
                    }
                }
                let (voltage, saturated) = loops.control_current(&mut state, excess);
                saturated_ticks = (saturated_ticks + one).select(saturated, saturated_ticks);
                let (motor, load) = (&mut state.motor, &mut state.load);
                let torques = [voltage, external, max_speed_drop];
                speed_drop = if IS_EXTENDED {
                    let deflection = self.has_presliding.then_some(&mut state.deflection);
                    let elements = &mut self.elements;
                    let memory = |inputs: [N; 2], bristles: (N, N)| match elements.is_present {
                        true => elements.step(simd, index, speed, inputs, bristles),
                        false => bristles,
                    };
                    match self.has_elastic_axis {
                        true => {
                            let speed_drop =
                                loops.plant.step_elastic(motor, load, deflection, torques, memory);
                            match self.has_event_driven_axis {
                                true => {
                                    self.step_event_driven(simd, index, tick, &mut state, torques, speed_drop)
                                }
                                false => speed_drop,
                            }
                        }
                        false => loops.plant.step_rigid(motor, deflection, torques, memory),
                    }
                } else {
                    loops.plant.step_with_torques(motor, voltage, external, max_speed_drop)
                };
                if record_all || tick == 0 {
                    let InnerLoopState { current_setpoint, friction, gravity, .. } = state;
                    let saturated = one.select(saturated, zero);
                    let record = TickRecord { current_setpoint, voltage, friction, gravity, saturated };
                    self.records[tick].0.store(index, &record);
                }
            }
        }
        state.friction = loops.plant.torque_from_speed_drop(speed_drop);
        state.gravity = gravity;
        self.friction_expansion.0.store(index, &friction_expansion);
        if HAS_TILTING_AXIS {
            self.gravity_expansion.0.store(index, &gravity_expansion);
        }
        self.state.0.store(index, &state);
        if IS_PART {
            self.span_state.0.store(index, &SpanState { excess, speed_drop, saturated_ticks });
        }
        // A loop of its own: the loop above uses all registers.
        let mut statistics = CycleStatistics { peak_current: zero, peak_speed: zero, saturated_ticks };
        let rows = if IS_PART { &self.motors[..span.end] } else { &self.motors };
        for row in rows {
            let motor: MotorState<N> = row.0.load(simd, index);
            statistics.peak_current = motor.current.abs().max(statistics.peak_current);
            statistics.peak_speed = motor.speed.abs().max(statistics.peak_speed);
        }
        self.statistics.0.store(index, &statistics);
    }
}

impl AxisBlock {
    /// Replaces the step of the axes with an event-driven transmission in `state` and in the speed drops by friction; each is
    /// stepped by itself.
    #[inline(always)]
    fn step_event_driven<S: Simd, N: SimdLoad<S>>(
        &self,
        simd: S,
        index: usize,
        tick: usize,
        state: &mut InnerLoopState<N>,
        [voltage, external, _]: [N; 3],
        speed_drop: N,
    ) -> N {
        let InnerLoopState { motor, load, contact, .. } = *state;
        let mut rows: Aligned<EventDrivenStep<[f64; LANES]>> = Aligned(EventDrivenStep::default().fill());
        let vector = EventDrivenStep { motor, load, contact, speed_drop, voltage, external };
        rows.0.store(index, &vector);
        for lane in index * N::LANES..(index + 1) * N::LANES {
            if let Some(transmission) = &self.event_driven[lane] {
                let mut step = rows.0.lane(lane);
                (step.motor, step.load) = (self.motors[tick].0.lane(lane), self.loads[tick].0.lane(lane));
                let EventDrivenStep { motor, load, contact, voltage, external, .. } = &mut step;
                let torque = transmission.step(motor, load, contact, *voltage, *external);
                step.speed_drop = transmission.speed_drop_from_torque(torque);
                rows.0.set_lane(lane, &step);
            }
        }
        let step: EventDrivenStep<N> = rows.0.load(simd, index);
        (state.motor, state.load, state.contact) = (step.motor, step.load, step.contact);
        step.speed_drop
    }
}

impl<N: SimdReal> InnerLoopState<N> {
    /// Returns the angle of the load, rad of the motor.
    #[inline(always)]
    fn load_angle<const IS_EXTENDED: bool>(&self) -> N {
        if IS_EXTENDED { self.motor.angle - self.load.wind_up } else { self.motor.angle }
    }
}

impl<N: SimdReal> InnerLoops<N> {
    /// Executes the velocity loop: sets i* and returns the amounts by which the speed and current setpoints exceeded
    /// their limits, added up.
    #[inline(always)]
    fn control_velocity(
        &self,
        inputs: &InnerLoopInputs<N>,
        state: &mut InnerLoopState<N>,
        velocity_cycle: f64,
        compensation: N,
        has_filters: bool,
    ) -> N {
        let setpoint = inputs.velocity_setpoint + inputs.velocity.at(velocity_cycle);
        let torque = inputs.torque.at(velocity_cycle) + compensation;
        let error = setpoint - state.motor.speed;
        let InnerLoopState { velocity, filters, .. } = state;
        state.current_setpoint = match has_filters {
            true => self.velocity.update_with_filter(velocity, error, torque, |setpoint| {
                self.filters.update(filters, setpoint)
            }),
            false => self.velocity.update_with_feedforward(velocity, error, torque),
        };
        let excess = state.velocity.excess.abs();
        state.max_current_excess = excess.max(state.max_current_excess);
        excess + inputs.velocity_excess.abs()
    }

    /// Executes the current loop: returns the voltage, and a mask that is set where a setpoint is at its limit.
    /// `excess` is the amount by which the setpoints of the outer loops exceeded their limits.
    #[inline(always)]
    fn control_current(&self, state: &mut InnerLoopState<N>, excess: N) -> (N, N::Mask) {
        let error = state.current_setpoint - state.motor.current;
        let voltage = self.current.update(&mut state.current, error);
        let zero = excess.splat(0.0);
        (voltage, zero.simd_lt(excess + state.current.excess.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Aligns the frame behind `depth` calls with a local of one byte each.
    fn aligned_behind(depth: usize) -> usize {
        let local = black_box(depth as u8);
        if local == 0 { align_stack_frame() } else { aligned_behind(depth - 1) }
    }

    #[test]
    fn stack_frames_are_aligned_to_a_cache_line() {
        for depth in 0..100 {
            assert_eq!(aligned_behind(depth) % 64, 0, "depth {depth}");
        }
    }

    #[test]
    fn zero_order_hold_switches_at_its_velocity_cycle() {
        let input = ZeroOrderHold { before: 1.0, after: 2.0, step: 3.0 };
        assert_eq!(
            [0.0, 2.0, 3.0, 23.0].map(|velocity_cycle| input.at(velocity_cycle)),
            [1.0, 1.0, 2.0, 2.0]
        );
    }
}
