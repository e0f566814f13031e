//! Machine files and parameters: one schema, one way in.
mod machine;
pub use machine::*;
