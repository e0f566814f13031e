//! External forces and torques, each held for a while.

use crate::machine::Machine;

/// Largest load, N or N·m: beyond any process, and small enough that the drive stays finite.
pub const MAX_LOAD: f64 = 1e6;

/// Load of one axis.
#[derive(Debug, Clone, Copy, Default)]
struct Load {
    value: f64,
    /// First position instant at which it no longer acts.
    until: i64,
}

/// Loads of every axis.
#[derive(Debug, Clone)]
pub(super) struct Loads {
    axes: Vec<Load>,
}

impl Loads {
    pub(super) fn new(axes: usize) -> Self {
        Loads { axes: vec![Load::default(); axes] }
    }

    pub(super) fn set(&mut self, axis: usize, value: f64, until: i64) {
        if let Some(load) = self.axes.get_mut(axis) {
            let value = if value.is_nan() { 0.0 } else { value.clamp(-MAX_LOAD, MAX_LOAD) };
            *load = Load { value, until };
        }
    }

    pub(super) fn clear(&mut self) {
        self.axes.fill(Load::default());
    }

    pub(super) fn any(&self) -> bool {
        self.axes.iter().any(|l| l.value != 0.0)
    }

    /// Puts the loads of position instant `k` on the machine.
    pub(super) fn apply(&mut self, machine: &mut Machine, k: i64) {
        for (axis, load) in self.axes.iter_mut().enumerate() {
            if k >= load.until {
                load.value = 0.0;
            }
            machine.set_load(axis, load.value);
        }
    }
}
