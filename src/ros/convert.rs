//! Conversions between ROS messages and typed values: those of [`virtual_axes_io::messages`] and [`crate::ingress`],
//! and the messages of a frame.

use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;

use super::axes_interface::SampleFrame;
pub use crate::ingress::loads;
use virtual_axes_io::messages::{DriveStates, MotorCurrents, Sampled};
pub use virtual_axes_io::messages::{header, stamp};

/// Creates the message `joint_states` of a frame.
pub fn joint_state(frame: &SampleFrame, joints: &[String]) -> JointState {
    JointState::of(frame.time, &frame.samples, joints)
}

/// Creates the message `~/motor_currents` of a frame.
pub fn motor_currents(frame: &SampleFrame, joints: &[String]) -> MotorCurrents {
    MotorCurrents::of(frame.time, &frame.samples, joints)
}

/// Creates the message `~/drive_states` of a frame.
pub fn drive_states(frame: &SampleFrame, joints: &[String]) -> DriveStates {
    DriveStates::of(frame.time, &frame.samples, joints)
}
