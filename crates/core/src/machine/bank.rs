//! SIMD blocks that hold the inner loops of all axes of a machine; selection of the SIMD width.

use std::sync::Arc;

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::inner_loops::{
    AxisBlock, CycleStatistics, CycleTicks, DriveFeedback, DriveState, InnerLoopInputs, InnerLoopState,
    InnerLoops, TickRecord, TickSpan,
};
use crate::drive::{EventDrivenTransmission, LoadState, MaxwellSlip, MotorState};
use crate::simd::{Aligned, LANES};
use crate::state_codec::StateCodec;

/// SIMD width that the inner loops run with. The results are bit-identical for every width.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SimdWidth {
    /// Widest vectors that the processor supports, detected at run time.
    #[default]
    Widest,
    /// Widest vectors that the processor supports, with at most four lanes.
    Four,
    /// Instruction set that every processor of the architecture supports. Without hardware fused multiply-add this
    /// is much slower.
    Baseline,
}

/// Inner loops and plants of all axes of a machine in SIMD blocks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisBank {
    /// Blocks in the order of the axes.
    blocks: Vec<AxisBlock>,
    ticks: CycleTicks,
    width: SimdWidth,
}

impl AxisBank {
    /// Creates a bank of the axes `loops`.
    pub fn new(loops: &[InnerLoops], ticks: CycleTicks) -> Self {
        let blocks = loops.chunks(LANES).map(|axes| AxisBlock::new(axes, ticks)).collect();
        AxisBank { blocks, ticks, width: SimdWidth::default() }
    }

    /// Returns the block and the lane of an axis.
    fn block(&self, axis: usize) -> (&AxisBlock, usize) {
        (&self.blocks[axis / LANES], axis % LANES)
    }

    /// Returns the block and the lane of an axis.
    fn block_mut(&mut self, axis: usize) -> (&mut AxisBlock, usize) {
        (&mut self.blocks[axis / LANES], axis % LANES)
    }

    /// Returns the ticks of the control loops.
    pub fn ticks(&self) -> CycleTicks {
        self.ticks
    }

    /// Sets the SIMD width of the following position cycles.
    pub fn set_simd_width(&mut self, width: SimdWidth) {
        self.width = width;
    }

    /// Sets the parameters of an axis.
    pub fn set_loops(&mut self, axis: usize, loops: &InnerLoops) {
        let (block, lane) = self.block_mut(axis);
        block.set_loops(lane, loops);
    }

    /// Sets the event-driven transmission of an axis.
    pub fn set_event_driven(&mut self, axis: usize, transmission: Option<Arc<EventDrivenTransmission>>) {
        let (block, lane) = self.block_mut(axis);
        block.set_event_driven(lane, transmission);
    }

    /// Sets the elements of the friction of an axis.
    pub fn set_elements(&mut self, axis: usize, elements: Option<Arc<MaxwellSlip>>) {
        let (block, lane) = self.block_mut(axis);
        block.set_elements(lane, elements);
    }

    /// Sets the forces of the elements of the friction of an axis to 0.
    pub fn reset_elements(&mut self, axis: usize) {
        let (block, lane) = self.block_mut(axis);
        block.reset_elements(lane);
    }

    /// Returns the state of an axis.
    pub fn state(&self, axis: usize) -> InnerLoopState {
        let (block, lane) = self.block(axis);
        block.state(lane)
    }

    /// Returns the part of the state of an axis that its position loop reads.
    pub fn feedback(&self, axis: usize) -> DriveFeedback {
        let (block, lane) = self.block(axis);
        block.feedback(lane)
    }

    /// Sets the state of an axis.
    pub fn set_state(&mut self, axis: usize, state: &InnerLoopState) {
        let (block, lane) = self.block_mut(axis);
        block.set_state(lane, state);
    }

    /// Sets the inputs of an axis for the next position cycle.
    pub fn set_inputs(&mut self, axis: usize, inputs: &InnerLoopInputs) {
        let (block, lane) = self.block_mut(axis);
        block.set_inputs(lane, inputs);
    }

    /// Sets the friction compensation of an axis; `torque` returns N·m at the motor for each velocity cycle.
    pub fn set_compensation(&mut self, axis: usize, torque: impl Fn(usize) -> f64) {
        let ticks = self.ticks;
        let (block, lane) = self.block_mut(axis);
        block.set_compensation(lane, ticks, torque);
    }

    /// Returns the state of motor and load of an axis at the start of a tick of the last position cycle.
    #[inline]
    pub fn drive(&self, axis: usize, tick: usize) -> DriveState {
        let (block, lane) = self.block(axis);
        let load = block.loads.get(tick).map_or(LoadState::default(), |row| row.0.lane(lane));
        (block.motors[tick].0.lane(lane), load)
    }

    /// Returns the state of the motor of an axis at the start of a tick of the last position cycle.
    #[inline]
    pub fn motor(&self, axis: usize, tick: usize) -> MotorState {
        let (block, lane) = self.block(axis);
        block.motors[tick].0.lane(lane)
    }

    /// Returns the current of an axis at the start of a tick of the last position cycle, A.
    #[inline]
    pub fn current(&self, axis: usize, tick: usize) -> f64 {
        let (block, lane) = self.block(axis);
        block.motors[tick].0.current[lane]
    }

    /// Writes the angles of the load of an axis at the ticks of the last position cycle, times `ratio`, to `positions`.
    pub fn positions(&self, axis: usize, ratio: f64, positions: &mut [f64]) {
        let (block, lane) = self.block(axis);
        for (position, motor) in positions.iter_mut().zip(&block.motors) {
            *position = motor.0.angle[lane] * ratio;
        }
        for ((position, motor), load) in positions.iter_mut().zip(&block.motors).zip(&block.loads) {
            *position = (motor.0.angle[lane] - load.0.wind_up[lane]) * ratio;
        }
    }

    /// Returns the record of an axis at a tick of the last position cycle, or at the last tick that was recorded.
    pub fn record(&self, axis: usize, tick: usize) -> TickRecord {
        let (block, lane) = self.block(axis);
        block.records[tick.min(block.records.len() - 1)].0.lane(lane)
    }

    /// Returns the statistics of an axis over the last position cycle.
    #[inline]
    pub fn statistics(&self, axis: usize) -> CycleStatistics {
        let (block, lane) = self.block(axis);
        block.statistics.0.lane(lane)
    }

    /// Writes or replaces the state of an axis.
    pub fn code(&mut self, axis: usize, codec: &mut StateCodec<'_>) {
        let ticks = self.ticks;
        let (block, lane) = self.block_mut(axis);
        block.code(lane, ticks, codec);
    }

    /// Runs ticks of a position cycle; spans of one cycle follow each other.
    pub fn run_span(&mut self, span: TickSpan) {
        let ticks = self.ticks;
        if span.record_all {
            let record = || Aligned(TickRecord::default().fill());
            self.blocks.iter_mut().for_each(|block| block.records.resize_with(ticks.position, record));
        }
        let run = BlockRun { blocks: &mut self.blocks, ticks, span };
        match self.width {
            SimdWidth::Widest => Arch::new().dispatch(run),
            SimdWidth::Four => dispatch_up_to_four_lanes(run),
            SimdWidth::Baseline => Scalar::new().vectorize(run),
        }
    }

    /// Stores the state of all axes at the start of a tick that can be repeated.
    pub fn store_start(&mut self) {
        self.blocks.iter_mut().for_each(AxisBlock::store_start);
    }

    /// Restores the state of all axes at the start of the tick.
    pub fn restore_start(&mut self) {
        self.blocks.iter_mut().for_each(AxisBlock::restore_start);
    }

    /// Discards the stored state, at the end of the tick.
    pub fn discard_start(&mut self) {
        self.blocks.iter_mut().for_each(AxisBlock::discard_start);
    }

    /// Sets the load torque of an axis for the rest of the position cycle, N·m at the motor.
    pub fn set_load_torque(&mut self, axis: usize, torque: f64) {
        let (block, lane) = self.block_mut(axis);
        block.set_load_torque(lane, torque);
    }
}

/// Runs `operation` with the widest vectors of the processor that have at most four lanes.
fn dispatch_up_to_four_lanes<A: WithSimd>(operation: A) -> A::Output {
    match Arch::new() {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Arch::V4(eight) => Simd::vectorize(*eight, operation),
        arch => arch.dispatch(operation),
    }
}

/// Operation that runs ticks of a position cycle of blocks.
struct BlockRun<'a> {
    blocks: &'a mut [AxisBlock],
    ticks: CycleTicks,
    span: TickSpan,
}

impl WithSimd for BlockRun<'_> {
    type Output = ();

    /// Runs the blocks; compiled once per SIMD width, with everything inlined.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for block in self.blocks {
            block.run(simd, self.ticks, self.span);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::config::Parameters;
    use crate::machine::{Machine, MachineParameters};

    /// Returns the bits of positions and statistics of all ticks, over motions that differ by axis.
    fn bits_of_run(machine: &mut Machine) -> Vec<u64> {
        let axes = machine.axis_count();
        machine.reset(&vec![0.1; axes]);
        let mut bits = Vec::new();
        for k in 0..100 {
            let psec = |axis: usize| 0.1 + 0.02 * (1.0 - (0.05 * (1 + axis) as f64 * f64::from(k)).cos());
            machine.advance(&Vec::from_iter((0..axes).map(psec)), &[]);
            for axis in 0..axes {
                bits.extend(
                    (0..machine.ticks_per_period()).map(|tick| machine.position(axis, tick).to_bits()),
                );
                let activity = machine.activity(axis);
                bits.extend([activity.peak_current.to_bits(), activity.saturated_ticks]);
            }
        }
        bits
    }

    #[test]
    fn results_are_bit_identical_for_every_number_of_axes_and_simd_width() {
        let config = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        for first in 0..5 {
            let indices = Vec::from_iter(first..5);
            let parameters = MachineParameters::from_axes(&config, &indices).expect("can be discretized");
            let mut machine = Machine::new(Arc::new(parameters));
            let wanted = bits_of_run(&mut machine);
            for width in [SimdWidth::Widest, SimdWidth::Four, SimdWidth::Baseline] {
                machine.set_simd_width(width);
                assert!(bits_of_run(&mut machine) == wanted, "axes from {first} on, {width:?}");
            }
        }
    }
}
