//! Reading of the XML that the trace of Sinumerik Operate (Sinumerik 840D sl) exports.
//!
//! `traceSession/traceData/dataFrame` has a `dataSignal` for each signal, with its name, its sampling interval in s and its
//! id, and a `rec` for each time, with values under these ids. A value that does not change between two samples can be left
//! out, as can a `rec` without values: the samples of a signal are those of its interval. Sources: the export
//! `Tav23362_2140_frenata_15_4_26_EmgTest.xml` in <https://github.com/hailongchenn/sinumerik-trace-viewer>, and
//! `tracetools/tracetools.py` of <https://github.com/eliasrhoden/Trace-Tools> for the value of missing samples; names as in
//! [`sinumerik_signal`](super::sinumerik_signal).

use std::io::{BufReader, Read};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::assignment::ColumnAssignment;
use super::context::Context;
use super::format::{Found, MAX_ROWS, RecordingFormat};
use super::found_column::FoundColumn;
use super::line_counter::LineCounter;
use super::recording_builder::{ChannelValues, build_timed_recording};
use super::recording_columns::RecordingColumns;
use super::sinumerik_signal::trace_signal;
use super::trace_samples::TraceSamples;
use super::unit::Channel;
use crate::files::error::FileError;
use virtual_axes_core::encoding::TextReader;
use virtual_axes_core::text::shortened;
use virtual_axes_identify::recording::{Finding, RawRecording};

type Xml<R> = Reader<LineCounter<BufReader<R>>>;

/// Root element.
const ROOT: &str = "traceSession";
/// Maximum number of signals.
const MAX_SIGNALS: usize = 10_000;
/// Smallest value of a missing sample: the bits of infinity as an integer.
const MISSING: f64 = 9.218_868_437_227_4e18;

/// Maximum number of samples for each record, and independent of them: values that do not change are left out.
const SAMPLES_PER_RECORD: usize = 100;
const FREE_SAMPLES: usize = 100_000;

/// Returns true if a text file that begins with `head` has the format.
pub(super) fn detects(head: &str) -> bool {
    head.trim_start().starts_with('<') && head.contains(&format!("<{ROOT}"))
}

/// Lists the columns with their detected meanings. `name` is the name of the file.
pub(super) fn inspect(input: &mut dyn Read, name: &str) -> Found<RecordingColumns> {
    let mut frame = Frame::new(name, None);
    frame.read(input)?;
    Ok(RecordingColumns::new(RecordingFormat::SinumerikTrace, frame.columns, true))
}

/// Reads the recording of an axis with findings.
pub(super) fn read(input: &mut dyn Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let name = context.name;
    let mut frame = Frame::new(name, Some(*context));
    frame.read(input)?;
    let Frame { columns, assignment, samples, last_time, mut findings, rows, .. } = frame;
    let is_position = |index: usize| Channel::ALL.get(index) == Some(&Channel::Position);
    let position = samples.iter().find(|(index, ..)| is_position(*index)).map(|(.., samples)| samples);
    let limit = rows.saturating_mul(SAMPLES_PER_RECORD).saturating_add(FREE_SAMPLES).min(MAX_ROWS);
    let times = match position.map(|samples| samples.times(last_time, limit)) {
        Some(Ok(times)) => times,
        Some(Err(count)) => {
            let reason = format!(
                "{rows} rec and the interval of the position give {count:.1e} samples, more than {limit}; record with \
                 less time at rest"
            );
            return Err(frame_error(name, reason));
        }
        None => Vec::new(),
    };
    let Some(assignment) = assignment.filter(|_| !times.is_empty()) else {
        return Err(FileError::no_value(name, Channel::Position, 0));
    };
    let mut channels = ChannelValues::default();
    for (index, factor, samples) in &samples {
        if let Some(channel) = channels.get_mut(*index) {
            *channel = samples.values(&times).into_iter().map(|value| factor * value).collect();
        }
    }
    let columns = (&assignment, columns.as_slice());
    let recording = build_timed_recording(context, channels, columns, (times, "trace"), &mut findings)?;
    Ok((recording, findings))
}

/// Signal of a trace.
#[derive(Debug)]
struct TraceSignal {
    id: String,
    name: String,
    /// Sampling interval, s; 0 if unknown.
    interval: f64,
}

/// Frame of a trace: its signals, and the samples of the selected ones.
struct Frame<'a> {
    name: &'a str,
    signals: Vec<TraceSignal>,
    columns: Vec<FoundColumn>,
    /// Options; `None` to read the signals only.
    context: Option<Context<'a>>,
    assignment: Option<ColumnAssignment>,
    /// Samples with the index of their channel and the factor to SI.
    samples: Vec<(usize, f64, TraceSamples)>,
    last_time: f64,
    rows: usize,
    findings: Vec<Finding>,
}

fn frame_error(at: &str, reason: String) -> FileError {
    FileError::content(at, RecordingFormat::SinumerikTrace, reason)
}

impl<'a> Frame<'a> {
    fn new(name: &'a str, context: Option<Context<'a>>) -> Self {
        Frame {
            name,
            signals: Vec::new(),
            columns: Vec::new(),
            context,
            assignment: None,
            samples: Vec::new(),
            last_time: f64::NEG_INFINITY,
            rows: 0,
            findings: Vec::new(),
        }
    }

    fn error(&self, line: u64, reason: String) -> FileError {
        frame_error(&format!("{}:{line}", self.name), reason)
    }

    /// Reads the first frame of values.
    fn read(&mut self, input: impl Read) -> Found<()> {
        let mut xml: Xml<_> = Reader::from_reader(LineCounter::new(BufReader::new(TextReader::new(input))));
        let mut buffer = Vec::new();
        let mut depth = 0_usize;
        let mut frames = 0_usize;
        loop {
            buffer.clear();
            let event = xml.read_event_into(&mut buffer);
            let line = xml.get_ref().line();
            match event {
                Err(error) => return Err(self.error(line, shortened(&error.to_string()))),
                Ok(Event::Eof) if depth == 0 && frames > 0 => return self.finish(line),
                Ok(Event::Eof) if depth == 0 => {
                    return Err(self.error(line, "there is no traceData with a dataFrame".to_owned()));
                }
                Ok(Event::Eof) => return Err(self.error(line, "the file ends within the trace".to_owned())),
                Ok(Event::Start(element)) => {
                    frames += usize::from(element.local_name().as_ref() == "dataFrame");
                    if frames == 1 && self.element(&element, line)? {
                        return Ok(());
                    }
                    depth += 1;
                }
                Ok(Event::Empty(element)) if frames == 1 => {
                    if self.element(&element, line)? {
                        return Ok(());
                    }
                }
                Ok(Event::End(_)) => {
                    depth = depth.saturating_sub(1);
                    if frames > 1 {
                        let what = format!("{}: the trace has several frames; the first is read", self.name);
                        self.findings.push(Finding::warning(
                            "frames",
                            what,
                            "record one frame without restarts",
                        ));
                        return self.finish(line);
                    }
                }
                Ok(_) => {}
            }
        }
    }

    /// Adds an element of the frame; returns true if nothing more has to be read.
    fn element(&mut self, element: &BytesStart, line: u64) -> Found<bool> {
        match element.local_name().as_ref() {
            "frameHeader" => self.header(element, line)?,
            "dataSignal" => self.signal(element, line)?,
            "rec" => {
                self.finish(line)?;
                if self.context.is_none() {
                    return Ok(true);
                }
                self.record(element, line)?;
            }
            _ => {}
        }
        Ok(false)
    }

    /// Checks that there are signals, and assigns them.
    fn finish(&mut self, line: u64) -> Found<()> {
        if self.signals.is_empty() {
            return Err(self.error(line, "the dataFrame has no dataSignal".to_owned()));
        }
        self.assign(line)
    }

    fn header(&mut self, element: &BytesStart, line: u64) -> Found<()> {
        self.attributes(element, line, |frame, key, value| {
            if key == "dropOuts" && value.trim() != "0" {
                let what = format!("{}: the trace has {} dropouts", frame.name, shortened(value));
                frame.findings.push(Finding::warning("dropouts", what, "record fewer signals"));
            }
            Ok(())
        })
    }

    fn signal(&mut self, element: &BytesStart, line: u64) -> Found<()> {
        if self.assignment.is_some() || self.signals.len() == MAX_SIGNALS {
            return Err(self.error(line, "a dataSignal behind the first rec, or more than 10000".to_owned()));
        }
        let mut signal = TraceSignal { id: String::new(), name: String::new(), interval: 0.0 };
        self.attributes(element, line, |frame, key, value| {
            match key {
                "id" => value.clone_into(&mut signal.id),
                "name" => value.clone_into(&mut signal.name),
                "interval" => signal.interval = frame.number("interval", value, line)?,
                _ => {}
            }
            Ok(())
        })?;
        if signal.id.is_empty() || signal.name.is_empty() {
            return Err(self.error(line, "a dataSignal has no id or no name".to_owned()));
        }
        let number = self.signals.len() + 1;
        let column = trace_signal(number, &signal.name);
        self.columns.push(
            column.unwrap_or_else(|| FoundColumn::unknown(number, &signal.name, "no signal that is read")),
        );
        self.signals.push(signal);
        Ok(())
    }

    /// Assigns the signals to channels, once.
    fn assign(&mut self, line: u64) -> Found<()> {
        let (Some(context), None) = (self.context, &self.assignment) else { return Ok(()) };
        // The times are those of the trace.
        let untimed = Context { rate: Some(1.0), ..context };
        let at = || format!("{}:{line}", context.name);
        let assignment = untimed.assign_found(&self.columns, &at)?;
        for (signal, slot) in self.signals.iter().zip(&assignment.slots) {
            if let Some((index, factor)) = *slot {
                self.samples.push((index, factor, TraceSamples::new(signal.id.clone(), signal.interval)));
            }
        }
        self.assignment = Some(assignment);
        Ok(())
    }

    /// Adds the values of a time.
    fn record(&mut self, element: &BytesStart, line: u64) -> Found<()> {
        if self.rows == MAX_ROWS {
            return Err(FileError::too_long(format_args!("{}:{line}", self.name)));
        }
        let mut time = None;
        let mut values: Vec<(usize, f64)> = Vec::new();
        self.attributes(element, line, |frame, key, value| {
            if key == "time" {
                time = Some(frame.number("time", value, line)?);
                return Ok(());
            }
            let place = frame.samples.iter().position(|(.., samples)| samples.id() == key);
            if let Some(place) = place {
                let number = frame.number(key, value, line)?;
                values.push((place, if number >= MISSING { f64::NAN } else { number }));
            }
            Ok(())
        })?;
        let Some(time) = time else {
            return Err(self.error(line, "a rec has no time".to_owned()));
        };
        if time <= self.last_time {
            let before = self.last_time;
            return Err(
                self.error(line, format!("time is {time}, must be greater than {before} of the last rec"))
            );
        }
        for (place, value) in values {
            if let Some((.., samples)) = self.samples.get_mut(place) {
                samples.push(time, value);
            }
        }
        self.last_time = time;
        self.rows += 1;
        Ok(())
    }

    /// Calls `visit` for each attribute with its key and value.
    fn attributes(
        &mut self,
        element: &BytesStart,
        line: u64,
        mut visit: impl FnMut(&mut Self, &str, &str) -> Found<()>,
    ) -> Found<()> {
        for attribute in element.attributes() {
            let attribute = attribute.map_err(|error| self.error(line, shortened(&error.to_string())))?;
            visit(self, attribute.key.local_name().as_ref(), &attribute.value)?;
        }
        Ok(())
    }

    fn number(&self, key: &str, value: &str, line: u64) -> Found<f64> {
        let number = value.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| {
            let at = format_args!("{}:{line}", self.name);
            FileError::number(at, &shortened(key), &shortened(value), "a finite number", "")
        })
    }
}
