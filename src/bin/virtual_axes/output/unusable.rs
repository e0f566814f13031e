//! Output of a command whose result misses its purpose.

use std::error::Error;
use std::fmt;

/// Setpoints beyond a limit, or a tolerance that is not held.
pub const BEYOND_LIMITS: u8 = 1;
/// Result that must not be used.
pub const INVALID_RESULT: u8 = 3;

/// Output of a command that is printed although the command fails.
#[derive(Debug)]
pub struct UnusableResult {
    /// Output of the command.
    pub text: String,
    /// Reasons, one per line, for standard error.
    pub reason: String,
    /// Exit status.
    pub status: u8,
}

impl fmt::Display for UnusableResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

impl Error for UnusableResult {}
