//! Samples that a logger repeats, since it samples faster than the control renews its signals.

use super::{Finding, RawRecording, SetpointCycles};
use virtual_axes_core::statistics::{mean, median};
use virtual_axes_core::units::{MILLISECOND, Rounded};

/// Share of the travel at one of several samples from which on the position is held between them.
const HELD: f64 = 0.95;
/// Largest number of samples for which a value is held.
const LONGEST: i64 = 40;
/// Longest time for which a control holds its signals, and step of the compared times, ms.
const LONGEST_CYCLE: i64 = 20;
/// Number of compared phases of such a cycle.
const PHASES: i64 = 12;
/// Roughness of the position over the instants at which it is renewed, relative to that over the stamps, from which on
/// the samples are those of these instants.
const SMOOTHER: f64 = 0.3;
/// Roughness relative to the least one up to which phases are alike.
const ALIKE: f64 = 1.01;
/// Largest mean distance of the stamps from uniform ones, in sampling periods.
const JITTER: f64 = 0.1;
/// Fewest samples that show it, and most that are compared.
const FEWEST: usize = 40;
const COMPARED: usize = 20_000;
/// Resolution of the sampling period of a control, s.
const STEP: f64 = 0.25e-3;
/// Duration of five samples relative to an interval in their middle from which on they have a gap.
const GAP: f64 = 6.0;
/// Smallest part of a cycle by which the samples move.
const MOVED: f64 = 0.01;

/// Returns the recording with one sample of each value that the logger holds; none if it holds none.
pub(super) fn without_held_samples(raw: &RawRecording, findings: &mut Vec<Finding>) -> Option<RawRecording> {
    let position = raw.position.as_ref().filter(|position| position.len() == raw.time.len())?;
    let mut intervals: Vec<f64> = raw.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let period = median(&mut intervals).filter(|period| *period > 0.0)?;
    let slot = |row: usize| ((raw.time[row] - raw.time[0]) / period).round() as i64;
    let (count, phase) =
        (2..=LONGEST).rev().find_map(|count| Some((count, held_phase(position, count, slot)?)))?;
    let kept: Vec<usize> = (0..raw.time.len()).filter(|row| slot(*row).rem_euclid(count) == phase).collect();
    findings.push(Finding::note(
        "held-samples",
        format!(
            "{}: the position is renewed every {count} samples, which is every {} ms: one sample of each value is used",
            raw.name,
            Rounded(count as f64 * period / MILLISECOND)
        ),
    ));
    Some(rows_of(raw, &kept))
}

/// Returns the samples `kept` of a recording.
fn rows_of(raw: &RawRecording, kept: &[usize]) -> RawRecording {
    let of = |channel: &[f64]| kept.iter().filter_map(|row| channel.get(*row).copied()).collect::<Vec<f64>>();
    let some = |channel: &Option<Vec<f64>>| channel.as_deref().map(of);
    RawRecording {
        name: raw.name.clone(),
        time: of(&raw.time),
        psec: some(&raw.psec),
        position: some(&raw.position),
        velocity: some(&raw.velocity),
        current: some(&raw.current),
        torque: some(&raw.torque),
        velocity_feedforward: some(&raw.velocity_feedforward),
        torque_feedforward: some(&raw.torque_feedforward),
        motor_position: some(&raw.motor_position),
    }
}

/// Instants at which the control renews a signal, if the samples do not follow them.
struct Renewals {
    /// Sampling period, s.
    period: f64,
    /// Instants of the samples by the period, and of the renewals whose values they show, s from the first sample.
    nominal: Vec<f64>,
    stamps: Vec<f64>,
    /// Period of the renewals, and time of the first sample behind one, s.
    cycle: f64,
    phase: f64,
}

impl Renewals {
    /// Searches the renewals over which `signal` is much smoother than over the stamps.
    fn of(time: &[f64], signal: Option<&Vec<f64>>) -> Option<Self> {
        let signal = signal.filter(|signal| signal.len() == time.len())?;
        let mut intervals: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let period = median(&mut intervals).filter(|period| *period > 0.0)?;
        let period = (period / STEP).round() * STEP;
        if period <= 0.0 || time.iter().any(|time| !time.is_finite()) {
            return None;
        }
        let nominal: Vec<f64> = time.iter().map(|at| ((at - time[0]) / period).round() * period).collect();
        let apart = time.iter().zip(&nominal).map(|(at, slot)| (at - time[0] - slot).abs());
        if mean(&apart.collect::<Vec<f64>>())? > JITTER * period {
            return None;
        }
        let shown = &nominal[..nominal.len().min(COMPARED)];
        let (before, count) = roughness(shown.iter().copied(), signal, f64::INFINITY)?;
        if count < FEWEST {
            return None;
        }
        let renewed = |cycle: f64, phase: f64| {
            move |time: &f64| ((time + phase) / cycle + 1e-6).floor() * cycle - phase
        };
        let cycles = (2..=LONGEST_CYCLE).map(|cycle| cycle as f64 * MILLISECOND).filter(|cycle| {
            let part = (period / cycle).fract();
            part.min(1.0 - part) > MOVED
        });
        let mut least = SMOOTHER * before;
        let mut found = None;
        for (cycle, k) in cycles.flat_map(|cycle| (0..PHASES).map(move |k| (cycle, k))) {
            let phase = k as f64 / PHASES as f64 * cycle;
            if let Some((sum, _)) = roughness(shown.iter().map(renewed(cycle, phase)), signal, least) {
                (least, found) = (sum, Some((cycle, phase)));
            }
        }
        let (cycle, first) = found?;
        let phase = middle_phase(cycle, first, |phase| {
            let sum = roughness(shown.iter().map(renewed(cycle, phase)), signal, f64::INFINITY);
            sum.is_some_and(|(sum, _)| sum <= ALIKE * least)
        });
        let stamps = nominal.iter().map(renewed(cycle, phase)).collect();
        Some(Self { period, nominal, stamps, cycle, phase })
    }

    /// Returns the samples that show a value for the first time.
    fn first_samples(&self) -> Vec<usize> {
        (0..self.stamps.len()).filter(|k| *k == 0 || self.stamps[*k] > self.stamps[k - 1]).collect()
    }

    /// Returns a signal at the instants of the samples, interpolated between the renewals.
    fn interpolated(&self, signal: &[f64]) -> Vec<f64> {
        let points: Vec<(f64, f64)> =
            self.first_samples().into_iter().map(|k| (self.stamps[k], signal[k])).collect();
        let value = |at: &f64| {
            let next = points.partition_point(|(stamp, _)| stamp <= at);
            let from = next.saturating_sub(2).min(points.len().saturating_sub(4));
            let near = &points[from..points.len().min(from + 4)];
            // A cubic is far off beside a gap.
            let is_gap = near.windows(2).any(|pair| pair[1].0 - pair[0].0 > GAP * self.period);
            let pair = next.saturating_sub(1).min(points.len().saturating_sub(2));
            lagrange(if is_gap { &points[pair..points.len().min(pair + 2)] } else { near }, *at)
        };
        self.nominal.iter().map(value).collect()
    }
}

/// Returns the middle of the phases around `first` that the samples show alike.
fn middle_phase(cycle: f64, first: f64, is_alike: impl Fn(f64) -> bool) -> f64 {
    let step = cycle / PHASES as f64;
    let reach = |sign: f64| {
        let alike = (1..PHASES)
            .map(|k| sign * k as f64 * step)
            .take_while(|by| is_alike((first + by).rem_euclid(cycle)));
        alike.last().unwrap_or(0.0)
    };
    (first + 0.5 * (reach(1.0) + reach(-1.0))).rem_euclid(cycle)
}

/// Returns the polynomial through `points` (instant, value) at an instant.
fn lagrange(points: &[(f64, f64)], at: f64) -> f64 {
    let weight = |k: usize| {
        let others = (0..points.len()).filter(|j| *j != k);
        others.map(|j| (at - points[j].0) / (points[k].0 - points[j].0)).product::<f64>()
    };
    points.iter().enumerate().map(|(k, (_, value))| weight(k) * value).sum()
}

/// Returns the recording with the stamps of the instants at which the control renews its signals, and the period of these, s, if
/// the samples do not follow them and the position is much smoother over them; none otherwise.
pub(super) fn with_stamps_of_renewals(
    raw: &RawRecording,
    findings: &mut Vec<Finding>,
) -> Option<(RawRecording, f64)> {
    let renewals = Renewals::of(&raw.time, raw.position.as_ref())?;
    findings.push(Finding::note(
        "held-samples",
        format!(
            "{}: the signals are renewed every {} ms, which the samples every {} ms do not follow: the samples are taken as \
             those of the renewals",
            raw.name,
            Rounded(renewals.cycle / MILLISECOND),
            Rounded(renewals.period / MILLISECOND)
        ),
    ));
    let kept = renewals.first_samples();
    let time = kept.iter().map(|k| raw.time[0] + renewals.stamps[*k]).collect();
    Some((RawRecording { time, ..rows_of(raw, &kept) }, renewals.cycle))
}

/// Returns the recording with setpoints interpolated between the position cycles, and these cycles, if the control holds its
/// setpoints for cycles that are shorter than the sampling period and no fraction of it; none otherwise.
pub(super) fn with_interpolated_setpoints(
    raw: &RawRecording,
    findings: &mut Vec<Finding>,
) -> Option<(RawRecording, SetpointCycles)> {
    let renewals = Renewals::of(&raw.time, raw.psec.as_ref())?;
    // The samples show each cycle that is longer.
    if renewals.cycle > renewals.period {
        return None;
    }
    findings.push(Finding::note(
        "held-setpoints",
        format!(
            "{}: the setpoints are renewed every {} ms, which the samples every {} ms do not follow: they are interpolated \
             between the renewals",
            raw.name,
            Rounded(renewals.cycle / MILLISECOND),
            Rounded(renewals.period / MILLISECOND)
        ),
    ));
    let setpoint = |channel: &Option<Vec<f64>>| {
        let whole = channel.as_ref().filter(|channel| channel.len() == raw.time.len());
        whole.map(|channel| renewals.interpolated(channel)).or_else(|| channel.clone())
    };
    let recording = RawRecording {
        psec: setpoint(&raw.psec),
        velocity_feedforward: setpoint(&raw.velocity_feedforward),
        torque_feedforward: setpoint(&raw.torque_feedforward),
        ..raw.clone()
    };
    let begin = raw.time.first()? - renewals.phase;
    Some((recording, SetpointCycles { period: renewals.cycle, begin }))
}

/// Returns the sum of the distances of the position from a cubic through the four samples around each, and their number; none if
/// the sum is not below `limit`. Samples with one stamp count with their difference.
fn roughness(stamps: impl Iterator<Item = f64>, position: &[f64], limit: f64) -> Option<(f64, usize)> {
    let mut sum = 0.0;
    let mut count = 0;
    let mut distinct: Vec<(f64, f64)> = Vec::new();
    for (time, value) in stamps.zip(position).filter(|(_, value)| value.is_finite()) {
        match distinct.last() {
            Some((last, known)) if time <= *last => sum += (value - known).abs(),
            _ => distinct.push((time, *value)),
        }
        if sum >= limit {
            return None;
        }
    }
    for five in distinct.windows(5) {
        let [a, b, c, d, e] = [five[0], five[1], five[2], five[3], five[4]];
        // Gaps and standstills show nothing.
        if e.0 - a.0 > GAP * (c.0 - b.0).min(d.0 - c.0) || e.1 == a.1 {
            continue;
        }
        sum += (c.1 - lagrange(&[a, b, d, e], c.0)).abs();
        count += 1;
        if sum >= limit {
            return None;
        }
    }
    (sum < limit).then_some((sum, count))
}

/// Returns the phase, among `count` samples, at which the position changes if it is held between them. A position that
/// moves every time at that phase is no accident.
fn held_phase(position: &[f64], count: i64, slot: impl Fn(usize) -> i64) -> Option<i64> {
    let mut travel = vec![0.0; usize::try_from(count).ok()?];
    for (row, pair) in position.windows(2).enumerate() {
        let step = (pair[1] - pair[0]).abs();
        // A gap has the travel of all missing samples.
        if step.is_finite() && slot(row + 1) - slot(row) == 1 {
            travel[slot(row + 1).rem_euclid(count) as usize] += step;
        }
    }
    let all: f64 = travel.iter().sum();
    let (phase, most) = travel.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    (all > 0.0 && *most >= HELD * all).then_some(phase as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_of_each_held_value_is_kept_also_behind_a_gap() {
        let rows: Vec<usize> = (0..400).filter(|i| !(100..117).contains(i)).collect();
        let raw = RawRecording {
            time: rows.iter().map(|i| *i as f64 * 1e-3).collect(),
            position: Some(rows.iter().map(|i| (((i + 2) / 4) as f64 * 0.1).sin()).collect()),
            current: Some(rows.iter().map(|i| *i as f64).collect()),
            ..RawRecording::default()
        };
        let found = without_held_samples(&raw, &mut Vec::new()).expect("held samples");
        let currents = found.current.expect("a current");
        assert!(currents.iter().all(|row| (*row as usize + 2).is_multiple_of(4)), "{currents:?}");
        assert!((95..=96).contains(&found.time.len()), "{}", found.time.len());
    }

    #[test]
    fn a_position_that_moves_with_each_sample_is_kept() {
        let raw = RawRecording {
            time: (0..400).map(|i| f64::from(i) * 1e-3).collect(),
            position: Some((0..400).map(|i| (f64::from(i) * 0.03).sin()).collect()),
            ..RawRecording::default()
        };
        assert!(without_held_samples(&raw, &mut Vec::new()).is_none());
    }

    /// Position at samples every `period` s of signals that are renewed every `cycle` s, first `phase` s ahead of the first sample.
    fn held(cycle: f64, period: f64, phase: f64) -> (RawRecording, impl Fn(f64) -> f64) {
        let renewal = move |time: f64| ((time + phase) / cycle + 1e-6).floor() * cycle - phase;
        let at = |time: f64| 0.2 * (3.0 * time).sin();
        let time: Vec<f64> = (0..500).map(|i| f64::from(i) * period).collect();
        let position = time.iter().map(|time| at(renewal(*time))).collect();
        (RawRecording { time, position: Some(position), ..RawRecording::default() }, at)
    }

    #[test]
    fn samples_that_do_not_follow_the_renewals_have_their_stamps() {
        for (cycle, period, phase) in [(6e-3, 4e-3, 0.0), (6e-3, 10e-3, 2e-3), (6e-3, 20e-3, 4e-3)] {
            let (raw, at) = held(cycle, period, phase);
            let (found, renewal) = with_stamps_of_renewals(&raw, &mut Vec::new()).expect("renewals");
            assert!((renewal - cycle).abs() < 1e-9, "{period}: {renewal}");
            // A constant shift of the stamps is that of the first sample within its cycle.
            let shift = |time: f64, value: f64| (value - at(time)) / (0.6 * (3.0 * time).cos());
            let positions = found.position.as_ref().expect("positions");
            let steep = found.time.iter().zip(positions).filter(|(time, _)| (3.0 * **time).cos().abs() > 0.9);
            let shifts: Vec<f64> = steep.map(|(time, value)| shift(*time, *value)).collect();
            let low = shifts.iter().copied().fold(f64::INFINITY, f64::min);
            let high = shifts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!(high - low < 0.1e-3 && low > -cycle, "{period}: {low} to {high}");
            assert!(found.time.windows(2).all(|pair| pair[1] > pair[0] + 0.9 * cycle), "{period}");
        }
    }

    #[test]
    fn setpoints_that_the_samples_do_not_follow_are_interpolated_between_their_cycles() {
        for (cycle, period, phase) in [(6e-3, 10e-3, 2e-3), (4e-3, 10e-3, 1e-3), (6e-3, 20e-3, 5e-3)] {
            let (raw, at) = held(cycle, period, phase);
            let position = raw.time.iter().map(|time| at(*time - 0.015)).collect();
            let recorded = raw.position.clone();
            let raw = RawRecording { psec: raw.position, position: Some(position), ..raw };
            assert!(with_stamps_of_renewals(&raw, &mut Vec::new()).is_none(), "{period}");
            let (found, cycles) = with_interpolated_setpoints(&raw, &mut Vec::new()).expect("cycles");
            assert_eq!((&found.position, &found.time), (&raw.position, &raw.time));
            assert!((cycles.period - cycle).abs() < 1e-9, "{period}: {}", cycles.period);
            // The samples bound the phase to the distances that occur, of which the cycle and the period have a common one.
            let behind = raw.time[0] - cycles.begin;
            assert!((behind - phase).abs() <= 2e-3 && (0.0..cycle).contains(&behind), "{period}: {behind}");
            // A constant delay by the remaining phase is left, not the steps of up to a cycle.
            let deviations = |setpoints: &[f64]| {
                let delay = phase - behind;
                let pairs = raw.time.iter().zip(setpoints);
                let within = pairs.take(490).map(|(time, value)| (value - at(*time - delay)).abs());
                within.fold(0.0, f64::max)
            };
            let (before, after) = (
                deviations(recorded.as_ref().expect("held")),
                deviations(found.psec.as_ref().expect("setpoints")),
            );
            assert!(after < 1e-5 && before > 50.0 * after, "{period}: {before} to {after}");
        }
    }

    #[test]
    fn uniform_samples_keep_their_stamps() {
        for period in [2e-3, 4e-3, 20e-3] {
            // The samples of a control that renews its signals with each of them.
            let (raw, _) = held(period, period, 0.0);
            assert!(with_stamps_of_renewals(&raw, &mut Vec::new()).is_none(), "{period}");
        }
    }
}
