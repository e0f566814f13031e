//! Tests of the production traces.

mod identification;
mod rates;
mod traces;
