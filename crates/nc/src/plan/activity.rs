//! Activity of the machine at a setpoint.

/// Kind of the time of a part program.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TimeKind {
    /// Motion at feed.
    Feed,
    /// Rapid traverse.
    #[default]
    Rapid,
    /// Dwell (G4, cycles).
    Dwell,
    /// Standstill for a tool change or a change of the spindle speed.
    Auxiliary,
}

/// Activity of the machine at a setpoint: kind of its time, source line and tool.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ProgramActivity {
    /// Kind of the time.
    pub kind: TimeKind,
    /// Source line, from 1; 0 before the first motion.
    pub line: usize,
    /// Tool in the spindle; `None` before the first tool change.
    pub tool: Option<u32>,
}

/// Standstill between two motions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ProgramStop {
    /// Duration, s.
    pub time: f64,
    pub activity: ProgramActivity,
}
