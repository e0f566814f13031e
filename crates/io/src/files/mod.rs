//! Reading and writing of files: setpoints, traces and recordings.
//!
//! The kind of an input file is detected by its content ([`Input`]), that of an output file by its extension.
//! Position setpoints are read from CSV ([`PsecCsvReader`], streaming), YAML ([`read_psec_yaml`]) and MCAP
//! ([`McapTrajectories`]), measured axis data from CSV, MCAP and exports of controls ([`read_recording`],
//! [`inspect_recording`]). Traces and setpoints ([`RowWriter`]) are written atomically ([`OutputFile`]),
//! figures of trials as JSON ([`figures_json`], [`part_program_json`]); recordings of the node ([`BoundedRecording`])
//! are readable up to the last complete chunk.

mod bounded_recording;
mod cdr;
mod decimal;
mod error;
mod figures_json;
mod input;
mod learning_json;
mod lines;
mod mcap_messages;
mod mcap_reader;
mod mcap_writer;
mod output;
mod psec_csv;
mod psec_error;
mod psec_mcap;
mod psec_row;
mod psec_writer;
mod psec_yaml;
mod recording;
mod row_writer;
mod trace_csv;
mod trace_mcap;
mod tuning_json;
mod zstd;

pub use bounded_recording::{BoundedRecording, RecordedTopic};
pub use cdr::encode_cdr;
pub use error::FileError;
pub use figures_json::{figures_json, part_program_json};
pub use input::{FileKind, Input, InputError};
pub use learning_json::{learning_end_text, learning_json};
pub use output::OutputFile;
pub use psec_csv::PsecCsvReader;
pub use psec_mcap::McapTrajectories;
pub use psec_row::{PsecRow, TimeGap};
pub use psec_writer::{PsecCsvWriter, PsecMcapWriter, PsecYamlWriter};
pub use psec_yaml::read_psec_yaml;
pub use recording::recorded_psec::RecordedPsec;
pub use recording::{
    Channel, ColumnUnit, Columns, FoundColumn, RecordingColumns, RecordingFormat, RecordingOptions,
    inspect_recording, inspect_recording_stream, read_recording, read_recording_mcap, read_recording_stream,
};
pub use row_writer::{RowWriter, psec_writer, trace_writer};
pub use trace_csv::TraceCsvWriter;
pub use trace_mcap::TraceMcapWriter;
pub use tuning_json::{costed_run_json, robustness_json, tuning_json};
