//! Random trajectories with checks of every tick, and fixtures of tests.

#![forbid(unsafe_code)]

pub mod fixtures;
pub mod stress;
