//! Tests of the production traces.

mod hidden_axes;
mod traces;
