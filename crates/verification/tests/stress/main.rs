//! TODO

mod stress;
