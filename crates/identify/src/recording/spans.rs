//! From placed samples to spans in which every channel has a value at every multiple of the period.

use super::order::{median, quantile};
use super::stamps::{Block, MAX_BRIDGED, Placed};
use super::{Finding, RawRecording};

/// Channels of a recording; the first is the position.
pub(super) const CHANNELS: usize = 6;
pub(super) const POSITION: usize = 0;
pub(super) const PSEC: usize = 1;
pub(super) const VELOCITY: usize = 2;
pub(super) const CURRENT: usize = 3;
pub(super) const VELOCITY_FEEDFORWARD: usize = 4;
pub(super) const TORQUE_FEEDFORWARD: usize = 5;
/// What they are called.
pub(super) const NAMES: [&str; CHANNELS] =
    ["position", "PSEC", "velocity", "current", "velocity feedforward", "torque feedforward"];
/// A value for each sample, by channel.
pub(super) type Columns = [Option<Vec<f64>>; CHANNELS];

/// Largest magnitude of a value in any unit: beyond it there is no number that was measured.
const LARGEST: f64 = 1e15;
/// Part of its samples that a channel must have to be used at all.
const FEWEST_VALUES: f64 = 0.5;
/// Samples on either side from which the speed about a frozen run is taken.
const ABOUT: usize = 10;
/// Steps of the common size that the position must leap by behind a frozen run, at least and per frozen sample.
const LEAP: f64 = 2.5;
const LEAP_PER_SAMPLE: f64 = 0.5;
/// Equal steps of zero that make a frozen run.
const FROZEN: usize = 2;
/// Part of samples from which on frozen positions are no accident.
const MOSTLY_FROZEN: f64 = 0.05;
/// Part of a period within which a sample is at a multiple of it, and keeps its value.
const AT: f64 = 1e-3;
/// Weights of two interpolations between the neighbors that differ less tell nothing about jitter.
const TELLING: f64 = 0.05;
/// Fewest samples that tell something about jitter.
const FEWEST_TELLING: usize = 20;
/// How much smoother the position must be over the stamps than over the grid.
const SMOOTHER: f64 = 0.5;

/// A part of a recording in which nothing is missing.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Piece {
    /// Time of the first sample, s.
    pub start: f64,
    pub columns: Columns,
}

impl Piece {
    /// Samples there are.
    pub fn len(&self) -> usize {
        self.columns[POSITION].as_ref().map_or(0, Vec::len)
    }

    /// Keeps the samples of `range`, counted from the start.
    pub fn cut(&mut self, range: std::ops::Range<usize>, period: f64) {
        self.start += range.start as f64 * period;
        for column in self.columns.iter_mut().flatten() {
            column.truncate(range.end);
            column.drain(..range.start.min(column.len()));
        }
    }
}

/// The channels of `raw` that can be used; what is no number that was measured is NaN.
pub(super) fn columns(raw: &RawRecording, findings: &mut Vec<Finding>) -> Columns {
    let channels = channels(raw);
    let mut columns = Columns::default();
    for (n, channel) in channels.into_iter().enumerate() {
        let Some(values) = channel else { continue };
        let there = values.iter().filter(|value| value.abs() <= LARGEST).count();
        if (there as f64) < FEWEST_VALUES * values.len() as f64 {
            let what =
                format!("{}: the {} has only {there} values for {} stamps", raw.name, NAMES[n], values.len());
            findings.push(Finding::warning("channel-dropped", what, "it is left out; record it fully"));
            continue;
        }
        let finite = |value: &f64| if value.abs() <= LARGEST { *value } else { f64::NAN };
        columns[n] = Some(values.iter().map(finite).collect());
    }
    columns
}

/// The channels of `raw` in their order.
pub(super) fn channels(raw: &RawRecording) -> [Option<&Vec<f64>>; CHANNELS] {
    [
        raw.position.as_ref(),
        raw.psec.as_ref(),
        raw.velocity.as_ref(),
        raw.current.as_ref(),
        raw.velocity_feedforward.as_ref(),
        raw.torque_feedforward.as_ref(),
    ]
}

/// Whether the position is smoother over the stamps than over the grid: then the samples were taken when they
/// are stamped, and not evenly.
pub(super) fn stamped_smoother(placed: &Placed, position: &[f64]) -> bool {
    // Travel, and the distance from the straight line between the neighbors: over the grid, over the stamps.
    let mut triples: Vec<(f64, f64, f64)> = Vec::new();
    for block in &placed.blocks {
        for n in 1..block.rows.len().saturating_sub(1) {
            if block.late[n - 1..=n + 1].contains(&true) {
                continue;
            }
            let [a, b, c] = [n - 1, n, n + 1].map(|n| position[block.rows[n]]);
            let slot = |n: usize| block.slots[n] as f64;
            let even = (slot(n) - slot(n - 1)) / (slot(n + 1) - slot(n - 1));
            let stamped =
                (block.stamps[n] - block.stamps[n - 1]) / (block.stamps[n + 1] - block.stamps[n - 1]);
            let off = |weight: f64| (b - (a + weight * (c - a))).abs();
            if (even - stamped).abs() > TELLING && off(even).is_finite() && off(stamped).is_finite() {
                triples.push(((c - a).abs(), off(even), off(stamped)));
            }
        }
    }
    let fast = 0.5 * quantile(&mut triples.iter().map(|t| t.0).collect::<Vec<_>>(), 0.9);
    triples.retain(|t| t.0 > 0.0 && t.0 >= fast);
    let even = median(&mut triples.iter().map(|t| t.1).collect::<Vec<_>>());
    let stamped = median(&mut triples.iter().map(|t| t.2).collect::<Vec<_>>());
    triples.len() >= FEWEST_TELLING && stamped < SMOOTHER * even
}

/// The spans of a recording, of `shortest` samples and more; the length of the longest there is.
pub(super) fn pieces(
    name: &str,
    placed: &Placed,
    columns: &Columns,
    shortest: usize,
    findings: &mut Vec<Finding>,
) -> (Vec<Piece>, usize) {
    tell_gaps(name, placed, findings);
    let mut pieces = Vec::new();
    let (mut bridged, mut holes, mut frozen) = (0, 0, Vec::new());
    for block in &placed.blocks {
        let mut dense =
            if placed.even { gridded(block, columns) } else { resampled(block, columns, placed.period) };
        if placed.even {
            frozen.extend(thaw(&mut dense, block.start, placed.period));
        }
        bridged += (0..CHANNELS).map(|n| bridge(&mut dense[n], n)).sum::<usize>();
        holes += split(&dense, block.start, placed.period, &mut pieces);
    }
    if bridged > 0 {
        let what =
            format!("{name}: {bridged} missing values, at most {MAX_BRIDGED} in a row, are interpolated");
        findings.push(Finding::note("bridged", what));
    }
    if let Some((begin, _)) = frozen.first() {
        let longest = frozen.iter().map(|(_, length)| *length).fold(0.0, f64::max);
        let samples: usize = placed.blocks.iter().map(|block| block.rows.len()).sum();
        let lost: f64 = frozen.iter().map(|(_, length)| length / placed.period).sum();
        let what = format!(
            "{name}: the position stands still {} times amid motion and leaps, first at {begin:.3} s, at most {:.1} ms; \
             these samples are cut out",
            frozen.len(),
            longest * 1e3
        );
        let remedy =
            if lost > MOSTLY_FROZEN * samples as f64 { "record with less load on the logger" } else { "" };
        findings.push(Finding::warning("frozen", what, remedy));
    }
    if holes > 0 {
        let what = format!("{name}: {holes} times values are missing for more than {MAX_BRIDGED} samples");
        findings.push(Finding::warning("hole", what, "the recording is parted there"));
    }
    let longest = pieces.iter().map(Piece::len).max().unwrap_or(0);
    let (all, before) = (pieces.len(), pieces.iter().map(Piece::len).sum::<usize>());
    pieces.retain(|piece| piece.len() >= shortest);
    if pieces.len() < all {
        let lost = before - pieces.iter().map(Piece::len).sum::<usize>();
        let what = format!(
            "{name}: {} parts shorter than {shortest} samples, {lost} samples together, are left out",
            all - pieces.len()
        );
        findings.push(Finding::note("short-span", what));
    }
    (pieces, longest)
}

fn tell_gaps(name: &str, placed: &Placed, findings: &mut Vec<Finding>) {
    let ends = placed.blocks.windows(2).map(|pair| (pair[0].stamps.last(), pair[1].stamps.first()));
    let gaps: Vec<(f64, f64)> = ends.filter_map(|(a, b)| Some((*a?, b? - a?))).collect();
    let Some((begin, _)) = gaps.first() else { return };
    let longest = gaps.iter().map(|(_, length)| *length).fold(0.0, f64::max);
    let what = format!(
        "{name}: {} gaps, the first at {begin:.3} s, the longest of {:.1} ms; the recording is parted there",
        gaps.len(),
        longest * 1e3
    );
    findings.push(Finding::warning("gap", what, ""));
}

/// The samples of a block in their slots, NaN where there is none.
fn gridded(block: &Block, columns: &Columns) -> Columns {
    let count = block.slots.last().map_or(0, |last| last + 1);
    let fill = |values: &Vec<f64>| {
        let mut dense = vec![f64::NAN; count];
        for (&slot, &row) in block.slots.iter().zip(&block.rows) {
            dense[slot] = values[row];
        }
        dense
    };
    std::array::from_fn(|n| columns[n].as_ref().map(fill))
}

/// The samples of a block interpolated from their stamps to the grid.
fn resampled(block: &Block, columns: &Columns, period: f64) -> Columns {
    let length = block.stamps.last().map_or(0.0, |last| last - block.start);
    let count = (length / period + AT) as usize + 1;
    let interpolate = |(n, values): (usize, &Vec<f64>)| {
        let nodes = block.stamps.iter().zip(&block.rows).map(|(stamp, row)| (*stamp, values[*row]));
        let nodes: Vec<(f64, f64)> = nodes.filter(|(_, value)| !value.is_nan()).collect();
        let mut at = 0;
        (0..count)
            .map(|j| {
                let time = block.start + j as f64 * period;
                while at + 1 < nodes.len() && nodes[at + 1].0 <= time + AT * period {
                    at += 1;
                }
                between(&nodes, at, time, period, n <= VELOCITY)
            })
            .collect()
    };
    std::array::from_fn(|n| columns[n].as_ref().map(|values| interpolate((n, values))))
}

/// Value at `time` between node `at` and the next one: `smooth` by a cubic, otherwise by a straight line.
fn between(nodes: &[(f64, f64)], at: usize, time: f64, period: f64, smooth: bool) -> f64 {
    let Some(&(t0, x0)) = nodes.get(at) else { return f64::NAN };
    if (time - t0).abs() <= AT * period {
        return x0;
    }
    let Some(&(t1, x1)) = nodes.get(at + 1) else { return f64::NAN };
    let step = t1 - t0;
    if time < t0 || step > (MAX_BRIDGED as f64 + 1.5) * period {
        return f64::NAN;
    }
    let part = (time - t0) / step;
    let straight = x0 + part * (x1 - x0);
    // Slopes from the parabola through three nodes; at an end that of the straight line.
    let slope = |a: Option<&(f64, f64)>, b: (f64, f64), c: Option<&(f64, f64)>| match (a, c) {
        (Some(a), Some(c)) => {
            let (left, right) = (b.0 - a.0, c.0 - b.0);
            ((b.1 - a.1) / left * right + (c.1 - b.1) / right * left) / (left + right)
        }
        _ => (x1 - x0) / step,
    };
    if !smooth {
        return straight;
    }
    let near = |n: Option<usize>| n.and_then(|n| nodes.get(n));
    let s0 = slope(near(at.checked_sub(1)), nodes[at], near(Some(at + 1)));
    let s1 = slope(near(Some(at)), nodes[at + 1], near(Some(at + 2)));
    let (a, b) = (step * s0 - (x1 - x0), (x1 - x0) - step * s1);
    straight + part * (1.0 - part) * (a * (1.0 - part) + b * part)
}

/// Takes out where the position stands still amid fast motion and then leaps: begin and length of each, s.
fn thaw(dense: &mut Columns, start: f64, period: f64) -> Vec<(f64, f64)> {
    let Some(position) = &dense[POSITION] else { return Vec::new() };
    let steps: Vec<f64> = position.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut frozen = Vec::new();
    let mut n = 0;
    while n < steps.len() {
        let run = steps[n..].iter().take_while(|step| **step == 0.0).count();
        let end = n + run;
        if run >= FROZEN && end < steps.len() && leaps(&steps, n, end) {
            frozen.push(n + 1..end + 1);
        }
        n = end + 1;
    }
    for column in dense.iter_mut().flatten() {
        for run in &frozen {
            column[run.clone()].fill(f64::NAN);
        }
    }
    frozen.iter().map(|run| (start + run.start as f64 * period, run.len() as f64 * period)).collect()
}

/// Whether the motion before and behind the steps n..end, which are zero, shows that they are not true.
fn leaps(steps: &[f64], n: usize, end: usize) -> bool {
    let common =
        |steps: &[f64]| median(&mut steps.iter().copied().filter(|s| !s.is_nan()).collect::<Vec<_>>());
    let before = common(&steps[n.saturating_sub(ABOUT)..n]);
    let after = common(&steps[end + 1..(end + 1 + ABOUT).min(steps.len())]);
    let step = 0.5 * (before + after);
    let leap = steps[end] / step;
    before * after > 0.0 && leap >= LEAP && leap >= LEAP_PER_SAMPLE * (end - n + 1) as f64
}

/// Interpolates runs of at most [`MAX_BRIDGED`] missing values; how many values that were.
fn bridge(column: &mut Option<Vec<f64>>, channel: usize) -> usize {
    let Some(values) = column else { return 0 };
    let (mut bridged, mut n) = (0, 1);
    while n < values.len() {
        let run = values[n..].iter().take_while(|value| value.is_nan()).count();
        let known = run > 0 && run <= MAX_BRIDGED && n + run < values.len() && !values[n - 1].is_nan();
        if known {
            let near = [n.checked_sub(2), Some(n - 1), Some(n + run), Some(n + run + 1)];
            let value = |at: Option<usize>| at.and_then(|at| Some((at as f64, *values.get(at)?)));
            let nodes: Vec<(f64, f64)> =
                near.into_iter().filter_map(value).filter(|(_, v)| !v.is_nan()).collect();
            let before = usize::from(nodes.first().is_some_and(|node| node.0 < (n - 1) as f64));
            for (j, missing) in values.iter_mut().enumerate().skip(n).take(run) {
                *missing = between(&nodes, before, j as f64, 1.0, channel <= VELOCITY);
            }
            bridged += run;
        }
        n += run + 1;
    }
    bridged
}

/// Adds the parts in which every channel has its value; how many holes are between them.
fn split(dense: &Columns, start: f64, period: f64, pieces: &mut Vec<Piece>) -> usize {
    let count = dense[POSITION].as_ref().map_or(0, Vec::len);
    let whole = |n: usize| dense.iter().flatten().all(|column| !column[n].is_nan());
    let (mut parts, mut n) = (0, 0);
    while n < count {
        let run = (n..count).take_while(|&n| whole(n)).count();
        if run > 0 {
            parts += 1;
            let columns =
                std::array::from_fn(|c| dense[c].as_ref().map(|column| column[n..n + run].to_vec()));
            pieces.push(Piece { start: start + n as f64 * period, columns });
        }
        n += run + 1;
    }
    usize::saturating_sub(parts, 1)
}
