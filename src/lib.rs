//! ROS 2 node that simulates the axes of a machine tool.
//!
//! [`ingress`] converts and validates command-line arguments and incoming messages. [`interface`] describes topics,
//! services and diagnostics as data. [`ros`] holds the node: its endpoints, parameters and pacing; `ros::node::run` runs it until a signal ends it. The simulation
//! itself is in `virtual_axes_core` and needs no ROS.
//!
//! ```
//! use virtual_axes::ingress::args::Command;
//!
//! let arguments = ["--ros-args", "-r", "__ns:=/cell", "-r", "psec:=setpoints"];
//! let Command::Run(args) = Command::parse(arguments, "virtual_axes")? else { unreachable!() };
//! assert_eq!(args.node().to_string(), "/cell/virtual_axes");
//! assert_eq!(args.resolve_topic("psec")?, "/cell/setpoints");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod ingress;
pub mod interface;
#[cfg(feature = "ros")]
pub mod ros;
