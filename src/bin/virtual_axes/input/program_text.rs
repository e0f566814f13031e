//! Sentences on path and feed of a program.

use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::path::{Block, Program};
use virtual_axes_core::units::{DEGREE, MILLIMETER};

use crate::arguments::axis::AxisUnits;
use crate::output::text_table;

/// Fraction of the programmed feed below which a remark says that it is not reached.
const REACHED: f64 = 0.5;
/// Distance of start and end below which a path is closed, and range of a joint below which it stands still, m or rad.
const RESOLUTION: f64 = 1e-9;
/// Number of intervals of the path in which the range of the joints is evaluated, and the fewest of a move.
const SAMPLES: usize = 2000;
const FEWEST_SAMPLES: usize = 4;
/// Distance in time over which the speed of a joint is evaluated, s.
const PROBE: f64 = 1e-4;
/// Fraction of the velocity limit from which a joint is at its limit.
const AT_LIMIT: f64 = 0.995;

/// Returns a warning if linear or rotary moves reach less than half of their highest programmed feed, with the limit that
/// acts at the highest feed.
pub fn unreached_feed(program: &Program, axes: &[AxisConfig]) -> Option<String> {
    let is_unreached =
        |&kind: &AxisKind| program.highest_feed(kind).0 < REACHED * program.programmed_feed(kind);
    let kind = kinds(program).find(is_unreached)?;
    let (highest, time) = program.highest_feed(kind);
    let psec = |time: f64| {
        let mut out = vec![0.0; program.path().joint_count()];
        program.psec(time, &mut out);
        out
    };
    let (before, after) = (psec(time - PROBE), psec(time + PROBE));
    let speed = before.iter().zip(&after).map(|(before, after)| (after - before).abs() / (2.0 * PROBE));
    let fastest = axes.iter().zip(speed).find(|(axis, speed)| *speed >= AT_LIMIT * axis.limits().velocity);
    let limit = match fastest {
        Some((axis, _)) => format!("velocity of {}", axis.name()),
        None => "acceleration and jerk on these moves".to_owned(),
    };
    Some(format!(
        "feed {} not reached, at most {}, limited by {limit}",
        feed_text(program.programmed_feed(kind), kind),
        feed_text(highest, kind)
    ))
}

/// Returns the kinds of the moves.
fn kinds(program: &Program) -> impl Iterator<Item = AxisKind> {
    [AxisKind::Linear, AxisKind::Rotary].into_iter().filter(|kind| program.programmed_feed(*kind) > 0.0)
}

/// Formats a feed, m/s or rad/s, in m/min or rpm.
fn feed_text(feed: f64, kind: AxisKind) -> String {
    let units = AxisUnits::for_kind(kind);
    format!("{:.2} {}", feed / units.speed, units.speed_name)
}

/// Returns the joint positions at a progress along the path.
fn joints(program: &Program, progress: f64) -> Vec<f64> {
    let mut out = vec![0.0; program.path().joint_count()];
    program.path().joints(progress, &mut out);
    out
}

/// Returns the range of each joint on the path.
fn ranges(program: &Program) -> Vec<[f64; 2]> {
    let path = program.path();
    let mut ranges: Vec<[f64; 2]> = joints(program, 0.0).iter().map(|value| [*value; 2]).collect();
    let intervals = (SAMPLES / path.blocks().len()).max(FEWEST_SAMPLES);
    for (index, block) in path.blocks().iter().enumerate() {
        for sample in 1..=intervals {
            let share = sample as f64 / intervals as f64;
            let at = joints(program, path.start_of(index) + share * block.length());
            for (range, value) in ranges.iter_mut().zip(at) {
                *range = [range[0].min(value), range[1].max(value)];
            }
        }
    }
    ranges
}

/// Returns highest feed and path length, then a line with start, end and range of each joint that moves.
pub fn description(program: &Program, axes: &[AxisConfig]) -> String {
    let path = program.path();
    let (start, end) = (joints(program, 0.0), joints(program, path.length()));
    let is_closed = start.iter().zip(&end).all(|(start, end)| (start - end).abs() < RESOLUTION);
    let feeds: Vec<String> =
        kinds(program).map(|kind| feed_text(program.highest_feed(kind).0, kind)).collect();
    let length = |kind| {
        let blocks = path.blocks().iter().filter(|block| block.kind() == kind);
        let length: f64 = blocks.map(Block::length).sum();
        match kind {
            AxisKind::Linear => format!("{:.3} mm", length / MILLIMETER),
            AxisKind::Rotary => format!("{:.3}°", length / DEGREE),
        }
    };
    let lengths: Vec<String> = kinds(program).map(length).collect();
    let shape = if is_closed { "closed" } else { "open" };
    let mut text = format!("highest feed: {}\npath: {}, {shape}\n", feeds.join(", "), lengths.join(", "));
    for (((axis, range), start), end) in axes.iter().zip(ranges(program)).zip(start).zip(end) {
        if range[1] - range[0] > RESOLUTION {
            text += &joint_line(axis, [start, end], range, None);
        }
    }
    text
}

/// Returns a line with start, end, range and, if known, highest speed of a joint.
pub fn joint_line(axis: &AxisConfig, ends: [f64; 2], range: [f64; 2], highest: Option<f64>) -> String {
    let AxisUnits { length, length_name: unit, speed, speed_name, .. } = AxisUnits::for_kind(axis.kind());
    let [start, end] = ends.map(|value| millis(value / length));
    let [low, high] = range.map(|value| millis(value / length));
    let highest = highest.map(|value| format!(", at most {:.2} {speed_name}", value / speed));
    text_table::wrapped_line(&format!(
        "{}: start {start} {unit}, end {end} {unit}, range {low} to {high} {unit}{}",
        axis.name(),
        highest.unwrap_or_default()
    ))
}

/// Returns a number with three decimals, without a negative zero.
fn millis(value: f64) -> String {
    let text = format!("{value:.3}");
    if text == "-0.000" { "0.000".to_owned() } else { text }
}
