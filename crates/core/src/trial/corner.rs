//! Contour error at the corners of a path.

use crate::config::MachineConfig;
use crate::path::Program;
use crate::units::seconds;

use super::cycle::TickTimes;
use super::figures::CornerFigures;
use super::path_features::turn;

/// Half of the evaluation window of a corner, s.
const WINDOW: f64 = 0.15;
/// Largest number of corners reported individually.
const MAX_COUNT: usize = 1000;

/// Contour errors of the corners within their windows.
#[derive(Debug, Clone, Default)]
pub(super) struct Corners {
    /// Time of the corner plus the delay of the position loop, s, and its figures.
    list: Vec<(f64, CornerFigures)>,
    /// Index of the first corner whose window has not ended.
    next: usize,
    /// Number of corners beyond those of the list.
    more: usize,
}

impl Corners {
    pub(super) fn of(program: &Program, machine: &MachineConfig) -> Self {
        let kinds: Vec<_> = machine.axes().iter().map(|axis| axis.kind()).collect();
        let delay = machine.axes().iter().map(|axis| axis.alpha()).max().unwrap_or(0);
        let blocks = program.path().blocks();
        let mut corners = blocks.windows(2).enumerate().filter_map(|(index, pair)| {
            let turn = turn(&pair[0], &pair[1], &kinds)?;
            let (end, next) = (program.time_range(index).end, program.time_range(index + 1).start);
            // The axes restart after a dwell, so this is not a corner.
            if next > end {
                return None;
            }
            let time = end + seconds(delay);
            Some((time, CornerFigures { index: index + 1, turn, max_contour_error: 0.0 }))
        });
        let list = corners.by_ref().take(MAX_COUNT).collect();
        Corners { list, next: 0, more: corners.count() }
    }

    /// Adds contour errors at `times`, s, without overshoot beyond the path's ends, m.
    pub(super) fn observe(&mut self, times: TickTimes, within_ends: &[f64]) {
        let last = times.last();
        for (tick, &distance) in within_ends.iter().enumerate() {
            let time = times.at(tick);
            while self.list.get(self.next).is_some_and(|(corner, _)| time > corner + WINDOW) {
                self.next += 1;
            }
            if self.list.get(self.next).is_none_or(|(corner, _)| last < corner - WINDOW) {
                return;
            }
            let open = self.list.iter_mut().skip(self.next).take_while(|(corner, _)| time >= corner - WINDOW);
            for (_, figures) in open {
                figures.max_contour_error = figures.max_contour_error.max(distance);
            }
        }
    }

    /// Returns the number of corners that are not evaluated.
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
    use crate::simulation::joint_limits;

    /// Plans alternate steps in X and Y: each but the last ends in a corner.
    fn zigzag(steps: usize) -> (Program, MachineConfig) {
        let machine = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        let kinds: Vec<AxisKind> = machine.axes().iter().map(|axis| axis.kind()).collect();
        let at = |step: usize| [1e-4 * step.div_ceil(2) as f64, 1e-4 * (step / 2) as f64, 0.0, 0.0, 0.0];
        let line = |step| Move::new(Block::line(&at(step), &at(step + 1), &kinds).expect("a line"), 0.01);
        let moves = (0..steps).map(line).collect();
        let period = machine.periods().position;
        let program = Program::plan(
            Kinematics::new(&machine),
            Frame::Joints,
            &joint_limits(&machine, ""),
            period,
            0.0,
            moves,
        );
        (program.expect("the machine can do it"), machine)
    }

    #[test]
    fn corners_beyond_the_maximum_are_counted() {
        for (steps, measured, more) in
            [(MAX_COUNT, MAX_COUNT - 1, 0), (MAX_COUNT + 1, MAX_COUNT, 0), (MAX_COUNT + 4, MAX_COUNT, 3)]
        {
            let (program, machine) = zigzag(steps);
            let corners = Corners::of(&program, &machine);
            assert_eq!((corners.figures().len(), corners.more()), (measured, more), "{steps} steps");
        }
    }
}
