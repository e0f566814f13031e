//! Start, end, range and highest speed of the setpoints of a run.

use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::trial::Tick;
use virtual_axes_core::units::{Rounded, seconds};

use crate::arguments::axis::AxisUnits;
use crate::input::program_text::joint_line;

/// Distance below which a joint stands still, m or rad.
const RESOLUTION: f64 = 1e-9;
/// Fraction of the velocity limit below which the unit of the time is doubted.
const DOUBTFUL_SPEED: f64 = 1e-3;

/// Setpoints of a joint, m or rad.
#[derive(Debug, Clone, Copy, PartialEq)]
struct JointSetpoints {
    start: f64,
    end: f64,
    range: [f64; 2],
    /// Highest speed, m/s or rad/s.
    speed: f64,
}

/// Summary of the setpoints of all joints.
#[derive(Debug, Clone, Default)]
pub struct SetpointSummary(Vec<JointSetpoints>);

impl SetpointSummary {
    /// Adds the setpoints of a position cycle; other ticks are ignored.
    pub fn add(&mut self, tick: &Tick<'_>) {
        let SetpointSummary(joints) = self;
        if !tick.position_instant {
            return;
        }
        let psec = tick.machine.axes().iter().map(|axis| axis.sample().psec);
        if joints.is_empty() {
            let joint = |value| JointSetpoints { start: value, end: value, range: [value; 2], speed: 0.0 };
            joints.extend(psec.map(joint));
            return;
        }
        let period = seconds(tick.machine.periods().position);
        for (joint, value) in joints.iter_mut().zip(psec) {
            joint.speed = joint.speed.max((value - joint.end).abs() / period);
            joint.range = [joint.range[0].min(value), joint.range[1].max(value)];
            joint.end = value;
        }
    }

    /// Returns the joints that move.
    fn moving<'a>(
        &'a self,
        axes: &'a [AxisConfig],
    ) -> impl Iterator<Item = (&'a AxisConfig, &'a JointSetpoints)> {
        let SetpointSummary(joints) = self;
        axes.iter().zip(joints).filter(|(_, joint)| joint.range[1] - joint.range[0] > RESOLUTION)
    }

    /// Returns a line with start, end, range and highest speed of each joint that moves.
    pub fn text(&self, axes: &[AxisConfig]) -> String {
        let line = |(axis, joint): (&AxisConfig, &JointSetpoints)| {
            joint_line(axis, [joint.start, joint.end], joint.range, Some(joint.speed))
        };
        self.moving(axes).map(line).collect()
    }

    /// Returns a warning if every moving joint is so slow that the time may be in another unit.
    pub fn slow_warning(&self, axes: &[AxisConfig]) -> Option<String> {
        let fraction = |(axis, joint): (&AxisConfig, &JointSetpoints)| joint.speed / axis.limits().velocity;
        let (axis, joint) = self.moving(axes).max_by(|a, b| fraction(*a).total_cmp(&fraction(*b)))?;
        let AxisUnits { speed, speed_name, .. } = AxisUnits::for_kind(axis.kind());
        (fraction((axis, joint)) < DOUBTFUL_SPEED).then(|| {
            format!(
                "setpoints reach at most {} {speed_name} ({}), below 0.1 % of the velocity limit; the time is in s: is \
                 this in ms?",
                Rounded(joint.speed / speed),
                axis.name()
            )
        })
    }
}
