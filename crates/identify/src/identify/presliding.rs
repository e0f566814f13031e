//! Identification of the presliding stiffness from reversals (LuGre model; Canudas de Wit et al., IEEE Transactions on
//! Automatic Control 40, 1995).
//!
//! A slow reversal from steady sliding moves the friction current from −g to g along `g (1 − 2 exp(−k u/g))`, with u the
//! distance since the reversal and k the stiffness σ0 as current per distance. Each reversal has its own level of friction
//! and of the constant currents, and the damping σ1 of the bristles; all have the same length g/k of presliding. The
//! sum of the squared residuals over this length has a minimum, whose scatter without each of the reversals in turn
//! (jackknife) is the uncertainty.

mod profile;
mod reversal;

use self::profile::LengthProfile;
pub(super) use self::profile::student;
use self::reversal::{Reversal, SpanMotion, WINDOW};
use crate::recording::{Finding, GaussianFilter, Signals, deviation};
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
        let before = axis.presliding.unwrap_or(PreslidingConfig::NONE);
        // Elements have no damping.
        let damping = self.damping.filter(|_| before.elements == 0);
        axis.presliding = Some(PreslidingConfig {
            stiffness: self.stiffness * square,
            damping: damping.map_or(before.damping, |(value, _)| value * square),
            ..before
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

/// Search for the length of presliding.
struct LengthSearch<'a> {
    axis: &'a AxisConfig,
    reversals: Vec<Reversal<'a>>,
    /// Friction current at the reversals, A.
    level: f64,
}

impl<'a> LengthSearch<'a> {
    /// Collects the reversals; none without reversals.
    fn new(motions: &'a [SpanMotion<'a>], axis: &'a AxisConfig) -> Option<Self> {
        let mut reversals = Vec::new();
        for of_span in motions {
            let SpanMotion { motion, signals, .. } = of_span;
            for pair in motion.legs.windows(2) {
                let (before, after) = (&pair[0], &pair[1]);
                let width = 2.0 * deviation(signals.cutoff) / signals.period;
                let samples = SAMPLES.max(width.ceil() as usize).min(after.end - after.begin);
                let passed: f64 = motion.steps[after.begin..after.begin + samples].iter().sum();
                reversals.push(Reversal {
                    motion: of_span,
                    before,
                    after,
                    travel: motion.travel(before).min(motion.travel(after)),
                    resolved: passed.max(NOISE * motion.noise).max(INCREMENTS * motion.increment),
                });
            }
        }
        let levels = reversals.iter().map(|r| r.motion.law[r.after.begin]);
        let level = median(&mut levels.collect::<Vec<_>>())?;
        Some(LengthSearch { axis, reversals, level })
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
            let profile = LengthProfile::new(self.level, &chosen, length.max(shortest), grid);
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
        let profile = LengthProfile::new(self.level, chosen, length.max(shortest), (range, FINE));
        let (length, stiffness) = profile.minimum(None);
        let count = chosen.len();
        let without: Vec<f64> = (0..count).map(|k| profile.minimum(Some(k)).1.ln()).collect();
        let middle = mean(&without).unwrap_or(f64::NAN);
        let scatter: f64 = without.iter().map(|x| (x - middle) * (x - middle)).sum();
        let increment = chosen.iter().map(|r| r.motion.motion.increment).fold(0.0, f64::max);
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

    /// Returns distance, measured and modeled current after a reversal.
    fn curve(&self, reversal: &Reversal<'_>, length: f64, cutoff: f64) -> Vec<[f64; 3]> {
        let Reversal { motion, before, after, .. } = *reversal;
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
