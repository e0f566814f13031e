//! Simulation of machine tool feed drives: from position setpoints to simulated position, velocity and motor current of
//! each axis.
//!
//! The crate contains the drive model with its cascaded controllers, controller design, five-axis kinematics, feed
//! planning, trajectories and motion assessment. It uses no network and no wall clock: equal inputs give bit-identical
//! results. The model is that of Prévost, Lavernhe, Lartigue, Dumur:
//! *Feed drive modelling for the simulation of tool path tracking in multi-axis High Speed Machining*.
//!
//! # Example
//!
//! A ramp of the X axis of the default machine at 6 m/min, one setpoint per position cycle of 6 ms:
//!
//! ```
//! use std::sync::Arc;
//!
//! use virtual_axes_core::config::Parameters;
//! use virtual_axes_core::machine::{Machine, MachineParameters};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = Parameters::embedded_default()?.machine_config()?;
//! let mut machine = Machine::new(Arc::new(MachineParameters::new(&config)?));
//!
//! let mut psec = [0.0; 5]; // setpoints of X, Y, Z in m and of A, C in rad
//! for _ in 0..200 {
//!     psec[0] += 0.1 * 0.006;
//!     machine.advance(&psec, &[]);
//! }
//! let x = machine.axis(0).sample();
//! println!("setpoint {} mm, position {} mm, current {} A", x.psec * 1e3, x.position * 1e3, x.current);
//!
//! // With velocity feedforward, the following error is that of the delay α: two position cycles at 6 m/min, 1.2 mm.
//! assert!((x.following_error() - 1.2e-3).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```
//!
//! # Modules by layer
//!
//! A module depends only on its own layer and the layers above it in this table.
//!
//! | layer | modules |
//! |---|---|
//! | basis | [`units`]: units and integer time; [`named_values!`]: enumerations with names; [`text`], [`encoding`], [`yaml`]: messages and files; [`simd`]: SIMD arithmetic over axes; [`statistics`]; [`state_codec`]: states as bytes |
//! | configuration | [`config`]: parameter schema, machine files, [`config::MachineConfig`] |
//! | models | [`kinematics`]: tool pose and joints; [`drive`]: motor, friction and gravity; [`control`]: cascade, RST and feedforward; [`design`]: predictive control (GPC), PID, pole placement, stability margins |
//! | machine | [`machine`]: all axes, advanced by position cycles |
//! | motion | [`trajectory`]: setpoints from requested points, admission and preemption; [`path`]: lines, arcs, splines and feed planning; [`scenario`]: test motions in YAML files |
//! | simulation | [`simulation`]: trajectories on a machine, as in the node; [`assess`]: following, contour and orientation errors; [`trial`]: complete offline runs |

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod assess;
pub mod config;
pub mod control;
pub mod design;
pub mod drive;
pub mod encoding;
pub mod kinematics;
pub mod machine;
mod named_values;
pub mod path;
pub mod scenario;
pub mod simd;
pub mod simulation;
pub mod state_codec;
pub mod statistics;
pub mod text;
pub mod trajectory;
pub mod trial;
pub mod units;
pub mod yaml;
