//! TODO

mod allocation;
mod goals;
mod simulation;
mod simulation_common;
mod stream;
mod trajectory_checks;
mod trajectory_common;
mod trajectory_properties;
mod trajectory_timeline;
