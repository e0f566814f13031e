//! Tests of tuning and of iterative learning.

mod learn;
mod tune;
mod tune_robustness;
