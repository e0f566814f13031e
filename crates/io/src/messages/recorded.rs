//! Messages that a recording (MCAP) of the node contains.

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::geometry_msgs::msg::PoseStamped;
use ros2_interfaces_jazzy_serde::nav_msgs::msg::Path;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;
use serde::Serialize;

use super::control::{JointTrajectoryControllerState, SpeedScalingFactor};
use super::own::{DriveStates, MotorCurrents, TrajectoryResult};
use super::schema::Schema;
use super::time::nanoseconds;
use virtual_axes_core::units::Nanoseconds;

/// Message type with the definition that a recording contains.
pub trait Recorded: Serialize {
    /// Returns the definition.
    fn schema() -> Schema;
    /// Returns the time stamp of the message, ns since the Unix epoch; 0 if it is not set.
    fn time(&self) -> Nanoseconds;
}

/// Implements [`Recorded`] for messages with a header.
macro_rules! with_header {
    ($($message:ty => $schema:ident),* $(,)?) => {$(
        impl Recorded for $message {
            fn schema() -> Schema {
                Schema::$schema()
            }

            fn time(&self) -> Nanoseconds {
                nanoseconds(&self.header.stamp)
            }
        }
    )*};
}

with_header! {
    JointState => joint_state,
    JointTrajectory => joint_trajectory,
    MotorCurrents => motor_currents,
    DriveStates => drive_states,
    TrajectoryResult => trajectory_result,
    DiagnosticArray => diagnostic_array,
    PoseStamped => pose_stamped,
    Path => path,
    JointTrajectoryControllerState => controller_state,
}

impl Recorded for SpeedScalingFactor {
    fn schema() -> Schema {
        Schema::speed_scaling_factor()
    }

    fn time(&self) -> Nanoseconds {
        0
    }
}

impl Recorded for Clock {
    fn schema() -> Schema {
        Schema::clock()
    }

    fn time(&self) -> Nanoseconds {
        nanoseconds(&self.clock)
    }
}

impl Recorded for Log {
    fn schema() -> Schema {
        Schema::log()
    }

    fn time(&self) -> Nanoseconds {
        nanoseconds(&self.stamp)
    }
}
