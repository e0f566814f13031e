//! Circularity (ISO 230-4) of the circles of a program.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use crate::assess::{CircleAssessor, CircleTrace, bidirectional};
use crate::config::{AxisKind, MachineConfig};
use crate::path::{Circle, Program};

use super::cycle::TickTimes;
use super::figures::{BidirectionalFigures, CircleFigures};
use super::path_features::steady_window;

/// Largest number of circles reported individually.
const MAX_COUNT: usize = 100;
/// Largest number of points kept for the polar plot of a circle: every tick of 16 s at 125 µs.
const MAX_TRACE_POINTS: usize = 1 << 17;
/// Number of circles whose points are kept.
const MAX_TRACES: usize = 8;
/// Tolerance within which two circles are the same, m.
const SAME_CIRCLE_TOLERANCE: f64 = 1e-9;

/// One circle at constant feed.
#[derive(Debug, Clone)]
struct SteadyCircle {
    /// Move, counted from 0.
    index: usize,
    window: Range<f64>,
    /// Feed in the window, m/s.
    feed: f64,
    circle: Circle,
    assessor: CircleAssessor,
    trace: CircleTrace,
}

/// Circles of a program, in order.
#[derive(Debug, Clone, Default)]
pub(super) struct Circles {
    list: Vec<SteadyCircle>,
    /// Index of the first circle whose window has not ended.
    next: usize,
    /// Number of whole circles beyond those of the list.
    more: usize,
}

impl Circles {
    pub(super) fn of(program: &Program, machine: &MachineConfig) -> Self {
        let axes = machine.axes();
        let is_linear = |index: &usize| axes[*index].kind() == AxisKind::Linear;
        let blocks = program.path().blocks().iter().enumerate();
        let mut circles = blocks.filter_map(|(index, block)| {
            Some((index, block.circle().filter(|circle| circle.plane.iter().all(is_linear))?))
        });
        let steady = |(index, circle): (usize, Circle)| {
            let plane = circle.plane;
            let window = steady_window(program, index)?;
            let trace = CircleTrace {
                plane: plane.map(|index| axes[index].name().to_owned()),
                radius: circle.radius,
                counterclockwise: circle.sweep > 0.0,
                angle: Vec::new(),
                deviation: Vec::new(),
            };
            let assessor = CircleAssessor::new(circle.center, circle.radius);
            let length = program.progress(window.end) - program.progress(window.start);
            let feed = length / (window.end - window.start);
            Some(SteadyCircle { index, window, feed, circle, assessor, trace })
        };
        let list = circles.by_ref().filter_map(steady).take(MAX_COUNT).collect();
        let more = circles.filter(|(_, circle)| circle.sweep.abs() >= TAU).count();
        Circles { list, next: 0, more }
    }

    /// Adds the axis positions at `times`, s; `coordinates` returns the programmed coordinate of an axis at
    /// these times.
    pub(super) fn observe<'m>(
        &mut self,
        times: TickTimes,
        coordinates: impl Fn(usize) -> &'m [f64],
        record: bool,
    ) {
        let last = times.last();
        if !record && let Some(steady) = self.list.get_mut(self.next) {
            let window = &steady.window;
            if window.contains(&times.at(0)) && window.contains(&last) {
                let [u, v] = steady.circle.plane.map(&coordinates);
                steady.assessor.push_all(u, v);
                return;
            }
        }
        for tick in 0..times.count() {
            let time = times.at(tick);
            while self.list.get(self.next).is_some_and(|steady| time >= steady.window.end) {
                self.next += 1;
            }
            let Some(steady) = self.list.get_mut(self.next).filter(|s| last >= s.window.start) else {
                return;
            };
            if steady.window.contains(&time) {
                let [u, v] = steady.circle.plane.map(|index| coordinates(index)[tick]);
                steady.push(u, v, record && self.next < MAX_TRACES);
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
                feed: steady.feed,
                mean: found.mean,
                min: found.min,
                max: found.max,
                circular_deviation: found.full.map(|full| full.circular_deviation),
                reversal_spikes: found.full.map(|full| full.reversal_spikes),
            })
        });
        figures.collect()
    }

    /// Returns the number of whole circles that are not evaluated.
    pub(super) fn more(&self) -> usize {
        self.more
    }

    /// Returns the figures of each circle that is run in both directions.
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

impl SteadyCircle {
    /// Adds a point and, with `record`, keeps it for the plot.
    fn push(&mut self, u: f64, v: f64, record: bool) {
        let deviation = self.assessor.push(u, v);
        if record && self.trace.angle.len() < MAX_TRACE_POINTS {
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

    fn is_reverse_of(&self, other: &SteadyCircle) -> bool {
        let (a, b) = (&self.circle, &other.circle);
        a.plane == b.plane
            && (a.sweep > 0.0) != (b.sweep > 0.0)
            && (a.radius - b.radius).abs() < SAME_CIRCLE_TOLERANCE
            && (a.center[0] - b.center[0]).hypot(a.center[1] - b.center[1]) < SAME_CIRCLE_TOLERANCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Parameters;
    use crate::kinematics::Kinematics;
    use crate::path::{Block, FeedProfile, Frame, Move};
    use crate::simulation::joint_limits;

    #[test]
    fn circles_beyond_the_maximum_are_counted() {
        let machine = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        let kinds: Vec<AxisKind> = machine.axes().iter().map(|axis| axis.kind()).collect();
        let (from, turns) = ([0.0; 5], 2.0);
        let block = Block::arc(&from, [0, 1], [-0.01, 0.0], turns * 2.0 * PI, &from, &kinds).expect("an arc");
        let circle = Move { profile: FeedProfile::Cosine { ramp: 0.1 }, ..Move::new(block, 0.05) };
        let period = machine.periods().position;
        for (count, measured, more) in [(MAX_COUNT, MAX_COUNT, 0), (MAX_COUNT + 3, MAX_COUNT, 3)] {
            let moves = vec![circle.clone(); count];
            let kinematics = Kinematics::new(&machine);
            let program =
                Program::plan(kinematics, Frame::Joints, &joint_limits(&machine, ""), period, 0.0, moves)
                    .expect("the machine can do it");
            let circles = Circles::of(&program, &machine);
            assert_eq!((circles.list.len(), circles.more()), (measured, more), "{count} circles");
        }
    }
}
