//! Recordings of one axis from MCAP.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::LazyLock;

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use proptest::prelude::*;
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_identify::recording::{Finding, RawRecording};
use virtual_axes_io::files::{
    Columns, FileError, RecordingOptions, TraceMcapWriter, read_recording, read_recording_mcap,
};
use virtual_axes_verification::fixtures::folder::TestFolder;

const STATE: &str = "sensor_msgs/msg/JointState";
const CURRENTS: &str = "virtual_axes/msg/MotorCurrents";
const DRIVES: &str = "virtual_axes/msg/DriveStates";
const MS: u64 = 1_000_000;

/// Returns axis x with a screw of 20 mm, 2.64 N·m/A.
fn x() -> &'static AxisConfig {
    static MILL: LazyLock<MachineConfig> =
        LazyLock::new(|| Parameters::embedded_default().expect("shipped").machine_config().expect("valid"));
    MILL.axes().iter().find(|axis| axis.name() == "x").expect("it has one")
}

/// Little-endian CDR encoder: values are aligned to their sizes after the header.
struct Cdr(Vec<u8>);

impl Cdr {
    /// Encodes a header with a stamp in ns, and names.
    fn stamped(stamp: u64, names: &[&str]) -> Self {
        let mut cdr = Cdr(vec![0, 1, 0, 0]);
        cdr.word((stamp / 1_000_000_000) as u32).word((stamp % 1_000_000_000) as u32).text("");
        cdr.word(names.len() as u32);
        for name in names {
            cdr.text(name);
        }
        cdr
    }

    fn align(&mut self, size: usize) {
        while !(self.0.len() - 4).is_multiple_of(size) {
            self.0.push(0);
        }
    }

    fn word(&mut self, value: u32) -> &mut Self {
        self.align(4);
        self.0.extend(value.to_le_bytes());
        self
    }

    fn text(&mut self, text: &str) -> &mut Self {
        self.word(text.len() as u32 + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
        self
    }

    fn numbers(&mut self, values: &[f64]) -> &mut Self {
        self.word(values.len() as u32);
        for value in values {
            self.align(8);
            self.0.extend(value.to_le_bytes());
        }
        self
    }

    fn bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.0)
    }
}

fn state(stamp: u64, names: &[&str], position: &[f64], velocity: &[f64], effort: &[f64]) -> Vec<u8> {
    Cdr::stamped(stamp, names).numbers(position).numbers(velocity).numbers(effort).bytes()
}

fn currents(stamp: u64, names: &[&str], current: &[f64]) -> Vec<u8> {
    let other = vec![9.0; names.len()];
    let mut cdr = Cdr::stamped(stamp, names);
    cdr.numbers(current).numbers(&other).numbers(&other).numbers(&other).numbers(&other);
    // saturated
    cdr.word(0).bytes()
}

/// Encodes drive states of x: psec, position, velocity, velocity_feedforward, torque_feedforward.
fn drives(stamp: u64, values: [f64; 5]) -> Vec<u8> {
    let [psec, position, velocity, vffws, tffws] = values;
    let mut cdr = Cdr::stamped(stamp, &["x"]);
    for value in [psec, position, 8.0, 8.0, velocity, 8.0, vffws, tffws, 8.0] {
        cdr.numbers(&[value]);
    }
    cdr.word(1).text("cascade").bytes()
}

/// Message: topic, type, log time, data.
type Entry<'a> = (&'a str, &'a str, u64, Vec<u8>);

fn record(entries: &[Entry<'_>]) -> Vec<u8> {
    let options = WriteOptions::new().compression(None).chunk_size(Some(300));
    let mut writer = options.profile("ros2").create(Cursor::new(Vec::new())).expect("in memory");
    for (k, (topic, kind, log_time, data)) in entries.iter().enumerate() {
        let schema = writer.add_schema(kind, "ros2msg", b"").expect("a schema");
        let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("a channel");
        let (sequence, log_time, publish_time) = (k as u32, *log_time, *log_time);
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, data).expect("in memory");
    }
    writer.finish().expect("in memory");
    writer.into_inner().into_inner()
}

type Outcome = Result<(RawRecording, Vec<Finding>), FileError>;

fn read_with(bytes: &[u8], options: &RecordingOptions) -> Outcome {
    read_recording_mcap(Cursor::new(bytes), "r.mcap", x(), options)
}

fn read(entries: &[Entry<'_>]) -> Outcome {
    read_with(&record(entries), &RecordingOptions::default())
}

fn topics(names: &[&str]) -> RecordingOptions {
    let topics = names.iter().map(|name| (*name).to_owned()).collect();
    RecordingOptions { topics, ..RecordingOptions::default() }
}

fn codes(findings: &[Finding]) -> Vec<&'static str> {
    findings.iter().map(|finding| finding.code).collect()
}

#[track_caller]
fn error(entries: &[Entry<'_>], options: &RecordingOptions) -> String {
    read_with(&record(entries), options).expect_err("must be rejected").to_string()
}

/// Asserts that values are equal; NaN equals NaN.
#[track_caller]
fn assert_values(found: Option<Vec<f64>>, wanted: &[f64]) {
    let found = found.expect("it is there");
    assert_eq!(found.len(), wanted.len(), "{found:?} for {wanted:?}");
    for (a, b) in found.iter().zip(wanted) {
        let near = (a - b).abs() <= 1e-12 * b.abs();
        assert!(near || (a.is_nan() && b.is_nan()), "{found:?} for {wanted:?}");
    }
}

#[test]
fn a_written_trace_is_read_back() {
    let joints = ["y".to_owned(), "x".to_owned()];
    let mut trace = TraceMcapWriter::new(Vec::new(), &joints).expect("in memory");
    let sample = |v: f64| AxisSample {
        psec: v,
        position: 0.1 * v,
        velocity: 0.2 * v,
        current: 0.3 * v,
        velocity_feedforward: 0.4 * v,
        torque_feedforward: 0.5 * v,
        wind_up: 0.25 * v,
        effort: 99.0,
        ..AxisSample::default()
    };
    let start = 1_700_000_000_000_000_000;
    for k in 0..5_i32 {
        trace
            .row(start + i64::from(k) * 6_000_000, &[sample(-7.0), sample(f64::from(k))])
            .expect("in memory");
    }
    let folder = TestFolder::new("recording_mcap");
    let path = folder.file("r.mcap", trace.finish().expect("in memory"));
    let (found, findings) = read_recording(&path, x(), &RecordingOptions::default()).expect("good");
    assert_eq!(findings, []);
    let scaled = |by: f64| Some((0..5).map(|k| by * f64::from(k)).collect::<Vec<f64>>());
    let wanted = RawRecording {
        name: path.display().to_string(),
        time: vec![0.0, 0.006, 0.012, 0.018, 0.024],
        psec: scaled(1.0),
        position: scaled(0.1),
        velocity: scaled(0.2),
        current: scaled(0.3),
        torque: None,
        velocity_feedforward: scaled(0.4),
        torque_feedforward: scaled(0.5),
        motor_position: Some((0..5).map(|k| 0.1 * f64::from(k) + 0.25 * f64::from(k)).collect()),
    };
    assert_eq!(found, wanted);
    let columns = Columns::read(None, &["position=p"], "--column").expect("a mapping");
    let options = RecordingOptions { columns, ..RecordingOptions::default() };
    let (found, findings) = read_recording(&path, x(), &options).expect("good");
    assert_eq!((found, codes(&findings)), (wanted.clone(), vec!["unused-columns"]));
    let columns = Columns::read(None, &["skip_lines=2", "decimal_comma=true"], "--column").expect("a format");
    let options = RecordingOptions { columns, rate_hz: Some(1000.0), ..RecordingOptions::default() };
    let (found, findings) = read_recording(&path, x(), &options).expect("good");
    assert_eq!((found, codes(&findings)), (wanted, vec!["unused-rate", "unused-option"]));
}

#[test]
fn joint_states_and_currents_are_joined_by_their_stamps() {
    let names = ["c", "x"];
    let mut entries = Vec::new();
    for k in 0..6_u64 {
        let (stamp, v) = (k * MS, k as f64);
        // Log times have no effect: currents are late and out of order.
        entries.push((
            "/joint_states",
            STATE,
            100 * MS + stamp,
            state(5_000_000_000 + stamp, &names, &[-1.0, v], &[], &[1.0, 1.0]),
        ));
        if k != 2 {
            let late = 100 * MS + (20 - stamp / MS) * MS;
            entries.push((
                "/currents",
                CURRENTS,
                late,
                currents(5_000_000_000 + stamp, &["x", "c"], &[10.0 + v, -1.0]),
            ));
        }
        entries.push(("/image", "sensor_msgs/msg/Image", stamp, vec![7; 400]));
    }
    let (found, findings) = read(&entries).expect("good");
    assert_values(Some(found.time), &[0.0, 0.001, 0.002, 0.003, 0.004, 0.005]);
    assert_values(found.position, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_values(found.current, &[10.0, 11.0, f64::NAN, 13.0, 14.0, 15.0]);
    assert_eq!((found.velocity, found.psec), (None, None));
    assert_eq!(codes(&findings), ["unmatched"]);
    assert!(
        findings[0].what.starts_with("r.mcap: /currents: no value at 1 of 6 stamps"),
        "{}",
        findings[0].what
    );
}

#[test]
fn slightly_different_stamps_are_joined_and_reported() {
    let mut entries = Vec::new();
    for k in 0..4_u64 {
        let stamp = 1_000 * MS + k * MS;
        entries.push(("/s", STATE, stamp, state(stamp, &["x"], &[k as f64], &[1.0], &[])));
        // 0.3 ms later: the nearest stamp is that of the same row.
        entries.push(("/i", CURRENTS, stamp, currents(stamp + 3 * MS / 10, &["x"], &[k as f64])));
    }
    let (found, findings) = read(&entries).expect("good");
    assert_values(found.current, &[0.0, 1.0, 2.0, 3.0]);
    assert_eq!(codes(&findings), ["stamps-differ"]);
    assert!(findings[0].what.contains("by up to 0.300 ms"), "{}", findings[0].what);
}

#[test]
fn missing_currents_are_computed_from_the_effort_and_reported() {
    let row = |k: u64, effort: f64| {
        ("/s", STATE, k * MS, state(1_000 * MS + k * MS, &["x"], &[0.1], &[0.2], &[effort]))
    };
    // 1000 N · 0.020 m / 2π / 2.64 N·m/A
    let amperes = 20.0 / (std::f64::consts::TAU * 2.64);
    let (found, findings) = read(&[row(0, 1000.0), row(1, -500.0)]).expect("good");
    assert_values(found.current, &[amperes, -0.5 * amperes]);
    assert_values(found.velocity, &[0.2, 0.2]);
    assert_eq!(codes(&findings), ["current-of-effort"]);
    let (found, findings) = read(&[row(0, 0.0), row(1, 0.0)]).expect("good");
    assert_eq!((found.current, codes(&findings)), (None, vec!["no-current"]));
    // Setpoints and outputs of the drive from one topic, the effort from another.
    let drive = |k: u64| ("/d", DRIVES, k * MS, drives(1_000 * MS + k * MS, [1.0, 2.0, 3.0, 4.0, 5.0]));
    let (found, findings) = read(&[drive(0), row(0, 1000.0), drive(1), row(1, -500.0)]).expect("good");
    assert_values(found.current, &[amperes, -0.5 * amperes]);
    assert_values(found.position, &[2.0, 2.0]);
    assert_values(found.psec, &[1.0, 1.0]);
    assert_values(found.velocity, &[3.0, 3.0]);
    assert_values(found.velocity_feedforward, &[4.0, 4.0]);
    assert_values(found.torque_feedforward, &[5.0, 5.0]);
    assert_eq!(codes(&findings), ["current-of-effort"]);
    let (found, findings) = read(&[drive(0), drive(1)]).expect("good");
    assert_eq!((found.current, codes(&findings)), (None, vec![]));
}

#[test]
fn a_joint_with_a_prefix_is_found_if_it_is_unique() {
    let entries = |names: [&str; 3]| {
        let row = |k: u64| {
            ("/s", STATE, k, state((1_000 + k) * MS, &names, &[1.0, 2.0, 3.0], &[], &[1.0, 1.0, 1.0]))
        };
        [row(0), row(1)]
    };
    let position = |names| read(&entries(names)).expect("good").0.position.expect("there");
    assert_eq!(position(["mill_a", "mill_x", "mill_y"]), [2.0, 2.0]);
    assert_eq!(position(["lathe_x", "mill_x", "x"]), [3.0, 3.0]);
    let two = ["lathe_x", "mill_x", "y"];
    assert_eq!(
        error(&entries(two), &RecordingOptions::default()),
        "r.mcap: /s: several joints end in x; there are lathe_x, mill_x"
    );
    let named = |joint: &str| RecordingOptions { joint: Some(joint.to_owned()), ..Default::default() };
    let (found, _) = read_with(&record(&entries(two)), &named("mill_x")).expect("good");
    assert_values(found.position, &[2.0, 2.0]);
    assert_eq!(
        error(&entries(two), &named("mil_x")),
        "r.mcap: /s: there is no joint mil_x; there are lathe_x, mill_x, y; the nearest is mill_x"
    );
    assert_eq!(
        error(&entries(["a", "b", "c"]), &RecordingOptions::default()),
        "r.mcap: /s: there is no joint x; there are a, b, c"
    );
    // One topic, several publishers with a joint each.
    let of = |k, name, v| ("/s", STATE, k, state((1_000 + k) * MS, &[name], &[v], &[], &[]));
    let (found, _) =
        read(&[of(0, "y", 1.0), of(0, "x", 2.0), of(1, "y", 3.0), of(1, "x", 4.0)]).expect("good");
    assert_values(found.position, &[2.0, 4.0]);
    // The joint has no current.
    let without =
        [of(0, "x", 1.0), of(1, "x", 1.0), ("/i", CURRENTS, 0, currents(1_000 * MS, &["y"], &[1.0]))];
    let (found, findings) = read(&without).expect("good");
    assert_eq!((found.current, codes(&findings)), (None, vec!["no-current"]));
    assert!(findings[0].what.contains("/i: there is no joint x; there are y"), "{}", findings[0]);
}

#[test]
fn several_topics_require_a_selection() {
    let s = |topic, v| (topic, STATE, 1, state(1_000 * MS, &["x"], &[v], &[], &[]));
    let i = |topic, v| (topic, CURRENTS, 1, currents(1_000 * MS, &["x"], &[v]));
    let entries = [s("/mill/s", 1.0), s("/mill2/s", 2.0), i("/mill/i", 3.0), i("/mill2/i", 4.0)];
    assert_eq!(
        error(&entries, &RecordingOptions::default()),
        "r.mcap: several topics carry virtual_axes/msg/MotorCurrents, /mill/i, /mill2/i: select one by its name or a \
         prefix of it"
    );
    for names in [&["/mill"][..], &["/mill/"], &["/mill/s", "/mill/i"]] {
        let (found, findings) = read_with(&record(&entries), &topics(names)).expect("good");
        assert_eq!((found.position, found.current), (Some(vec![1.0]), Some(vec![3.0])), "{names:?}");
        assert_eq!(findings, []);
    }
    let (found, findings) = read_with(&record(&entries), &topics(&["/mill2/s"])).expect("good");
    assert_eq!((found.position, found.current), (Some(vec![2.0]), None));
    assert_eq!(codes(&findings), ["unused-current"]);
    assert_eq!(
        error(&entries, &topics(&["/mil/s"])),
        "r.mcap: no message of an axis on /mil/s; there are some on /mill/s, /mill2/s, /mill/i, /mill2/i; the \
         nearest is /mill/s"
    );
    assert_eq!(
        error(&[i("/i", 1.0), ("/p", "trajectory_msgs/msg/JointTrajectory", 1, vec![])], &topics(&[])),
        "r.mcap: there is no message of type virtual_axes/msg/DriveStates or sensor_msgs/msg/JointState; there \
         are /i (virtual_axes/msg/MotorCurrents), /p (trajectory_msgs/msg/JointTrajectory)"
    );
    assert!(error(&[], &topics(&["/mill"])).ends_with("there are none at all"));
}

#[test]
fn log_times_replace_stamps_that_were_never_set() {
    let s = |log: u64, stamp| ("/s", STATE, log * MS, state(stamp, &["x"], &[log as f64], &[], &[]));
    let (found, findings) = read(&[s(30, 0), s(10, 0), s(20, 0)]).expect("good");
    assert_values(Some(found.time), &[0.0, 0.01, 0.02]);
    assert_values(found.position, &[10.0, 20.0, 30.0]);
    assert_eq!(codes(&findings), ["no-stamps"]);
    // A clock that starts at 0 is valid.
    let (found, findings) = read(&[s(10, 0), s(20, MS), s(30, 2 * MS)]).expect("good");
    assert_values(Some(found.time), &[0.0, 0.001, 0.002]);
    assert_eq!(findings, []);
    // Stamps are returned in any order.
    let (found, _) = read(&[s(10, 5 * MS), s(20, 4 * MS), s(30, 4 * MS)]).expect("good");
    assert_values(Some(found.time), &[0.0, -0.001, -0.001]);
}

#[test]
fn the_error_of_a_message_names_topic_index_and_log_time() {
    let with = |data| {
        let good = state(1_000 * MS, &["x"], &[1.0], &[], &[]);
        error(&[("/s", STATE, 0, good), ("/s", STATE, 2_500 * MS, data)], &RecordingOptions::default())
    };
    let at = "r.mcap: /s, message 1, log time 2.5 s: ";
    let positions = state(1_001 * MS, &["x", "y"], &[1.0], &[], &[]);
    assert_eq!(with(positions), format!("{at}position has 1 values for 2 joints"));
    let infinite = state(1_001 * MS, &["x"], &[1.0], &[f64::INFINITY], &[]);
    assert_eq!(with(infinite), format!("{at}velocity of x is inf"));
    let mut late = state(0, &["x"], &[1.0], &[], &[]);
    late[8..12].copy_from_slice(&1_000_000_000_u32.to_le_bytes());
    assert_eq!(with(late), format!("{at}header.stamp: nanosec is 1000000000, must be below 1000000000"));
    let message = with(vec![0, 1, 0, 0, 5]);
    assert!(message.starts_with(&format!("{at}not a message of this type: ")), "{message}");
    let none = state(1_000 * MS, &["x"], &[], &[], &[]);
    assert_eq!(
        error(&[("/s", STATE, 0, none)], &RecordingOptions::default()),
        "r.mcap: position has no value in any of 1 rows"
    );
}

fn sample_recording() -> Vec<u8> {
    let mut entries = Vec::new();
    for k in 0..4_u64 {
        let stamp = 1_000 * MS + k * MS;
        entries.push(("/s", STATE, stamp, state(stamp, &["y", "x"], &[0.0, 1.0], &[2.0, 3.0], &[4.0, 5.0])));
        entries.push(("/i", CURRENTS, stamp, currents(stamp, &["x"], &[k as f64])));
        entries.push(("/d", DRIVES, stamp, drives(stamp, [1.0, 2.0, 3.0, 4.0, 5.0])));
    }
    record(&entries)
}

#[test]
fn truncated_files_are_rejected() {
    let bytes = sample_recording();
    let (found, findings) = read_with(&bytes, &RecordingOptions::default()).expect("good");
    assert_eq!((found.current, findings), (Some(vec![0.0, 1.0, 2.0, 3.0]), vec![]));
    for length in [0, 5, 40, bytes.len() / 2, bytes.len() - 1] {
        let error =
            read_with(&bytes[..length], &RecordingOptions::default()).expect_err("cut off").to_string();
        assert!(
            error.starts_with(
                "r.mcap: not a complete MCAP recording: the file ends in the middle of a record"
            ),
            "{length}: {error}"
        );
    }
}

#[test]
fn an_unfinished_recording_is_read_up_to_its_last_complete_chunk() {
    let bytes = sample_recording();
    let (complete, _) = read_with(&bytes, &RecordingOptions::default()).expect("good");
    let summary = mcap::Summary::read(&bytes).expect("complete").expect("has a summary");
    // End of a chunk and its indexes.
    let ends: Vec<usize> = summary
        .chunk_indexes
        .iter()
        .map(|chunk| (chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length) as usize)
        .collect();
    assert!(ends.len() > 2, "{ends:?}");
    let mut rows = Vec::new();
    for end in &ends[1..] {
        let (found, findings) = read_with(&bytes[..*end], &RecordingOptions::default()).expect("goes on");
        assert_eq!(findings[0].code, "unfinished", "{findings:?}");
        rows.push(found.time.len());
        assert_eq!(found.time, complete.time[..found.time.len()]);
        assert_eq!(found.position.as_deref(), complete.position.as_deref().map(|p| &p[..found.time.len()]));
    }
    assert!(
        rows.is_sorted() && rows.first() < rows.last() && rows.last() == Some(&complete.time.len()),
        "{rows:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_recordings_cause_no_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        keep in prop_oneof![Just(1.0), 0.0_f64..1.0],
    ) {
        let mut bytes = sample_recording();
        for (index, value) in flips {
            let index = index.index(bytes.len());
            bytes[index] = value;
        }
        bytes.truncate((bytes.len() as f64 * keep) as usize);
        if let Ok((found, _)) = read_with(&bytes, &RecordingOptions::default()) {
            let rows = found.time.len();
            for values in [found.position, found.velocity, found.current, found.psec].into_iter().flatten() {
                prop_assert!(values.len() == rows && values.iter().all(|value| !value.is_infinite()));
            }
        }
    }

    #[test]
    fn a_message_of_any_bytes_causes_no_panic(
        kind in prop::sample::select(vec![STATE, CURRENTS, DRIVES]),
        data in prop::collection::vec(any::<u8>(), 0..80),
        little in any::<bool>(),
    ) {
        let stamp = 1_000 * MS;
        let data = if little { [&[0, 1, 0, 0], &data[..]].concat() } else { data };
        let good = state(stamp, &["x"], &[1.0], &[], &[]);
        _ = read(&[("/s", STATE, 1, good), ("/other", kind, 2, data)]);
    }
}
