//! Search for the least minimum of a closed-loop problem, from several starts.

use rayon::prelude::*;

use super::fit::{Effort, descend};
use super::loop_parameter::LoopParameter;
use super::loop_problem::LoopProblem;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::{POSITION_GAIN, seconds};

/// Start values of β and γ relative to the lag.
const DELAY_STARTS: [f64; 4] = [0.2, 0.45, 0.7, 0.95];
/// Start values of the position-loop gain, (m/min)/mm.
const GAIN_STARTS: [f64; 3] = [1.4, 2.2, 3.3];
/// Start values of the ratio of velocity-loop gain to inertia, s⁻¹.
const BANDWIDTH_STARTS: [f64; 2] = [180.0, 300.0];
/// Starts of each gain that are followed to their minimum.
const FOLLOWED: usize = 1;
/// Gains whose minimum is followed with a free gain; the best one can be a local minimum.
const FREED: usize = 4;
/// Minima with a free gain that are followed until they converge.
const FINISHED: usize = 2;
/// Relative change of the cost below which a minimum is reached, and largest number of searches for it.
const CONVERGED: f64 = 2e-3;
const SEARCHES: usize = 4;
/// Velocity cycles by which β and γ are moved, since they act at velocity cycles only.
const DELAY_STEPS: [f64; 2] = [-2.0, 2.0];

/// LoopMinimum of the search: parameters and their values.
#[derive(Debug, Clone)]
pub(super) struct LoopMinimum {
    pub values: Vec<f64>,
    pub cost: f64,
}

impl LoopProblem<'_> {
    /// Returns the values from which the search starts with a position-loop gain, best first.
    fn starts(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        lag: f64,
    ) -> Vec<LoopMinimum> {
        let mut all = Vec::new();
        // A delay without effect has one start.
        let of =
            |parameter| &DELAY_STARTS[..if parameters.contains(&parameter) { DELAY_STARTS.len() } else { 1 }];
        let pairs = || {
            of(LoopParameter::Beta)
                .iter()
                .flat_map(|beta| of(LoopParameter::Gamma).iter().map(|gamma| (*beta, *gamma)))
        };
        for bandwidth in BANDWIDTH_STARTS {
            for (beta, gamma) in pairs() {
                let value = |parameter: &LoopParameter| match parameter {
                    LoopParameter::Lag => lag,
                    LoopParameter::Beta => beta * lag,
                    LoopParameter::Gamma => gamma * lag,
                    LoopParameter::Gain => axis.position_loop.gain,
                    LoopParameter::Bandwidth => bandwidth,
                    LoopParameter::IntegralTime => 1.5 / bandwidth,
                    LoopParameter::TorqueRatio => 1.0,
                };
                all.push(parameters.iter().map(value).collect::<Vec<f64>>());
            }
        }
        let residuals = self.residuals_of(axis, periods, parameters);
        let tried = all.into_par_iter().filter_map(|values| {
            let cost = residuals(&values)?.norm_squared();
            Some(LoopMinimum { values, cost })
        });
        let mut tried: Vec<LoopMinimum> = tried.collect();
        tried.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        tried
    }

    /// Follows a start to its minimum.
    fn follow(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        from: &[f64],
    ) -> Option<LoopMinimum> {
        let bounded = self.bounded(periods, parameters, from);
        let residuals = self.residuals_of(axis, periods, parameters);
        let (values, cost) = descend(&bounded, Effort::Simulation, residuals)?;
        Some(LoopMinimum { values, cost })
    }

    /// Follows a start until the cost hardly changes.
    pub fn converge(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        from: &[f64],
    ) -> Option<LoopMinimum> {
        let mut best = self.follow(axis, periods, parameters, from)?;
        for _ in 1..SEARCHES {
            let next = self.follow(axis, periods, parameters, &best.values)?;
            let is_reached = next.cost > (1.0 - CONVERGED) * best.cost;
            if next.cost < best.cost {
                best = next;
            }
            if is_reached {
                break;
            }
        }
        Some(best)
    }

    /// Moves β and γ by some velocity cycles, from each of which the others converge, until no move improves the minimum.
    pub fn polish(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        mut best: LoopMinimum,
    ) -> LoopMinimum {
        let tsv = seconds(periods.velocity);
        let is_delay = |k: &usize| matches!(parameters[*k], LoopParameter::Beta | LoopParameter::Gamma);
        for _ in 1..SEARCHES {
            let moves = (0..parameters.len()).filter(is_delay).flat_map(|k| DELAY_STEPS.map(|by| (k, by)));
            let next = moves
                .filter_map(|(k, by)| {
                    let mut from = best.values.clone();
                    from[k] = (from[k] + by * tsv).max(0.0);
                    self.follow(axis, periods, parameters, &from)
                })
                .min_by(|a, b| a.cost.total_cmp(&b.cost));
            match next.filter(|next| next.cost < (1.0 - CONVERGED) * best.cost) {
                Some(next) => best = next,
                None => break,
            }
        }
        best
    }

    /// Returns the least minimum: first with some gains held, since a search over all parameters ends in local minima, then
    /// with a free gain.
    pub fn best(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        lag: f64,
    ) -> Option<LoopMinimum> {
        let held: Vec<LoopParameter> =
            parameters.iter().copied().filter(|p| *p != LoopParameter::Gain).collect();
        let gains: Vec<f64> = match self.fits_gain {
            true => GAIN_STARTS.iter().map(|gain| gain * POSITION_GAIN).chain([self.given_gain]).collect(),
            false => vec![self.given_gain],
        };
        let mut minima: Vec<(f64, LoopMinimum)> = Vec::new();
        for gain in gains {
            let mut with_gain = axis.clone();
            with_gain.position_loop.gain = gain;
            for start in self.starts(&with_gain, periods, &held, lag).iter().take(FOLLOWED) {
                let found = self.follow(&with_gain, periods, &held, &start.values);
                minima.extend(found.map(|found| (gain, found)));
            }
        }
        minima.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        let freed = minima.into_iter().take(FREED).filter_map(|(gain, found)| {
            let mut values = found.values.into_iter();
            let from =
                parameters.iter().map(|p| if *p == LoopParameter::Gain { Some(gain) } else { values.next() });
            self.follow(axis, periods, parameters, &from.collect::<Option<Vec<f64>>>()?)
        });
        let mut freed: Vec<LoopMinimum> = freed.collect();
        freed.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let finished = freed.iter().take(FINISHED);
        let finished = finished.filter_map(|start| self.converge(axis, periods, parameters, &start.values));
        finished.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }
}
