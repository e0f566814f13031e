//! Reading of high-frequency data of Sinumerik Edge (Capture, Analyze MyWorkpiece, Data Recorder) from JSON.
//!
//! `Header.SignalListHFData` lists the columns with `Address` (`DES_POS|1`) and `Axis` (`X1`), `Header.CycleTimeMs` is the
//! period of the rows, and the `HFData` of each item of `Payload` are rows of values; other items are events. Sources:
//! the recording `example/example_data_ff429d74-6482-4d4f-80e1-31419d9bd56c.json` of
//! <https://github.com/max-scw/CaptureDataParser>; names and units as in [`sinumerik_signal`](super::sinumerik_signal).

use std::fmt;
use std::io::{BufReader, Read};

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::assignment::ColumnAssignment;
use super::context::Context;
use super::format::{Found, MAX_ROWS, RecordingFormat};
use super::found_column::FoundColumn;
use super::recording_builder::{ChannelValues, build_recording};
use super::recording_columns::RecordingColumns;
use super::sinumerik_signal::edge_signal;
use super::unit::Channel;
use crate::files::error::FileError;
use virtual_axes_core::encoding::TextReader;
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::{MILLISECOND, Rounded};
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Key of the list of signals, by which the format is detected.
const SIGNALS: &str = "SignalListHFData";
/// Maximum number of signals.
const MAX_SIGNALS: usize = 10_000;
/// Relative difference of equal sampling rates.
const SAME_RATE: f64 = 1e-6;

/// Returns true if a text file that begins with `head` has the format.
pub(super) fn detects(head: &str) -> bool {
    head.trim_start().starts_with('{') && head.contains(&format!("\"{SIGNALS}\""))
}

/// Lists the columns with their detected meanings. `name` is the name of the file.
pub(super) fn inspect(input: &mut dyn Read, name: &str) -> Found<RecordingColumns> {
    let mut document = Document::new(None);
    document.parse(input, name)?;
    let is_periodic = document.rate.is_some();
    Ok(RecordingColumns::new(RecordingFormat::SinumerikEdge, document.columns, is_periodic))
}

/// Reads the recording of an axis with findings.
pub(super) fn read(input: &mut dyn Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let mut document = Document::new(Some(*context));
    document.parse(input, context.name)?;
    let Document { columns, assignment, channels, rows, rate, file_rate, .. } = document;
    if rows == 0 {
        return Err(FileError::new(context.name, "there are no rows of HFData in the Payload"));
    }
    let mut findings = Vec::new();
    if let (Some(given), Some(stated)) = (context.rate, file_rate)
        && (given / stated - 1.0).abs() > SAME_RATE
    {
        findings.push(Finding::warning(
            "rate-differs",
            format!(
                "{}: the {} Hz of --rate-hz replace the {} Hz of CycleTimeMs in the file",
                context.name,
                Rounded(given),
                Rounded(stated)
            ),
            "leave out --rate-hz for the rate of the file",
        ));
    }
    let context = Context { rate, ..*context };
    let recording = build_recording(&context, channels, (&assignment, &columns), rows, &mut findings)?;
    Ok((recording, findings))
}

/// Header of a recording.
#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct EdgeHeader {
    #[serde(rename = "SignalListHFData")]
    signals: Vec<EdgeSignal>,
    #[serde(default)]
    cycle_time_ms: Option<f64>,
}

/// Column of the high-frequency data.
#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct EdgeSignal {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    axis: Option<String>,
    #[serde(default)]
    address: Option<String>,
}

impl EdgeHeader {
    fn columns(&self) -> Vec<FoundColumn> {
        self.signals.iter().zip(1..).map(|(signal, number)| signal.column(number)).collect()
    }

    /// Returns the number of rows per second.
    fn rate(&self) -> Option<f64> {
        let period = self.cycle_time_ms? * MILLISECOND;
        (period.is_finite() && period > 0.0).then(|| 1.0 / period)
    }
}

impl EdgeSignal {
    fn column(&self, number: usize) -> FoundColumn {
        let address = self.address.as_deref().or(self.name.as_deref()).unwrap_or_default();
        let mut column = edge_signal(number, address)
            .unwrap_or_else(|| FoundColumn::unknown(number, address, "no signal that is read"));
        let name = self.axis.as_deref().map(str::trim).filter(|name| !name.is_empty());
        if let (Some(axis), Some(name)) = (&column.axis, name) {
            (column.axis, column.axis_number) = (Some(name.to_owned()), Some(axis.clone()));
        }
        column
    }
}

/// State of reading a document.
struct Document<'a> {
    /// Axis and options; `None` to read the header only.
    context: Option<Context<'a>>,
    columns: Vec<FoundColumn>,
    assignment: ColumnAssignment,
    channels: ChannelValues,
    rows: usize,
    rate: Option<f64>,
    /// Rate that the file states.
    file_rate: Option<f64>,
    /// Error that is no syntax error.
    error: Option<FileError>,
    /// True after the header if only the header is read.
    is_done: bool,
}

impl<'a> Document<'a> {
    fn new(context: Option<Context<'a>>) -> Self {
        Document {
            context,
            columns: Vec::new(),
            assignment: ColumnAssignment::default(),
            channels: ChannelValues::default(),
            rows: 0,
            rate: None,
            file_rate: None,
            error: None,
            is_done: false,
        }
    }

    fn parse(&mut self, input: impl Read, name: &str) -> Found<()> {
        let mut json = serde_json::Deserializer::from_reader(BufReader::new(TextReader::new(input)));
        let outcome =
            json.deserialize_map(Node { document: self, level: Level::Document }).and_then(|()| json.end());
        let Err(error) = outcome else { return Ok(()) };
        if self.is_done {
            return Ok(());
        }
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        if error.is_io() {
            return Err(FileError::new(name, shortened(&error.to_string())));
        }
        let text = error.to_string();
        let position = format!(" at line {} column {}", error.line(), error.column());
        let reason = shortened(text.strip_suffix(&position).unwrap_or(&text));
        let at = format!("{name}:{}", error.line());
        Err(FileError::content(at, RecordingFormat::SinumerikEdge, reason))
    }

    /// Assigns the columns of the header to channels.
    fn set_header(&mut self, header: &EdgeHeader) -> Result<(), &'static str> {
        if header.signals.len() > MAX_SIGNALS {
            return Err("the header has more than 10000 signals");
        }
        self.columns = header.columns();
        let Some(mut context) = self.context else {
            self.rate = header.rate();
            self.is_done = true;
            return Err("only the header is read");
        };
        self.file_rate = header.rate();
        self.rate = context.rate.or(self.file_rate);
        context.rate = self.rate;
        match context.assign_found(&self.columns, &|| context.name.to_owned()) {
            Ok(assignment) => self.assignment = assignment,
            Err(error) => {
                self.error = Some(error);
                return Err("the columns cannot be assigned");
            }
        }
        Ok(())
    }

    fn add(&mut self, row: &[Option<f64>]) -> Result<(), String> {
        if self.rows == MAX_ROWS {
            return Err(format!("more than {MAX_ROWS} samples; split the recording"));
        }
        if row.len() != self.columns.len() {
            return Err(format!("a row has {} values, the header {} signals", row.len(), self.columns.len()));
        }
        let mut values = [f64::NAN; Channel::ALL.len()];
        for (slot, value) in self.assignment.slots.iter().zip(row) {
            let (Some((index, factor)), Some(value)) = (*slot, *value) else { continue };
            if let Some(target) = values.get_mut(index) {
                *target = factor * value;
            }
        }
        let is_timed = self.assignment.column_of(0).is_some();
        if is_timed && values.first().is_some_and(|time| time.is_nan()) {
            return Err("a row has no cycle number, must be a number".to_owned());
        }
        for (channel, value) in self.channels.iter_mut().zip(values) {
            channel.push(value);
        }
        self.rows += 1;
        Ok(())
    }
}

/// Part of the document.
#[derive(Clone, Copy)]
enum Level {
    Document,
    Payload,
    Item,
    Rows,
}

/// Visitor of a part of the document.
struct Node<'s, 'a> {
    document: &'s mut Document<'a>,
    level: Level,
}

impl<'de> DeserializeSeed<'de> for Node<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        match self.level {
            Level::Document | Level::Item => deserializer.deserialize_map(self),
            Level::Payload | Level::Rows => deserializer.deserialize_seq(self),
        }
    }
}

impl<'de> Visitor<'de> for Node<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self.level {
            Level::Document => "an object with Header and Payload",
            Level::Payload => "a list of objects as Payload",
            Level::Item => "an object in the Payload",
            Level::Rows => "rows of numbers as HFData",
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Node { document, level } = self;
        let mut has_header = false;
        while let Some(key) = map.next_key::<String>()? {
            match (level, key.as_str()) {
                (Level::Document, "Header") if has_header => {
                    return Err(A::Error::custom("there are two Headers"));
                }
                (Level::Document, "Header") => {
                    let header: EdgeHeader = map.next_value()?;
                    document.set_header(&header).map_err(A::Error::custom)?;
                    has_header = true;
                }
                (Level::Document, "Payload") if has_header => {
                    map.next_value_seed(Node { document: &mut *document, level: Level::Payload })?;
                }
                (Level::Document, "Payload") => {
                    return Err(A::Error::custom("the Payload is in front of the Header"));
                }
                (Level::Item, "HFData") => {
                    map.next_value_seed(Node { document: &mut *document, level: Level::Rows })?;
                }
                _ => _ = map.next_value::<IgnoredAny>()?,
            }
        }
        if matches!(level, Level::Document) && !has_header {
            return Err(A::Error::custom("there is no Header with SignalListHFData"));
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<(), A::Error> {
        let Node { document, level } = self;
        if matches!(level, Level::Payload) {
            while items.next_element_seed(Node { document: &mut *document, level: Level::Item })?.is_some() {}
            return Ok(());
        }
        while let Some(row) = items.next_element::<Vec<Option<f64>>>()? {
            document.add(&row).map_err(A::Error::custom)?;
        }
        Ok(())
    }
}
