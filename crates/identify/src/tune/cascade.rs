//! Search of the cascade gains by COBYLA (Powell) from several starts, first common to all axes, then per
//! axis.

use std::cell::RefCell;
use std::f64::consts::LN_10;

use cobyla::{Func, RhoBeg, StopTols, minimize};
use rayon::prelude::*;

use super::error::TuneError;
use super::margin_limits::MarginLimits;
use super::problem::{SearchResult, TuningCandidate, TuningProblem, ranked};
use super::tuning::{AxisGains, Tuning, round_significant, torque_key};
use virtual_axes_core::config::Value;

/// Starts of the first stage: the present gains and random ones.
const STARTS: usize = 8;
/// Starts of the second stage: the best results of the first.
const FINISHERS: usize = 2;
/// Runs per start of the first stage.
const COMMON_RUNS: usize = 50;
/// Runs per start and variable of the second stage.
const RUNS_PER_VARIABLE: usize = 20;
/// Variables per axis: ln of Kp relative to the present one, VFFW, TFFW relative to Jeq.
const VARIABLES: usize = 3;
/// Bounds of the variables: Kp from a tenth to ten times; feedforward from off to beyond the inverse of the
/// plant.
const BOUNDS: [(f64, f64); VARIABLES] = [(-LN_10, LN_10), (0.0, 1.2), (0.0, 1.2)];
/// Bounds of the random starts; axes are unstable beyond a few times Kp.
const START_BOUNDS: [(f64, f64); VARIABLES] = [(-0.7, 0.7), (0.7, 1.1), (0.0, 1.0)];
/// Initial steps of the variables in the first and second stage.
const STEPS: [f64; VARIABLES] = [0.2, 0.05, 0.15];
const FINE_STEPS: [f64; VARIABLES] = [0.05, 0.01, 0.05];
/// Final step relative to the initial step.
const LAST_STEP: f64 = 0.02;
/// Kp of an axis without gain, (m/min)/mm.
const DEFAULT_GAIN: f64 = 1.0;
/// Cost of an unstable loop relative to the present cost.
const UNSTABLE: f64 = 10.0;
/// Largest delay margin in the constraints, s; constraints must be finite.
const LONG: f64 = 1.0;
/// Significant digits of the gains.
const DIGITS: usize = 5;

/// Searches cascade gains (Kp, VFFW, TFFW) of each moving axis with a low cost.
///
/// Kv and Tv stay unchanged: the margins are those of the position loop and do not protect the velocity loop.
/// `seed` determines the random starts; the same seed gives the same gains.
///
/// # Errors
/// [`TuneError`] if a run fails or no tuning is within the limits.
pub fn tune_cascade(
    problem: &TuningProblem<'_>,
    limits: &MarginLimits,
    seed: u64,
) -> Result<SearchResult, TuneError> {
    let axes: Vec<Axis> = problem
        .joints()
        .iter()
        .zip(problem.axes())
        .map(|(j, a)| Axis::of(problem, j, a.motor.inertia))
        .collect();
    let own: Vec<[f64; VARIABLES]> = axes.iter().map(Axis::own).collect();
    let mean = |variable: usize| own.iter().map(|o| o[variable]).sum::<f64>() / own.len() as f64;
    let mut random = SplitMix(seed);
    let mut starts = vec![vec![mean(0), mean(1), mean(2)]];
    starts
        .resize_with(STARTS, || START_BOUNDS.map(|(low, high)| low + (high - low) * random.next()).to_vec());

    problem.progress().begin("common gains", STARTS * COMMON_RUNS);
    let spread = |x: &[f64]| -> Tuning {
        let point: Vec<f64> = axes.iter().flat_map(|_| x.iter().copied()).collect();
        tuning(&axes, &point)
    };
    let common = descend_all(problem, limits, starts, &STEPS, COMMON_RUNS, &spread)?;
    // The mean gains are poor common gains if the axes differ, so the own gains are a start, too.
    let mut ends: Vec<(f64, Vec<f64>)> = common.iter().filter_map(|found| found.end(limits)).collect();
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut tried: Vec<DescentHistory> = common;

    let apart = |x: &[f64]| tuning(&axes, x);
    let mut fine: Vec<Vec<f64>> = ends
        .iter()
        .take(FINISHERS)
        .map(|(_, x)| axes.iter().flat_map(|_| x.iter().copied()).collect())
        .collect();
    fine.push(own.concat());
    let runs = RUNS_PER_VARIABLE * VARIABLES * axes.len();
    problem.progress().begin("gains per axis", fine.len() * runs);
    tried.extend(descend_all(problem, limits, fine, &FINE_STEPS, runs, &apart)?);

    let designs = tried.iter().map(|found| found.history.len()).sum();
    let all: Vec<TuningCandidate> =
        tried.into_iter().flat_map(|found| found.history).filter_map(|(_, candidate)| candidate).collect();
    let runs = all.len();
    let most = all.iter().filter_map(|c| c.margins).max_by(|a, b| a.modulus.total_cmp(&b.modulus));
    let kept: Vec<TuningCandidate> =
        all.into_iter().filter(|c| c.margins.is_some_and(|m| limits.allows(&m))).collect();
    if kept.is_empty() {
        return Err(match most {
            Some(m) => TuneError::NoMargins { designs, limits: *limits, modulus: m.modulus, delay: m.delay },
            None => TuneError::NoneStable { designs },
        });
    }
    let tried = ranked(kept);
    let best = tried.first().cloned().ok_or(TuneError::Saturated { runs })?;
    Ok(SearchResult { best, tried, designs, runs })
}

/// Axis with its present gains.
struct Axis {
    joint: String,
    gains: AxisGains,
    inertia: f64,
}

impl Axis {
    fn of(problem: &TuningProblem<'_>, joint: &str, inertia: f64) -> Self {
        let number = |key: String| match problem.parameters().get(&key) {
            Some(Value::Double(value)) => value,
            _ => 0.0,
        };
        let gain = number(format!("{joint}.position_loop.gain"));
        let gains = AxisGains {
            gain: if gain > 0.0 { gain } else { DEFAULT_GAIN },
            velocity: number(format!("{joint}.feedforward.velocity")),
            torque: number(torque_key(joint, problem.parameters())),
        };
        Axis { joint: joint.to_owned(), gains, inertia }
    }

    /// Returns the present gains as variables.
    fn own(&self) -> [f64; VARIABLES] {
        let own = [0.0, self.gains.velocity, self.gains.torque / self.inertia];
        let mut within = own.into_iter().zip(BOUNDS).map(|(x, (low, high))| x.clamp(low, high));
        [(); VARIABLES].map(|()| within.next().unwrap_or_default())
    }
}

/// Converts a point of three variables per axis to gains.
fn tuning(axes: &[Axis], x: &[f64]) -> Tuning {
    let of_axis = |(axis, x): (&Axis, &[f64])| {
        let at = |variable: usize| x.get(variable).copied().unwrap_or_default();
        let gains = AxisGains {
            gain: round_significant(axis.gains.gain * at(0).exp(), DIGITS),
            velocity: round_significant(at(1), DIGITS),
            torque: round_significant(at(2) * axis.inertia, DIGITS),
        };
        (axis.joint.clone(), gains)
    };
    Tuning::Cascade(axes.iter().zip(x.chunks(VARIABLES)).map(of_axis).collect())
}

/// Evaluated points of a search; candidates are none for unstable loops.
struct DescentHistory {
    history: Vec<(Vec<f64>, Option<TuningCandidate>)>,
}

impl DescentHistory {
    /// Returns the best point within the limits and its cost.
    fn end(&self, limits: &MarginLimits) -> Option<(f64, Vec<f64>)> {
        let kept = self.history.iter().filter_map(|(x, candidate)| {
            let candidate = candidate.as_ref()?;
            let keeps = limits.allows(&candidate.margins?) && !candidate.is_saturated;
            keeps.then(|| (candidate.cost, x.clone()))
        });
        kept.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// Runs one search per start in parallel.
fn descend_all(
    problem: &TuningProblem<'_>,
    limits: &MarginLimits,
    starts: Vec<Vec<f64>>,
    steps: &[f64; VARIABLES],
    runs: usize,
    tuning_at: &(impl Fn(&[f64]) -> Tuning + Sync),
) -> Result<Vec<DescentHistory>, TuneError> {
    starts
        .into_par_iter()
        .with_max_len(1)
        .map(|start| descend(problem, limits, &start, steps, runs, tuning_at))
        .collect()
}

/// Minimizes the cost from `start`; margins and saturation are constraints.
fn descend(
    problem: &TuningProblem<'_>,
    limits: &MarginLimits,
    start: &[f64],
    steps: &[f64; VARIABLES],
    runs: usize,
    tuning_at: &impl Fn(&[f64]) -> Tuning,
) -> Result<DescentHistory, TuneError> {
    let seen: RefCell<Vec<(Vec<f64>, Option<TuningCandidate>)>> = RefCell::default();
    let failed: RefCell<Option<TuneError>> = RefCell::default();
    // Objective and constraints evaluate the same point in sequence.
    let look = |x: &[f64], read: &dyn Fn(Option<&TuningCandidate>) -> f64| -> f64 {
        if failed.borrow().is_some() {
            return 0.0;
        }
        let known = seen.borrow().iter().rposition(|(point, _)| point == x);
        if let Some(index) = known {
            return read(seen.borrow()[index].1.as_ref());
        }
        let tuning = tuning_at(x);
        let run = match problem.margins(&tuning) {
            // An unstable axis is not simulated; it would saturate.
            None => Ok(None),
            margins => problem.run(&tuning, margins).map(Some),
        };
        match run {
            Ok(candidate) => {
                let value = read(candidate.as_ref());
                seen.borrow_mut().push((x.to_vec(), candidate));
                value
            }
            Err(error) => {
                *failed.borrow_mut() = Some(error);
                0.0
            }
        }
    };
    let unstable = UNSTABLE * problem.present().cost.max(f64::MIN_POSITIVE);
    let objective = |x: &[f64], (): &mut ()| look(x, &|c| c.map_or(unstable, |c| c.cost));
    let modulus = |x: &[f64], (): &mut ()| {
        look(x, &|c| c.and_then(|c| c.margins).map_or(-1.0, |m| m.modulus - limits.modulus))
    };
    let delay = |x: &[f64], (): &mut ()| {
        // Scaled by the limit, so that both constraints have similar magnitude.
        let scale = if limits.delay > 0.0 { limits.delay } else { LONG };
        look(x, &|c| c.and_then(|c| c.margins).map_or(-1.0, |m| (m.delay.min(LONG) - limits.delay) / scale))
    };
    let saturation = |x: &[f64], (): &mut ()| {
        let time =
            |c: &TuningCandidate| c.figures.axes.iter().map(|axis| axis.report.saturation_time).sum::<f64>();
        look(x, &|c| c.map_or(-1.0, |c| -time(c)))
    };
    let constraints: [&dyn Func<()>; 3] = [&modulus, &delay, &saturation];
    let repeated = |values: &[f64; VARIABLES]| -> Vec<f64> {
        values.iter().copied().cycle().take(start.len()).collect()
    };
    let steps = repeated(steps);
    let bounds: Vec<(f64, f64)> = BOUNDS.into_iter().cycle().take(start.len()).collect();
    let tolerances =
        StopTols { xtol_abs: steps.iter().map(|step| step * LAST_STEP).collect(), ..StopTols::default() };
    // The return value is not needed; the best point is taken from the history.
    let _ = minimize(objective, start, &bounds, &constraints, (), runs, RhoBeg::Set(steps), Some(tolerances));
    match failed.into_inner() {
        Some(error) => Err(error),
        None => Ok(DescentHistory { history: seen.into_inner() }),
    }
}

/// Pseudo-random number generator SplitMix64 (Steele, Lea and Flood 2014).
struct SplitMix(u64);

impl SplitMix {
    /// Returns a number in 0 … 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        // The upper 53 bits fill the mantissa.
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn split_mix_matches_the_reference_implementation() {
        // First outputs for seed 0 of the reference implementation: e220a8397b1dcdaf, 6e789e6aa1b965f4.
        let mut random = SplitMix(0);
        let expected = [0xe220_a839_7b1d_cdaf_u64, 0x6e78_9e6a_a1b9_65f4];
        for bits in expected {
            assert_eq!(random.next(), (bits >> 11) as f64 / (1u64 << 53) as f64);
        }
    }
}
