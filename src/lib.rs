//! Virtual machine-tool axes.
//!
//! The library knows physics, controllers and trajectories, and no ROS; the node is a thin shell
//! around [`simulation::Simulation`] in the room `ros` (cargo feature `ros`).
//!
//! Data flows one way and the rooms stand in that order; a room imports only from rooms before it:
//! [`units`], [`lanes`], [`config`], [`kinematics`] → [`drive`] → [`control`] → [`design`] → [`machine`] →
//! [`trajectory`], [`path`] → [`assess`] → [`simulation`] → [`scenario`] → [`trial`] →
//! [`recording`] → [`identify`], [`tune`], [`stress`] → [`messages`], [`files`], [`report`], [`urdf`] → [`door`] → `ros`.

#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod assess;
pub mod config;
pub mod control;
pub mod design;
pub mod door;
pub mod drive;
pub mod files;
pub mod identify;
pub mod kinematics;
pub mod lanes;
pub mod machine;
pub mod messages;
pub mod path;
pub mod recording;
pub mod report;
#[cfg(feature = "ros")]
pub mod ros;
pub mod scenario;
pub mod simulation;
pub mod stress;
pub mod trajectory;
pub mod trial;
pub mod tune;
pub mod units;
pub mod urdf;
