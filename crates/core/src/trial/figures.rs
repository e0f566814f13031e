//! Figures of a trial, SI units.

use crate::assess::AxisReport;
use crate::config::AxisKind;
use crate::kinematics::AxisRole;

/// Figures of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// Simulated time until the axes had settled, s.
    pub duration: f64,
    /// Figures of each axis, in the order of the machine.
    pub axes: Vec<AxisFigures>,
    /// Energy of the common DC link of all axes; `None` if it was not evaluated.
    pub dc_link: Option<DcLinkEnergy>,
    /// Contour error; `None` without linear axes.
    pub contour: Option<ContourFigures>,
    /// Orientation error; `None` without rotary axes.
    pub orientation: Option<OrientationFigures>,
    /// Circles of at least a whole turn, in order.
    pub circles: Vec<CircleFigures>,
    /// Number of further circles, which are not evaluated.
    pub more_circles: usize,
    /// Circles run in both directions.
    pub bidirectional: Vec<BidirectionalFigures>,
    /// Corners of the path, in order.
    pub corners: Vec<CornerFigures>,
    /// Number of further corners, which are not evaluated individually.
    pub more_corners: usize,
}

impl Figures {
    /// Returns the moving axes that move the tool, by their names and kinds.
    pub fn moving_tool_axes(&self) -> impl Iterator<Item = &AxisFigures> {
        let has_role =
            |axis: &AxisFigures| AxisRole::ALL.iter().any(|role| role.matches(&axis.name, axis.kind));
        self.axes.iter().filter(move |axis| axis.moves && has_role(axis))
    }
}

/// Figures of one axis, from the first setpoint until the last one has passed the delays.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisFigures {
    /// Name of the joint.
    pub name: String,
    /// Kind of the axis.
    pub kind: AxisKind,
    /// True if its setpoints changed.
    pub moves: bool,
    /// Limit of the motor current, A.
    pub max_current: f64,
    /// Errors, current, saturation.
    pub report: AxisReport,
    /// Figures of the position cycles at feed; `None` without rapid traverse, or without anything else.
    pub cuts: Option<AxisReport>,
    /// Time outside its travel limits at position cycles, over the whole run, s.
    pub outside_travel_limits_time: f64,
    /// True if the friction law was used beyond the velocities that it was fitted for.
    pub friction_extrapolated: bool,
    /// Energy over the whole run; `None` if it was not evaluated.
    pub energy: Option<AxisEnergy>,
}

/// Energy of one axis over a run: `input = copper_loss + mechanical_work + magnetic`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisEnergy {
    /// Electrical input from the DC link minus what was fed back, J.
    pub input: f64,
    /// Electrical energy fed back to the DC link, J.
    pub returned: f64,
    /// Copper loss of the motor, J.
    pub copper_loss: f64,
    /// Work of the motor on the axis, J: against friction, gravity and loads, and the change of the kinetic energy.
    pub mechanical_work: f64,
    /// Change of the magnetic energy of the motor, J.
    pub magnetic: f64,
    /// Largest mean electrical power of a current cycle, W.
    pub peak_power: f64,
    /// Mean copper loss while the setpoint stands still and the motor is at rest, W; `None` if it never is.
    pub holding_power: Option<f64>,
}

/// Energy that all axes draw together from a common DC link, which passes what one feeds back to the others.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DcLinkEnergy {
    /// Energy drawn from the link, J.
    pub drawn: f64,
    /// Energy fed back to the link, which others cannot use at that time, J.
    pub returned: f64,
    /// Largest mean power of a current cycle, W.
    pub peak_power: f64,
}

/// Reference of the contour errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The continuous geometric path.
    Path,
    /// The polyline through the setpoints.
    Setpoints,
}

/// Contour error: distance of the tool tip from the path in the workpiece frame, at every tick of the whole run. Where
/// setpoints at feed and at rapid traverse are distinguished, that of the motions at feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContourFigures {
    /// Reference of the contour error.
    pub reference: Reference,
    /// Largest contour error, m.
    pub max: f64,
    /// RMS contour error, m.
    pub rms: f64,
    /// Largest contour error without overshoot beyond the path's two ends, m.
    pub max_within_ends: f64,
    /// RMS contour error without overshoot beyond the path's two ends, m.
    pub rms_within_ends: f64,
    /// Contour error at rapid traverse; `None` without rapid traverse, or without anything else.
    pub rapids: Option<RapidFigures>,
}

/// Contour error at rapid traverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RapidFigures {
    /// Largest contour error, m.
    pub max: f64,
    /// RMS contour error, m.
    pub rms: f64,
}

/// Orientation error: angle between the tool axis and that of the path at its nearest point, at every tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientationFigures {
    /// Largest orientation error, rad.
    pub max: f64,
    /// RMS orientation error, rad.
    pub rms: f64,
}

/// Circularity of one circle at constant feed (ISO 230-4).
#[derive(Debug, Clone, PartialEq)]
pub struct CircleFigures {
    /// Move, counted from 1.
    pub index: usize,
    /// Names of the axes of its plane.
    pub plane: [String; 2],
    /// True if it turns from the first axis towards the second.
    pub counterclockwise: bool,
    /// Nominal radius, m.
    pub radius: f64,
    /// Feed, m/s.
    pub feed: f64,
    /// Mean radial deviation, m, positive outside.
    pub mean: f64,
    /// Smallest radial deviation, m.
    pub min: f64,
    /// Largest radial deviation, m.
    pub max: f64,
    /// Circular deviation G, m; `None` if the points leave part of the circle open.
    pub circular_deviation: Option<f64>,
    /// Reversal spikes at +first, +second, −first and −second axis, m; `None` as for the circular deviation.
    pub reversal_spikes: Option<[f64; 4]>,
}

/// Circle run in both directions (ISO 230-4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BidirectionalFigures {
    /// Both moves, counted from 1.
    pub moves: [usize; 2],
    /// Bi-directional circular deviation G(b), m.
    pub circular_deviation: f64,
    /// Mean bi-directional radial deviation D, m.
    pub mean_radial_deviation: f64,
}

/// A corner of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerFigures {
    /// Move that ends at the corner, counted from 1.
    pub index: usize,
    /// Change of direction, rad.
    pub turn: f64,
    /// Largest contour error within 0.15 s of the corner, shifted by the delay of the position loop, m.
    pub max_contour_error: f64,
}
