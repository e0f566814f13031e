//! Circles: G2, G3, CIP and CT.

use std::f64::consts::TAU;

use virtual_axes_core::units::DEGREE;

use super::super::arcs::{center_by_radius, require_radii, sweep};
use super::super::error::Outcome;
use super::super::limits::MAX_TURNS;
use super::super::state::State;
use super::Sinumerik;
use super::modes::MotionMode;
use super::motions::{CENTERS, STRAIGHT};
use super::words::{Approach, Words};
use crate::motion::{AXIS_LETTERS, Coordinates, PlanarArc};

/// Letters of the intermediate point of CIP.
const POINTS: [&str; 3] = ["I1", "J1", "K1"];

impl Sinumerik {
    /// Returns the circle of a block, and completes its end; `None` for a straight line (CT along its tangent).
    pub(super) fn circle(
        &mut self,
        words: &mut Words,
        start: &Coordinates,
        end: &mut Coordinates,
        state: &mut State,
    ) -> Outcome<Option<PlanarArc>> {
        let plane = state.modal.plane;
        let [first, second, normal] = plane.axes();
        let point = |coordinates: &Coordinates| [coordinates[first], coordinates[second]];
        let turns = words.number("TURN")?.unwrap_or(0.0);
        if turns.fract() != 0.0 || !(0.0..=MAX_TURNS).contains(&turns) {
            return Err(format!("word TURN: {turns} turns, an integer from 0 to {MAX_TURNS} is required"));
        }
        let mode = self.modes.motion;
        if mode == MotionMode::ThroughPoint {
            let through = self.point_words(words, POINTS, start, state, true)?;
            if (through[normal] - start[normal]).abs() > 1e-9 {
                return Err(format!(
                    "CIP: the circle leaves the plane; program {} without motion along {}",
                    POINTS[normal], AXIS_LETTERS[normal]
                ));
            }
            return through_points(point(start), point(&through), point(end)).map(|(center, angle)| {
                Some(PlanarArc { plane, center, sweep: angle + TAU * turns * angle.signum() })
            });
        }
        if mode == MotionMode::Tangential {
            return self.tangential(point(start), point(end), state).map(|arc| {
                arc.map(|(center, angle)| PlanarArc {
                    plane,
                    center,
                    sweep: angle + TAU * turns * angle.signum(),
                })
            });
        }
        let is_clockwise = mode == MotionMode::Clockwise;
        let sign = if is_clockwise { -1.0 } else { 1.0 };
        let length = state.modal.length;
        let has_center = words.has(CENTERS[first]) || words.has(CENTERS[second]);
        if words.has(CENTERS[normal]) {
            let value = words.number(CENTERS[normal])?.unwrap_or(0.0);
            if value != 0.0 {
                return Err(format!(
                    "word {} is not in the plane of the circle, which has {} and {}",
                    CENTERS[normal], CENTERS[first], CENTERS[second]
                ));
            }
        }
        let opening = words.positive("AR", 360.0)?.map(|angle| angle * DEGREE);
        let radius = words.number("CR")?.map(|radius| radius * length);
        let center = match (radius, has_center, opening) {
            (Some(_), true, _) => return Err("word CR excludes I, J and K".to_owned()),
            (Some(radius), false, _) => {
                center_by_radius([start, end], [first, second], radius, is_clockwise)?
            }
            (None, true, opening) => {
                let center = point(&self.point_words(words, CENTERS, start, state, false)?);
                if let Some(angle) = opening {
                    let (sine, cosine) = (sign * angle).sin_cos();
                    let from = [start[first] - center[0], start[second] - center[1]];
                    end[first] = center[0] + cosine * from[0] - sine * from[1];
                    end[second] = center[1] + sine * from[0] + cosine * from[1];
                    let sweep = sign * (angle + TAU * turns);
                    return Ok(Some(PlanarArc { plane, center, sweep }));
                }
                center
            }
            (None, false, Some(angle)) => {
                let chord = [end[first] - start[first], end[second] - start[second]];
                // Half the chord over the distance of the center, to the left of the chord.
                let height = 0.5 * sign / (0.5 * angle).tan();
                if chord == [0.0; 2] || !height.is_finite() {
                    return Err("AR requires an end point that differs from the start, or I, J, K".to_owned());
                }
                let center = [
                    start[first] + 0.5 * chord[0] - height * chord[1],
                    start[second] + 0.5 * chord[1] + height * chord[0],
                ];
                return Ok(Some(PlanarArc { plane, center, sweep: sign * (angle + TAU * turns) }));
            }
            (None, false, None) if self.is_polar => self.modes.pole,
            (None, false, None) => {
                return Err(format!(
                    "a circle requires its center {} {}, CR= or AR=",
                    CENTERS[first], CENTERS[second]
                ));
            }
        };
        let [from, to] = [start, end].map(|coordinates| {
            let [x, y] = point(coordinates);
            [x - center[0], y - center[1]]
        });
        require_radii(from, to)?;
        let angle = sweep(from, to, is_clockwise);
        Ok(Some(PlanarArc { plane, center, sweep: angle + TAU * turns * angle.signum() }))
    }

    /// Returns a point by its words: relative to the start, or absolute with AC; CIP follows G90 and G91.
    fn point_words(
        &self,
        words: &mut Words,
        names: [&str; 3],
        start: &Coordinates,
        state: &State,
        is_coordinate: bool,
    ) -> Outcome<Coordinates> {
        let mut point = *start;
        for (axis, name) in names.into_iter().enumerate() {
            let Some(word) = words.take(name) else { continue };
            let value = word.value.number().map_err(|reason| format!("word {name}: {reason}"))?;
            let value = value * state.modal.length;
            let is_absolute = match word.approach {
                Approach::Absolute => true,
                Approach::Modal => is_coordinate && !state.modal.is_incremental,
                _ => false,
            };
            point[axis] = if is_absolute { value } else { start[axis] + value };
        }
        Ok(point)
    }

    /// Returns center and sweep of a circle that continues the last motion along its tangent.
    fn tangential(&self, start: [f64; 2], end: [f64; 2], state: &State) -> Outcome<Option<([f64; 2], f64)>> {
        let tangent = self.tangent.filter(|(plane, _)| *plane == state.modal.plane);
        let (_, tangent) = tangent.ok_or("CT requires a motion in the plane in front of it")?;
        let chord = [end[0] - start[0], end[1] - start[1]];
        let length = chord[0].hypot(chord[1]);
        if length < 1e-9 {
            return Err("CT requires an end point that differs from the start".to_owned());
        }
        let cross = tangent[0] * chord[1] - tangent[1] * chord[0];
        if cross.abs() < STRAIGHT * length {
            return Ok(None);
        }
        // Signed radius to the left of the tangent.
        let radius = 0.5 * length * length / cross;
        let center = [start[0] - radius * tangent[1], start[1] + radius * tangent[0]];
        let along = tangent[0] * chord[0] + tangent[1] * chord[1];
        let angle = 2.0 * cross.atan2(along);
        Ok(Some((center, angle)))
    }
}

/// Returns center and sweep of the circle from a point through another to a third.
fn through_points(start: [f64; 2], through: [f64; 2], end: [f64; 2]) -> Outcome<([f64; 2], f64)> {
    let [a, b] = [through, end].map(|point| [point[0] - start[0], point[1] - start[1]]);
    let cross = a[0] * b[1] - a[1] * b[0];
    let squares = [a, b].map(|[x, y]| x * x + y * y);
    if cross.abs() <= STRAIGHT * (squares[0] * squares[1]).sqrt() {
        return Err("CIP: the three points are on a line".to_owned());
    }
    let center = [
        start[0] + 0.5 * (b[1] * squares[0] - a[1] * squares[1]) / cross,
        start[1] + 0.5 * (a[0] * squares[1] - b[0] * squares[0]) / cross,
    ];
    let angle = |point: [f64; 2]| (point[1] - center[1]).atan2(point[0] - center[0]);
    let turn = (angle(end) - angle(start)).rem_euclid(TAU);
    // The triangle has the orientation of the circle.
    Ok((center, if cross > 0.0 { turn } else { turn - TAU }))
}
