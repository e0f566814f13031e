//! Construction of a recording from the values of its channels.

use super::assignment::ColumnAssignment;
use super::context::Context;
use super::format::Found;
use super::found_column::{ColumnUnit, FoundColumn};
use super::unit::Channel;
use crate::files::error::FileError;
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::{MILLISECOND, Rounded};
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Values of all channels, in the order of [`Channel::ALL`]; NaN where a value is missing.
pub(super) type ChannelValues = [Vec<f64>; Channel::ALL.len()];

/// Builds a recording from the channels that have values. Without a column of time, the time is the sample number or the
/// index of the row, from 0, divided by the sampling rate.
pub(super) fn build_recording(
    context: &Context,
    channels: ChannelValues,
    (assignment, found): (&ColumnAssignment, &[FoundColumn]),
    rows: usize,
    findings: &mut Vec<Finding>,
) -> Found<RawRecording> {
    let name = context.name;
    assignment.report(context, found, findings);
    let mut recording = RawRecording { name: name.to_owned(), ..RawRecording::default() };
    let mut wind_up = None;
    for (index, (channel, values)) in Channel::ALL.into_iter().zip(channels).enumerate() {
        let Some(column) = assignment.column_of(index) else { continue };
        if values.iter().all(|value| value.is_nan()) {
            if channel.is_required() {
                return Err(FileError::no_value(name, channel, rows));
            }
            let column = found.get(column).map_or_else(String::new, |column| shortened(&column.header));
            let what = format!("{name}: column {column} ({channel}) has no values and is ignored");
            findings.push(Finding::note("empty-channel", what));
            continue;
        }
        match channel {
            Channel::Time => recording.time = values,
            Channel::Psec => recording.psec = Some(values),
            Channel::Position => recording.position = Some(values),
            Channel::Velocity => recording.velocity = Some(values),
            Channel::Current => recording.current = Some(values),
            Channel::Torque => recording.torque = Some(values),
            Channel::VelocityFeedforward => recording.velocity_feedforward = Some(values),
            Channel::TorqueFeedforward => recording.torque_feedforward = Some(values),
            Channel::MotorPosition => recording.motor_position = Some(values),
            Channel::WindUp => wind_up = Some(values),
        }
    }
    if recording.current.is_none()
        && let Some(torque) = recording.torque.take()
    {
        let constant = context.axis.motor.torque_constant;
        recording.current = Some(torque.iter().map(|torque| torque / constant).collect());
    }
    recording.motor_position =
        recording.motor_position.or_else(|| motor_position(recording.position.as_ref()?, &wind_up?));
    set_time(context, assignment, found, rows, findings, &mut recording);
    Ok(recording)
}

/// Creates the recording from the values of its channels at times that the format states; `source` names them.
///
/// # Errors
/// A required channel without values.
pub(super) fn build_timed_recording(
    context: &Context,
    channels: ChannelValues,
    columns: (&ColumnAssignment, &[FoundColumn]),
    (times, source): (Vec<f64>, &str),
    findings: &mut Vec<Finding>,
) -> Found<RawRecording> {
    if context.rate.is_some() {
        let what = format!("{}: --rate-hz is not used: the times are those of the {source}", context.name);
        findings.push(Finding::note("unused-rate", what));
    }
    let context = Context { rate: None, ..*context };
    let mut recording = build_recording(&context, channels, columns, times.len(), findings)?;
    recording.time = times;
    Ok(recording)
}

/// Returns the position of the motor at the axis from that of the load and the wind-up, m or rad.
pub(super) fn motor_position(load: &[f64], wind_up: &[f64]) -> Option<Vec<f64>> {
    let sum: Vec<f64> = load.iter().zip(wind_up).map(|(load, wind_up)| load + wind_up).collect();
    sum.iter().any(|position| position.is_finite()).then_some(sum)
}

/// Computes the time from the sample number or the index of the row; reports a sampling rate that is not used.
fn set_time(
    context: &Context,
    assignment: &ColumnAssignment,
    found: &[FoundColumn],
    rows: usize,
    findings: &mut Vec<Finding>,
    recording: &mut RawRecording,
) {
    let Some(rate) = context.rate else { return };
    let Some(column) = assignment.column_of(0) else {
        recording.time = (0..rows).map(|row| row as f64 / rate).collect();
        return;
    };
    let column = found.get(column);
    let is_counter = column.and_then(|c| c.unit.as_ref()).is_some_and(ColumnUnit::is_samples);
    if is_counter && context.columns.mapping(Channel::Time).is_none() {
        let first = recording.time.first().copied().unwrap_or_default();
        let steps = recording.time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
        let step = steps.fold(f64::INFINITY, f64::min);
        if step.is_finite() && step > 1.0 {
            let header = column.map_or_else(String::new, |column| shortened(&column.header));
            let what = format!(
                "{}: column {header} counts {} per row: with the {} Hz of --rate-hz, which are those of the counter, a row lasts {} ms",
                context.name,
                Rounded(step),
                Rounded(rate),
                Rounded(step / rate / MILLISECOND)
            );
            let remedy = format!(
                "if {} Hz is the rate of the rows, give --rate-hz {}",
                Rounded(rate),
                Rounded(step * rate)
            );
            findings.push(Finding::warning("counter-step", what, &remedy));
        }
        recording.time.iter_mut().for_each(|time| *time = (*time - first) / rate);
        return;
    }
    let header = column.map_or_else(String::new, |column| shortened(&column.header));
    let what = format!("{}: --rate-hz is not used: the time is that of column {header}", context.name);
    findings.push(Finding::note("unused-rate", what));
}
