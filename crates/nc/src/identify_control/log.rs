//! Setpoints that a control made of a program.

use virtual_axes_core::config::MachineConfig;

use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates};

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
}

impl ControlLog {
    /// Creates a log from rows of times, s, and positions of the joints with these indices, m or rad. Rows are interpolated
    /// at the median of the time steps.
    ///
    /// # Errors
    ///
    /// Returns an error if there are fewer than two rows, or if times do not increase.
    pub fn new(
        machine: &MachineConfig,
        joints: &[usize],
        rows: &[(f64, Vec<f64>)],
        resolution: f64,
    ) -> Result<Self, String> {
        let mut steps: Vec<f64> = rows.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        steps.sort_by(f64::total_cmp);
        let (Some(&period), Some(&least)) = (steps.get(steps.len() / 2), steps.first()) else {
            return Err(format!("{} rows; a log has at least two", rows.len()));
        };
        if least <= 0.0 {
            return Err("the times of the rows do not increase".to_owned());
        }
        let axes = joints.iter().map(|&joint| {
            let name = machine.axes().get(joint)?.name();
            AXIS_LETTERS.iter().position(|letter| name.eq_ignore_ascii_case(&letter.to_string()))
        });
        let axes: Vec<Option<usize>> = axes.collect();
        let mut log = Self {
            period,
            accuracy: LogAccuracy { resolution, window: 1, smoothing: 0.0, drive_squares: 0.0 },
            positions: Vec::with_capacity(rows.len()),
            has_axis: [false; AXIS_COUNT],
        };
        axes.iter().flatten().for_each(|&axis| log.has_axis[axis] = true);
        let (start, end) = (rows[0].0, rows[rows.len() - 1].0);
        let mut next = 0;
        for k in 0..=((end - start) / period + 0.5) as usize {
            let time = start + k as f64 * period;
            while next + 2 < rows.len() && rows[next + 1].0 < time - 1e-6 * period {
                next += 1;
            }
            let [(from, before), (to, after)] = [&rows[next], &rows[next + 1]];
            let part = ((time - from) / (to - from)).clamp(0.0, 1.0);
            let mut position = [0.0; AXIS_COUNT];
            for (column, axis) in axes.iter().enumerate() {
                if let Some(axis) = *axis {
                    position[axis] = match part {
                        // Bits of the rows at their times.
                        part if part < 1e-5 => before[column],
                        part if part > 1.0 - 1e-5 => after[column],
                        part => before[column] + part * (after[column] - before[column]),
                    };
                }
            }
            log.positions.push(position);
        }
        Ok(log)
    }
}
