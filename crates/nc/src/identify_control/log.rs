//! Setpoints that a control made of a program.

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::statistics::median;
use virtual_axes_core::units::Rounded;

use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates};

/// Parts of the distance of a stamp from the grid by which the grid follows, one for each pass.
const GAINS: [f64; 3] = [0.3, 0.1, 0.03];
/// Distance of a stamp from the grid below which it fits, and above which it is reported, sampling periods. A missing sample
/// that is not counted leaves at least half a period.
const MOST_JITTER: f64 = 0.49;
const REPORTED_JITTER: f64 = 0.01;
/// Largest shift of a sample by rounding of the period to a decimal, sampling periods.
const MOST_ROUNDING: f64 = 0.02;
/// Fewest changes of a position that show runs of repeated samples.
const LEAST_CHANGES: usize = 20;

/// Accuracy of the setpoints of a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LogAccuracy {
    /// Value of the last digit of setpoints, or deviation of estimated ones, m or rad.
    pub resolution: f64,
    /// Samples over which a speed is taken: 1 for setpoints, more for estimated ones.
    pub window: usize,
    /// Length of a moving average that rounds corners as the estimate does, s; 0 for setpoints.
    pub smoothing: f64,
    /// Sum of squares that the drives can add to that of a ramp, s²; 0 for setpoints.
    pub drive_squares: f64,
}

impl LogAccuracy {
    /// Returns true for setpoints that are estimated from recorded positions.
    pub fn is_estimated(&self) -> bool {
        self.window > 1
    }
}

/// Setpoints of a control at a constant sampling period.
#[derive(Debug, Clone)]
pub struct ControlLog {
    /// Sampling period, s.
    pub period: f64,
    /// Accuracy of the setpoints.
    pub(super) accuracy: LogAccuracy,
    /// Positions of X, Y, Z, A, B, C, U, V, W, m or rad; 0 for an axis that the log lacks.
    pub positions: Vec<Coordinates>,
    /// True for the axes that the log has.
    pub has_axis: [bool; AXIS_COUNT],
    /// Corrections of the samples.
    pub notes: Vec<String>,
}

impl ControlLog {
    /// Creates a log from rows of times, s, and positions of the joints with these indices, m or rad. Each row is moved to an
    /// even grid of times; missing rows are interpolated. Of runs of equal rows, one is used.
    ///
    /// # Errors
    ///
    /// Returns an error if there are fewer than two rows, if times do not increase, or if they do not fit an even grid.
    pub fn new(
        machine: &MachineConfig,
        joints: &[usize],
        rows: &[(f64, Vec<f64>)],
        resolution: f64,
    ) -> Result<Self, String> {
        let axes = joints.iter().map(|&joint| {
            let name = machine.axes().get(joint)?.name();
            AXIS_LETTERS.iter().position(|letter| name.eq_ignore_ascii_case(&letter.to_string()))
        });
        let axes: Vec<Option<usize>> = axes.collect();
        let times: Vec<f64> = rows.iter().map(|(time, _)| time - rows[0].0).collect();
        let grid = TimeGrid::new(&times)?;
        let mut period = grid.decimal_period();
        let mut notes = Vec::new();
        if grid.jitter > REPORTED_JITTER {
            notes.push(format!(
                "the time stamps are up to {} ms off an even grid: the samples are moved to it, one each {} ms",
                Rounded(1e3 * grid.jitter * period),
                Rounded(1e3 * period)
            ));
        }
        let mut samples: Vec<(i64, &[f64])> =
            grid.slots.iter().zip(rows).map(|(slot, (_, row))| (*slot as i64, row.as_slice())).collect();
        if let Some((length, first)) = runs(&samples) {
            samples.retain(|(slot, _)| (slot - first) % length == 0);
            samples.iter_mut().for_each(|(slot, _)| *slot = (*slot - first) / length);
            period *= length as f64;
            notes.push(format!(
                "the samples repeat in runs of {length}: one of each run is used, each {} ms",
                Rounded(1e3 * period)
            ));
        }
        let mut log = Self {
            period,
            accuracy: LogAccuracy { resolution, window: 1, smoothing: 0.0, drive_squares: 0.0 },
            positions: Vec::with_capacity(samples.len()),
            has_axis: [false; AXIS_COUNT],
            notes,
        };
        axes.iter().flatten().for_each(|&axis| log.has_axis[axis] = true);
        let mut add = |value: &dyn Fn(usize) -> f64| {
            let mut position = [0.0; AXIS_COUNT];
            for (column, axis) in axes.iter().enumerate() {
                axis.iter().for_each(|&axis| position[axis] = value(column));
            }
            log.positions.push(position);
        };
        for pair in samples.windows(2) {
            let [(from, before), (to, after)] = [pair[0], pair[1]];
            add(&|column| before[column]);
            for slot in from + 1..to {
                let part = (slot - from) as f64 / (to - from) as f64;
                add(&|column| before[column] + part * (after[column] - before[column]));
            }
        }
        if let Some((_, last)) = samples.last() {
            add(&|column| last[column]);
        }
        Ok(log)
    }
}

/// Even grid of times, on which a control samples.
#[derive(Debug, PartialEq)]
struct TimeGrid {
    /// Time of slot 0, s.
    start: f64,
    /// Sampling period, s.
    period: f64,
    /// Slot of each sample, a whole number.
    slots: Vec<f64>,
    /// Largest distance of a stamp from the grid, sampling periods.
    jitter: f64,
}

impl TimeGrid {
    /// Finds the grid of stamps, s.
    fn new(times: &[f64]) -> Result<Self, String> {
        let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let Some(middle) = median(&mut steps) else {
            return Err(format!("{} rows; a log has at least two", times.len()));
        };
        if steps.iter().any(|step| *step <= 0.0) {
            return Err("the times of the rows do not increase".to_owned());
        }
        let all = Self::through(times, (0..times.len()).map(|k| k as f64).collect());
        if all.jitter < MOST_JITTER {
            return Ok(all);
        }
        let mean = times[times.len() - 1] / steps.len() as f64;
        let grids = [mean, middle].map(|period| Self::following(times, period));
        let off = grids[1].jitter * grids[1].period;
        grids.into_iter().find(|grid| grid.jitter < MOST_JITTER).ok_or_else(|| {
            format!(
                "the time stamps do not fit an even grid: they are up to {} ms off one of {} ms; a control samples at a \
                 constant rate: write the stamps with more digits, or delete their column and give the rate by --rate-hz",
                Rounded(1e3 * off),
                Rounded(1e3 * middle)
            )
        })
    }

    /// Returns the grid of stamps with missing samples, from an estimate of its period.
    fn following(times: &[f64], period: f64) -> Self {
        let mut grid = Self { start: times[0], period, slots: Vec::new(), jitter: 0.0 };
        for gain in GAINS {
            let mut phase = grid.start;
            let slot = |time: &f64| {
                let slot = ((time - phase) / grid.period).round();
                phase += gain * (time - phase - slot * grid.period);
                slot
            };
            let mut slots: Vec<f64> = times.iter().map(slot).collect();
            // Two samples in one slot: the second one is late.
            for i in (1..slots.len()).rev() {
                slots[i - 1] = slots[i - 1].min(slots[i] - 1.0);
            }
            grid = Self::through(times, slots);
        }
        grid
    }

    /// Fits the grid to stamps in slots by least squares.
    fn through(times: &[f64], slots: Vec<f64>) -> Self {
        let count = times.len() as f64;
        let [center, middle] = [times, &slots].map(|values| values.iter().sum::<f64>() / count);
        let [mut product, mut square] = [0.0; 2];
        for (slot, time) in slots.iter().zip(times) {
            product += (slot - middle) * (time - center);
            square += (slot - middle).powi(2);
        }
        let period = product / square;
        let start = center - middle * period;
        let distances = times.iter().zip(&slots).map(|(time, slot)| ((time - start) / period - slot).abs());
        let jitter = distances.fold(0.0, f64::max);
        Self { start, period, slots, jitter }
    }

    /// Returns the shortest decimal period that moves no sample.
    fn decimal_period(&self) -> f64 {
        let length = self.slots[self.slots.len() - 1] - self.slots[0];
        let decimals = (3..=9).map(|digits| {
            let scale = 10_f64.powi(digits);
            (self.period * scale).round() / scale
        });
        let is_same = |period: &f64| {
            *period > 0.0 && (period - self.period).abs() * length <= MOST_ROUNDING * self.period
        };
        decimals.into_iter().find(is_same).unwrap_or(self.period)
    }
}

/// Returns the length of the runs in which samples repeat during motion, if it is more than 1, and the slot of a run's first
/// sample.
fn runs(samples: &[(i64, &[f64])]) -> Option<(i64, i64)> {
    let changes = samples.windows(2).filter(|pair| pair[0].1 != pair[1].1).map(|pair| pair[1].0);
    let changes: Vec<i64> = changes.collect();
    let lengths = || changes.windows(2).map(|pair| pair[1] - pair[0]);
    let shortest = lengths().min().filter(|length| *length > 1)?;
    let is_equal = lengths().all(|length| length % shortest == 0)
        && 2 * lengths().filter(|length| *length == shortest).count() > changes.len();
    (changes.len() > LEAST_CHANGES && is_equal).then(|| (shortest, changes[0]))
}
