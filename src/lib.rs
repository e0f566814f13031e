//! Virtual machine-tool axes.
//!
//! The library knows physics, controllers and trajectories, and no ROS; the node is a thin shell
//! around [`simulation::Simulation`] in the room `ros` (cargo feature `ros`).
//!
//! Data flows one way and the rooms stand in that order; a room imports only from rooms before it:
//! [`units`], [`config`] → [`drive`] → [`control`] → [`machine`] → [`trajectory`] → [`assess`] →
//! [`simulation`], [`files`] → `ros`.

#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod assess;
pub mod config;
pub mod control;
pub mod drive;
pub mod files;
pub mod machine;
#[cfg(feature = "ros")]
pub mod ros;
pub mod simulation;
pub mod trajectory;
pub mod units;
