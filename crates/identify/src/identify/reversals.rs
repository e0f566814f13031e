//! Reversals of motion in a recording.

use crate::recording::{GaussianFilter, SignalSpan, Signals};
use virtual_axes_core::statistics::mean;

/// Smallest travel between two reversals, in standard deviations of the position noise.
const NOISE: f64 = 20.0;

/// Smallest step of a position relative to its range; smaller ones are rounding errors.
const ROUNDING: f64 = 1e-9;

/// Motion between two turning points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Leg {
    /// Index of the sample at the turning point where the leg begins.
    pub begin: usize,
    /// Index behind its last sample, the next turning point.
    pub end: usize,
    /// Direction of motion, ±1.
    pub direction: f64,
}

/// Motion of one span, cut at its turning points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ReversingMotion {
    /// Legs in order of time.
    pub legs: Vec<Leg>,
    /// Distance covered since the previous sample, m or rad, never negative.
    pub steps: Vec<f64>,
    /// Standard deviation of the recorded position about the filtered one, m or rad.
    pub noise: f64,
    /// Smallest step of the recorded position, the increment of its encoder, m or rad.
    pub increment: f64,
}

impl ReversingMotion {
    /// Finds the turning points of a span; none if it is shorter than the filter.
    pub fn new(span: &SignalSpan, signals: &Signals) -> Option<Self> {
        let filter = GaussianFilter::new(signals.cutoff, signals.period);
        if span.position.len() <= 2 * filter.radius() {
            return None;
        }
        let position = filter.apply(&span.position).value;
        let squares: Vec<f64> = span.position.iter().zip(&position).map(|(x, y)| (x - y) * (x - y)).collect();
        let noise = mean(&squares).unwrap_or(0.0).sqrt();
        let legs = find_legs(&position, NOISE * noise);
        let mut steps = vec![0.0; position.len()];
        for leg in &legs {
            let directed: Vec<f64> =
                span.position[leg.begin..leg.end].iter().map(|x| leg.direction * x).collect();
            let rising = isotonic(&directed);
            for (step, pair) in steps[leg.begin + 1..leg.end].iter_mut().zip(rising.windows(2)) {
                *step = pair[1] - pair[0];
            }
        }
        let increments = span.position.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let range =
            legs.iter().map(|leg| (position[leg.end - 1] - position[leg.begin]).abs()).fold(0.0, f64::max);
        let increment = increments.filter(|step| *step > ROUNDING * range).fold(f64::INFINITY, f64::min);
        Some(ReversingMotion { legs, steps, noise, increment })
    }

    /// Returns the distance covered by a leg, m or rad.
    pub fn travel(&self, leg: &Leg) -> f64 {
        self.steps[leg.begin..leg.end].iter().sum()
    }

    /// Returns the number of samples from the beginning of a leg until it has covered `distance`.
    pub fn samples_within(&self, leg: &Leg, distance: f64) -> usize {
        let mut covered = 0.0;
        let is_within = |step: &&f64| {
            covered += **step;
            covered <= distance
        };
        self.steps[leg.begin..leg.end].iter().take_while(is_within).count()
    }

    /// Returns the number of samples before the end of a leg in which it covers `distance`.
    pub fn samples_before_end(&self, leg: &Leg, distance: f64) -> usize {
        let mut covered = 0.0;
        let is_within = |step: &&f64| {
            covered += **step;
            covered <= distance
        };
        self.steps[leg.begin..leg.end].iter().rev().take_while(is_within).count()
    }
}

/// Cuts a position at its extremes, from which it returns by more than `hysteresis`.
fn find_legs(position: &[f64], hysteresis: f64) -> Vec<Leg> {
    let Some(&first) = position.first() else { return Vec::new() };
    let (mut begin, mut direction, mut extreme) = (0, 0.0, (0, first));
    let mut legs = Vec::new();
    for (i, &x) in position.iter().enumerate() {
        if direction == 0.0 {
            if (x - first).abs() > hysteresis {
                direction = (x - first).signum();
                extreme = (i, x);
            }
        } else if direction * (x - extreme.1) > 0.0 {
            extreme = (i, x);
        } else if direction * (extreme.1 - x) > hysteresis {
            legs.push(Leg { begin, end: extreme.0 + 1, direction });
            begin = extreme.0;
            direction = -direction;
            extreme = (i, x);
        }
    }
    if direction != 0.0 {
        legs.push(Leg { begin, end: position.len(), direction });
    }
    legs
}

/// Returns the nearest rising sequence, by least squares (pool adjacent violators).
fn isotonic(values: &[f64]) -> Vec<f64> {
    let mut blocks: Vec<(f64, usize)> = Vec::with_capacity(values.len());
    for &value in values {
        let mut block = (value, 1);
        while let Some(&(level, count)) = blocks.last().filter(|last| last.0 > block.0) {
            let total = count + block.1;
            block = ((level * count as f64 + block.0 * block.1 as f64) / total as f64, total);
            blocks.pop();
        }
        blocks.push(block);
    }
    blocks.into_iter().flat_map(|(level, count)| std::iter::repeat_n(level, count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pooled_neighbors_rise() {
        assert_eq!(isotonic(&[1.0, 3.0, 2.0, 4.0]), [1.0, 2.5, 2.5, 4.0]);
        assert_eq!(isotonic(&[3.0, 2.0, 1.0]), [2.0; 3]);
    }

    #[test]
    fn a_triangle_has_a_leg_on_each_side_and_noise_below_the_hysteresis_none() {
        let triangle: Vec<f64> = (0..=20).map(|k| 10.0 - f64::from((k - 10_i32).abs())).collect();
        let legs = find_legs(&triangle, 2.0);
        assert_eq!(legs.len(), 2);
        assert_eq!((legs[0].begin, legs[0].end, legs[0].direction), (0, 11, 1.0));
        assert_eq!((legs[1].begin, legs[1].end, legs[1].direction), (10, 21, -1.0));
        let noise: Vec<f64> = (0..40).map(|k| f64::from(k % 2)).collect();
        assert!(find_legs(&noise, 2.0).is_empty());
    }
}
