//! The ROS 2 side of the node.

pub mod environment;
mod goodbye;
pub mod participant;
