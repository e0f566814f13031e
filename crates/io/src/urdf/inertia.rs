//! Mass, center of mass and inertia of a link from its shapes.
//!
//! The drives have the inertia of the machine file; these are those of a rigid-body simulator, such as Gazebo, which rejects
//! links without them.

use super::shapes::{Geometry, Visual};

/// Density of the shapes, kg/m³: a quarter of cast iron, since castings are hollow.
const DENSITY: f64 = 1800.0;

/// Mass, center of mass and inertia of a link.
pub(super) struct Inertia {
    /// Mass, kg.
    pub mass: f64,
    /// Center of mass in the frame of the link, m.
    pub center: [f64; 3],
    /// Inertia about the center of mass, along the axes of the link, kg·m².
    pub tensor: [[f64; 3]; 3],
}

impl Inertia {
    /// Returns the inertia of `shapes`, each homogeneous.
    pub fn of(shapes: &[Visual]) -> Self {
        let masses: Vec<f64> = shapes.iter().map(|shape| DENSITY * volume(&shape.geometry)).collect();
        let mass: f64 = masses.iter().sum();
        let weighted =
            |i: usize| shapes.iter().zip(&masses).map(|(shape, m)| m * shape.origin[i]).sum::<f64>();
        let center: [f64; 3] = std::array::from_fn(|i| weighted(i) / mass);
        let mut tensor = [[0.0; 3]; 3];
        for (shape, &m) in shapes.iter().zip(&masses) {
            let offset: [f64; 3] = std::array::from_fn(|i| shape.origin[i] - center[i]);
            let squared: f64 = offset.iter().map(|d| d * d).sum();
            let own = principal(shape, m);
            for (i, row) in tensor.iter_mut().enumerate() {
                row[i] += own[i] + m * squared;
                for (j, term) in row.iter_mut().enumerate() {
                    *term -= m * offset[i] * offset[j];
                }
            }
        }
        Inertia { mass, center, tensor }
    }
}

/// Returns the volume, m³.
fn volume(geometry: &Geometry) -> f64 {
    match geometry {
        Geometry::Box([x, y, z]) => x * y * z,
        Geometry::Cylinder { radius, length } => std::f64::consts::PI * radius * radius * length,
    }
}

/// Returns the moments of inertia of a shape of mass `m`, kg, about its center along the axes of the link, kg·m².
fn principal(shape: &Visual, m: f64) -> [f64; 3] {
    match shape.geometry {
        Geometry::Box([x, y, z]) => [y * y + z * z, x * x + z * z, x * x + y * y].map(|sum| m * sum / 12.0),
        Geometry::Cylinder { radius, length } => {
            let across = m * (3.0 * radius * radius + length * length) / 12.0;
            let along = m * radius * radius / 2.0;
            // A shape is turned by a right angle about Y or not at all.
            if shape.rotation[1] == 0.0 { [across, across, along] } else { [along, across, across] }
        }
    }
}
