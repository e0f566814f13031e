//! Reading of the text that LinuxCNC's `halsampler` writes.
//!
//! A line has the values of the HAL pins in the order of the configuration string of `sampler`, separated by spaces, with
//! a space at the end; with the option `-t` the sample number comes first. `overrun` on a line of its own states that
//! samples were lost. There is neither header nor time. Sources: the manual page
//! <https://linuxcnc.org/docs/2.9/html/man/man1/halsampler.1.html>, and `src/hal/components/sampler_usr.c` and
//! `tests/limit3.1/expected` of <https://github.com/LinuxCNC/linuxcnc>.

use std::io::Read;

use super::context::Context;
use super::format::{Found, MAX_ROWS, RecordingFormat};
use super::found_column::{ColumnUnit, FoundColumn, UnitSource};
use super::layout::{next_line, parse_number};
use super::recording_builder::{ChannelValues, build_recording};
use super::recording_columns::RecordingColumns;
use super::unit::Channel;
use crate::files::error::FileError;
use crate::files::lines::Lines;
use virtual_axes_core::text::shortened;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Line that states lost samples.
const OVERRUN: &str = "overrun";
/// Number of lines that decide whether the first column is the sample number.
const TAGGED_LINES: usize = 3;

/// Returns true if a text file that begins with `head` has the format.
pub(super) fn detects(head: &str) -> bool {
    let mut lines = head.lines().filter(|line| !line.trim().is_empty() && line.trim() != OVERRUN);
    lines.next().is_some_and(|line| {
        let is_number = |field: &str| parse_number(field, false).is_some_and(f64::is_finite);
        !line.contains('\t') && line.split_whitespace().count() > 1 && line.split_whitespace().all(is_number)
    })
}

/// Lists the columns with their detected meanings. `name` is the name of the file.
pub(super) fn inspect(input: &mut dyn Read, name: &str) -> Found<RecordingColumns> {
    let columns = Head::read(&mut Lines::new(input), name)?.columns;
    Ok(RecordingColumns::new(RecordingFormat::Halsampler, columns, false))
}

/// Reads the recording of an axis with findings.
pub(super) fn read(input: &mut dyn Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let name = context.name;
    let mut lines = Lines::new(input);
    let head = Head::read(&mut lines, name)?;
    let line = head.lines.first().map_or(1, |(line, _)| *line);
    let assignment = context.assign_found(&head.columns, &|| format!("{name}:{line}"))?;
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
            return Err(FileError::new(name, "the file is empty"));
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
        (tag.channel, tag.unit, tag.is_secondary) =
            (Some(Channel::Time), Some(ColumnUnit(UnitSource::Samples)), true);
        columns.insert(0, tag);
    }
    columns
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
                return Err(FileError::content(at(), RecordingFormat::Halsampler, reason));
            }
            self.overruns += usize::from(self.count > 0);
            return Ok(());
        }
        if self.count == MAX_ROWS {
            return Err(FileError::too_long(at()));
        }
        let found = text.split_whitespace().count();
        if found != self.slots.len() {
            return Err(FileError::fields(at(), found, self.slots.len(), ""));
        }
        let mut values = [f64::NAN; Channel::ALL.len()];
        for (column, (field, slot)) in text.split_whitespace().zip(self.slots).enumerate() {
            let Some((index, factor)) = *slot else { continue };
            let value = parse_number(field, false).filter(|value| value.is_finite() || index > 0);
            let (Some(value), Some(target)) = (value, values.get_mut(index)) else {
                let column = format!("#{}", column + 1);
                return Err(FileError::number(at(), &column, &shortened(field), "a number", ""));
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
