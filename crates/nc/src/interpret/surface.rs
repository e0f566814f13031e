//! Paths in a plane that a rotary axis carries: cylindrical interpolation (G7.1) and polar coordinate interpolation (G12.1)
//! of Fanuc. Lines and arcs become straight motions of the axes within the chord error, each with the time of its part of
//! the path at the programmed feed.

use std::f64::consts::TAU;

use super::arcs::{center_by_radius, require_radii, sweep};
use super::codes::{Codes, Motion, SurfaceCode, g_name};
use super::error::Outcome;
use super::line_words::LineWords;
use super::moves::CHORD_ERROR;
use super::state::{State, Surface};
use crate::motion::{AXIS_LETTERS, Coordinates, Feed, MotionKind, Plane};

/// Parts of an arc that are divided further.
const PARTS: u32 = 16;
/// Divisions of a part.
const MAX_DEPTH: u32 = 16;
/// Smallest distance from the center of polar coordinates, m.
const LEAST_RADIUS: f64 = 1e-6;

/// Path in the plane: programmed coordinates by the share of its length.
struct SurfacePath<'a> {
    at: &'a dyn Fn(f64) -> Coordinates,
    length: f64,
    speed: f64,
    parts: u32,
}

impl State {
    /// Begins or ends the interpolation: G7.1, G12.1, G13.1.
    pub(super) fn set_surface(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let Some(code) = codes.g.surface else { return Ok(()) };
        self.finish_contour()?;
        self.modal.surface = match code {
            SurfaceCode::PolarOff | SurfaceCode::PolarOff113 => None,
            SurfaceCode::Polar | SurfaceCode::Polar112 => {
                self.require_plain(code)?;
                let start = self.programmed();
                if start[0] < LEAST_RADIUS || !self.options.axes[5] {
                    return Err("G12.1 requires the axis C, and a start with X above 0".to_owned());
                }
                Some(Surface::Polar { base: start[5] })
            }
            SurfaceCode::Cylinder | SurfaceCode::Cylinder107 => {
                let word = (3..6).find_map(|axis| Some((axis, block.take(AXIS_LETTERS[axis])?)));
                let (rotary, radius) = word.ok_or(
                    "G7.1 requires the rotary axis with the radius, as in G7.1 A50, or A0 at the end",
                )?;
                if radius == 0.0 {
                    None
                } else {
                    self.require_plain(code)?;
                    Some(Surface::Cylinder { rotary, radius: radius.abs() * self.modal.length })
                }
            }
        };
        Ok(())
    }

    fn require_plain(&self, code: SurfaceCode) -> Outcome<()> {
        let is_plain = self.frame.is_identity()
            && self.tilt.is_none()
            && self.modal.tcp_length.is_none()
            && self.modal.polar.is_none()
            && self.contour.compensation.is_none();
        match is_plain {
            true => Ok(()),
            false => Err(format!(
                "{}: end cutter compensation, rotation, scaling, polar coordinates and tool center point control before",
                g_name(code.number())
            )),
        }
    }

    /// Executes a line or an arc of a path in the plane of the surface.
    pub(super) fn surface_motion(
        &mut self,
        block: &mut LineWords,
        code: Motion,
        surface: Surface,
    ) -> Outcome<()> {
        let is_clockwise = match code {
            Motion::Line => None,
            Motion::ClockwiseArc => Some(true),
            Motion::CounterclockwiseArc => Some(false),
            _ => {
                return Err(format!(
                    "{}: only G1, G2 and G3 are allowed with G7.1 and G12.1; end them before",
                    g_name(code.number())
                ));
            }
        };
        if self.contour.compensation.is_some() {
            return Err("cutter compensation with G7.1 and G12.1 is not supported: program the path of the tool center"
                .to_owned());
        }
        let (plane, replaced) = self.surface_plane(surface)?;
        let start = to_plane(surface, replaced, &self.programmed());
        let mut end = start;
        for (axis, value) in end.iter_mut().enumerate() {
            let (letter, unit) = match surface {
                Surface::Cylinder { rotary, radius } if axis == replaced => {
                    (AXIS_LETTERS[rotary], radius.to_radians())
                }
                Surface::Polar { .. } if axis == replaced => ('C', self.modal.length),
                _ => (AXIS_LETTERS[axis], self.unit(axis)),
            };
            let Some(word) = block.take(letter) else { continue };
            *value = word * unit + if self.modal.is_incremental { *value } else { 0.0 };
        }
        let [first, second, _] = plane.axes();
        let along = |share: f64| -> Coordinates {
            std::array::from_fn(|axis| start[axis] + share * (end[axis] - start[axis]))
        };
        let Feed::Linear(speed) = self.feed(&end, false)? else {
            return Err("G7.1 and G12.1 require G94 or G95".to_owned());
        };
        let Some(is_clockwise) = is_clockwise else {
            let length = (0..3).map(|axis| (end[axis] - start[axis]).powi(2)).sum::<f64>().sqrt();
            return self.follow(surface, replaced, &SurfacePath { at: &along, length, speed, parts: 1 });
        };
        let before = std::mem::replace(&mut self.modal.plane, plane);
        let center = match block.take('R') {
            Some(radius) => {
                center_by_radius([&start, &end], [first, second], radius * self.modal.length, is_clockwise)
            }
            None => self.center_by_words(block, &start),
        };
        self.modal.plane = before;
        let center = center?;
        let [from, to] = [&start, &end].map(|point| [point[first] - center[0], point[second] - center[1]]);
        require_radii(from, to)?;
        let angle = sweep(from, to, is_clockwise);
        let around = |share: f64| {
            let mut point = along(share);
            let (sin, cos) = (angle * share).sin_cos();
            let size = 1.0 + share * (to[0].hypot(to[1]) / from[0].hypot(from[1]) - 1.0);
            point[first] = center[0] + size * (from[0] * cos - from[1] * sin);
            point[second] = center[1] + size * (from[0] * sin + from[1] * cos);
            point
        };
        let normal = plane.axes()[2];
        let length = (angle * from[0].hypot(from[1])).hypot(end[normal] - start[normal]);
        self.follow(surface, replaced, &SurfacePath { at: &around, length, speed, parts: PARTS })
    }

    /// Returns the plane of the path, and the axis whose place the rotary axis takes in it.
    fn surface_plane(&self, surface: Surface) -> Outcome<(Plane, usize)> {
        let Surface::Cylinder { rotary, .. } = surface else { return Ok((Plane::Xy, 1)) };
        // A, B and C turn about X, Y and Z.
        let [first, second, normal] = self.modal.plane.axes();
        match rotary - 3 {
            axis if axis == first => Ok((self.modal.plane, second)),
            axis if axis == second => Ok((self.modal.plane, first)),
            axis => Err(format!(
                "G7.1 {}: the plane requires the axis {}; program another one than that normal to {}",
                AXIS_LETTERS[rotary], AXIS_LETTERS[axis], AXIS_LETTERS[normal]
            )),
        }
    }

    /// Appends the motions along a path.
    fn follow(&mut self, surface: Surface, replaced: usize, path: &SurfacePath<'_>) -> Outcome<()> {
        if path.length == 0.0 {
            return Ok(());
        }
        let fixed = self.programmed();
        let mut before = fixed;
        for part in 0..path.parts {
            let [from, to] = [part, part + 1].map(|index| f64::from(index) / f64::from(path.parts));
            let mut shares = vec![(to, 0)];
            let mut from = from;
            while let Some((to, depth)) = shares.pop() {
                let axes = |share: f64, near: &Coordinates| {
                    to_axes(surface, replaced, &(path.at)(share), &fixed, near)
                };
                let end = axes(to, &before)?;
                let middle = 0.5 * (from + to);
                let between: Coordinates = std::array::from_fn(|axis| 0.5 * (before[axis] + end[axis]));
                let (found, wanted) = (to_plane(surface, replaced, &between), (path.at)(middle));
                let error = (0..3).map(|axis| (found[axis] - wanted[axis]).powi(2)).sum::<f64>().sqrt();
                if error > CHORD_ERROR && depth < MAX_DEPTH {
                    shares.extend([(to, depth + 1), (middle, depth + 1)]);
                    continue;
                }
                let time = (to - from) * path.length / path.speed;
                self.push_motion(MotionKind::Line, self.position_at(&end), Feed::Duration(time))?;
                (from, before) = (to, end);
            }
        }
        Ok(())
    }
}

/// Returns the coordinates in the plane of the surface: the axis `replaced` is the one that the rotary axis carries.
fn to_plane(surface: Surface, replaced: usize, axes: &Coordinates) -> Coordinates {
    let mut point = *axes;
    match surface {
        Surface::Cylinder { rotary, radius } => point[replaced] = radius * axes[rotary],
        Surface::Polar { base } => {
            let (sin, cos) = (axes[5] - base).sin_cos();
            (point[0], point[1]) = (axes[0] * cos, axes[0] * sin);
        }
    }
    point
}

/// Returns the coordinates of the axes at a point of the plane; the rotary axis takes the turn nearest to that of `near`.
fn to_axes(
    surface: Surface,
    replaced: usize,
    point: &Coordinates,
    fixed: &Coordinates,
    near: &Coordinates,
) -> Outcome<Coordinates> {
    let mut axes = *point;
    axes[replaced] = fixed[replaced];
    match surface {
        Surface::Cylinder { rotary, radius } => axes[rotary] = point[replaced] / radius,
        Surface::Polar { base } => {
            let radius = point[0].hypot(point[1]);
            if radius < LEAST_RADIUS {
                return Err("G12.1: the path leads through the center, where C has no angle".to_owned());
            }
            let angle = point[1].atan2(point[0]) + base;
            axes[0] = radius;
            axes[5] = angle + TAU * ((near[5] - angle) / TAU).round();
        }
    }
    Ok(axes)
}
