//! What a run looked like: signals over time, the path of the tool, circles.

use crate::config::AxisKind;

/// Signals of one run at the same position instants; every list of a run is as long as [`Self::time`].
///
/// What figures measure at every tick is taken where it is largest in the position period that begins there, so
/// that a plot shows the figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// s from the start.
    pub time: Vec<f64>,
    /// Of each axis of the machine, in its order.
    pub axes: Vec<AxisTrace>,
    /// Of the tool in the workpiece frame; none for a machine without linear axes.
    pub tool: Option<ToolTrace>,
    /// Circles that were run at constant feed, each direction on its own.
    pub circles: Vec<CircleTrace>,
}

/// Signals of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisTrace {
    /// Name of the joint.
    pub name: String,
    /// Linear: m, m/s; rotary: rad, rad/s.
    pub kind: AxisKind,
    /// Whether the axis was given setpoints that move.
    pub moves: bool,
    /// PSEC, m or rad.
    pub psec: Vec<f64>,
    /// SP, m or rad.
    pub position: Vec<f64>,
    /// PSEC − SP, m or rad.
    pub tracking_error: Vec<f64>,
    /// PSEC delayed by α − SP, m or rad.
    pub synchronized_tracking_error: Vec<f64>,
    /// SV, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// SMC, A, where it is largest in the position period.
    pub current: Vec<f64>,
    /// Setpoint of the current loop, A.
    pub current_setpoint: Vec<f64>,
    /// Part of the current that friction takes, A.
    pub friction_current: Vec<f64>,
    /// Part of the current that gravity takes, A.
    pub gravity_current: Vec<f64>,
    /// Part of the current that the external load takes, A.
    pub load_current: Vec<f64>,
}

/// The tool tip in the workpiece frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolTrace {
    /// Nearest point of the path, m.
    pub reference: Vec<[f64; 3]>,
    /// Where the tip is, m.
    pub position: Vec<[f64; 3]>,
    /// Distance of the tip from the path, m, the largest of the position period.
    pub contour_error: Vec<f64>,
    /// Angle between the tool axis and that of the path at its nearest point, rad, the largest of the position
    /// period; empty for a machine without rotary axes.
    pub orientation_error: Vec<f64>,
}

/// The steady part of a circle.
#[derive(Debug, Clone, PartialEq)]
pub struct CircleTrace {
    /// Names of the two axes, first and second coordinate.
    pub plane: [String; 2],
    /// Nominal radius, m.
    pub radius: f64,
    /// Whether it turns from the first axis towards the second (counterclockwise).
    pub counterclockwise: bool,
    /// Polar angle about the nominal center, rad, growing or falling over several turns.
    pub angle: Vec<f64>,
    /// Radial deviation, m, positive outside.
    pub deviation: Vec<f64>,
}
