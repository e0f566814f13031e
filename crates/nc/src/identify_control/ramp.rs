//! Ramps from rest to a constant speed, by the moments of their acceleration over time.
//!
//! The acceleration of a trapezoidal control has the shape of a box over v/a; a moving average over T, and a jerk limit with
//! T = a/j, widen it by another box. The variance of boxes adds: 12 × variance = Σ L², and so does the fourth cumulant:
//! −120 × cumulant = Σ L⁴. A sum over sampled positions, in place of their differences, keeps the influence of rounding low.

/// SpeedRamp from rest to a constant speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpeedRamp {
    /// Speed, in units of the places per second.
    pub speed: f64,
    /// Sum of the squares of the lengths of the boxes, s².
    pub squares: f64,
    /// Sum of their fourth powers, s⁴.
    pub fourth_powers: f64,
}

/// Part of constant speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plateau {
    /// First and last sample.
    pub ends: [usize; 2],
    /// Distance per sample.
    pub step: f64,
}

/// Fewest steps of a part of constant speed.
const LEAST_STEPS: usize = 12;
/// Steps over which the largest speed is taken.
const WINDOW: usize = 8;
/// Relative deviation of steps in a part of constant speed.
const CONSTANT: f64 = 2e-4;

/// Returns the part of largest constant speed.
pub(super) fn plateau(places: &[f64], resolution: f64) -> Option<Plateau> {
    let mean = |i: usize| (places[i + WINDOW] - places[i]) / WINDOW as f64;
    let count = places.len().checked_sub(WINDOW)?;
    let fastest = (0..count).max_by(|a, b| mean(*a).total_cmp(&mean(*b)))?;
    let step = mean(fastest);
    let tolerance = CONSTANT * step + 2.5 * resolution;
    let is_constant = |i: usize| (places[i + 1] - places[i] - step).abs() <= tolerance;
    if step <= 4.0 * resolution || !is_constant(fastest + WINDOW / 2) {
        return None;
    }
    let mut ends = [fastest + WINDOW / 2; 2];
    while ends[0] > 0 && is_constant(ends[0] - 1) {
        ends[0] -= 1;
    }
    while ends[1] + 1 < places.len() && is_constant(ends[1]) {
        ends[1] += 1;
    }
    let trimmed = (ends[1] - ends[0]) / 20;
    let [from, to] = [ends[0] + trimmed, ends[1] - trimmed];
    if to - from < LEAST_STEPS {
        return None;
    }
    let slope = |from: usize, to: usize| (places[to] - places[from]) / (to - from) as f64;
    let middle = usize::midpoint(from, to);
    let change = (slope(from, middle) - slope(middle, to)).abs();
    let is_steady = change <= CONSTANT * step + 4.0 * resolution / (to - from) as f64;
    is_steady.then(|| Plateau { ends: [from, to], step: slope(from, to) })
}

/// Returns the ramp of places, which start at rest at 0, up to a part of constant speed.
pub(super) fn ramp(places: &[f64], plateau: &Plateau, period: f64) -> Option<SpeedRamp> {
    let Plateau { ends: [from, to], step } = *plateau;
    // Sample, with its fraction, at which the straight line of constant speed starts at 0.
    let middle = usize::midpoint(from, to);
    let center = middle as f64 - places[middle] / step;
    if center < 0.0 {
        return None;
    }
    let [mut second, mut fourth] = [0.0; 2];
    for (i, place) in places.iter().enumerate().take(from + (to - from) / 4) {
        let t = i as f64 - center;
        let deviation = place / step - t.max(0.0);
        second += 2.0 * deviation;
        fourth += (12.0 * t * t + 2.0) * deviation;
    }
    // The bend of the straight lines lies between two samples.
    let f = center.fract();
    second += f * (1.0 - f);
    fourth += (1.0 - f) * f.powi(4) + f * (1.0 - f).powi(4);
    // Linear interpolation between samples adds two boxes of one period.
    let squares = 12.0 * second - 2.0;
    let fourth_powers = -120.0 * (fourth - 3.0 * second * second) - 2.0;
    Some(SpeedRamp {
        speed: step / period,
        squares: squares * period.powi(2),
        fourth_powers: fourth_powers * period.powi(4),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns ∫∫ of boxes of unit area with these lengths, over time: (t)₊ⁿ⁺¹ / (n + 1)! with a difference for each box.
    fn distance(t: f64, lengths: &[f64]) -> f64 {
        let n = lengths.len();
        let factorial: f64 = (1..=n + 1).map(|k| k as f64).product();
        let mut sum = 0.0;
        for subset in 0..1_usize << n {
            let shift: f64 = (0..n).filter(|i| subset >> i & 1 == 1).map(|i| lengths[i]).sum();
            let sign = if subset.count_ones() % 2 == 0 { 1.0 } else { -1.0 };
            sum += sign * (t - shift).max(0.0).powi(n as i32 + 1);
        }
        sum / factorial / lengths.iter().product::<f64>()
    }

    #[test]
    fn moments_are_those_of_the_boxes() {
        for lengths in [vec![0.0412], vec![0.0412, 0.0333], vec![0.0187, 0.0404, 0.0121]] {
            let places: Vec<f64> =
                (0..400).map(|i| 0.1 * distance(1e-3 * f64::from(i) - 0.0204, &lengths)).collect();
            let plateau = plateau(&places, 0.0).unwrap();
            let ramp = ramp(&places, &plateau, 1e-3).unwrap();
            let sum = |power: i32| lengths.iter().map(|length| length.powi(power)).sum::<f64>();
            assert!((ramp.speed - 0.1).abs() < 1e-9);
            assert!((ramp.squares / sum(2) - 1.0).abs() < 1e-3, "{lengths:?} {ramp:?}");
            assert!((ramp.fourth_powers / sum(4) - 1.0).abs() < 5e-3, "{lengths:?} {ramp:?}");
        }
    }
}
