//! Figures of a trial (the errors of the model, section by section), SI units.

use crate::assess::AxisReport;
use crate::config::AxisKind;

/// Everything that is measured on a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// Simulated time until the axes had settled, s.
    pub duration: f64,
    /// Of each axis of the machine, in its order.
    pub axes: Vec<AxisFigures>,
    /// Contour error; none for a machine without linear axes.
    pub contour: Option<ContourFigures>,
    /// Orientation error; none for a machine without rotary axes.
    pub orientation: Option<OrientationFigures>,
    /// Circles of a whole turn or more, in their order.
    pub circles: Vec<CircleFigures>,
    /// Circles beyond these, of which nothing is measured.
    pub more_circles: usize,
    /// The same circle in both directions.
    pub bidirectional: Vec<BidirectionalFigures>,
    /// Where the direction turns, in their order.
    pub corners: Vec<CornerFigures>,
    /// Corners beyond these, of which nothing is measured on their own.
    pub more_corners: usize,
}

/// Figures of one axis, from the first setpoint until the last one has passed the delays.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisFigures {
    /// Joint.
    pub name: String,
    /// Linear or rotary.
    pub kind: AxisKind,
    /// Whether its setpoints moved.
    pub moves: bool,
    /// Errors, current, saturation.
    pub report: AxisReport,
    /// Time at which it had left its stroke at position instants, over the whole run, s.
    pub outside_stroke_time: f64,
    /// Whether the friction law was used beyond the velocities that it was fitted for.
    pub friction_extrapolated: bool,
}

/// What contour errors are measured against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The continuous geometric path.
    Path,
    /// The polyline through the setpoints.
    Setpoints,
}

/// Distance of the tool tip from the path in the workpiece frame, at every tick of the whole run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContourFigures {
    /// What it is measured against.
    pub reference: Reference,
    /// Largest, m.
    pub max: f64,
    /// RMS, m.
    pub rms: f64,
    /// Largest without what overshoots the path's two ends, m.
    pub max_within_ends: f64,
    /// RMS without what overshoots the path's two ends, m.
    pub rms_within_ends: f64,
}

/// Angle between the tool axis and that of the path at its nearest point, at every tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientationFigures {
    /// Largest, rad.
    pub max: f64,
    /// RMS, rad.
    pub rms: f64,
}

/// Circularity of one circle at steady feed (ISO 230-4).
#[derive(Debug, Clone, PartialEq)]
pub struct CircleFigures {
    /// Move, from 1.
    pub index: usize,
    /// Names of the axes of its plane.
    pub plane: [String; 2],
    /// Whether it turns from the first axis towards the second.
    pub counterclockwise: bool,
    /// Nominal radius, m.
    pub radius: f64,
    /// Mean radial deviation, m, positive outside.
    pub mean: f64,
    /// Smallest radial deviation, m.
    pub min: f64,
    /// Largest radial deviation, m.
    pub max: f64,
    /// G, circular deviation, m; none where the points leave part of the circle open.
    pub circular_deviation: Option<f64>,
}

/// One circle run in both directions (ISO 230-4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BidirectionalFigures {
    /// The two moves, from 1.
    pub moves: [usize; 2],
    /// G(b), bi-directional circular deviation, m.
    pub circular_deviation: f64,
    /// D, mean bi-directional radial deviation, m.
    pub mean_radial_deviation: f64,
}

/// A corner of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerFigures {
    /// The move that ends there, from 1.
    pub index: usize,
    /// Turn of the direction, rad.
    pub turn: f64,
    /// Largest contour error within 0.15 s of the corner's passing the delays, m.
    pub max_contour_error: f64,
}
