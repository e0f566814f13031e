//! Fuzz targets of setpoint files and recordings.

use std::io::Cursor;

use virtual_axes_core::trajectory::{Trajectory, ValidationContext};
use virtual_axes_identify::recording::{Conditioning, Finding, RawRecording, condition};
use virtual_axes_io::files::{
    Columns, McapTrajectories, PsecCsvReader, PsecCsvWriter, RecordingFormat, RecordingOptions,
    inspect_recording_stream, read_psec_yaml, read_recording_mcap, read_recording_stream,
};
use virtual_axes_io::messages;

use crate::{JOINTS, MACHINE, assert_one_line, bounded, bounded_with_extra, names};

/// Largest record in a compressed chunk, bytes: its declared length is allocated.
const COMPRESSED_RECORD: u64 = 256 << 20;
/// Largest number of position cycles read: two rows can span a long time.
const MAX_CYCLES: usize = 2000;
/// Largest number of points of a validated trajectory.
const MAX_POINTS: usize = 1000;
/// Longest validated trajectory, ns: validation checks each position cycle.
const LONGEST: i64 = 60_000_000_000;

/// Reads setpoints to their end and returns joints and rows.
fn rows(data: &[u8]) -> Option<(Vec<String>, Vec<Vec<f64>>)> {
    let mut psec = match PsecCsvReader::new(data, "my.csv", MACHINE.periods().position, &JOINTS) {
        Ok(psec) => psec,
        Err(error) => {
            assert_one_line(&error.to_string());
            assert!(error.to_string().starts_with("my.csv"), "{error}");
            return None;
        }
    };
    let joints = psec.joints().iter().map(|&index| names()[index].clone()).collect();
    let mut row = vec![0.0; psec.joints().len()];
    let mut rows = Vec::new();
    while rows.len() < MAX_CYCLES {
        match psec.next(&mut row) {
            Ok(true) => rows.push(row.clone()),
            Ok(false) => return Some((joints, rows)),
            Err(error) => {
                assert_one_line(&error.to_string());
                assert!(matches!(psec.next(&mut row), Ok(false)), "an error is reported once");
                return None;
            }
        }
    }
    None
}

/// Reads setpoints in CSV and asserts that they round-trip.
pub fn psec_csv(data: &[u8]) {
    bounded(data.len(), || {
        let Some((joints, rows_read)) = rows(data) else { return };
        for row in &rows_read {
            assert!(row.iter().all(|value| value.is_finite()));
        }
        let mut out = PsecCsvWriter::new(Vec::new(), &joints).expect("written to a vector");
        for (k, row) in rows_read.iter().enumerate() {
            out.row(k as i64 * MACHINE.periods().position, row).expect("written to a vector");
        }
        let written = out.finish().expect("written to a vector");
        let again = rows(&written).expect("what was written can be read");
        assert_eq!(again, (joints, rows_read));
    });
}

fn check(request: virtual_axes_core::trajectory::TrajectoryRequest) {
    if request.points() > 0 && request.point(request.points() - 1).is_some_and(|(time, _)| time > LONGEST) {
        return;
    }
    let context = ValidationContext {
        joints: &JOINTS,
        period: MACHINE.periods().position,
        max_points: MAX_POINTS,
        allow_nonzero_end_velocity: true,
    };
    if let Err(rejection) = Trajectory::new(request, &context) {
        assert_one_line(&rejection.to_string());
    }
}

/// Reads trajectories in YAML and asserts that they round-trip through messages.
pub fn psec_yaml(data: &[u8]) {
    let Ok(text) = str::from_utf8(data) else { return };
    bounded(data.len(), || match read_psec_yaml(text, "my.yaml") {
        Ok(requests) => {
            for request in requests {
                let message = messages::joint_trajectory(&request);
                assert_eq!(messages::request(&message, usize::MAX).as_ref(), Ok(&request));
                check(request);
            }
        }
        Err(error) => {
            assert_one_line(&error.to_string());
            assert!(error.to_string().starts_with("my.yaml"), "{error}");
        }
    });
}

/// Reads trajectories in MCAP and asserts that they are sorted by log time.
pub fn psec_mcap(data: &[u8]) {
    bounded_with_extra(COMPRESSED_RECORD, data.len(), || {
        let trajectories = match McapTrajectories::new(Cursor::new(data), "my.mcap", None) {
            Ok(trajectories) => trajectories,
            Err(error) => return assert_one_line(&error.to_string()),
        };
        let announced = trajectories.remaining();
        let mut seen = 0;
        let mut last = i64::MIN;
        for found in trajectories {
            seen += 1;
            match found {
                Ok((time, request)) => {
                    assert!(time >= last, "in the order of log times");
                    last = time;
                    check(request);
                }
                Err(error) => assert_one_line(&error.to_string()),
            }
        }
        assert!(seen <= announced);
    });
}

/// Asserts that all channels have the length of the time stamps, and conditions the recording.
fn check_recording(read: (RawRecording, Vec<Finding>)) {
    let (raw, _) = read;
    for channel in [&raw.psec, &raw.position, &raw.velocity, &raw.current, &raw.motor_position] {
        assert!(channel.as_ref().is_none_or(|values| values.len() == raw.time.len()));
    }
    match condition(&raw, &MACHINE.axes()[0], &MACHINE.periods(), &Conditioning::default()) {
        Ok((signals, _)) => {
            assert!(signals.period > 0.0 && signals.period.is_finite());
            for span in &signals.spans {
                let of = [&span.position, &span.velocity, &span.acceleration];
                assert!(of.iter().all(|values| values.len() == span.position.len()));
                assert!(of.iter().all(|values| values.iter().all(|value| value.is_finite())));
            }
        }
        Err(fault) => assert_one_line(&fault.to_string()),
    }
}

/// Sets the columns from the text before a line `---`; returns the rest.
fn set_columns<'a>(data: &'a [u8], options: &mut RecordingOptions) -> &'a [u8] {
    let mut body = data;
    if let Ok(text) = str::from_utf8(data)
        && let Some((columns, rest)) = text.split_once("---\n")
    {
        for line in columns.lines() {
            if let Err(error) = options.columns.set(line, "--columns") {
                assert_one_line(&error.to_string());
            }
        }
        if let Err(error) = Columns::from_yaml(columns, "columns.yaml") {
            assert_one_line(&error.to_string());
        }
        body = rest.as_bytes();
    }
    body
}

/// Reads a recording in CSV; text before a line `---` assigns the columns.
pub fn recording_csv(data: &[u8]) {
    let mut options = RecordingOptions { format: Some(RecordingFormat::Csv), ..RecordingOptions::default() };
    let body = set_columns(data, &mut options);
    bounded(data.len(), || match read_recording_stream(body, "my.csv", &MACHINE.axes()[0], &options) {
        Ok(read) => check_recording(read),
        Err(error) => assert_one_line(&error.to_string()),
    });
}

/// Lists and reads an export of a control; text before a line `---` assigns the columns.
pub fn recording_control(data: &[u8]) {
    let mut options = RecordingOptions { rate_hz: Some(500.0), ..RecordingOptions::default() };
    let body = set_columns(data, &mut options);
    bounded(data.len(), || {
        match inspect_recording_stream(body, "my.xml", &options) {
            // MCAP is not read from a stream.
            Ok(found) => {
                assert!(!found.columns.is_empty() || found.format == RecordingFormat::Mcap);
                options.joint = found.readable_axes().into_iter().next();
            }
            Err(error) => assert_one_line(&error.to_string()),
        }
        match read_recording_stream(body, "my.xml", &MACHINE.axes()[0], &options) {
            Ok(read) => check_recording(read),
            Err(error) => assert_one_line(&error.to_string()),
        }
    });
}

/// Reads a recording in MCAP.
pub fn recording_mcap(data: &[u8]) {
    bounded_with_extra(COMPRESSED_RECORD, data.len(), || {
        let options = RecordingOptions::default();
        match read_recording_mcap(Cursor::new(data), "my.mcap", &MACHINE.axes()[0], &options) {
            Ok(read) => check_recording(read),
            Err(error) => assert_one_line(&error.to_string()),
        }
    });
}
