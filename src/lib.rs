//! The ROS 2 node of the virtual machine-tool axes: validation of its inputs and the node itself.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod ingress;
#[cfg(feature = "ros")]
pub mod ros;
