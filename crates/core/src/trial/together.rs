//! Variants of a machine on one trial, side by side.

use std::io;
use std::sync::Arc;

use crate::config::MachineConfig;
use crate::machine::{Machine, MachineParameters};
use crate::simulation::{Simulation, SimulationError};

use super::figures::Figures;
use super::observer::{Measures, Observer};
use super::period::Period;
use super::setpoints::Setpoints;
use super::{Trial, TrialError, begin};

/// Variants of the trial's machine that are run as one.
///
/// The setpoints are worked out once, by the trial's machine itself; the axes of the variants are lanes of
/// one machine, so that a vector of the processor holds the same axis of several variants.
struct Together<'a> {
    /// Places of the axes that the variants have their own of.
    own: &'a [usize],
    /// For each axis of the trial's machine, its place in `own`.
    place: Vec<Option<usize>>,
    fleet: Machine,
    psec: Vec<f64>,
    ahead: Vec<f64>,
}

impl<'a> Together<'a> {
    fn new(
        trial: &Trial<'_>,
        variants: &[MachineConfig],
        own: &'a [usize],
        start: &[f64],
    ) -> Result<Option<Self>, TrialError> {
        let of_variant = |config| MachineParameters::of_axes(config, own).map(Arc::new);
        let parameters: Vec<_> =
            variants.iter().map(of_variant).collect::<Result<_, _>>().map_err(SimulationError::from)?;
        let Some(parameters) = MachineParameters::together(&parameters) else { return Ok(None) };
        let mut fleet = Machine::new(Arc::new(parameters));
        let of_one: Vec<f64> = own.iter().map(|&place| start[place]).collect();
        fleet.reset(&of_one.repeat(variants.len()));
        let places = 0..trial.machine.axes().len();
        let place = places.map(|axis| own.iter().position(|&place| place == axis)).collect();
        Ok(Some(Together { own, place, fleet, psec: Vec::new(), ahead: Vec::new() }))
    }

    /// Learns what is asked of the axes at the next instant of `pilot`, and behind it as far as any of the
    /// variants looks.
    fn look_ahead(&mut self, pilot: &Simulation) {
        let horizon = self.fleet.horizon();
        let psec = |&axis: &usize, periods| pilot.psec_ahead(axis, periods as u32).unwrap_or(0.0);
        self.psec.clear();
        self.psec.extend(self.own.iter().map(|axis| psec(axis, 0)));
        self.ahead.clear();
        for axis in self.own {
            self.ahead.extend((1..=horizon).map(|periods| psec(axis, periods)));
        }
    }

    fn advance(&mut self, variants: usize) {
        self.fleet.advance(&self.psec.repeat(variants), &self.ahead.repeat(variants));
    }
}

/// Runs `setpoints` on each of `variants`: machines that differ from the trial's own in axes at `own` only,
/// and neither in periods nor in delays. The figures of each are those that [`run`](super::run) finds for it, but
/// without circles, each of which would cost more than all of the rest.
/// `watch` is asked at every position period.
///
/// # Errors
/// [`TrialError`]; a variant that cannot be run ends all of them.
pub fn run_together(
    trial: &Trial<'_>,
    setpoints: Setpoints<'_>,
    variants: &[MachineConfig],
    own: &[usize],
    watch: impl Fn() -> io::Result<()>,
) -> Result<Vec<Figures>, TrialError> {
    let (mut pilot, mut supply, start) = begin(trial, setpoints)?;
    let Some(mut together) = Together::new(trial, variants, own, &start)? else { return Ok(Vec::new()) };
    let mut observers = vec![Observer::new(trial, &start, Measures::WithoutCircles); variants.len()];
    let mut period = Period::new(trial.machine.periods(), start.len());
    loop {
        supply.offer_due(&mut pilot)?;
        if !pilot.is_busy() && supply.is_empty() {
            break;
        }
        let moving = pilot.is_asked();
        for observer in &mut observers {
            observer.look_ahead(&pilot);
        }
        together.look_ahead(&pilot);
        let time = pilot.time_of(pilot.next_instant());
        watch().map_err(TrialError::Watch)?;
        if pilot.step() {
            together.advance(variants.len());
            period.begin(time, moving);
            (0..start.len()).for_each(|axis| period.put(axis, pilot.machine(), axis));
            for (variant, observer) in observers.iter_mut().enumerate() {
                let find = |axis| together.find(&pilot, variant, axis);
                for &axis in own {
                    let (machine, at) = find(axis);
                    period.put(axis, machine, at);
                }
                observer.observe(find, &mut period);
            }
        }
    }
    Ok(observers.iter().map(Observer::figures).collect())
}

impl Together<'_> {
    /// Where an axis of a variant is: one of its own, or that of the pilot.
    fn find<'m>(&'m self, pilot: &'m Simulation, variant: usize, axis: usize) -> (&'m Machine, usize) {
        match self.place.get(axis).copied().flatten() {
            Some(place) => (&self.fleet, variant * self.own.len() + place),
            None => (pilot.machine(), axis),
        }
    }
}
