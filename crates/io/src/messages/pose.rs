//! Messages of the tool: pose and path of the tool tip.

use nalgebra::{UnitQuaternion, Vector3};
use ros2_interfaces_jazzy_serde::geometry_msgs::msg::{Point, Pose, PoseStamped, Quaternion};
use ros2_interfaces_jazzy_serde::nav_msgs::msg::Path;

use super::time::header;
use virtual_axes_core::units::Nanoseconds;

/// Returns the pose of the tool frame: tip (m) and orientation in `frame`, at a time in ns since the Unix epoch.
pub fn pose_stamped(
    time: Nanoseconds,
    frame: &str,
    tip: &Vector3<f64>,
    orientation: &UnitQuaternion<f64>,
) -> PoseStamped {
    let [x, y, z, w] = orientation.coords.into();
    let pose =
        Pose { position: Point { x: tip.x, y: tip.y, z: tip.z }, orientation: Quaternion { x, y, z, w } };
    let mut header = header(time);
    header.frame_id = frame.to_owned();
    PoseStamped { header, pose }
}

/// Returns a path in `frame` with the stamp of its last pose.
pub fn path(frame: &str, poses: Vec<PoseStamped>) -> Path {
    let mut header = poses.last().map(|pose| pose.header.clone()).unwrap_or_default();
    header.frame_id = frame.to_owned();
    Path { header, poses }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scalar_of_a_quaternion_comes_last() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let pose = pose_stamped(7, "workpiece", &Vector3::new(1.0, 2.0, 3.0), &turn);
        let Quaternion { z, w, .. } = pose.pose.orientation;
        assert!((z - 1.0).abs() < 1e-15 && w.abs() < 1e-15);
        assert_eq!((pose.pose.position.z, pose.header.stamp.nanosec), (3.0, 7));
        let path = path("workpiece", vec![pose.clone()]);
        assert_eq!(path.header, pose.header);
    }
}
