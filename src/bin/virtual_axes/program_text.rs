//! Sentences on path and feed of a program.

use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::path::Program;
use virtual_axes_core::units::{DEGREE, MILLIMETER};

use crate::axis::AxisUnits;

/// Fraction of the programmed feed below which a remark says that it is not reached.
const REACHED: f64 = 0.5;
/// Distance of start and end below which a path is closed, and range of a joint below which it stands still, m or rad.
const RESOLUTION: f64 = 1e-9;
/// Number of intervals in which the range of the joints is evaluated.
const SAMPLES: u32 = 2000;
/// Distance in time over which the speed of a joint is evaluated, s.
const PROBE: f64 = 1e-4;
/// Fraction of the velocity limit from which a joint is at its limit.
const AT_LIMIT: f64 = 0.995;

/// Returns a warning if the program reaches less than half of its highest programmed feed, with the limit that acts at
/// the highest feed.
pub fn unreached_feed(program: &Program, axes: &[AxisConfig]) -> Option<String> {
    let (programmed, (highest, time)) = (program.programmed_feed(), program.highest_feed());
    if highest >= REACHED * programmed {
        return None;
    }
    let (unit, symbol) = feed_unit(axes, &ranges(program));
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
        "feed {:.2} {symbol} not reached, at most {:.2} {symbol}, limited by {limit}",
        programmed / unit,
        highest / unit
    ))
}

/// Returns size and symbol of the unit of feeds: rpm if only rotary axes move, else m/min.
fn feed_unit(axes: &[AxisConfig], ranges: &[[f64; 2]]) -> (f64, &'static str) {
    let moves = |kind| axes.iter().zip(ranges).any(|(axis, range)| axis.kind() == kind && moves(range));
    let is_rotary = moves(AxisKind::Rotary) && !moves(AxisKind::Linear);
    let units = AxisUnits::for_kind(if is_rotary { AxisKind::Rotary } else { AxisKind::Linear });
    (units.speed, units.speed_name)
}

fn moves(range: &[f64; 2]) -> bool {
    range[1] - range[0] > RESOLUTION
}

/// Returns the joint positions at a progress along the path.
fn joints(program: &Program, progress: f64) -> Vec<f64> {
    let mut out = vec![0.0; program.path().joint_count()];
    program.path().joints(progress, &mut out);
    out
}

/// Returns the range of each joint on the path.
fn ranges(program: &Program) -> Vec<[f64; 2]> {
    let mut ranges: Vec<[f64; 2]> = joints(program, 0.0).iter().map(|value| [*value; 2]).collect();
    for sample in 1..=SAMPLES {
        let at = joints(program, program.path().length() * f64::from(sample) / f64::from(SAMPLES));
        for (range, value) in ranges.iter_mut().zip(at) {
            *range = [range[0].min(value), range[1].max(value)];
        }
    }
    ranges
}

/// Returns highest feed and path length, then a line with start, end and range of each joint that moves.
pub fn description(program: &Program, axes: &[AxisConfig]) -> String {
    let length = program.path().length();
    let (start, end) = (joints(program, 0.0), joints(program, length));
    let ranges = ranges(program);
    let is_closed = start.iter().zip(&end).all(|(start, end)| (start - end).abs() < RESOLUTION);
    let (unit, symbol) = feed_unit(axes, &ranges);
    let length = match symbol {
        "rpm" => format!("{:.3}°", length / DEGREE),
        _ => format!("{:.3} mm", length / MILLIMETER),
    };
    let mut text = format!("highest feed: {:.2} {symbol}\n", program.highest_feed().0 / unit);
    text += &format!("path: {length}, {}\n", if is_closed { "closed" } else { "open" });
    for (((axis, range), start), end) in axes.iter().zip(ranges).zip(start).zip(end) {
        if moves(&range) {
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
    format!(
        "{}: start {start} {unit}, end {end} {unit}, range {low} to {high} {unit}{}\n",
        axis.name(),
        highest.unwrap_or_default()
    )
}

/// Returns a number with three decimals, without a negative zero.
fn millis(value: f64) -> String {
    let text = format!("{value:.3}");
    if text == "-0.000" { "0.000".to_owned() } else { text }
}
