//! Batch forward kinematics: tool poses at consecutive instants.

use nalgebra::Vector3;

use super::chain::{AxisRole, Kinematics, TableAngles, ToolPose};

/// Tool poses at consecutive instants, as structure of arrays.
#[derive(Debug, Clone, Default)]
pub struct Poses {
    /// X, Y and Z of the tips, m, workpiece frame.
    tips: [Vec<f64>; 3],
    /// Tool axes; a single one if the tables do not move.
    axes: Vec<Vector3<f64>>,
}

/// Returns true if all values are bit-identical.
fn are_equal(values: &[f64]) -> bool {
    values.iter().all(|value| value.to_bits() == values[0].to_bits())
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
        self.tips.each_ref().map(Vec::as_slice)
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
        ToolPose { tip: self.tip(instant), axis: self.axes[instant.min(self.axes.len() - 1)] }
    }

    /// Returns the common tool axis if the tables do not move.
    pub fn constant_axis(&self) -> Option<Vector3<f64>> {
        if let [axis] = self.axes[..] { Some(axis) } else { None }
    }

    /// Returns true if all poses are bit-identical.
    pub fn is_constant(&self) -> bool {
        self.axes.len() <= 1 && self.tips().into_iter().all(are_equal)
    }
}

impl Kinematics {
    /// Computes the tool poses at `instants` consecutive instants, bit-identical to
    /// [`forward_cached`](Self::forward_cached). `joints` contains the values of the first joint at all instants, then those
    /// of the next joint, m or rad.
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
        for (tips, role) in poses.tips.iter_mut().zip(AxisRole::LINEAR) {
            tips.clear();
            match of(role) {
                Some(values) => tips.extend_from_slice(values),
                None => tips.resize(instants, 0.0),
            }
        }
        poses.axes.clear();
        let tables = [of(AxisRole::A), of(AxisRole::C)];
        let angles = |instant: usize| tables.map(|values| values.map_or(0.0, |values| values[instant]));
        let [xs, ys, zs] = &mut poses.tips;
        let linear = xs.iter_mut().zip(ys.iter_mut()).zip(zs.iter_mut());
        if instants > 0 && tables.into_iter().flatten().all(are_equal) {
            let tables = self.tables_cached(table_angles, angles(0));
            poses.axes.push(tables.tool_axis());
            for ((x, y), z) in linear {
                [*x, *y, *z] = tables.tip(Vector3::new(*x, *y, *z)).into();
            }
        } else {
            for (instant, ((x, y), z)) in linear.enumerate() {
                let tables = self.tables_cached(table_angles, angles(instant));
                poses.axes.push(tables.tool_axis());
                [*x, *y, *z] = tables.tip(Vector3::new(*x, *y, *z)).into();
            }
        }
    }
}
