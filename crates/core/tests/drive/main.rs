//! TODO

mod analytic;
mod drives;
mod friction;
mod lanes;
mod numbers;
mod scalar_c;
