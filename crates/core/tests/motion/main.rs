//! Tests of trajectory execution, streamed setpoints and the simulation.

mod allocation;
mod feed_override;
mod goals;
mod simulation;
mod simulation_common;
mod stream;
mod trajectory_common;
mod trajectory_properties;
mod trajectory_steps;
mod trajectory_timeline;
mod trajectory_validation;
