//! Position setpoints of several axes from a recording of a control.

use std::fs::File;
use std::io::{self, Cursor, Read, Write};
use std::path::Path;

use super::columns::{Column, Columns, Mapping, column_and_unit};
use super::context::{Context, RecordingOptions};
use super::format::{Found, MAX_ROWS, RecordingFormat};
use super::found_column::{ColumnFactor, ColumnUnit, FoundColumn};
use super::unit::{Channel, Unit};
use super::{RecordingColumns, inspect_recording, read_head, read_stream};
use crate::files::error::{FileError, MAX_LISTED};
use crate::files::input::kind_from_head;
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use virtual_axes_identify::recording::{Finding, Severity};

/// Option of column mappings, for errors.
const OPTION: &str = "--column";
/// Numbers of decimals that a column can have; with more, all digits of its values count.
const DECIMALS: std::ops::RangeInclusive<i32> = 3..=9;
/// Largest rounding of a decimal number, in units of its last digit.
const ROUNDING: f64 = 1e-3;

/// Position setpoints of several axes from a recording. It reads as CSV, `time,x,y` in s, m and rad, from the first
/// sample at time 0, whose numbers have the bits of the values.
#[derive(Debug)]
pub struct RecordedPsec {
    times: Vec<f64>,
    /// Positions of each axis, m or rad.
    positions: Vec<Vec<f64>>,
    resolutions: Vec<f64>,
    next: usize,
    line: Cursor<Vec<u8>>,
}

impl RecordedPsec {
    /// Reads the setpoints of the axes of a machine from a file of any format but MCAP; the format is detected from the
    /// content. `columns` are texts `AXIS=COLUMN[UNIT]`, and the keys of [`Columns`] for time and CSV. Without an axis in
    /// `columns`, all axes are read whose commanded position the file names. `rate_hz` is the sampling rate, Hz, of a file
    /// without a column of time. Samples without a value of each axis are left out.
    ///
    /// # Errors
    /// Returns a [`FileError`] for the first error in the file or in a mapping, or if there is no setpoint.
    pub fn open(
        path: &Path,
        axes: &[AxisConfig],
        columns: &[String],
        rate_hz: Option<f64>,
    ) -> Result<(Self, Vec<Finding>), FileError> {
        let name = path.display().to_string();
        let (common, mut mappings) = mappings(axes, columns)?;
        let mut options = RecordingOptions { columns: common, rate_hz, ..RecordingOptions::default() };
        let mut findings = Vec::new();
        if mappings.is_empty() {
            mappings = detected(&name, &inspect_recording(path, &options)?, axes, &mut findings)?;
        }
        let common = options.columns.clone();
        let (mut header, mut times, mut found) = ("time".to_owned(), Vec::new(), Vec::new());
        for (axis, mapping) in mappings {
            options.columns = common.clone();
            options.columns.mappings.push(mapping);
            let context = Context { is_setpoint: true, ..options.context(&name, axis)? };
            let mut file = File::open(path).map_err(|error| FileError::new(&name, error))?;
            let head = read_head(&mut file, &name, &options)?;
            let (recording, new) = read_stream(head, file, &context)?;
            for finding in new.into_iter().filter(is_of_interest) {
                if !findings.contains(&finding) {
                    findings.push(finding);
                }
            }
            if times.is_empty() {
                times = recording.time;
            } else if times != recording.time {
                let reason = format!(
                    "the setpoints of {} are sampled at other times than those of {}; give the axes with one sampling by {OPTION}",
                    axis.name,
                    header.rsplit(',').next().unwrap_or_default()
                );
                return Err(FileError::new(name, reason));
            }
            header = header + "," + &axis.name;
            let index =
                Channel::ALL.iter().position(|channel| *channel == Channel::Position).unwrap_or_default();
            let factor = context.factors()?.get(index).copied().unwrap_or(1.0);
            found.push((recording.position.unwrap_or_default(), factor));
        }
        let complete: Vec<usize> = (0..times.len())
            .filter(|row| found.iter().all(|(values, _)| values.get(*row).is_some_and(|v| v.is_finite())))
            .collect();
        let pick = |values: &[f64]| complete.iter().filter_map(|row| values.get(*row).copied()).collect();
        if complete.len() < times.len() {
            let what = format!(
                "{name}: {} of {} samples without a setpoint of each axis are left out",
                times.len() - complete.len(),
                times.len()
            );
            findings.push(Finding::note("incomplete-samples", what));
        }
        let resolutions = found.iter().map(|(values, factor)| resolution(values, *factor)).collect();
        let positions = found.iter().map(|(values, _)| pick(values)).collect();
        let line = Cursor::new((header + "\n").into_bytes());
        Ok((RecordedPsec { times: pick(&times), positions, resolutions, next: 0, line }, findings))
    }

    /// Returns true if a regular file has the content of a recording of a control: Sinumerik, TwinCAT, LinuxCNC, or CSV
    /// whose header names commanded positions of axes.
    pub fn detects(path: &Path) -> bool {
        let options = RecordingOptions::default();
        let head = || read_head(&mut File::open(path).ok()?, "", &options).ok();
        let is_named = |column: &FoundColumn| column.channel == Some(Channel::Psec) && column.axis.is_some();
        path.is_file()
            && match head() {
                Some((RecordingFormat::Csv, head)) if kind_from_head(&head).is_none() => {
                    inspect_recording(path, &options).is_ok_and(|found| found.columns.iter().any(is_named))
                }
                Some((format, _)) => !matches!(format, RecordingFormat::Csv | RecordingFormat::Mcap),
                None => false,
            }
    }

    /// Returns the values of the last digits of the axes, m or rad; infinite if unknown.
    pub(in crate::files) fn resolutions(&self) -> &[f64] {
        &self.resolutions
    }
}

impl Read for RecordedPsec {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.line.position() == self.line.get_ref().len() as u64
            && let (Some(time), Some(first)) = (self.times.get(self.next), self.times.first())
        {
            let mut line = Vec::new();
            write!(line, "{}", time - first)?;
            for values in &self.positions {
                write!(line, ",{}", values.get(self.next).copied().unwrap_or(f64::NAN))?;
            }
            line.push(b'\n');
            self.line = Cursor::new(line);
            self.next += 1;
        }
        self.line.read(out)
    }
}

/// Returns true for findings on more than the columns of time and setpoints.
fn is_of_interest(finding: &Finding) -> bool {
    finding.severity > Severity::Note || finding.code == "unused-rate"
}

/// Axis of the machine with the column of its setpoints.
type AxisMapping<'a> = (&'a AxisConfig, Mapping);

/// Returns the mapping of time and format, and those of the axes.
fn mappings<'a>(axes: &'a [AxisConfig], texts: &[String]) -> Found<(Columns, Vec<AxisMapping<'a>>)> {
    const COMMON: [&str; 4] = ["time", "delimiter", "decimal_comma", "skip_lines"];
    let (mut common, mut mappings) = (Columns::default(), Vec::<AxisMapping<'a>>::new());
    for text in texts {
        let (key, value) = text.split_once('=').unwrap_or((text, ""));
        let (key, value) = (key.trim(), value.trim());
        if COMMON.contains(&key) {
            common.set(text, OPTION)?;
            continue;
        }
        let Some(axis) = axes.iter().find(|axis| axis.name == key) else {
            let known = || axes.iter().map(|axis| axis.name.as_str()).chain(COMMON);
            let reason = format!(
                "\"{}\" is no axis of the machine; a column of setpoints is AXIS=COLUMN[UNIT], for example x=#2[mm]; known are \
                 {}{}",
                shortened(key),
                known().collect::<Vec<_>>().join(", "),
                nearest_hint(&nearest_name(key, known()))
            );
            return Err(FileError::new(OPTION, reason));
        };
        if mappings.iter().any(|(other, _)| other.name == axis.name) {
            return Err(FileError::new(OPTION, format_args!("{key} is given twice")));
        }
        let (column, unit) = column_and_unit(value)
            .map_err(|reason| FileError::new(OPTION, format_args!("{key}={}: {reason}", shortened(value))))?;
        mappings.push((axis, mapping(column, unit, value)));
    }
    Ok((common, mappings))
}

fn mapping(column: Column, unit: Option<Unit>, text: &str) -> Mapping {
    Mapping { channel: Channel::Position, column, unit, text: text.to_owned(), at: OPTION.to_owned() }
}

/// Returns the columns of the commanded positions of all axes that the file names.
fn detected<'a>(
    name: &str,
    found: &RecordingColumns,
    axes: &'a [AxisConfig],
    findings: &mut Vec<Finding>,
) -> Found<Vec<AxisMapping<'a>>> {
    let mut mappings = Vec::new();
    for axis in axes {
        let Some(file_axis) = found.axis_of(&axis.name) else { continue };
        let is_psec = |column: &&FoundColumn| {
            column.channel == Some(Channel::Psec) && column.axis.as_deref() == Some(file_axis)
        };
        let columns: Vec<&FoundColumn> = found.columns.iter().filter(is_psec).collect();
        let [column] = columns.as_slice() else {
            if columns.is_empty() {
                continue;
            }
            let listed: Vec<String> =
                columns.iter().take(MAX_LISTED).map(|column| format!("#{}", column.number)).collect();
            let reason = format!(
                "columns {} all fit the setpoint of {1}: select one by {OPTION} {1}=#{2}",
                listed.join(", "),
                axis.name,
                columns.first().map_or(1, |column| column.number)
            );
            return Err(FileError::new(name, reason));
        };
        if column.unit.as_ref().is_some_and(ColumnUnit::is_assumed) {
            let unit = if axis.kind == AxisKind::Linear { "mm" } else { "deg" };
            let header = shortened(&column.header);
            let reason = format!(
                "the file does not state the unit of column {header}; give it by {OPTION} '{}={header}[{unit}]', and the columns \
                 of other axes likewise",
                axis.name
            );
            return Err(FileError::new(name, reason));
        }
        let factor = column.unit.as_ref().map(|unit| unit.factor(Channel::Psec, axis));
        let (Some(ColumnFactor::Value(factor)), Some((symbol, _))) =
            (factor, Channel::Psec.units(axis).first().copied())
        else {
            let unit = column.unit.as_ref().map_or_else(String::new, ToString::to_string);
            let reason = format!(
                "column {} has the unit {unit} of no {} axis; give it by {OPTION} '{}=#{}[mm]'",
                shortened(&column.header),
                axis.kind,
                axis.name,
                column.number
            );
            return Err(FileError::new(name, reason));
        };
        let what = format!("{name}: setpoints of {} from column {}", axis.name, shortened(&column.header));
        findings.push(Finding::note("detected-columns", what));
        let column = Column::Index(column.number.saturating_sub(1));
        mappings.push((axis, mapping(column, Some(Unit { factor, symbol }), "")));
    }
    if mappings.is_empty() {
        let headers: Vec<String> =
            found.columns.iter().take(MAX_LISTED).map(|column| shortened(&column.header)).collect();
        let axis = axes.first().map_or("x", |axis| axis.name.as_str());
        let reason = format!(
            "no column is known as the commanded position of an axis of the machine; there are {}: name the column of each \
             axis, for example by {OPTION} '{axis}=#2[mm]'",
            headers.join(", ")
        );
        return Err(FileError::new(name, reason));
    }
    Ok(mappings)
}

/// Returns the value of the last digit of decimal numbers, from the values `factor` times as large, in their unit.
fn resolution(values: &[f64], factor: f64) -> f64 {
    let has = |decimals: &i32| {
        let scale = 10_f64.powi(*decimals) / factor;
        let is_rounded =
            |value: &f64| !value.is_finite() || (value * scale - (value * scale).round()).abs() < ROUNDING;
        values.len() <= MAX_ROWS && values.iter().all(is_rounded)
    };
    DECIMALS.into_iter().find(has).map_or(0.0, |decimals| factor.abs() * 10_f64.powi(-decimals))
}
