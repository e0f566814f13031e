//! Splines in the XY plane: G5, G5.1 and G5.2 with G5.3.

use nalgebra::Vector3;

use super::codes::Motion;
use super::error::Outcome;
use super::limits::{MAX_CONTROL_POINTS, MAX_ORDER};
use super::line_words::LineWords;
use super::state::{OpenSpline, State};
use crate::motion::{Coordinates, MotionKind, Nurbs, Plane};

/// Order of a NURBS without L, as in LinuxCNC.
const DEFAULT_ORDER: usize = 3;

impl State {
    /// Executes the line of G5, G5.1 or G5.2.
    pub(super) fn start_spline(&mut self, block: &mut LineWords, code: Motion) -> Outcome<()> {
        if self.modal.plane != Plane::Xy {
            return Err("splines require the plane XY (G17)".to_owned());
        }
        if code == Motion::Nurbs && self.modal.is_incremental {
            return Err("G5.2 requires G90".to_owned());
        }
        if code == Motion::Nurbs {
            // The mode ends with G5.3, not with the next motion code.
            self.modal.motion = None;
            return self.start_nurbs(block);
        }
        let end = self.targets(block)?;
        let length = self.modal.length;
        let offset =
            |block: &mut LineWords, letters: [char; 2]| match letters.map(|letter| block.take(letter)) {
                [Some(first), Some(second)] => Ok([first * length, second * length]),
                _ => Err(format!("a spline requires {} and {}", letters[0], letters[1])),
            };
        let start = self.programmed();
        let (start, last) = ([start[0], start[1]], [end[0], end[1]]);
        // A G5 without I and J continues the one before in its direction.
        let [first_x, first_y] = match self.cubic_end {
            Some([x, y]) if code == Motion::CubicSpline && !block.has_any(&['I', 'J']) => [-x, -y],
            _ => offset(block, ['I', 'J'])?,
        };
        let mut points = vec![start, [start[0] + first_x, start[1] + first_y]];
        let mut cubic_end = None;
        if code == Motion::CubicSpline {
            let [second_x, second_y] = offset(block, ['P', 'Q'])?;
            points.push([last[0] + second_x, last[1] + second_y]);
            cubic_end = Some([second_x, second_y]);
        }
        points.push(last);
        let control: Vec<_> = points.into_iter().map(|point| (point, 1.0)).collect();
        self.nurbs_to(control.len(), control, &end)?;
        self.cubic_end = cubic_end;
        Ok(())
    }

    fn start_nurbs(&mut self, block: &mut LineWords) -> Outcome<()> {
        let order = block.take_integer('L')?.map_or(DEFAULT_ORDER, |order| order as usize);
        if !(2..=MAX_ORDER).contains(&order) {
            return Err(format!("word L: order {order}, must be between 2 and {MAX_ORDER}"));
        }
        let start = self.programmed();
        let start = [start[0], start[1]];
        let weight = if block.has_axis() { 1.0 } else { weight(block)?.unwrap_or(1.0) };
        self.spline = Some(OpenSpline { order, control: vec![(start, weight)] });
        if block.has_axis() { self.add_control_point(block) } else { Ok(()) }
    }

    /// Executes a line between G5.2 and G5.3.
    pub(super) fn spline_line(&mut self, block: &mut LineWords) -> Outcome<()> {
        let is_end = match block.g[..] {
            [] => false,
            [code] if code == Motion::NurbsEnd.number() => true,
            _ => return Err("only X, Y and P are allowed between G5.2 and G5.3".to_owned()),
        };
        if !block.m.is_empty() {
            return Err("M codes are not allowed between G5.2 and G5.3".to_owned());
        }
        match is_end {
            true => self.end_nurbs()?,
            false => self.add_control_point(block)?,
        }
        block.require_used()
    }

    fn add_control_point(&mut self, block: &mut LineWords) -> Outcome<()> {
        let weight = weight(block)?.ok_or("a control point requires P, its weight")?;
        let end = self.targets(block)?;
        if end[2..] != self.programmed()[2..] {
            return Err("a control point has X and Y only".to_owned());
        }
        let Some(spline) = &mut self.spline else { return Ok(()) };
        if spline.control.len() >= MAX_CONTROL_POINTS {
            return Err(format!("the NURBS has more than {MAX_CONTROL_POINTS} control points"));
        }
        spline.control.push(([end[0], end[1]], weight));
        Ok(())
    }

    fn end_nurbs(&mut self) -> Outcome<()> {
        let Some(OpenSpline { order, control }) = self.spline.take() else { return Ok(()) };
        if control.len() < order {
            return Err(format!(
                "a NURBS of order {order} requires {order} control points, found {}",
                control.len()
            ));
        }
        let mut end = self.programmed();
        if let Some((point, _)) = control.last() {
            end[..2].copy_from_slice(point);
        }
        self.nurbs_to(order, control, &end)
    }

    /// Appends a NURBS in XY with programmed control points, m.
    fn nurbs_to(
        &mut self,
        order: usize,
        mut control: Vec<([f64; 2], f64)>,
        end: &Coordinates,
    ) -> Outcome<()> {
        let map = self.map();
        let tilt = [(2, 0), (2, 1), (0, 2), (1, 2)].map(|index| map.linear[index]);
        if tilt.iter().any(|value| *value != 0.0) {
            return Err("a spline in a plane that is not parallel to XY is not supported".to_owned());
        }
        for (point, _) in &mut control {
            let image = map.apply(&Vector3::new(point[0], point[1], end[2]));
            *point = [image.x, image.y];
        }
        let end = self.position_at(end);
        self.push_feed(MotionKind::Nurbs(Nurbs { plane: Plane::Xy, order, control }), end)
    }
}

/// Returns the weight P, which then counts as used.
fn weight(block: &mut LineWords) -> Outcome<Option<f64>> {
    match block.take('P') {
        Some(weight) if weight <= 0.0 => Err(format!("word P: weight {weight}, must be above 0")),
        weight => Ok(weight),
    }
}
