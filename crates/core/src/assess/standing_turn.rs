//! Turns of the tool about a tip that stands or hardly moves, where the orientation at the nearest point of the path means
//! nothing: the contour error is as long as the path of a large turn.

use crate::kinematics::ToolPose;

/// Path of the tip per turn of the tool below which the tip counts as standing, m/rad.
const STANDING: f64 = 0.05;
/// Step of the tip above which it leaves the place of a turn, m.
const LEAVING: f64 = 1e-9;
/// Time in which the axes have left the place of a turn behind the setpoints, s.
const SETTLING: f64 = 0.25;

/// Turns of the tool about a standing tip, by the setpoints up to the newest one, which may be a future one.
#[derive(Debug, Clone)]
pub struct StandingTurn {
    /// Newest setpoint.
    last: Option<ToolPose>,
    /// True from a turn until the tip moves on.
    is_standing: bool,
    /// Time until which the axes are at the place of a turn, s.
    until: f64,
}

impl Default for StandingTurn {
    fn default() -> Self {
        StandingTurn { last: None, is_standing: false, until: f64::NEG_INFINITY }
    }
}

impl StandingTurn {
    /// Adds the tool pose of the next setpoint and its time, s.
    pub fn push(&mut self, setpoint: ToolPose, time: f64) {
        let Some(last) = self.last.replace(setpoint) else { return };
        let (angle, step) = ((last.axis - setpoint.axis).norm(), (last.tip - setpoint.tip).norm());
        self.is_standing = step < STANDING * angle || self.is_standing && step < LEAVING;
        if self.is_standing {
            self.until = time + SETTLING;
        }
    }

    /// Returns true if the orientation at `time`, s, not after the newest setpoint, is to be compared with that of the
    /// setpoints of the same time, delayed by α.
    pub fn is_turning(&self, time: f64) -> bool {
        time <= self.until
    }
}
