//! The lanes of a machine: as many blocks as its axes fill.

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::block::{Block, Demand, Done, Loops, LoopsState, Row, Tally, Timing};
use crate::drive::MotorState;

/// Lanes of a block of few axes, where the processor has no vector of more: one of four, or less.
const FEW: usize = 4;
/// Lanes of a block of some: a vector of eight, or two of four of which one is worked on while the other waits for
/// itself.
const SOME: usize = 8;
/// Lanes of a block of many: two vectors of eight.
const MANY: usize = 16;

/// How wide the processor's vectors are used. The results are the same bits whatever the width.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Width {
    /// As wide as this processor has them.
    #[default]
    Widest,
    /// As wide as this processor has them, but four numbers at most.
    Four,
    /// As every processor of its kind has them. Where multiplication and addition are not fused by the
    /// hardware this is far slower.
    Baseline,
}

/// Inner loops and plants of any number of axes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bank {
    blocks: Blocks,
    timing: Timing,
    width: Width,
}

/// Blocks of one size, in the order of the axes.
#[derive(Debug, Clone, PartialEq)]
enum Blocks {
    Few(Vec<Block<FEW>>),
    Some(Vec<Block<SOME>>),
    Many(Vec<Block<MANY>>),
}

/// `$act` on the block and the lane of an axis, whatever the size of the blocks.
macro_rules! at {
    ($blocks:expr, $axis:expr, $iter:ident, |$block:ident, $lane:ident| $act:expr) => {
        match $blocks {
            Blocks::Few(blocks) => {
                let ($block, $lane) = $iter(blocks, $axis);
                $act
            }
            Blocks::Some(blocks) => {
                let ($block, $lane) = $iter(blocks, $axis);
                $act
            }
            Blocks::Many(blocks) => {
                let ($block, $lane) = $iter(blocks, $axis);
                $act
            }
        }
    };
}

fn of<const L: usize>(blocks: &[Block<L>], axis: usize) -> (&Block<L>, usize) {
    (&blocks[axis / L], axis % L)
}

fn of_mut<const L: usize>(blocks: &mut [Block<L>], axis: usize) -> (&mut Block<L>, usize) {
    (&mut blocks[axis / L], axis % L)
}

/// Blocks of the axes `loops`; lanes that stand for no axis do as the first one of their block does.
fn filled<const L: usize>(loops: &[Loops], timing: Timing) -> Vec<Block<L>> {
    let block = |axes: &[Loops]| {
        let mut block = Block::new(&axes[0], timing);
        for (lane, loops) in axes.iter().enumerate() {
            block.set_loops(lane, loops);
        }
        block
    };
    loops.chunks(L).map(block).collect()
}

impl Bank {
    /// A bank of the axes `loops`.
    pub fn new(loops: &[Loops], timing: Timing) -> Self {
        let blocks = match loops.len() {
            ..=FEW if Arch::new().dispatch(Lanes) <= FEW => Blocks::Few(filled(loops, timing)),
            ..=SOME => Blocks::Some(filled(loops, timing)),
            _ => Blocks::Many(filled(loops, timing)),
        };
        Bank { blocks, timing, width: Width::default() }
    }

    /// How wide vectors are used from now on.
    pub fn set_width(&mut self, width: Width) {
        self.width = width;
    }

    /// Gives an axis other parameters.
    pub fn set_loops(&mut self, axis: usize, loops: &Loops) {
        at!(&mut self.blocks, axis, of_mut, |block, lane| block.set_loops(lane, loops));
    }

    /// Where an axis is.
    pub fn state(&self, axis: usize) -> LoopsState {
        at!(&self.blocks, axis, of, |block, lane| block.state(lane))
    }

    /// Puts an axis there.
    pub fn set_state(&mut self, axis: usize, state: &LoopsState) {
        at!(&mut self.blocks, axis, of_mut, |block, lane| block.set_state(lane, state));
    }

    /// What is asked of an axis in the next position period.
    pub fn set_demand(&mut self, axis: usize, demand: &Demand) {
        at!(&mut self.blocks, axis, of_mut, |block, lane| block.set_demand(lane, demand));
    }

    /// The torque with which friction of an axis is compensated, N·m, by the instant of the velocity loop.
    pub fn set_compensation(&mut self, axis: usize, torque: impl Fn(usize) -> f64) {
        let timing = self.timing;
        at!(&mut self.blocks, axis, of_mut, |block, lane| block.set_compensation(lane, timing, torque));
    }

    /// The motor of an axis at a tick of the last position period.
    #[inline]
    pub fn motor(&self, axis: usize, tick: usize) -> MotorState {
        at!(&self.blocks, axis, of, |block, lane| block.seen[tick].0.lane(lane))
    }

    /// Motor angles of an axis at the ticks of the last position period, rad.
    #[inline]
    pub fn angles(&self, axis: usize, angles: &mut [f64]) {
        at!(&self.blocks, axis, of, |block, lane| {
            angles.iter_mut().zip(&block.seen).for_each(|(angle, row)| *angle = row.0.angle[lane]);
        });
    }

    /// What the controllers of an axis made of it.
    pub fn done(&self, axis: usize, tick: usize) -> Done {
        at!(&self.blocks, axis, of, |block, lane| block.done[tick].0.lane(lane))
    }

    /// What the ticks of the last position period come to for an axis.
    #[inline]
    pub fn tally(&self, axis: usize) -> Tally {
        at!(&self.blocks, axis, of, |block, lane| block.tally.0.lane(lane))
    }

    /// Runs a position period; `traced` keeps what the controllers did at every tick, not only at the first.
    pub fn run(&mut self, traced: bool) {
        let timing = self.timing;
        match &mut self.blocks {
            Blocks::Few(blocks) => run_all(self.width, Period { blocks, timing, traced }),
            Blocks::Some(blocks) => run_all(self.width, Period { blocks, timing, traced }),
            Blocks::Many(blocks) => run_all(self.width, Period { blocks, timing, traced }),
        }
    }
}

fn run_all<const L: usize>(width: Width, period: Period<'_, L>) {
    if period.traced {
        let row = || Row(Done::default().fill());
        period.blocks.iter_mut().for_each(|b| b.done.resize_with(period.timing.ticks_per_position, row));
    }
    match width {
        Width::Widest if L > FEW => Arch::new().dispatch(period),
        Width::Widest | Width::Four => four_at_most(period),
        Width::Baseline => Scalar::new().vectorize(period),
    }
}

/// How many numbers the processor reckons with at a time.
struct Lanes;

impl WithSimd for Lanes {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

/// `act` with vectors as wide as the processor has them, but four numbers at most.
fn four_at_most<A: WithSimd>(act: A) -> A::Output {
    match Arch::new() {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Arch::V4(eight) => Simd::vectorize(*eight, act),
        arch => arch.dispatch(act),
    }
}

/// A position period to be run.
struct Period<'a, const L: usize> {
    blocks: &'a mut [Block<L>],
    timing: Timing,
    traced: bool,
}

impl<const L: usize> WithSimd for Period<'_, L> {
    type Output = ();

    /// Compiled once for each width: what is inlined here is made of the vectors that it has.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for block in self.blocks {
            block.run(simd, self.timing, self.traced);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::config::Parameters;
    use crate::machine::{Machine, MachineParameters};

    /// Positions of every tick and what the axes have come to, as bits, over motions that differ by axis.
    fn seen(machine: &mut Machine) -> Vec<u64> {
        let axes = machine.axis_count();
        machine.reset(&vec![0.1; axes]);
        let mut seen = Vec::new();
        for k in 0..100 {
            let psec = |axis: usize| 0.1 + 0.02 * (1.0 - (0.05 * (1 + axis) as f64 * f64::from(k)).cos());
            machine.advance(&Vec::from_iter((0..axes).map(psec)), &[]);
            for axis in 0..axes {
                seen.extend(
                    (0..machine.ticks_per_period()).map(|tick| machine.position(axis, tick).to_bits()),
                );
                let activity = machine.activity(axis);
                seen.extend([activity.peak_current.to_bits(), activity.saturated_ticks]);
            }
        }
        seen
    }

    /// Which size of blocks a machine gets depends on the processor; what comes out must not.
    #[test]
    fn blocks_of_each_size_give_the_same_bits_at_each_width() {
        let config = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        for first in 0..5 {
            let places = Vec::from_iter(first..5);
            let parameters = MachineParameters::of_axes(&config, &places).expect("can be discretized");
            let loops: Vec<Loops> = parameters.axes.iter().map(|axis| axis.loops).collect();
            let timing = parameters.timing();
            let mut machine = Machine::new(Arc::new(parameters));
            let wanted = seen(&mut machine);
            let sizes = [
                Blocks::Few(filled(&loops, timing)),
                Blocks::Some(filled(&loops, timing)),
                Blocks::Many(filled(&loops, timing)),
            ];
            for (size, blocks) in sizes.into_iter().enumerate() {
                machine.bank.blocks = blocks;
                for width in [Width::Widest, Width::Four, Width::Baseline] {
                    machine.set_width(width);
                    assert!(seen(&mut machine) == wanted, "axes from {first} on, size {size}, {width:?}");
                }
            }
        }
    }
}
