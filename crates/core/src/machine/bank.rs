//! SIMD blocks that hold the inner loops of all axes of a machine; selection of block size and SIMD width.

use std::sync::Arc;

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::axis::DriveState;
use super::inner_loops::{
    Aligned, AxisBlock, CycleStatistics, CycleTicks, DriveFeedback, InnerLoopInputs, InnerLoopState,
    InnerLoops, TickRecord, TickSpan,
};
use crate::drive::{EventDrivenTransmission, LoadState, MaxwellSlip};
use crate::simd::LANES;
use crate::state_codec::StateCodec;

/// Lanes of the small block, used for up to four axes if the widest vector of the processor has at most four lanes:
/// there one axis takes 37 % less time in it than in the large block (docs/internals/performance.md, block sizes).
const X4: usize = 4;
/// Lanes of the large block: one vector of eight lanes, or two interleaved vectors of four lanes ([`Unroll2`]), so that
/// the latencies of one overlap with the operations of the other. On vectors of four lanes this saves 10 to 17 %.
///
/// [`Unroll2`]: crate::simd::Unroll2
const X8: usize = 8;

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
    blocks: AxisBlocks,
    ticks: CycleTicks,
    width: SimdWidth,
}

/// Blocks of equal size, in the order of the axes.
#[derive(Debug, Clone, PartialEq)]
enum AxisBlocks {
    X4(Vec<AxisBlock<X4>>),
    X8(Vec<AxisBlock<X8>>),
}

/// Evaluates `$body` with the block and the lane of an axis, for any block size.
macro_rules! with_lane {
    ($blocks:expr, $axis:expr, $find:ident, |$block:ident, $lane:ident| $body:expr) => {
        match $blocks {
            AxisBlocks::X4(blocks) => {
                let ($block, $lane) = $find(blocks, $axis);
                $body
            }
            AxisBlocks::X8(blocks) => {
                let ($block, $lane) = $find(blocks, $axis);
                $body
            }
        }
    };
}

fn block_and_lane<const L: usize>(blocks: &[AxisBlock<L>], axis: usize) -> (&AxisBlock<L>, usize) {
    (&blocks[axis / L], axis % L)
}

fn block_and_lane_mut<const L: usize>(
    blocks: &mut [AxisBlock<L>],
    axis: usize,
) -> (&mut AxisBlock<L>, usize) {
    (&mut blocks[axis / L], axis % L)
}

/// Creates the blocks for the axes `loops`; unused lanes repeat the first axis of their block.
fn create_blocks<const L: usize>(loops: &[InnerLoops], ticks: CycleTicks) -> Vec<AxisBlock<L>> {
    let block = |axes: &[InnerLoops]| {
        let mut block = AxisBlock::new(&axes[0], ticks);
        for (lane, loops) in axes.iter().enumerate() {
            block.set_loops(lane, loops);
        }
        block
    };
    loops.chunks(L).map(block).collect()
}

impl AxisBank {
    /// Creates a bank of the axes `loops`; their number and the SIMD width of the processor select the block size.
    pub fn new(loops: &[InnerLoops], ticks: CycleTicks) -> Self {
        let blocks = match loops.len() {
            ..=X4 if Arch::new().dispatch(LaneCount) <= X4 => AxisBlocks::X4(create_blocks(loops, ticks)),
            _ => AxisBlocks::X8(create_blocks(loops, ticks)),
        };
        AxisBank { blocks, ticks, width: SimdWidth::default() }
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
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| block.set_loops(lane, loops));
    }

    /// Sets the event-driven transmission of an axis.
    pub fn set_event_driven(&mut self, axis: usize, transmission: Option<Arc<EventDrivenTransmission>>) {
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| {
            block.set_event_driven(lane, transmission);
        });
    }

    /// Sets the elements of the friction of an axis.
    pub fn set_elements(&mut self, axis: usize, elements: Option<Arc<MaxwellSlip>>) {
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| {
            block.set_elements(lane, elements);
        });
    }

    /// Sets the forces of the elements of the friction of an axis to 0.
    pub fn reset_elements(&mut self, axis: usize) {
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| block.reset_elements(lane));
    }

    /// Returns the state of an axis.
    pub fn state(&self, axis: usize) -> InnerLoopState {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| block.state(lane))
    }

    /// Returns the part of the state of an axis that its position loop reads.
    pub fn feedback(&self, axis: usize) -> DriveFeedback {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| block.feedback(lane))
    }

    /// Sets the state of an axis.
    pub fn set_state(&mut self, axis: usize, state: &InnerLoopState) {
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| block.set_state(lane, state));
    }

    /// Sets the inputs of an axis for the next position cycle.
    pub fn set_inputs(&mut self, axis: usize, inputs: &InnerLoopInputs) {
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| block.set_inputs(lane, inputs));
    }

    /// Sets the friction compensation of an axis; `torque` returns N·m at the motor for each velocity cycle.
    pub fn set_compensation(&mut self, axis: usize, torque: impl Fn(usize) -> f64) {
        let ticks = self.ticks;
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| {
            block.set_compensation(lane, ticks, torque);
        });
    }

    /// Returns the state of motor and load of an axis at the start of a tick of the last position cycle.
    #[inline]
    pub fn drive(&self, axis: usize, tick: usize) -> DriveState {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| {
            let load = block.loads.get(tick).map_or(LoadState::default(), |row| row.0.lane(lane));
            (block.motors[tick].0.lane(lane), load)
        })
    }

    /// Returns the current of an axis at the start of a tick of the last position cycle, A.
    #[inline]
    pub fn current(&self, axis: usize, tick: usize) -> f64 {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| block.motors[tick].0.current[lane])
    }

    /// Writes the angles of the load of an axis at the ticks of the last position cycle, times `ratio`, to `positions`.
    pub fn positions(&self, axis: usize, ratio: f64, positions: &mut [f64]) {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| {
            let count = positions.len().min(block.motors.len());
            let (groups, rest) = positions[..count].as_chunks_mut::<LANES>();
            let (rows, last_rows) = block.motors[..count].as_chunks::<LANES>();
            for (group, rows) in groups.iter_mut().zip(rows) {
                *group = std::array::from_fn(|tick| rows[tick].0.angle[lane] * ratio);
            }
            for (position, row) in rest.iter_mut().zip(last_rows) {
                *position = row.0.angle[lane] * ratio;
            }
            for ((position, motor), load) in positions.iter_mut().zip(&block.motors).zip(&block.loads) {
                *position = (motor.0.angle[lane] - load.0.wind_up[lane]) * ratio;
            }
        });
    }

    /// Returns the record of an axis at a tick of the last position cycle, or at the last tick that was recorded.
    pub fn record(&self, axis: usize, tick: usize) -> TickRecord {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| {
            block.records[tick.min(block.records.len() - 1)].0.lane(lane)
        })
    }

    /// Returns the statistics of an axis over the last position cycle.
    #[inline]
    pub fn statistics(&self, axis: usize) -> CycleStatistics {
        with_lane!(&self.blocks, axis, block_and_lane, |block, lane| block.statistics.0.lane(lane))
    }

    /// Writes or replaces the state of an axis.
    pub fn code(&mut self, axis: usize, codec: &mut StateCodec<'_>) {
        let ticks = self.ticks;
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| block.code(lane, ticks, codec));
    }

    /// Runs ticks of a position cycle; spans of one cycle follow each other.
    pub fn run_span(&mut self, span: TickSpan) {
        let ticks = self.ticks;
        match &mut self.blocks {
            AxisBlocks::X4(blocks) => run_blocks(self.width, BlockRun { blocks, ticks, span }),
            AxisBlocks::X8(blocks) => run_blocks(self.width, BlockRun { blocks, ticks, span }),
        }
    }

    /// Stores the state of all axes at the start of a tick that can be repeated.
    pub fn store_start(&mut self) {
        match &mut self.blocks {
            AxisBlocks::X4(blocks) => blocks.iter_mut().for_each(AxisBlock::store_start),
            AxisBlocks::X8(blocks) => blocks.iter_mut().for_each(AxisBlock::store_start),
        }
    }

    /// Restores the state of all axes at the start of the tick.
    pub fn restore_start(&mut self) {
        match &mut self.blocks {
            AxisBlocks::X4(blocks) => blocks.iter_mut().for_each(AxisBlock::restore_start),
            AxisBlocks::X8(blocks) => blocks.iter_mut().for_each(AxisBlock::restore_start),
        }
    }

    /// Discards the stored state, at the end of the tick.
    pub fn discard_start(&mut self) {
        match &mut self.blocks {
            AxisBlocks::X4(blocks) => blocks.iter_mut().for_each(AxisBlock::discard_start),
            AxisBlocks::X8(blocks) => blocks.iter_mut().for_each(AxisBlock::discard_start),
        }
    }

    /// Sets the load torque of an axis for the rest of the position cycle, N·m at the motor.
    pub fn set_load_torque(&mut self, axis: usize, torque: f64) {
        with_lane!(&mut self.blocks, axis, block_and_lane_mut, |block, lane| block
            .set_load_torque(lane, torque));
    }
}

/// Runs ticks of a position cycle with the selected SIMD width.
fn run_blocks<const L: usize>(width: SimdWidth, run: BlockRun<'_, L>) {
    if run.span.record_all {
        let record = || Aligned(TickRecord::default().fill());
        run.blocks.iter_mut().for_each(|block| block.records.resize_with(run.ticks.position, record));
    }
    match width {
        SimdWidth::Widest if L > X4 => Arch::new().dispatch(run),
        SimdWidth::Widest | SimdWidth::Four => dispatch_up_to_four_lanes(run),
        SimdWidth::Baseline => Scalar::new().vectorize(run),
    }
}

/// Operation that returns the number of lanes of a SIMD vector.
struct LaneCount;

impl WithSimd for LaneCount {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
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
struct BlockRun<'a, const L: usize> {
    blocks: &'a mut [AxisBlock<L>],
    ticks: CycleTicks,
    span: TickSpan,
}

impl<const L: usize> WithSimd for BlockRun<'_, L> {
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
    fn results_are_bit_identical_for_every_block_size_and_simd_width() {
        let config = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        for first in 0..5 {
            let indices = Vec::from_iter(first..5);
            let parameters = MachineParameters::from_axes(&config, &indices).expect("can be discretized");
            let loops: Vec<InnerLoops> = parameters.axes.iter().map(|axis| axis.loops).collect();
            let ticks = parameters.cycle_ticks();
            let mut machine = Machine::new(Arc::new(parameters));
            let wanted = bits_of_run(&mut machine);
            let sizes =
                [AxisBlocks::X4(create_blocks(&loops, ticks)), AxisBlocks::X8(create_blocks(&loops, ticks))];
            for (size, blocks) in sizes.into_iter().enumerate() {
                machine.bank.blocks = blocks;
                for width in [SimdWidth::Widest, SimdWidth::Four, SimdWidth::Baseline] {
                    machine.set_simd_width(width);
                    assert!(
                        bits_of_run(&mut machine) == wanted,
                        "axes from {first} on, size {size}, {width:?}"
                    );
                }
            }
        }
    }
}
