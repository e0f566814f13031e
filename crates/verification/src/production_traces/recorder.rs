//! Trace function of a control: sampling, filter, quantization, noise, gaps and stamps.

use std::error::Error;
use std::f64::consts::{PI, SQRT_2};

use virtual_axes_core::config::Periods;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, seconds};
use virtual_axes_identify::recording::RawRecording;

use super::hidden_axis::{HiddenAxis, HiddenMachine, SimulatedAxis};
use super::program::ProductionProgram;
use crate::fixtures::recordings::NoiseGenerator;
use crate::random::{RandomSource, stream};

/// Longest gap, samples.
const MAX_GAP: usize = 15;
/// Largest number of gaps.
const MAX_GAPS: usize = 3;

/// Way in which a control samples the current.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CurrentSampling {
    /// Mean over the sampling period around each sample.
    Mean,
    /// Value at this phase of the sampling period behind each sample, 0 … 1.
    Instant(f64),
}

/// Trace function of a control; the default is that of a machining center in production.
///
/// The signals are sampled every `sampling_period`, or at each position cycle if Tsp is longer, and held in between.
/// Then one Butterworth filter filters all of them, the commanded position included, so that their relative lags
/// remain. Of the filtered signals one sample per `period` is stored; noise and quantization follow.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceRecorder {
    /// Period of sampling in the control, ns.
    pub sampling_period: Nanoseconds,
    /// True if a shorter `sampling_period` samples within the position cycle too, as the trace of a drive does.
    pub is_within_cycles: bool,
    /// Sampling of the current.
    pub current_sampling: CurrentSampling,
    /// Number of sampling periods, or of position cycles if the signals are held, by which actual position, velocity and
    /// current are logged too late.
    pub delay: usize,
    /// True if VFFWS and TFFWS are recorded.
    pub is_feedforward_recorded: bool,
    /// Half-power frequency of the filter, Hz; 0 disables it.
    pub cutoff: f64,
    /// Period of stored samples, ns, a multiple of `sampling_period`.
    pub period: Nanoseconds,
    /// Time of the program before the recording, s.
    pub start: f64,
    /// Resolution of the commanded position, m; 0 for none.
    pub psec_resolution: f64,
    /// Resolution of the actual position, m; 0 for none.
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
            is_within_cycles: false,
            current_sampling: CurrentSampling::Mean,
            delay: 0,
            is_feedforward_recorded: false,
            cutoff: 24.0,
            period: 20 * MILLISECOND_NS,
            start: 0.0,
            psec_resolution: 1e-7,
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
            psec_resolution: 0.0,
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

    /// Returns the period at which a control with these periods renews its signals, ns.
    pub fn renewal(&self, periods: &Periods) -> Nanoseconds {
        match self.is_within_cycles {
            true => self.sampling_period,
            false => self.sampling_period.max(periods.position),
        }
    }

    /// Returns the filtered values of a channel at the sampling instants, zero-order held, `delay` values late.
    fn filtered(&self, simulated: &SimulatedAxis, values: &[f64], delay: usize) -> Vec<f64> {
        let period = seconds(self.sampling_period);
        let count = (values.len() as f64 * simulated.period / period).round() as usize;
        let index = |k: usize| ((k as f64 * period + 1e-9) / simulated.period) as usize;
        let index = |k: usize| index(k).saturating_sub(delay);
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
    /// position before the delay α, VFFWS and TFFWS are those behind β and γ.
    ///
    /// Stamps and gaps depend on `recorder` and `seed` only, noise on the joint too.
    ///
    /// # Errors
    /// An error if the axis cannot be simulated.
    pub fn record(
        &self,
        program: &ProductionProgram,
        recorder: &TraceRecorder,
        seed: u64,
    ) -> Result<RawRecording, Box<dyn Error>> {
        let simulated = self.simulate(program, recorder.renewal(&self.periods))?;
        let setpoint = |of: fn(&AxisSample) -> f64| -> Vec<f64> {
            let values: Vec<f64> = simulated.samples.iter().map(of).collect();
            recorder.filtered(&simulated, &values, 0)
        };
        let measured = |values: &[f64]| recorder.filtered(&simulated, values, recorder.delay);
        let psec = setpoint(|sample| sample.psec);
        let position = measured(&self.load_position(&simulated));
        let velocity: Vec<f64> = simulated.samples.iter().map(|sample| sample.velocity).collect();
        let velocity = measured(&velocity);
        let sign = if self.is_current_inverted { -1.0 } else { 1.0 };
        let current = measured(&match recorder.current_sampling {
            CurrentSampling::Mean => simulated.mean_currents(),
            CurrentSampling::Instant(phase) => simulated.currents_at(phase),
        });
        let stored = recorder.stored_samples(psec.len(), seed);
        let at = |values: &[f64]| -> Vec<f64> {
            stored.instants.iter().filter_map(|&instant| values.get(instant).copied()).collect()
        };
        let feedforward =
            |of: fn(&AxisSample) -> f64| recorder.is_feedforward_recorded.then(|| at(&setpoint(of)));
        let (velocity_feedforward, torque_feedforward) = (
            feedforward(|sample| sample.velocity_feedforward),
            feedforward(|sample| sample.torque_feedforward),
        );
        let mut noise =
            NoiseGenerator::new(seed.wrapping_mul(1000).wrapping_add(stream::NOISE + self.joint as u64));
        let mut noisy = |values: &[f64], deviation: f64, step: f64| -> Vec<f64> {
            let value = |value: f64| quantized(value + deviation * noise.normal(), step);
            at(values).into_iter().map(value).collect()
        };
        let largest = current.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let current: Vec<f64> = current.iter().map(|value| sign * value).collect();
        Ok(RawRecording {
            name: self.config.name.clone(),
            psec: Some(
                at(&psec).into_iter().map(|value| quantized(value, recorder.psec_resolution)).collect(),
            ),
            position: Some(noisy(&position, recorder.position_noise, recorder.position_resolution)),
            velocity: Some(noisy(&velocity, recorder.velocity_noise, 0.0)),
            current: Some(noisy(&current, recorder.current_noise * largest, recorder.current_resolution)),
            torque: None,
            velocity_feedforward,
            torque_feedforward,
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

impl HiddenMachine {
    /// Records a program: one recording per axis, with equal stamps.
    ///
    /// # Errors
    /// An error if an option of the recorder is out of range or an axis cannot be simulated.
    pub fn record(
        &self,
        program: &ProductionProgram,
        recorder: &TraceRecorder,
        seed: u64,
    ) -> Result<Vec<RawRecording>, Box<dyn Error>> {
        self.axes.iter().map(|axis| axis.record(program, recorder, seed)).collect()
    }
}

/// Causal Butterworth low-pass filter of second order (bilinear transform with prewarped cutoff frequency).
///
/// The gain is 1 at rest and 1/√2 at the cutoff frequency. Well below it the filter delays every signal by
/// √2 / (2π · cutoff): 9.4 ms at 24 Hz. Signals filtered alike keep their lags relative to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ButterworthFilter {
    /// Coefficients of input values k, k − 1, k − 2.
    input: [f64; 3],
    /// Coefficients of output values k − 1, k − 2.
    output: [f64; 2],
}

impl ButterworthFilter {
    /// Creates a filter for samples every `period` s with the half-power frequency `cutoff` in Hz, below half of the
    /// sampling frequency.
    fn new(cutoff: f64, period: f64) -> Self {
        let k = (PI * cutoff * period).tan();
        let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let gain = k * k * scale;
        ButterworthFilter {
            input: [gain, 2.0 * gain, gain],
            output: [2.0 * (k * k - 1.0) * scale, (1.0 - SQRT_2 * k + k * k) * scale],
        }
    }

    /// Returns the filtered values, one per value of `values`, in their unit. Before the first value the signal has
    /// its first value.
    fn filter(&self, values: &[f64]) -> Vec<f64> {
        let first = values.first().copied().unwrap_or(0.0);
        // Values relative to the first keep the resolution of small changes.
        let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
        let step = |value: &f64| {
            let x = value - first;
            let [b0, b1, b2] = self.input;
            let [a1, a2] = self.output;
            let y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2;
            (x2, x1, y2, y1) = (x1, x, y1, y);
            first + y
        };
        values.iter().map(step).collect()
    }
}
