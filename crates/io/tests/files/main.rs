//! Tests of file formats: setpoints, traces, recordings and URDF.

mod bounded_recording;
mod encodings;
mod output;
mod psec_csv;
mod psec_mcap;
mod psec_yaml;
mod recorded_psec;
mod recording_any_bytes;
mod recording_columns;
mod recording_csv;
mod recording_halsampler;
mod recording_mcap;
mod recording_sinumerik_edge;
mod recording_sinumerik_trace;
mod recording_twincat;
mod urdf;
