//! Recording of the signals of a trial in bounded memory, by min–max decimation.

use crate::assess::{AxisTrace, SignalRecording, ToolTrace};
use crate::config::MachineConfig;
use crate::machine::AxisSample;

/// Largest number of rows; beyond it, pairs of rows are merged. An even number.
const CAPACITY: usize = 1 << 15;

/// A signal whose decimation keeps its extremes.
#[derive(Debug, Clone, Default)]
struct Signal {
    values: Vec<f64>,
    /// Smallest value of the current bucket.
    low: f64,
    high: f64,
    low_first: bool,
}

impl Signal {
    /// Adds sample number `count` of a bucket of `bucket` samples. A bucket becomes two values; a bucket of
    /// one sample is that value.
    fn push(&mut self, value: f64, count: usize, bucket: usize) {
        if bucket == 1 {
            self.values.push(value);
            return;
        }
        if count == 0 {
            (self.low, self.high) = (value, value);
        }
        if value < self.low {
            (self.low, self.low_first) = (value, false);
        }
        if value > self.high {
            (self.high, self.low_first) = (value, true);
        }
        if count + 1 == bucket {
            self.close();
        }
    }

    /// Appends the two values of the current bucket.
    fn close(&mut self) {
        let (first, second) = if self.low_first { (self.low, self.high) } else { (self.high, self.low) };
        self.values.extend([first, second]);
    }

    /// Reduces each four values to two, the extremes in their order.
    fn decimate(&mut self) {
        let mut kept = Vec::with_capacity(self.values.capacity());
        for four in self.values.chunks(4) {
            let at = |order: fn(&f64, &f64) -> std::cmp::Ordering| {
                (0..four.len()).max_by(|&a, &b| order(&four[a], &four[b])).unwrap_or(0)
            };
            let (low, high) = (at(|a, b| b.total_cmp(a)), at(f64::total_cmp));
            let (first, second) = if low < high { (low, high) } else { (high, low) };
            kept.extend([four[first], four[second]]);
        }
        self.values = kept;
    }
}

/// Reference and position of the tool tip, m.
type TipPair = [[f64; 3]; 2];

/// Returns the pair whose points are farther apart, the first one if they are equal.
fn farther(one: TipPair, other: TipPair) -> TipPair {
    let apart = |[a, b]: TipPair| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    if apart(other) > apart(one) { other } else { one }
}

/// Number of signals of an axis, in the order of [`AxisTrace`].
const AXIS_SIGNALS: usize = 11;

fn axis_values(s: &AxisSample, current: f64, saturated: f64) -> [f64; AXIS_SIGNALS] {
    [
        s.psec,
        s.position,
        s.following_error(),
        s.delay_compensated_following_error(),
        s.velocity,
        current,
        s.current_setpoint,
        s.friction_current,
        s.gravity_current,
        s.load_current,
        saturated,
    ]
}

/// Tool data of a position cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct ToolSample {
    /// Nearest point of the path to the tip at the position cycle, m.
    pub reference: [f64; 3],
    /// Tip at the position cycle, m.
    pub position: [f64; 3],
    /// Largest contour error at any tick, m.
    pub contour_error: f64,
    /// Largest orientation error at any tick, rad.
    pub orientation_error: f64,
}

/// Accumulator of a [`SignalRecording`]: one row per position cycle until the capacity is reached.
#[derive(Debug, Clone)]
pub(super) struct SignalRecorder {
    time: Vec<f64>,
    axes: Vec<[Signal; AXIS_SIGNALS]>,
    contour: Signal,
    orientation: Signal,
    /// Reference and position of the tool tip, one pair per value of the signals.
    tool: Vec<TipPair>,
    /// Samples per bucket: 1, then 4, 8, …
    bucket: usize,
    /// Samples in the current bucket.
    count: usize,
    /// Time of the last sample, s.
    last: f64,
}

impl SignalRecorder {
    pub(super) fn new(axes: usize) -> Self {
        SignalRecorder {
            time: Vec::new(),
            axes: (0..axes).map(|_| Default::default()).collect(),
            contour: Signal::default(),
            orientation: Signal::default(),
            tool: Vec::new(),
            bucket: 1,
            count: 0,
            last: 0.0,
        }
    }

    /// Adds the position cycle that begins at `time`, s from the start: for each axis its sample at that
    /// instant, the largest current at any tick, A, and the share of its ticks at a limit.
    pub(super) fn push<'a>(
        &mut self,
        time: f64,
        axes: impl Iterator<Item = (&'a AxisSample, f64, f64)>,
        tool: Option<ToolSample>,
    ) {
        let (count, bucket) = (self.count, self.bucket);
        self.last = time;
        for (signals, (sample, current, saturated)) in self.axes.iter_mut().zip(axes) {
            for (signal, value) in signals.iter_mut().zip(axis_values(sample, current, saturated)) {
                signal.push(value, count, bucket);
            }
        }
        // A bucket is represented by its first instant and its middle.
        let is_stored = bucket == 1 || count == 0 || count == bucket / 2;
        if is_stored {
            self.time.push(time);
        }
        if let Some(tool) = tool {
            self.contour.push(tool.contour_error, count, bucket);
            self.orientation.push(tool.orientation_error, count, bucket);
            let pair = [tool.reference, tool.position];
            match self.tool.last_mut() {
                // Each half of a bucket keeps the pair farthest from the path.
                Some(last) if !is_stored => *last = farther(*last, pair),
                _ => self.tool.push(pair),
            }
        }
        self.count = (count + 1) % bucket;
        if self.count == 0 && self.time.len() >= CAPACITY {
            self.decimate();
        }
    }

    fn decimate(&mut self) {
        for signal in self.axes.iter_mut().flatten() {
            signal.decimate();
        }
        self.contour.decimate();
        self.orientation.decimate();
        let mut row = 0;
        let mut every_second = || {
            row += 1;
            row % 2 == 1
        };
        self.time.retain(|_| every_second());
        let halves = self.tool.chunks(2);
        self.tool = halves.filter_map(|pairs| pairs.iter().copied().reduce(farther)).collect();
        self.bucket = if self.bucket == 1 { 4 } else { 2 * self.bucket };
    }

    /// Completes the current bucket, so that all lists have the same length.
    fn close(&mut self) {
        if self.count == 0 {
            return;
        }
        let has_tool = !self.tool.is_empty();
        let of_tool = [&mut self.contour, &mut self.orientation].into_iter().filter(|_| has_tool);
        self.axes.iter_mut().flatten().chain(of_tool).for_each(Signal::close);
        if self.count <= self.bucket / 2 {
            // The middle of the bucket was not reached.
            self.time.push(self.last);
            self.tool.extend(self.tool.last().copied());
        }
        self.count = 0;
    }

    /// Returns the recording; `moves` contains true for axes that move.
    pub(super) fn finish(
        mut self,
        machine: &MachineConfig,
        moves: &[bool],
        orientation: bool,
    ) -> SignalRecording {
        self.close();
        let axes = machine.axes().iter().zip(self.axes).zip(moves).map(|((axis, signals), &moves)| {
            let [
                psec,
                position,
                following_error,
                delay_compensated_following_error,
                velocity,
                current,
                current_setpoint,
                friction_current,
                gravity_current,
                load_current,
                saturation,
            ] = signals.map(|signal| signal.values);
            AxisTrace {
                name: axis.name().to_owned(),
                kind: axis.kind(),
                moves,
                psec,
                position,
                following_error,
                delay_compensated_following_error,
                velocity,
                current,
                current_setpoint,
                friction_current,
                gravity_current,
                load_current,
                saturation,
            }
        });
        let tool = (!self.tool.is_empty()).then(|| ToolTrace {
            reference: self.tool.iter().map(|pair| pair[0]).collect(),
            position: self.tool.iter().map(|pair| pair[1]).collect(),
            contour_error: self.contour.values,
            orientation_error: if orientation { self.orientation.values } else { Vec::new() },
        });
        SignalRecording { time: self.time, axes: axes.collect(), tool, circles: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimated_signal_keeps_a_spike_of_one_sample() {
        let mut signal = Signal::default();
        let mut recorder = SignalRecorder::new(1);
        let length = 3 * CAPACITY;
        for k in 0..length {
            let position = if k == length / 2 + 1 { 1.0 } else { 0.0 };
            let sample = AxisSample { position, ..AxisSample::default() };
            recorder.push(k as f64, [(&sample, 0.0, 0.0)].into_iter(), None);
            signal.push(position, 0, 1);
        }
        let values = &recorder.axes[0][1].values;
        assert!(values.len() <= CAPACITY && values.len() >= CAPACITY / 4, "{}", values.len());
        assert_eq!(values.iter().filter(|&&v| v == 1.0).count(), 1);
        let at = values.iter().position(|&v| v == 1.0).expect("the spike is there");
        let distance = (recorder.time[at] - (length / 2 + 1) as f64).abs();
        assert!(distance <= recorder.bucket as f64, "the spike is {distance} instants off");
    }

    /// Records an hour at 6 ms; each signal has a single peak at a different time, the last at the very
    /// end.
    #[test]
    fn decimation_of_an_hour_keeps_the_peak_of_every_signal_and_of_the_path() {
        const HOUR: usize = 600_001;
        let peaks = [1, 33_000, 100_003, 300_001, 555_555, HOUR - 2, HOUR - 1];
        let mut recorder = SignalRecorder::new(1);
        for k in 0..HOUR {
            let at = |index: usize| if k == peaks[index] { 1.0 } else { 0.0 };
            let sample = AxisSample {
                psec: 5.0 + at(0),
                position: 3.0 - at(1),
                velocity: at(2),
                current_setpoint: -at(4),
                friction_current: at(5),
                gravity_current: at(6),
                ..AxisSample::default()
            };
            let tool = ToolSample {
                reference: [0.0; 3],
                position: [0.1 + at(5), 0.0, 0.0],
                contour_error: 0.1 + at(5),
                orientation_error: at(6),
            };
            recorder.push(k as f64, [(&sample, at(3), 0.0)].into_iter(), Some(tool));
        }
        let machine = crate::config::Parameters::embedded_default()
            .and_then(|p| p.machine_config())
            .expect("the embedded machine is valid");
        let within = recorder.bucket as f64;
        let recording = recorder.finish(&machine, &[true], true);
        let (x, tool) = (&recording.axes[0], recording.tool.as_ref().expect("a tool"));
        let far: Vec<f64> = tool.position.iter().map(|position| position[0]).collect();
        let found: [(&[f64], f64, usize); 9] = [
            (&x.psec, 6.0, 0),
            (&x.position, 2.0, 1),
            (&x.velocity, 1.0, 2),
            (&x.current, 1.0, 3),
            (&x.current_setpoint, -1.0, 4),
            (&x.friction_current, 1.0, 5),
            (&x.gravity_current, 1.0, 6),
            (&far, 1.1, 5),
            (&tool.orientation_error, 1.0, 6),
        ];
        assert!(recording.time.len() <= CAPACITY && recording.time.is_sorted());
        for (values, peak, index) in found {
            assert_eq!(values.len(), recording.time.len());
            let at: Vec<usize> = (0..values.len()).filter(|&i| values[i] == peak).collect();
            // A bucket of one sample contains it twice.
            assert!((1..=2).contains(&at.len()), "peak {index} is there {} times", at.len());
            let near = |&i: &usize| (recording.time[i] - peaks[index] as f64).abs() <= within;
            assert!(at.iter().all(near), "peak {index}");
        }
    }

    #[test]
    fn time_and_signals_are_of_one_length() {
        for length in [1, CAPACITY - 1, CAPACITY, CAPACITY + 3, 2 * CAPACITY + 5] {
            let mut recorder = SignalRecorder::new(1);
            for k in 0..length {
                recorder.push(k as f64, [(&AxisSample::default(), 0.0, 0.0)].into_iter(), None);
            }
            let config = crate::config::Parameters::embedded_default()
                .and_then(|p| p.machine_config())
                .expect("the embedded machine is valid");
            let recording = recorder.finish(&config, &[false], false);
            assert_eq!(recording.time.len(), recording.axes[0].position.len(), "{length} instants");
        }
    }
}
