//! Parameters of a machine: discretized axes, cross-coupled control and mechanical couplings.

use std::sync::Arc;

use super::bank::AxisBank;
use super::contour_control::ContourControl;
use super::coupling::AxisCoupling;
use super::inner_loops::{CycleTicks, InnerLoops};
use super::{AxisParameters, MachineError};
use crate::config::{AxisConfig, MachineConfig, Periods};

/// Immutable parameters of a machine, discretized.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineParameters {
    pub(super) periods: Periods,
    pub(super) axes: Vec<AxisParameters>,
    pub(super) contour_controls: Vec<ContourControl>,
    pub(super) couplings: Vec<AxisCoupling>,
}

impl MachineParameters {
    /// Discretizes every axis of `config`.
    ///
    /// # Errors
    /// [`MachineError::Axis`] with the name of the first axis that cannot be built.
    pub fn new(config: &MachineConfig) -> Result<Self, MachineError> {
        Self::from_axes(config, &Vec::from_iter(0..config.axes.len()))
    }

    /// Discretizes the axes of `config` at `indices` only; indices without an axis are ignored. Two axes are coupled if
    /// both are among them.
    ///
    /// # Errors
    /// [`MachineError::Axis`] with the name of the first axis that cannot be built.
    pub fn from_axes(config: &MachineConfig, indices: &[usize]) -> Result<Self, MachineError> {
        let axis = |axis: &AxisConfig| {
            AxisParameters::new(axis, &config.periods)
                .map_err(|source| MachineError::Axis { axis: axis.name.clone(), source })
        };
        let axes = indices.iter().filter_map(|&index| config.axes.get(index));
        let mut axes: Vec<AxisParameters> = axes.map(axis).collect::<Result<_, _>>()?;
        let contour_control = ContourControl::new(config, indices)?;
        for (index, axis) in axes.iter_mut().enumerate() {
            axis.has_contour_control =
                contour_control.as_ref().is_some_and(|control| control.contains(index));
        }
        let contour_controls = contour_control.into_iter().collect();
        let couplings = AxisCoupling::of_machine(config, indices);
        for axis in couplings.iter().flat_map(|coupling| coupling.axes) {
            axes[axis].is_coupled = true;
        }
        Ok(MachineParameters { periods: config.periods, axes, contour_controls, couplings })
    }

    /// Returns the periods of the control loops.
    pub fn periods(&self) -> Periods {
        self.periods
    }

    /// Concatenates the axes of several machines into one machine; `None` without machines or if their periods differ.
    pub fn concatenate(machines: &[Arc<MachineParameters>]) -> Option<Self> {
        let periods = machines.first()?.periods;
        let is_same = machines.iter().all(|machine| machine.periods == periods);
        let (mut axes, mut contour_controls, mut couplings) = (Vec::new(), Vec::new(), Vec::new());
        for machine in machines {
            contour_controls
                .extend(machine.contour_controls.iter().map(|control| control.behind(axes.len())));
            couplings.extend(machine.couplings.iter().map(|coupling| coupling.behind(axes.len())));
            axes.extend(machine.axes.iter().cloned());
        }
        is_same.then_some(MachineParameters { periods, axes, contour_controls, couplings })
    }

    pub(super) fn cycle_ticks(&self) -> CycleTicks {
        CycleTicks {
            position: self.periods.ticks_per_position() as usize,
            velocity: self.periods.ticks_per_velocity() as usize,
        }
    }

    pub(super) fn bank(&self) -> AxisBank {
        let loops: Vec<InnerLoops> = self.axes.iter().map(|axis| axis.loops).collect();
        let mut bank = AxisBank::new(&loops, self.cycle_ticks());
        for (index, axis) in self.axes.iter().enumerate() {
            bank.set_event_driven(index, axis.event_driven.clone());
            bank.set_elements(index, axis.elements.clone());
        }
        bank
    }
}
