//! Identification of an elastic transmission from recordings with the encoders of motor and load.
//!
//! The load follows the force of the contact, the motor both (docs/explanation/model.md, elastic transmission), here at the
//! axis:
//!
//! ```text
//! Ml a_load = k c(δ) + d dc(δ)/dt − C_load − G          c(δ): twist δ beyond the gap
//! Kt i / r  = Mm a_motor + Ml a_load + C(V) + G
//! ```
//!
//! The first equation gives k/Ml, d/Ml and the gap, without a current. Only the second, above the frequencies at which motor
//! and load move as one, tells Ml from Mm. All signals pass the same filter without phase; the nonlinear function c(δ) is
//! evaluated before it.

mod block_regression;
mod contact;
mod fit;
mod motion;

use std::f64::consts::TAU;

use self::block_regression::{BlockRegression, scatter};
use self::contact::{BLOCKS, ContactFit, Gap, UnknownGap, fit_contact};
use self::fit::INTERVAL;
pub use self::fit::{ConfidenceInterval, MassesFit, TransmissionFit};
use self::motion::TwoEncoderMotion;
use super::presliding::student;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, AxisKind, Periods};
use virtual_axes_core::units::{MICROMETER, Rounded, seconds};

/// Smallest spread of the twist, and of its part by the acceleration, in standard deviations by the encoders.
const NOISE: f64 = 5.0;
/// Smallest coefficient of determination R² of the acceleration of the load.
const EXPLAINED: f64 = 0.9;
/// Standard error of the inertia of the load by forces that the equation does not contain, relative to the inertia of motor
/// and load, where the twist accelerates as the load does.
const UNMODELED: f64 = 0.002;
/// Standard errors relative to the value that all blocks share: by the filter, and, with the current, by a sampling period as
/// long as the position cycle, within which the current varies; the latter grows with its square.
const SYSTEMATIC: [f64; 2] = [0.005, 0.0];
const WITH_CURRENT: [f64; 2] = [0.007, 0.36];
const OF_DAMPING: [f64; 2] = [0.06, 0.36];
/// Least delay between the encoders that is reported, s.
const DELAY: f64 = 5e-5;
/// Largest number of steps of the search for it, and step at which the search ends, s.
const DELAY_STEPS: usize = 10;
const DELAY_SETTLED: f64 = 1e-6;
/// Standard error of the width of the gap that all blocks share, relative to the twist by the encoders, to the spread of
/// the twist, and to the width.
const GAP: [f64; 3] = [1.0, 0.01, 0.01];

/// Fits the transmission of `axis`, whose friction law and gravity are known, and reports findings.
pub(super) fn fit_transmission(
    recordings: &[&Signals],
    (axis, periods): (&AxisConfig, &Periods),
    findings: &mut Vec<Finding>,
) -> Option<TransmissionFit> {
    let missing: Vec<&str> = recordings
        .iter()
        .filter(|signals| signals.spans.iter().all(|span| span.motor_position.is_none()))
        .map(|signals| signals.name.as_str())
        .collect();
    if !missing.is_empty() {
        findings.push(Finding::missing(
            "one-encoder",
            format!(
                "{}: no position of the motor beside that of the load: one encoder does not tell stiffness, inertia of the load and \
                 backlash from the inertia and the control",
                missing.join(", ")
            ),
            "record both encoders (channels position and motor_position)",
        ));
    }
    let is_new = |k: &usize| recordings[..*k].iter().all(|other| other.spans != recordings[*k].spans);
    let motions: Vec<TwoEncoderMotion> = (0..recordings.len())
        .filter(is_new)
        .map(|k| recordings[k])
        .flat_map(|signals| {
            signals.spans.iter().filter_map(|span| TwoEncoderMotion::new(span, signals, axis))
        })
        .collect();
    if motions.is_empty() {
        return None;
    }
    if motions.iter().all(TwoEncoderMotion::is_without_twist) {
        findings.push(Finding::missing(
            "no-wind-up",
            "no transmission: motor_position equals position in all recordings, as that of a rigid axis or of one encoder",
            "record the encoder of the load beside that of the motor",
        ));
        return None;
    }
    for (k, signals) in recordings.iter().enumerate() {
        if let Some(first) = recordings[..k].iter().find(|other| other.spans == signals.spans) {
            let what =
                format!("{} has the same samples as {}: it adds no information", signals.name, first.name);
            findings.push(Finding::warning("same-samples", what, "give each recording once"));
        }
    }
    let period = recordings.iter().map(|signals| signals.period).fold(0.0, f64::max);
    let fit = TransmissionSearch { motions: &motions, axis, sampling: period / seconds(periods.position) };
    match fit.run(findings) {
        Ok(found) => Some(found),
        Err(finding) => {
            findings.push(finding);
            None
        }
    }
}

/// Returns the finding about encoders that are not sampled at the same instant.
fn delay_finding(delay: ConfidenceInterval) -> Finding {
    let side = if delay.value > 0.0 { "older" } else { "newer" };
    Finding::warning(
        "encoder-delay",
        format!(
            "position is {:.3} ± {:.3} ms {side} than motor_position in the same row; the twist is corrected by the velocity \
             over this time",
            1e3 * delay.value.abs(),
            1e3 * (delay.bounds[1] - delay.value)
        ),
        "sample both encoders at the same instant",
    )
}

struct TransmissionSearch<'a> {
    motions: &'a [TwoEncoderMotion],
    axis: &'a AxisConfig,
    /// Longest sampling period, relative to the position cycle.
    sampling: f64,
}

impl TransmissionSearch<'_> {
    fn run(&self, findings: &mut Vec<Finding>) -> Result<TransmissionFit, Finding> {
        let has_tilt = self.axis.kind() == AxisKind::Rotary && self.axis.gravity.tilt != 0.0;
        let no_motion = || {
            Finding::missing(
                "no-wind-up",
                "no transmission: the recordings with both encoders contain no motion",
                "record a chirp of the setpoint and some reversals",
            )
        };
        let fits = |motions: &[TwoEncoderMotion]| {
            let closed = fit_contact(motions, has_tilt, Gap::Closed)?;
            Some((closed, fit_contact(motions, has_tilt, Gap::Free)?))
        };
        let (mut closed, mut free) = fits(self.motions).ok_or_else(no_motion)?;
        let delay = self.delay(&free, |motions| fit_contact(motions, has_tilt, Gap::Free));
        if let Some(delay) = delay {
            (closed, free) = fits(&self.without_delay(delay.value)).ok_or_else(no_motion)?;
        }
        let gap = self.gap(&free);
        let is_open = gap.is_some_and(|gap| gap.is_certain());
        let contact = if is_open { &free } else { &closed };
        let antiresonance =
            self.interval(&contact.stiffness, SYSTEMATIC, |stiffness| stiffness.max(0.0).sqrt() / TAU);
        if contact.stiffness.0 <= 0.0 {
            return Err(self.not_in_time());
        }
        // Without accelerations friction twists the transmission as a gap does.
        let by_acceleration = self.acceleration() / contact.stiffness.0;
        let is_seen = contact.spread.min(by_acceleration) >= NOISE * contact.noise;
        if !is_seen || !antiresonance.is_certain() {
            return Err(self.too_stiff(contact, antiresonance, is_seen));
        }
        findings.extend(delay.map(delay_finding));
        if contact.r_squared < EXPLAINED {
            return Err(Finding::missing(
                "poor-transmission",
                format!(
                    "no transmission: spring, damper, gap and friction explain {:.1} % of the acceleration of the load only",
                    100.0 * contact.r_squared
                ),
                "check units and signs of both positions; a structure that vibrates is not modeled",
            ));
        }
        match &free.widths {
            Ok(_) => {}
            Err(UnknownGap::OneFlank) => findings.push(Finding::warning(
                "one-flank",
                "backlash is not identified: the load rests on one side of the transmission in all recordings",
                "record reversals with accelerations or friction that move the load to the other side",
            )),
            Err(UnknownGap::LikeFriction) => findings.push(Finding::warning(
                "gap-or-friction",
                "backlash is not identified: these recordings do not tell it from the twist by friction at the load",
                "record accelerations about a steady motion, too",
            )),
        }
        let excluded_backlash = gap.filter(|_| !is_open).map(|gap| gap.bounds[1].max(0.0));
        // A gap that is unknown acts as friction at the load.
        let width_error = match (gap, &free.widths) {
            (Some(gap), _) if is_open => Some(gap.bounds[1] - gap.value),
            (Some(gap), _) => Some(gap.bounds[1].max(0.0)),
            (None, Err(UnknownGap::OneFlank)) => Some(0.0),
            (None, _) => None,
        };
        let masses = self.masses(contact, width_error);
        if masses.is_none() {
            findings.push(Finding::missing(
                "no-load-inertia",
                format!(
                    "stiffness and inertia of the load are not identified, only their antiresonance of {:.1} Hz: the recordings do \
                     not tell the inertia of the load from that of the motor",
                    antiresonance.value
                ),
                "record the current, at a period of 1 ms or less, with a chirp that reaches the antiresonance",
            ));
        }
        if masses.as_ref().is_some_and(|masses| masses.damping.is_none()) {
            let what = "the recordings do not determine the damping of the transmission: it is unchanged";
            findings.push(Finding::note("transmission-damping", what));
        }
        if masses.as_ref().is_some_and(|masses| masses.load_friction.is_none()) {
            let what =
                "the recordings do not determine the share of the friction at the load: it is unchanged";
            findings.push(Finding::note("load-friction", what));
        }
        Ok(TransmissionFit {
            antiresonance,
            masses,
            backlash: gap.filter(|_| is_open),
            excluded_backlash,
            r_squared: contact.r_squared,
        })
    }

    /// Returns the time by which the position of the load is older than that of the motor, s; none without a clear delay.
    fn delay(
        &self,
        first: &ContactFit,
        fit: impl Fn(&[TwoEncoderMotion]) -> Option<ContactFit>,
    ) -> Option<ConfidenceInterval> {
        let (mut delay, mut step) = (0.0, first.delay.0);
        if step.abs() < DELAY / 2.0 {
            return None;
        }
        for _ in 0..DELAY_STEPS {
            delay += step;
            let found = fit(&self.without_delay(delay))?;
            step = found.delay.0;
            if step.abs() < DELAY_SETTLED {
                let half = student(BLOCKS - 1) * scatter(&found.delay.1);
                let is_clear = delay.abs() > DELAY.max(2.0 * half) && found.r_squared > first.r_squared;
                return is_clear.then(|| ConfidenceInterval::about(delay, half));
            }
        }
        None
    }

    /// Returns the motions with the position of the motor at the instants of that of the load.
    fn without_delay(&self, delay: f64) -> Vec<TwoEncoderMotion> {
        self.motions.iter().map(|motion| motion.without_delay(delay)).collect()
    }

    /// Returns the width of the gap; none if it is unknown.
    fn gap(&self, fit: &ContactFit) -> Option<ConfidenceInterval> {
        let sizes = [fit.noise, fit.spread, fit.gap[1]];
        let shared = sizes.iter().zip(GAP).map(|(x, part)| x * part).fold(0.0, f64::hypot);
        let half = (student(BLOCKS - 1) * scatter(fit.widths.as_ref().ok()?)).hypot(INTERVAL * shared);
        Some(ConfidenceInterval::about(fit.gap[1], half))
    }

    /// Returns the finding about a twist that the encoders do not resolve.
    fn too_stiff(&self, fit: &ContactFit, antiresonance: ConfidenceInterval, is_seen: bool) -> Finding {
        let (unit, name) = match self.axis.kind() {
            AxisKind::Linear => (MICROMETER, "µm"),
            AxisKind::Rotary => (1.0, "rad"),
        };
        let what = format!(
            "no transmission: motor and load differ by {} {name} (standard deviation) in time with the acceleration, the encoders \
             resolve {} {name}; an antiresonance below {:.1} Hz is excluded",
            Rounded(fit.spread / unit),
            Rounded(fit.noise / unit),
            if !is_seen {
                // The acceleration would twist the transmission by more than the encoders resolve.
                self.acceleration().max(0.0).sqrt() / (NOISE * fit.noise).sqrt() / TAU
            } else {
                antiresonance.bounds[0].max(0.0)
            }
        );
        Finding::missing("no-wind-up", what, "record larger accelerations, or encoders of a finer resolution")
    }

    /// Returns the finding about positions whose difference does not follow the acceleration.
    fn not_in_time(&self) -> Finding {
        Finding::missing(
            "no-wind-up",
            "no transmission: the difference of the positions of motor and load does not follow the acceleration of the load",
            "check units and signs of both positions, and that motor_position is that of the motor at the axis",
        )
    }

    /// Returns the standard deviation of the acceleration, m/s² or rad/s².
    fn acceleration(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for motion in self.motions {
            for i in motion.samples() {
                sum += motion.load.second[i].powi(2);
                count += 1.0;
            }
        }
        f64::sqrt(sum / count)
    }

    /// Returns a function of a value, given also without each of the blocks, with its interval.
    fn interval(
        &self,
        (value, without): &(f64, Vec<f64>),
        [always, by_sampling]: [f64; 2],
        of: impl Fn(f64) -> f64,
    ) -> ConfidenceInterval {
        let parts: Vec<f64> = without.iter().map(|x| of(*x)).collect();
        let value = of(*value);
        let shared = always.hypot(by_sampling * self.sampling * self.sampling);
        let half = (student(BLOCKS - 1) * scatter(&parts)).hypot(INTERVAL * shared * value);
        ConfidenceInterval::about(value, half)
    }

    /// Returns the masses; none if the current does not tell them apart. `width_error` is that of the gap, m or rad, none if
    /// the gap is unknown.
    fn masses(&self, contact: &ContactFit, width_error: Option<f64>) -> Option<MassesFit> {
        let total: usize = self.motions.iter().map(|motion| motion.samples().len()).sum();
        // Accelerations of load and twist, friction, velocity, constant, sine and cosine of the position.
        let mut regression = BlockRegression::new(7, BLOCKS);
        let has_tilt = self.axis.kind() == AxisKind::Rotary;
        let (mut k, mut squares, mut law) = (0, [0.0; 2], [0.0; 2]);
        for motion in self.motions {
            for i in motion.samples() {
                k += 1;
                let Some(force) = motion.force.as_ref().map(|force| force[i]).filter(|f| !f.is_nan()) else {
                    continue;
                };
                let tilt = if has_tilt { motion.load.value[i].sin_cos() } else { (0.0, 0.0) };
                let row = [
                    motion.load.second[i],
                    motion.motor.second[i] - motion.load.second[i],
                    motion.friction[i],
                    motion.motor.first[i],
                    1.0,
                    tilt.0,
                    tilt.1,
                ];
                regression.add((k - 1) * BLOCKS / total, &row, force);
                squares[0] += row[0] * row[0];
                squares[1] += row[1] * row[1];
                law[0] += row[2] * row[3];
                law[1] += row[2] * row[2];
            }
        }
        // All of the friction as a part of the friction law.
        let along_law = if law[1] > 0.0 { law[0] / law[1] } else { 0.0 };
        let (all, without) = regression.jackknife(7, |c| [c[0], c[1], c[2] + c[3] * along_law])?;
        let load = (all[0] - all[1], without.iter().map(|c| c[0] - c[1]).collect::<Vec<f64>>());
        let sum = (all[0], without.iter().map(|c| c[0]).collect());
        let product = |of_load: &(f64, Vec<f64>)| {
            let parts = of_load.1.iter().zip(&load.1).map(|(x, mass)| x * mass);
            (of_load.0 * load.0, parts.collect::<Vec<f64>>())
        };
        let (stiffness, damping) = (product(&contact.stiffness), product(&contact.damping));
        let friction = product(&contact.load_friction);
        // Forces that the equation does not contain act as an inertia of the load if motor and load move as one.
        let by_forces = UNMODELED * all[0] / load.0 * f64::sqrt(squares[0] / squares[1]);
        let of_load = [WITH_CURRENT[0].hypot(by_forces), WITH_CURRENT[1]];
        let [stiffness, load] = [stiffness, load].map(|value| self.interval(&value, of_load, |x| x));
        let total = self.interval(&sum, WITH_CURRENT, |x| x);
        let damping = self.interval(&damping, OF_DAMPING, |x| x);
        let share = width_error.filter(|_| all[2] > 0.0).map(|error| {
            let of_all = without.iter().zip(&friction.1).map(|(c, part)| part / c[2]).collect();
            let share = self.interval(&(friction.0 / all[2], of_all), of_load, |x| x);
            let half = (share.bounds[1] - share.value)
                .hypot(error * contact.friction_by_width * load.value / all[2]);
            ConfidenceInterval::about(share.value, half)
        });
        let is_certain = [load, total, stiffness].iter().all(ConfidenceInterval::is_certain);
        let is_possible = load.value > 0.0 && load.value < total.value;
        (is_certain && is_possible).then_some(MassesFit {
            load,
            total,
            stiffness,
            damping: Some(damping).filter(|damping| damping.bounds[0] > 0.0),
            load_friction: share.and_then(ConfidenceInterval::as_share),
        })
    }
}
