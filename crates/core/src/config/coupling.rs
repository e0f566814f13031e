//! Couplings between axes in SI units: workpiece on the tables of A and C, beam of a gantry.

/// Workpiece on the table of C, which couples A and C; a body in addition to the inertias of both axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkpieceConfig {
    /// Mass, kg.
    pub mass: f64,
    /// Center of mass in the workpiece frame, m.
    pub center_of_mass: [f64; 3],
    /// Principal moments of inertia about the center of mass, parallel to the axes of the workpiece frame, kg·m².
    pub moments: [f64; 3],
}

/// Beam between the two linear axes of a gantry: a spring and a damper between their positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GantryConfig {
    /// Indices of both axes in `joints`.
    pub axes: [usize; 2],
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Damping, N/(m/s).
    pub damping: f64,
}
