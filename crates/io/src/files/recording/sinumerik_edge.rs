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
use super::error::{AxisRecordingError, MAX_ROWS};
use super::format::RecordingFormat;
use super::found_column::FoundColumn;
use super::layout::Context;
use super::recording_builder::{ChannelValues, build_recording};
use super::sinumerik_signal::edge_signal;
use super::unit::Channel;
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::recording::{Finding, RawRecording};

type Found<T> = Result<T, AxisRecordingError>;

/// Key of the list of signals, by which the format is detected.
const SIGNALS: &str = "SignalListHFData";
/// Maximum number of signals.
const MAX_SIGNALS: usize = 10_000;

/// Returns true for JSON with a list of high-frequency signals.
pub(super) fn is_sinumerik_edge(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('{')
        && text.contains(&format!("\"{SIGNALS}\""))
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
    /// Error that is no syntax error.
    error: Option<AxisRecordingError>,
    /// True after the header if only the header is read.
    is_done: bool,
}

/// Returns the columns of a recording, and true if it states its period.
pub(super) fn inspect(input: impl Read, name: &str) -> Found<(Vec<FoundColumn>, bool)> {
    let mut document = Document::new(None);
    document.parse(input, name)?;
    Ok((document.columns, document.rate.is_some()))
}

/// Reads the recording of an axis.
pub(super) fn read(input: impl Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let mut document = Document::new(Some(*context));
    document.parse(input, context.name)?;
    let Document { columns, assignment, channels, rows, rate, .. } = document;
    if rows == 0 {
        let what = "there are no rows of HFData in the Payload";
        return Err(AxisRecordingError::Empty { at: context.name.to_owned(), what });
    }
    let mut findings = Vec::new();
    let context = Context { rate, ..*context };
    let recording = build_recording(&context, channels, (&assignment, &columns), rows, &mut findings)?;
    Ok((recording, findings))
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
            error: None,
            is_done: false,
        }
    }

    fn parse(&mut self, input: impl Read, name: &str) -> Found<()> {
        let mut json = serde_json::Deserializer::from_reader(BufReader::new(input));
        let outcome = json.deserialize_map(DocumentVisitor(self)).and_then(|()| json.end());
        let Err(error) = outcome else { return Ok(()) };
        if self.is_done {
            return Ok(());
        }
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        if error.is_io() {
            return Err(AxisRecordingError::Unreadable {
                at: name.to_owned(),
                reason: shortened(&error.to_string()),
            });
        }
        let text = error.to_string();
        let position = format!(" at line {} column {}", error.line(), error.column());
        let reason = shortened(text.strip_suffix(&position).unwrap_or(&text));
        let at = format!("{name}:{}", error.line());
        Err(AxisRecordingError::Content { at, format: RecordingFormat::SinumerikEdge, reason })
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
        self.rate = context.rate.or(header.rate());
        context.rate = self.rate;
        let headers: Vec<String> = self.columns.iter().map(|column| column.header.clone()).collect();
        let at = || context.name.to_owned();
        let assigned =
            context.factors().and_then(|factors| context.assign(&headers, &self.columns, &at, &factors));
        match assigned {
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

/// Visitor of the whole document.
struct DocumentVisitor<'s, 'a>(&'s mut Document<'a>);

impl<'de> Visitor<'de> for DocumentVisitor<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object with Header and Payload")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut has_header = false;
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "Header" if has_header => return Err(A::Error::custom("there are two Headers")),
                "Header" => {
                    let header: EdgeHeader = map.next_value()?;
                    self.0.set_header(&header).map_err(A::Error::custom)?;
                    has_header = true;
                }
                "Payload" if has_header => map.next_value_seed(Payload(&mut *self.0))?,
                "Payload" => return Err(A::Error::custom("the Payload is in front of the Header")),
                _ => _ = map.next_value::<IgnoredAny>()?,
            }
        }
        if !has_header {
            return Err(A::Error::custom("there is no Header with SignalListHFData"));
        }
        Ok(())
    }
}

/// List of data and events.
struct Payload<'s, 'a>(&'s mut Document<'a>);

/// Item of the list: an object whose `HFData` are rows.
struct PayloadItem<'s, 'a>(&'s mut Document<'a>);

/// Rows of values.
struct HighFrequencyRows<'s, 'a>(&'s mut Document<'a>);

impl<'de> DeserializeSeed<'de> for Payload<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Payload<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of objects as Payload")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<(), A::Error> {
        while items.next_element_seed(PayloadItem(&mut *self.0))?.is_some() {}
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for PayloadItem<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for PayloadItem<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object in the Payload")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "HFData" => map.next_value_seed(HighFrequencyRows(&mut *self.0))?,
                _ => _ = map.next_value::<IgnoredAny>()?,
            }
        }
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for HighFrequencyRows<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for HighFrequencyRows<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("rows of numbers as HFData")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<(), A::Error> {
        while let Some(row) = rows.next_element::<Vec<Option<f64>>>()? {
            self.0.add(&row).map_err(A::Error::custom)?;
        }
        Ok(())
    }
}
