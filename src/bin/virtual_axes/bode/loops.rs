//! Analysis of the control loops of an axis.

use std::error::Error;

use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::design::{ControlLoop, DesignError, FrequencyResponse, LoopMargins, LoopResponse};
use virtual_axes_core::machine::{NaturalFrequencies, contour_response, loop_response, natural_frequencies};

/// Control loop on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LoopName {
    /// Current loop.
    Current,
    /// Velocity loop.
    Velocity,
    /// Position loop.
    Position,
    /// Position loop across a path, with the gain of cross-coupled control.
    Contour,
}

impl LoopName {
    /// Returns the name: current, velocity, position or contour.
    pub fn name(self) -> &'static str {
        match self {
            LoopName::Current => ControlLoop::Current.name(),
            LoopName::Velocity => ControlLoop::Velocity.name(),
            LoopName::Position => ControlLoop::Position.name(),
            LoopName::Contour => "contour",
        }
    }

    fn of(control_loop: ControlLoop) -> Self {
        match control_loop {
            ControlLoop::Current => LoopName::Current,
            ControlLoop::Velocity => LoopName::Velocity,
            ControlLoop::Position => LoopName::Position,
        }
    }
}

/// Loops of one axis.
#[derive(Debug)]
pub struct AxisLoops {
    /// Axis name.
    pub axis: String,
    /// Natural frequencies of an elastic axis.
    pub natural_frequencies: Option<NaturalFrequencies>,
    /// Loops from the innermost to the outermost.
    pub loops: Vec<AnalyzedLoop>,
}

/// One loop of an axis.
#[derive(Debug)]
pub struct AnalyzedLoop {
    /// Loop.
    pub control_loop: LoopName,
    /// Cycle, s.
    pub period: f64,
    /// Margins, or an error with the unstable pole.
    pub margins: Result<LoopMargins, DesignError>,
    /// Frequency in Hz and magnitude of the resonance peak of the closed loop.
    pub peak: Option<(f64, f64)>,
    /// Sampled response.
    pub response: FrequencyResponse,
}

/// Analyzes the selected loops of an axis; `contour_gain` is the gain of cross-coupled control, 1/s, if it acts on the axis.
pub fn analyze(
    (axis, contour_gain): (&AxisConfig, Option<f64>),
    periods: &Periods,
    selected: &[LoopName],
) -> Result<AxisLoops, Box<dyn Error>> {
    let is_selected = |name: LoopName| selected.is_empty() || selected.contains(&name);
    let mut loops = Vec::new();
    for control_loop in ControlLoop::ALL {
        let name = LoopName::of(control_loop);
        if is_selected(name) {
            loops.push(analyzed(name, &loop_response(axis, periods, control_loop)?));
        }
    }
    if let Some(gain) = contour_gain.filter(|_| is_selected(LoopName::Contour)) {
        loops.push(analyzed(LoopName::Contour, &contour_response(axis, periods, gain)?));
    }
    Ok(AxisLoops { axis: axis.name().to_owned(), natural_frequencies: natural_frequencies(axis), loops })
}

fn analyzed(control_loop: LoopName, model: &LoopResponse) -> AnalyzedLoop {
    let margins = model.margins();
    // The response of an unstable loop has no peak that could be measured.
    let peak = margins.as_ref().ok().and_then(|_| model.resonance_peak());
    AnalyzedLoop { control_loop, period: model.period(), margins, peak, response: model.sample() }
}
