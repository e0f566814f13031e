//! Options and outcome of a compilation.

use std::collections::BTreeMap;

use super::simulation::Runs;
use crate::offline::PartProgramOptions;

/// Aim of a compilation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CompileAim {
    /// Contour errors up to a tolerance, m, in the least time.
    Tolerance(f64),
    /// Least error with a cycle time of at most that of the program, times one plus this value, or one position cycle more
    /// than that of the program.
    Time(f64),
}

/// Options of a compilation.
#[derive(Debug, Clone, PartialEq)]
pub struct CompileOptions {
    /// Aim.
    pub aim: CompileAim,
    /// Highest feed relative to the programmed one, at least 1.
    pub feed_limit: f64,
    /// Interpretation and planning of the program.
    pub program: PartProgramOptions,
}

/// Figures of a program on all plants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompiledFigures {
    /// Cycle time, s.
    pub cycle_time: f64,
    /// Largest contour error at feed on the nominal machine, m.
    pub nominal: f64,
    /// Largest contour error at feed on any plant, m.
    pub worst: f64,
    /// Largest RMS contour error at feed on any plant, m.
    pub rms: f64,
}

/// Line of the program with its largest contour errors.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledLine {
    /// Source line, from 1.
    pub line: usize,
    /// First of its lines in the compiled program, from 1.
    pub new_line: usize,
    /// Text in the program, and in the compiled one with its extra lines.
    pub texts: [String; 2],
    /// Largest contour error on any plant before and after, m.
    pub errors: [f64; 2],
}

/// Compiled program.
#[derive(Debug, Clone, PartialEq)]
pub struct Compiled {
    /// Text of the program; that of the input if nothing is better.
    pub text: String,
    /// True if the text differs from the input.
    pub is_changed: bool,
    /// Figures of the program, and of the compiled one against the path of the program.
    pub figures: [CompiledFigures; 2],
    /// Lines with their errors, the largest before first.
    pub lines: Vec<CompiledLine>,
    /// Number of lines that can be changed.
    pub eligible: usize,
    /// Number of lines at feed that are not changed, by reason.
    pub left: BTreeMap<&'static str, usize>,
    /// Number of points that are shifted, extra points, and parts of lines with another feed.
    pub counts: [usize; 3],
    /// Largest shift of a point or radius, m.
    pub largest_shift: f64,
}

impl CompiledFigures {
    pub(super) fn of(runs: &Runs) -> Self {
        Self {
            cycle_time: runs.time,
            nominal: runs.plants.first().map_or(0.0, |run| run.cuts.max),
            worst: runs.max(),
            rms: runs.rms(),
        }
    }
}

impl Compiled {
    pub(super) fn unchanged(text: &str, before: &Runs) -> Self {
        Self {
            text: text.to_owned(),
            is_changed: false,
            figures: [CompiledFigures::of(before); 2],
            lines: Vec::new(),
            eligible: 0,
            left: BTreeMap::new(),
            counts: [0; 3],
            largest_shift: 0.0,
        }
    }
}
