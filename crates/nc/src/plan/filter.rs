//! Filters of the setpoints of a control: moving averages.

use std::collections::VecDeque;

use super::vector::{JointVector, mix};

/// Moving average over a time, of setpoints joined by straight lines.
#[derive(Debug, Clone)]
pub(super) struct MovingAverage {
    /// Length in periods.
    length: f64,
    /// Setpoints of the last periods, the latest one first.
    setpoints: VecDeque<JointVector>,
}

impl MovingAverage {
    /// Creates the average over a positive time, s.
    pub fn new(time: f64, period: f64) -> Self {
        Self { length: time / period, setpoints: VecDeque::new() }
    }

    /// Returns the average up to the next setpoint; before the first one the axes rest there.
    pub fn next(&mut self, setpoint: &JointVector) -> JointVector {
        let whole = self.length.floor();
        self.setpoints.push_front(*setpoint);
        self.setpoints.resize(whole as usize + 2, self.setpoints.back().copied().unwrap_or(*setpoint));
        let mut sum = [0.0; std::mem::size_of::<JointVector>() / std::mem::size_of::<f64>()];
        let mut add = |from: &JointVector, to: &JointVector, part: f64| {
            let end = mix(from, to, part);
            for ((sum, from), to) in sum.iter_mut().zip(from).zip(&end) {
                *sum += 0.5 * part * (from + to);
            }
        };
        for (index, pair) in self.setpoints.iter().zip(self.setpoints.iter().skip(1)).enumerate() {
            add(pair.0, pair.1, (self.length - index as f64).min(1.0));
        }
        // Exact at rest.
        let is_at_rest = self.setpoints.iter().all(|other| other == setpoint);
        if is_at_rest { *setpoint } else { sum.map(|sum| sum / self.length) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_delayed_by_half_the_time() {
        for length in [0.4, 1.0, 7.3] {
            let mut average = MovingAverage::new(length * 1e-3, 1e-3);
            let mut setpoint = [0.0; 9];
            let mut last = setpoint;
            for k in 0..20 {
                setpoint[1] = f64::from(k);
                last = average.next(&setpoint);
            }
            assert!((last[1] - (19.0 - 0.5 * length)).abs() < 1e-12, "{length}: {}", last[1]);
            for _ in 0..10 {
                last = average.next(&setpoint);
            }
            assert_eq!(last, setpoint, "exact at rest");
        }
    }
}
