//! Message definitions in recordings (encoding `ros2msg` of rosbag2): the text of the message, then the text of each
//! nested message after a line of `=` and a line with its name.

use super::own::PACKAGE;

/// Separator of definitions.
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

const KEY_VALUE: (&str, &str) = ("diagnostic_msgs/KeyValue", "string key\nstring value\n");
const DIAGNOSTIC_STATUS: (&str, &str) = (
    "diagnostic_msgs/DiagnosticStatus",
    "\
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
KeyValue[] values
",
);
const LOG: &str = "\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
";
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n");
const POSE: (&str, &str) = ("geometry_msgs/Pose", "Point position\nQuaternion orientation\n");
const POSE_STAMPED: (&str, &str) = ("geometry_msgs/PoseStamped", "std_msgs/Header header\nPose pose\n");
const VECTOR: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const TRANSFORM: (&str, &str) = ("geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation\n");
const TWIST: (&str, &str) = ("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n");
const MULTI_DOF_POINT: (&str, &str) = (
    "trajectory_msgs/MultiDOFJointTrajectoryPoint",
    "\
geometry_msgs/Transform[] transforms
geometry_msgs/Twist[] velocities
geometry_msgs/Twist[] accelerations
builtin_interfaces/Duration time_from_start
",
);
const CONTROLLER_STATE: &str = "\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
string[] multi_dof_joint_names
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_reference
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_feedback
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_output
float64 speed_scaling_factor
";

/// Name and definition of a message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// Name of the type, `package/msg/Type`.
    pub name: String,
    /// Definition with all nested types, encoding `ros2msg`.
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

    /// Returns the schema of `sensor_msgs/msg/JointState`.
    pub fn joint_state() -> Self {
        Self::new("sensor_msgs", "JointState", JOINT_STATE, &[HEADER, TIME])
    }

    /// Returns the schema of `trajectory_msgs/msg/JointTrajectory`.
    pub fn joint_trajectory() -> Self {
        let nested = [HEADER, TIME, JOINT_TRAJECTORY_POINT, DURATION];
        Self::new("trajectory_msgs", "JointTrajectory", JOINT_TRAJECTORY, &nested)
    }

    /// Returns the schema of `virtual_axes/msg/MotorCurrents`.
    pub fn motor_currents() -> Self {
        let own = include_str!("../../msg/MotorCurrents.msg");
        Self::new(PACKAGE, "MotorCurrents", own, &[HEADER, TIME])
    }

    /// Returns the schema of `virtual_axes/msg/DriveStates`.
    pub fn drive_states() -> Self {
        let own = include_str!("../../msg/DriveStates.msg");
        Self::new(PACKAGE, "DriveStates", own, &[HEADER, TIME])
    }

    /// Returns the schema of `virtual_axes/msg/TrajectoryResult`.
    pub fn trajectory_result() -> Self {
        let own = include_str!("../../msg/TrajectoryResult.msg");
        Self::new(PACKAGE, "TrajectoryResult", own, &[HEADER, TIME])
    }

    /// Returns the schema of `diagnostic_msgs/msg/DiagnosticArray`.
    pub fn diagnostic_array() -> Self {
        let own = "std_msgs/Header header\nDiagnosticStatus[] status\n";
        Self::new("diagnostic_msgs", "DiagnosticArray", own, &[HEADER, TIME, DIAGNOSTIC_STATUS, KEY_VALUE])
    }

    /// Returns the schema of `rosgraph_msgs/msg/Clock`.
    pub fn clock() -> Self {
        Self::new("rosgraph_msgs", "Clock", "builtin_interfaces/Time clock\n", &[TIME])
    }

    /// Returns the schema of `rcl_interfaces/msg/Log`.
    pub fn log() -> Self {
        Self::new("rcl_interfaces", "Log", LOG, &[TIME])
    }

    /// Returns the schema of `geometry_msgs/msg/PoseStamped`.
    pub fn pose_stamped() -> Self {
        let nested = [HEADER, TIME, POSE, POINT, QUATERNION];
        Self::new("geometry_msgs", "PoseStamped", POSE_STAMPED.1, &nested)
    }

    /// Returns the schema of `nav_msgs/msg/Path`.
    pub fn path() -> Self {
        let own = "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n";
        let nested = [HEADER, TIME, POSE_STAMPED, POSE, POINT, QUATERNION];
        Self::new("nav_msgs", "Path", own, &nested)
    }

    /// Returns the schema of `control_msgs/msg/SpeedScalingFactor`.
    pub fn speed_scaling_factor() -> Self {
        Self::new("control_msgs", "SpeedScalingFactor", "float64 factor\n", &[])
    }

    /// Returns the schema of `control_msgs/msg/JointTrajectoryControllerState`.
    pub fn controller_state() -> Self {
        let nested = [
            HEADER,
            TIME,
            JOINT_TRAJECTORY_POINT,
            DURATION,
            MULTI_DOF_POINT,
            TRANSFORM,
            TWIST,
            VECTOR,
            QUATERNION,
        ];
        Self::new("control_msgs", "JointTrajectoryControllerState", CONTROLLER_STATE, &nested)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_nested_type_is_defined() {
        for schema in [
            Schema::joint_state(),
            Schema::joint_trajectory(),
            Schema::motor_currents(),
            Schema::drive_states(),
            Schema::trajectory_result(),
            Schema::diagnostic_array(),
            Schema::clock(),
            Schema::log(),
            Schema::pose_stamped(),
            Schema::path(),
            Schema::controller_state(),
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
