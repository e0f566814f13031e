//! Message definitions in recordings (encoding `ros2msg` of rosbag2): the text of the message, then the text of each
//! nested message after a line of `=` and a line with its name.

/// Separator of definitions.
const RULE: &str = "================================================================================";

pub(super) const HEADER: (&str, &str) =
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
pub(super) const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
pub(super) const DURATION: (&str, &str) = ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n");

pub(super) const JOINT_STATE: &str = "\
# position, velocity and effort: m, m/s and N on linear joints; rad, rad/s and N.m on rotary ones
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
";
pub(super) const JOINT_TRAJECTORY: &str = "\
std_msgs/Header header
string[] joint_names
JointTrajectoryPoint[] points
";
pub(super) const JOINT_TRAJECTORY_POINT: (&str, &str) = (
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

pub(super) const KEY_VALUE: (&str, &str) = ("diagnostic_msgs/KeyValue", "string key\nstring value\n");
pub(super) const DIAGNOSTIC_STATUS: (&str, &str) = (
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
pub(super) const LOG: &str = "\
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
pub(super) const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
pub(super) const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n");
pub(super) const POSE: (&str, &str) = ("geometry_msgs/Pose", "Point position\nQuaternion orientation\n");
pub(super) const POSE_STAMPED: (&str, &str) =
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\nPose pose\n");
pub(super) const VECTOR: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
pub(super) const TRANSFORM: (&str, &str) =
    ("geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation\n");
pub(super) const TWIST: (&str, &str) = ("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n");
pub(super) const MULTI_DOF_POINT: (&str, &str) = (
    "trajectory_msgs/MultiDOFJointTrajectoryPoint",
    "\
geometry_msgs/Transform[] transforms
geometry_msgs/Twist[] velocities
geometry_msgs/Twist[] accelerations
builtin_interfaces/Duration time_from_start
",
);
pub(super) const CONTROLLER_STATE: &str = "\
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
    pub(super) fn new(package: &str, kind: &str, own: &str, nested: &[(&str, &str)]) -> Self {
        let mut text = own.to_owned();
        for (name, definition) in nested {
            text += &format!("\n{RULE}\nMSG: {name}\n{definition}");
        }
        Schema { name: format!("{package}/msg/{kind}"), text }
    }
}
