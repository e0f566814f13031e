//! Samples that a logger repeats, since it samples faster than the control renews its signals.

use super::{Finding, RawRecording};
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

/// Returns the recording with the stamps of the instants at which the control renews its signals, and the period of these, s, if
/// the samples do not follow them and the position is much smoother over them; none otherwise.
pub(super) fn with_stamps_of_renewals(
    raw: &RawRecording,
    findings: &mut Vec<Finding>,
) -> Option<(RawRecording, f64)> {
    let position = raw.position.as_ref().filter(|position| position.len() == raw.time.len())?;
    let mut intervals: Vec<f64> = raw.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let period = median(&mut intervals).filter(|period| *period > 0.0)?;
    let period = (period / STEP).round() * STEP;
    if period <= 0.0 || raw.time.iter().any(|time| !time.is_finite()) {
        return None;
    }
    let slots: Vec<f64> = raw.time.iter().map(|time| ((time - raw.time[0]) / period).round()).collect();
    let nominal: Vec<f64> = slots.iter().map(|slot| slot * period).collect();
    let apart = raw.time.iter().zip(&nominal).map(|(time, slot)| (time - raw.time[0] - slot).abs());
    if mean(&apart.collect::<Vec<f64>>())? > JITTER * period {
        return None;
    }
    let shown = &nominal[..nominal.len().min(COMPARED)];
    let (before, count) = roughness(shown.iter().copied(), position, f64::INFINITY)?;
    if count < FEWEST {
        return None;
    }
    let renewed =
        |cycle: f64, phase: f64| move |time: &f64| ((time + phase) / cycle + 1e-6).floor() * cycle - phase;
    let cycles = (2..=LONGEST_CYCLE).map(|cycle| cycle as f64 * MILLISECOND).filter(|cycle| {
        let part = (period / cycle).fract();
        part.min(1.0 - part) > MOVED
    });
    let mut least = SMOOTHER * before;
    let mut found = None;
    for (cycle, k) in cycles.flat_map(|cycle| (0..PHASES).map(move |k| (cycle, k))) {
        let phase = k as f64 / PHASES as f64 * cycle;
        if let Some((sum, _)) = roughness(shown.iter().map(renewed(cycle, phase)), position, least) {
            (least, found) = (sum, Some((cycle, phase)));
        }
    }
    let (cycle, phase) = found?;
    findings.push(Finding::note(
        "held-samples",
        format!(
            "{}: the signals are renewed every {} ms, which the samples every {} ms do not follow: the samples are taken as \
             those of the renewals",
            raw.name,
            Rounded(cycle / MILLISECOND),
            Rounded(period / MILLISECOND)
        ),
    ));
    let stamps: Vec<f64> = nominal.iter().map(renewed(cycle, phase)).collect();
    let kept: Vec<usize> = (0..stamps.len()).filter(|k| *k == 0 || stamps[*k] > stamps[k - 1]).collect();
    let time = kept.iter().map(|k| raw.time[0] + stamps[*k]).collect();
    Some((RawRecording { time, ..rows_of(raw, &kept) }, cycle))
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
        let around = [a, b, d, e];
        let cubic: f64 = (0..4)
            .map(|k| {
                let others = (0..4).filter(|j| *j != k);
                let weight: f64 = others.map(|j| (c.0 - around[j].0) / (around[k].0 - around[j].0)).product();
                weight * around[k].1
            })
            .sum();
        sum += (c.1 - cubic).abs();
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
    fn uniform_samples_keep_their_stamps() {
        for period in [2e-3, 4e-3, 20e-3] {
            // The samples of a control that renews its signals with each of them.
            let (raw, _) = held(period, period, 0.0);
            assert!(with_stamps_of_renewals(&raw, &mut Vec::new()).is_none(), "{period}");
        }
    }
}
