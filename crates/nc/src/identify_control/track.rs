//! Motions of a program and the place of each sample of a log on them.

use super::log::{ControlLog, LogAccuracy};
use crate::motion::{
    AXIS_COUNT, AXIS_LETTERS, Coordinates, Feed, MotionKind, PathControl, ProgramEvent, ProgramMotion,
    ProgramStep, is_rotary,
};
use std::f64::consts::{PI, TAU};
use virtual_axes_core::units::Rounded;

/// Length that counts for one radian of a rotary axis, m.
pub(super) const ROTARY_LENGTH: f64 = 0.1;
/// Distance of the first sample from the start of the program below which the log begins there, m.
const START_DISTANCE: f64 = 5e-5;
/// Largest distance of a sample from its motion, m, besides a fifth of the motion.
const MOST_DISTANCE: f64 = 5e-3;

/// Factors of positions in a wrong unit, the right one, and the wrong one.
const UNITS: [(f64, &str, &str); 6] = [
    (1e3, "mm", "m"),
    (25.4, "mm", "in"),
    (1e3 / 25.4, "in", "m"),
    (1e-3, "m", "mm"),
    (1.0 / 25.4, "in", "mm"),
    (25.4e-3, "m", "in"),
];
/// Relative difference of equal distances in different units.
const SAME_UNIT: f64 = 0.2;

/// Motion of a program with its coordinates.
#[derive(Debug, Clone)]
pub(super) struct TrackedMotion {
    pub line: usize,
    pub from: Coordinates,
    pub to: Coordinates,
    /// TrackedArc with the indices of its axes, its radius and the angle of its start.
    pub arc: Option<TrackedArc>,
    /// Length, in the metric in which 1 rad of a rotary axis is 0.1 m.
    pub length: f64,
    /// Programmed feed, m/s or rad/s; infinite at rapid traverse.
    pub feed: f64,
    pub path_control: PathControl,
    /// Duration of the dwell behind the motion, s.
    pub dwell: Option<f64>,
}

/// Circular arc.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrackedArc {
    pub plane: [usize; 2],
    pub center: [f64; 2],
    pub radius: f64,
    pub phase: f64,
    pub sweep: f64,
}

/// Returns the length that counts for a unit of an axis.
pub(super) fn weight(axis: usize) -> f64 {
    if is_rotary(axis) { ROTARY_LENGTH } else { 1.0 }
}

/// Returns the distance of two positions.
pub(super) fn distance(a: &Coordinates, b: &Coordinates) -> f64 {
    (0..AXIS_COUNT).map(|i| (weight(i) * (a[i] - b[i])).powi(2)).sum::<f64>().sqrt()
}

impl TrackedMotion {
    fn new(motion: &ProgramMotion) -> Result<Option<Self>, String> {
        if motion.tcp_length.is_some() {
            return Err(format!(
                "line {}: motions with tool center point control (G43.4) cannot be compared with setpoints of axes; use a \
                 program without it",
                motion.line
            ));
        }
        let (from, to) = (motion.start, motion.end);
        let mut length = distance(&from, &to);
        let arc = match &motion.kind {
            MotionKind::Rapid | MotionKind::Line => None,
            MotionKind::Arc(arc) => {
                let [x, y, _] = arc.plane.axes();
                let offset = [from[x] - arc.center[0], from[y] - arc.center[1]];
                let radius = offset[0].hypot(offset[1]);
                let across = (0..AXIS_COUNT).filter(|&i| i != x && i != y);
                let others = across.map(|i| (weight(i) * (to[i] - from[i])).powi(2)).sum::<f64>().sqrt();
                length = others.hypot(radius * arc.sweep);
                let phase = offset[1].atan2(offset[0]);
                Some(TrackedArc { plane: [x, y], center: arc.center, radius, phase, sweep: arc.sweep })
            }
            MotionKind::Nurbs(_) => {
                return Err(format!("line {}: splines (G5.2) are not supported", motion.line));
            }
        };
        let feed = match motion.feed {
            Feed::Rapid => f64::INFINITY,
            Feed::Linear(feed) | Feed::Rotary(feed) => feed,
            Feed::Duration(time) => length / time,
        };
        let (line, path_control) = (motion.line, motion.path_control);
        Ok((length > 0.0).then_some(Self { line, from, to, arc, length, feed, path_control, dwell: None }))
    }

    /// Returns the only axis that moves along a straight line.
    pub fn single_axis(&self) -> Option<usize> {
        let mut moving = (0..AXIS_COUNT).filter(|&i| self.from[i] != self.to[i]);
        match (moving.next(), moving.next(), &self.arc) {
            (Some(axis), None, None) => Some(axis),
            _ => None,
        }
    }

    /// Returns true if only X, Y and Z move.
    pub fn is_linear(&self) -> bool {
        (3..AXIS_COUNT).all(|i| self.from[i] == self.to[i])
    }

    /// Returns the direction of a straight line, of length 1 in the metric.
    pub fn direction(&self) -> Coordinates {
        std::array::from_fn(|i| weight(i) * (self.to[i] - self.from[i]) / self.length)
    }

    /// Returns the place along the motion, in its length, at or beyond its ends too; that of an arc is the nearest one to
    /// the place `near`.
    pub fn place(&self, position: &Coordinates, near: f64) -> f64 {
        match &self.arc {
            None => {
                let direction = self.direction();
                (0..AXIS_COUNT).map(|i| direction[i] * weight(i) * (position[i] - self.from[i])).sum()
            }
            Some(arc) => {
                let [x, y] = arc.plane;
                let angle = (position[y] - arc.center[1]).atan2(position[x] - arc.center[0]) - arc.phase;
                let turned = arc.sweep.signum() * angle;
                let near = near / self.length * arc.sweep.abs();
                let difference = (turned - near + PI).rem_euclid(TAU) - PI;
                (near + difference) * self.length / arc.sweep.abs()
            }
        }
    }

    /// Returns the position at a place.
    pub fn position(&self, place: f64) -> Coordinates {
        let part = place / self.length;
        let mut position: Coordinates =
            std::array::from_fn(|i| self.from[i] + part * (self.to[i] - self.from[i]));
        if let Some(arc) = &self.arc {
            let (sine, cosine) = (arc.phase + arc.sweep * part).sin_cos();
            position[arc.plane[0]] = arc.center[0] + arc.radius * cosine;
            position[arc.plane[1]] = arc.center[1] + arc.radius * sine;
        }
        position
    }

    /// Returns the place on the motion from `from` on that is nearest to a position, and its distance.
    fn nearest(&self, position: &Coordinates, from: f64) -> (f64, f64) {
        let place = self.place(position, from).clamp(from, self.length);
        (place, distance(position, &self.position(place)))
    }
}

/// Program with the samples of each motion.
#[derive(Debug)]
pub(super) struct Track<'a> {
    pub log: &'a ControlLog,
    pub motions: Vec<TrackedMotion>,
    /// Samples of each motion: the first one, and the one behind the last.
    pub samples: Vec<[usize; 2]>,
    /// True if the axes do not move from this sample to the next one.
    pub is_at_rest: Vec<bool>,
}

/// Returns the motions of a program.
pub(super) fn motions<E: std::fmt::Display>(
    steps: impl Iterator<Item = Result<ProgramStep, E>>,
) -> Result<Vec<TrackedMotion>, String> {
    let mut motions: Vec<TrackedMotion> = Vec::new();
    for step in steps {
        match step.map_err(|error| error.to_string())? {
            ProgramStep::Motion(motion) => motions.extend(TrackedMotion::new(&motion)?),
            ProgramStep::Event { event: ProgramEvent::Dwell(time) | ProgramEvent::Pause(time), .. } => {
                if let Some(last) = motions.last_mut() {
                    *last.dwell.get_or_insert(0.0) += time;
                }
            }
            ProgramStep::Event { event: ProgramEvent::End, .. } => break,
            ProgramStep::Event { .. } => {}
        }
    }
    Ok(motions)
}

impl<'a> Track<'a> {
    /// Finds the motion of each sample.
    ///
    /// # Errors
    ///
    /// Returns an error if the log is not one of the program.
    pub fn new(log: &'a ControlLog, motions: Vec<TrackedMotion>) -> Result<Self, String> {
        let Some(first) = motions.first() else { return Err("the program has no motion".to_owned()) };
        for (axis, letter) in AXIS_LETTERS.iter().enumerate() {
            let moves =
                motions.iter().any(|motion| motion.from[axis] != motion.to[axis] || motion.moves(axis));
            if moves && !log.has_axis[axis] {
                return Err(format!(
                    "the program moves {letter}, of which the log has no setpoints; see --column"
                ));
            }
        }
        let near = |point: &Coordinates| {
            log.positions.iter().position(|position| distance(position, point) < START_DISTANCE)
        };
        // A control starts where the axes are: at the start of the program, or at the end of its first motion.
        let starts = log.positions.first().is_some_and(|p| distance(p, &first.from) < START_DISTANCE);
        let (mut current, mut sample) = match (starts, near(&first.to)) {
            (true, _) => (0, 0),
            (false, Some(sample)) if motions.len() > 1 => (1, sample),
            _ => {
                return Err(format!(
                    "no sample of the log is at the end of the first motion, line {}: {}the log starts late, or work offset \
                     (--work-offset), tool length or columns (--column) differ",
                    first.line,
                    wrong_unit(log, &motions)
                ));
            }
        };
        let mut samples = vec![[0, 0]; motions.len()];
        samples[current][0] = sample;
        let mut place = 0.0;
        let tolerance = 1e-9 + log.accuracy.resolution;
        // Estimated setpoints can run back.
        let slack = if log.accuracy.is_estimated() { 20.0 * log.accuracy.resolution } else { 0.0 };
        let mut worst = (0.0, 0, 0);
        while let Some(position) = log.positions.get(sample) {
            let (mut at, mut away) = motions[current].nearest(position, (place - slack).max(0.0));
            while let Some(next) = motions.get(current + 1) {
                let (next_at, next_away) = next.nearest(position, 0.0);
                let is_past = at.max(place) >= motions[current].length - tolerance && next_at > tolerance;
                if next_away + tolerance.max(slack) < away || (is_past && next_away <= away + tolerance) {
                    samples[current][1] = sample;
                    current += 1;
                    samples[current][0] = sample;
                    (at, away, place) = (next_at, next_away, next_at);
                } else {
                    break;
                }
            }
            place = at.max(place);
            let excess = away - 0.2 * motions[current].length;
            if excess > worst.0 {
                worst = (excess, current, sample);
            }
            sample += 1;
        }
        samples[current][1] = log.positions.len();
        let (excess, motion, sample) = worst;
        if excess > MOST_DISTANCE {
            return Err(format!(
                "the setpoints depart by {:.3} mm from line {} at {:.3} s: {}the log starts late or is not of this program, \
                 or work offset (--work-offset), tool length or columns (--column) differ",
                1e3 * (excess + 0.2 * motions[motion].length),
                motions[motion].line,
                sample as f64 * log.period,
                wrong_unit(log, &motions)
            ));
        }
        let left = motions.len() - 1 - current;
        if left > 0 {
            return Err(format!(
                "the log ends on line {}; {left} motions of the program are left: {}it ends early or starts late",
                motions[current].line,
                wrong_unit(log, &motions)
            ));
        }
        let LogAccuracy { resolution, window, .. } = log.accuracy;
        let at_rest = |samples: &[Coordinates]| {
            samples.iter().all(|sample| distance(&samples[0], sample) <= 2.0 * resolution)
        };
        let ends = std::iter::repeat_n(true, window);
        let is_at_rest =
            log.positions.windows(window + 1).map(at_rest).chain(ends).take(log.positions.len()).collect();
        Ok(Self { log, motions, samples, is_at_rest })
    }

    /// Returns the largest distance of a rest from the end of its motion, m.
    pub fn rest_tolerance(&self) -> f64 {
        1e-7 + 4.0 * self.log.accuracy.resolution
    }

    /// Returns the samples from the last one at rest before a motion to the first one at rest behind it; `None` where the
    /// axes do not rest. A rest has at least two steps.
    pub fn rests(&self, motion: usize) -> [Option<usize>; 2] {
        // Samples between the rest and the motion.
        let reach = 2 * (self.log.accuracy.window + 1);
        let [first, end] = self.samples[motion];
        let rests = |sample: usize| {
            sample >= 1
                && sample < self.is_at_rest.len()
                && self.is_at_rest[sample - 1]
                && self.is_at_rest[sample]
        };
        let near = |sample: usize, point: &Coordinates| {
            distance(&self.log.positions[sample], point) <= self.rest_tolerance()
        };
        let TrackedMotion { from, to, .. } = &self.motions[motion];
        let before = (first.saturating_sub(reach)..=first + reach)
            .filter(|&i| i >= 1 && i < end && rests(i - 1) && near(i, from))
            .max()
            .or((first == 0).then_some(0));
        let before = before.map(|mut sample| {
            while sample + 1 < end && self.is_at_rest[sample] {
                sample += 1;
            }
            sample
        });
        let start = before.unwrap_or(first);
        let after = (start + 1..(end + reach).min(self.is_at_rest.len())).find(|&i| {
            near(i, to) && self.is_at_rest[i] && self.is_at_rest.get(i + 1).copied().unwrap_or(true)
        });
        [before, after]
    }

    /// Returns the places of the samples in a range along a motion.
    pub fn places(&self, motion: usize, range: std::ops::Range<usize>) -> Vec<f64> {
        let mut near = 0.0;
        let place = |sample: usize| {
            near = self.motions[motion].place(&self.log.positions[sample], near);
            near
        };
        range.map(place).collect()
    }
}

/// Returns the reason if the log has positions in a wrong unit, by the largest distance that an axis moves; otherwise nothing.
fn wrong_unit(log: &ControlLog, motions: &[TrackedMotion]) -> String {
    let range = |positions: &mut dyn Iterator<Item = f64>| {
        let [low, high] = positions.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], position| {
            [low.min(position), high.max(position)]
        });
        (high - low).max(0.0)
    };
    let ends = |axis: usize| range(&mut motions.iter().skip(1).map(|motion| motion.to[axis]));
    let Some(axis) = (0..AXIS_COUNT)
        .filter(|&axis| !is_rotary(axis) && log.has_axis[axis])
        .max_by(|a, b| ends(*a).total_cmp(&ends(*b)))
    else {
        return String::new();
    };
    let factor = range(&mut log.positions.iter().map(|position| position[axis])) / ends(axis);
    let found = UNITS.iter().find(|(of_unit, ..)| (factor / of_unit - 1.0).abs() < SAME_UNIT);
    found.map_or_else(String::new, |(of_unit, right, wrong)| {
        let letter = AXIS_LETTERS[axis];
        format!(
            "{letter} moves {} times as far as in the program: its unit is {right}, not {wrong} (--column \
             {}=COLUMN[{right}]); otherwise ",
            Rounded(*of_unit),
            letter.to_ascii_lowercase()
        )
    })
}

impl TrackedMotion {
    /// Returns true if an arc moves an axis.
    fn moves(&self, axis: usize) -> bool {
        self.arc.is_some_and(|arc| arc.plane.contains(&axis))
    }
}
