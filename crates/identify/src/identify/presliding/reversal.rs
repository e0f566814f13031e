//! Friction current at one reversal, recorded and modeled.

use super::super::fit::fit_linear;
use super::super::reversals::{Leg, ReversingMotion};
use crate::recording::{GaussianFilter, SignalSpan, Signals, deviation};
use virtual_axes_core::config::AxisConfig;

/// Window on both sides of a reversal, in lengths of presliding: exp(−6) of the friction is left.
pub(super) const WINDOW: f64 = 6.0;

/// Span with current and its turning points.
pub(super) struct SpanMotion<'a> {
    pub signals: &'a Signals,
    pub motion: ReversingMotion,
    /// Recorded position, m or rad.
    pub position: &'a [f64],
    /// Recorded current without gravity, A.
    pub current: Vec<f64>,
    /// Inertia as current per acceleration, A/(m/s²) or A/(rad/s²).
    pub inertia: f64,
    /// Friction current of the law at the speed of each sample, A.
    pub law: Vec<f64>,
}

impl<'a> SpanMotion<'a> {
    pub fn new(span: &'a SignalSpan, signals: &'a Signals, axis: &AxisConfig) -> Option<Self> {
        let current = span.current.as_deref()?;
        let motion = ReversingMotion::new(span, signals)?;
        let (law, unit) = (&axis.friction, axis.units().speed);
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
    pub fn friction_at(&self, filter: &GaussianFilter, index: usize) -> Option<f64> {
        let acceleration = filter.second_at(self.position, index)?;
        Some(filter.value_at(&self.current, index)? - self.inertia * acceleration)
    }

    /// Returns the current of the bristles, A, and its rate, A/s, on two legs, for a stiffness, A/m or A/rad.
    pub fn bristles(&self, legs: [&Leg; 2], stiffness: f64) -> [Vec<f64>; 2] {
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
pub(super) struct Reversal<'a> {
    pub motion: &'a SpanMotion<'a>,
    pub before: &'a Leg,
    pub after: &'a Leg,
    /// Shorter travel of the two legs, m or rad.
    pub travel: f64,
    /// Shortest length that the samples after the reversal resolve, m or rad.
    pub resolved: f64,
}

impl Reversal<'_> {
    /// Fits the reversal at trial lengths; window and filter are those of `length`, and `level` is its friction current, A.
    pub fn fit(&self, length: f64, lengths: &[f64], level: f64, cutoff: f64) -> Vec<ReversalFit> {
        let Reversal { before, after, motion, .. } = self;
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
            let stiffness = level / trial;
            let [force, rate] = motion.bristles([before, after], stiffness);
            let row = |&(i, measured): &(usize, f64)| {
                let (force, rate) = (filter.value_at(&force, i)?, filter.value_at(&rate, i)?);
                Some((vec![1.0, force, rate / stiffness], measured, 1.0))
            };
            ReversalFit::new(&rows.iter().filter_map(row).collect::<Vec<_>>())
        };
        lengths.iter().map(at).collect()
    }
}

/// Linear fit of one reversal at one length.
pub(super) struct ReversalFit {
    pub squares: f64,
    /// Friction level relative to the law; damping, A/(m/s) or A/(rad/s).
    pub level: f64,
    pub damping: f64,
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
