//! TODO

mod tune;
mod tune_robustness;
