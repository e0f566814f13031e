//! Tests of the interpreter.

mod arcs;
mod canonical;
mod common;
mod dialects;
mod extensions;
mod fanuc;
mod found;
mod hobby;
mod memory;
mod okuma;
mod programs;
mod properties;
mod rejections;
mod rs274;
mod sinumerik;
mod surface;
mod survey;
mod tool_center_point;
mod turning;
