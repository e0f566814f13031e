//! Sentences on path and feed of a program.

use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::path::Program;
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER};

/// Fraction of the programmed feed below which a remark says that it is not reached.
const REACHED: f64 = 0.5;
/// Distance of start and end below which a path is closed, and range of a joint below which it stands still, m or rad.
const RESOLUTION: f64 = 1e-9;
/// Number of intervals in which the range of the joints is evaluated.
const SAMPLES: u32 = 2000;

/// Returns a remark if the program reaches less than half of its highest programmed feed.
pub fn unreached_feed(program: &Program) -> Option<String> {
    let (programmed, highest) = (program.programmed_feed(), program.highest_feed());
    (highest < REACHED * programmed).then(|| {
        format!(
            "the programmed feed of {:.2} m/min is not reached; the highest feed is {:.2} m/min",
            programmed / METER_PER_MINUTE,
            highest / METER_PER_MINUTE
        )
    })
}

/// Returns highest feed and path length, then a line with start, end and range of each joint that moves.
pub fn description(program: &Program, axes: &[AxisConfig]) -> String {
    let path = program.path();
    let joints = |progress: f64| {
        let mut out = vec![0.0; path.joint_count()];
        path.joints(progress, &mut out);
        out
    };
    let (start, end) = (joints(0.0), joints(path.length()));
    let mut range: Vec<[f64; 2]> = start.iter().map(|value| [*value; 2]).collect();
    for sample in 1..=SAMPLES {
        let at = joints(path.length() * f64::from(sample) / f64::from(SAMPLES));
        for (range, value) in range.iter_mut().zip(at) {
            *range = [range[0].min(value), range[1].max(value)];
        }
    }
    let is_closed = start.iter().zip(&end).all(|(start, end)| (start - end).abs() < RESOLUTION);
    let is_linear = |axis: &AxisConfig| axis.kind() == AxisKind::Linear;
    let moves = |range: &[f64; 2]| range[1] - range[0] > RESOLUTION;
    let has_linear = axes.iter().zip(&range).any(|(axis, range)| is_linear(axis) && moves(range));
    let (length, feed) = if has_linear {
        (format!("{:.3} mm", path.length() / MILLIMETER), program.highest_feed() / METER_PER_MINUTE)
    } else {
        (format!("{:.3}°", path.length() / DEGREE), 0.0)
    };
    let mut text = if feed > 0.0 { format!("highest feed: {feed:.2} m/min\n") } else { String::new() };
    text += &format!("path: {length}, {}\n", if is_closed { "closed" } else { "open" });
    for (((axis, range), start), end) in axes.iter().zip(&range).zip(start).zip(end) {
        if moves(range) {
            let (unit, scale) = if is_linear(axis) { ("mm", MILLIMETER) } else { ("°", DEGREE) };
            let [start, end, low, high] = [start, end, range[0], range[1]].map(|value| millis(value / scale));
            text += &format!("{}: {start} to {end} {unit}, range {low} to {high} {unit}\n", axis.name());
        }
    }
    text
}

/// Returns a number with three decimals, without a negative zero.
fn millis(value: f64) -> String {
    let text = format!("{value:.3}");
    if text == "-0.000" { "0.000".to_owned() } else { text }
}
