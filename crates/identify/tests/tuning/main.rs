//! Tests of tuning and of iterative learning.

mod contour_gain;
mod learn;
mod tune;
mod tune_robustness;
