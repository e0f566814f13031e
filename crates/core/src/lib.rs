//! Feed drives of machine tools: model, controllers, kinematics, trajectories, paths and simulation.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod assess;
pub mod config;
pub mod control;
pub mod design;
pub mod drive;
pub mod kinematics;
pub mod simd;
pub mod machine;
pub mod path;
pub mod scenario;
pub mod simulation;
pub mod statistics;
pub mod trajectory;
pub mod text;
pub mod trial;
pub mod units;
pub mod yaml;
