//! Compilation of C programs against the static library, and their numbers.

mod library;

use std::path::{Path, PathBuf};
use std::process::Command;

use library::library;

pub use library::folder;

/// Compiles a C program of this crate with further options against the static library.
pub fn compile(source: &str, program: &str, options: &[&str]) -> PathBuf {
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(program);
    let mut gcc = Command::new("gcc");
    gcc.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1"]).args(options).arg("-o").arg(&program);
    gcc.arg("-I").arg(folder().join("include")).arg(folder().join(source));
    gcc.arg(library()).args(["-lpthread", "-ldl", "-lm"]);
    assert!(gcc.status().expect("gcc is installed").success());
    program
}

/// Parses a number as printed by `%a`.
pub fn hexadecimal(text: &str) -> f64 {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1.0, digits),
        None => (1.0, text),
    };
    let (mantissa, exponent) = digits.trim_start_matches("0x").split_once('p').expect("%a");
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let value = u64::from_str_radix(&format!("{whole}{fraction}"), 16).expect("hexadecimal digits");
    let exponent: i32 = exponent.parse().expect("an exponent");
    sign * value as f64 * f64::powi(2.0, exponent - 4 * fraction.len() as i32)
}
