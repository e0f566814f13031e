//! Acceleration, jerk and filters of the axes, from their ramps.

use nalgebra::{DMatrix, DVector};

use super::control_estimate::{COVERAGE, ControlEstimate};
use super::ramp::{SpeedRamp, distance};

/// Relative uncertainty of a ramp, and its part of the square of the sampling period.
const RELATIVE: f64 = 1e-3;
const OF_PERIOD: f64 = 0.1;
/// Length of filters, in sampling periods, up to which they count as interpolation of the sampled setpoints.
const INTERPOLATION: f64 = 3.0;
/// Smallest sum of squares of filters, as a multiple of that of the drives.
pub(super) const FILTER_SHARE: f64 = 2.0;
/// Ratio of residuals from which one model is better than another.
const BETTER: f64 = 0.25;
/// Relative difference of the squares of equal ramps.
const SAME_RAMP: f64 = 0.01;
/// Part of the squares of a ramp that filters leave to its acceleration.
const LEAST_SHARE: f64 = 0.1;
/// Jerk limits from which a search starts, as multiples of the acceleration over the time of a filter.
const JERK_STARTS: [f64; 6] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0];
/// Smallest ratio of the stages of a filter.
const LEAST_STAGE: f64 = 0.05;
/// Ratio of residuals up to which two stages are better than one.
const TWO_STAGES: f64 = 0.8;
/// Number of times that the range of their ratio loses a third, and step for the growth of the residual with it.
const THIRDS: usize = 25;
const RATIO_STEP: f64 = 0.05;
/// Shortest length of a box in the shape of a ramp, sampling periods.
const LEAST_BOX: f64 = 0.3;

/// Shape of the ramps.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Smoothing {
    /// Trapezoidal speed; the sampling shows no filter longer than this, s.
    None(f64),
    /// Moving averages over these times, s.
    Filters(Vec<ControlEstimate>),
    /// Jerk limit of each axis.
    Jerk(Vec<Option<ControlEstimate>>),
}

/// Law of the ramps of all axes.
#[derive(Debug, Clone)]
pub(super) struct RampLaw {
    /// Acceleration of each axis; `None` without a ramp.
    pub accelerations: Vec<Option<ControlEstimate>>,
    pub smoothing: Smoothing,
    /// True if filters and a jerk limit explain the ramps alike.
    pub is_ambiguous: bool,
}

/// Fit of a model.
struct Fit {
    /// Weighted sum of squares.
    residual: f64,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
}

fn sigma(ramp: &SpeedRamp, period: f64) -> f64 {
    RELATIVE * ramp.squares.abs() + OF_PERIOD * period * period + ramp.deviation
}

/// Solves weighted linear equations; `rows` has coefficients and right-hand sides, divided by their uncertainty.
fn least_squares(rows: &[(Vec<f64>, f64)], unknowns: usize) -> Option<Fit> {
    let matrix = DMatrix::from_fn(rows.len(), unknowns, |i, j| rows[i].0[j]);
    let right = DVector::from_fn(rows.len(), |i, _| rows[i].1);
    // Columns of very different sizes.
    let scales = DVector::from_fn(unknowns, |j, _| matrix.column(j).norm().max(f64::MIN_POSITIVE));
    let scaled = DMatrix::from_fn(rows.len(), unknowns, |i, j| matrix[(i, j)] / scales[j]);
    let inverse = (scaled.transpose() * &scaled).try_inverse()?;
    let solution = &inverse * scaled.transpose() * &right;
    let residual = (&scaled * &solution - right).norm_squared();
    let freedom = rows.len().saturating_sub(unknowns).max(1) as f64;
    let variance = (residual / freedom).max(0.01);
    let covariance =
        DMatrix::from_fn(unknowns, unknowns, |i, j| variance * inverse[(i, j)] / (scales[i] * scales[j]));
    let values = solution.component_div(&scales);
    Some(Fit { residual, values, covariance })
}

/// Returns the sum of squares of a ramp with acceleration and jerk limit.
fn jerk_squares(speed: f64, acceleration: f64, jerk: f64) -> f64 {
    let time = acceleration / jerk;
    if speed >= acceleration * time {
        (speed / acceleration).powi(2) + time * time
    } else {
        2.0 * speed / jerk
    }
}

/// Fits acceleration and jerk of one axis; the values are their logarithms.
fn fit_jerk(ramps: &[SpeedRamp], period: f64, start: [f64; 2]) -> Option<Fit> {
    let residuals = |logs: [f64; 2]| -> Vec<f64> {
        let of = |ramp: &SpeedRamp| {
            let model = jerk_squares(ramp.speed, logs[0].exp(), logs[1].exp());
            (ramp.squares - model) / sigma(ramp, period)
        };
        ramps.iter().map(of).collect()
    };
    let derivative = |logs: [f64; 2], at: &[f64], k: usize| -> Vec<f64> {
        let mut moved = logs;
        moved[k] += 1e-6;
        residuals(moved).iter().zip(at).map(|(a, b)| (a - b) / 1e-6).collect()
    };
    let square = |r: &[f64]| r.iter().map(|x| x * x).sum::<f64>();
    let mut logs = start.map(f64::ln);
    let mut damping = 1e-3;
    let mut best = residuals(logs);
    for _ in 0..200 {
        let columns = [0, 1].map(|k| derivative(logs, &best, k));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let [a, b, c] =
            [dot(&columns[0], &columns[0]), dot(&columns[0], &columns[1]), dot(&columns[1], &columns[1])];
        let right = [-dot(&columns[0], &best), -dot(&columns[1], &best)];
        let (p, q) = (a * (1.0 + damping) + 1e-12, c * (1.0 + damping) + 1e-12);
        let determinant = p * q - b * b;
        let step = [(right[0] * q - right[1] * b) / determinant, (right[1] * p - right[0] * b) / determinant];
        let tried: [f64; 2] = std::array::from_fn(|k| logs[k] + step[k].clamp(-0.5, 0.5));
        let found = residuals(tried);
        if square(&found) < square(&best) {
            (logs, best, damping) = (tried, found, 0.3 * damping);
        } else {
            damping *= 4.0;
        }
        if step.iter().all(|x| x.abs() < 1e-9) || damping > 1e12 {
            break;
        }
    }
    let columns = [0, 1].map(|k| derivative(logs, &best, k));
    let rows: Vec<_> = (0..ramps.len()).map(|i| (vec![columns[0][i], columns[1][i]], best[i])).collect();
    let covariance = match least_squares(&rows, 2) {
        Some(fit) => fit.covariance,
        None => {
            // No ramp reaches the acceleration: the jerk limit alone, and the least acceleration with which that is so.
            let fastest = ramps.iter().map(|ramp| ramp.speed).fold(0.0, f64::max);
            logs[0] = 0.5 * (fastest.ln() + logs[1]);
            let alone: Vec<_> =
                columns[1].iter().zip(&best).map(|(slope, error)| (vec![*slope], *error)).collect();
            let variance = least_squares(&alone, 1)?.covariance[(0, 0)];
            DMatrix::from_row_slice(2, 2, &[f64::INFINITY, 0.0, 0.0, variance])
        }
    };
    Some(Fit { residual: square(&best), values: DVector::from_row_slice(&logs), covariance })
}

impl RampLaw {
    /// Fits the ramps of all axes; `None` without a ramp. Drives can add `drive_squares`, s², to the squares.
    pub fn fit(ramps: &[Vec<SpeedRamp>], period: f64, drive_squares: f64) -> Option<Self> {
        let axes: Vec<usize> = (0..ramps.len()).filter(|&axis| !ramps[axis].is_empty()).collect();
        if axes.is_empty() {
            return None;
        }
        // 1/a² of each axis, and the sum of squares of the filters of all axes.
        let unknowns = axes.len() + 1;
        let mut rows = Vec::new();
        for (column, &axis) in axes.iter().enumerate() {
            for ramp in &ramps[axis] {
                let weight = 1.0 / sigma(ramp, period);
                let mut row = vec![0.0; unknowns];
                row[column] = weight * ramp.speed * ramp.speed;
                row[unknowns - 1] = weight;
                rows.push((row, weight * ramp.squares));
            }
        }
        let has_two_speeds = axes.iter().any(|&axis| {
            let speeds = ramps[axis].iter().map(|ramp| ramp.speed);
            speeds.clone().fold(0.0, f64::max) > 1.3 * speeds.fold(f64::INFINITY, f64::min)
        });
        let filtered = least_squares(&rows, unknowns).filter(|_| has_two_speeds);
        let squares = filtered.as_ref().map_or(0.0, |fit| fit.values[unknowns - 1]);
        let mut law = Self {
            accelerations: vec![None; ramps.len()],
            smoothing: Smoothing::None(squares.max(0.0).sqrt()),
            is_ambiguous: !has_two_speeds,
        };
        let Some(fit) = filtered else {
            for &axis in &axes {
                let value = |ramp: &SpeedRamp| ramp.speed / ramp.squares.max(f64::MIN_POSITIVE).sqrt();
                law.accelerations[axis] = ControlEstimate::of(ramps[axis].iter().map(value).collect(), 0.05);
            }
            return Some(law);
        };
        for (column, &axis) in axes.iter().enumerate() {
            let slope = fit.values[column];
            if slope <= 0.0 {
                continue;
            }
            let value = slope.powf(-0.5);
            let deviation = COVERAGE * fit.covariance[(column, column)].max(0.0).sqrt();
            let half_width = (0.5 * value * deviation / slope).max(1e-4 * value);
            law.accelerations[axis] = Some(ControlEstimate { value, half_width, count: ramps[axis].len() });
        }
        let shortest = (INTERPOLATION * period).powi(2).max(FILTER_SHARE * drive_squares);
        if squares < shortest {
            return Some(law);
        }
        let jerks: Option<Vec<Fit>> = axes
            .iter()
            .map(|&axis| {
                let a = law.accelerations[axis].map_or(1.0, |a| a.value);
                let starts = JERK_STARTS
                    .iter()
                    .flat_map(|factor| [1.0, 1.5].map(|part| [part * a, factor * a / squares.sqrt()]));
                let fits = starts.filter_map(|start| fit_jerk(&ramps[axis], period, start));
                fits.min_by(|a, b| a.residual.total_cmp(&b.residual))
            })
            .collect();
        if let Some(jerks) = jerks {
            let residual: f64 = jerks.iter().map(|fit| fit.residual).sum();
            law.is_ambiguous = (BETTER * fit.residual..=fit.residual / BETTER).contains(&residual);
            if residual < BETTER * fit.residual {
                let mut limits = vec![None; ramps.len()];
                for (fit, &axis) in jerks.iter().zip(&axes) {
                    let of = |k: usize| {
                        let value = fit.values[k].exp();
                        // A square of the time a/j off by that of the drives.
                        let jerk_time = (fit.values[0] - fit.values[1]).exp();
                        let of_drives = k as f64 * 0.5 * drive_squares / (jerk_time * jerk_time);
                        let deviation = COVERAGE * fit.covariance[(k, k)].max(0.0).sqrt();
                        let half_width = value * deviation.hypot(of_drives).max(1e-4);
                        Some(ControlEstimate { value, half_width, count: ramps[axis].len() })
                    };
                    law.accelerations[axis] = of(0);
                    limits[axis] = of(1);
                }
                law.smoothing = Smoothing::Jerk(limits);
                return Some(law);
            }
        }
        let deviation = COVERAGE * fit.covariance[(unknowns - 1, unknowns - 1)].max(0.0).sqrt();
        if squares - deviation < shortest {
            law.is_ambiguous = false;
            return Some(law);
        }
        let deviation = deviation.hypot(drive_squares);
        law.smoothing = Smoothing::Filters(stages(ramps, &law.accelerations, [squares, deviation], period));
        Some(law)
    }

    /// Returns the acceleration of a ramp of axes, and how well the ramp shows it, 0 to 1; `None` if filters or jerk limit
    /// hide it.
    pub fn acceleration(&self, ramp: &SpeedRamp, axes: &[usize]) -> Option<[f64; 2]> {
        match &self.smoothing {
            Smoothing::Jerk(jerks) => {
                let least = axes.iter().try_fold(f64::INFINITY, |j, &axis| Some(j.min(jerks[axis]?.value)));
                ramp.jerk_limited_acceleration(least?)
            }
            _ => {
                let square = ramp.squares - self.filter_squares();
                let share = square / ramp.squares;
                (share > LEAST_SHARE).then(|| [ramp.speed / square.sqrt(), share])
            }
        }
    }

    /// Returns true if a ramp is that of the limits of an axis.
    pub fn is_limit(&self, ramp: &SpeedRamp, axis: usize) -> bool {
        let (Some(a), Smoothing::Jerk(jerks)) = (self.accelerations[axis], &self.smoothing) else {
            return false;
        };
        jerks[axis].is_some_and(|j| {
            (ramp.squares / jerk_squares(ramp.speed, a.value, j.value) - 1.0).abs() < SAME_RAMP
        })
    }

    /// Returns the duration of a ramp of an axis before the filters, s.
    pub fn ramp_time(&self, axis: usize, speed: f64) -> Option<f64> {
        let a = self.accelerations[axis]?.value;
        Some(match &self.smoothing {
            Smoothing::Jerk(jerks) => {
                let jerk_time = (a / jerks[axis]?.value).min((speed / jerks[axis]?.value).sqrt());
                jerk_time + (speed / a).max(jerk_time)
            }
            _ => speed / a,
        })
    }

    /// Returns the sum of squares of the filters, s².
    fn filter_squares(&self) -> f64 {
        match &self.smoothing {
            Smoothing::None(time) => time * time,
            Smoothing::Filters(stages) => stages.iter().map(|stage| stage.value.powi(2)).sum(),
            Smoothing::Jerk(_) => 0.0,
        }
    }

    /// Returns the times of the filters, s.
    pub fn filters(&self) -> Vec<f64> {
        match &self.smoothing {
            Smoothing::Filters(stages) => stages.iter().map(|stage| stage.value).collect(),
            _ => Vec::new(),
        }
    }
}

/// Returns the times of one or two moving averages with a sum of squares.
fn stages(
    ramps: &[Vec<SpeedRamp>],
    accelerations: &[Option<ControlEstimate>],
    [squares, deviation]: [f64; 2],
    period: f64,
) -> Vec<ControlEstimate> {
    // Ramps that are shorter than the filters.
    let shown: Vec<(&SpeedRamp, f64)> = ramps
        .iter()
        .zip(accelerations)
        .filter_map(|(ramps, a)| Some(ramps.iter().zip(std::iter::repeat((*a)?.value))))
        .flatten()
        .map(|(ramp, a)| (ramp, ramp.speed / a))
        .filter(|(_, length)| length * length < squares)
        .collect();
    let split = |ratio: f64| {
        let first = (squares / (1.0 + ratio * ratio)).sqrt();
        [first, ratio * first]
    };
    let residual = |ratio: f64| -> f64 {
        let boxes = split(ratio);
        shown.iter().map(|(ramp, length)| shape_residual(ramp, [boxes[0], boxes[1], *length], period)).sum()
    };
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..THIRDS {
        let third = (high - low) / 3.0;
        if residual(low + third) < residual(high - third) { high -= third } else { low += third }
    }
    let ratio = f64::midpoint(low, high);
    let [first, second] = split(ratio);
    let count = ramps.iter().map(Vec::len).sum();
    let of = |value: f64, width: f64| ControlEstimate { value, half_width: width.max(0.05 * period), count };
    let of_sum = |value: f64| 0.5 * deviation * value / squares;
    let least = residual(ratio);
    if shown.is_empty() || ratio < LEAST_STAGE || second < period || least > TWO_STAGES * residual(0.0) {
        let value = squares.sqrt();
        return vec![of(value, of_sum(value))];
    }
    // The residual grows with the square of an error of the ratio. The four ramps of a feed are alike.
    let step = RATIO_STEP.min(0.5 * ratio);
    let growth = (residual(ratio - step) - least) / (step * step);
    let spread = COVERAGE * (least / ((0.25 * shown.len() as f64) * growth.max(f64::MIN_POSITIVE))).sqrt();
    let of_ratio = spread * first / (1.0 + ratio * ratio);
    vec![of(first, of_sum(first).hypot(ratio * of_ratio)), of(second, of_sum(second).hypot(of_ratio))]
}

/// Returns the sum of squares by which the positions of a ramp differ from those of boxes, apart from a shift in time.
fn shape_residual(ramp: &SpeedRamp, boxes: [f64; 3], period: f64) -> f64 {
    let lengths: Vec<f64> =
        boxes.iter().map(|length| length / period).filter(|length| *length > LEAST_BOX).collect();
    let [mut square, mut product, mut slopes] = [0.0; 3];
    for [time, place] in &ramp.shape {
        let error = place - distance(*time, &lengths);
        let slope = distance(time + 0.5, &lengths) - distance(time - 0.5, &lengths);
        square += error * error;
        product += error * slope;
        slopes += slope * slope;
    }
    (square - product * product / slopes.max(f64::MIN_POSITIVE)).max(0.0) * ramp.speed * ramp.speed
}
