//! Formats of recordings, detected from the content.

use std::fmt;
use std::str::FromStr;

use super::{halsampler, sinumerik_edge, sinumerik_trace, twincat_header};
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};

/// Format of a recording of axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingFormat {
    /// CSV with a header, or with columns selected by number.
    Csv,
    /// Trace of Sinumerik Operate on Sinumerik 840D sl, XML.
    SinumerikTrace,
    /// High-frequency data of Sinumerik Edge, JSON.
    SinumerikEdge,
    /// CSV exported by TwinCAT Scope.
    TwinCatScope,
    /// Text of LinuxCNC's halsampler.
    Halsampler,
    /// MCAP with ROS messages.
    Mcap,
}

/// Error of an unknown name of a format.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown format \"{found}\"; known are {}{}", RecordingFormat::names(), nearest_hint(.nearest))]
pub struct RecordingFormatError {
    found: String,
    nearest: Option<String>,
}

impl RecordingFormat {
    /// All formats.
    pub const ALL: [RecordingFormat; 6] = [
        RecordingFormat::Csv,
        RecordingFormat::SinumerikTrace,
        RecordingFormat::SinumerikEdge,
        RecordingFormat::TwinCatScope,
        RecordingFormat::Halsampler,
        RecordingFormat::Mcap,
    ];

    /// Returns the name of the format, as in the option `--format`.
    pub const fn name(self) -> &'static str {
        match self {
            RecordingFormat::Csv => "csv",
            RecordingFormat::SinumerikTrace => "sinumerik-trace",
            RecordingFormat::SinumerikEdge => "sinumerik-edge",
            RecordingFormat::TwinCatScope => "twincat-scope",
            RecordingFormat::Halsampler => "halsampler",
            RecordingFormat::Mcap => "mcap",
        }
    }

    fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// Detects the format from the first bytes of a file.
    pub(super) fn detect(head: &[u8]) -> Self {
        if head.starts_with(mcap::MAGIC) {
            return RecordingFormat::Mcap;
        }
        let text = String::from_utf8_lossy(head);
        if sinumerik_trace::is_sinumerik_trace(&text) {
            RecordingFormat::SinumerikTrace
        } else if sinumerik_edge::is_sinumerik_edge(&text) {
            RecordingFormat::SinumerikEdge
        } else if twincat_header::is_twincat(&text) {
            RecordingFormat::TwinCatScope
        } else if halsampler::is_halsampler(&text) {
            RecordingFormat::Halsampler
        } else {
            RecordingFormat::Csv
        }
    }
}

impl fmt::Display for RecordingFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for RecordingFormat {
    type Err = RecordingFormatError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|format| format.name() == text).ok_or_else(|| RecordingFormatError {
            found: shortened(text),
            nearest: nearest_name(text, Self::ALL.map(Self::name)),
        })
    }
}
