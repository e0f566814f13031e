//! Ordering of samples by their stamps: drops non-finite stamps, removes clock steps, sorts late samples.

use super::{ConditioningError, Finding, RawRecording};
use virtual_axes_core::statistics::{mean, median};
use virtual_axes_core::units::Rounded;

/// Fewest samples of a recording: 0.2 s at 6 ms.
const FEWEST: usize = 32;
/// Number of samples behind a backward step that shows a clock step rather than a late sample.
const OVERTAKEN: usize = 20;
/// Backward step in periods up to which the order of the file is kept.
const JITTER: f64 = 0.9;
/// Sum of all steps of the stamps, relative to their range, above which the rows are in no order.
const SHUFFLED: f64 = 4.0;
/// Motion between rows of one stamp, relative to that between stamps, below which the rows of a stamp are one sample.
const SAME_SAMPLE: f64 = 0.1;
/// Gap in periods inserted at a clock step, whose true length is unknown.
const CLOCK_STEP: f64 = 10.0;

/// Samples in order of time.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct OrderedSamples {
    /// Row of each sample in the recording.
    pub rows: Vec<usize>,
    /// Stamp of each sample, s; non-decreasing.
    pub stamps: Vec<f64>,
}

/// Orders the samples of `raw` by their stamps.
///
/// # Errors
/// [`ConditioningError`] if there are too few samples, or if the stamps are not finite, all equal or mostly
/// decreasing.
pub(super) fn sort_samples(
    raw: &RawRecording,
    findings: &mut Vec<Finding>,
) -> Result<OrderedSamples, ConditioningError> {
    let error = |reason: String| ConditioningError::new(&raw.name, reason);
    let too_few = |found: usize| {
        error(format!(
            "{found} samples, at least {FEWEST} are required; the file is likely empty or truncated"
        ))
    };
    if raw.time.len() < FEWEST {
        return Err(too_few(raw.time.len()));
    }
    let rows: Vec<usize> = (0..raw.time.len()).filter(|&row| raw.time[row].is_finite()).collect();
    let bad = raw.time.len() - rows.len();
    if 2 * bad > raw.time.len() {
        return Err(error(format!(
            "{bad} of {} stamps are not finite; check the time column",
            raw.time.len()
        )));
    }
    if rows.len() < FEWEST {
        return Err(too_few(rows.len()));
    }
    if bad > 0 {
        let what = format!("{}: {bad} samples with non-finite stamps dropped", raw.name);
        findings.push(Finding::warning("no-stamp", what, "check the time column"));
    }
    let stamps: Vec<f64> = rows.iter().map(|&row| raw.time[row]).collect();
    if stamps.iter().all(|&stamp| stamp == stamps[0]) {
        return Err(error(format!("every stamp is {} s; check the time column", Rounded(stamps[0]))));
    }
    let back = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let count = stamps.len();
    let range =
        stamps.iter().fold(f64::MIN, |a, b| a.max(*b)) - stamps.iter().fold(f64::MAX, |a, b| a.min(*b));
    let path: f64 = stamps.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let is_shuffled = 4 * back > count && path > SHUFFLED * range;
    if 2 * back > count || is_shuffled {
        return Err(error(format!(
            "{back} of {count} stamps are earlier than the one before; sort the rows by time, or check the time column"
        )));
    }
    let mut ordered = OrderedSamples { rows, stamps };
    if back > 0 {
        flatten_jitter(&mut ordered.stamps);
        remove_clock_steps(&mut ordered, &raw.name, findings);
        sort(&mut ordered, &raw.name, findings);
    }
    Ok(ordered)
}

/// Drops duplicate rows: same stamp and same values as the row before; also with other values if the axis moves between
/// stamps only, as after two recordings of one motion were joined.
///
/// Other repeated stamps with different values mean that the clock of the logger is coarser than its sampling.
/// Equal rows of such a recording are kept; they are samples at standstill.
pub(super) fn drop_copies<'a>(
    ordered: &mut OrderedSamples,
    name: &str,
    position: Option<&Vec<f64>>,
    columns: impl Iterator<Item = &'a Vec<f64>> + Clone,
    findings: &mut Vec<Finding>,
) {
    let is_repeated = |n: usize| ordered.stamps[n] == ordered.stamps[n - 1];
    let is_copy = |n: usize| {
        let (row, before) = (ordered.rows[n], ordered.rows[n - 1]);
        columns.clone().all(|values| values[row].to_bits() == values[before].to_bits())
    };
    let repeated: Vec<usize> = (1..ordered.stamps.len()).filter(|&n| is_repeated(n)).collect();
    let are_copies = repeated.iter().all(|&n| is_copy(n));
    let is_joined = position.is_some_and(|position| {
        let step = |n: usize| (position[ordered.rows[n]] - position[ordered.rows[n - 1]]).abs();
        let mean_step = |has_stamp: bool| {
            let steps = (1..ordered.stamps.len()).filter(|&n| is_repeated(n) == has_stamp).map(step);
            mean(&steps.filter(|step| step.is_finite()).collect::<Vec<_>>())
        };
        // A held position does not move within a stamp at all.
        matches!((mean_step(true), mean_step(false)), (Some(w), Some(b)) if w > 0.0 && w < SAME_SAMPLE * b)
    });
    if repeated.is_empty() || !(are_copies || is_joined) {
        return;
    }
    let mut copies = repeated.iter().copied().peekable();
    let keep: Vec<usize> = (0..ordered.stamps.len()).filter(|&n| copies.next_if_eq(&n).is_none()).collect();
    ordered.rows = keep.iter().map(|&n| ordered.rows[n]).collect();
    ordered.stamps = keep.iter().map(|&n| ordered.stamps[n]).collect();
    findings.push(if are_copies {
        let what = format!("{name}: {} duplicate samples (same stamp and values) dropped", repeated.len());
        Finding::note("duplicate-stamps", what)
    } else {
        let what = format!(
            "{name}: {} rows have the stamp of the row before and nearly its position; the first row of each stamp is used",
            repeated.len()
        );
        Finding::warning("duplicate-stamps", what, "give each recording by itself")
    });
}

/// Replaces stamps that step back by less than a period with the latest stamp; the order of the file is kept.
fn flatten_jitter(stamps: &mut [f64]) {
    let period = period(stamps);
    let mut latest = f64::NEG_INFINITY;
    for stamp in stamps {
        if *stamp < latest && latest - *stamp < JITTER * period {
            *stamp = latest;
        }
        latest = *stamp;
    }
}

/// Returns the median of the positive steps.
fn period(stamps: &[f64]) -> f64 {
    median(&mut stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|d| *d > 0.0).collect::<Vec<_>>())
        .unwrap_or(0.0)
}

/// Shifts all samples behind a backward clock step so that they follow the samples before it.
fn remove_clock_steps(ordered: &mut OrderedSamples, name: &str, findings: &mut Vec<Finding>) {
    let stamps = &mut ordered.stamps;
    let period = period(stamps);
    let (mut latest, mut shift, mut count, mut first) = (stamps[0], 0.0, 0_usize, f64::NAN);
    for n in 1..stamps.len() {
        let stamp = stamps[n] + shift;
        let ahead = &stamps[n..];
        let behind =
            ahead.len() >= OVERTAKEN && ahead[..OVERTAKEN].iter().all(|later| later + shift < latest);
        if behind {
            if count == 0 {
                first = stamps[n];
            }
            count += 1;
            shift += latest + CLOCK_STEP * period - stamp;
        }
        stamps[n] += shift;
        latest = latest.max(stamps[n]);
    }
    if count > 0 {
        let what = format!(
            "{name}: the clock steps back {count} times, first to {first:.3} s; a gap is inserted there"
        );
        let remedy = "record each run to a separate file, and do not set the clock during a recording";
        findings.push(Finding::warning("clock-step", what, remedy));
    }
}

fn sort(ordered: &mut OrderedSamples, name: &str, findings: &mut Vec<Finding>) {
    let back = ordered.stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if back == 0 {
        return;
    }
    let mut order: Vec<usize> = (0..ordered.stamps.len()).collect();
    order.sort_by(|&a, &b| ordered.stamps[a].total_cmp(&ordered.stamps[b]));
    ordered.rows = order.iter().map(|&n| ordered.rows[n]).collect();
    ordered.stamps = order.iter().map(|&n| ordered.stamps[n]).collect();
    let what = format!("{name}: {back} stamps step back; the samples are sorted by their stamps");
    findings.push(Finding::warning("stamps-order", what, ""));
}
