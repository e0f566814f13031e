//! ROS messages to typed values and back, by the conversions of [`virtual_axes_io::messages`], [`crate::ingress`] and
//! those that only the node needs.

use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;

use super::pace::Frame;
pub use crate::ingress::loads;
use virtual_axes_io::messages::{DriveStates, MotorCurrents, Sampled};
pub use virtual_axes_io::messages::{header, stamp};

/// `joint_states` of a frame.
pub fn joint_state(frame: &Frame, joints: &[String]) -> JointState {
    JointState::of(frame.time, &frame.samples, joints)
}

/// `~/motor_currents` of a frame.
pub fn motor_currents(frame: &Frame, joints: &[String]) -> MotorCurrents {
    MotorCurrents::of(frame.time, &frame.samples, joints)
}

/// `~/drive_states` of a frame.
pub fn drive_states(frame: &Frame, joints: &[String]) -> DriveStates {
    DriveStates::of(frame.time, &frame.samples, joints)
}
