//! External forces and torques on the axes.

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
    /// Loads beside those with a hold time, N or N·m.
    lasting: Vec<f64>,
}

impl AxisLoads {
    /// Creates zero loads for `axes` axes.
    pub(super) fn new(axes: usize) -> Self {
        AxisLoads { axes: vec![AxisLoad::default(); axes], lasting: vec![0.0; axes] }
    }

    /// Sets the load of an axis up to instant `until`, limited to ±[`MAX_INPUT`]; NaN is zero.
    pub(super) fn set(&mut self, axis: usize, value: f64, until: i64) {
        if let Some(load) = self.axes.get_mut(axis) {
            *load = AxisLoad { value: limited(value), until };
        }
    }

    /// Sets the load of an axis that acts until it is set again, limited as that of [`set`](Self::set).
    pub(super) fn set_lasting(&mut self, axis: usize, value: f64) {
        if let Some(load) = self.lasting.get_mut(axis) {
            *load = limited(value);
        }
    }

    /// Sets all loads to zero.
    pub(super) fn clear(&mut self) {
        self.axes.fill(AxisLoad::default());
        self.lasting.fill(0.0);
    }

    /// Returns true if any load is not zero, with a hold time or lasting.
    pub(super) fn is_any_acting(&self) -> bool {
        self.is_any_active() || self.lasting.iter().any(|&load| load != 0.0)
    }

    /// Returns true if any load with a hold time is not zero.
    pub(super) fn is_any_active(&self) -> bool {
        self.axes.iter().any(|l| l.value != 0.0)
    }

    /// Applies the loads of position cycle `k` to the machine.
    pub(super) fn apply(&mut self, machine: &mut Machine, k: i64) {
        for (axis, (load, lasting)) in self.axes.iter_mut().zip(&self.lasting).enumerate() {
            if k >= load.until {
                load.value = 0.0;
            }
            machine.set_load(axis, load.value + lasting);
        }
    }
}

fn limited(load: f64) -> f64 {
    if load.is_nan() { 0.0 } else { load.clamp(-MAX_INPUT, MAX_INPUT) }
}
