//! Circularity of the circles of a program.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use crate::assess::{CircleAssessor, CircleTrace, bidirectional};
use crate::config::{AxisKind, MachineConfig};
use crate::path::{Circle, Program};

use super::figures::{BidirectionalFigures, CircleFigures};
use super::windows::steady_circle;

/// Most circles that are told one by one.
const MOST: usize = 100;
/// Points of a circle that are kept for its polar plot: every tick of 16 s at 125 µs.
const TRACE: usize = 1 << 17;
/// Circles of which points are kept.
const TRACED: usize = 8;
/// Circles within this of each other are the same one, m.
const SAME: f64 = 1e-9;

/// One circle at steady feed.
#[derive(Debug, Clone)]
struct Steady {
    /// Move, from 0.
    index: usize,
    window: Range<f64>,
    circle: Circle,
    assessor: CircleAssessor,
    trace: CircleTrace,
}

/// The circles of a program, in order.
#[derive(Debug, Clone, Default)]
pub(super) struct Circles {
    list: Vec<Steady>,
    /// The first whose window is not over.
    next: usize,
    /// Whole circles behind those of the list.
    more: usize,
}

impl Circles {
    pub(super) fn of(program: &Program, machine: &MachineConfig) -> Self {
        let axes = machine.axes();
        let is_linear = |place: &usize| axes[*place].kind() == AxisKind::Linear;
        let blocks = program.path().blocks().iter().enumerate();
        let mut circles = blocks.filter_map(|(index, block)| {
            Some((index, block.circle().filter(|circle| circle.plane.iter().all(is_linear))?))
        });
        let steady = |(index, circle): (usize, Circle)| {
            let plane = circle.plane;
            let window = steady_circle(program, index)?;
            let trace = CircleTrace {
                plane: plane.map(|place| axes[place].name().to_owned()),
                radius: circle.radius,
                counterclockwise: circle.sweep > 0.0,
                angle: Vec::new(),
                deviation: Vec::new(),
            };
            let assessor = CircleAssessor::new(circle.center, circle.radius);
            Some(Steady { index, window, circle, assessor, trace })
        };
        let list = circles.by_ref().filter_map(steady).take(MOST).collect();
        let more = circles.filter(|(_, circle)| circle.sweep.abs() >= TAU).count();
        Circles { list, next: 0, more }
    }

    /// Takes where the axes are at `times`, s, into account: `coordinates` has the programmed ones of an axis.
    pub(super) fn observe<'m>(
        &mut self,
        times: &[f64],
        coordinates: impl Fn(usize) -> &'m [f64],
        record: bool,
    ) {
        let Some(last) = times.last() else { return };
        for (tick, time) in times.iter().enumerate() {
            while self.list.get(self.next).is_some_and(|steady| *time >= steady.window.end) {
                self.next += 1;
            }
            let Some(steady) = self.list.get_mut(self.next).filter(|s| *last >= s.window.start) else {
                return;
            };
            if steady.window.contains(time) {
                let [u, v] = steady.circle.plane.map(|place| coordinates(place)[tick]);
                steady.push(u, v, record && self.next < TRACED);
            }
        }
    }

    pub(super) fn figures(&self) -> Vec<CircleFigures> {
        let figures = self.list.iter().filter_map(|steady| {
            let found = steady.assessor.report()?;
            Some(CircleFigures {
                index: steady.index + 1,
                plane: steady.trace.plane.clone(),
                counterclockwise: steady.circle.sweep > 0.0,
                radius: steady.circle.radius,
                mean: found.mean,
                min: found.min,
                max: found.max,
                circular_deviation: found.full.map(|full| full.circular_deviation),
            })
        });
        figures.collect()
    }

    /// Whole circles of which nothing is measured.
    pub(super) fn more(&self) -> usize {
        self.more
    }

    /// Each circle that was run in both directions.
    pub(super) fn bidirectional(&self) -> Vec<BidirectionalFigures> {
        let mut pairs = Vec::new();
        for (i, first) in self.list.iter().enumerate() {
            let other = self.list.iter().skip(i + 1).find(|second| first.is_reverse_of(second));
            let Some(second) = other else { continue };
            if let Some(found) = bidirectional(&first.assessor, &second.assessor) {
                pairs.push(BidirectionalFigures {
                    moves: [first.index + 1, second.index + 1],
                    circular_deviation: found.circular_deviation,
                    mean_radial_deviation: found.mean_radial_deviation,
                });
            }
        }
        pairs
    }

    pub(super) fn into_traces(self) -> Vec<CircleTrace> {
        self.list.into_iter().map(|steady| steady.trace).collect()
    }
}

impl Steady {
    /// Adds a point; `record` keeps it for the plot.
    fn push(&mut self, u: f64, v: f64, record: bool) {
        let deviation = self.assessor.push(u, v);
        if record && self.trace.angle.len() < TRACE {
            let [cu, cv] = self.circle.center;
            let angle = (v - cv).atan2(u - cu);
            let angle = match self.trace.angle.last() {
                Some(last) => last + (angle - last + PI).rem_euclid(2.0 * PI) - PI,
                None => angle,
            };
            self.trace.angle.push(angle);
            self.trace.deviation.push(deviation);
        }
    }

    fn is_reverse_of(&self, other: &Steady) -> bool {
        let (a, b) = (&self.circle, &other.circle);
        a.plane == b.plane
            && (a.sweep > 0.0) != (b.sweep > 0.0)
            && (a.radius - b.radius).abs() < SAME
            && (a.center[0] - b.center[0]).hypot(a.center[1] - b.center[1]) < SAME
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Parameters;
    use crate::kinematics::Kinematics;
    use crate::path::{Block, Frame, Law, Move};
    use crate::simulation::joints;

    #[test]
    fn circles_that_are_not_measured_are_counted() {
        let machine = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        let kinds: Vec<AxisKind> = machine.axes().iter().map(|axis| axis.kind()).collect();
        let (from, turns) = ([0.0; 5], 2.0);
        let block = Block::arc(&from, [0, 1], [-0.01, 0.0], turns * 2.0 * PI, &from, &kinds).expect("an arc");
        let circle = Move { law: Law::Cosine { ramp: 0.1 }, ..Move::new(block, 0.05) };
        let period = machine.periods().position;
        for (count, measured, more) in [(MOST, MOST, 0), (MOST + 3, MOST, 3)] {
            let moves = vec![circle.clone(); count];
            let kinematics = Kinematics::new(&machine);
            let program = Program::plan(kinematics, Frame::Joints, &joints(&machine, ""), period, 0.0, moves)
                .expect("the machine can do it");
            let circles = Circles::of(&program, &machine);
            assert_eq!((circles.list.len(), circles.more()), (measured, more), "{count} circles");
        }
    }
}
