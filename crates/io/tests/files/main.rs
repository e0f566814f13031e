//! TODO

mod files_mcap;
mod files_mcap_bounded;
mod files_psec_csv;
mod files_psec_yaml;
mod files_recording_csv;
mod files_recording_mcap;
mod urdf;
