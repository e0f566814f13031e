//! Bounds on everything that a program can make large or endless.

/// Longest line, bytes.
pub(super) const MAX_LINE: usize = 4096;
/// Longest name of a parameter or subprogram, bytes.
pub(super) const MAX_NAME: usize = 100;
/// Deepest nesting of values in an expression.
pub(super) const MAX_NESTING: usize = 32;
/// Deepest nesting of subprogram calls.
pub(super) const MAX_CALLS: usize = 50;
/// Deepest nesting of loops and conditions in one subprogram.
pub(super) const MAX_BLOCKS: usize = 50;
/// Largest number of named parameters, local ones of all calls included.
pub(super) const MAX_NAMED: usize = 10_000;
/// Largest number of subprograms in a file.
pub(super) const MAX_SUBPROGRAMS: usize = 10_000;
/// Largest number of G codes, M codes and parameter settings of a line, each.
pub(super) const MAX_CODES: usize = 32;
/// Largest number of control points of a spline.
pub(super) const MAX_CONTROL_POINTS: usize = 10_000;
/// Highest order of a spline.
pub(super) const MAX_ORDER: usize = 16;
/// Largest number of turns of a helix.
pub(super) const MAX_TURNS: f64 = 10_000.0;
/// Largest number of pecks in one line of a canned cycle.
pub(super) const MAX_PECKS: f64 = 10_000.0;
/// Largest coordinate of a linear axis, m.
pub(super) const MAX_LENGTH: f64 = 1e4;
/// Largest coordinate of a rotary axis, rad.
pub(super) const MAX_ANGLE: f64 = 1e6;
/// Largest feed, spindle speed and dwell, in the units of the program.
pub(super) const MAX_RATE: f64 = 1e9;
/// Lines that jumps may repeat without a step of the program.
pub(super) const MAX_IDLE_LINES: u64 = 2_000_000;
/// Lines that jumps may repeat, unless the options have another number.
pub(super) const REPEATED_LINES: u64 = 50_000_000;
/// Largest number of starts of a program by GOTOS.
pub(super) const MAX_RESTARTS: u32 = 1000;
/// Number of work coordinate systems with codes of their own: G54 to G59.3.
pub const WORK_OFFSET_COUNT: usize = 9;
/// Number of additional work coordinate systems: G54.1 P1 and on.
pub const ADDITIONAL_OFFSET_COUNT: usize = 300;
