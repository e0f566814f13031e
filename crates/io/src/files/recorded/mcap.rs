//! One axis from an MCAP recording: `DriveStates` or `JointState`, with `MotorCurrents`.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use mcap::McapError;

use super::error::AxisRecordingError;
use super::join::{Clock, Times, put};
use super::series::{Kind, Row, Series};
use crate::files::mcap_in::{Ending, check_chunks, damaged, start, type_of};
use crate::files::listed;
use virtual_axes_core::text::nearest_name;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_identify::recording::{Finding, RawRecording};

type Found<T> = Result<T, AxisRecordingError>;

/// The topics with messages, each with how the message is called; those of use by their kinds.
#[derive(Debug, Default)]
struct Contents {
    of_use: BTreeMap<Kind, Vec<String>>,
    all: BTreeMap<String, String>,
}

/// Reads `joint` (exactly that one if it `is_whole`, else also behind a prefix); `topics` are names of
/// topics, or what they begin with, and all if there are none.
pub(super) fn read(
    mut input: impl Read + Seek,
    name: &str,
    axis: &AxisConfig,
    (joint, is_whole): (&str, bool),
    topics: &[String],
) -> Found<(RawRecording, Vec<Finding>)> {
    let ending = check_chunks(&mut input, name)?;
    let is_end =
        |error: &McapError| ending == Ending::Unfinished && matches!(error, McapError::UnexpectedEof);
    let mut reader = start(input, name)?;
    let mut contents = Contents::default();
    for message in reader.by_ref() {
        let message = match message {
            Err(error) if is_end(&error) => break,
            message => message.map_err(|error| damaged(name, &error))?,
        };
        contents.add(&message.channel.topic, type_of(&message));
    }
    let mut findings = Vec::new();
    if ending == Ending::Unfinished {
        findings.push(Finding::warning(
            "unfinished",
            format!(
                "{name}: it has no end, its writer was killed: what it holds is read, the last second may be \
                 missing"
            ),
            "let the recorder finish",
        ));
    }
    let mut wanted = contents.choose(name, topics, &mut findings)?;
    let mut reader = start(reader.into_inner().into_inner(), name)?;
    let mut rows = 0;
    for message in reader.by_ref() {
        let message = match message {
            Err(error) if is_end(&error) => break,
            message => message.map_err(|error| damaged(name, &error))?,
        };
        let of = |series: &&mut Series| {
            series.topic == message.channel.topic && type_of(&message) == Some(series.kind.name())
        };
        if let Some(series) = wanted.iter_mut().find(of) {
            rows += series.add(&message, name, joint, is_whole)?;
        }
        if rows > super::csv::MOST_ROWS {
            return Err(AxisRecordingError::TooLong { at: name.to_owned() });
        }
    }
    joined(wanted, name, axis, joint, &mut findings).map(|recording| (recording, findings))
}

impl Contents {
    fn add(&mut self, topic: &str, kind: Option<&str>) {
        if self.all.contains_key(topic) {
            return;
        }
        let name = kind.unwrap_or("no type");
        self.all.insert(topic.to_owned(), name.to_owned());
        if let Some(kind) = Kind::named(name) {
            self.of_use.entry(kind).or_default().push(topic.to_owned());
        }
    }

    /// The series to read; what positions are taken from comes first.
    fn choose(mut self, name: &str, named: &[String], findings: &mut Vec<Finding>) -> Found<Vec<Series>> {
        let at = || name.to_owned();
        for topics in self.of_use.values_mut() {
            topics.sort();
        }
        self.check_named(name, named)?;
        let one = |kind: Kind| -> Found<Option<Series>> {
            let topics = self.of_use.get(&kind).map_or(&[][..], Vec::as_slice);
            let chosen: Vec<&String> =
                topics.iter().filter(|t| named.is_empty() || named.iter().any(|n| is_below(t, n))).collect();
            match chosen.as_slice() {
                [] => Ok(None),
                [topic] => Ok(Some(Series::new(kind, topic))),
                topics => Err(AxisRecordingError::SeveralTopics {
                    at: at(),
                    kind: kind.name(),
                    topics: listed(topics.iter().copied()),
                }),
            }
        };
        let currents = one(Kind::MotorCurrents)?;
        let drives = one(Kind::DriveStates)?;
        let mut chosen = match drives {
            Some(drives) => vec![drives],
            None => Vec::new(),
        };
        if chosen.is_empty() || currents.is_none() {
            chosen.extend(one(Kind::JointState)?);
        }
        if chosen.is_empty() {
            let found: Vec<String> =
                self.all.iter().map(|(topic, kind)| format!("{topic} ({kind})")).collect();
            let found = listed(&found);
            return Err(AxisRecordingError::NoMessages {
                at: at(),
                wanted: format!("{} or {}", Kind::DriveStates.name(), Kind::JointState.name()),
                found: if found.is_empty() { "none at all".to_owned() } else { found.join(", ") },
            });
        }
        if let (None, Some(topics)) = (&currents, self.of_use.get(&Kind::MotorCurrents)) {
            let what = format!("{name}: there are motor currents on {}, not asked for", topics.join(", "));
            findings.push(Finding::warning("unused-current", what, "name that topic, too"));
        }
        chosen.extend(currents);
        Ok(chosen)
    }

    /// Each topic that is named is one of use, or the beginning of one.
    fn check_named(&self, name: &str, named: &[String]) -> Found<()> {
        let all = || self.of_use.values().flatten();
        for topic in named {
            if !all().any(|found| is_below(found, topic)) && all().next().is_some() {
                return Err(AxisRecordingError::UnknownTopic {
                    at: name.to_owned(),
                    topic: topic.clone(),
                    topics: listed(all()),
                    nearest: nearest_name(topic, all().map(String::as_str)),
                });
            }
        }
        Ok(())
    }
}

/// Whether `topic` is `name`, or stands below it.
fn is_below(topic: &str, name: &str) -> bool {
    let rest = topic.strip_prefix(name.trim_end_matches('/'));
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// The series as one recording, in the order of the log times of the first.
fn joined(
    mut series: Vec<Series>,
    name: &str,
    axis: &AxisConfig,
    joint: &str,
    findings: &mut Vec<Finding>,
) -> Found<RawRecording> {
    // Stamps that were never set are zero; log times are the clock that all have then.
    let clock = if series.iter().any(|series| !series.is_stamped()) { Clock::Log } else { Clock::Stamp };
    let mut others = series.split_off(1);
    let Some(base) = series.pop() else { return Ok(RawRecording::default()) };
    let kind = base.kind;
    let (found, mut rows) = base.into_rows(name, joint, None)?;
    // Stable: messages of one time stay in the order of the file.
    rows.sort_by_key(|row| row.log_time);
    let stamps: Vec<Nanoseconds> = rows.iter().map(|row| clock.of(row)).collect();
    let first = stamps.first().copied().unwrap_or_default();
    let channel = |place: usize| recorded(rows.iter().map(|row| row.values[place]).collect());
    let mut recording = RawRecording {
        name: name.to_owned(),
        time: stamps.iter().map(|stamp| seconds(stamp.saturating_sub(first))).collect(),
        position: channel(Kind::POSITION),
        velocity: channel(Kind::VELOCITY),
        ..RawRecording::default()
    };
    if kind == Kind::DriveStates {
        recording.psec = channel(Kind::PSEC);
        recording.velocity_feedforward = channel(Kind::VELOCITY_FEEDFORWARD);
        recording.torque_feedforward = channel(Kind::TORQUE_FEEDFORWARD);
    }
    if recording.position.is_none() {
        let (channel, rows) = (super::Channel::Position, rows.len());
        return Err(AxisRecordingError::NoValue { at: name.to_owned(), channel, rows });
    }
    if clock == Clock::Log {
        let what = format!("{name}: messages have no stamps: log times are used, which jitter");
        findings.push(Finding::warning("no-stamps", what, "record messages with header.stamp"));
    }
    let times = Times::new(stamps);
    let current = others.iter().position(|series| series.kind == Kind::MotorCurrents);
    if let Some(place) = current {
        let series = others.swap_remove(place);
        let topic = series.topic.clone();
        match series.into_rows(name, joint, Some(&found)) {
            Ok((_, rows)) => {
                let values = put(&rows, Kind::CURRENT, clock, &times, &format!("{name}: {topic}"), findings);
                recording.current = recorded(values);
            }
            Err(error) => {
                findings.push(Finding::warning("no-current", error.to_string(), "record its motor current"));
            }
        }
        return Ok(recording);
    }
    let effort = if kind == Kind::JointState {
        recorded(rows.iter().map(|row| row.values[Kind::EFFORT]).collect())
    } else {
        others.pop().and_then(|series| {
            let topic = format!("{name}: {}", series.topic);
            let (_, rows) = series.into_rows(name, joint, Some(&found)).ok()?;
            recorded(put(&rows, Kind::EFFORT, clock, &times, &topic, findings))
        })
    };
    if let Some(effort) = effort {
        recording.current = current_of(effort, axis, name, findings);
    }
    Ok(recording)
}

/// The current of an effort (`effort` = Kt·i/r), unless it was never set.
fn current_of(
    effort: Vec<f64>,
    axis: &AxisConfig,
    name: &str,
    findings: &mut Vec<Finding>,
) -> Option<Vec<f64>> {
    if effort.iter().all(|effort| *effort == 0.0 || effort.is_nan()) {
        findings.push(Finding::warning(
            "no-current",
            format!("{name}: there are no motor currents, and the effort is 0 throughout"),
            "record the motor current",
        ));
        return None;
    }
    let (ratio, constant) = (axis.transmission_ratio, axis.motor.torque_constant);
    findings.push(Finding::note(
        "current-of-effort",
        format!(
            "{name}: there are no motor currents: they are computed from the effort of the joint states with \
             {}.motor's torque constant {constant} (N·m/A or N/A) and the transmission ratio {ratio}",
            axis.name
        ),
    ));
    Some(effort.iter().map(|effort| effort * ratio / constant).collect())
}

/// A channel, if it has values.
fn recorded(values: Vec<f64>) -> Option<Vec<f64>> {
    values.iter().any(|value| !value.is_nan()).then_some(values)
}

impl Clock {
    /// The time of a row, ns.
    pub(super) fn of(self, row: &Row) -> Nanoseconds {
        match self {
            Clock::Stamp => row.stamp,
            Clock::Log => row.log_time,
        }
    }
}
