//! Signal recording of a run: axis signals over time, tool path, circles.

use crate::config::AxisKind;

/// Signals of one run at position cycles; all lists of a run have the length of [`Self::time`].
///
/// Quantities whose figures are evaluated at every tick are recorded at their largest value in the position
/// cycle, so that a plot shows the figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SignalRecording {
    /// Time from the start, s.
    pub time: Vec<f64>,
    /// Signals of each axis, in the order of the machine.
    pub axes: Vec<AxisTrace>,
    /// Tool signals in the workpiece frame; `None` without linear axes.
    pub tool: Option<ToolTrace>,
    /// Circles at constant feed, each direction separately.
    pub circles: Vec<CircleTrace>,
}

/// Signals of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisTrace {
    /// Name of the joint.
    pub name: String,
    /// Kind of the axis: linear, m and m/s, or rotary, rad and rad/s.
    pub kind: AxisKind,
    /// True if the setpoints of the axis change.
    pub moves: bool,
    /// Position setpoint at the entrance of the position controller (PSEC), m or rad.
    pub psec: Vec<f64>,
    /// Position SP, m or rad.
    pub position: Vec<f64>,
    /// Following error PSEC − SP, m or rad.
    pub following_error: Vec<f64>,
    /// Delay-compensated following error, PSEC delayed by α − SP, m or rad.
    pub delay_compensated_following_error: Vec<f64>,
    /// Velocity SV, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// Motor current SMC of largest magnitude in the position cycle, A.
    pub current: Vec<f64>,
    /// Setpoint of the current loop, A.
    pub current_setpoint: Vec<f64>,
    /// Friction component of the current, A.
    pub friction_current: Vec<f64>,
    /// Gravity component of the current, A.
    pub gravity_current: Vec<f64>,
    /// Component of the current from the external load, A.
    pub load_current: Vec<f64>,
    /// Share of the current cycles of a position cycle in which speed, current or voltage setpoint is at its limit.
    pub saturation: Vec<f64>,
}

/// Tool tip in the workpiece frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolTrace {
    /// Nearest point of the path, m.
    pub reference: Vec<[f64; 3]>,
    /// Position of the tip, m.
    pub position: Vec<[f64; 3]>,
    /// Contour error, m: distance of the tip from the path, the largest value of the position cycle.
    pub contour_error: Vec<f64>,
    /// Orientation error, rad: angle between the tool axis and that of the path at its nearest point, the
    /// largest value of the position cycle. Empty without rotary axes.
    pub orientation_error: Vec<f64>,
}

/// Part of a circle at constant feed.
#[derive(Debug, Clone, PartialEq)]
pub struct CircleTrace {
    /// Names of the axes of the first and second coordinate.
    pub plane: [String; 2],
    /// Nominal radius, m.
    pub radius: f64,
    /// True if it turns from the first axis towards the second (counterclockwise).
    pub counterclockwise: bool,
    /// Polar angle about the nominal center, rad, continuous over several turns.
    pub angle: Vec<f64>,
    /// Radial deviation, m, positive outside.
    pub deviation: Vec<f64>,
}
