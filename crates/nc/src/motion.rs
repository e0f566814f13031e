//! Motions and events of a part program, as the interpreter returns them and the feed planner consumes them.

/// Number of programmed axes.
pub const AXIS_COUNT: usize = 9;
/// Letters of the programmed axes, in the order of [`Coordinates`].
pub const AXIS_LETTERS: [char; AXIS_COUNT] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];
/// Coordinates of X, Y, Z, A, B, C, U, V, W: m for linear axes, rad for A, B and C. An axis that the machine lacks
/// keeps its initial value.
pub type Coordinates = [f64; AXIS_COUNT];

/// Returns true for A, B and C.
pub(crate) fn is_rotary(axis: usize) -> bool {
    (3..6).contains(&axis)
}

/// Step of a program: a motion, or an event between motions.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nearly all steps are motions")]
pub enum ProgramStep {
    /// Motion of the axes.
    Motion(ProgramMotion),
    /// Event at standstill or between motions.
    Event {
        /// Source line, from 1.
        line: usize,
        /// Event.
        event: ProgramEvent,
    },
}

/// Motion of the axes along one curve.
///
/// Coordinates contain all offsets of the program: work offset, G92 and tool length. Without tool center point control
/// they are positions of the machine's axes. With it, X, Y and Z are the tool tip as fixed to the workpiece: its
/// coordinates in the machine frame with A, B and C at 0.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramMotion {
    /// Source line, from 1.
    pub line: usize,
    /// Curve of the linear axes X, Y and Z; other axes move in proportion to the curve's parameter.
    pub kind: MotionKind,
    /// Start: the end of the motion before.
    pub start: Coordinates,
    /// End.
    pub end: Coordinates,
    /// Programmed feed.
    pub feed: Feed,
    /// Behavior at the end of the motion.
    pub path_control: PathControl,
    /// Tool length of tool center point control (G43.4), m; `None` if it is off.
    pub tcp_length: Option<f64>,
}

/// Curve of a motion.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionKind {
    /// Straight line at rapid traverse (G0), all axes arriving together; [`ProgramMotion::feed`] is [`Feed::Rapid`].
    Rapid,
    /// Straight line at feed (G1).
    Line,
    /// Circular arc or helix at feed (G2, G3).
    Arc(PlanarArc),
    /// Rational B-spline in a plane at feed (G5.2).
    Nurbs(Nurbs),
}

/// Circular arc in a plane, with a proportional motion of the other axes (helix).
///
/// The radii at start and end differ by at most the tolerance of the interpreter, since programs round the center.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarArc {
    /// Plane of the circle.
    pub plane: Plane,
    /// Center along the two axes of the plane, m, in their order.
    pub center: [f64; 2],
    /// Swept angle with all turns, rad: positive from the first to the second axis of the plane (G3).
    pub sweep: f64,
}

/// Clamped, non-uniform rational B-spline in a plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Nurbs {
    /// Plane of the curve.
    pub plane: Plane,
    /// Order: the degree plus one.
    pub order: usize,
    /// Control points along the two axes of the plane, m, with their weights; the first is the start.
    pub control: Vec<([f64; 2], f64)>,
}

/// Plane of an arc, by its axes in right-handed order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plane {
    /// X and Y (G17), normal Z.
    Xy,
    /// Z and X (G18), normal Y.
    Zx,
    /// Y and Z (G19), normal X.
    Yz,
}

impl Plane {
    /// Returns the indices in [`Coordinates`] of the first axis, the second axis and the normal.
    pub fn axes(self) -> [usize; 3] {
        match self {
            Plane::Xy => [0, 1, 2],
            Plane::Zx => [2, 0, 1],
            Plane::Yz => [1, 2, 0],
        }
    }
}

/// Feed of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Feed {
    /// Rapid traverse: as fast as the axes allow.
    Rapid,
    /// Feed along the path of X, Y and Z, or along that of U, V and W if X, Y and Z do not move, m/s.
    Linear(f64),
    /// Feed of a motion of A, B and C alone: Euclidean norm of their speeds, rad/s.
    Rotary(f64),
    /// Duration of the motion (G93), s.
    Duration(f64),
}

/// Path control mode: behavior of the feed and of the path at the end of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PathControl {
    /// Stop at the end of each motion (G61.1). Splines deviate by up to 0.5 µm.
    ExactStop,
    /// Exact path (G61): a stop where tangent or curvature are discontinuous. Splines deviate by up to 0.5 µm.
    ExactPath,
    /// Blending within a tolerance (G64).
    Blend(Blend),
}

/// Tolerances of blending (G64 P Q).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// Maximum deviation of X, Y and Z from the programmed path, m; `None` without P: the best speed.
    pub tolerance: Option<f64>,
    /// Maximum deviation of A, B and C, rad: as many degrees as `tolerance` has millimeters.
    pub rotary_tolerance: Option<f64>,
    /// Word Q, m, which has no effect: lines are joined within `tolerance`.
    pub merge_tolerance: Option<f64>,
}

/// Event of a program that moves no axis.
#[derive(Debug, Clone, PartialEq)]
pub enum ProgramEvent {
    /// Dwell (G4), s.
    Dwell(f64),
    /// Standstill for a tool change or a change of the spindle speed, s.
    Pause(f64),
    /// Program stop (M0).
    Stop,
    /// Optional stop (M1).
    OptionalStop,
    /// Program end (M2, M30, or the end of the file).
    End,
    /// Selection of the next tool (T).
    ToolSelection(u32),
    /// Tool change to a tool (M6).
    ToolChange(u32),
    /// Spindle speed, rad/s: positive clockwise (M3), negative counterclockwise (M4), 0 stopped (M5).
    Spindle(f64),
    /// Coolant: mist (M7) and flood (M8), both off by M9.
    Coolant {
        /// True if mist is on.
        mist: bool,
        /// True if flood is on.
        flood: bool,
    },
    /// Comment for the operator (MSG).
    Message(String),
}
