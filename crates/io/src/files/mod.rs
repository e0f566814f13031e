//! Files: setpoints, traces and recordings, in and out.
//!
//! What a file is, is told by its content ([`Input`]) when it is read and by its extension when it is
//! written. Setpoints come from CSV ([`PsecCsv`], a stream), YAML ([`read_psec_yaml`]) and MCAP
//! recordings ([`Trajectories`]); what was recorded of an axis from CSV and MCAP ([`read_recording`]).
//! Traces ([`TraceWriter`]) and setpoints ([`PsecWriter`]) go into [`OutputFile`]s, which stand under their
//! names only when they are whole; what the node records ([`BoundedRecording`]) can be read from the start.

mod cdr;
mod input;
mod lines;
mod mcap_bounded;
mod mcap_in;
mod mcap_messages;
mod mcap_out;
mod number;
mod output;
mod psec_csv;
mod psec_error;
mod psec_mcap;
mod psec_out;
mod psec_yaml;
mod recorded;
mod trace;
mod trace_csv;
mod trace_mcap;

pub use cdr::encode;
pub use input::{FileKind, Input, InputError};
pub use mcap_bounded::{BoundedRecording, RecordedTopic};
pub use mcap_in::McapFault;
pub use output::OutputFile;
pub use psec_csv::PsecCsv;
pub use psec_error::PsecError;
pub use psec_mcap::{RecordingError, Trajectories};
pub use psec_out::{PsecCsvOut, PsecMcapOut, PsecWriter, PsecYamlOut, psec_writer};
pub use psec_yaml::{TrajectoryYamlError, read_psec_yaml};
pub use recorded::{
    AxisRecordingError, Channel, Columns, ColumnsError, RecordingOptions, read_recording, read_recording_csv,
    read_recording_mcap,
};
pub use trace::{TraceWriter, trace_writer};
pub use trace_csv::TraceCsv;
pub use trace_mcap::TraceMcap;

use virtual_axes_core::text::shortened;

/// Most names that a message lists.
const MOST_LISTED: usize = 10;

/// Names for a message: the first of them, none longer than is worth reading.
fn listed<'a>(names: impl IntoIterator<Item = &'a String>) -> Vec<String> {
    names.into_iter().take(MOST_LISTED).map(|name| shortened(name)).collect()
}
