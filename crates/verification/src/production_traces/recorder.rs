//! Trace function of a control: sampling, filter, quantization, noise, gaps and stamps.

use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, SECOND_NS, seconds};
use virtual_axes_identify::recording::RawRecording;

use super::butterworth::ButterworthFilter;
use super::error::TraceError;
use super::hidden_axis::{HiddenAxis, SimulatedAxis, stream};
use super::program::ProductionProgram;
use crate::fixtures::recordings::NoiseGenerator;
use crate::stress::random::RandomSource;

/// Longest gap, samples.
const MAX_GAP: usize = 15;
/// Largest number of gaps.
const MAX_GAPS: usize = 3;

/// Sampling of the current in the control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurrentSampling {
    /// Mean over one sampling period around the instant, as a drive smooths its actual current.
    Mean,
    /// Current at the instant. VFFWS and TFFWS step once per position cycle, and the current follows in a sawtooth,
    /// of which this sampling always meets the same phase: with Tsp = 6 ms the recorded current of an acceleration is
    /// 0.3 to 1.5 times its mean.
    Instant,
}

/// Trace function of a control; the default is that of a machining center in production.
///
/// The signals are sampled every `sampling_period`, or at each position cycle if Tsp is longer, and held in between;
/// the current is averaged before.
/// Then one [`ButterworthFilter`] filters all of them, the commanded position included, so that their relative lags
/// remain. Of the filtered signals one sample per `period` is stored; noise and quantization follow.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceRecorder {
    /// Period of sampling in the control, ns.
    pub sampling_period: Nanoseconds,
    /// Sampling of the current.
    pub current_sampling: CurrentSampling,
    /// Half-power frequency of the filter, Hz; 0 disables it.
    pub cutoff: f64,
    /// Period of stored samples, ns, a multiple of `sampling_period`.
    pub period: Nanoseconds,
    /// Time of the program before the recording, s.
    pub start: f64,
    /// Resolution of positions, m; 0 for none.
    pub position_resolution: f64,
    /// Resolution of the current, A; 0 for none.
    pub current_resolution: f64,
    /// Standard deviation of the actual position, m.
    pub position_noise: f64,
    /// Standard deviation of the actual velocity, m/s.
    pub velocity_noise: f64,
    /// Standard deviation of the current, relative to the largest recorded current.
    pub current_noise: f64,
    /// Probability of one to three gaps of up to 15 samples, 0 … 1.
    pub gap_probability: f64,
    /// Largest delay of a stamp, s.
    pub jitter: f64,
}

impl Default for TraceRecorder {
    /// Returns 500 Hz, mean current, 24 Hz, 20 ms, 0.1 µm, 0.01 A, 0.2 µm, 0.05 mm/s, 1 %, gaps in 3 of 10 traces, and 0.2 ms.
    fn default() -> Self {
        TraceRecorder {
            sampling_period: 2 * MILLISECOND_NS,
            current_sampling: CurrentSampling::Mean,
            cutoff: 24.0,
            period: 20 * MILLISECOND_NS,
            start: 0.0,
            position_resolution: 1e-7,
            current_resolution: 0.01,
            position_noise: 2e-7,
            velocity_noise: 5e-5,
            current_noise: 0.01,
            gap_probability: 0.3,
            jitter: 2e-4,
        }
    }
}

impl TraceRecorder {
    /// Returns the default without noise, quantization, gaps and jitter.
    pub fn ideal() -> Self {
        TraceRecorder {
            position_resolution: 0.0,
            current_resolution: 0.0,
            position_noise: 0.0,
            velocity_noise: 0.0,
            current_noise: 0.0,
            gap_probability: 0.0,
            jitter: 0.0,
            ..TraceRecorder::default()
        }
    }

    fn check(&self) -> Result<(), TraceError> {
        let sampling_ms = self.sampling_period as f64 / MILLISECOND_NS as f64;
        let nyquist = 0.5 * SECOND_NS as f64 / self.sampling_period.max(1) as f64;
        TraceError::check_range("the sampling period in ms", sampling_ms, [0.5, 20.0], "from 0.5 to 20")?;
        let rate = (self.period.max(0) / self.sampling_period) as f64;
        TraceError::check_range("the period in sampling periods", rate, [1.0, 1000.0], "from 1 to 1000")?;
        TraceError::check_range(
            "the cutoff in Hz",
            self.cutoff,
            [0.0, 0.9 * nyquist],
            "0 or below 0.45 times the sampling frequency",
        )?;
        let deviations = [
            ("start in s", self.start),
            ("the position resolution in m", self.position_resolution),
            ("the current resolution in A", self.current_resolution),
            ("the position noise in m", self.position_noise),
            ("the velocity noise in m/s", self.velocity_noise),
            ("the relative current noise", self.current_noise),
            ("the jitter in s", self.jitter),
        ];
        for (name, found) in deviations {
            TraceError::check_range(name, found, [0.0, f64::MAX], "finite and at least 0")?;
        }
        TraceError::check_range("the gap probability", self.gap_probability, [0.0, 1.0], "from 0 to 1")
    }

    /// Returns the filtered values of a channel at the sampling instants, zero-order held.
    fn filtered(&self, simulated: &SimulatedAxis, values: &[f64]) -> Vec<f64> {
        let period = seconds(self.sampling_period);
        let count = (values.len() as f64 * simulated.period / period).round() as usize;
        let index = |k: usize| ((k as f64 * period + 1e-9) / simulated.period) as usize;
        let held: Vec<f64> = (0..count).filter_map(|k| values.get(index(k)).copied()).collect();
        if self.cutoff > 0.0 { ButterworthFilter::new(self.cutoff, period).filter(&held) } else { held }
    }

    /// Returns the stored samples of a trace with `count` sampling instants.
    fn stored_samples(&self, count: usize, seed: u64) -> StoredSamples {
        let mut random = RandomSource::new(seed, stream::STAMPS);
        let every = (self.period / self.sampling_period) as usize;
        let skipped = (self.start / seconds(self.sampling_period)).round() as usize;
        // Tenths of a millisecond, off the millisecond.
        let milliseconds = random.below(((self.period / MILLISECOND_NS) as usize).max(1));
        let first = (milliseconds as f64 + (1 + random.below(9)) as f64 * 0.1) * 1e-3;
        let begin = skipped.saturating_add(random.below(every));
        let instants: Vec<usize> = (begin..count).step_by(every).collect();
        let mut is_lost = vec![false; instants.len()];
        if random.chance(self.gap_probability) {
            for _ in 0..1 + random.below(MAX_GAPS) {
                let (from, length) = (random.below(instants.len()), 2 + random.below(MAX_GAP - 1));
                is_lost.iter_mut().skip(from).take(length).for_each(|lost| *lost = true);
            }
        }
        let period = seconds(self.period);
        let stamped = instants
            .into_iter()
            .enumerate()
            .map(|(k, instant)| (instant, first + k as f64 * period + random.between(0.0, self.jitter)));
        let kept = stamped.zip(is_lost).filter(|(_, lost)| !lost).map(|(stamped, _)| stamped);
        let (instants, stamps) = kept.unzip();
        StoredSamples { instants, stamps }
    }
}

/// Stored samples of a trace.
struct StoredSamples {
    /// Indices of the sampling instants.
    instants: Vec<usize>,
    /// Stamps, s.
    stamps: Vec<f64>,
}

/// Rounds to a multiple of `step`, if it is positive.
fn quantized(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

impl HiddenAxis {
    /// Records a program in SI units, with the name of the axis as name of the recording. PSEC is the commanded
    /// position before the delay α; VFFWS and TFFWS are not recorded.
    ///
    /// Stamps and gaps depend on `recorder` and `seed` only, noise on the joint too.
    ///
    /// # Errors
    /// [`TraceError`] if an option of the recorder is out of range or the axis cannot be simulated.
    pub fn record(
        &self,
        program: &ProductionProgram,
        recorder: &TraceRecorder,
        seed: u64,
    ) -> Result<RawRecording, TraceError> {
        recorder.check()?;
        let simulated = self.simulate(program, recorder.sampling_period)?;
        let channel = |of: fn(&AxisSample) -> f64| -> Vec<f64> {
            let values: Vec<f64> = simulated.samples.iter().map(of).collect();
            recorder.filtered(&simulated, &values)
        };
        let psec = channel(|sample| sample.psec);
        let position = recorder.filtered(&simulated, &self.load_position(&simulated));
        let velocity = channel(|sample| sample.velocity);
        let sign = if self.is_current_inverted { -1.0 } else { 1.0 };
        let current = match recorder.current_sampling {
            CurrentSampling::Mean => recorder.filtered(&simulated, &simulated.mean_current),
            CurrentSampling::Instant => channel(|sample| sample.current),
        };
        let stored = recorder.stored_samples(psec.len(), seed);
        let at = |values: &[f64]| -> Vec<f64> {
            stored.instants.iter().filter_map(|&instant| values.get(instant).copied()).collect()
        };
        let mut noise =
            NoiseGenerator::new(seed.wrapping_mul(1000).wrapping_add(stream::NOISE + self.joint as u64));
        let mut noisy = |values: &[f64], deviation: f64, step: f64| -> Vec<f64> {
            let value = |value: f64| quantized(value + deviation * noise.normal(), step);
            at(values).into_iter().map(value).collect()
        };
        let largest = current.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let current: Vec<f64> = current.iter().map(|value| sign * value).collect();
        let resolution = recorder.position_resolution;
        Ok(RawRecording {
            name: self.config.name.clone(),
            psec: Some(at(&psec).into_iter().map(|value| quantized(value, resolution)).collect()),
            position: Some(noisy(&position, recorder.position_noise, resolution)),
            velocity: Some(noisy(&velocity, recorder.velocity_noise, 0.0)),
            current: Some(noisy(&current, recorder.current_noise * largest, recorder.current_resolution)),
            velocity_feedforward: None,
            torque_feedforward: None,
            motor_position: None,
            time: stored.stamps,
        })
    }

    /// Returns the position of the load behind the backlash at each sample, m.
    fn load_position(&self, simulated: &SimulatedAxis) -> Vec<f64> {
        let half = 0.5 * self.backlash.max(0.0);
        let mut load = simulated.samples.first().map_or(0.0, |sample| sample.position);
        let follow = |sample: &AxisSample| {
            load = load.clamp(sample.position - half, sample.position + half);
            load
        };
        simulated.samples.iter().map(follow).collect()
    }
}
