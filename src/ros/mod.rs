//! The ROS 2 side of the node.

pub mod args;
pub mod environment;
mod goodbye;
pub mod log;
pub mod names;
pub mod parameter_services;
pub mod participant;
