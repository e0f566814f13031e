//! Tests of the production traces.

mod hidden_axes;
mod identification;
mod traces;
