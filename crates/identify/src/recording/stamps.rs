//! From stamps to an even grid: which sample was taken at which multiple of the period.
//!
//! A controller samples evenly; what jitters is the logger's stamp. A sample that comes late and is caught up
//! with by a burst of short intervals was taken on time; where nothing catches up, samples are missing.

use std::ops::Range;

use super::order::{Ordered, median, quantile};
use super::sampling::{REGULAR, check_period, coarse_step, nominal};
use super::{Finding, RecordingFault};
use virtual_axes_core::config::Periods;

/// Longest run of missing samples that is bridged: cubic interpolation over it is harmless.
pub(super) const MAX_BRIDGED: usize = 2;
/// An interval longer than this many periods is looked at: half a period of jitter at both ends stays below.
const LONG: f64 = 1.7;
/// An interval shorter than this many periods is that of a repeated stamp.
const REPEATED: f64 = 0.02;
/// Part of repeated stamps from which on the clock of the logger is coarser than its sampling.
const COARSE: f64 = 0.1;
/// While the mean of the next few intervals is below this many periods, a burst catches up.
const BURST: f64 = 0.85;
/// How many intervals that mean takes.
const BURST_MEAN: usize = 4;
/// Samples from which the lateness before and behind an event is taken: with jitter of half a period at most
/// their median is out by a tenth of one.
const LEVEL: usize = 31;
/// Fewest such samples behind an event.
const FEWEST_LEVEL: usize = 3;
/// A sample later than this many periods counts as stalled.
const STALL: f64 = 2.5;
/// Most periods that a gap is counted in; longer ones have their own phase anyway.
const LONGEST_GAP: f64 = 1e12;
/// A period is rounded to a decimal if that moves no sample by more than this part of it.
const ROUNDING: f64 = 0.02;
/// Jitter below this part of a period is not worth a word.
const ON_GRID: f64 = 0.01;
/// Wandering (median distance from the grid, periods) from which on the sampling itself is irregular.
const WANDERING: f64 = 0.5;
/// Part of intervals that nothing catches up with, from which on the sampling itself is irregular.
const UNCAUGHT: f64 = 0.25;

/// Samples with their place on a grid of `period`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Placed {
    /// Sampling period, s.
    pub period: f64,
    /// Whether the samples are on the grid; otherwise they were taken when they are stamped.
    pub even: bool,
    /// What lies between gaps that are too long to be bridged.
    pub blocks: Vec<Block>,
}

/// Samples that follow each other without a long gap.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Block {
    /// Time of slot 0, s.
    pub start: f64,
    /// Where each sample is in the recording.
    pub rows: Vec<usize>,
    /// Its stamp, s.
    pub stamps: Vec<f64>,
    /// Its place on the grid.
    pub slots: Vec<usize>,
    /// Whether its stamp is late by a stall of the logger.
    pub late: Vec<bool>,
}

struct Slots {
    slot: Vec<i64>,
    keep: Vec<bool>,
    late: Vec<bool>,
    /// Begin and length, s.
    stalls: Vec<(f64, f64)>,
    /// Long intervals that nothing caught up with.
    gaps: usize,
    /// Samples left out since their stamp is repeated.
    dropped: usize,
}

/// Places the samples; `stamped_smoother` tells from the position whether they were rather taken when stamped.
///
/// # Errors
/// [`RecordingFault::TimeUnit`] if the period is not that of a drive.
pub(super) fn place(
    name: &str,
    ordered: &Ordered,
    periods: &Periods,
    stamped_smoother: impl Fn(&Placed) -> bool,
    findings: &mut Vec<Finding>,
) -> Result<Placed, RecordingFault> {
    let stamps = &ordered.stamps;
    let intervals: Vec<f64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let repeated = intervals.iter().filter(|d| **d == 0.0).count();
    let coarse = repeated as f64 > COARSE * intervals.len() as f64;
    let first = nominal(&intervals, coarse);
    check_period(name, first, periods)?;
    // The second pass sees the period that the first has found.
    let mut placed = Placed { period: first, even: true, blocks: Vec::new() };
    let mut slots = assign(stamps, first, coarse);
    for pass in 0..2 {
        if pass > 0 {
            slots = assign(stamps, placed.period, coarse);
        }
        placed.blocks = blocks(ordered, &slots, placed.period);
        placed.period = rounded(fitted(&placed.blocks, placed.period), &placed.blocks);
        set_starts(&mut placed);
    }
    let distance = distances(&placed);
    // A clock coarser than the sampling lets every stamp wander by its own step.
    let step = if coarse { coarse_step(stamps) } else { 0.0 };
    let wandering = median(&mut distance.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let uncaught = slots.gaps as f64 > UNCAUGHT * intervals.len() as f64;
    let smoother = || !coarse && stamped_smoother(&placed);
    if wandering > WANDERING + step / placed.period || uncaught || smoother() {
        placed = irregular(ordered, placed.period.max(step));
        let spread = |at| quantile(&mut intervals.clone(), at) * 1e3;
        let what = format!(
            "{name}: the sampling is irregular ({:.3} … {:.3} ms, 5th to 95th percentile); it is interpolated to {:.3} ms",
            spread(0.05),
            spread(0.95),
            placed.period * 1e3
        );
        findings.push(Finding::warning("irregular", what, "record with the clock of the controller"));
        return Ok(placed);
    }
    tell(name, &slots, &distance, placed.period, findings);
    Ok(placed)
}

fn tell(name: &str, slots: &Slots, distance: &[f64], period: f64, findings: &mut Vec<Finding>) {
    if slots.dropped > 0 {
        let what = format!("{name}: {} samples whose stamp is repeated are left out", slots.dropped);
        findings.push(Finding::note("duplicate-stamps", what));
    }
    if let Some((begin, _)) = slots.stalls.first() {
        let longest = slots.stalls.iter().map(|(_, length)| *length).fold(0.0, f64::max);
        let what = format!(
            "{name}: {} stalls of the logger, the first at {begin:.3} s, the longest of {:.1} ms; \
             the samples stamped late are put back on the grid of {:.4} ms",
            slots.stalls.len(),
            longest * 1e3,
            period * 1e3
        );
        findings.push(Finding::note("stall", what));
    }
    let rms = (distance.iter().map(|d| d * d).sum::<f64>() / distance.len().max(1) as f64).sqrt();
    let largest = distance.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    if rms > ON_GRID || largest > 5.0 * ON_GRID {
        let what = format!(
            "{name}: the stamps jitter by {:.3} ms RMS, {:.3} ms at most, about an even grid of {:.4} ms; \
             the samples are put on it",
            rms * period * 1e3,
            largest * period * 1e3,
            period * 1e3
        );
        findings.push(Finding::note("jitter", what));
    }
}

/// Counts the samples through jitter, stalls, gaps and repeated stamps.
fn assign(stamps: &[f64], period: f64, coarse: bool) -> Slots {
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
    let long = if coarse { LONG * period + coarse_step(stamps) } else { LONG * period };
    let mut n = 1;
    while n < count {
        if interval(n) <= long && (coarse || interval(n) > REPEATED * period) {
            s.slot[n] = s.slot[n - 1] + 1;
            n += 1;
            continue;
        }
        let before = level_before(stamps, &s, n, period);
        let (settled, window, largest) = burst(stamps, n, period, long);
        let base = s.slot[n - 1];
        let lateness = |j: usize| stamps[j] - (base + 1 + (j - n) as i64) as f64 * period - before;
        let after = median(&mut window.map(lateness).collect::<Vec<_>>());
        let missing = (after / period).round().clamp(-LONGEST_GAP, LONGEST_GAP) as i64;
        let mut surplus = (-missing).max(0);
        let mut slot = base;
        let mut latest = 0.0_f64;
        for (j, stamp) in stamps.iter().enumerate().take(settled + 1).skip(n) {
            let repeats = interval(j) <= REPEATED * period;
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
            s.late[j] = late > STALL;
        }
        s.gaps += usize::from(missing > 0);
        if latest > STALL {
            s.stalls.push((stamps[n - 1], latest * period));
        }
        n = settled + 1;
    }
    s
}

/// Lateness of the samples before sample n, s.
fn level_before(stamps: &[f64], s: &Slots, n: usize, period: f64) -> f64 {
    let calm = (0..n).rev().take(4 * LEVEL).filter(|&j| s.keep[j] && !s.late[j]).take(LEVEL);
    let mut levels: Vec<f64> = calm.map(|j| stamps[j] - s.slot[j] as f64 * period).collect();
    if levels.is_empty() {
        return stamps[n - 1] - s.slot[n - 1] as f64 * period;
    }
    median(&mut levels)
}

/// Where the burst behind the interval that ends at n is over, the calm samples from there on, and the sample at
/// the end of the longest interval meanwhile.
fn burst(stamps: &[f64], n: usize, period: f64, long: f64) -> (usize, Range<usize>, usize) {
    let last = stamps.len() - 1;
    let interval = |j: usize| stamps[j] - stamps[j - 1];
    let (mut settled, mut largest) = (n, n);
    loop {
        let from = settled;
        while settled < last {
            let limit = (settled + BURST_MEAN).min(last);
            let ahead = (settled..limit).find(|&j| interval(j + 1) > long).unwrap_or(limit);
            if ahead == settled
                || stamps[ahead] - stamps[settled] >= BURST * period * (ahead - settled) as f64
            {
                break;
            }
            settled += 1;
        }
        let limit = (settled + LEVEL).min(stamps.len());
        let end = (settled + 1..limit).find(|&j| interval(j) > long).unwrap_or(limit);
        // A burst that another stall interrupts goes on behind it.
        let interrupted = settled > from && end < limit && end - settled < FEWEST_LEVEL;
        if !interrupted {
            return (settled, settled..end, largest);
        }
        if interval(end) > interval(largest) {
            largest = end;
        }
        settled = end;
    }
}

fn blocks(ordered: &Ordered, slots: &Slots, period: f64) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let (mut first, mut before) = (0, i64::MIN);
    for n in (0..ordered.rows.len()).filter(|&n| slots.keep[n]) {
        let slot = slots.slot[n];
        if blocks.is_empty() || slot - before > MAX_BRIDGED as i64 + 1 {
            first = slot;
            blocks.push(Block { start: ordered.stamps[n], ..Block::default() });
        }
        before = slot;
        if let Some(block) = blocks.last_mut() {
            block.push(ordered.rows[n], ordered.stamps[n], (slot - first) as usize, slots.late[n]);
        }
    }
    let mut placed = Placed { period, even: true, blocks };
    set_starts(&mut placed);
    placed.blocks
}

impl Block {
    fn push(&mut self, row: usize, stamp: f64, slot: usize, late: bool) {
        self.rows.push(row);
        self.stamps.push(stamp);
        self.slots.push(slot);
        self.late.push(late);
    }

    /// Slot and stamp of the samples that are not late.
    fn timely(&self) -> impl Iterator<Item = (f64, f64)> {
        let all = self.slots.iter().zip(&self.stamps).zip(&self.late);
        all.filter(|(_, late)| !**late).map(|((slot, stamp), _)| (*slot as f64, *stamp))
    }
}

fn set_starts(placed: &mut Placed) {
    for block in &mut placed.blocks {
        let mut starts: Vec<f64> = block.timely().map(|(slot, stamp)| stamp - slot * placed.period).collect();
        if !starts.is_empty() {
            block.start = median(&mut starts);
        }
    }
}

/// Slope of the stamps over the slots by least squares, all blocks together, s.
fn fitted(blocks: &[Block], otherwise: f64) -> f64 {
    let (mut cross, mut square) = (0.0, 0.0);
    for block in blocks {
        let count = block.timely().count().max(1) as f64;
        let (sum_slot, sum_stamp) = block.timely().fold((0.0, 0.0), |(slots, stamps), (slot, stamp)| {
            (slots + slot, stamps + (stamp - block.start))
        });
        for (slot, stamp) in block.timely() {
            let slot = slot - sum_slot / count;
            cross += slot * (stamp - block.start - sum_stamp / count);
            square += slot * slot;
        }
    }
    let slope = cross / square;
    // Far from the guess the slots themselves are wrong.
    if (slope / otherwise - 1.0).abs() < REGULAR { slope } else { otherwise }
}

/// The shortest decimal that is the same period for all that the stamps can tell.
fn rounded(period: f64, blocks: &[Block]) -> f64 {
    let longest = blocks.iter().filter_map(|block| block.slots.last()).max().copied().unwrap_or(0).max(1);
    let decimals = (3..=9).map(|digits| {
        let scale = 10_f64.powi(digits);
        (period * scale).round() / scale
    });
    let same = |round: &f64| *round > 0.0 && (round - period).abs() * longest as f64 <= ROUNDING * period;
    decimals.into_iter().find(same).unwrap_or(period)
}

/// Distance of each timely sample from its place on the grid, periods.
fn distances(placed: &Placed) -> Vec<f64> {
    let of = |block: &Block| {
        let (start, period) = (block.start, placed.period);
        block.timely().map(|(slot, stamp)| (stamp - start) / period - slot).collect::<Vec<_>>()
    };
    placed.blocks.iter().flat_map(of).collect()
}

/// The samples where they are stamped, parted at what is too long to be interpolated.
fn irregular(ordered: &Ordered, period: f64) -> Placed {
    let longest = (MAX_BRIDGED as f64 + 1.5) * period;
    let mut blocks: Vec<Block> = Vec::new();
    let mut before = f64::NEG_INFINITY;
    for (&row, &stamp) in ordered.rows.iter().zip(&ordered.stamps) {
        if stamp - before > longest {
            blocks.push(Block { start: stamp, ..Block::default() });
        } else if stamp - before <= REPEATED * period {
            continue;
        }
        before = stamp;
        if let Some(block) = blocks.last_mut() {
            let slot = ((stamp - block.start) / period).round() as usize;
            block.push(row, stamp, slot, false);
        }
    }
    Placed { period, even: false, blocks }
}
