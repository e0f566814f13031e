//! Bits of a machine over all ticks of a motion, for every SIMD width and every part of a position cycle.

use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth};
use virtual_axes_verification::fixtures::machines::{AXES, TSP};

/// Setpoints of all axes in a position cycle.
pub fn psec(k: usize) -> [f64; AXES] {
    std::array::from_fn(|axis| 0.02 * (1.0 - (9.0 * TSP * k as f64 + axis as f64).cos()))
}

/// Returns the bits of position, velocity, current and wind-up of an axis over all ticks of a motion.
pub fn bits(config: &MachineConfig, axis: usize, width: SimdWidth, parts: &[usize]) -> Vec<u64> {
    let mut machine = Machine::new(Arc::new(MachineParameters::new(config).expect("can be discretized")));
    machine.set_simd_width(width);
    let mut bits = Vec::new();
    for k in 0..120 {
        machine.set_load(axis, if k % 9 < 3 { 2000.0 } else { 0.0 });
        for &part in parts {
            machine.advance_ticks(part, &psec(k), &[]);
        }
        for tick in 0..machine.ticks_per_period() {
            bits.extend(machine.motion_at(axis, tick).map(f64::to_bits));
        }
        bits.push(machine.sample_at_end(axis).wind_up.to_bits());
    }
    bits
}

/// Asserts that each axis has the same bits with every SIMD width and in every split of the position cycles.
pub fn assert_bits_of_every_width_and_part(config: &MachineConfig) {
    for axis in 0..AXES {
        let wanted = bits(config, axis, SimdWidth::Widest, &[48]);
        for width in [SimdWidth::Widest, SimdWidth::Four, SimdWidth::Baseline] {
            for parts in [&[48][..], &[1, 20, 27], &[47, 1]] {
                assert!(bits(config, axis, width, parts) == wanted, "axis {axis}, {width:?}, {parts:?}");
            }
        }
    }
}
