//! Tests of the stress test: random trajectories, violation injection and the command line.

mod stress;
