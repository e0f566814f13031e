//! Stamps in order: what is no number is dropped, what steps back is put where it belongs.

use super::{Finding, RawRecording, RecordingFault};

/// Fewest samples of a recording: a fifth of a second at 6 ms.
const FEWEST: usize = 32;
/// Samples that lie before the latest stamp, from which on a step back is a clock that was set, not a
/// message that was overtaken.
const OVERTAKEN: usize = 20;
/// Part of a period by which stamps step back and still have the order of the file.
const JITTER: f64 = 0.9;
/// Periods left free where a clock was set: how long it really took is not known.
const CLOCK_STEP: f64 = 10.0;

/// Samples in the order of time.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Ordered {
    /// Where each is in the recording.
    pub rows: Vec<usize>,
    /// Its stamp, s; never less than the one before it.
    pub stamps: Vec<f64>,
}

/// The samples of `raw` in the order of their stamps.
///
/// # Errors
/// [`RecordingFault`] if there are too few, or the stamps are no time.
pub(super) fn ordered(raw: &RawRecording, findings: &mut Vec<Finding>) -> Result<Ordered, RecordingFault> {
    let name = || raw.name.clone();
    let too_few = |found| RecordingFault::TooFew { name: name(), found, wanted: FEWEST };
    if raw.time.len() < FEWEST {
        return Err(too_few(raw.time.len()));
    }
    let rows: Vec<usize> = (0..raw.time.len()).filter(|&row| raw.time[row].is_finite()).collect();
    let bad = raw.time.len() - rows.len();
    if 2 * bad > raw.time.len() {
        return Err(RecordingFault::StampsNotFinite { name: name(), bad, stamps: raw.time.len() });
    }
    if rows.len() < FEWEST {
        return Err(too_few(rows.len()));
    }
    if bad > 0 {
        let what = format!("{}: {bad} samples without a finite stamp are left out", raw.name);
        findings.push(Finding::warning("no-stamp", what, "look at the column of the time"));
    }
    let stamps: Vec<f64> = rows.iter().map(|&row| raw.time[row]).collect();
    if stamps.iter().all(|&stamp| stamp == stamps[0]) {
        return Err(RecordingFault::StampsEqual { name: name(), stamp: stamps[0] });
    }
    let back = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if 2 * back > stamps.len() {
        return Err(RecordingFault::StampsBackwards { name: name(), back, stamps: stamps.len() });
    }
    let mut ordered = Ordered { rows, stamps };
    if back > 0 {
        hold_jitter(&mut ordered.stamps);
        undo_clock_steps(&mut ordered, &raw.name, findings);
        sort(&mut ordered, &raw.name, findings);
    }
    Ok(ordered)
}

/// Leaves out rows that stand more than once: with the stamp and all values of the row before.
///
/// Where a stamp is repeated with other values the clock of the logger is coarser than its sampling, and such a recording
/// has equal rows only while nothing changes: then they stay.
pub(super) fn drop_copies<'a>(
    ordered: &mut Ordered,
    name: &str,
    columns: impl Iterator<Item = &'a Vec<f64>> + Clone,
    findings: &mut Vec<Finding>,
) {
    let is_repeated = |n: usize| ordered.stamps[n] == ordered.stamps[n - 1];
    let is_copy = |n: usize| {
        let (row, before) = (ordered.rows[n], ordered.rows[n - 1]);
        columns.clone().all(|values| values[row].to_bits() == values[before].to_bits())
    };
    let repeated: Vec<usize> = (1..ordered.stamps.len()).filter(|&n| is_repeated(n)).collect();
    if repeated.is_empty() || !repeated.iter().all(|&n| is_copy(n)) {
        return;
    }
    let mut copies = repeated.iter().copied().peekable();
    let keep: Vec<usize> = (0..ordered.stamps.len()).filter(|&n| copies.next_if_eq(&n).is_none()).collect();
    ordered.rows = keep.iter().map(|&n| ordered.rows[n]).collect();
    ordered.stamps = keep.iter().map(|&n| ordered.stamps[n]).collect();
    let what =
        format!("{name}: {} samples that are repeated, stamp and values, are left out", repeated.len());
    findings.push(Finding::note("duplicate-stamps", what));
}

/// Stamps that step back by less than a period are late stamps that jitter: the file has the order.
fn hold_jitter(stamps: &mut [f64]) {
    let period = period(stamps);
    let mut latest = f64::NEG_INFINITY;
    for stamp in stamps {
        if *stamp < latest && latest - *stamp < JITTER * period {
            *stamp = latest;
        }
        latest = *stamp;
    }
}

/// The middle of the steps forward.
fn period(stamps: &[f64]) -> f64 {
    median(&mut stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|d| *d > 0.0).collect::<Vec<_>>())
}

/// Where the clock was set back for good, what follows is moved behind what was before.
fn undo_clock_steps(ordered: &mut Ordered, name: &str, findings: &mut Vec<Finding>) {
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
        let what =
            format!("{name}: the clock steps back {count} times, first to {first} s; a gap is put there");
        let remedy = "record each run to a file of its own, with a clock that is not set meanwhile";
        findings.push(Finding::warning("clock-step", what, remedy));
    }
}

fn sort(ordered: &mut Ordered, name: &str, findings: &mut Vec<Finding>) {
    let back = ordered.stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if back == 0 {
        return;
    }
    let mut order: Vec<usize> = (0..ordered.stamps.len()).collect();
    order.sort_by(|&a, &b| ordered.stamps[a].total_cmp(&ordered.stamps[b]));
    ordered.rows = order.iter().map(|&n| ordered.rows[n]).collect();
    ordered.stamps = order.iter().map(|&n| ordered.stamps[n]).collect();
    let what = format!("{name}: {back} stamps step back; the samples are put in the order of their stamps");
    findings.push(Finding::warning("stamps-order", what, ""));
}

/// Median of `values`, which are left in another order; 0 of none.
pub(super) fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// The value below which the part `at` of `values` lies; they are left in another order; 0 of none.
pub(super) fn quantile(values: &mut [f64], at: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let place = ((values.len() - 1) as f64 * at).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}
