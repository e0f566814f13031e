//! Validation: conversion and checks of ROS messages, goals, parameters and the command line.
//!
//! The module contains no network code. The module `ros` receives messages and passes them here; the results
//! are validated values, rejections, or error texts.

mod admission_control;
pub mod args;
mod cancel_selection;
mod goal_validator;
mod loads;
pub mod names;
pub mod parameters;
mod stream;
mod trajectory_validator;

pub use admission_control::AdmissionControl;
pub use cancel_selection::{CancelCandidate, GoalId, select_goals_to_cancel};
pub use goal_validator::GoalValidator;
pub use loads::loads;
pub use stream::{ReorderFilter, StreamSetpoints};
pub use trajectory_validator::TrajectoryValidator;
