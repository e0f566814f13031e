//! Contour error around the corners of a path.

use crate::config::MachineConfig;
use crate::path::Program;
use crate::units::seconds;

use super::figures::CornerFigures;
use super::windows::turn;

/// Half the length of the window around a corner, s.
const WINDOW: f64 = 0.15;
/// Most corners that are told one by one.
const MOST: usize = 1000;

/// Looks at each corner within its window.
#[derive(Debug, Clone, Default)]
pub(super) struct Corners {
    /// Time at which the corner has passed the delay of the position loop, s, and its figures.
    list: Vec<(f64, CornerFigures)>,
    /// The first whose window is not over.
    next: usize,
    /// Corners behind those of the list.
    more: usize,
}

impl Corners {
    pub(super) fn of(program: &Program, machine: &MachineConfig) -> Self {
        let kinds: Vec<_> = machine.axes().iter().map(|axis| axis.kind()).collect();
        let delay = machine.axes().iter().map(|axis| axis.alpha()).max().unwrap_or(0);
        let blocks = program.path().blocks();
        let mut corners = blocks.windows(2).enumerate().filter_map(|(index, pair)| {
            let turn = turn(&pair[0], &pair[1], &kinds)?;
            let (end, next) = (program.span(index).end, program.span(index + 1).start);
            // Behind a dwell the axes start anew: that is no corner.
            if next > end {
                return None;
            }
            let time = end + seconds(delay);
            Some((time, CornerFigures { index: index + 1, turn, max_contour_error: 0.0 }))
        });
        let list = corners.by_ref().take(MOST).collect();
        Corners { list, next: 0, more: corners.count() }
    }

    /// Takes distances from the path, less what overshoots its ends, m, at `times`, s, into account.
    pub(super) fn observe(&mut self, times: &[f64], within_ends: &[f64]) {
        let Some(last) = times.last() else { return };
        for (&time, &distance) in times.iter().zip(within_ends) {
            while self.list.get(self.next).is_some_and(|(corner, _)| time > corner + WINDOW) {
                self.next += 1;
            }
            if self.list.get(self.next).is_none_or(|(corner, _)| *last < corner - WINDOW) {
                return;
            }
            let open = self.list.iter_mut().skip(self.next).take_while(|(corner, _)| time >= corner - WINDOW);
            for (_, figures) in open {
                figures.max_contour_error = figures.max_contour_error.max(distance);
            }
        }
    }

    /// Corners of which nothing is measured.
    pub(super) fn more(&self) -> usize {
        self.more
    }

    pub(super) fn figures(&self) -> Vec<CornerFigures> {
        self.list.iter().map(|(_, figures)| *figures).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{AxisKind, Parameters};
    use crate::kinematics::Kinematics;
    use crate::path::{Block, Frame, Move};
    use crate::simulation::joints;

    /// Steps in X and Y by turns: each but the last ends in a corner.
    fn stairs(steps: usize) -> (Program, MachineConfig) {
        let machine = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        let kinds: Vec<AxisKind> = machine.axes().iter().map(|axis| axis.kind()).collect();
        let at = |step: usize| [1e-4 * step.div_ceil(2) as f64, 1e-4 * (step / 2) as f64, 0.0, 0.0, 0.0];
        let line = |step| Move::new(Block::line(&at(step), &at(step + 1), &kinds).expect("a line"), 0.01);
        let moves = (0..steps).map(line).collect();
        let period = machine.periods().position;
        let program = Program::plan(
            Kinematics::new(&machine),
            Frame::Joints,
            &joints(&machine, ""),
            period,
            0.0,
            moves,
        );
        (program.expect("the machine can do it"), machine)
    }

    #[test]
    fn corners_that_are_not_measured_are_counted() {
        for (steps, measured, more) in [(MOST, MOST - 1, 0), (MOST + 1, MOST, 0), (MOST + 4, MOST, 3)] {
            let (program, machine) = stairs(steps);
            let corners = Corners::of(&program, &machine);
            assert_eq!((corners.figures().len(), corners.more()), (measured, more), "{steps} steps");
        }
    }
}
