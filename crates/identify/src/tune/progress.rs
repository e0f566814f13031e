//! Progress reports and interrupts of a search.

use std::io;

/// Receiver of progress reports and source of interrupts, called from any thread.
pub trait Progress: Sync {
    /// Starts a part of the search with its name and the largest number of runs.
    fn begin(&self, _part: &'static str, _runs: usize) {}

    /// Counts a finished run.
    fn finish_run(&self) {}

    /// Checks for an interrupt; called in every position cycle of every run.
    ///
    /// # Errors
    /// Error that ends the search.
    fn check_interrupt(&self) -> io::Result<()> {
        Ok(())
    }
}

/// Progress receiver without output that never interrupts.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoProgress;

impl Progress for NoProgress {}
