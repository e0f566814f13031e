//! Part of a recording that is simulated in closed loop.

use super::feedforward_mode::FeedforwardMode;

/// Current that a control logs at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurrentLogging {
    /// Share of the ripple that the setpoints cause within a position cycle: 1 for the current of an instant, 0 for the mean
    /// over a cycle around the sample.
    pub ripple: f64,
    /// Time of that instant behind the sample, s.
    pub offset: f64,
}

impl CurrentLogging {
    /// Current of the instant of the sample.
    pub const INSTANT: Self = CurrentLogging { ripple: 1.0, offset: 0.0 };
    /// Mean over a position cycle.
    pub const MEAN: Self = CurrentLogging { ripple: 0.0, offset: 0.0 };
}

/// Section of a recording that starts at rest and can be simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Index of the recording.
    pub recording: usize,
    /// Index of the span in `Signals::spans`.
    pub span: usize,
    /// Index of the first sample of the experiment in the span.
    pub sample: usize,
    /// Active feedforward.
    pub mode: FeedforwardMode,
    /// Position cycle, s.
    pub(super) cycle: f64,
    /// PSEC from the first position cycle on, m or rad.
    pub(super) psec: Vec<f64>,
    /// Time of the first sample after the first position cycle, s.
    pub(super) first: f64,
    pub(super) period: f64,
    /// Half-power frequency, Hz, of the low-pass filter of the control.
    pub(super) trace_filter: Option<f64>,
    pub(super) logging: CurrentLogging,
    /// Time of the first sample in the recording, s.
    pub start: f64,
    /// Recorded position, m or rad.
    pub position: Vec<f64>,
    /// Recorded velocity, or the derivative of the filtered position, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// Recorded current, A.
    pub current: Option<Vec<f64>>,
}

/// Simulated signals at the samples of an experiment.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SimulatedExperiment {
    /// Simulated position, m or rad.
    pub position: Vec<f64>,
    /// Simulated velocity, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// Simulated motor current, A.
    pub current: Vec<f64>,
}

impl Experiment {
    /// Returns the sampling period, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Ends the experiment `duration` s after the start of its first motion.
    pub(super) fn shorten(&mut self, duration: f64) {
        let moving = self.psec.windows(2).position(|pair| pair[0] != pair[1]).unwrap_or_default();
        let start = (moving as f64 * self.cycle - self.first).max(0.0);
        if !duration.is_finite() {
            return;
        }
        let count = ((start + duration) / self.period) as usize;
        let cycles = ((self.first + count as f64 * self.period) / self.cycle).ceil() as usize + 1;
        self.psec.truncate(cycles);
        for channel in [&mut self.position, &mut self.velocity].into_iter().chain(&mut self.current) {
            channel.truncate(count);
        }
    }

    /// Returns true if PSEC changes.
    pub fn moves(&self) -> bool {
        self.psec.windows(2).any(|pair| pair[0] != pair[1])
    }

    /// Returns PSEC at sample `i` with zero-order hold, m or rad.
    pub fn psec_at(&self, i: usize) -> f64 {
        let instant = ((self.first + i as f64 * self.period) / self.cycle + 1e-9).floor().max(0.0) as usize;
        self.psec.get(instant.min(self.psec.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
    }
}
