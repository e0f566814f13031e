//! Position cycles that recordings permit, compared by the residuals of the closed loop.

use super::loop_parameter::{LoopParameter, apply};
use super::loop_problem::{GRID_TOLERANCE, LoopProblem, PERMITTED};
use super::loop_ripple::with_plant_of_loop;
use super::loop_search::LoopMinimum;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, seconds};

/// Residual with the gain of the machine file, relative to the least one, up to which it is kept.
pub(super) const KEPT: f64 = 1.1;
/// The same up to which a cycle is possible: the renewal of the signals, or one whose ripple explains the current.
const POSSIBLE: f64 = 1.5;
/// The same up to which a cycle is compared with the plant of its ripple.
const COMPARED: f64 = 2.0;
/// Residual of the current relative to the least one, from which on a cycle is none of the control.
const CURRENT: f64 = 2.0;
/// Largest number of fits with the plant of the ripple, which depend on each other, and change of the inertia that ends them.
const PLANT_PASSES: usize = 4;
const SAME_INERTIA: f64 = 0.02;
/// Position cycles that are compared, ns; the search starts with the first one that the recordings permit.
const CYCLES: [Nanoseconds; 5] =
    [2 * MILLISECOND_NS, MILLISECOND_NS, 4 * MILLISECOND_NS, 6 * MILLISECOND_NS, MILLISECOND_NS / 2];

impl LoopProblem<'_> {
    /// Returns the position cycles that the recordings permit, the first one to start with; that of the machine file last.
    pub fn cycles(&self, given: &Periods) -> Vec<Periods> {
        let (longest, is_certain) = self.longest_cycle;
        let certain = (longest / seconds(given.velocity)).round().max(1.0) as Nanoseconds * given.velocity;
        let is_permitted = |cycle: &Nanoseconds| {
            *cycle >= given.velocity
                && *cycle % given.velocity == 0
                && seconds(*cycle) <= longest * (1.0 + PERMITTED)
        };
        let mut cycles: Vec<Nanoseconds> = match is_certain {
            true => vec![certain],
            false => self
                .renewal(given)
                .into_iter()
                .chain(CYCLES)
                .chain([given.position])
                .filter(is_permitted)
                .collect(),
        };
        if cycles.is_empty() {
            cycles.push(given.velocity);
        }
        let mut known = Vec::new();
        cycles.retain(|cycle| {
            !known.contains(cycle) && {
                known.push(*cycle);
                true
            }
        });
        cycles.into_iter().map(|position| Periods { position, ..*given }).collect()
    }

    /// Returns the period at which the control renews its signals, rounded to velocity cycles, ns, if the recordings show it.
    fn renewal(&self, given: &Periods) -> Option<Nanoseconds> {
        let renewal = self.recordings.iter().find_map(|(signals, _)| signals.renewal)?;
        Some((renewal / seconds(given.velocity)).round() as Nanoseconds * given.velocity)
    }

    /// Returns the best position cycle, and the cycles that are possible by their residuals, of which those below the resolution
    /// of the encoder or the error of interpolated setpoints count alike. The best one is the renewal of the signals, or one
    /// that divides the lag, whose ripple explains the current, with about the least residual; if several are, that of the
    /// machine file, then the first one.
    ///
    /// A motion shows β + Tsp, so the others start with β changed by the difference of the cycles. Those that can be the least
    /// are compared with the plant that the current shows with the ripple of each.
    pub fn best_cycle(
        &self,
        (axis, given): (&AxisConfig, &Periods),
        cycles: &[Periods],
        parameters: &[LoopParameter],
        first: LoopMinimum,
    ) -> Option<(CycleMinimum, Vec<CycleMinimum>)> {
        let start = cycles.first()?;
        let others = cycles.iter().skip(1).filter_map(|periods| {
            let change = seconds(start.position) - seconds(periods.position);
            let from = parameters.iter().zip(&first.values).map(|(parameter, value)| match parameter {
                LoopParameter::Beta | LoopParameter::Gamma => (value + change).max(0.0),
                _ => *value,
            });
            let found = self.converge(axis, periods, parameters, &from.collect::<Vec<f64>>())?;
            Some((*periods, found))
        });
        let mut all: Vec<CycleMinimum> = others
            .chain([(*start, first.clone())])
            .map(|(periods, minimum)| CycleMinimum { axis: axis.clone(), periods, minimum, current: 0.0 })
            .collect();
        let least =
            |all: &[CycleMinimum]| all.iter().map(|cycle| cycle.minimum.cost).fold(f64::INFINITY, f64::min);
        let best = least(&all);
        all.retain(|cycle| cycle.minimum.cost <= COMPARED * COMPARED * best);
        if self.has_plant {
            for cycle in &mut all {
                self.refit_with_plant(cycle, parameters);
            }
        }
        let count = self.experiments(start, 0.0).iter().map(|e| e.position.len()).sum::<usize>() as f64;
        let interpolation = cycles.iter().map(|periods| self.interpolation(periods)).fold(0.0, f64::max);
        let floor = self.resolution().hypot(interpolation);
        let least = least(&all).max(count * floor.powi(2));
        let renewal = self.renewal(given);
        all.retain(|found| found.minimum.cost <= POSSIBLE * POSSIBLE * least);
        // Of a lag between two cycles, what a machine file cannot have.
        let rest = |found: &CycleMinimum| {
            let tsp = seconds(found.periods.position);
            let lag = found.minimum.values[0];
            ((lag - (lag / tsp).round() * tsp).abs() / GRID_TOLERANCE) as usize
        };
        let is_renewal = |found: &CycleMinimum| Some(found.periods.position) == renewal;
        let least_rest = all.iter().map(rest).min()?;
        let mut best = all.clone();
        best.retain(|found| is_renewal(found) || rest(found) == least_rest);
        let current = best.iter().map(|found| found.current).fold(f64::INFINITY, f64::min);
        best.retain(|found| is_renewal(found) || found.current <= CURRENT * CURRENT * current);
        let least = best
            .iter()
            .map(|found| found.minimum.cost)
            .fold(f64::INFINITY, f64::min)
            .max(count * floor.powi(2));
        best.retain(|found| is_renewal(found) || found.minimum.cost <= KEPT * KEPT * least);
        let preference = |found: &CycleMinimum| {
            let cycle = found.periods.position;
            (is_renewal(found), rest(found) == 0 && cycle == given.position, cycle == start.position, cycle)
        };
        let best = best.into_iter().max_by_key(preference)?;
        Some((best, all))
    }

    /// Fits the loop of a cycle again with the plant that the current shows with its ripple, and the plant with the ripple of
    /// that loop.
    fn refit_with_plant(&self, cycle: &mut CycleMinimum, parameters: &[LoopParameter]) {
        for _ in 0..PLANT_PASSES {
            let (moved, _) = apply(&cycle.axis, &cycle.periods, parameters, &cycle.minimum.values);
            let found = with_plant_of_loop(self.recordings, &cycle.axis, (&moved, &cycle.periods));
            let Some((axis, current)) = found else { return };
            cycle.current = current;
            let Some(minimum) = self.converge(&axis, &cycle.periods, parameters, &cycle.minimum.values)
            else {
                return;
            };
            let change = axis.motor.inertia / cycle.axis.motor.inertia - 1.0;
            (cycle.axis, cycle.minimum) = (axis, minimum);
            if change.abs() < SAME_INERTIA {
                return;
            }
        }
    }
}

/// Minimum of a position cycle.
#[derive(Debug, Clone)]
pub(super) struct CycleMinimum {
    /// Axis with the plant of the cycle.
    pub axis: AxisConfig,
    pub periods: Periods,
    pub minimum: LoopMinimum,
    /// Share of the current that its plant leaves, 1 − R²; 0 without a current.
    pub current: f64,
}
