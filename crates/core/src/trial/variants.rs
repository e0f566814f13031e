//! Simultaneous simulation of machine variants on one trial.

use std::io;
use std::sync::Arc;

use crate::config::MachineConfig;
use crate::machine::{Machine, MachineParameters};
use crate::simulation::{Simulation, SimulationError};

use super::cycle::PositionCycle;
use super::definition::{Trial, TrialError};
use super::figures::Figures;
use super::observer::Observer;
use super::run::start;
use super::setpoints::SetpointSource;

/// Variants of the trial's machine simulated as one machine.
///
/// The trial's base machine computes the setpoints once. The axes of the variants are SIMD lanes of one
/// machine, so that a vector contains the same axis of several variants.
struct VariantBatch<'a> {
    /// Machine indices of the axes that differ between variants.
    own: &'a [usize],
    /// Index in `own` of each axis of the trial's machine.
    own_index: Vec<Option<usize>>,
    machine: Machine,
    psec: Vec<f64>,
    preview: Vec<f64>,
}

impl<'a> VariantBatch<'a> {
    fn new(
        trial: &Trial<'_>,
        variants: &[MachineConfig],
        own: &'a [usize],
        start: &[f64],
    ) -> Result<Option<Self>, TrialError> {
        let of_variant = |config| MachineParameters::from_axes(config, own).map(Arc::new);
        let parameters: Vec<_> =
            variants.iter().map(of_variant).collect::<Result<_, _>>().map_err(SimulationError::from)?;
        let Some(parameters) = MachineParameters::concatenate(&parameters) else { return Ok(None) };
        let mut machine = Machine::new(Arc::new(parameters));
        let of_one: Vec<f64> = own.iter().map(|&index| start[index]).collect();
        machine.record_every_tick(trial.measures.energy);
        machine.reset(&of_one.repeat(variants.len()));
        let indices = 0..trial.machine.axes().len();
        let own_index = indices.map(|axis| own.iter().position(|&index| index == axis)).collect();
        Ok(Some(VariantBatch { own, own_index, machine, psec: Vec::new(), preview: Vec::new() }))
    }

    /// Reads the setpoints of the next instant from `base`, and the preview that the controllers of the
    /// variants need.
    fn update_preview(&mut self, base: &Simulation) {
        let horizon = self.machine.preview_length();
        let psec = |&axis: &usize, periods| base.psec_ahead(axis, periods as u32).unwrap_or(0.0);
        self.psec.clear();
        self.psec.extend(self.own.iter().map(|axis| psec(axis, 0)));
        self.preview.clear();
        for axis in self.own {
            self.preview.extend((1..=horizon).map(|periods| psec(axis, periods)));
        }
    }

    fn advance(&mut self, variants: usize) {
        self.machine.advance(&self.psec.repeat(variants), &self.preview.repeat(variants));
    }
}

/// Runs `setpoints` on each of `variants` and returns their figures.
///
/// The variants differ from the trial's machine only in the axes at `own`, not in periods, delays or couplings. The
/// figures of each are those of [`run`](super::run). `callback` is called at every position cycle.
///
/// # Errors
/// Returns [`TrialError`] if one of the variants cannot be run.
pub fn run_variants(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'_>,
    variants: &[MachineConfig],
    own: &[usize],
    callback: impl Fn() -> io::Result<()>,
) -> Result<Vec<Figures>, TrialError> {
    let own = &*trial.machine.with_coupled_axes(own);
    let (mut base, mut submitter, start) = start(trial, setpoints)?;
    let Some(mut batch) = VariantBatch::new(trial, variants, own, &start)? else { return Ok(Vec::new()) };
    let mut observers = vec![Observer::new(trial, &start); variants.len()];
    let mut cycle = PositionCycle::new(trial.machine.periods(), start.len());
    loop {
        submitter.submit_due(&mut base)?;
        if !base.is_busy() && submitter.is_empty() {
            break;
        }
        let is_moving = base.has_active_commands();
        for observer in &mut observers {
            observer.push_preview(&base, |instant| submitter.is_rapid(instant));
        }
        batch.update_preview(&base);
        let time = base.time_of(base.next_instant());
        callback().map_err(TrialError::Callback)?;
        if base.step() {
            batch.advance(variants.len());
            cycle.begin(time, is_moving);
            let needs_positions = observers.iter().any(Observer::needs_positions);
            if needs_positions {
                (0..start.len()).for_each(|axis| cycle.store_positions(axis, base.machine(), axis));
            }
            for (variant, observer) in observers.iter_mut().enumerate() {
                let locate = |axis| batch.locate(&base, variant, axis);
                for &axis in own.iter().filter(|_| needs_positions) {
                    let (machine, at) = locate(axis);
                    cycle.store_positions(axis, machine, at);
                }
                observer.observe(locate, &mut cycle);
            }
        }
    }
    Ok(observers.iter().map(Observer::figures).collect())
}

impl VariantBatch<'_> {
    /// Returns the machine and index of an axis of a variant: one of its own, or that of the base machine.
    fn locate<'m>(&'m self, base: &'m Simulation, variant: usize, axis: usize) -> (&'m Machine, usize) {
        match self.own_index.get(axis).copied().flatten() {
            Some(index) => (&self.machine, variant * self.own.len() + index),
            None => (base.machine(), axis),
        }
    }
}
