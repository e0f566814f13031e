//! Limit audit of the rows of a CSV file, at their own times and with the rounding of their digits.

use virtual_axes_core::assess::LimitAudit;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_io::files::PsecRow;

/// Number of rows that determine the digits of a column before differences are computed.
const DIGIT_ROWS: usize = 1000;

/// Audit of rows in constant memory.
#[derive(Debug)]
pub struct RowAudit {
    audit: LimitAudit,
    /// Index of each column's axis in the machine.
    joints: Vec<usize>,
    /// Last positions of all axes, m or rad.
    psec: Vec<f64>,
    /// Value of the last digit of the times, s, and of the positions of each axis, m or rad.
    resolutions: (f64, Vec<f64>),
    /// First rows, until their digits are known.
    first: Vec<PsecRow>,
    is_digits_known: bool,
}

impl RowAudit {
    /// Creates the audit of rows with the columns `joints`, axis indices in the machine.
    pub fn new(machine: &MachineConfig, joints: &[usize]) -> Self {
        let axes = machine.axes().len();
        Self {
            audit: LimitAudit::new(machine),
            joints: joints.to_vec(),
            psec: vec![0.0; axes],
            resolutions: (f64::INFINITY, vec![f64::INFINITY; axes]),
            first: Vec::new(),
            is_digits_known: false,
        }
    }

    /// Adds a row.
    pub fn add(&mut self, row: PsecRow) {
        let (time, positions) = &mut self.resolutions;
        *time = time.min(row.time_resolution);
        for (&joint, &resolution) in self.joints.iter().zip(&row.resolutions) {
            if let Some(finest) = positions.get_mut(joint) {
                *finest = finest.min(resolution);
            }
        }
        if self.is_digits_known {
            self.evaluate(&row);
            return;
        }
        self.first.push(row);
        if self.first.len() == DIGIT_ROWS {
            self.evaluate_first();
        }
    }

    fn evaluate_first(&mut self) {
        self.is_digits_known = true;
        for row in std::mem::take(&mut self.first) {
            self.evaluate(&row);
        }
    }

    fn evaluate(&mut self, row: &PsecRow) {
        let (time, positions) = &self.resolutions;
        self.audit.set_resolutions(*time, positions.iter().copied());
        for (&joint, &position) in self.joints.iter().zip(&row.positions) {
            if let Some(psec) = self.psec.get_mut(joint) {
                *psec = position;
            }
        }
        self.audit.add(row.time, usize::try_from(row.line).ok(), self.psec.iter().copied());
    }

    /// Returns the audit of all rows.
    pub fn finish(mut self) -> LimitAudit {
        self.evaluate_first();
        self.audit
    }
}
