//! ROS messages as values, setpoint files, recordings, traces and URDF.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod files;
pub mod messages;
pub mod urdf;
