//! Axis and options of a recording that is read.

use virtual_axes_core::config::{AxisConfig, AxisKind};

use super::columns::{Column, Columns};
use super::format::{Found, RecordingFormat};
use super::unit::Channel;
use crate::files::error::FileError;

/// File, axis, column mapping and sampling rate of a recording.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub name: &'a str,
    pub axis: &'a AxisConfig,
    pub joint: &'a str,
    /// True if the user names the joint.
    pub is_joint_given: bool,
    pub columns: &'a Columns,
    /// Sampling rate, Hz, of a file without a column of time.
    pub rate: Option<f64>,
    /// True to read time and position only.
    pub is_setpoint: bool,
}

impl Context<'_> {
    /// Returns the factors to SI of the channels, in the order of [`Channel::ALL`].
    pub fn factors(&self) -> Found<[f64; Channel::ALL.len()]> {
        let mut factors = [1.0; Channel::ALL.len()];
        for (factor, channel) in factors.iter_mut().zip(Channel::ALL) {
            let Some(mapping) = self.columns.mapping(channel) else { continue };
            let Some(unit) = mapping.unit else { continue };
            let units = channel.units(self.axis);
            let Some((_, worth)) = units.iter().find(|(symbol, _)| *symbol == unit.symbol) else {
                let allowed: Vec<&str> = units.iter().map(|(symbol, _)| *symbol).collect();
                return Err(FileError::new(
                    &mapping.at,
                    format_args!(
                        "the unit of {channel} is [{}], must be one of {} for the {} axis {}",
                        unit.symbol,
                        allowed.join(", "),
                        if self.axis.kind == AxisKind::Linear { "linear" } else { "rotary" },
                        self.axis.name
                    ),
                ));
            };
            *factor = unit.factor * worth;
        }
        Ok(factors)
    }

    /// Returns true if the channel is read.
    pub fn is_read(&self, channel: Channel) -> bool {
        !self.is_setpoint || matches!(channel, Channel::Time | Channel::Position)
    }

    /// Returns true if the recording must have a column of the channel.
    pub fn is_required(&self, channel: Channel) -> bool {
        channel.is_required() && !(channel == Channel::Time && self.rate.is_some())
    }

    /// Returns the header of a channel in a trace.
    pub fn trace_header(&self, channel: Channel) -> String {
        format!("{}.{channel}", self.joint)
    }

    /// Returns the possible headers of a channel; the first one found is used.
    pub fn candidate_headers(&self, channel: Channel, is_trace: bool) -> Vec<String> {
        let defaults = || match channel {
            Channel::Time => vec![channel.name().to_owned()],
            // In a trace, only trace headers are used.
            channel if is_trace => vec![self.trace_header(channel)],
            channel => vec![self.trace_header(channel), channel.name().to_owned()],
        };
        match self.columns.mapping(channel) {
            None => defaults(),
            Some(mapping) => match &mapping.column {
                Column::Default => defaults(),
                Column::Named(name) => vec![name.clone(), mapping.text.clone()],
                Column::Index(index) => vec![format!("#{}", index + 1)],
            },
        }
    }
}

/// Options of reading a recording. The defaults fit traces and recordings of this package.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordingOptions {
    /// Column mapping and format of CSV files.
    pub columns: Columns,
    /// Topics of MCAP recordings, or prefixes of their names (`/mill`), if several topics have the same type.
    pub topics: Vec<String>,
    /// Full name of the joint, or the name or number of the axis in the file; default is the name of the axis, with or
    /// without a prefix.
    pub joint: Option<String>,
    /// Format of the file; detected from the content if `None`.
    pub format: Option<RecordingFormat>,
    /// Sampling rate, Hz, of a file without a column of time.
    pub rate_hz: Option<f64>,
}

impl RecordingOptions {
    /// Returns the name of the joint in the file.
    pub(super) fn joint<'a>(&'a self, axis: &'a AxisConfig) -> &'a str {
        self.joint.as_deref().unwrap_or(&axis.name)
    }

    /// Returns the context of a file; rejects an invalid sampling rate.
    pub(super) fn context<'a>(&'a self, name: &'a str, axis: &'a AxisConfig) -> Found<Context<'a>> {
        if let Some(found) = self.rate_hz.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            let reason = format!("the sampling rate is {found}, must be a finite number above 0");
            return Err(FileError::new("--rate-hz", reason));
        }
        Ok(Context {
            name,
            axis,
            joint: self.joint(axis),
            is_joint_given: self.joint.is_some(),
            columns: &self.columns,
            rate: self.rate_hz,
            is_setpoint: false,
        })
    }
}
