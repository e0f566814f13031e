//! Experiments from recordings of any program at any sampling period.

use super::experiment::{CurrentLogging, Experiment};
use super::feedforward_mode::FeedforwardMode;
use super::resample::BandLimitedSpline;
use super::setpoints::{HELD, SetpointGrid};
use crate::recording::Signals;
use virtual_axes_core::config::Periods;
use virtual_axes_core::units::seconds;

/// Duration of the acceleration from rest to the velocity at the first sample, s.
const RUN_UP: f64 = 0.5;
/// Rest before the run-up, s.
const REST: f64 = 0.1;
/// Time after the first sample until the simulation has settled, s.
const SETTLING: f64 = 0.3;
/// Samples before the end of a span that are left out: if it ends in motion, the interpolation errs there by the
/// unknown curvature, half as much with each sample from the end.
const ENDING: usize = 6;
/// Shortest span that is simulated, s.
const SHORTEST: f64 = 1.0;

/// Returns the spans of a recording as experiments with PSEC at the position cycles: the setpoints themselves, if the
/// recording shows each of them, otherwise interpolated. The control logs actual values `shift` s late. `logging` is that of
/// the recorded current.
///
/// A span can begin in motion, after a gap for instance: the simulation accelerates from rest to its first velocity, and
/// the samples until it has settled are left out.
pub(super) fn trace_experiments(
    signals: &Signals,
    recording: usize,
    periods: &Periods,
    (mode, shift, logging): (FeedforwardMode, f64, CurrentLogging),
) -> Vec<Experiment> {
    let (tsp, period) = (seconds(periods.position), signals.period);
    let skipped = (SETTLING / period).ceil() as usize;
    let before = ((RUN_UP + REST) / tsp).ceil() * tsp;
    let mut found = Vec::new();
    for (number, span) in signals.spans.iter().enumerate() {
        let Some(recorded) = &span.psec else { continue };
        if (span.position.len() as f64) * period < SHORTEST {
            continue;
        }
        // Setpoints that are held between samples are those of the position cycles.
        let held = SetpointGrid::of(span, period, tsp).filter(|_| period < HELD * tsp);
        let (knots, distance, origin) = match &held {
            Some(grid) => (&grid.values, tsp, grid.first),
            None => (recorded, period, 0.0),
        };
        let spline = BandLimitedSpline::new(knots, distance);
        let [start, velocity] = spline.at(0.0);
        let end = before + (knots.len() - 1) as f64 * distance;
        let cycles = (end / tsp).ceil() as usize + 1;
        let setpoint = |k: usize| {
            let t = k as f64 * tsp - before;
            if t >= 0.0 { spline.at(t)[0] } else { start - velocity * RUN_UP * run_up(t / RUN_UP + 1.0) }
        };
        let kept = skipped..span.position.len().saturating_sub(ENDING);
        let of = |channel: &[f64]| channel.get(kept.clone()).unwrap_or_default().to_vec();
        found.push(Experiment {
            recording,
            span: number,
            sample: skipped,
            mode,
            cycle: tsp,
            psec: (0..cycles).map(setpoint).collect(),
            first: before - origin + skipped as f64 * period - shift,
            period,
            trace_filter: signals.trace_filter,
            logging,
            start: span.start + skipped as f64 * period,
            position: of(&span.position),
            velocity: of(span.recorded_velocity.as_ref().unwrap_or(&span.velocity)),
            current: span.current.as_deref().map(of),
        });
    }
    found
}

/// Returns the distance to the end of a run-up of duration 1 to velocity 1, whose velocity is 3u² − 2u³.
fn run_up(u: f64) -> f64 {
    let u = u.max(0.0);
    0.5 - u.powi(3) + 0.5 * u.powi(4)
}
