//! Samples of a signal that is stored where it changes.

/// Largest distance from a multiple of the sampling interval, as a fraction of it.
const GRID_TOLERANCE: f64 = 0.01;

/// Samples of a signal at multiples of an interval; unchanged values are left out.
#[derive(Debug)]
pub(super) struct TraceSamples {
    id: String,
    /// Sampling interval, s; 0 if unknown.
    interval: f64,
    /// Times, s, and values; NaN for a missing value.
    samples: Vec<(f64, f64)>,
}

impl TraceSamples {
    pub fn new(id: String, interval: f64) -> Self {
        TraceSamples { id, interval, samples: Vec::new() }
    }

    /// Returns the id of the signal.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Adds a sample behind all others.
    pub fn push(&mut self, time: f64, value: f64) {
        self.samples.push((time, value));
    }

    /// Returns the sampling times up to `end`: all multiples of the interval from the first sample. Without an interval
    /// these are the times of the samples.
    ///
    /// # Errors
    /// Returns the number of times if it is greater than `limit`.
    pub fn times(&self, end: f64, limit: usize) -> Result<Vec<f64>, f64> {
        let Some((first, _)) = self.samples.first() else { return Ok(Vec::new()) };
        if self.interval <= 0.0 {
            return Ok(self.samples.iter().map(|(time, _)| *time).collect());
        }
        let count = ((end - first) / self.interval + GRID_TOLERANCE).floor() + 1.0;
        // False for NaN.
        if count <= limit as f64 {
            Ok((0..count as usize).map(|k| first + k as f64 * self.interval).collect())
        } else {
            Err(count)
        }
    }

    /// Returns the values at `times`, in ascending order; NaN before the first sample and between sampling times.
    pub fn values(&self, times: &[f64]) -> Vec<f64> {
        let Some((first, _)) = self.samples.first() else { return vec![f64::NAN; times.len()] };
        let tolerance = GRID_TOLERANCE * self.interval;
        let mut next = self.samples.iter().peekable();
        let mut value = f64::NAN;
        let mut value_at = |time: f64| {
            while let Some((_, new)) = next.next_if(|(other, _)| *other <= time + tolerance) {
                value = *new;
            }
            let intervals = (time - first) / self.interval;
            let is_on_grid = self.interval <= 0.0 || (intervals - intervals.round()).abs() <= GRID_TOLERANCE;
            if is_on_grid { value } else { f64::NAN }
        };
        times.iter().map(|time| value_at(*time)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(interval: f64, values: &[(f64, f64)]) -> TraceSamples {
        let mut samples = TraceSamples::new("f1".to_owned(), interval);
        values.iter().for_each(|(time, value)| samples.push(*time, *value));
        samples
    }

    #[test]
    fn omitted_values_are_those_before() {
        let signal = samples(0.002, &[(0.0, 1.0), (0.004, 2.0), (0.008, f64::NAN)]);
        let times = signal.times(0.008, 5).expect("five");
        assert_eq!(times, [0.0, 0.002, 0.004, 0.006, 0.008]);
        let values = signal.values(&times);
        assert_eq!(values[..4], [1.0, 1.0, 2.0, 2.0]);
        assert!(values[4].is_nan());
    }

    #[test]
    fn a_slower_signal_has_values_at_its_own_times() {
        let signal = samples(0.004, &[(0.002, 1.0), (0.006, 2.0)]);
        let values = signal.values(&[0.0, 0.002, 0.004, 0.006, 0.010]);
        assert_eq!((values[1], values[3], values[4]), (1.0, 2.0, 2.0));
        assert!(values[0].is_nan() && values[2].is_nan());
        assert_eq!(samples(0.0, &[(0.5, 1.0)]).times(9.0, 9), Ok(vec![0.5]));
        assert_eq!(samples(1.0, &[]).times(9.0, 9), Ok(Vec::new()));
        assert!(samples(1.0, &[]).values(&[0.0])[0].is_nan());
        assert_eq!(samples(1.0, &[(0.0, 1.0)]).times(9.0, 9), Err(10.0));
        assert_eq!(samples(1e-300, &[(0.0, 1.0)]).times(9.0, 9), Err(9.0 / 1e-300));
    }
}
