//! Batch forward kinematics: tool poses at consecutive instants.

use nalgebra::Vector3;

use super::chain::{AxisRole, Kinematics, TableAngles, Tables, ToolPose};
use crate::simd::{AlignedBuffer, LANES, SliceOperation, vectorize};

/// Largest distance of an angle from the middle one, rad, up to which sines and cosines are computed by power series.
const SERIES_LIMIT: f64 = 0.0625;

/// Tool poses at consecutive instants, as structure of arrays.
#[derive(Debug, Clone, Default)]
pub struct Poses {
    /// X, Y and Z of the tips, m, workpiece frame.
    tips: [AlignedBuffer; 3],
    /// Components of the tool axes.
    axes: [AlignedBuffer; 3],
    /// True if the tables do not move.
    has_constant_axis: bool,
    /// Sines and cosines of A and C at each instant.
    angles: [[AlignedBuffer; 2]; 2],
}

/// Returns true if all values are bit-identical.
fn are_equal(values: &[f64]) -> bool {
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return true };
    // Without an early end the comparison is a series of vector instructions.
    first.to_bits() == last.to_bits()
        && values.iter().fold(0, |differences, value| differences | (value.to_bits() ^ first.to_bits())) == 0
}

impl Poses {
    /// Returns the number of poses.
    pub fn len(&self) -> usize {
        self.tips[0].len()
    }

    /// Returns true if there are no poses.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns X, Y and Z of the tips, m, workpiece frame.
    pub fn tips(&self) -> [&[f64]; 3] {
        self.tips.each_ref().map(|values| &**values)
    }

    /// Returns the components of the tool axes in the workpiece frame.
    pub fn axes(&self) -> [&[f64]; 3] {
        self.axes.each_ref().map(|values| &**values)
    }

    /// Returns X, Y and Z of the tips, m, workpiece frame, in vectors; those beyond the last pose are undetermined.
    #[inline(always)]
    pub(crate) fn tip_lanes(&self) -> [&[[f64; LANES]]; 3] {
        self.tips.each_ref().map(AlignedBuffer::lanes)
    }

    /// Returns the tip at `instant`, m, workpiece frame.
    ///
    /// # Panics
    /// If `instant` is not below [`len`](Self::len).
    #[inline]
    pub fn tip(&self, instant: usize) -> Vector3<f64> {
        Vector3::new(self.tips[0][instant], self.tips[1][instant], self.tips[2][instant])
    }

    /// Returns the pose at `instant`.
    ///
    /// # Panics
    /// If `instant` is not below [`len`](Self::len).
    pub fn get(&self, instant: usize) -> ToolPose {
        let axis = Vector3::new(self.axes[0][instant], self.axes[1][instant], self.axes[2][instant]);
        ToolPose { tip: self.tip(instant), axis }
    }

    /// Returns the common tool axis if the tables do not move.
    pub fn constant_axis(&self) -> Option<Vector3<f64>> {
        (self.has_constant_axis && !self.is_empty()).then(|| self.get(0).axis)
    }

    /// Returns true if all poses are bit-identical.
    pub fn is_constant(&self) -> bool {
        self.has_constant_axis && self.tips().into_iter().all(are_equal)
    }

    /// Sets the number of poses; their values are undetermined.
    fn resize(&mut self, instants: usize) {
        let angles = self.angles.iter_mut().flatten();
        for values in self.tips.iter_mut().chain(&mut self.axes).chain(angles) {
            values.resize(instants);
        }
    }
}

impl Kinematics {
    /// Computes the tool poses at `instants` consecutive instants. `joints` contains the values of the first joint at all
    /// instants, then those of the next joint, m or rad.
    ///
    /// Sines and cosines of the tables are within 2·10⁻¹⁶ of those of [`forward_cached`](Self::forward_cached), so the
    /// tip is within 10⁻¹⁵ of it relative to the size of the machine. While a table does not move, they are identical.
    pub fn forward_batch(
        &self,
        table_angles: &mut TableAngles,
        joints: &[f64],
        instants: usize,
        poses: &mut Poses,
    ) {
        debug_assert_eq!(joints.len(), self.joints * instants, "one value for each joint and instant");
        let of = |role: AxisRole| {
            let index = self.role(role)?;
            joints.get(index * instants..(index + 1) * instants)
        };
        poses.resize(instants);
        if instants == 0 {
            return;
        }
        for (tips, role) in poses.tips.iter_mut().zip(AxisRole::LINEAR) {
            match of(role) {
                Some(values) => tips.copy_from_slice(values),
                None => tips.fill(0.0),
            }
        }
        let tables = [of(AxisRole::A), of(AxisRole::C)];
        poses.has_constant_axis = tables.into_iter().flatten().all(are_equal);
        let middle = tables.map(|values| values.map_or(0.0, |values| values[instants / 2]));
        let center = self.tables_cached(table_angles, middle);
        if poses.has_constant_axis {
            vectorize(FixedTables { tables: center, poses });
            return;
        }
        for (((values, sin_cos), middle), angles) in
            tables.into_iter().zip(center.sin_cos()).zip(middle).zip(&mut poses.angles)
        {
            write_sines(values, middle, sin_cos, angles);
        }
        vectorize(MovingTables { center, poses });
    }
}

/// Writes sines and cosines of the angles `values`, rad; `sin_cos` are those of the angle `middle`.
fn write_sines(
    values: Option<&[f64]>,
    middle: f64,
    sin_cos: (f64, f64),
    [sines, cosines]: &mut [AlignedBuffer; 2],
) {
    let is_series = values.is_some_and(|values| {
        vectorize(SineSeries { values, middle, sin_cos, sines: &mut *sines, cosines: &mut *cosines })
    });
    if !is_series {
        for (index, (sine, cosine)) in sines.iter_mut().zip(cosines.iter_mut()).enumerate() {
            (*sine, *cosine) = values.map_or(sin_cos, |values| values[index].sin_cos());
        }
    }
}

/// Computation of sines and cosines by power series about the angle `middle`.
///
/// The first omitted terms are below 10⁻¹⁶ of the sine and 10⁻¹⁸ of the cosine of the distance from it.
struct SineSeries<'a> {
    values: &'a [f64],
    middle: f64,
    sin_cos: (f64, f64),
    sines: &'a mut [f64],
    cosines: &'a mut [f64],
}

impl SliceOperation for SineSeries<'_> {
    type Output = bool;

    /// Writes sines and cosines; returns false if an angle is too far from the middle one.
    #[inline(always)]
    fn run(self) -> bool {
        let SineSeries { values, middle, sin_cos: (sine, cosine), sines, cosines } = self;
        let count = values.len();
        let (sines, cosines) = (&mut sines[..count], &mut cosines[..count]);
        let mut is_near = true;
        for index in 0..count {
            let x = values[index] - middle;
            is_near &= x.abs() <= SERIES_LIMIT;
            let y = x * x;
            let quotient = -1.0 / 6.0 + y * (1.0 / 120.0 + y * (-1.0 / 5040.0 + y * (1.0 / 362_880.0)));
            let sine_of_x = x + x * y * quotient;
            let versine = y * (0.5 + y * (-1.0 / 24.0 + y * (1.0 / 720.0 + y * (-1.0 / 40_320.0))));
            sines[index] = sine + (cosine * sine_of_x - sine * versine);
            cosines[index] = cosine - (sine * sine_of_x + cosine * versine);
        }
        is_near
    }
}

/// Computation of poses with fixed tables.
struct FixedTables<'a> {
    tables: Tables<'a>,
    /// Poses whose tips contain X, Y and Z.
    poses: &'a mut Poses,
}

impl SliceOperation for FixedTables<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let FixedTables { tables, poses } = self;
        let axis = tables.tool_axis();
        for (values, component) in poses.axes.iter_mut().zip(&axis) {
            values.fill(*component);
        }
        let count = poses.len();
        let [xs, ys, zs] = poses.tips.each_mut().map(|values| &mut values[..count]);
        for index in 0..count {
            let tip = tables.tip(Vector3::new(xs[index], ys[index], zs[index]));
            (xs[index], ys[index], zs[index]) = (tip.x, tip.y, tip.z);
        }
    }
}

/// Computation of poses at the sines and cosines of each instant.
struct MovingTables<'a> {
    center: Tables<'a>,
    /// Poses whose tips contain X, Y and Z.
    poses: &'a mut Poses,
}

impl SliceOperation for MovingTables<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let MovingTables { center, poses } = self;
        let count = poses.len().div_ceil(LANES);
        let [xs, ys, zs] = poses.tips.each_mut().map(|values| &mut values.lanes_mut()[..count]);
        let [us, vs, ws] = poses.axes.each_mut().map(|values| &mut values.lanes_mut()[..count]);
        let [[sin_a, cos_a], [sin_c, cos_c]] =
            poses.angles.each_ref().map(|pair| pair.each_ref().map(|values| &values.lanes()[..count]));
        for part in 0..count {
            let (x, y, z) = (xs[part], ys[part], zs[part]);
            let (sin_a, cos_a, sin_c, cos_c) = (sin_a[part], cos_a[part], sin_c[part], cos_c[part]);
            let (mut tips, mut axes) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            for k in 0..LANES {
                let tables = center.with_sin_cos((sin_a[k], cos_a[k]), (sin_c[k], cos_c[k]));
                let tip = tables.tip(Vector3::new(x[k], y[k], z[k]));
                (tips[0][k], tips[1][k], tips[2][k]) = (tip.x, tip.y, tip.z);
                let axis = tables.tool_axis();
                (axes[0][k], axes[1][k], axes[2][k]) = (axis.x, axis.y, axis.z);
            }
            [xs[part], ys[part], zs[part]] = tips;
            [us[part], vs[part], ws[part]] = axes;
        }
    }
}
