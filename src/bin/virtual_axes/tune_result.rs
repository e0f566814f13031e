//! Result of `virtual_axes tune`.

use virtual_axes_identify::tune::{Contrast, SearchResult, TuningCandidate};

/// Controller that can be tuned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum TunableController {
    /// N1, N2, Nu and λ of the predictive controller.
    Gpc,
    /// Kp and feedforward weights of the cascade.
    Cascade,
}

/// Results of the initial and the best tuning on another path.
pub struct ComparedPath {
    /// Name of the path.
    pub name: String,
    /// Initial tuning on this path.
    pub present: TuningCandidate,
    /// Best tuning on this path.
    pub tuned: TuningCandidate,
}

/// Result of the command.
pub struct TuningResult {
    /// Best tuning, on the path that it was tuned for.
    pub best: TuningCandidate,
    /// All simulated tunings within the margin limits, sorted by increasing cost; `None` for a contrast.
    pub search: Option<SearchResult>,
    /// Tunings that are better on the first path and worse on the other path, the worst first.
    pub contrasts: Vec<Contrast>,
    /// Results on the other paths.
    pub elsewhere: Vec<ComparedPath>,
}
