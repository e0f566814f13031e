//! The lanes of a machine: as many blocks as its axes fill.

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::block::{Block, Demand, Done, Loops, LoopsState, Row, Timing};
use crate::drive::MotorState;
use crate::lanes::Lane;

/// Lanes of a block: one vector of most processors.
const LANES: usize = 4;
/// Blocks that go through the ticks together: while one waits for itself, the other is worked on.
const TOGETHER: usize = 2;

/// How wide the processor's vectors are used. The results are the same bits whatever the width.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Width {
    /// As wide as this processor has them.
    #[default]
    Widest,
    /// As every processor of its kind has them. Where multiplication and addition are not fused by the
    /// hardware this is some ten times slower.
    Baseline,
}

/// Inner loops and plants of any number of axes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bank {
    blocks: Vec<Block<LANES>>,
    timing: Timing,
    width: Width,
}

impl Bank {
    /// A bank of the axes `loops`.
    pub fn new(loops: &[Loops], timing: Timing) -> Self {
        let block = |axes: &[Loops]| {
            // Lanes that stand for no axis do as the first one does.
            let mut block = Block::new(axes[0], timing);
            for (lane, loops) in axes.iter().enumerate() {
                block.set_loops(lane, *loops);
            }
            block
        };
        Bank { blocks: loops.chunks(LANES).map(block).collect(), timing, width: Width::default() }
    }

    /// How wide vectors are used from now on.
    pub fn set_width(&mut self, width: Width) {
        self.width = width;
    }

    /// The block and the lane of an axis.
    #[inline]
    fn of(&self, axis: usize) -> (&Block<LANES>, usize) {
        (&self.blocks[axis / LANES], axis % LANES)
    }

    /// Likewise, to change it.
    #[inline]
    fn of_mut(&mut self, axis: usize) -> (&mut Block<LANES>, usize) {
        (&mut self.blocks[axis / LANES], axis % LANES)
    }

    /// Gives an axis other parameters.
    pub fn set_loops(&mut self, axis: usize, loops: Loops) {
        let (block, lane) = self.of_mut(axis);
        block.set_loops(lane, loops);
    }

    /// Where an axis is.
    pub fn state(&self, axis: usize) -> LoopsState {
        let (block, lane) = self.of(axis);
        LoopsState::get(&block.state, lane)
    }

    /// Puts an axis there.
    pub fn set_state(&mut self, axis: usize, state: &LoopsState) {
        let (block, lane) = self.of_mut(axis);
        state.set(&mut block.state, lane);
    }

    /// What is asked of an axis in the next position period; its friction is not compensated.
    pub fn set_demand(&mut self, axis: usize, demand: &Demand) {
        let (block, lane) = self.of_mut(axis);
        demand.set(&mut block.demand, lane);
    }

    /// The torque with which friction of an axis is compensated, N·m, by the instant of the velocity loop.
    pub fn set_compensation(&mut self, axis: usize, torque: impl Fn(usize) -> f64) {
        let (block, lane) = self.of_mut(axis);
        block.set_compensation(lane, torque);
    }

    /// The motor of an axis at a tick of the last position period.
    #[inline]
    pub fn motor(&self, axis: usize, tick: usize) -> MotorState {
        let (block, lane) = self.of(axis);
        MotorState::get(&block.seen[tick].0, lane)
    }

    /// Motor angles of an axis at all ticks of the last position period, rad.
    pub fn angles(&self, axis: usize) -> impl Iterator<Item = f64> {
        let (block, lane) = self.of(axis);
        block.seen.iter().map(move |row| row.0.angle[lane])
    }

    /// What the controllers of an axis made of it.
    pub fn done(&self, axis: usize, tick: usize) -> Done {
        let (block, lane) = self.of(axis);
        Done::get(&block.done[tick].0, lane)
    }

    /// Largest |i| (A) and |ω| (rad/s) of an axis in the last position period.
    pub fn peaks(&self, axis: usize) -> (f64, f64) {
        let (block, lane) = self.of(axis);
        (block.peak_current[lane], block.peak_speed[lane])
    }

    /// Runs a position period; `traced` keeps what the controllers did at every tick, not only at the first.
    pub fn run(&mut self, traced: bool) {
        let Bank { blocks, timing, width } = self;
        if traced {
            for block in blocks.iter_mut() {
                block.done.resize(timing.ticks_per_position, Row(Done::default().fill()));
            }
        }
        let period = Period { blocks, timing: *timing, traced };
        match width {
            Width::Widest => Arch::new().dispatch(period),
            Width::Baseline => Scalar::new().vectorize(period),
        }
    }
}

/// A position period to be run.
struct Period<'a> {
    blocks: &'a mut [Block<LANES>],
    timing: Timing,
    traced: bool,
}

impl WithSimd for Period<'_> {
    type Output = ();

    /// Compiled once for each width: what is inlined here is made of the vectors that it has.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for blocks in self.blocks.chunks_mut(TOGETHER) {
            if self.traced {
                run::<true>(blocks, self.timing);
            } else {
                run::<false>(blocks, self.timing);
            }
        }
    }
}

/// Runs some blocks through a position period, tick by tick.
#[inline(always)]
fn run<const TRACED: bool>(blocks: &mut [Block<LANES>], timing: Timing) {
    for block in &mut *blocks {
        block.begin();
    }
    for instant in 0..timing.instants() {
        for block in &mut *blocks {
            block.control_velocity(instant);
        }
        let first = instant * timing.ticks_per_velocity;
        for tick in first..first + timing.ticks_per_velocity {
            for block in &mut *blocks {
                if TRACED || tick == 0 {
                    block.tick::<true>(tick);
                } else {
                    block.tick::<false>(tick);
                }
            }
        }
    }
    for block in blocks {
        block.find_peaks();
    }
}
