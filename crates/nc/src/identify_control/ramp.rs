//! Ramps from rest to a constant speed, by the moments of their acceleration over time.
//!
//! The acceleration of a trapezoidal control has the shape of a box over v/a; a moving average over T, and a jerk limit with
//! T = a/j, widen it by another box. The variance of boxes adds: 12 × variance = Σ L². A sum over sampled positions, in place
//! of their differences, keeps the influence of rounding low. The shape of the positions tells one box from two.

use super::control_estimate::ControlEstimate;
use super::log::LogAccuracy;

/// Ramp from rest to a constant speed.
#[derive(Debug, Clone)]
pub(super) struct SpeedRamp {
    /// Speed, in units of the places per second.
    pub speed: f64,
    /// Sum of the squares of the lengths of the boxes, s².
    pub squares: f64,
    /// Influence of the deviation of estimated setpoints on this sum, s²; 0 for setpoints.
    pub deviation: f64,
    /// Samples of the ramp: time from the middle of the ramp, and distance from its start in steps of the constant speed,
    /// both in sampling periods.
    pub shape: Vec<[f64; 2]>,
}

impl SpeedRamp {
    /// Returns the share of the sum of squares that filters leave to the acceleration, with half of its deviation, which is the
    /// relative one of the acceleration. Drives can add `drive_squares`, s², to the squares of many ramps.
    pub fn square(&self, share: f64, drive_squares: f64) -> ControlEstimate {
        let half_width = 0.5 * (self.deviation + OF_SINGLE * drive_squares);
        ControlEstimate { value: share * self.squares, half_width, count: 1 }
    }

    /// Returns the acceleration with a known jerk limit, and how well the ramp shows it, 0 to 1; `None` if the ramp does not
    /// reach its acceleration.
    pub fn jerk_limited_acceleration(&self, jerk: f64) -> Option<[f64; 2]> {
        // (v/a)² + (a/j)² is smallest, 2 v/j, where the acceleration is just reached.
        let half = 0.5 * self.squares * jerk * jerk;
        let root = half * half - (self.speed * jerk).powi(2);
        let share = root / (half * half);
        (share > LEAST_ROOT).then(|| [(half - root.sqrt()).sqrt(), share])
    }
}

/// Part of constant speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plateau {
    /// First and last sample.
    pub ends: [usize; 2],
    /// Distance per sample.
    pub step: f64,
    /// Place in the middle sample.
    pub place: f64,
    /// Sample behind the ramp.
    pub settled: usize,
    /// Deviation of the places of estimated setpoints; 0 for setpoints.
    pub deviation: f64,
}

impl Plateau {
    /// Returns the part of a motion of a length in reverse, whose last sample this is.
    pub fn reversed(&self, last: usize, length: f64) -> Self {
        let Self { ends: [from, to], step, place, .. } = *self;
        // The middle sample is rounded down.
        let moved = if (from + to) % 2 == 1 { step } else { 0.0 };
        let settled = if self.settled == from { last - to } else { last - to + (to - from) / 4 };
        Self { ends: [last - to, last - from], step, place: length - place - moved, settled, ..*self }
    }
}

/// Sum of squares that drives add to a single ramp, as a multiple of that in many: friction off by 30 % and torque constants off
/// by 20 % changed 9 % of the squares of a ramp to 0.1 m/s.
const OF_SINGLE: f64 = 4.0;
/// Smallest share by which a ramp with a jerk limit shows its acceleration.
const LEAST_ROOT: f64 = 0.02;
/// Fewest steps of a part of constant speed.
const LEAST_STEPS: usize = 12;
/// Deviation of estimated setpoints as a part of their resolution.
const DEVIATION: f64 = 0.2;
/// Steps over which the largest speed is taken.
const WINDOW: usize = 8;
/// Relative deviation of steps in a part of constant speed.
const CONSTANT: f64 = 2e-4;

/// Returns the part of largest constant speed.
pub(super) fn plateau(places: &[f64], accuracy: LogAccuracy) -> Option<Plateau> {
    let LogAccuracy { resolution, window, .. } = accuracy;
    let slope = |from: usize, to: usize| (places[to] - places[from]) / (to - from) as f64;
    let longest = if accuracy.is_estimated() { 2 * window } else { WINDOW };
    let count = places.len().checked_sub(longest)?;
    let mean = |i: usize| slope(i, i + longest);
    let fastest = (0..count).max_by(|a, b| mean(*a).total_cmp(&mean(*b)))?;
    let step = mean(fastest);
    let tolerance = CONSTANT * step + 2.5 * resolution / window as f64;
    let is_constant = |i: usize| (slope(i, i + window) - step).abs() <= tolerance;
    if step * window as f64 <= 4.0 * resolution || !is_constant(fastest + longest / 2) {
        return None;
    }
    let mut ends = [fastest + longest / 2; 2];
    while ends[0] > 0 && is_constant(ends[0] - 1) {
        ends[0] -= 1;
    }
    while ends[1] + 1 < places.len() && is_constant((ends[1] + 1).saturating_sub(window)) {
        ends[1] += 1;
    }
    let trimmed = (ends[1] - ends[0]) / 20;
    let [from, to] = [ends[0] + trimmed, ends[1] - trimmed];
    if to - from < LEAST_STEPS.max(window) {
        return None;
    }
    let middle = usize::midpoint(from, to);
    let change = (slope(from, middle) - slope(middle, to)).abs();
    let is_steady = change <= CONSTANT * step + 4.0 * resolution / (to - from) as f64;
    let found = match accuracy.is_estimated() {
        false => {
            let settled = from + (to - from) / 4;
            Plateau {
                ends: [from, to],
                step: slope(from, to),
                place: places[middle],
                settled,
                deviation: 0.0,
            }
        }
        true => {
            let (step, place) = line(places, from, to);
            Plateau { ends: [from, to], step, place, settled: from, deviation: DEVIATION * resolution }
        }
    };
    is_steady.then_some(found)
}

/// Returns slope, per sample, and value in the middle sample of the straight line through samples.
fn line(places: &[f64], from: usize, to: usize) -> (f64, f64) {
    let middle = usize::midpoint(from, to) as f64;
    let center = 0.5 * (from + to) as f64;
    let count = (to + 1 - from) as f64;
    let mean = places[from..=to].iter().sum::<f64>() / count;
    let [mut product, mut square] = [0.0; 2];
    for (place, i) in places[from..=to].iter().zip(from..) {
        let t = i as f64 - center;
        product += t * (place - mean);
        square += t * t;
    }
    let slope = product / square;
    (slope, mean + slope * (middle - center))
}

/// Returns the ramp of places, which start at rest at 0, up to a part of constant speed.
pub(super) fn ramp(places: &[f64], plateau: &Plateau, period: f64) -> Option<SpeedRamp> {
    let Plateau { ends: [from, to], step, place, settled, deviation } = *plateau;
    // Sample, with its fraction, at which the straight line of constant speed starts at 0.
    let middle = usize::midpoint(from, to);
    let center = middle as f64 - place / step;
    if center < 0.0 {
        return None;
    }
    let mut second = 0.0;
    for (i, place) in places.iter().enumerate().take(settled) {
        second += 2.0 * (place / step - (i as f64 - center).max(0.0));
    }
    // The bend of the straight lines lies between two samples.
    let f = center.fract();
    second += f * (1.0 - f);
    // Linear interpolation between samples adds two boxes of one period.
    let squares = 12.0 * second - 2.0;
    // A constant deviation of the places over the ramp, which has half its samples on either side of the center.
    let reach = (settled as f64 - center).max(1.0);
    let deviation = 48.0 * reach * deviation / step;
    // The longest sum of up to three boxes with this sum of squares.
    let half = 0.5 * (3.0 * squares.max(0.0)).sqrt() + 1.0;
    let samples = (center - half).max(0.0).ceil() as usize..=((center + half) as usize).min(to);
    let shape = samples.map(|i| [i as f64 - center, places[i] / step]).collect();
    Some(SpeedRamp {
        speed: step / period,
        squares: squares * period.powi(2),
        deviation: deviation * period.powi(2),
        shape,
    })
}

/// Returns the distance from rest at a time from the middle of a ramp to speed 1 whose acceleration is boxes of these lengths,
/// one averaged by the other.
pub(super) fn distance(time: f64, lengths: &[f64]) -> f64 {
    // (t)₊ⁿ⁺¹ / (n + 1)! with a difference for each box.
    let n = lengths.len();
    let half: f64 = 0.5 * lengths.iter().sum::<f64>();
    let factorial: f64 = (1..=n + 1).map(|k| k as f64).product();
    let mut sum = 0.0;
    for subset in 0..1_usize << n {
        let shift: f64 = (0..n).filter(|i| subset >> i & 1 == 1).map(|i| lengths[i]).sum();
        let sign = if subset.count_ones() % 2 == 0 { 1.0 } else { -1.0 };
        sum += sign * (time + half - shift).max(0.0).powi(n as i32 + 1);
    }
    sum / factorial / lengths.iter().product::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_boxes() {
        for lengths in [vec![0.0412], vec![0.0412, 0.0333], vec![0.0187, 0.0404, 0.0121]] {
            let places: Vec<f64> =
                (0..400).map(|i| 0.1 * distance(1e-3 * f64::from(i) - 0.0904, &lengths)).collect();
            let plateau = plateau(
                &places,
                LogAccuracy { resolution: 0.0, window: 1, smoothing: 0.0, drive_squares: 0.0 },
            )
            .unwrap();
            let ramp = ramp(&places, &plateau, 1e-3).unwrap();
            let sum = lengths.iter().map(|length| length.powi(2)).sum::<f64>();
            assert!((ramp.speed - 0.1).abs() < 1e-9);
            assert!((ramp.squares / sum - 1.0).abs() < 1e-3, "{lengths:?} {ramp:?}");
            let model = |time: f64| 1e3 * distance(1e-3 * time, &lengths);
            assert!(
                ramp.shape.iter().all(|[time, place]| (place - model(*time)).abs() < 1e-6),
                "{lengths:?}"
            );
        }
    }
}
