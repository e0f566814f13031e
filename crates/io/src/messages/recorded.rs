//! Messages that a recording (MCAP) of the node contains.

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::geometry_msgs::msg::PoseStamped;
use ros2_interfaces_jazzy_serde::nav_msgs::msg::Path;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;
use serde::Serialize;

use super::control::{CONTROL_PACKAGE, JointTrajectoryControllerState, SpeedScalingFactor};
use super::own::{DriveStates, MotorCurrents, PACKAGE, TrajectoryResult};
use super::schema::{self, HEADER, Schema, TIME};
use super::time::nanoseconds;
use virtual_axes_core::units::Nanoseconds;

/// Message type with the definition that a recording contains.
pub trait Recorded: Serialize {
    /// Returns the definition.
    fn schema() -> Schema;
    /// Returns the time stamp of the message, ns since the Unix epoch; 0 if it is not set.
    fn time(&self) -> Nanoseconds;
}

/// Implements [`Recorded`] for messages, each with its package, its text, the definitions of nested messages, and the
/// field of its stamp.
macro_rules! recorded {
    ($($message:ident of $package:expr, $own:expr, $nested:expr, $($stamp:ident).+;)*) => {
        $(
            impl Recorded for $message {
                fn schema() -> Schema {
                    Schema::new($package, stringify!($message), $own, &$nested)
                }

                fn time(&self) -> Nanoseconds {
                    nanoseconds(&self.$($stamp).+)
                }
            }
        )*

        #[cfg(test)]
        const SCHEMAS: &[fn() -> Schema] = &[$(<$message as Recorded>::schema),*];
    };
}

recorded! {
    JointState of "sensor_msgs", schema::JOINT_STATE, [HEADER, TIME], header.stamp;
    JointTrajectory of "trajectory_msgs", schema::JOINT_TRAJECTORY,
        [HEADER, TIME, schema::JOINT_TRAJECTORY_POINT, schema::DURATION], header.stamp;
    MotorCurrents of PACKAGE, include_str!("../../msg/MotorCurrents.msg"), [HEADER, TIME], header.stamp;
    DriveStates of PACKAGE, include_str!("../../msg/DriveStates.msg"), [HEADER, TIME], header.stamp;
    TrajectoryResult of PACKAGE, include_str!("../../msg/TrajectoryResult.msg"), [HEADER, TIME], header.stamp;
    DiagnosticArray of "diagnostic_msgs", "std_msgs/Header header\nDiagnosticStatus[] status\n",
        [HEADER, TIME, schema::DIAGNOSTIC_STATUS, schema::KEY_VALUE], header.stamp;
    Clock of "rosgraph_msgs", "builtin_interfaces/Time clock\n", [TIME], clock;
    Log of "rcl_interfaces", schema::LOG, [TIME], stamp;
    PoseStamped of "geometry_msgs", schema::POSE_STAMPED.1,
        [HEADER, TIME, schema::POSE, schema::POINT, schema::QUATERNION], header.stamp;
    Path of "nav_msgs", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
        [HEADER, TIME, schema::POSE_STAMPED, schema::POSE, schema::POINT, schema::QUATERNION], header.stamp;
    JointTrajectoryControllerState of CONTROL_PACKAGE, schema::CONTROLLER_STATE,
        [
            HEADER, TIME, schema::JOINT_TRAJECTORY_POINT, schema::DURATION, schema::MULTI_DOF_POINT,
            schema::TRANSFORM, schema::TWIST, schema::VECTOR, schema::QUATERNION,
        ], header.stamp;
}

impl Recorded for SpeedScalingFactor {
    fn schema() -> Schema {
        Schema::new(CONTROL_PACKAGE, "SpeedScalingFactor", "float64 factor\n", &[])
    }

    fn time(&self) -> Nanoseconds {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_nested_type_is_defined() {
        for schema in SCHEMAS.iter().map(|schema| schema()) {
            let defined: Vec<&str> =
                schema.text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
            let mut fields = 0;
            for line in schema.text.lines() {
                let line = line.split('#').next().unwrap_or_default();
                let Some((kind, _)) = line.split_once(' ') else { continue };
                if kind == "MSG:" {
                    continue;
                }
                fields += 1;
                let kind = kind.split('[').next().unwrap_or_default();
                let basic =
                    ["byte", "uint8", "uint16", "int32", "uint32", "uint64", "string", "float64", "bool"]
                        .contains(&kind);
                let nested = defined.iter().any(|name| name.rsplit('/').next() == kind.rsplit('/').next());
                assert!(basic || nested, "{}: {kind}", schema.name);
            }
            assert!(fields > 2, "{}: {fields} fields", schema.name);
        }
    }
}
