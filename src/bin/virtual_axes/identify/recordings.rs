//! Recordings of one axis on the command line: reading, conditioning, and active feedforward.

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::identify::{ConditionedRecording, FeedforwardMode};
use virtual_axes_identify::recording::{Conditioning, PsecShift, StatedValues};
use virtual_axes_io::files::{Columns, RecordingFormat, RecordingOptions, read_recording};

use crate::psec::campaign::FeedforwardName;

/// Options for reading all recordings.
#[derive(Debug, Clone, clap::Args)]
pub struct RecordingArguments {
    /// Column and unit of a channel in CSV files, for example `position=Pos1[mm]`, `current=#4[-1 A]`.
    /// Channels: time, psec, position, velocity, current, torque, velocity_feedforward, torque_feedforward, motor_position,
    /// wind_up; also `delimiter=;`, `decimal_comma=true`, `skip_lines=2`; can be repeated.
    #[arg(long, value_name = "CHANNEL=COLUMN[UNIT]")]
    column: Vec<String>,
    /// File with column mappings; --column has priority.
    #[arg(long, value_name = "MAP.yaml")]
    columns: Option<PathBuf>,
    /// Topic of an MCAP recording, or a prefix of its name, if several topics have one type; can be repeated.
    #[arg(long)]
    topic: Vec<String>,
    /// Joint in the recordings, or name or number of the axis in their columns [default: axis name]; for several axes
    /// one for each, separated by commas.
    #[arg(long)]
    joint: Option<String>,
    /// Format of the recordings [default: detected]: csv, sinumerik-trace, sinumerik-edge,
    /// twincat-scope, halsampler or mcap.
    #[arg(long, value_name = "NAME")]
    format: Option<RecordingFormat>,
    /// Sampling rate of recordings without a column of time, Hz.
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    rate_hz: Option<f64>,
    /// Cut-off frequency (−3 dB) of the filter of velocity, acceleration and current, Hz [default: 100, less
    /// for low sampling rates].
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    cutoff_hz: Option<f64>,
    /// Lag of the recorded current, ms [default: estimated].
    #[arg(long, value_name = "MS", allow_negative_numbers = true)]
    current_lag_ms: Option<f64>,
    /// Low-pass filter of the control (second-order Butterworth, −3 dB), Hz, that all recorded signals but the setpoint
    /// have passed; simulated signals pass it too.
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    trace_filter_hz: Option<f64>,
    /// Moves a setpoint that the recording delays forward in time: `auto`, or a time in ms.
    #[arg(long, value_name = "auto|MS", allow_negative_numbers = true, value_parser = parse_psec_shift)]
    psec_shift: Option<PsecShift>,
}

fn parse_psec_shift(text: &str) -> Result<PsecShift, String> {
    /// Largest shift, ms.
    const LARGEST: f64 = 1000.0;
    if text == "auto" {
        return Ok(PsecShift::Auto);
    }
    let milliseconds = text.parse::<f64>().ok().filter(|value| value.abs() <= LARGEST);
    let shift = milliseconds.map(|value| PsecShift::By(value * MILLISECOND));
    shift.ok_or_else(|| format!("must be auto, or a time from -{LARGEST} to {LARGEST} ms"))
}

impl RecordingArguments {
    /// Returns the file with column mappings, if given.
    pub fn map(&self) -> Option<&Path> {
        self.columns.as_deref()
    }

    /// Returns the option that names the signals of one axis, if given.
    ///
    /// # Errors
    /// Returns an error if a column mapping is invalid.
    pub fn single_axis_option(&self) -> Result<Option<String>, Box<dyn Error>> {
        if let Some(joint) = &self.joint {
            return Ok(Some(format!("--joint {}", shortened(joint))));
        }
        let columns = Columns::read(self.map(), &self.column, "--column")?;
        Ok(columns.single_axis_mapping())
    }

    /// Returns the value of `--joint`.
    pub fn joint(&self) -> Option<&str> {
        self.joint.as_deref()
    }

    /// Returns the arguments for the axis with this name in the recordings.
    pub fn with_joint(&self, joint: Option<&str>) -> Self {
        RecordingArguments { joint: joint.map(str::to_owned), ..self.clone() }
    }

    /// Returns the arguments with further column mappings and, if none is given, the sampling rate.
    pub fn with_additions(&self, columns: &[String], rate_hz: Option<f64>) -> Self {
        let column = self.column.iter().chain(columns).cloned().collect();
        RecordingArguments { column, rate_hz: self.rate_hz.or(rate_hz), ..self.clone() }
    }

    /// Returns true if the sampling rate is given.
    pub fn has_rate(&self) -> bool {
        self.rate_hz.is_some()
    }

    /// Returns true if a mapping names the channel.
    pub fn maps(&self, channel: &str) -> bool {
        self.column.iter().any(|column| column.split('=').next().is_some_and(|key| key.trim() == channel))
    }

    /// Returns the arguments as words of a command, but `--joint`.
    pub fn words(&self) -> Vec<String> {
        let mut words = Vec::new();
        let mut add = |option: &str, value: String| words.extend([option.to_owned(), value]);
        self.column.iter().for_each(|column| add("--column", column.clone()));
        self.columns.iter().for_each(|file| add("--columns", file.display().to_string()));
        self.topic.iter().for_each(|topic| add("--topic", topic.clone()));
        self.format.iter().for_each(|format| add("--format", format.to_string()));
        let numbers = [
            ("--rate-hz", self.rate_hz),
            ("--cutoff-hz", self.cutoff_hz),
            ("--current-lag-ms", self.current_lag_ms),
            ("--trace-filter-hz", self.trace_filter_hz),
        ];
        for (option, number) in numbers {
            number.iter().for_each(|number| add(option, number.to_string()));
        }
        match self.psec_shift {
            Some(PsecShift::Auto) => add("--psec-shift", "auto".to_owned()),
            Some(PsecShift::By(time)) => add("--psec-shift", (time / MILLISECOND).to_string()),
            Some(PsecShift::None) | None => {}
        }
        words
    }

    /// Returns the arguments with a setpoint that is moved forward, unless the shift is given.
    pub fn with_psec_shift(&self) -> Self {
        RecordingArguments { psec_shift: self.psec_shift.or(Some(PsecShift::Auto)), ..self.clone() }
    }

    /// Sets the lag of the current to 0 unless it is given, in place of an estimate.
    pub fn without_estimated_current_lag(mut self) -> Self {
        self.current_lag_ms = self.current_lag_ms.or(Some(0.0));
        self
    }

    /// Returns the options for reading files.
    pub fn options(&self) -> Result<RecordingOptions, Box<dyn Error>> {
        let columns = Columns::read(self.map(), &self.column, "--column")?;
        Ok(RecordingOptions {
            columns,
            topics: self.topic.clone(),
            joint: self.joint.clone(),
            format: self.format,
            rate_hz: self.rate_hz,
        })
    }

    fn conditioning(&self, stated: StatedValues) -> Conditioning {
        Conditioning {
            cutoff: self.cutoff_hz,
            current_lag: self.current_lag_ms.map(|milliseconds| milliseconds * MILLISECOND),
            psec_shift: self.psec_shift.unwrap_or_default(),
            trace_filter: self.trace_filter_hz,
            stated,
        }
    }
}

/// Axis with the periods of its machine, and its values that the user has stated.
pub type StatedAxis<'a> = (&'a AxisConfig, &'a Periods, StatedValues);

/// Reads and conditions the recording `path` of `axis`; `feedforward` is the active one if it was given.
///
/// # Errors
///
/// Returns an error if the file is invalid.
pub fn read(
    path: &Path,
    (axis, periods, stated): StatedAxis<'_>,
    (reading, options): (&RecordingArguments, &RecordingOptions),
    feedforward: Option<FeedforwardMode>,
) -> Result<ConditionedRecording, Box<dyn Error>> {
    let (raw, findings) = read_recording(path, axis, options)?;
    let conditioning = reading.conditioning(stated);
    Ok(ConditionedRecording::new((&raw, findings), (axis, periods), &conditioning, feedforward)?)
}

/// Reads and conditions the recording `path` of `axis` with both encoders.
///
/// # Errors
///
/// Returns an error if the file is invalid.
pub fn read_both_encoders(
    path: &Path,
    (axis, periods, stated): StatedAxis<'_>,
    (reading, options): (&RecordingArguments, &RecordingOptions),
) -> Result<ConditionedRecording, Box<dyn Error>> {
    let read = read_recording(path, axis, options)?;
    Ok(ConditionedRecording::of_both_encoders(read, (axis, periods), &reading.conditioning(stated))?)
}

/// Returns the active feedforward of each of `count` recordings from the values of `option`: one for all, or
/// one for each.
pub fn feedforward(
    given: &[FeedforwardName],
    count: usize,
    option: &str,
) -> Result<Vec<Option<FeedforwardMode>>, String> {
    match given {
        [] => Ok(vec![None; count]),
        [one] => Ok(vec![Some((*one).into()); count]),
        all if all.len() == count => Ok(all.iter().map(|part| Some((*part).into())).collect()),
        all => Err(format!(
            "{option}: {} values for {count} recording{}; give one value for all, or one for each",
            all.len(),
            if count == 1 { "" } else { "s" }
        )),
    }
}
