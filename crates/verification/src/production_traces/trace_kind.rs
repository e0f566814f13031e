//! Kinds of recordings that controls give, drawn at random.

use std::error::Error;

use virtual_axes_core::units::{MICROSECOND_NS, MILLISECOND_NS, Nanoseconds, seconds};

use super::hidden_axis::HiddenAxis;
use super::program::ProductionProgram;
use super::recorder::{CurrentSampling, TraceRecorder};
use crate::random::{RandomSource, stream};

/// Sampling periods of traces, ns: of a drive, of position cycles, of loggers.
pub const PERIODS: [Nanoseconds; 7] = [
    500 * MICROSECOND_NS,
    MILLISECOND_NS,
    2 * MILLISECOND_NS,
    4 * MILLISECOND_NS,
    6 * MILLISECOND_NS,
    10 * MILLISECOND_NS,
    20 * MILLISECOND_NS,
];
/// Resolutions of position encoders, m: linear scales of 1 nm to 1 µm, motor encoders of 20 bits and of 10,000 counts per
/// revolution with a screw lead of 20 mm.
const RESOLUTIONS: [f64; 5] = [1e-9, 1.9e-8, 1e-7, 1e-6, 2e-6];
/// Longest sampling period of the signals before their filter, ns.
const LONGEST_SAMPLING: Nanoseconds = 2 * MILLISECOND_NS;
/// Half-power frequency of a filter times the period of the stored samples.
const FILTER: f64 = 0.48;
/// Largest half-power frequency, Hz.
const HIGHEST_CUTOFF: f64 = 120.0;

/// Program of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TraceProgram {
    /// Few rapids, one to three.
    Rapids(usize),
    /// Part program of this duration, s.
    Part(f64),
}

/// Recording that a control gives: program, sampling, feedforward.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceKind {
    /// Program.
    pub program: TraceProgram,
    /// Trace function.
    pub recorder: TraceRecorder,
    /// TFFW relative to Jeq; 0 without torque feedforward.
    pub torque_feedforward: f64,
}

impl TraceKind {
    /// Draws a kind with samples every `period` ns.
    ///
    /// A third of the kinds are one to three rapids, the others part programs of 6 to 20 s. A third has no torque
    /// feedforward, half have recorded feedforward signals. The current is averaged, or sampled at an instant of the
    /// sampling period. Some traces are filtered, the others are not. Actual values are logged up to two renewals late.
    pub fn draw(seed: u64, period: Nanoseconds) -> Self {
        let mut random = RandomSource::new(seed, stream::TRACE_KIND);
        let program = match random.below(3) {
            0 => TraceProgram::Rapids(1 + random.below(3)),
            _ => TraceProgram::Part(random.between(6.0, 20.0)),
        };
        let torque_feedforward = [0.0, 1.0, random.between(0.07, 1.0)][random.below(3)];
        let sampling_period = period.min(LONGEST_SAMPLING);
        let is_slow = period > LONGEST_SAMPLING;
        let current_sampling = match random.below(3) {
            0 => CurrentSampling::Mean,
            1 => CurrentSampling::Instant(0.0),
            _ => CurrentSampling::Instant(random.unit()),
        };
        let is_filtered = is_slow && random.chance(0.4);
        let cutoff = if is_filtered { (FILTER / seconds(period)).min(HIGHEST_CUTOFF) } else { 0.0 };
        let recorder = TraceRecorder {
            sampling_period,
            is_within_cycles: random.chance(0.5),
            current_sampling,
            delay: random.below(3),
            is_feedforward_recorded: random.chance(0.5),
            cutoff,
            period,
            start: 0.0,
            psec_resolution: [1e-9, 1e-7, 1e-6][random.below(3)],
            position_resolution: RESOLUTIONS[random.below(RESOLUTIONS.len())],
            current_resolution: [0.001, 0.01][random.below(2)],
            position_noise: random.between(0.0, 2e-7),
            velocity_noise: 5e-5,
            current_noise: random.between(0.001, 0.01),
            gap_probability: if matches!(program, TraceProgram::Part(_)) { 0.3 } else { 0.0 },
            // A fast trace counts its samples.
            jitter: if is_slow { 2e-4 } else { 0.0 },
        };
        TraceKind { program, recorder, torque_feedforward }
    }

    /// Returns `axis` with the torque feedforward of the kind.
    pub fn applied(&self, mut axis: HiddenAxis) -> HiddenAxis {
        axis.config.feedforward.torque = self.torque_feedforward * axis.config.motor.inertia;
        axis
    }

    /// Plans program `seed` of the kind within the limits of `axis`.
    ///
    /// # Errors
    /// An error if the program cannot be planned.
    pub fn plan(&self, axis: &HiddenAxis, seed: u64) -> Result<ProductionProgram, Box<dyn Error>> {
        match self.program {
            TraceProgram::Rapids(count) => {
                ProductionProgram::draw_rapids(seed, count, &[*axis.config.limits(); 3])
            }
            TraceProgram::Part(duration) => axis.program(seed, duration),
        }
    }

    /// Returns the time by which actual values of `axis` are logged too late, s.
    pub fn logger_delay(&self, axis: &HiddenAxis) -> f64 {
        seconds(self.recorder.delay as Nanoseconds * self.recorder.renewal(&axis.periods))
    }
}
