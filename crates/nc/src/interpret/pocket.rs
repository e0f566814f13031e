//! Circular pockets: G12 and G13 of Haas and Mach3.

use std::f64::consts::{PI, TAU};

use virtual_axes_core::units::{MILLIMETER, Rounded};

use super::dialect::Dialect;
use super::error::Outcome;
use super::line_words::LineWords;
use super::state::State;
use crate::motion::{PlanarArc, Plane};

/// Largest number of circles of a pocket.
const MAX_CIRCLES: f64 = 10_000.0;

impl State {
    /// Executes a circular pocket about the position: I is the radius of the first circle, or of the pocket; K is the
    /// radius of the pocket, which circles reach in steps of Q. Each circle begins and ends with half a circle. The tool
    /// radius of D is subtracted; Mach3 has no D. Z is the depth of the pocket, reached before the first circle.
    pub(super) fn circular_pocket(&mut self, block: &mut LineWords, is_clockwise: bool) -> Outcome<()> {
        let name = if is_clockwise { "G12" } else { "G13" };
        if self.modal.plane != Plane::Xy {
            return Err(format!("{name} requires the plane XY (G17)"));
        }
        self.finish_contour()?;
        let length = self.modal.length;
        let first = block.take('I').map(|value| value * length).filter(|value| *value > 0.0);
        let first = first.ok_or_else(|| format!("{name} requires I above 0, a radius"))?;
        let pocket = block.take('K').map_or(first, |value| value * length);
        let step = block.take('Q').map(|value| value * length).filter(|value| *value > 0.0);
        let repeats = block.take_integer('L')?.unwrap_or(1).min(1000);
        let number = block.take_integer('D')?.or(self.modal.radius_number);
        let tool = match number.filter(|number| *number > 0 && self.dialect == Dialect::Haas) {
            Some(number) => self.tool_radius(number),
            None => 0.0,
        };
        let (first, pocket) = (first - tool, pocket - tool);
        if first <= 0.0 || pocket < first {
            let [first, pocket] = [first, pocket].map(|radius| Rounded(radius / MILLIMETER));
            return Err(format!(
                "{name}: circles of radius {first} to {pocket} mm of the tool center; I must be above the tool radius, \
                 and K at least I"
            ));
        }
        let step = step.unwrap_or(pocket - first).max(f64::MIN_POSITIVE);
        let circles = ((pocket - first) / step).ceil();
        if circles > MAX_CIRCLES {
            return Err(format!("{name}: {circles} circles, at most {MAX_CIRCLES} are allowed"));
        }
        let is_incremental = self.modal.is_incremental;
        let depth = block.take('Z').map(|value| value * length);
        for _ in 0..repeats {
            let mut center = self.programmed();
            if let Some(depth) = depth {
                center[2] = if is_incremental { center[2] + depth } else { depth };
                self.line_to(&center)?;
            }
            self.circles([center[0], center[1]], [first, pocket, step], is_clockwise)?;
        }
        Ok(())
    }

    fn circles(
        &mut self,
        center: [f64; 2],
        [first, pocket, step]: [f64; 3],
        is_clockwise: bool,
    ) -> Outcome<()> {
        let sign = if is_clockwise { -1.0 } else { 1.0 };
        let home = self.programmed();
        let arc = |state: &mut Self, middle: f64, end: f64, sweep: f64| {
            let mut target = home;
            target[0] = end;
            let arc = PlanarArc { plane: Plane::Xy, center: [middle, center[1]], sweep: sign * sweep };
            state.arc_to(&arc, &target)
        };
        let (mut radius, mut at) = (first, center[0]);
        loop {
            let end = center[0] + radius;
            arc(self, 0.5 * (at + end), end, PI)?;
            arc(self, center[0], end, TAU)?;
            at = end;
            if radius >= pocket {
                break;
            }
            radius = (radius + step).min(pocket);
        }
        arc(self, 0.5 * (at + center[0]), center[0], PI)
    }
}
