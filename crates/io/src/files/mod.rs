//! Reading and writing of files: setpoints, traces and recordings.
//!
//! The kind of an input file is detected by its content ([`Input`]), that of an output file by its extension.
//! Position setpoints are read from CSV ([`PsecCsvReader`], streaming), YAML ([`read_psec_yaml`]) and MCAP
//! ([`McapTrajectories`]), measured axis data from CSV, MCAP and exports of controls ([`read_recording`],
//! [`inspect_recording`]). Traces ([`TraceWriter`]) and setpoints ([`PsecWriter`]) are written atomically
//! ([`OutputFile`]), figures of trials as JSON ([`figures_json`], [`part_program_json`]); recordings of the node ([`BoundedRecording`]) are readable up to the last complete chunk.

mod bounded_recording;
mod cdr;
mod decimal;
mod figures_json;
mod input;
mod lines;
mod mcap_messages;
mod mcap_reader;
mod mcap_writer;
mod output;
mod psec_csv;
mod psec_error;
mod psec_mcap;
mod psec_row;
mod psec_steps;
mod psec_writer;
mod psec_yaml;
mod recording;
mod trace;
mod trace_csv;
mod trace_mcap;
mod tuning_json;

pub use bounded_recording::{BoundedRecording, RecordedTopic};
pub use cdr::encode_cdr;
pub use figures_json::{figures_json, part_program_json};
pub use input::{FileKind, Input, InputError};
pub use mcap_reader::McapFileError;
pub use output::OutputFile;
pub use psec_csv::PsecCsvReader;
pub use psec_error::PsecError;
pub use psec_mcap::{McapTrajectories, TrajectoryRecordingError};
pub use psec_row::PsecRow;
pub use psec_steps::TimeGap;
pub use psec_writer::{PsecCsvWriter, PsecMcapWriter, PsecWriter, PsecYamlWriter, psec_writer};
pub use psec_yaml::{TrajectoryYamlError, read_psec_yaml};
pub use recording::{
    AxisRecordingError, Channel, ColumnUnit, Columns, ColumnsError, FoundColumn, RecordingColumns,
    RecordingFormat, RecordingFormatError, RecordingOptions, inspect_recording, inspect_recording_stream,
    read_recording, read_recording_csv, read_recording_mcap, read_recording_stream,
};
pub use trace::{TraceWriter, trace_writer};
pub use trace_csv::TraceCsvWriter;
pub use trace_mcap::TraceMcapWriter;
pub use tuning_json::{costed_run_json, tuning_json};

use virtual_axes_core::text::shortened;

/// Maximum number of names in an error message.
const MAX_LISTED: usize = 10;

/// Returns the first names, each shortened, for an error message.
fn shorten_names<'a>(names: impl IntoIterator<Item = &'a String>) -> Vec<String> {
    names.into_iter().take(MAX_LISTED).map(|name| shortened(name)).collect()
}
