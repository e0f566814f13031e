//! Rigid-body dynamics of a workpiece on a tilting table A that carries a rotary table C.
//!
//! Lagrange's equations of the two joints (Spong, Hutchinson and Vidyasagar, *Robot Modeling and Control*, 2006,
//! chapter 7) for the kinematic chain of [`kinematics`](crate::kinematics). With ρ = Rz(−c) (W + p − Pc),
//! the center of mass p seen from the axis of C, y = Pc_y − Pa_y + ρ_y and h = W_z + p_z − Pa_z, its coordinates from the
//! axis of A, the torques of the joints towards plus are:
//!
//! ```text
//! M_aa = m (y² + h²) + Ix cos² c + Iy sin² c      M_ac = −m h ρ_x      M_cc = m (ρ_x² + ρ_y²) + Iz
//! τ_a = M_aa ä + M_ac c̈ + M_aa′ ȧ ċ + M_ac′ ċ² − m g (y cos a + h sin a)
//! τ_c = M_ac ä + M_cc c̈ − M_aa′ ȧ²/2 + m g ρ_x sin a
//! ```
//!
//! The prime is the derivative by c: M_aa′ = −2 m y ρ_x + (Iy − Ix) sin 2c and M_ac′ = −m h ρ_y. Gravity acts along −Z
//! of the machine frame.

use crate::config::{KinematicsConfig, WorkpieceConfig};

/// Standard acceleration of gravity, m/s² (3rd General Conference on Weights and Measures, 1901).
pub const STANDARD_GRAVITY: f64 = 9.80665;

/// Inertia, gravity and velocity torques of a workpiece at the joints A and C, in this order; see the
/// equations of this module.
///
/// Angles and torques have the signs of the axes: positive A and C turn the tables about −X and −Z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkpieceDynamics {
    mass: f64,
    moments: [f64; 3],
    /// W + p − Pc in X and Y, m.
    offset: [f64; 2],
    /// Pc_y − Pa_y, m.
    table_y: f64,
    /// h, m.
    height: f64,
}

impl WorkpieceDynamics {
    /// Creates the dynamics of a workpiece on the tables of a machine.
    pub fn new(kinematics: &KinematicsConfig, workpiece: &WorkpieceConfig) -> Self {
        let [x, y, z] = [0, 1, 2].map(|k| kinematics.workpiece[k] + workpiece.center_of_mass[k]);
        let (pivot_a, pivot_c) = (kinematics.pivot_a, kinematics.pivot_c);
        WorkpieceDynamics {
            mass: workpiece.mass,
            moments: workpiece.moments,
            offset: [x - pivot_c[0], y - pivot_c[1]],
            table_y: pivot_c[1] - pivot_a[0],
            height: z - pivot_a[1],
        }
    }

    /// Returns ρ_x, ρ_y and y at the angle `c` (rad), m.
    fn center(&self, c: f64) -> [f64; 3] {
        let ([x, y], (sin, cos)) = (self.offset, c.sin_cos());
        let across = cos * y - sin * x;
        [cos * x + sin * y, across, self.table_y + across]
    }

    /// Returns the mass matrix at the angle `c` (rad), kg·m².
    pub fn mass_matrix(&self, c: f64) -> [[f64; 2]; 2] {
        let ([x, y, from_a], (sin, cos), m) = (self.center(c), c.sin_cos(), self.mass);
        let [ix, iy, iz] = self.moments;
        let both = m * (from_a * from_a + self.height * self.height) + ix * cos * cos + iy * sin * sin;
        let mixed = -m * self.height * x;
        [[both, mixed], [mixed, m * (x * x + y * y) + iz]]
    }

    /// Returns the torques that hold the workpiece against gravity at the angles `[a, c]` (rad), N·m.
    pub fn gravity_torques(&self, [a, c]: [f64; 2]) -> [f64; 2] {
        let ([x, _, from_a], (sin, cos), weight) =
            (self.center(c), a.sin_cos(), self.mass * STANDARD_GRAVITY);
        [-weight * (from_a * cos + self.height * sin), weight * x * sin]
    }

    /// Returns the Coriolis and centrifugal torques at the angle `c` (rad) and the velocities of A and C (rad/s), N·m.
    pub fn velocity_torques(&self, c: f64, [va, vc]: [f64; 2]) -> [f64; 2] {
        let ([x, y, from_a], m) = (self.center(c), self.mass);
        let [ix, iy, _] = self.moments;
        let slope = -2.0 * m * from_a * x + (iy - ix) * (2.0 * c).sin();
        let mixed_slope = -m * self.height * y;
        [slope * va * vc + mixed_slope * vc * vc, -0.5 * slope * va * va]
    }
}
