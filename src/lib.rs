//! ROS 2 node that simulates the axes of a machine tool.
//!
//! [`validation`] converts and validates command-line arguments and incoming messages. [`ros_interface`] describes topics,
//! services and diagnostics as data. [`ros`] holds the node; `ros::node::run` runs it until a signal ends it. The simulation
//! itself is in `virtual_axes_core` and needs no ROS, the middleware in `virtual_axes_dds`.
//!
//! ```
//! use virtual_axes::validation::args::Command;
//!
//! let arguments = ["--ros-args", "-r", "__ns:=/cell", "-r", "psec:=setpoints"];
//! let Command::Run(args) = Command::parse(arguments, "virtual_axes")? else { unreachable!() };
//! assert_eq!(args.node().to_string(), "/cell/virtual_axes");
//! assert_eq!(args.resolve_topic("psec")?, "/cell/setpoints");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

#[cfg(feature = "ros")]
pub mod ros;
pub mod ros_interface;
pub mod validation;
