//! Identification of the presliding stiffness from reversals (LuGre model; Canudas de Wit et al., IEEE Transactions on
//! Automatic Control 40, 1995).
//!
//! A slow reversal from steady sliding moves the friction current from −g to g along `g (1 − 2 exp(−k u/g))`, with u the
//! distance since the reversal and k the stiffness σ0 as current per distance. Each reversal has its own level of friction
//! and of the constant currents, and the damping σ1 of the bristles; all have the same length g/k of presliding. The
//! sum of the squared residuals over this length has a minimum, whose scatter without each of the reversals in turn
//! (jackknife) is the uncertainty.

use super::fit::fit_linear;
use super::friction::speed_unit;
use super::reversals::{Leg, ReversingMotion};
use rayon::prelude::*;

use crate::recording::{Finding, GaussianFilter, SignalSpan, Signals, deviation};
use virtual_axes_core::config::{AxisConfig, AxisKind, PreslidingConfig};
use virtual_axes_core::statistics::{mean, median};
use virtual_axes_core::units::{NEWTON_PER_MICROMETER, Rounded};

/// Standard errors of the half interval that contains 95 % of the values.
const INTERVAL: f64 = 1.96;
/// Fewest reversals.
const FEWEST: usize = 4;
/// Fewest samples within the length of presliding.
const SAMPLES: usize = 16;
/// Smallest length of presliding in standard deviations of the position noise.
const NOISE: f64 = 20.0;
/// Fewest encoder increments within the length of presliding.
const INCREMENTS: f64 = 10.0;
/// Window on both sides of a reversal, in lengths of presliding: exp(−6) of the friction is left.
const WINDOW: f64 = 6.0;
/// Travel before and after a reversal, in lengths of presliding.
const TRAVEL: f64 = 12.0;
/// Trial lengths per decade in the search, and about its result.
const COARSE: f64 = 8.0;
const FINE: f64 = 40.0;
/// Relative change of the length at which the search ends.
const SETTLED: f64 = 0.03;
/// Shortest trial length relative to the shortest that the recording resolves.
const BELOW: f64 = 0.05;
/// Passes: the window, the filter and the choice of reversals depend on the length.
const PASSES: usize = 6;
/// Duration of the filter relative to the time in which an axis passes the length.
const FILTER: f64 = 0.12;
/// Standard errors of a significant damping.
const SIGNIFICANT: f64 = 3.0;
/// Standard error of the logarithm of the stiffness that all reversals share: errors of the inertia, of the friction law and
/// of the sampling; and that of an encoder increment relative to the length.
const SYSTEMATIC: f64 = 0.02;
const OF_INCREMENT: f64 = 1.5;
/// Standard error, s, of the damping relative to the stiffness that all reversals share.
const SYSTEMATIC_TIME: f64 = 1.5e-3;
/// Largest standard error of the logarithm of the stiffness.
const UNCERTAIN: f64 = 0.25;

/// Identified presliding of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct PreslidingFit {
    /// Stiffness σ0 at the axis, N/m or N·m/rad.
    pub stiffness: f64,
    /// Bounds of its 95 % interval.
    pub interval: [f64; 2],
    /// Damping σ1 at the axis, N·s/m or N·m·s/rad, and its standard error; none if the recordings do not determine it.
    pub damping: Option<(f64, f64)>,
    /// Length of presliding g/σ0, m or rad.
    pub length: f64,
    /// Number of reversals.
    pub reversals: usize,
    /// Distance since the reversal, m or rad, measured and modeled friction current, A, of one reversal.
    pub curve: Vec<[f64; 3]>,
}

impl PreslidingFit {
    /// Returns the standard deviation of a normal distribution with the width of the interval.
    pub fn error(&self) -> f64 {
        (self.interval[1] - self.interval[0]) / (2.0 * INTERVAL)
    }

    /// Sets the presliding of an axis; an undetermined damping keeps its value.
    pub(super) fn apply(&self, axis: &mut AxisConfig) {
        let square = axis.transmission_ratio * axis.transmission_ratio;
        let kept = axis.presliding.map_or(0.0, |before| before.damping);
        axis.presliding = Some(PreslidingConfig {
            stiffness: self.stiffness * square,
            damping: self.damping.map_or(kept, |(value, _)| value * square),
        });
    }
}

/// Fits the presliding of `axis`, whose friction law, gravity and inertia are known, and reports findings.
pub(super) fn fit_presliding(
    recordings: &[&Signals],
    axis: &AxisConfig,
    findings: &mut Vec<Finding>,
) -> Result<PreslidingFit, Option<f64>> {
    let motions: Vec<SpanMotion<'_>> = recordings
        .iter()
        .flat_map(|signals| signals.spans.iter().filter_map(|span| SpanMotion::new(span, signals, axis)))
        .collect();
    let search = LengthSearch::new(&motions, axis);
    match search.ok_or_else(|| Undetermined::of(few_reversals(0))).and_then(|search| search.fit()) {
        Ok(fit) => {
            if fit.damping.is_none() {
                findings.push(Finding::note(
                    "presliding-damping",
                    "the reversals do not determine the presliding damping σ1: it is unchanged",
                ));
            }
            Ok(fit)
        }
        Err(Undetermined { finding, excluded }) => {
            findings.push(finding);
            Err(excluded)
        }
    }
}

/// Reason why the recordings do not determine a stiffness.
struct Undetermined {
    finding: Finding,
    /// Stiffness at the axis, N/m or N·m/rad, below which presliding is excluded.
    excluded: Option<f64>,
}

impl Undetermined {
    fn of(finding: Finding) -> Self {
        Undetermined { finding, excluded: None }
    }
}

fn few_reversals(count: usize) -> Finding {
    Finding::missing(
        "no-reversals",
        format!("no presliding stiffness: {count} reversals with current, at least {FEWEST} are needed"),
        "record slow motions to and fro, such as a sine of 1 mm in 4 s, with position and current",
    )
}

/// Span with current and its turning points.
struct SpanMotion<'a> {
    signals: &'a Signals,
    motion: ReversingMotion,
    /// Recorded position, m or rad.
    position: &'a [f64],
    /// Recorded current without gravity, A.
    current: Vec<f64>,
    /// Inertia as current per acceleration, A/(m/s²) or A/(rad/s²).
    inertia: f64,
    /// Friction current of the law at the speed of each sample, A.
    law: Vec<f64>,
}

impl<'a> SpanMotion<'a> {
    fn new(span: &'a SignalSpan, signals: &'a Signals, axis: &AxisConfig) -> Option<Self> {
        let current = span.current.as_deref()?;
        let motion = ReversingMotion::new(span, signals)?;
        let (law, unit) = (&axis.friction, speed_unit(axis));
        let of = |velocity: &f64| {
            let v = velocity.abs() / unit;
            law.a * (law.b * v).exp() + law.c * (law.d * v).exp()
        };
        let law: Vec<f64> = span.velocity.iter().map(of).collect();
        let least = 1e-3 * law.iter().copied().fold(0.0, f64::max);
        let (kt, ratio) = (axis.motor.torque_constant, axis.transmission_ratio);
        let weight =
            |x: &f64| (axis.gravity.weight + axis.gravity.tilt * (x + axis.gravity.phase).sin()) * ratio / kt;
        (least > 0.0).then(|| SpanMotion {
            current: current.iter().zip(&span.position).map(|(i, x)| i - weight(x)).collect(),
            position: &span.position,
            inertia: axis.motor.inertia / (kt * ratio),
            signals,
            motion,
            law: law.into_iter().map(|level| level.max(least)).collect(),
        })
    }

    /// Returns the filtered current without gravity and inertia at a sample, A.
    fn friction_at(&self, filter: &GaussianFilter, index: usize) -> Option<f64> {
        let acceleration = filter.second_at(self.position, index)?;
        Some(filter.value_at(&self.current, index)? - self.inertia * acceleration)
    }

    /// Returns the current of the bristles, A, and its rate, A/s, on two legs, for a stiffness, A/m or A/rad.
    fn bristles(&self, legs: [&Leg; 2], stiffness: f64) -> [Vec<f64>; 2] {
        let first = legs[0].begin;
        let count = legs[1].end - first;
        let (mut force, mut rate) = (vec![0.0; count], vec![0.0; count]);
        let mut present = -legs[0].direction * self.law[first];
        force[0] = present;
        for leg in legs {
            for i in leg.begin + 1..leg.end {
                let level = leg.direction * self.law[i];
                let next =
                    level + (present - level) * (-stiffness * self.motion.steps[i] / self.law[i]).exp();
                rate[i - first] = (next - present) / self.signals.period;
                present = next;
                force[i - first] = present;
            }
        }
        [force, rate]
    }
}

/// Reversal between two legs of a span.
#[derive(Clone, Copy)]
struct Reversal<'a> {
    /// Index of the span.
    span: usize,
    before: &'a Leg,
    after: &'a Leg,
    /// Shorter travel of the two legs, m or rad.
    travel: f64,
    /// Shortest length that the samples after the reversal resolve, m or rad.
    resolved: f64,
}

/// Linear fit of one reversal at one length.
struct ReversalFit {
    squares: f64,
    /// Friction level relative to the law; damping, A/(m/s) or A/(rad/s).
    level: f64,
    damping: f64,
}

/// Search for the length of presliding.
struct LengthSearch<'a> {
    motions: &'a [SpanMotion<'a>],
    axis: &'a AxisConfig,
    reversals: Vec<Reversal<'a>>,
    /// Friction current at the reversals, A.
    level: f64,
}

impl<'a> LengthSearch<'a> {
    /// Collects the reversals; none without reversals.
    fn new(motions: &'a [SpanMotion<'a>], axis: &'a AxisConfig) -> Option<Self> {
        let mut reversals = Vec::new();
        for (span, SpanMotion { motion, signals, .. }) in motions.iter().enumerate() {
            for pair in motion.legs.windows(2) {
                let (before, after) = (&pair[0], &pair[1]);
                let width = 2.0 * deviation(signals.cutoff) / signals.period;
                let samples = SAMPLES.max(width.ceil() as usize).min(after.end - after.begin);
                let passed: f64 = motion.steps[after.begin..after.begin + samples].iter().sum();
                reversals.push(Reversal {
                    span,
                    before,
                    after,
                    travel: motion.travel(before).min(motion.travel(after)),
                    resolved: passed.max(NOISE * motion.noise).max(INCREMENTS * motion.increment),
                });
            }
        }
        let levels = reversals.iter().map(|r| motions[r.span].law[r.after.begin]);
        let level = median(&mut levels.collect::<Vec<_>>())?;
        Some(LengthSearch { motions, axis, reversals, level })
    }

    fn fit(&self) -> Result<PreslidingFit, Undetermined> {
        if self.reversals.len() < FEWEST {
            return Err(Undetermined::of(few_reversals(self.reversals.len())));
        }
        let mut resolved: Vec<f64> = self.reversals.iter().map(|r| r.resolved).collect();
        resolved.sort_by(f64::total_cmp);
        let shortest = resolved[FEWEST - 1];
        let mut travels: Vec<f64> = self.reversals.iter().map(|r| r.travel).collect();
        let travel = median(&mut travels).unwrap_or(0.0);
        let longest = travel / TRAVEL;
        if longest <= shortest {
            return Err(self.coarse(shortest, shortest));
        }
        let (mut length, mut chosen) = (longest, self.reversals.clone());
        for _ in 0..PASSES {
            chosen = self.choose(length.max(shortest));
            if chosen.len() < FEWEST {
                return Err(Undetermined::of(few_reversals(chosen.len())));
            }
            let grid = ([BELOW * shortest, longest], COARSE);
            let profile = LengthProfile::new(self, &chosen, length.max(shortest), grid);
            let next = profile.minimum(None).0;
            let is_settled = (next / length - 1.0).abs() < SETTLED;
            length = next;
            if is_settled {
                break;
            }
        }
        self.finish(&chosen, length, [shortest, longest])
    }

    /// Returns the reversals that are slow and long enough for a length.
    fn choose(&self, length: f64) -> Vec<Reversal<'a>> {
        let is_fit = |r: &&Reversal<'_>| r.travel >= TRAVEL * length && r.resolved <= length;
        self.reversals.iter().filter(is_fit).copied().collect()
    }

    /// Returns the stiffness at the axis, N/m or N·m/rad, of a current per distance.
    fn at_axis(&self, per_distance: f64) -> f64 {
        per_distance * self.axis.motor.torque_constant / self.axis.transmission_ratio
    }

    fn finish(
        &self,
        chosen: &[Reversal<'a>],
        length: f64,
        [shortest, longest]: [f64; 2],
    ) -> Result<PreslidingFit, Undetermined> {
        let range = [(length / 2.0).max(BELOW * shortest), (2.0 * length).min(longest)];
        let profile = LengthProfile::new(self, chosen, length.max(shortest), (range, FINE));
        let (length, stiffness) = profile.minimum(None);
        let count = chosen.len();
        let without: Vec<f64> = (0..count).map(|k| profile.minimum(Some(k)).1.ln()).collect();
        let middle = mean(&without).unwrap_or(f64::NAN);
        let scatter: f64 = without.iter().map(|x| (x - middle) * (x - middle)).sum();
        let increment = chosen.iter().map(|r| self.motions[r.span].motion.increment).fold(0.0, f64::max);
        let shared = SYSTEMATIC.hypot(OF_INCREMENT * increment / length);
        let error = (scatter * (count - 1) as f64 / count as f64).sqrt();
        let half = (student(count - 1) * error).hypot(INTERVAL * shared);
        if length < shortest || half.is_nan() || error > UNCERTAIN {
            return Err(self.coarse(shortest, length * half.min(3.0).exp()));
        }
        if length > 0.98 * longest {
            return Err(Undetermined::of(Finding::missing(
                "no-sliding",
                format!(
                    "no presliding stiffness: the axis does not slide between its reversals, which are {} apart",
                    self.distance(longest * TRAVEL)
                ),
                "record slow motions to and fro over a longer distance",
            )));
        }
        Ok(PreslidingFit {
            stiffness: self.at_axis(stiffness),
            interval: [-half, half].map(|x| self.at_axis(stiffness * x.exp())),
            damping: profile
                .damping(length, stiffness * SYSTEMATIC_TIME.hypot(increment / length * profile.time))
                .map(|(value, error)| (self.at_axis(value), self.at_axis(error))),
            length,
            reversals: count,
            curve: self.curve(&chosen[0], length, profile.cutoff),
        })
    }

    /// Returns the finding about a length that is shorter than the recordings resolve.
    fn coarse(&self, shortest: f64, upper: f64) -> Undetermined {
        let length = shortest.max(upper);
        let least = self.at_axis(self.level / length);
        let (unit, name) = match self.axis.kind() {
            AxisKind::Linear => (NEWTON_PER_MICROMETER, "N/µm"),
            AxisKind::Rotary => (1.0, "N·m/rad"),
        };
        let finding = Finding::missing(
            "no-presliding",
            format!(
                "no presliding found: friction changes its sign within {} of the reversals, the shortest distance that encoder, \
                 sampling and speed resolve; a stiffness σ0 below {} {name} is excluded",
                self.distance(length),
                Rounded(least / unit)
            ),
            format!(
                "if a stiffer presliding matters, record slower reversals, with at least {SAMPLES} samples and {INCREMENTS} encoder \
                 increments within its length"
            ),
        );
        Undetermined { finding, excluded: Some(least) }
    }

    fn distance(&self, distance: f64) -> String {
        match self.axis.kind() {
            AxisKind::Linear => format!("{:.3} µm", distance / 1e-6),
            AxisKind::Rotary => format!("{:.3e} rad", distance),
        }
    }

    /// Fits one reversal at each of the trial lengths.
    fn fit_reversal(
        &self,
        reversal: &Reversal<'_>,
        length: f64,
        lengths: &[f64],
        cutoff: f64,
    ) -> Vec<ReversalFit> {
        let Reversal { before, after, span, .. } = reversal;
        let motion = &self.motions[*span];
        let cutoff = cutoff.min(motion.signals.cutoff);
        let filter = GaussianFilter::new(cutoff, motion.signals.period);
        let from = after.begin - motion.motion.samples_before_end(before, WINDOW * length);
        let to = after.begin + motion.motion.samples_within(after, WINDOW * length);
        // Samples closer than half a standard deviation of the filter are nearly equal.
        let every = (0.5 * deviation(cutoff) / motion.signals.period).max(1.0) as usize;
        let first = before.begin;
        let measured = |i: usize| motion.friction_at(&filter, i);
        let rows: Vec<(usize, f64)> =
            (from..to).step_by(every).filter_map(|i| Some((i - first, measured(i)?))).collect();
        let at = |trial: &f64| {
            let stiffness = self.level / trial;
            let [force, rate] = motion.bristles([before, after], stiffness);
            let row = |&(i, measured): &(usize, f64)| {
                let (force, rate) = (filter.value_at(&force, i)?, filter.value_at(&rate, i)?);
                Some((vec![1.0, force, rate / stiffness], measured, 1.0))
            };
            ReversalFit::new(&rows.iter().filter_map(row).collect::<Vec<_>>())
        };
        lengths.iter().map(at).collect()
    }

    /// Returns distance, measured and modeled current after a reversal.
    fn curve(&self, reversal: &Reversal<'_>, length: f64, cutoff: f64) -> Vec<[f64; 3]> {
        let Reversal { span, before, after, .. } = *reversal;
        let motion = &self.motions[span];
        let filter = GaussianFilter::new(cutoff.min(motion.signals.cutoff), motion.signals.period);
        let [force, _] = motion.bristles([before, after], self.level / length);
        let count = motion.motion.samples_within(after, WINDOW * length);
        let mut distance = 0.0;
        let point = |i: usize| {
            distance += motion.motion.steps[i];
            let (measured, modeled) =
                (motion.friction_at(&filter, i)?, filter.value_at(&force, i - before.begin)?);
            Some([distance, measured, modeled])
        };
        (after.begin..after.begin + count).filter_map(point).collect()
    }
}

/// Residuals of each reversal over the trial lengths.
struct LengthProfile {
    lengths: Vec<f64>,
    /// Fits of each reversal, one per length.
    fits: Vec<Vec<ReversalFit>>,
    level: f64,
    /// Cut-off frequency of the filter, Hz.
    cutoff: f64,
    /// Median time in which an axis passes the length after a reversal, s.
    time: f64,
}

impl LengthProfile {
    /// Fits `chosen` reversals at trial lengths between `low` and `high`; window and filter are those of `length`.
    fn new(
        search: &LengthSearch<'_>,
        chosen: &[Reversal<'_>],
        length: f64,
        ([low, high], per_decade): ([f64; 2], f64),
    ) -> Self {
        let points = ((high / low).log10() * per_decade).ceil().max(2.0) as usize;
        let lengths: Vec<f64> =
            (0..=points).map(|k| low * (high / low).powf(k as f64 / points as f64)).collect();
        let times = chosen.iter().map(|r| {
            let motion = &search.motions[r.span];
            motion.motion.samples_within(r.after, length) as f64 * motion.signals.period
        });
        let time = median(&mut times.collect::<Vec<_>>()).unwrap_or(0.0);
        let cutoff = deviation(1.0) / (FILTER * time).max(f64::MIN_POSITIVE);
        let fits = chosen.par_iter().map(|r| search.fit_reversal(r, length, &lengths, cutoff)).collect();
        LengthProfile { lengths, fits, level: search.level, cutoff, time }
    }

    /// Returns the length of the least squares and its stiffness, A/m or A/rad, without the reversal `left_out`.
    fn minimum(&self, left_out: Option<usize>) -> (f64, f64) {
        let used: Vec<&Vec<ReversalFit>> =
            self.fits.iter().enumerate().filter(|(k, _)| Some(*k) != left_out).map(|(_, fit)| fit).collect();
        let sums: Vec<f64> =
            (0..self.lengths.len()).map(|j| used.iter().map(|fit| fit[j].squares).sum()).collect();
        let least = (0..sums.len()).min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0);
        // Vertex of the parabola through the neighbors, over the logarithm of the length.
        let spacing = (self.lengths[1] / self.lengths[0]).ln();
        let shift = match least {
            0 => 0.0,
            last if last + 1 == sums.len() => 0.0,
            k => {
                let bend = sums[k - 1] - 2.0 * sums[k] + sums[k + 1];
                if bend > 0.0 { 0.5 * (sums[k - 1] - sums[k + 1]) / bend } else { 0.0 }
            }
        };
        let length = self.lengths[least] * (shift * spacing).exp();
        let level = mean(&used.iter().map(|fit| fit[least].level).collect::<Vec<_>>()).unwrap_or(f64::NAN);
        (length, level * self.level / length)
    }

    /// Returns the damping at the trial length next to `length` with its standard error, A/(m/s) or A/(rad/s), if it is
    /// significant. `shared` is the standard error that all reversals share.
    fn damping(&self, length: f64, shared: f64) -> Option<(f64, f64)> {
        let near = |j: &usize| (self.lengths[*j] / length).ln().abs();
        let at = (0..self.lengths.len()).min_by(|a, b| near(a).total_cmp(&near(b)))?;
        let values: Vec<f64> = self.fits.iter().map(|fit| fit[at].damping).collect();
        let value = mean(&values)?;
        let scatter: f64 = values.iter().map(|x| (x - value) * (x - value)).sum();
        let error = (scatter / (values.len() * (values.len() - 1)) as f64).sqrt().hypot(shared);
        (value > SIGNIFICANT * error).then_some((value, error))
    }
}

impl ReversalFit {
    fn new(rows: &[(Vec<f64>, f64, f64)]) -> Self {
        let Some(fit) = fit_linear(rows.iter().cloned()) else {
            let squares = rows.iter().map(|(_, y, _)| y * y).sum();
            return ReversalFit { squares, level: f64::NAN, damping: f64::NAN };
        };
        let residual = |(x, y, _): &(Vec<f64>, f64, f64)| {
            y - x.iter().zip(&fit.values).map(|(x, value)| x * value).sum::<f64>()
        };
        let squares = rows.iter().map(residual).map(|r| r * r).sum();
        ReversalFit { squares, level: fit.values[1], damping: fit.values[2] }
    }
}

/// Returns the 97.5 % quantile of Student's distribution, by the expansion of Cornish and Fisher in powers of
/// 1 / `freedom`; the error is below 1 % from three degrees of freedom on.
fn student(freedom: usize) -> f64 {
    let n = freedom as f64;
    1.959_964 + (2.372_27 + (2.822_5 + 2.555_9 / n) / n) / n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_is_that_of_the_tables() {
        for (freedom, table) in [(3, 3.182), (5, 2.571), (10, 2.228), (30, 2.042)] {
            assert!((student(freedom) / table - 1.0).abs() < 0.01, "{freedom}: {}", student(freedom));
        }
    }
}
