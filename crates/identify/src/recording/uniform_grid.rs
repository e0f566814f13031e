//! Assignment of stamped samples to a uniform time grid.
//!
//! A controller samples uniformly; the stamps of the logger jitter. Late samples followed by a burst of short
//! intervals were taken in time; a long interval without a burst means missing samples.

use std::ops::Range;

use super::ordering::OrderedSamples;
use super::sampling::{REGULAR, check_period, coarse_step, estimate_period};
use super::{ConditioningError, Finding};
use virtual_axes_core::config::Periods;
use virtual_axes_core::statistics::{median, quantile, rms};

/// Longest run of missing samples that is interpolated by a cubic.
pub(super) const MAX_BRIDGED: usize = 2;
/// Interval in periods above which an event is analyzed; half a period of jitter at both ends stays below.
const LONG_INTERVAL: f64 = 1.7;
/// Interval in periods below which a stamp is repeated.
const REPEATED_INTERVAL: f64 = 0.02;
/// Share of repeated stamps above which the clock of the logger is coarser than its sampling.
const MAX_REPEATED_SHARE: f64 = 0.1;
/// Mean interval in periods below which a burst continues.
const BURST_INTERVAL: f64 = 0.85;
/// Number of intervals in that mean.
const BURST_MEAN: usize = 4;
/// Samples that determine the lateness before and behind an event; with jitter of at most half a period their
/// median deviates by a tenth of it.
const LATENESS_SAMPLES: usize = 31;
/// Fewest such samples behind an event.
const MIN_LATENESS_SAMPLES: usize = 3;
/// Lateness in periods above which a sample is stalled.
const STALL_LATENESS: f64 = 2.5;
/// Longest gap that is counted in periods; longer gaps are limited to it.
const MAX_GAP: f64 = 1e12;
/// Largest shift of any sample, in periods, by rounding of the period to a decimal.
const MAX_ROUNDING_SHIFT: f64 = 0.02;
/// Jitter in periods below which no finding is reported.
const MIN_REPORTED_JITTER: f64 = 0.01;
/// Median distance from the grid, in periods, above which the sampling is irregular.
const MAX_MEDIAN_DEVIATION: f64 = 0.5;
/// Step of the distance from the grid between samples, relative to the distance, below which stamps wander.
const SMALL_STEPS: f64 = 0.35;
/// Share of long intervals without a burst above which the sampling is irregular.
const MAX_GAP_SHARE: f64 = 0.25;

/// Samples assigned to a uniform grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct UniformGrid {
    /// Sampling period, s.
    pub period: f64,
    /// True if the samples are on the grid; false if they were taken at their stamps.
    pub is_uniform: bool,
    /// Blocks between gaps that are too long to be interpolated.
    pub blocks: Vec<SampleBlock>,
}

/// Consecutive samples without a long gap.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct SampleBlock {
    /// Time of slot 0, s.
    pub start: f64,
    /// Row of each sample in the recording.
    pub rows: Vec<usize>,
    /// Stamp of each sample, s.
    pub stamps: Vec<f64>,
    /// Slot of each sample on the grid.
    pub slots: Vec<usize>,
    /// True for samples whose stamp is late by a stall of the logger.
    pub late: Vec<bool>,
}

struct Slots {
    slot: Vec<i64>,
    keep: Vec<bool>,
    late: Vec<bool>,
    /// Start and length of each stall, s.
    stalls: Vec<(f64, f64)>,
    /// Number of long intervals without a burst.
    gaps: usize,
    /// Number of samples dropped because of a repeated stamp.
    dropped: usize,
}

/// Assigns samples to a uniform grid. `stamped_smoother` decides from the position if the samples were taken
/// at their stamps instead.
///
/// # Errors
/// [`ConditioningError`] if the sampling period is not plausible for a drive.
pub(super) fn assign_to_grid(
    name: &str,
    ordered: &OrderedSamples,
    periods: &Periods,
    stamped_smoother: impl Fn(&UniformGrid) -> bool,
    findings: &mut Vec<Finding>,
) -> Result<UniformGrid, ConditioningError> {
    let stamps = &ordered.stamps;
    let intervals: Vec<f64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let repeated = intervals.iter().filter(|d| **d == 0.0).count();
    let coarse = repeated as f64 > MAX_REPEATED_SHARE * intervals.len() as f64;
    let first = estimate_period(&intervals, coarse);
    check_period(name, first, periods)?;
    // The second pass uses the period found by the first.
    let mut placed = UniformGrid { period: first, is_uniform: true, blocks: Vec::new() };
    let mut slots = count_slots(stamps, first, coarse);
    for pass in 0..2 {
        if pass > 0 {
            slots = count_slots(stamps, placed.period, coarse);
        }
        placed.blocks = split_blocks(ordered, &slots, placed.period);
        placed.period = round_period(fit_period(&placed.blocks, placed.period), &placed.blocks);
        set_starts(&mut placed);
    }
    let distance = distances(&placed);
    // A clock coarser than the sampling moves each stamp by up to its step.
    let step = if coarse { coarse_step(stamps) } else { 0.0 };
    let wandering = median(&mut distance.iter().map(|d| d.abs()).collect::<Vec<_>>()).unwrap_or(0.0);
    let uncaught = slots.gaps as f64 > MAX_GAP_SHARE * intervals.len() as f64;
    let smoother = || !coarse && stamped_smoother(&placed);
    let walks = || !coarse && slots.stalls.is_empty() && slots.dropped == 0 && is_walk(&distance);
    if walks() || wandering > MAX_MEDIAN_DEVIATION + step / placed.period || uncaught || smoother() {
        placed = keep_stamps(ordered, placed.period.max(step));
        let spread = |at| quantile(&mut intervals.clone(), at).unwrap_or(0.0) * 1e3;
        let what = format!(
            "{name}: irregular sampling ({:.3} … {:.3} ms, 5th to 95th percentile), interpolated to {:.3} ms",
            spread(0.05),
            spread(0.95),
            placed.period * 1e3
        );
        findings.push(Finding::warning("irregular", what, "record with the clock of the controller"));
        return Ok(placed);
    }
    report_grid(name, &slots, &distance, placed.period, findings);
    Ok(placed)
}

/// Returns true if the distances of the stamps from the grid, in periods, wander by more than half a period in small steps:
/// the stamps are right, and the logger does not sample uniformly. Jitter of the stamps changes from sample to sample.
fn is_walk(distance: &[f64]) -> bool {
    let largest = distance.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    let steps = rms(distance.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or(0.0);
    largest > MAX_MEDIAN_DEVIATION && steps < SMALL_STEPS * rms(distance.iter().copied()).unwrap_or(0.0)
}

fn report_grid(name: &str, slots: &Slots, distance: &[f64], period: f64, findings: &mut Vec<Finding>) {
    if slots.dropped > 0 {
        let what = format!("{name}: {} samples with repeated stamps dropped", slots.dropped);
        findings.push(Finding::note("duplicate-stamps", what));
    }
    if let Some((begin, _)) = slots.stalls.first() {
        let longest = slots.stalls.iter().map(|(_, length)| *length).fold(0.0, f64::max);
        let what = format!(
            "{name}: {} stalls of the logger, the first at {begin:.3} s, the longest of {:.1} ms; \
             late samples are moved to the grid of {:.4} ms",
            slots.stalls.len(),
            longest * 1e3,
            period * 1e3
        );
        findings.push(Finding::note("stall", what));
    }
    let rms = rms(distance.iter().copied()).unwrap_or(0.0);
    let largest = distance.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    if rms > MIN_REPORTED_JITTER || largest > 5.0 * MIN_REPORTED_JITTER {
        let what = format!(
            "{name}: the stamps jitter by {:.3} ms RMS, {:.3} ms at most; \
             the samples are moved to the grid of {:.4} ms",
            rms * period * 1e3,
            largest * period * 1e3,
            period * 1e3
        );
        findings.push(Finding::note("jitter", what));
    }
}

/// Counts the samples through jitter, stalls, gaps and repeated stamps.
fn count_slots(stamps: &[f64], period: f64, coarse: bool) -> Slots {
    let count = stamps.len();
    let mut s = Slots {
        slot: vec![0; count],
        keep: vec![true; count],
        late: vec![false; count],
        stalls: Vec::new(),
        gaps: 0,
        dropped: 0,
    };
    let interval = |n: usize| stamps[n] - stamps[n - 1];
    // A coarse clock adds its own step to an interval.
    let long = if coarse { LONG_INTERVAL * period + coarse_step(stamps) } else { LONG_INTERVAL * period };
    let mut n = 1;
    while n < count {
        if interval(n) <= long && (coarse || interval(n) > REPEATED_INTERVAL * period) {
            s.slot[n] = s.slot[n - 1] + 1;
            n += 1;
            continue;
        }
        let before = level_before(stamps, &s, n, period);
        let (settled, window, largest) = find_burst_end(stamps, n, period, long);
        let base = s.slot[n - 1];
        let lateness = |j: usize| stamps[j] - (base + 1 + (j - n) as i64) as f64 * period - before;
        let after = median(&mut window.map(lateness).collect::<Vec<_>>()).unwrap_or(0.0);
        let missing = (after / period).round().clamp(-MAX_GAP, MAX_GAP) as i64;
        let mut surplus = (-missing).max(0);
        let mut slot = base;
        let mut latest = 0.0_f64;
        for (j, stamp) in stamps.iter().enumerate().take(settled + 1).skip(n) {
            let repeats = interval(j) <= REPEATED_INTERVAL * period;
            if surplus > 0 && repeats && !coarse {
                surplus -= 1;
                s.keep[j] = false;
                s.dropped += 1;
            } else {
                slot += 1;
            }
            if j == largest {
                slot += missing.max(0);
            }
            s.slot[j] = slot;
            let late = (stamp - slot as f64 * period - before) / period;
            latest = latest.max(late);
            s.late[j] = late > STALL_LATENESS;
        }
        s.gaps += usize::from(missing > 0);
        if latest > STALL_LATENESS {
            s.stalls.push((stamps[n - 1], latest * period));
        }
        n = settled + 1;
    }
    s
}

/// Returns the median lateness of the samples before sample `n`, s.
fn level_before(stamps: &[f64], s: &Slots, n: usize, period: f64) -> f64 {
    let calm =
        (0..n).rev().take(4 * LATENESS_SAMPLES).filter(|&j| s.keep[j] && !s.late[j]).take(LATENESS_SAMPLES);
    let mut levels: Vec<f64> = calm.map(|j| stamps[j] - s.slot[j] as f64 * period).collect();
    if levels.is_empty() {
        return stamps[n - 1] - s.slot[n - 1] as f64 * period;
    }
    median(&mut levels).unwrap_or(0.0)
}

/// Finds the end of the burst behind the interval that ends at `n`. Returns the first settled sample, the
/// settled samples from there, and the end of the longest interval.
fn find_burst_end(stamps: &[f64], n: usize, period: f64, long: f64) -> (usize, Range<usize>, usize) {
    let last = stamps.len() - 1;
    let interval = |j: usize| stamps[j] - stamps[j - 1];
    let (mut settled, mut largest) = (n, n);
    loop {
        let from = settled;
        while settled < last {
            let limit = (settled + BURST_MEAN).min(last);
            let ahead = (settled..limit).find(|&j| interval(j + 1) > long).unwrap_or(limit);
            if ahead == settled
                || stamps[ahead] - stamps[settled] >= BURST_INTERVAL * period * (ahead - settled) as f64
            {
                break;
            }
            settled += 1;
        }
        let limit = (settled + LATENESS_SAMPLES).min(stamps.len());
        let end = (settled + 1..limit).find(|&j| interval(j) > long).unwrap_or(limit);
        // A burst that is interrupted by another stall continues behind it.
        let interrupted = settled > from && end < limit && end - settled < MIN_LATENESS_SAMPLES;
        if !interrupted {
            return (settled, settled..end, largest);
        }
        if interval(end) > interval(largest) {
            largest = end;
        }
        settled = end;
    }
}

fn split_blocks(ordered: &OrderedSamples, slots: &Slots, period: f64) -> Vec<SampleBlock> {
    let mut blocks: Vec<SampleBlock> = Vec::new();
    let (mut first, mut before) = (0, i64::MIN);
    for n in (0..ordered.rows.len()).filter(|&n| slots.keep[n]) {
        let slot = slots.slot[n];
        if blocks.is_empty() || slot - before > MAX_BRIDGED as i64 + 1 {
            first = slot;
            blocks.push(SampleBlock { start: ordered.stamps[n], ..SampleBlock::default() });
        }
        before = slot;
        if let Some(block) = blocks.last_mut() {
            block.push(ordered.rows[n], ordered.stamps[n], (slot - first) as usize, slots.late[n]);
        }
    }
    let mut placed = UniformGrid { period, is_uniform: true, blocks };
    set_starts(&mut placed);
    placed.blocks
}

impl SampleBlock {
    fn push(&mut self, row: usize, stamp: f64, slot: usize, late: bool) {
        self.rows.push(row);
        self.stamps.push(stamp);
        self.slots.push(slot);
        self.late.push(late);
    }

    /// Returns slot and stamp of the samples that are not late.
    fn on_time(&self) -> impl Iterator<Item = (f64, f64)> {
        let all = self.slots.iter().zip(&self.stamps).zip(&self.late);
        all.filter(|(_, late)| !**late).map(|((slot, stamp), _)| (*slot as f64, *stamp))
    }
}

fn set_starts(placed: &mut UniformGrid) {
    for block in &mut placed.blocks {
        let mut starts: Vec<f64> =
            block.on_time().map(|(slot, stamp)| stamp - slot * placed.period).collect();
        if !starts.is_empty() {
            block.start = median(&mut starts).unwrap_or(0.0);
        }
    }
}

/// Fits the period, s, as slope of the stamps over the slots by least squares over all blocks.
fn fit_period(blocks: &[SampleBlock], otherwise: f64) -> f64 {
    let (mut cross, mut square) = (0.0, 0.0);
    for block in blocks {
        let count = block.on_time().count().max(1) as f64;
        let (sum_slot, sum_stamp) = block.on_time().fold((0.0, 0.0), |(slots, stamps), (slot, stamp)| {
            (slots + slot, stamps + (stamp - block.start))
        });
        for (slot, stamp) in block.on_time() {
            let slot = slot - sum_slot / count;
            cross += slot * (stamp - block.start - sum_stamp / count);
            square += slot * slot;
        }
    }
    let slope = cross / square;
    // A slope far from the estimate means wrong slots.
    if (slope / otherwise - 1.0).abs() < REGULAR { slope } else { otherwise }
}

/// Returns the shortest decimal period that is consistent with the stamps.
fn round_period(period: f64, blocks: &[SampleBlock]) -> f64 {
    let longest = blocks.iter().filter_map(|block| block.slots.last()).max().copied().unwrap_or(0).max(1);
    let decimals = (3..=9).map(|digits| {
        let scale = 10_f64.powi(digits);
        (period * scale).round() / scale
    });
    let same =
        |round: &f64| *round > 0.0 && (round - period).abs() * longest as f64 <= MAX_ROUNDING_SHIFT * period;
    decimals.into_iter().find(same).unwrap_or(period)
}

/// Returns the distance of each timely sample from its slot, periods.
fn distances(placed: &UniformGrid) -> Vec<f64> {
    let of = |block: &SampleBlock| {
        let (start, period) = (block.start, placed.period);
        block.on_time().map(|(slot, stamp)| (stamp - start) / period - slot).collect::<Vec<_>>()
    };
    placed.blocks.iter().flat_map(of).collect()
}

/// Splits the samples at their stamps into blocks without long gaps.
fn keep_stamps(ordered: &OrderedSamples, period: f64) -> UniformGrid {
    let longest = (MAX_BRIDGED as f64 + 1.5) * period;
    let mut blocks: Vec<SampleBlock> = Vec::new();
    let mut before = f64::NEG_INFINITY;
    for (&row, &stamp) in ordered.rows.iter().zip(&ordered.stamps) {
        if stamp - before > longest {
            blocks.push(SampleBlock { start: stamp, ..SampleBlock::default() });
        } else if stamp - before <= REPEATED_INTERVAL * period {
            continue;
        }
        before = stamp;
        if let Some(block) = blocks.last_mut() {
            let slot = ((stamp - block.start) / period).round() as usize;
            block.push(row, stamp, slot, false);
        }
    }
    UniformGrid { period, is_uniform: false, blocks }
}
