//! Samples that a logger repeats, since it samples faster than the control renews its signals.

use super::{Finding, RawRecording};
use virtual_axes_core::statistics::median;
use virtual_axes_core::units::{MILLISECOND, Rounded};

/// Share of the travel at one of several samples from which on the position is held between them.
const HELD: f64 = 0.95;
/// Largest number of samples for which a value is held.
const LONGEST: i64 = 40;

/// Returns the recording with one sample of each value that the logger holds; none if it holds none.
pub(super) fn without_held_samples(raw: &RawRecording, findings: &mut Vec<Finding>) -> Option<RawRecording> {
    let position = raw.position.as_ref().filter(|position| position.len() == raw.time.len())?;
    let mut intervals: Vec<f64> = raw.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let period = median(&mut intervals).filter(|period| *period > 0.0)?;
    let slot = |row: usize| ((raw.time[row] - raw.time[0]) / period).round() as i64;
    let (count, phase) =
        (2..=LONGEST).rev().find_map(|count| Some((count, held_phase(position, count, slot)?)))?;
    let kept: Vec<usize> = (0..raw.time.len()).filter(|row| slot(*row).rem_euclid(count) == phase).collect();
    let of = |channel: &[f64]| kept.iter().filter_map(|row| channel.get(*row).copied()).collect::<Vec<f64>>();
    let some = |channel: &Option<Vec<f64>>| channel.as_deref().map(of);
    findings.push(Finding::note(
        "held-samples",
        format!(
            "{}: the position is renewed every {count} samples, which is every {} ms: one sample of each value is used",
            raw.name,
            Rounded(count as f64 * period / MILLISECOND)
        ),
    ));
    Some(RawRecording {
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
    })
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
}
