//! ROS 2 node: topics, services, actions, parameters, log and clock.
//!
//! `axes` runs the thread that owns the simulation and the clock; in real time it never waits for the network.
//! Everything else runs on tokio and exchanges data with that thread through bounded channels:
//!
//! | module | contents |
//! |---|---|
//! | `log` | log on the terminal, and records for `/rosout` |
//! | `axes` | thread of the simulation: commands, frames, reports, pacing |
//! | `topics` | topics from the table in `ros_interface`, output queues, recording |
//! | `results` | results of trajectories and events of goals |
//! | `publication` | messages of a frame, feedback, diagnostics, tool, `/rosout` |
//! | `services` | services, parameters, lifecycle |
//! | `inputs` | trajectories, streams, loads, feed override, `/clock` |
//! | `actions` | `~/follow_joint_trajectory`, `~/run_program` |
//! | `node` | start and shutdown |
//!
//! The middleware and the remedies for its defects are in `virtual_axes_dds`.

mod actions;
mod axes;
mod inputs;
pub mod log;
pub mod node;
mod publication;
mod results;
mod services;
mod topics;

pub use publication::ROSOUT_QUEUE;
