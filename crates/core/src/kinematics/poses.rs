//! Poses of the tool at many instants at once.

use nalgebra::Vector3;

use super::chain::{Kinematics, Role, ToolPose, Turned};

/// Poses of the tool at instants that follow each other, coordinate by coordinate.
#[derive(Debug, Clone, Default)]
pub struct Poses {
    /// X, Y and Z of the tips, m, workpiece frame.
    tips: [Vec<f64>; 3],
    /// Tool axes; a single one where the tables stand still.
    axes: Vec<Vector3<f64>>,
}

/// Whether all values are the same, bit for bit.
fn stand(values: &[f64]) -> bool {
    values.iter().all(|value| value.to_bits() == values[0].to_bits())
}

impl Poses {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.tips[0].len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// X, Y and Z of the tips, m, workpiece frame.
    pub fn tips(&self) -> [&[f64]; 3] {
        self.tips.each_ref().map(Vec::as_slice)
    }

    /// One of the tips, m, workpiece frame.
    ///
    /// # Panics
    /// If there is no such instant.
    #[inline]
    pub fn tip(&self, instant: usize) -> Vector3<f64> {
        Vector3::new(self.tips[0][instant], self.tips[1][instant], self.tips[2][instant])
    }

    /// One of them.
    ///
    /// # Panics
    /// If there is no such instant.
    pub fn get(&self, instant: usize) -> ToolPose {
        ToolPose { tip: self.tip(instant), axis: self.axes[instant.min(self.axes.len() - 1)] }
    }

    /// The tool axis of all of them, if the tables stand still.
    pub fn only_axis(&self) -> Option<Vector3<f64>> {
        if let [axis] = self.axes[..] { Some(axis) } else { None }
    }

    /// Whether all of them are the same, bit for bit.
    pub fn stand_still(&self) -> bool {
        self.axes.len() <= 1 && self.tips().into_iter().all(stand)
    }
}

impl Kinematics {
    /// As [`forward_from`](Self::forward_from), for `instants` that follow each other: `joints` has the values
    /// of one joint at all of them behind those of another, m or rad. The same bits.
    pub fn forward_all(&self, turned: &mut Turned, joints: &[f64], instants: usize, poses: &mut Poses) {
        debug_assert_eq!(joints.len(), self.joints * instants, "one value for each joint and instant");
        let of = |role: Role| {
            let place = self.role(role)?;
            joints.get(place * instants..(place + 1) * instants)
        };
        for (tips, role) in poses.tips.iter_mut().zip(Role::LINEAR) {
            tips.clear();
            match of(role) {
                Some(values) => tips.extend_from_slice(values),
                None => tips.resize(instants, 0.0),
            }
        }
        poses.axes.clear();
        let tables = [of(Role::A), of(Role::C)];
        let angles = |instant: usize| tables.map(|values| values.map_or(0.0, |values| values[instant]));
        let [xs, ys, zs] = &mut poses.tips;
        let linear = xs.iter_mut().zip(ys.iter_mut()).zip(zs.iter_mut());
        if instants > 0 && tables.into_iter().flatten().all(stand) {
            let tables = self.turned(turned, angles(0));
            poses.axes.push(tables.tool_axis());
            for ((x, y), z) in linear {
                [*x, *y, *z] = tables.tip(Vector3::new(*x, *y, *z)).into();
            }
        } else {
            for (instant, ((x, y), z)) in linear.enumerate() {
                let tables = self.turned(turned, angles(instant));
                poses.axes.push(tables.tool_axis());
                [*x, *y, *z] = tables.tip(Vector3::new(*x, *y, *z)).into();
            }
        }
    }
}
