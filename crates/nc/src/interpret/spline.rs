//! Splines in the XY plane: G5, G5.1 and G5.2 with G5.3.

use super::error::Outcome;
use super::limits::{MAX_CONTROL_POINTS, MAX_ORDER};
use super::line_words::LineWords;
use super::state::State;
use crate::motion::{MotionKind, Nurbs, Plane};

/// Order of a NURBS without L, as in LinuxCNC.
const DEFAULT_ORDER: usize = 3;

/// NURBS between G5.2 and G5.3.
#[derive(Debug)]
pub(super) struct OpenSpline {
    order: usize,
    control: Vec<([f64; 2], f64)>,
}

impl State {
    /// Executes the line of G5, G5.1 or G5.2.
    pub(super) fn start_spline(&mut self, block: &mut LineWords, code: u16) -> Outcome<()> {
        if self.modal.plane != Plane::Xy {
            return Err("splines require the plane XY (G17)".to_owned());
        }
        if code == 52 && self.modal.is_incremental {
            return Err("G5.2 requires G90".to_owned());
        }
        if code == 52 {
            // The mode ends with G5.3, not with the next motion code.
            self.modal.motion = None;
            return self.start_nurbs(block);
        }
        let end = self.targets(block, false)?;
        let length = self.modal.length;
        let mut offset = |letters: [char; 2]| match letters.map(|letter| block.take(letter)) {
            [Some(first), Some(second)] => Ok([first * length, second * length]),
            _ => Err(format!("a spline requires {} and {}", letters[0], letters[1])),
        };
        let (start, last) = ([self.position[0], self.position[1]], [end[0], end[1]]);
        let [first_x, first_y] = offset(['I', 'J'])?;
        let mut points = vec![start, [start[0] + first_x, start[1] + first_y]];
        if code == 50 {
            let [second_x, second_y] = offset(['P', 'Q'])?;
            points.push([last[0] + second_x, last[1] + second_y]);
        }
        points.push(last);
        let control: Vec<_> = points.into_iter().map(|point| (point, 1.0)).collect();
        self.push_feed(MotionKind::Nurbs(Nurbs { plane: Plane::Xy, order: control.len(), control }), end)
    }

    fn start_nurbs(&mut self, block: &mut LineWords) -> Outcome<()> {
        let order = block.take_integer('L')?.map_or(DEFAULT_ORDER, |order| order as usize);
        if !(2..=MAX_ORDER).contains(&order) {
            return Err(format!("word L: order {order}, must be between 2 and {MAX_ORDER}"));
        }
        let start = [self.position[0], self.position[1]];
        let weight = if block.has_axis() { 1.0 } else { weight(block)?.unwrap_or(1.0) };
        self.spline = Some(OpenSpline { order, control: vec![(start, weight)] });
        if block.has_axis() { self.add_control_point(block) } else { Ok(()) }
    }

    /// Executes a line between G5.2 and G5.3.
    pub(super) fn spline_line(&mut self, block: &mut LineWords) -> Outcome<()> {
        let is_end = match block.g[..] {
            [] => false,
            [53] => true,
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
        let end = self.targets(block, false)?;
        if end[2..] != self.position[2..] {
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
        let mut end = self.position;
        if let Some((point, _)) = control.last() {
            end[..2].copy_from_slice(point);
        }
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
