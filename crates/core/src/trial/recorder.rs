//! Keeps the signals of a trial in bounded memory.

use crate::assess::{AxisTrace, Recording, ToolTrace};
use crate::config::MachineConfig;
use crate::machine::AxisSample;

/// Rows that are kept; beyond, two become one. An even number.
const CAPACITY: usize = 1 << 15;

/// A signal that keeps its extremes when it is thinned.
#[derive(Debug, Clone, Default)]
struct Signal {
    values: Vec<f64>,
    /// Lowest and highest since the last values were written, and whether the lowest came first.
    low: f64,
    high: f64,
    low_first: bool,
}

impl Signal {
    /// Adds sample number `count` of a bucket of `bucket` samples, which becomes two values; a bucket
    /// of one is that value.
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

    /// Makes two values of the bucket.
    fn close(&mut self) {
        let (first, second) = if self.low_first { (self.low, self.high) } else { (self.high, self.low) };
        self.values.extend([first, second]);
    }

    /// Makes two values of each four, the extremes in their order.
    fn thin(&mut self) {
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
type Pair = [[f64; 3]; 2];

/// The pair whose points are farther apart, the first if they are alike.
fn farther(one: Pair, other: Pair) -> Pair {
    let apart = |[a, b]: Pair| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    if apart(other) > apart(one) { other } else { one }
}

/// Signals of an axis, in the order of [`AxisTrace`].
const AXIS_SIGNALS: usize = 10;

fn axis_values(s: &AxisSample, current: f64) -> [f64; AXIS_SIGNALS] {
    [
        s.psec,
        s.position,
        s.tracking_error(),
        s.synchronized_tracking_error(),
        s.velocity,
        current,
        s.current_setpoint,
        s.friction_current,
        s.gravity_current,
        s.load_current,
    ]
}

/// The tool in a position period.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tool {
    /// Nearest point of the path to the tip at the position instant, m.
    pub reference: [f64; 3],
    /// The tip then, m.
    pub position: [f64; 3],
    /// Largest distance from the path at any tick, m.
    pub contour_error: f64,
    /// Largest angle between the tool axes at any tick, rad.
    pub orientation_error: f64,
}

/// Gathers a [`Recording`], one row per position instant as long as there is room.
#[derive(Debug, Clone)]
pub(super) struct Recorder {
    time: Vec<f64>,
    axes: Vec<[Signal; AXIS_SIGNALS]>,
    contour: Signal,
    orientation: Signal,
    /// Reference and position of the tool tip, one pair per value of the signals.
    tool: Vec<Pair>,
    /// Samples in a bucket: 1, then 4, 8, …
    bucket: usize,
    /// Samples in the bucket that was begun.
    count: usize,
    /// Time of the last sample, s.
    last: f64,
}

impl Recorder {
    pub(super) fn new(axes: usize) -> Self {
        Recorder {
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

    /// Adds the position period that begins at `time`, s from the start: of each axis the sample of that instant
    /// and the largest current of all ticks, A.
    pub(super) fn push<'a>(
        &mut self,
        time: f64,
        axes: impl Iterator<Item = (&'a AxisSample, f64)>,
        tool: Option<Tool>,
    ) {
        let (count, bucket) = (self.count, self.bucket);
        self.last = time;
        for (signals, (sample, current)) in self.axes.iter_mut().zip(axes) {
            for (signal, value) in signals.iter_mut().zip(axis_values(sample, current)) {
                signal.push(value, count, bucket);
            }
        }
        // A bucket is told by its first instant and its middle.
        let told = bucket == 1 || count == 0 || count == bucket / 2;
        if told {
            self.time.push(time);
        }
        if let Some(tool) = tool {
            self.contour.push(tool.contour_error, count, bucket);
            self.orientation.push(tool.orientation_error, count, bucket);
            let pair = [tool.reference, tool.position];
            match self.tool.last_mut() {
                // Of each half of a bucket, where the tool is farthest from the path.
                Some(last) if !told => *last = farther(*last, pair),
                _ => self.tool.push(pair),
            }
        }
        self.count = (count + 1) % bucket;
        if self.count == 0 && self.time.len() >= CAPACITY {
            self.thin();
        }
    }

    fn thin(&mut self) {
        for signal in self.axes.iter_mut().flatten() {
            signal.thin();
        }
        self.contour.thin();
        self.orientation.thin();
        let mut place = 0;
        let mut every_second = || {
            place += 1;
            place % 2 == 1
        };
        self.time.retain(|_| every_second());
        let halves = self.tool.chunks(2);
        self.tool = halves.filter_map(|pairs| pairs.iter().copied().reduce(farther)).collect();
        self.bucket = if self.bucket == 1 { 4 } else { 2 * self.bucket };
    }

    /// Ends the bucket that was begun, so that all lists are of one length.
    fn close(&mut self) {
        if self.count == 0 {
            return;
        }
        let has_tool = !self.tool.is_empty();
        let of_tool = [&mut self.contour, &mut self.orientation].into_iter().filter(|_| has_tool);
        self.axes.iter_mut().flatten().chain(of_tool).for_each(Signal::close);
        if self.count <= self.bucket / 2 {
            // Its middle was not reached.
            self.time.push(self.last);
            self.tool.extend(self.tool.last().copied());
        }
        self.count = 0;
    }

    /// The recording; `moves` tells which axes move.
    pub(super) fn finish(mut self, machine: &MachineConfig, moves: &[bool], orientation: bool) -> Recording {
        self.close();
        let axes = machine.axes().iter().zip(self.axes).zip(moves).map(|((axis, signals), &moves)| {
            let [
                psec,
                position,
                tracking_error,
                synchronized_tracking_error,
                velocity,
                current,
                current_setpoint,
                friction_current,
                gravity_current,
                load_current,
            ] = signals.map(|signal| signal.values);
            AxisTrace {
                name: axis.name().to_owned(),
                kind: axis.kind(),
                moves,
                psec,
                position,
                tracking_error,
                synchronized_tracking_error,
                velocity,
                current,
                current_setpoint,
                friction_current,
                gravity_current,
                load_current,
            }
        });
        let tool = (!self.tool.is_empty()).then(|| ToolTrace {
            reference: self.tool.iter().map(|pair| pair[0]).collect(),
            position: self.tool.iter().map(|pair| pair[1]).collect(),
            contour_error: self.contour.values,
            orientation_error: if orientation { self.orientation.values } else { Vec::new() },
        });
        Recording { time: self.time, axes: axes.collect(), tool, circles: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_signal_keeps_a_spike_of_one_sample() {
        let mut signal = Signal::default();
        let mut recorder = Recorder::new(1);
        let length = 3 * CAPACITY;
        for k in 0..length {
            let position = if k == length / 2 + 1 { 1.0 } else { 0.0 };
            let sample = AxisSample { position, ..AxisSample::default() };
            recorder.push(k as f64, [(&sample, 0.0)].into_iter(), None);
            signal.push(position, 0, 1);
        }
        let values = &recorder.axes[0][1].values;
        assert!(values.len() <= CAPACITY && values.len() >= CAPACITY / 4, "{}", values.len());
        assert_eq!(values.iter().filter(|&&v| v == 1.0).count(), 1);
        let at = values.iter().position(|&v| v == 1.0).expect("the spike is there");
        let distance = (recorder.time[at] - (length / 2 + 1) as f64).abs();
        assert!(distance <= recorder.bucket as f64, "the spike is {distance} instants off");
    }

    /// An hour at 6 ms; each signal has its one peak elsewhere, the last at the very end.
    #[test]
    fn an_hour_keeps_the_one_peak_of_every_signal_and_of_the_path() {
        const HOUR: usize = 600_001;
        let peaks = [1, 33_000, 100_003, 300_001, 555_555, HOUR - 2, HOUR - 1];
        let mut recorder = Recorder::new(1);
        for k in 0..HOUR {
            let at = |place: usize| if k == peaks[place] { 1.0 } else { 0.0 };
            let sample = AxisSample {
                psec: 5.0 + at(0),
                position: 3.0 - at(1),
                velocity: at(2),
                current_setpoint: -at(4),
                friction_current: at(5),
                gravity_current: at(6),
                ..AxisSample::default()
            };
            let tool = Tool {
                reference: [0.0; 3],
                position: [0.1 + at(5), 0.0, 0.0],
                contour_error: 0.1 + at(5),
                orientation_error: at(6),
            };
            recorder.push(k as f64, [(&sample, at(3))].into_iter(), Some(tool));
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
        for (values, peak, place) in found {
            assert_eq!(values.len(), recording.time.len());
            let at: Vec<usize> = (0..values.len()).filter(|&i| values[i] == peak).collect();
            // A bucket of one sample has it twice.
            assert!((1..=2).contains(&at.len()), "peak {place} is there {} times", at.len());
            let near = |&i: &usize| (recording.time[i] - peaks[place] as f64).abs() <= within;
            assert!(at.iter().all(near), "peak {place}");
        }
    }

    #[test]
    fn time_and_signals_are_of_one_length() {
        for length in [1, CAPACITY - 1, CAPACITY, CAPACITY + 3, 2 * CAPACITY + 5] {
            let mut recorder = Recorder::new(1);
            for k in 0..length {
                recorder.push(k as f64, [(&AxisSample::default(), 0.0)].into_iter(), None);
            }
            let config = crate::config::Parameters::embedded_default()
                .and_then(|p| p.machine_config())
                .expect("the embedded machine is valid");
            let recording = recorder.finish(&config, &[false], false);
            assert_eq!(recording.time.len(), recording.axes[0].position.len(), "{length} instants");
        }
    }
}
