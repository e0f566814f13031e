//! Options of setpoints from a recording of a control.

use std::error::Error;
use std::path::Path;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_io::files::RecordedPsec;

use crate::input::part_program::has_program_extension;
use crate::output::print_error;

/// Columns and sampling rate of a recording of a control.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct LogArguments {
    /// Column with the setpoints of an axis in a log of a control or in CSV, for example `x=#2[mm]`; also `time=t[ms]`,
    /// `delimiter=;`, `decimal_comma=true`, `skip_lines=2`; can be repeated [default: the commanded positions that the
    /// log names].
    #[arg(long, value_name = "AXIS=COLUMN[UNIT]")]
    column: Vec<String>,
    /// Sampling rate of a log without a column of time, Hz.
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    rate_hz: Option<f64>,
}

impl LogArguments {
    /// Returns the first option that is given.
    pub fn given(&self) -> Option<&'static str> {
        let given = [(!self.column.is_empty(), "--column"), (self.rate_hz.is_some(), "--rate-hz")];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
    }

    /// Returns true if a file is read as a log: because of an option, or of its content. The extension of a part program
    /// excludes the latter: a line such as `o<zref> sub` can pass for the header of columns.
    pub fn applies_to(&self, name: &str) -> bool {
        !self.column.is_empty() || (!has_program_extension(name) && RecordedPsec::detects(Path::new(name)))
    }

    /// Opens the setpoints of the axes of a machine; `has_notes` prints the findings of reading.
    ///
    /// # Errors
    ///
    /// Returns an error if the file or an option is invalid.
    pub fn open(
        &self,
        name: &str,
        machine: &MachineConfig,
        has_notes: bool,
    ) -> Result<RecordedPsec, Box<dyn Error>> {
        let (recorded, findings) =
            RecordedPsec::open(Path::new(name), machine.axes(), &self.column, self.rate_hz)?;
        findings.iter().filter(|_| has_notes).for_each(|finding| print_error(&finding.line()));
        Ok(recorded)
    }
}
