//! Definitions of messages as recordings carry them (`ros2msg`, as rosbag2 writes it): a message's
//! text, then the text of each message in it behind a line of `=` and a line with its name.

use super::own::PACKAGE;

/// Between definitions.
const RULE: &str = "================================================================================";

const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const DURATION: (&str, &str) = ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n");

const JOINT_STATE: &str = "\
# position, velocity and effort: m, m/s and N on linear joints; rad, rad/s and N.m on rotary ones
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
";
const JOINT_TRAJECTORY: &str = "\
std_msgs/Header header
string[] joint_names
JointTrajectoryPoint[] points
";
const JOINT_TRAJECTORY_POINT: (&str, &str) = (
    "trajectory_msgs/JointTrajectoryPoint",
    "\
# m and seconds on linear joints, rad and seconds on rotary ones
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
",
);

/// A type of message, with its definition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// `package/msg/Type`.
    pub name: String,
    /// The `ros2msg` text.
    pub text: String,
}

impl Schema {
    fn new(package: &str, kind: &str, own: &str, nested: &[(&str, &str)]) -> Self {
        let mut text = own.to_owned();
        for (name, definition) in nested {
            text += &format!("\n{RULE}\nMSG: {name}\n{definition}");
        }
        Schema { name: format!("{package}/msg/{kind}"), text }
    }

    /// `sensor_msgs/msg/JointState`.
    pub fn joint_state() -> Self {
        Self::new("sensor_msgs", "JointState", JOINT_STATE, &[HEADER, TIME])
    }

    /// `trajectory_msgs/msg/JointTrajectory`.
    pub fn joint_trajectory() -> Self {
        let nested = [HEADER, TIME, JOINT_TRAJECTORY_POINT, DURATION];
        Self::new("trajectory_msgs", "JointTrajectory", JOINT_TRAJECTORY, &nested)
    }

    /// `virtual_axes/msg/MotorCurrents`.
    pub fn motor_currents() -> Self {
        let own = include_str!("../../msg/MotorCurrents.msg");
        Self::new(PACKAGE, "MotorCurrents", own, &[HEADER, TIME])
    }

    /// `virtual_axes/msg/DriveStates`.
    pub fn drive_states() -> Self {
        let own = include_str!("../../msg/DriveStates.msg");
        Self::new(PACKAGE, "DriveStates", own, &[HEADER, TIME])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every type that a definition names is a basic one or is defined below it.
    #[test]
    fn every_nested_type_is_defined() {
        for schema in [
            Schema::joint_state(),
            Schema::joint_trajectory(),
            Schema::motor_currents(),
            Schema::drive_states(),
        ] {
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
                let kind = kind.trim_end_matches("[]");
                let basic = ["int32", "uint32", "string", "float64", "bool"].contains(&kind);
                let nested = defined.iter().any(|name| name.rsplit('/').next() == kind.rsplit('/').next());
                assert!(basic || nested, "{}: {kind}", schema.name);
            }
            assert!(fields > 8, "{}: {fields} fields", schema.name);
        }
    }
}
