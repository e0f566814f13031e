//! External forces and torques on the axes, each with a hold time.

use crate::machine::{MAX_INPUT, Machine};

#[derive(Debug, Clone, Copy, Default)]
struct AxisLoad {
    /// Load, N or N·m.
    value: f64,
    /// First position cycle without the load.
    until: i64,
}

/// Loads of all axes.
#[derive(Debug, Clone)]
pub(super) struct AxisLoads {
    axes: Vec<AxisLoad>,
}

impl AxisLoads {
    /// Creates zero loads for `axes` axes.
    pub(super) fn new(axes: usize) -> Self {
        AxisLoads { axes: vec![AxisLoad::default(); axes] }
    }

    /// Sets the load of an axis up to instant `until`, limited to ±[`MAX_INPUT`]; NaN is zero.
    pub(super) fn set(&mut self, axis: usize, value: f64, until: i64) {
        if let Some(load) = self.axes.get_mut(axis) {
            let value = if value.is_nan() { 0.0 } else { value.clamp(-MAX_INPUT, MAX_INPUT) };
            *load = AxisLoad { value, until };
        }
    }

    /// Sets all loads to zero.
    pub(super) fn clear(&mut self) {
        self.axes.fill(AxisLoad::default());
    }

    /// Returns true if any load is not zero.
    pub(super) fn is_any_active(&self) -> bool {
        self.axes.iter().any(|l| l.value != 0.0)
    }

    /// Applies the loads of position cycle `k` to the machine.
    pub(super) fn apply(&mut self, machine: &mut Machine, k: i64) {
        for (axis, load) in self.axes.iter_mut().enumerate() {
            if k >= load.until {
                load.value = 0.0;
            }
            machine.set_load(axis, load.value);
        }
    }
}
