//! Reading of a recording of one axis from MCAP: `DriveStates` or `JointState`, with `MotorCurrents`.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use mcap::McapError;

use super::format::{Found, MAX_ROWS};
use super::join::{TargetStamps, TimeSource};
use super::recording_builder::motor_position;
use super::series::{MessageKind, Row, Series};
use super::unit::Channel;
use crate::files::error::{FileError, shorten_names};
use crate::files::mcap_reader::{Completeness, check_chunks, parse_error, read_messages, type_of};
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::text::{nearest_hint, nearest_name};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Topics of a recording: all with their message types, and the relevant ones by kind.
#[derive(Debug, Default)]
struct Contents {
    relevant: BTreeMap<MessageKind, Vec<String>>,
    all: BTreeMap<String, String>,
}

/// Reads the recording of `joint`: of exactly this name if `is_full_name`, else also with a prefix. `topics` are topic
/// names or their prefixes; all topics if empty.
pub(super) fn read(
    mut input: impl Read + Seek,
    name: &str,
    axis: &AxisConfig,
    (joint, is_full_name): (&str, bool),
    topics: &[String],
) -> Found<(RawRecording, Vec<Finding>)> {
    let ending = check_chunks(&mut input, name)?;
    let is_end =
        |error: &McapError| ending == Completeness::Unfinished && matches!(error, McapError::UnexpectedEof);
    let mut reader = read_messages(input, name)?;
    let mut contents = Contents::default();
    for message in reader.by_ref() {
        let message = match message {
            Err(error) if is_end(&error) => break,
            message => message.map_err(|error| parse_error(name, &error))?,
        };
        contents.add(&message.channel.topic, type_of(&message));
    }
    let mut findings = Vec::new();
    if ending == Completeness::Unfinished {
        findings.push(Finding::warning(
            "unfinished",
            format!(
                "{name}: the recording is unfinished because its writer was terminated: the last second may be \
                 missing"
            ),
            "stop the recorder regularly, so that it finishes the file",
        ));
    }
    let mut selected = contents.choose(name, topics, &mut findings)?;
    let mut reader = read_messages(reader.into_inner().into_inner(), name)?;
    let mut rows = 0;
    for message in reader.by_ref() {
        let message = match message {
            Err(error) if is_end(&error) => break,
            message => message.map_err(|error| parse_error(name, &error))?,
        };
        let of = |series: &&mut Series| {
            series.topic == message.channel.topic && type_of(&message) == Some(series.kind.name())
        };
        if let Some(series) = selected.iter_mut().find(of) {
            rows += series.add(&message, name, joint, is_full_name)?;
        }
        if rows > MAX_ROWS {
            return Err(FileError::too_long(name));
        }
    }
    join_series(selected, name, axis, joint, &mut findings).map(|recording| (recording, findings))
}

impl Contents {
    fn add(&mut self, topic: &str, kind: Option<&str>) {
        if self.all.contains_key(topic) {
            return;
        }
        let name = kind.unwrap_or("no type");
        self.all.insert(topic.to_owned(), name.to_owned());
        if let Some(kind) = MessageKind::from_name(name) {
            self.relevant.entry(kind).or_default().push(topic.to_owned());
        }
    }

    /// Selects the series to read; the source of positions comes first.
    fn choose(mut self, name: &str, named: &[String], findings: &mut Vec<Finding>) -> Found<Vec<Series>> {
        for topics in self.relevant.values_mut() {
            topics.sort();
        }
        self.check_named(name, named)?;
        let one = |kind: MessageKind| -> Found<Option<Series>> {
            let topics = self.relevant.get(&kind).map_or(&[][..], Vec::as_slice);
            let chosen: Vec<&String> = topics
                .iter()
                .filter(|t| named.is_empty() || named.iter().any(|n| is_in_namespace(t, n)))
                .collect();
            match chosen.as_slice() {
                [] => Ok(None),
                [topic] => Ok(Some(Series::new(kind, topic))),
                topics => {
                    let reason = format!(
                        "several topics carry {}, {}: select one by its name or a prefix of it",
                        kind.name(),
                        shorten_names(topics.iter().copied()).join(", ")
                    );
                    Err(FileError::new(name, reason))
                }
            }
        };
        let currents = one(MessageKind::MotorCurrents)?;
        let drives = one(MessageKind::DriveStates)?;
        let mut chosen = match drives {
            Some(drives) => vec![drives],
            None => Vec::new(),
        };
        if chosen.is_empty() || currents.is_none() {
            chosen.extend(one(MessageKind::JointState)?);
        }
        if chosen.is_empty() {
            let found: Vec<String> =
                self.all.iter().map(|(topic, kind)| format!("{topic} ({kind})")).collect();
            let found = shorten_names(&found);
            let reason = format!(
                "there is no message of type {} or {}; there are {}",
                MessageKind::DriveStates.name(),
                MessageKind::JointState.name(),
                if found.is_empty() { "none at all".to_owned() } else { found.join(", ") }
            );
            return Err(FileError::new(name, reason));
        }
        if let (None, Some(topics)) = (&currents, self.relevant.get(&MessageKind::MotorCurrents)) {
            let what = format!("{name}: the motor currents on {} are not selected", topics.join(", "));
            findings.push(Finding::warning("unused-current", what, "select that topic, too"));
        }
        chosen.extend(currents);
        Ok(chosen)
    }

    /// Checks that each selected name is a relevant topic or a prefix of one.
    fn check_named(&self, name: &str, named: &[String]) -> Found<()> {
        let all = || self.relevant.values().flatten();
        for topic in named {
            if !all().any(|found| is_in_namespace(found, topic)) && all().next().is_some() {
                let reason = format!(
                    "no message of an axis on {topic}; there are some on {}{}",
                    shorten_names(all()).join(", "),
                    nearest_hint(&nearest_name(topic, all().map(String::as_str)))
                );
                return Err(FileError::new(name, reason));
            }
        }
        Ok(())
    }
}

/// Returns true if `topic` is `name` or in the namespace `name`.
fn is_in_namespace(topic: &str, name: &str) -> bool {
    let rest = topic.strip_prefix(name.trim_end_matches('/'));
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// Joins the series into one recording, in the log time order of the first.
fn join_series(
    mut series: Vec<Series>,
    name: &str,
    axis: &AxisConfig,
    joint: &str,
    findings: &mut Vec<Finding>,
) -> Found<RawRecording> {
    // Stamps that were never set are 0: log times are used.
    let source =
        if series.iter().any(|series| !series.is_stamped()) { TimeSource::Log } else { TimeSource::Stamp };
    let mut others = series.split_off(1);
    let Some(base) = series.pop() else { return Ok(RawRecording::default()) };
    let kind = base.kind;
    let (found, mut rows) = base.into_rows(name, joint, None)?;
    // Stable sort: messages of equal log time stay in file order.
    rows.sort_by_key(|row| row.log_time);
    let stamps: Vec<Nanoseconds> = rows.iter().map(|row| source.time_of(row)).collect();
    let mut recording = base_recording(name, kind, &rows, &stamps)?;
    if source == TimeSource::Log {
        let what = format!("{name}: the messages have no stamps: log times are used, with their jitter");
        findings.push(Finding::warning("no-stamps", what, "record messages with header.stamp"));
    }
    let stamps = TargetStamps::new(stamps, source);
    let current = others.iter().position(|series| series.kind == MessageKind::MotorCurrents);
    if let Some(index) = current {
        let series = others.swap_remove(index);
        let topic = format!("{name}: {}", series.topic);
        match series.into_rows(name, joint, Some(&found)) {
            Ok((_, rows)) => {
                let values = stamps.nearest_values(&rows, MessageKind::CURRENT, &topic, findings);
                recording.current = non_empty(values);
            }
            Err(error) => {
                findings.push(Finding::warning("no-current", error.to_string(), "record its motor current"));
            }
        }
        return Ok(recording);
    }
    let effort = if kind == MessageKind::JointState {
        channel(&rows, MessageKind::EFFORT)
    } else {
        others.pop().and_then(|series| {
            let topic = format!("{name}: {}", series.topic);
            let (_, rows) = series.into_rows(name, joint, Some(&found)).ok()?;
            non_empty(stamps.nearest_values(&rows, MessageKind::EFFORT, &topic, findings))
        })
    };
    if let Some(effort) = effort {
        recording.current = current_from_effort(effort, axis, name, findings);
    }
    Ok(recording)
}

/// Builds a recording from the messages with the positions; time starts at the first stamp.
fn base_recording(
    name: &str,
    kind: MessageKind,
    rows: &[Row],
    stamps: &[Nanoseconds],
) -> Found<RawRecording> {
    let first = stamps.first().copied().unwrap_or_default();
    let mut recording = RawRecording {
        name: name.to_owned(),
        time: stamps.iter().map(|stamp| seconds(stamp.saturating_sub(first))).collect(),
        position: channel(rows, MessageKind::POSITION),
        velocity: channel(rows, MessageKind::VELOCITY),
        ..RawRecording::default()
    };
    if kind == MessageKind::DriveStates {
        recording.psec = channel(rows, MessageKind::PSEC);
        recording.velocity_feedforward = channel(rows, MessageKind::VELOCITY_FEEDFORWARD);
        recording.torque_feedforward = channel(rows, MessageKind::TORQUE_FEEDFORWARD);
        let wind_up = channel(rows, MessageKind::WIND_UP);
        let both = recording.position.as_ref().zip(wind_up);
        recording.motor_position = both.and_then(|(load, wind_up)| motor_position(load, &wind_up));
    }
    if recording.position.is_none() {
        return Err(FileError::no_value(name, Channel::Position, rows.len()));
    }
    Ok(recording)
}

/// Returns the values at `index` of the rows, if there are any.
fn channel(rows: &[Row], index: usize) -> Option<Vec<f64>> {
    non_empty(rows.iter().map(|row| row.values[index]).collect())
}

/// Computes the motor current from the effort (`effort` = Kt·i/r), unless the effort was never set.
fn current_from_effort(
    effort: Vec<f64>,
    axis: &AxisConfig,
    name: &str,
    findings: &mut Vec<Finding>,
) -> Option<Vec<f64>> {
    if effort.iter().all(|effort| *effort == 0.0 || effort.is_nan()) {
        findings.push(Finding::warning(
            "no-current",
            format!("{name}: the recording has no motor currents, and the effort is always 0"),
            "record the motor current",
        ));
        return None;
    }
    let (ratio, constant) = (axis.transmission_ratio, axis.motor.torque_constant);
    findings.push(Finding::note(
        "current-of-effort",
        format!(
            "{name}: the recording has no motor currents: they are computed from the effort of the joint states with \
             {}.motor's torque constant {constant} (N·m/A or N/A) and the transmission ratio {ratio}",
            axis.name
        ),
    ));
    Some(effort.iter().map(|effort| effort * ratio / constant).collect())
}

/// Returns a channel, if it has values.
fn non_empty(values: Vec<f64>) -> Option<Vec<f64>> {
    values.iter().any(|value| !value.is_nan()).then_some(values)
}
