//! Batch forward kinematics: tool poses at consecutive instants.

use nalgebra::Vector3;

use super::chain::{Kinematics, RotaryAngles, ToolPose};
use super::rotation::Rotation;
use crate::simd::{LANES, SliceOperation, vectorize};

/// Largest distance of an angle from the middle one, rad, up to which sines and cosines are computed by power series.
const SERIES_LIMIT: f64 = 0.0625;

/// Tool poses at consecutive instants, as structure of arrays.
#[derive(Debug, Clone, Default)]
pub struct Poses {
    count: usize,
    /// X, Y and Z of the tips, m, workpiece frame; all columns are filled up to whole vectors.
    tips: [Vec<f64>; 3],
    /// Components of the tool axes.
    axes: [Vec<f64>; 3],
    /// True if the rotary axes do not move.
    has_constant_axis: bool,
    /// Sines and cosines of the rotary axes at each instant, in the order of the chain.
    angles: [[Vec<f64>; 2]; 2],
}

/// Returns true if all values are bit-identical.
fn are_equal(values: &[f64]) -> bool {
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return true };
    // Without an early end the comparison is a series of vector instructions.
    first.to_bits() == last.to_bits()
        && values.iter().fold(0, |differences, value| differences | (value.to_bits() ^ first.to_bits())) == 0
}

impl Poses {
    /// Creates the series of one pose.
    pub fn of(pose: &ToolPose) -> Self {
        let mut poses = Poses { has_constant_axis: true, ..Poses::default() };
        poses.resize(1);
        for axis in 0..3 {
            (poses.tips[axis][0], poses.axes[axis][0]) = (pose.tip[axis], pose.axis[axis]);
        }
        poses
    }

    /// Returns the number of poses.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns true if there are no poses.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns X, Y and Z of the tips, m, workpiece frame.
    pub fn tips(&self) -> [&[f64]; 3] {
        self.tips.each_ref().map(|values| &values[..self.count])
    }

    /// Returns the components of the tool axes in the workpiece frame.
    pub fn axes(&self) -> [&[f64]; 3] {
        self.axes.each_ref().map(|values| &values[..self.count])
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

    /// Returns the common tool axis if the rotary axes do not move.
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
        self.count = instants;
        for values in self.tips.iter_mut().chain(&mut self.axes).chain(angles) {
            values.resize(instants.next_multiple_of(LANES), 0.0);
        }
    }
}

impl Kinematics {
    /// Computes the tool poses at `instants` consecutive instants. `joints` contains the values of the first joint at all
    /// instants, then those of the next joint, m or rad.
    ///
    /// Sines and cosines of the rotary axes are within 2·10⁻¹⁶ of those of [`forward_cached`](Self::forward_cached), so the
    /// tip is within 10⁻¹⁵ of it relative to the size of the machine. While an axis does not move, they are identical.
    pub fn forward_batch(
        &self,
        angles: &mut RotaryAngles,
        joints: &[f64],
        instants: usize,
        poses: &mut Poses,
    ) {
        debug_assert_eq!(joints.len(), self.joints * instants, "one value for each joint and instant");
        let of = |joint: Option<usize>| joints.get(joint? * instants..(joint? + 1) * instants);
        poses.resize(instants);
        if instants == 0 {
            return;
        }
        let rotary = self.rotations().each_ref().map(|rotation| of(rotation.joint()));
        poses.has_constant_axis = rotary.into_iter().flatten().all(are_equal);
        let middle = rotary.map(|values| values.map_or(0.0, |values| values[instants / 2]));
        let center = angles.at(middle);
        for (((values, sin_cos), middle), angles) in
            rotary.into_iter().zip(center).zip(middle).zip(&mut poses.angles)
        {
            write_sines(values, middle, sin_cos, angles.each_mut().map(|values| &mut values[..instants]));
        }
        vectorize(PoseSeries { kinematics: self, linear: self.linear.map(of), center, poses });
    }
}

/// Writes sines and cosines of the angles `values`, rad; `sin_cos` are those of the angle `middle`.
fn write_sines(values: Option<&[f64]>, middle: f64, sin_cos: (f64, f64), [sines, cosines]: [&mut [f64]; 2]) {
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

/// Computation of poses from the sines and cosines of each instant.
struct PoseSeries<'a> {
    kinematics: &'a Kinematics,
    /// Positions of X, Y and Z, m; `None` is 0.
    linear: [Option<&'a [f64]>; 3],
    /// Sines and cosines in the middle.
    center: [(f64, f64); 2],
    poses: &'a mut Poses,
}

impl SliceOperation for PoseSeries<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let PoseSeries { kinematics, linear, center, poses } = self;
        let Poses { count, tips, axes, angles, has_constant_axis } = poses;
        let mut tips = tips.each_mut().map(|values| &mut values[..*count]);
        let mut axes = axes.each_mut().map(|values| &mut values[..*count]);
        let angles = angles.each_ref().map(|pair| pair.each_ref().map(|values| &values[..*count]));
        let chain = || kinematics.rotations().iter().zip(angles).rev();
        for (values, start) in tips.iter_mut().zip(&kinematics.tool) {
            values.fill(*start);
        }
        for (rotation, angles) in chain().filter(|(rotation, _)| rotation.is_head()) {
            turn(&mut tips, rotation, rotation.pivot(), angles);
        }
        for (values, linear) in tips.iter_mut().zip(linear) {
            for (value, linear) in values.iter_mut().zip(linear.unwrap_or_default()) {
                *value += linear;
            }
        }
        for (rotation, angles) in chain().filter(|(rotation, _)| !rotation.is_head()) {
            turn(&mut tips, rotation, rotation.pivot(), angles);
        }
        for (values, origin) in tips.iter_mut().zip(&kinematics.workpiece) {
            values.iter_mut().for_each(|value| *value -= origin);
        }
        let axis = if *has_constant_axis { kinematics.tool_axis(&center) } else { Vector3::z() };
        for (values, component) in axes.iter_mut().zip(&axis) {
            values.fill(*component);
        }
        if !*has_constant_axis {
            for (rotation, angles) in chain() {
                turn(&mut axes, rotation, Vector3::zeros(), angles);
            }
        }
    }
}

/// Rotates the points with the coordinates `columns` about `pivot` by the angles with these sines and cosines.
#[inline(always)]
fn turn(
    columns: &mut [&mut [f64]; 3],
    rotation: &Rotation,
    pivot: Vector3<f64>,
    [sines, cosines]: [&[f64]; 2],
) {
    let [i, j] = rotation.plane();
    let Ok([first, second]) = columns.get_disjoint_mut([i, j]) else { return };
    let (pivot_i, pivot_j) = (pivot[i], pivot[j]);
    let count = sines.len();
    let (first, second, cosines) = (&mut first[..count], &mut second[..count], &cosines[..count]);
    for k in 0..count {
        let (u, v) = (first[k] - pivot_i, second[k] - pivot_j);
        first[k] = cosines[k] * u - sines[k] * v + pivot_i;
        second[k] = sines[k] * u + cosines[k] * v + pivot_j;
    }
}
