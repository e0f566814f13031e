//! Angles between tool axes: orientation errors.

use nalgebra::Vector3;

use crate::simd::{SliceOperation, vectorize};

/// Largest tangent of an angle that is computed by its power series.
const SERIES_LIMIT: f64 = 0.1;
/// Coefficients of the power series of atan(x)/x in x². The first omitted term is below 10⁻¹⁷ up to [`SERIES_LIMIT`].
const SERIES: [f64; 8] =
    [1.0, -1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0, -1.0 / 15.0];

/// Returns the angle between two vectors, rad; exact for small angles.
pub(super) fn tool_angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    // Equal on all paths with fixed rotary tables.
    if a == b { 0.0 } else { a.cross(b).norm().atan2(a.dot(b)) }
}

/// Angles between pairs of vectors, by products with their sine and cosine.
#[derive(Debug, Clone, Default)]
pub(super) struct ToolAngles {
    square_sines: Vec<f64>,
    cosines: Vec<f64>,
}

impl ToolAngles {
    /// Sets the number of angles; their values are undetermined.
    pub fn resize(&mut self, count: usize) {
        self.square_sines.resize(count, 0.0);
        self.cosines.resize(count, 0.0);
    }

    /// Returns the first `count` squares of the sines, times the squares of the lengths of both vectors, and cosines,
    /// times the lengths.
    #[inline(always)]
    pub fn columns(&mut self, count: usize) -> [&mut [f64]; 2] {
        [&mut self.square_sines[..count], &mut self.cosines[..count]]
    }

    /// Returns the square of the sine of the angle between two vectors, times the squares of their lengths, and its
    /// cosine, times their lengths.
    #[inline(always)]
    pub fn square_sine_and_cosine(a: [f64; 3], b: [f64; 3]) -> [f64; 2] {
        let x = a[1] * b[2] - a[2] * b[1];
        let y = a[2] * b[0] - a[0] * b[2];
        let z = a[0] * b[1] - a[1] * b[0];
        [x * x + y * y + z * z, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]]
    }

    /// Writes the angles, rad, within 3·10⁻¹⁶ of their value relative to it.
    pub fn write_angles(&self, angles: &mut [f64]) {
        let is_series =
            vectorize(AngleSeries { square_sines: &self.square_sines, cosines: &self.cosines, angles });
        if !is_series {
            for ((angle, square), cosine) in angles.iter_mut().zip(&self.square_sines).zip(&self.cosines) {
                *angle = square.sqrt().atan2(*cosine);
            }
        }
    }
}

/// Computation of angles by their power series.
struct AngleSeries<'a> {
    square_sines: &'a [f64],
    cosines: &'a [f64],
    angles: &'a mut [f64],
}

impl SliceOperation for AngleSeries<'_> {
    type Output = bool;

    /// Writes the angles; returns false if one is too large for the series.
    #[inline(always)]
    fn run(self) -> bool {
        let count = self.angles.len();
        let (square_sines, cosines) = (&self.square_sines[..count], &self.cosines[..count]);
        let mut is_small = true;
        for index in 0..count {
            let (sine, cosine) = (square_sines[index].sqrt(), cosines[index]);
            // Vectors of length 0 have no angle.
            is_small &= (sine <= SERIES_LIMIT * cosine) & (cosine > 0.0);
            let tangent = sine / cosine;
            let square = tangent * tangent;
            let mut sum = 0.0;
            for coefficient in SERIES.into_iter().rev() {
                sum = sum * square + coefficient;
            }
            self.angles[index] = tangent * sum;
        }
        is_small
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_all_sizes_are_those_of_the_arctangent() {
        let axis = |angle: f64| [angle.sin(), 0.0, angle.cos()];
        let all: Vec<f64> =
            (0..4000).map(|i| 1e-12 * 1.008_f64.powi(i)).filter(|angle| *angle < 3.1).collect();
        for part in all.chunks(7) {
            let mut angles = ToolAngles::default();
            angles.resize(part.len());
            let [sines, cosines] = angles.columns(part.len());
            for (index, angle) in part.iter().enumerate() {
                [sines[index], cosines[index]] =
                    ToolAngles::square_sine_and_cosine([0.0, 0.0, 2.0], axis(*angle));
            }
            let mut found = vec![0.0; part.len()];
            angles.write_angles(&mut found);
            for (found, wanted) in found.iter().zip(part) {
                assert!((found - wanted).abs() <= 5e-16 * wanted, "{found} instead of {wanted}");
            }
        }
    }

    #[test]
    fn a_vector_of_length_0_has_the_angle_0() {
        let mut angles = ToolAngles::default();
        angles.resize(1);
        let mut found = [1.0];
        angles.write_angles(&mut found);
        assert_eq!(found, [0.0]);
    }
}
