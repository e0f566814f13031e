//! Reading of the text that LinuxCNC's `halsampler` writes.
//!
//! A line has the values of the HAL pins in the order of the configuration string of `sampler`, separated by spaces, with
//! a space at the end; with the option `-t` the sample number comes first. `overrun` on a line of its own states that
//! samples were lost. There is neither header nor time. Sources: the manual page
//! <https://linuxcnc.org/docs/2.9/html/man/man1/halsampler.1.html>, and `src/hal/components/sampler_usr.c` and
//! `tests/limit3.1/expected` of <https://github.com/LinuxCNC/linuxcnc>.

use std::io::Read;

use super::error::{AxisRecordingError, MAX_ROWS};
use super::format::RecordingFormat;
use super::found_column::{ColumnUnit, FoundColumn};
use super::layout::{Context, next_line, parse_number};
use super::recording_builder::{ChannelValues, build_recording};
use super::unit::Channel;
use crate::files::lines::Lines;
use virtual_axes_core::text::shortened;
use virtual_axes_identify::recording::{Finding, RawRecording};

type Found<T> = Result<T, AxisRecordingError>;

/// Line that states lost samples.
const OVERRUN: &str = "overrun";
/// Number of lines that decide whether the first column is the sample number.
const TAGGED_LINES: usize = 3;

/// Returns true if the first line of values consists of at least two numbers separated by spaces.
pub(super) fn is_halsampler(text: &str) -> bool {
    let mut lines = text.lines().filter(|line| !line.trim().is_empty() && line.trim() != OVERRUN);
    lines.next().is_some_and(|line| {
        let is_number = |field: &str| parse_number(field, false).is_some_and(f64::is_finite);
        !line.contains('\t') && line.split_whitespace().count() > 1 && line.split_whitespace().all(is_number)
    })
}

/// Lines at the start of a file, and the meanings of its columns.
struct Head {
    lines: Vec<(u64, String)>,
    columns: Vec<FoundColumn>,
}

impl Head {
    fn read(lines: &mut Lines<impl Read>, name: &str) -> Found<Self> {
        let mut first: Vec<(u64, String)> = Vec::new();
        let mut rows = 0;
        while rows < TAGGED_LINES
            && let Some((line, text)) = next_line(lines, name)?
        {
            rows += usize::from(text.trim() != OVERRUN);
            first.push((line, text.to_owned()));
        }
        let values: Vec<&str> =
            first.iter().map(|(_, text)| text.trim()).filter(|text| *text != OVERRUN).collect();
        let Some(columns) = values.first().map(|text| text.split_whitespace().count()) else {
            return Err(AxisRecordingError::Empty { at: name.to_owned(), what: "the file is empty" });
        };
        let columns = describe(columns, is_tagged(&values));
        Ok(Head { lines: first, columns })
    }
}

/// Returns true if the first field counts the lines: integers that increase.
fn is_tagged(lines: &[&str]) -> bool {
    let numbers: Vec<Option<i64>> = lines
        .iter()
        .map(|line| line.split_whitespace().next().and_then(|field| field.parse().ok()))
        .collect();
    let is_next = |pair: &[Option<i64>]| match pair {
        [Some(before), Some(after)] => before.checked_add(1) == Some(*after),
        _ => false,
    };
    numbers.len() > 1 && numbers.windows(2).all(is_next)
}

fn describe(count: usize, is_tagged: bool) -> Vec<FoundColumn> {
    let pin = |number: usize| {
        let pin = number - 1 - usize::from(is_tagged);
        let reason = format!(
            "pin {pin} of the sampler; there is no header: select it by --column, for example 'position=#{number}[mm]'"
        );
        FoundColumn::unknown(number, &format!("#{number}"), &reason)
    };
    let mut columns: Vec<FoundColumn> = (1 + usize::from(is_tagged)..=count).map(pin).collect();
    if is_tagged {
        let mut tag = FoundColumn::unknown(1, "#1", "sample number (halsampler -t): it counts the lines");
        (tag.channel, tag.unit, tag.is_secondary) = (Some(Channel::Time), Some(ColumnUnit::samples()), true);
        columns.insert(0, tag);
    }
    columns
}

/// Returns the columns of a file.
pub(super) fn inspect(input: impl Read, name: &str) -> Found<Vec<FoundColumn>> {
    Ok(Head::read(&mut Lines::new(input), name)?.columns)
}

/// Reads the recording of an axis, whose columns are selected by number.
pub(super) fn read(input: impl Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let name = context.name;
    let factors = context.factors()?;
    let mut lines = Lines::new(input);
    let head = Head::read(&mut lines, name)?;
    let headers: Vec<String> = head.columns.iter().map(|column| column.header.clone()).collect();
    let line = head.lines.first().map_or(1, |(line, _)| *line);
    let assignment = context.assign(&headers, &head.columns, &|| format!("{name}:{line}"), &factors)?;
    let mut rows = Rows {
        name,
        slots: &assignment.slots,
        is_tagged: head.columns.first().is_some_and(|column| column.channel.is_some()),
        channels: ChannelValues::default(),
        count: 0,
        overruns: 0,
    };
    for (line, text) in &head.lines {
        rows.add(*line, text)?;
    }
    while let Some((line, text)) = next_line(&mut lines, name)? {
        rows.add(line, text)?;
    }
    let mut findings = Vec::new();
    if rows.overruns > 0 {
        let what = format!("{name}: samples are missing; lines with \"overrun\": {}", rows.overruns);
        findings.push(Finding::warning("overrun", what, "increase the depth of the FIFO of sampler"));
    }
    let Rows { channels, count, .. } = rows;
    let recording = build_recording(context, channels, (&assignment, &head.columns), count, &mut findings)?;
    Ok((recording, findings))
}

/// Values read so far.
struct Rows<'a> {
    name: &'a str,
    slots: &'a [Option<(usize, f64)>],
    is_tagged: bool,
    channels: ChannelValues,
    count: usize,
    overruns: usize,
}

impl Rows<'_> {
    fn add(&mut self, line: u64, text: &str) -> Found<()> {
        let at = || format!("{}:{line}", self.name);
        if text.trim() == OVERRUN {
            // The first overrun is that of the samples before the start of halsampler.
            if self.count > 0 && !self.is_tagged {
                let reason = "samples are missing at \"overrun\", and their number is unknown; record with the option \
                              -t of halsampler, or increase the depth of the FIFO of sampler";
                return Err(AxisRecordingError::Content {
                    at: at(),
                    format: RecordingFormat::Halsampler,
                    reason: reason.to_owned(),
                });
            }
            self.overruns += usize::from(self.count > 0);
            return Ok(());
        }
        if self.count == MAX_ROWS {
            return Err(AxisRecordingError::TooLong { at: at() });
        }
        let found = text.split_whitespace().count();
        if found != self.slots.len() {
            return Err(AxisRecordingError::Fields { at: at(), found, wanted: self.slots.len(), hint: "" });
        }
        let mut values = [f64::NAN; Channel::ALL.len()];
        for (column, (field, slot)) in text.split_whitespace().zip(self.slots).enumerate() {
            let Some((index, factor)) = *slot else { continue };
            let value = parse_number(field, false).filter(|value| value.is_finite() || index > 0);
            let (Some(value), Some(target)) = (value, values.get_mut(index)) else {
                return Err(AxisRecordingError::Number {
                    at: at(),
                    column: format!("#{}", column + 1),
                    found: shortened(field),
                    wanted: "a number",
                    hint: "",
                });
            };
            *target = factor * value;
        }
        for (channel, value) in self.channels.iter_mut().zip(values) {
            channel.push(value);
        }
        self.count += 1;
        Ok(())
    }
}
