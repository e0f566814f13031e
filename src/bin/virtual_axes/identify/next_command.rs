//! Next command of the list of columns: it runs on these recordings as it is printed.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::{MachineConfig, Periods};
use virtual_axes_core::text::escaped;
use virtual_axes_identify::recording::StatedValues;
use virtual_axes_io::files::{Channel, RecordingColumns, RecordingFormat};

use crate::identify::axes::moving_axes;
use crate::identify::recordings::{self, RecordingArguments};
use crate::identify::selection::{self, SelectedAxis};

/// Sampling rates, Hz, of a file that states none: the first at which the motion is plausible is the example.
const EXAMPLE_RATES: [f64; 4] = [500.0, 250.0, 100.0, 50.0];
/// Largest number of corrected options.
const CORRECTIONS: usize = 8;

/// Recordings with their columns and the machine that they are read for.
pub struct Listed<'a> {
    /// Recordings for the rigid axis, and with both encoders.
    pub recordings: (&'a [PathBuf], &'a [PathBuf]),
    /// Columns of each recording.
    pub columns: Vec<RecordingColumns>,
    /// Options of reading.
    pub reading: &'a RecordingArguments,
    /// Machine.
    pub config: &'a MachineConfig,
    /// Options of the command that name the machine.
    pub machine: Vec<String>,
    /// Returns the values of an axis that the user has stated.
    pub stated: &'a dyn Fn(&str) -> StatedValues,
}

/// Axes with equal options.
struct AxisGroup {
    axes: Vec<SelectedAxis>,
    /// Words of the options of reading.
    options: Vec<String>,
}

impl Listed<'_> {
    /// Returns the lines with the next command; `named` are the axes of the machine that the columns name.
    ///
    /// # Errors
    /// Returns an error if a recording cannot be read.
    pub fn lines(&self, named: Vec<SelectedAxis>) -> Result<Vec<String>, Box<dyn Error>> {
        let (mut lines, mut groups, mut failures) =
            (Vec::new(), Vec::<AxisGroup>::new(), Vec::<String>::new());
        let axes = self.candidates(named, &mut lines);
        let is_several = axes.len() > 1;
        let axes = match moving_axes(axes.clone(), &self.files(), self.reading, self.config) {
            Ok((moving, _)) => moving,
            Err(_) => axes,
        };
        let (count, mut rate) = (axes.len(), None);
        for tried in self.rates() {
            (rate, failures) = (tried, Vec::new());
            for axis in &axes {
                match self.readable(axis, rate) {
                    Ok(options) => match groups.iter_mut().find(|group| group.options == options) {
                        Some(group) => group.axes.push(axis.clone()),
                        None => groups.push(AxisGroup { axes: vec![axis.clone()], options }),
                    },
                    Err(error) => failures.push(format!("{} is not readable: {error}", axis.name)),
                }
            }
            if !groups.is_empty() {
                break;
            }
        }
        if groups.is_empty() {
            lines.extend(failures);
            return Ok(lines);
        }
        if let Some(rate) = rate {
            lines.push(format!(
                "the sampling rate is not in the file: {rate} Hz is an example, give that of the recording"
            ));
        }
        groups.sort_by_key(|group| std::cmp::Reverse(group.axes.len()));
        let is_mcap = self.columns.iter().any(|found| found.format == RecordingFormat::Mcap);
        for (k, group) in groups.iter().enumerate() {
            let has_joint = group.axes.iter().any(|axis| axis.joint.is_some());
            let is_all = group.axes.len() == count && is_several && !has_joint && !is_mcap;
            let start = if k == 0 { "next" } else { "and" };
            lines.push(format!("{start}: {}", self.command(group, is_all, k)));
        }
        if let [AxisGroup { axes, .. }] = groups.as_slice()
            && let [_, _, ..] = axes.as_slice()
        {
            let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            lines.push(format!("or one axis: --axis {}", names.join(", --axis ")));
        }
        lines.extend(failures);
        Ok(lines)
    }

    fn files(&self) -> Vec<PathBuf> {
        self.recordings.0.iter().chain(self.recordings.1).cloned().collect()
    }

    /// Returns the axes to try: those that the columns name, otherwise the first of the machine for the first of the file,
    /// and for messages all.
    fn candidates(&self, named: Vec<SelectedAxis>, lines: &mut Vec<String>) -> Vec<SelectedAxis> {
        let of = |name: &str, joint: Option<&str>| SelectedAxis {
            name: name.to_owned(),
            joint: joint.map(str::to_owned),
        };
        let given = self.reading.joint();
        let first = self.config.axes().first().map_or("", |axis| axis.name());
        if given.is_some() || !matches!(self.reading.single_axis_option(), Ok(None)) {
            let name = named.first().map_or(first, |axis| axis.name.as_str());
            return vec![of(name, given)];
        }
        if self.columns.iter().any(|found| found.format == RecordingFormat::Mcap) {
            return self.config.axes().iter().map(|axis| of(axis.name(), None)).collect();
        }
        if !named.is_empty() {
            return named;
        }
        let has_position = |found: &RecordingColumns| {
            found.columns.iter().any(|column| column.channel == Some(Channel::Position))
        };
        if !self.columns.iter().all(has_position) {
            return Vec::new();
        }
        let axes = self.columns.first().map(RecordingColumns::readable_axes).unwrap_or_default();
        let joint = axes.first().map(String::as_str);
        lines.push(match joint {
            Some(joint) => format!(
                "axis {} of the file is taken for {first} of the machine: give the name of the machine's axis by --axis, and that \
                 of the file ({}) by --joint",
                escaped(joint),
                escaped(&axes.join(", "))
            ),
            None => format!("the file names no axis: {first} of the machine is assumed, give another by --axis"),
        });
        vec![of(first, joint)]
    }

    /// Returns the sampling rates to try: none unless the recordings lack it.
    fn rates(&self) -> Vec<Option<f64>> {
        let lacks_time =
            |found: &RecordingColumns| found.format != RecordingFormat::Mcap && !found.has_time();
        match self.columns.iter().any(lacks_time) && !self.reading.has_rate() {
            true => EXAMPLE_RATES.map(Some).to_vec(),
            false => vec![None],
        }
    }

    /// Returns the options with which the recordings of an axis are plausible. Errors of reading name the option that
    /// corrects a unit.
    fn readable(&self, axis: &SelectedAxis, rate: Option<f64>) -> Result<Vec<String>, String> {
        let found = self.config.axes().iter().find(|known| known.name() == axis.name);
        let found = found.ok_or_else(|| "the machine has no such axis".to_owned())?;
        let of_axis: (_, &Periods, _) = (found, &self.config.periods(), (self.stated)(&axis.name));
        let skipped = self.columns.iter().find_map(|columns| columns.header_line);
        let skipped = skipped.filter(|_| !self.reading.maps("skip_lines"));
        let mut columns: Vec<String> =
            skipped.map(|line| format!("skip_lines={}", line.saturating_sub(1))).into_iter().collect();
        let (mut is_shifted, mut corrections) = (false, 0);
        loop {
            let reading = self.reading.with_joint(axis.joint.as_deref()).with_additions(&columns, rate);
            let reading = if is_shifted { reading.with_psec_shift() } else { reading };
            let options = reading.options().map_err(|error| error.to_string())?;
            let read = |path: &PathBuf| recordings::read(path, of_axis, (&reading, &options), None).map(drop);
            let both = |path: &PathBuf| {
                recordings::read_both_encoders(path, of_axis, (&reading, &options)).map(drop)
            };
            let (rigid, transmission) = self.recordings;
            let result =
                rigid.iter().try_for_each(read).and_then(|()| transmission.iter().try_for_each(both));
            let Err(error) = result else {
                return Ok(reading.words());
            };
            let error = error.to_string();
            corrections += 1;
            if corrections > CORRECTIONS {
                return Err(error);
            }
            match correction(&error) {
                Some(Correction::Unit(column))
                    if !self.reading.maps(channel_of(&column)) && !columns.contains(&column) =>
                {
                    columns.retain(|known| channel_of(known) != channel_of(&column));
                    columns.push(column);
                }
                Some(Correction::Shift) if !is_shifted => is_shifted = true,
                _ => return Err(error),
            }
        }
    }

    /// Returns the command for a group of axes; `number` counts the groups.
    fn command(&self, group: &AxisGroup, is_all: bool, number: usize) -> String {
        let mut words = vec!["virtual_axes".to_owned(), "identify".to_owned()];
        let (rigid, transmission) = self.recordings;
        words.extend(rigid.iter().map(|path| path.display().to_string()));
        for path in transmission {
            words.extend(["--transmission".to_owned(), path.display().to_string()]);
        }
        let joined = |of: &dyn Fn(&SelectedAxis) -> Option<String>| -> String {
            group.axes.iter().filter_map(of).collect::<Vec<_>>().join(",")
        };
        let names = joined(&|axis| Some(axis.name.clone()));
        words.extend(["--axis".to_owned(), if is_all { selection::ALL.to_owned() } else { names }]);
        let joints = joined(&|axis| axis.joint.clone());
        if !joints.is_empty() {
            words.extend(["--joint".to_owned(), joints]);
        }
        words.extend(group.options.iter().cloned());
        words.extend(self.machine.iter().cloned());
        let suffix = if number == 0 { String::new() } else { format!("_{}", number + 1) };
        words.extend(["--out".to_owned(), format!("identified{suffix}.yaml")]);
        words.extend(["--report".to_owned(), format!("identified{suffix}.html")]);
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }
}

/// Option that corrects a rejected recording.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Correction {
    /// Unit of a column: `position=[mm]`.
    Unit(String),
    /// Setpoint that is moved forward.
    Shift,
}

/// Returns true if an error names the unit of a column without a mapping: the printed command has it.
pub fn is_corrected(error: &str, reading: &RecordingArguments) -> bool {
    matches!(correction(error), Some(Correction::Unit(column)) if !reading.maps(channel_of(&column)))
}

/// Returns the channel of a column mapping.
fn channel_of(column: &str) -> &str {
    column.split('=').next().unwrap_or_default()
}

/// Returns the option that an error names as its remedy.
fn correction(error: &str) -> Option<Correction> {
    if let Some((_, rest)) = error.split_once("--column ")
        && let Some((channel, rest)) = rest.split_once("=COLUMN[")
        && let Some((unit, _)) = rest.split_once(']')
        && unit != "UNIT"
    {
        return Some(Correction::Unit(format!("{channel}=[{unit}]")));
    }
    error.contains("--psec-shift auto").then_some(Correction::Shift)
}

/// Returns a word of a command line, in quotation marks if a shell requires them.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_./:=,+-@%".contains(c);
    let word = escaped(word).to_string();
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word,
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_their_correction() {
        let unit = |text: &str| Some(Correction::Unit(text.to_owned()));
        let error = "a.csv: the position covers 300 m; it is likely in mm; give --column position=COLUMN[mm]";
        assert_eq!(correction(error), unit("position=[mm]"));
        let error = "the position is likely in mm; give --column position=COLUMN[mm], or time=COLUMN[s] if the time is in s";
        assert_eq!(correction(error), unit("position=[mm]"));
        assert_eq!(correction("give the unit by --column 'position=COLUMN[UNIT]'"), None);
        assert_eq!(correction("--psec-shift auto moves PSEC by this lag"), Some(Correction::Shift));
    }

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!(quoted("trace_1.csv"), "trace_1.csv");
        assert_eq!(quoted("position=[mm]"), "'position=[mm]'");
        assert_eq!(quoted("it's here.csv"), r"'it'\''s here.csv'");
        assert_eq!(quoted(""), "''");
    }
}
