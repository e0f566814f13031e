//! Circular arcs and helices: G2, G3 with I J K or R, and P.

use std::f64::consts::TAU;

use virtual_axes_core::units::{MILLIMETER, Rounded};

use super::dialect::Dialect;
use super::error::Outcome;
use super::limits::{MAX_LENGTH, MAX_TURNS};
use super::line_words::LineWords;
use super::state::State;
use crate::motion::{AXIS_LETTERS, Coordinates, PlanarArc};

/// Letters of the arc center along X, Y and Z.
const CENTERS: [char; 3] = ['I', 'J', 'K'];
/// Distance below which start and end are the same point, a full circle, and smallest radius, m.
const POINT: f64 = 1e-9;
/// Difference of the radii at start and end that is always accepted, m.
const RADIUS_TOLERANCE: f64 = 5e-6;
/// Difference of the radii that is accepted relative to the radius, up to `MAX_RADIUS_ERROR`.
const RELATIVE_RADIUS_TOLERANCE: f64 = 1e-3;
/// Largest difference of the radii, m.
const MAX_RADIUS_ERROR: f64 = 0.5 * MILLIMETER;

impl State {
    /// Executes an arc.
    pub(super) fn arc(&mut self, block: &mut LineWords, is_clockwise: bool) -> Outcome<()> {
        // P of Marlin are full circles before the arc.
        let before = if self.dialect == Dialect::Marlin { 1.0 } else { 0.0 };
        let turns = block.take('P').map_or(1.0, |turns| turns + before);
        if turns.fract() != 0.0 || !(1.0..=MAX_TURNS).contains(&turns) {
            return Err(format!("word P: {turns} turns, an integer from 1 to {MAX_TURNS} is required"));
        }
        let [first, second, _] = self.modal.plane.axes();
        let has_end = block.has_any(&[AXIS_LETTERS[first], AXIS_LETTERS[second]]) || block.polar != [None; 2];
        if self.dialect == Dialect::Grbl && !has_end {
            let [first, second] = [first, second].map(|axis| AXIS_LETTERS[axis]);
            return Err(format!("grbl requires {first} or {second} in the line of an arc (error 32)"));
        }
        let (start, end) = (self.programmed(), self.targets(block)?);
        if self.dialect == Dialect::Fanuc && block.get('R').is_some() {
            // R comes before the center; without a distance to the end it is an arc of 0°.
            block.skip("IJK");
            let chord = (end[first] - start[first]).hypot(end[second] - start[second]);
            if has_end && chord < POINT {
                block.take('R');
                return self.line_to(&end);
            }
        }
        let center = match block.take('R') {
            Some(_) if block.has_any(&CENTERS) => return Err("word R excludes I, J and K".to_owned()),
            Some(_) if !has_end => return Err("an arc with R requires an end point in its plane".to_owned()),
            Some(radius) => {
                center_by_radius([&start, &end], [first, second], radius * self.modal.length, is_clockwise)?
            }
            None => self.center_by_words(block, &start)?,
        };
        let [from, to] = [&start, &end].map(|point| [point[first] - center[0], point[second] - center[1]]);
        require_radii(from, to)?;
        let angle = sweep(from, to, is_clockwise);
        let sweep = angle + TAU * (turns - 1.0) * angle.signum();
        self.arc_to(&PlanarArc { plane: self.modal.plane, center, sweep }, &end)
    }

    /// Returns the center by I, J, K, m.
    pub(super) fn center_by_words(&self, block: &mut LineWords, start: &Coordinates) -> Outcome<[f64; 2]> {
        let [first, second, normal] = self.modal.plane.axes();
        let letters = [CENTERS[first], CENTERS[second]];
        // grbl does not read the third word; posts write it as 0.
        let is_unused = |word: f64| match self.dialect {
            Dialect::Grbl | Dialect::Marlin => true,
            Dialect::LinuxCnc => false,
            _ => word == 0.0,
        };
        if block.get(CENTERS[normal]).is_some_and(is_unused) {
            block.take(CENTERS[normal]);
        } else if block.get(CENTERS[normal]).is_some() {
            return Err(format!(
                "word {} is not in the plane of the arc, which has {} and {}",
                CENTERS[normal], letters[0], letters[1]
            ));
        }
        let words = letters.map(|letter| block.take(letter));
        let is_absolute = self.modal.has_absolute_centers;
        if words.iter().all(Option::is_none) || (is_absolute && words.iter().any(Option::is_none)) {
            let [one, two] = letters;
            let joint = if is_absolute { "and" } else { "or" };
            return Err(format!("an arc requires R, or its center {one} {joint} {two}"));
        }
        let coordinate = |axis: usize, word: Option<f64>| {
            let reference = if is_absolute { 0.0 } else { start[axis] };
            reference + word.unwrap_or(0.0) * self.modal.length
        };
        Ok([coordinate(first, words[0]), coordinate(second, words[1])])
    }
}

/// Returns the center by the radius, m; a negative radius selects the longer arc.
pub(super) fn center_by_radius(
    [start, end]: [&Coordinates; 2],
    [first, second]: [usize; 2],
    radius: f64,
    is_clockwise: bool,
) -> Outcome<[f64; 2]> {
    let chord = [end[first] - start[first], end[second] - start[second]];
    let half = 0.5 * chord[0].hypot(chord[1]);
    if half < POINT {
        return Err("an arc with R requires an end point that differs from its start; use I, J, K".to_owned());
    }
    if half - radius.abs() > RADIUS_TOLERANCE {
        let [found, least] = [radius.abs(), half].map(|length| Rounded(length / MILLIMETER));
        return Err(format!(
            "word R: radius {found} mm does not reach the end point, at least {least} mm are required"
        ));
    }
    let height = ((radius.abs() - half).max(0.0) * (radius.abs() + half)).sqrt();
    // The center of a short arc is to the left of the chord if the arc turns to the left.
    let side = if is_clockwise == (radius < 0.0) { 1.0 } else { -1.0 };
    let scale = 0.5 * side * height / half;
    Ok([start[first] + 0.5 * chord[0] - scale * chord[1], start[second] + 0.5 * chord[1] + scale * chord[0]])
}

/// Rejects an arc without radius, or with different radii at start and end.
pub(super) fn require_radii(from: [f64; 2], to: [f64; 2]) -> Outcome<()> {
    let [start, end] = [from, to].map(|[x, y]| x.hypot(y));
    if start < POINT || end < POINT {
        return Err("arc of radius 0: check the center".to_owned());
    }
    if start > MAX_LENGTH {
        let [found, most] = [start, MAX_LENGTH].map(|length| Rounded(length / MILLIMETER));
        return Err(format!(
            "arc of radius {found} mm: at most {most} mm; check the center, or program a straight line"
        ));
    }
    let difference = (start - end).abs();
    let allowed = RADIUS_TOLERANCE.max((RELATIVE_RADIUS_TOLERANCE * start.max(end)).min(MAX_RADIUS_ERROR));
    if difference <= allowed {
        return Ok(());
    }
    let [start, end, allowed] = [start, end, allowed].map(|length| Rounded(length / MILLIMETER));
    Err(format!(
        "arc with radius {start} mm at its start and {end} mm at its end, at most {allowed} mm difference is allowed"
    ))
}

/// Returns the swept angle of at most one turn, rad; positive counterclockwise. `from` and `to` are relative to the
/// center.
pub(super) fn sweep(from: [f64; 2], to: [f64; 2], is_clockwise: bool) -> f64 {
    let direction = if is_clockwise { -1.0 } else { 1.0 };
    if (from[0] - to[0]).hypot(from[1] - to[1]) < POINT {
        return direction * TAU;
    }
    let cross = from[0] * to[1] - from[1] * to[0];
    let dot = from[0] * to[0] + from[1] * to[1];
    let angle = direction * cross.atan2(dot);
    direction * if angle > 0.0 { angle } else { angle + TAU }
}
