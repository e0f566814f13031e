//! Tests of the interpreter.

mod arcs;
mod canonical;
mod common;
mod extensions;
mod memory;
mod programs;
mod properties;
mod rejections;
mod rs274;
mod tool_center_point;
