//! Speed in rows of short lines, which the block cycle and the look-ahead limit.

use virtual_axes_core::units::MILLISECOND;

use super::control_estimate::ControlEstimate;
use super::identification::ControlIdentification;
use super::law::RampLaw;
use super::track::Track;

/// Fewest lines of a row.
const LEAST_LINES: usize = 20;
/// Parts of a row between which its speed is measured, and the one from which on it is constant.
const PARTS: [f64; 2] = [0.4, 0.6];
const CONSTANT_FROM: f64 = 0.3;
/// Relative difference of equal figures.
const SAME: f64 = 0.02;

/// Row of short lines of one length in one direction.
#[derive(Debug, Clone, Copy)]
struct Row {
    length: f64,
    speed: f64,
    acceleration: f64,
    /// True if feed or the length of the row limits its speed.
    is_free: bool,
}

/// Limits that rows of short lines show.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    pub cycle: Option<ControlEstimate>,
    pub look_ahead: Option<ControlEstimate>,
    /// Longest block cycle and smallest look-ahead that the rows leave.
    pub bounds: Option<[f64; 2]>,
}

impl Blocks {
    pub fn of(track: &Track<'_>, law: &RampLaw) -> Self {
        let rows = rows(track, law);
        let mut blocks = Self::default();
        let cycle = |row: &Row| row.length / row.speed;
        let ahead = |row: &Row| 0.5 * row.speed * row.speed / (row.acceleration * row.length);
        let limits =
            |f: &dyn Fn(&Row) -> f64, of: fn(f64, f64) -> f64, start: f64| rows.iter().map(f).fold(start, of);
        if rows.is_empty() {
            return blocks;
        }
        let bounds = [limits(&cycle, f64::min, f64::INFINITY), limits(&ahead, f64::max, 0.0)];
        blocks.bounds = Some(bounds);
        let limited: Vec<&Row> = rows.iter().filter(|row| !row.is_free).collect();
        let (by_cycle, others): (Vec<&Row>, Vec<&Row>) =
            limited.iter().partition(|row| cycle(row) < bounds[0] * (1.0 + SAME));
        if by_cycle.len() > 1 {
            blocks.cycle = ControlEstimate::of(by_cycle.iter().map(|row| cycle(row)).collect(), 1e-3);
        }
        // The speed varies by a part of 1/(2 N) within a line.
        let rest = if by_cycle.len() > 1 { others } else { limited };
        let counts: Vec<f64> = rest.iter().map(|row| ahead(row) - 0.25).collect();
        let largest = counts.iter().copied().fold(0.0, f64::max);
        let alike: Vec<f64> =
            counts.into_iter().filter(|count| *count > largest * (1.0 - 4.0 * SAME)).collect();
        if alike.len() > 1 {
            blocks.look_ahead = ControlEstimate::of(alike, SAME);
        }
        blocks
    }
}

fn rows(track: &Track<'_>, law: &RampLaw) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut first = 0;
    while first < track.motions.len() {
        let start = &track.motions[first];
        let axis = start.single_axis();
        let continues = |index: usize| {
            let motion = &track.motions[index];
            motion.single_axis() == axis
                && (motion.length / start.length - 1.0).abs() < 1e-3
                && motion.feed == start.feed
                && axis.is_some_and(|axis| {
                    (motion.to[axis] - motion.from[axis]).signum()
                        == (start.to[axis] - start.from[axis]).signum()
                })
                && track.motions[index - 1].dwell.is_none()
        };
        let mut end = first + 1;
        while end < track.motions.len() && continues(end) {
            end += 1;
        }
        let acceleration = axis.and_then(|axis| law.accelerations[axis]);
        if let (true, Some(axis), Some(acceleration)) = (end - first >= LEAST_LINES, axis, acceleration) {
            let scale = (start.to[axis] - start.from[axis]).abs() / start.length;
            let total = start.length * (end - first) as f64;
            let samples = track.samples[first][0]..track.samples[end - 1][1];
            let places = track.places(first, samples);
            let time = |part: f64| {
                let after = places.iter().position(|place| *place >= part * total)?;
                let before = after.checked_sub(1)?;
                let fraction = (part * total - places[before]) / (places[after] - places[before]);
                Some((before as f64 + fraction) * track.log.period)
            };
            if let [Some(early), Some(from), Some(to)] = [CONSTANT_FROM, PARTS[0], PARTS[1]].map(time) {
                let speed = scale * total * (PARTS[1] - PARTS[0]) / (to - from);
                let before = scale * total * (PARTS[0] - CONSTANT_FROM) / (from - early);
                let is_free = speed > (1.0 - SAME) * start.feed || (before / speed - 1.0).abs() > SAME;
                rows.push(Row {
                    length: start.length * scale,
                    speed,
                    acceleration: acceleration.value,
                    is_free,
                });
            }
        }
        first = end;
    }
    rows
}

/// Identifies block cycle and look-ahead.
pub(super) fn identify_blocks(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    let blocks = Blocks::of(track, law);
    let Some([cycle, ahead]) = blocks.bounds else {
        found.not_shown.push(
            "block cycle and look-ahead: no row of short lines of one axis, of the same length, without a corner".to_owned(),
        );
        return;
    };
    match blocks.cycle {
        Some(cycle) => found.push("control.block_cycle_ms", cycle, MILLISECOND, "ms"),
        None => found.not_shown.push(format!(
            "block cycle: at most {:.3} ms; it takes two rows of shorter lines that it limits",
            1e3 * cycle
        )),
    }
    match blocks.look_ahead {
        Some(count) => found.push("control.look_ahead", count, 1.0, "blocks"),
        None => found.not_shown.push(format!(
            "look-ahead: at least {:.0} blocks; it takes rows of short lines at a higher feed that it limits",
            ahead.floor()
        )),
    }
}
