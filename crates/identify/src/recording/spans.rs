//! Extraction of complete sections: every channel has a value at every multiple of the sampling period.

use super::uniform_grid::{MAX_BRIDGED, SampleBlock, UniformGrid};
use super::{Finding, RawRecording};
use virtual_axes_core::statistics::{median, quantile};

/// Number of channels; the first is the position.
pub(super) const CHANNELS: usize = 7;
pub(super) const POSITION: usize = 0;
pub(super) const PSEC: usize = 1;
pub(super) const VELOCITY: usize = 2;
pub(super) const CURRENT: usize = 3;
pub(super) const VELOCITY_FEEDFORWARD: usize = 4;
pub(super) const TORQUE_FEEDFORWARD: usize = 5;
pub(super) const MOTOR_POSITION: usize = 6;
/// Names of the channels in messages.
pub(super) const NAMES: [&str; CHANNELS] = [
    "position",
    "PSEC",
    "velocity",
    "current",
    "velocity feedforward",
    "torque feedforward",
    "motor position",
];
/// Values of each channel, one per sample.
pub(super) type ChannelColumns = [Option<Vec<f64>>; CHANNELS];

/// Largest plausible magnitude of a value in any unit.
const LARGEST: f64 = 1e15;
/// Smallest share of valid values of a usable channel.
const FEWEST_VALUES: f64 = 0.5;
/// Samples on either side that determine the speed around a frozen run.
const ABOUT: usize = 10;
/// Smallest jump of the position behind a frozen run, in usual steps: in total, and per frozen sample.
const LEAP: f64 = 2.5;
const LEAP_PER_SAMPLE: f64 = 0.5;
/// Jump, in smallest steps of the position, up to which the axis creeps by single increments of its encoder: three, with
/// rounding.
const CREEPING: f64 = 3.5;
/// Number of zero steps in a row that form a frozen run.
const FROZEN: usize = 2;
/// Share of frozen samples above which a remedy is suggested.
const MOSTLY_FROZEN: f64 = 0.05;
/// Distance from a multiple of the period, relative to it, within which a sample keeps its value.
const AT: f64 = 1e-3;
/// Smallest difference of interpolation weights that is informative about jitter.
const TELLING: f64 = 0.05;
/// Fewest informative samples for a decision about jitter.
const FEWEST_TELLING: usize = 20;
/// Ratio of roughness over the stamps to roughness over the grid below which the stamps are the true sampling
/// times.
const SMOOTHER: f64 = 0.5;

/// Section of a recording without missing values.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct RecordingSection {
    /// Time of the first sample, s.
    pub start: f64,
    pub columns: ChannelColumns,
}

impl RecordingSection {
    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.columns[POSITION].as_ref().map_or(0, Vec::len)
    }

    /// Keeps the samples of `range`, relative to the start of the section.
    pub fn cut(&mut self, range: std::ops::Range<usize>, period: f64) {
        self.start += range.start as f64 * period;
        for column in self.columns.iter_mut().flatten() {
            column.truncate(range.end);
            column.drain(..range.start.min(column.len()));
        }
    }
}

/// Returns the usable channels of `raw`; implausible values are NaN.
pub(super) fn usable_columns(raw: &RawRecording, findings: &mut Vec<Finding>) -> ChannelColumns {
    let channels = channels(raw);
    let mut columns = ChannelColumns::default();
    for (n, channel) in channels.into_iter().enumerate() {
        let Some(values) = channel else { continue };
        let there = values.iter().filter(|value| value.abs() <= LARGEST).count();
        if (there as f64) < FEWEST_VALUES * values.len() as f64 {
            let what = format!(
                "{}: the {} has {there} valid values for {} stamps and is dropped",
                raw.name,
                NAMES[n],
                values.len()
            );
            findings.push(Finding::warning("channel-dropped", what, "record the channel completely"));
            continue;
        }
        let impossible = values.iter().filter(|value| value.abs() > LARGEST).count();
        if impossible > 0 {
            let what = format!(
                "{}: values of the {} beyond ±10¹⁵, {impossible} in all, count as missing",
                raw.name, NAMES[n]
            );
            findings.push(Finding::warning("impossible-values", what, "check the format of the recording"));
        }
        let finite = |value: &f64| if value.abs() <= LARGEST { *value } else { f64::NAN };
        columns[n] = Some(values.iter().map(finite).collect());
    }
    columns
}

/// Returns the channels of `raw` in fixed order.
pub(super) fn channels(raw: &RawRecording) -> [Option<&Vec<f64>>; CHANNELS] {
    [
        raw.position.as_ref(),
        raw.psec.as_ref(),
        raw.velocity.as_ref(),
        raw.current.as_ref(),
        raw.velocity_feedforward.as_ref(),
        raw.torque_feedforward.as_ref(),
        raw.motor_position.as_ref(),
    ]
}

/// Returns true if the position is smoother over the stamps than over the grid, so that the samples were
/// taken at their stamps.
pub(super) fn is_smoother_over_stamps(placed: &UniformGrid, position: &[f64]) -> bool {
    // Travel between the neighbors, and distance from the straight line between them over the grid and over
    // the stamps.
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
    let fast = 0.5 * quantile(&mut triples.iter().map(|t| t.0).collect::<Vec<_>>(), 0.9).unwrap_or(0.0);
    triples.retain(|t| t.0 > 0.0 && t.0 >= fast);
    let even = median(&mut triples.iter().map(|t| t.1).collect::<Vec<_>>()).unwrap_or(0.0);
    let stamped = median(&mut triples.iter().map(|t| t.2).collect::<Vec<_>>()).unwrap_or(0.0);
    triples.len() >= FEWEST_TELLING && stamped < SMOOTHER * even
}

/// Returns the sections of at least `shortest` samples, and the length of the longest section of any length.
pub(super) fn extract_sections(
    name: &str,
    placed: &UniformGrid,
    columns: &ChannelColumns,
    shortest: usize,
    findings: &mut Vec<Finding>,
) -> (Vec<RecordingSection>, usize) {
    report_gaps(name, placed, findings);
    let mut pieces = Vec::new();
    let (mut bridged, mut holes, mut frozen) = (0, 0, Vec::new());
    for block in &placed.blocks {
        let mut dense = if placed.is_uniform {
            place_on_grid(block, columns)
        } else {
            resample(block, columns, placed.period)
        };
        if placed.is_uniform {
            frozen.extend(remove_frozen(&mut dense, block.start, placed.period));
        }
        bridged += (0..CHANNELS).map(|n| interpolate_missing(&mut dense[n], n)).sum::<usize>();
        holes += split_at_holes(&dense, block.start, placed.period, &mut pieces);
    }
    if bridged > 0 {
        let what = format!(
            "{name}: {bridged} missing or dropped values interpolated, in gaps of at most {MAX_BRIDGED} samples"
        );
        findings.push(Finding::note("bridged", what));
    }
    if let Some((begin, _)) = frozen.first() {
        let longest = frozen.iter().map(|(_, length)| *length).fold(0.0, f64::max);
        let samples: usize = placed.blocks.iter().map(|block| block.rows.len()).sum();
        let lost: f64 = frozen.iter().map(|(_, length)| length / placed.period).sum();
        let what = format!(
            "{name}: the position freezes {} during motion, first at {begin:.3} s, for at most {:.1} ms; \
             these samples are dropped",
            if frozen.len() == 1 { "once".to_owned() } else { format!("{} times", frozen.len()) },
            longest * 1e3
        );
        let remedy = if lost > MOSTLY_FROZEN * samples as f64 { "reduce the load on the logger" } else { "" };
        findings.push(Finding::warning("frozen", what, remedy));
    }
    if holes > 0 {
        let what = format!(
            "{name}: {holes} times more than {MAX_BRIDGED} values in a row are missing; the recording is split there"
        );
        findings.push(Finding::warning("hole", what, ""));
    }
    let longest = pieces.iter().map(RecordingSection::len).max().unwrap_or(0);
    let (all, before) = (pieces.len(), pieces.iter().map(RecordingSection::len).sum::<usize>());
    pieces.retain(|piece| piece.len() >= shortest);
    if pieces.len() < all {
        let lost = before - pieces.iter().map(RecordingSection::len).sum::<usize>();
        let what = format!(
            "{name}: {} sections shorter than {shortest} samples dropped, {lost} samples in total",
            all - pieces.len()
        );
        findings.push(Finding::note("short-span", what));
    }
    (pieces, longest)
}

fn report_gaps(name: &str, placed: &UniformGrid, findings: &mut Vec<Finding>) {
    let ends = placed.blocks.windows(2).map(|pair| (pair[0].stamps.last(), pair[1].stamps.first()));
    let gaps: Vec<(f64, f64)> = ends.filter_map(|(a, b)| Some((*a?, b? - a?))).collect();
    let Some((begin, _)) = gaps.first() else { return };
    let longest = gaps.iter().map(|(_, length)| *length).fold(0.0, f64::max);
    let what = format!(
        "{name}: {} gaps, the first at {begin:.3} s, the longest of {:.1} ms; the recording is split there",
        gaps.len(),
        longest * 1e3
    );
    findings.push(Finding::warning("gap", what, ""));
}

/// Places the samples of a block in their slots; empty slots are NaN.
fn place_on_grid(block: &SampleBlock, columns: &ChannelColumns) -> ChannelColumns {
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

/// Interpolates the samples of a block from their stamps to the grid.
fn resample(block: &SampleBlock, columns: &ChannelColumns, period: f64) -> ChannelColumns {
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
                interpolate(&nodes, at, time, period, is_smooth(n))
            })
            .collect()
    };
    std::array::from_fn(|n| columns[n].as_ref().map(|values| interpolate((n, values))))
}

/// Returns true for positions and velocities.
fn is_smooth(channel: usize) -> bool {
    channel <= VELOCITY || channel == MOTOR_POSITION
}

/// Interpolates at `time` between node `at` and the next one: cubic if `smooth`, otherwise linear.
fn interpolate(nodes: &[(f64, f64)], at: usize, time: f64, period: f64, smooth: bool) -> f64 {
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
    // Slopes of the parabola through three nodes; of the straight line at an end.
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

/// Removes samples where the position freezes during motion and then jumps. Returns start and length of each
/// run, s.
fn remove_frozen(dense: &mut ChannelColumns, start: f64, period: f64) -> Vec<(f64, f64)> {
    let Some(position) = &dense[POSITION] else { return Vec::new() };
    let steps: Vec<f64> = position.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let sizes = steps.iter().map(|step| step.abs()).filter(|size| *size > 0.0);
    let resolution = sizes.reduce(f64::min).unwrap_or(0.0);
    let mut frozen = Vec::new();
    let mut n = 0;
    while n < steps.len() {
        let run = steps[n..].iter().take_while(|step| **step == 0.0).count();
        let end = n + run;
        if run >= FROZEN && end < steps.len() && is_frozen(&steps, n, end, resolution) {
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

/// Returns true if the zero steps `n..end` are a frozen signal, judged by the motion before and behind them. A jump of few
/// increments of the encoder is a slow motion.
fn is_frozen(steps: &[f64], n: usize, end: usize, resolution: f64) -> bool {
    let common = |steps: &[f64]| {
        median(&mut steps.iter().copied().filter(|s| !s.is_nan()).collect::<Vec<_>>()).unwrap_or(0.0)
    };
    let before = common(&steps[n.saturating_sub(ABOUT)..n]);
    let after = common(&steps[end + 1..(end + 1 + ABOUT).min(steps.len())]);
    let step = 0.5 * (before + after);
    let leap = steps[end] / step;
    let is_creeping = steps[end].abs() <= CREEPING * resolution;
    !is_creeping && before * after > 0.0 && leap >= LEAP && leap >= LEAP_PER_SAMPLE * (end - n + 1) as f64
}

/// Interpolates runs of at most [`MAX_BRIDGED`] missing values. Returns the number of interpolated values.
fn interpolate_missing(column: &mut Option<Vec<f64>>, channel: usize) -> usize {
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
                *missing = interpolate(&nodes, before, j as f64, 1.0, is_smooth(channel));
            }
            bridged += run;
        }
        n += run + 1;
    }
    bridged
}

/// Appends the sections in which every channel has a value. Returns the number of holes between them.
fn split_at_holes(
    dense: &ChannelColumns,
    start: f64,
    period: f64,
    pieces: &mut Vec<RecordingSection>,
) -> usize {
    let count = dense[POSITION].as_ref().map_or(0, Vec::len);
    let whole = |n: usize| dense.iter().flatten().all(|column| !column[n].is_nan());
    let (mut parts, mut n) = (0, 0);
    while n < count {
        let run = (n..count).take_while(|&n| whole(n)).count();
        if run > 0 {
            parts += 1;
            let columns =
                std::array::from_fn(|c| dense[c].as_ref().map(|column| column[n..n + run].to_vec()));
            pieces.push(RecordingSection { start: start + n as f64 * period, columns });
        }
        n += run + 1;
    }
    usize::saturating_sub(parts, 1)
}
