//! ROS messages as values, without a network.

mod own;

pub use own::{DriveStates, MotorCurrents, PACKAGE, Source, Status, TrajectoryResult};
pub use ros2_interfaces_jazzy_serde::{
    builtin_interfaces, diagnostic_msgs, rcl_interfaces, rosgraph_msgs, sensor_msgs, std_msgs, std_srvs,
    trajectory_msgs,
};
