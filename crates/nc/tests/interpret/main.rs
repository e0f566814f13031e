//! Tests of the interpreter.

mod canonical;
mod rs274;
