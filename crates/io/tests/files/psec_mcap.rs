//! Setpoints and traces as MCAP recordings.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use proptest::prelude::*;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::trajectory::Start;
use virtual_axes_io::files::{FileError, McapTrajectories, PsecMcapWriter, TraceMcapWriter};
use virtual_axes_verification::fixtures::folder::TestFolder;

const TYPE: &str = "trajectory_msgs/msg/JointTrajectory";

/// Encodes a trajectory of `x` with one point at 1 s as CDR.
fn trajectory(position: f64, big_endian: bool) -> Vec<u8> {
    let mut bytes = vec![0, u8::from(!big_endian), 0, 0];
    let put = |value: u32, at: &mut Vec<u8>| {
        at.extend(if big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    };
    // stamp 0, frame_id "" (its zero and padding)
    for word in [0, 0, 1] {
        put(word, &mut bytes);
    }
    bytes.extend([0; 4]);
    // joint_names: one, "x" (its zero and padding); points: one, positions: one
    for word in [1, 2] {
        put(word, &mut bytes);
    }
    bytes.extend([b'x', 0, 0, 0]);
    for word in [1, 1] {
        put(word, &mut bytes);
    }
    // An f64 is aligned to 8 bytes after the header of 4 bytes.
    while (bytes.len() - 4) % 8 != 0 {
        bytes.push(0);
    }
    bytes.extend(if big_endian { position.to_be_bytes() } else { position.to_le_bytes() });
    // no velocities, accelerations, effort; 1 s
    for word in [0, 0, 0, 1, 0] {
        put(word, &mut bytes);
    }
    bytes
}

/// Message: topic, type, log time, data.
type Entry<'a> = (&'a str, &'a str, u64, Vec<u8>);

fn record(entries: &[Entry<'_>], options: WriteOptions) -> Vec<u8> {
    let mut writer = options.profile("ros2").create(Cursor::new(Vec::new())).expect("in memory");
    for (k, (topic, kind, log_time, data)) in entries.iter().enumerate() {
        let schema = writer.add_schema(kind, "ros2msg", b"").expect("a schema");
        let channel = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("a channel");
        let header = MessageHeader {
            channel_id: channel,
            sequence: k as u32,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer.write_to_known_channel(&header, data).expect("in memory");
    }
    writer.finish().expect("in memory");
    writer.into_inner().into_inner()
}

fn options(compression: Option<Compression>) -> WriteOptions {
    WriteOptions::new().compression(compression).chunk_size(Some(200))
}

/// Compresses the chunks of a recording by zstd.
fn with_zstd(recording: &[u8]) -> Vec<u8> {
    const MAGIC: usize = 8;
    // Chunk record up to its compression: two times, length, checksum.
    const HEAD: usize = 8 + 8 + 8 + 4;
    let (magic, mut rest) = recording.split_at(MAGIC);
    let mut found = magic.to_vec();
    while rest.len() > MAGIC {
        let length = u64::from_le_bytes(rest[1..9].try_into().expect("a length")) as usize;
        let (record, after) = rest.split_at(9 + length);
        let body = match record[0] {
            6 => {
                // An empty name of the compression and the length of the records.
                let compressed = compress_to_vec(&record[9 + HEAD + 4 + 8..], CompressionLevel::Fastest);
                let length = (compressed.len() as u64).to_le_bytes();
                [&record[9..9 + HEAD], &4_u32.to_le_bytes(), b"zstd", &length, &compressed].concat()
            }
            _ => record[9..].to_vec(),
        };
        found.push(record[0]);
        found.extend((body.len() as u64).to_le_bytes());
        found.extend(body);
        rest = after;
    }
    found.extend(rest);
    found
}

fn open(bytes: &[u8], topic: Option<&str>) -> Result<McapTrajectories<Cursor<Vec<u8>>>, FileError> {
    McapTrajectories::new(Cursor::new(bytes.to_vec()), "r.mcap", topic)
}

/// Returns log times and first positions.
fn read(bytes: &[u8], topic: Option<&str>) -> Result<Vec<(i64, f64)>, FileError> {
    open(bytes, topic)?
        .map(|found| {
            let (time, request) = found?;
            assert_eq!((request.start(), request.joints()), (Start::Now, &["x".to_owned()][..]));
            let (after, row) = request.point(0).expect("a point");
            assert_eq!(after, 1_000_000_000);
            Ok((time, row.positions[0]))
        })
        .collect()
}

#[track_caller]
fn error(bytes: &[u8], topic: Option<&str>) -> String {
    read(bytes, topic).expect_err("must be rejected").to_string()
}

#[test]
fn trajectories_are_returned_in_log_time_order() {
    let times = [30, 10, 20, 50, 40, 41, 41, 5];
    let entries: Vec<Entry<'_>> = times
        .iter()
        .enumerate()
        .flat_map(|(k, &time)| {
            let data = trajectory(k as f64, k % 2 == 1);
            [("/psec", TYPE, time, data), ("/image", "sensor_msgs/msg/Image", time, vec![7; 300])]
        })
        .collect();
    let wanted = [(5, 7.0), (10, 1.0), (20, 2.0), (30, 0.0), (40, 4.0), (41, 5.0), (41, 6.0), (50, 3.0)];
    let plain = record(&entries, options(None));
    for bytes in [with_zstd(&plain), record(&entries, options(Some(Compression::Lz4))), plain] {
        assert_eq!(read(&bytes, None).as_deref(), Ok(&wanted[..]));
        assert_eq!(read(&bytes, Some("/psec")).as_deref(), Ok(&wanted[..]));
    }
    let unchunked = record(&entries, options(None).use_chunks(false));
    assert_eq!(read(&unchunked, None).as_deref(), Ok(&wanted[..]));
    let trajectories = open(&unchunked, None).expect("good");
    assert_eq!((trajectories.topic(), trajectories.remaining()), ("/psec", 8));
}

#[test]
fn several_topics_require_a_selection() {
    let entry = |topic| (topic, TYPE, 1, trajectory(0.5, false));
    let two = record(&[entry("/mill/psec"), entry("/lathe/psec")], options(None));
    assert_eq!(
        error(&two, None),
        "r.mcap: several topics carry trajectories, /lathe/psec, /mill/psec: select one by its name"
    );
    assert_eq!(read(&two, Some("/lathe/psec")), Ok(vec![(1, 0.5)]));
    assert_eq!(
        error(&two, Some("/mil/psec")),
        "r.mcap: there is no trajectory on /mil/psec; there are some on /lathe/psec, /mill/psec; the nearest is \
         /mill/psec"
    );
    let none = record(
        &[("/b", "std_msgs/msg/Empty", 1, vec![0, 1, 0, 0]), ("/a", "x/msg/Y", 1, vec![])],
        options(None),
    );
    assert_eq!(
        error(&none, None),
        "r.mcap: there is no message trajectory_msgs/msg/JointTrajectory; there are messages on /a, /b"
    );
    assert_eq!(
        error(&record(&[], options(None)), None),
        "r.mcap: there is no message trajectory_msgs/msg/JointTrajectory; the file contains no messages"
    );
}

#[test]
fn the_error_of_a_message_names_topic_index_and_log_time() {
    let with = |data| {
        record(
            &[("/psec", TYPE, 0, trajectory(0.0, false)), ("/psec", TYPE, 2_500_000_000, data)],
            options(None),
        )
    };
    let at = "r.mcap: /psec, message 1, log time 2.5 s: ";
    assert_eq!(
        error(&with(trajectory(f64::NAN, false)), None),
        format!("{at}x, point 0: position is NaN, not a finite number")
    );
    let message = error(&with(vec![0, 7, 0, 0]), None);
    assert!(message.starts_with(at) && message.contains("plain CDR"), "{message}");
    let mut short = trajectory(0.0, false);
    short.truncate(50);
    let message = error(&with(short), None);
    assert!(message.starts_with(&format!("{at}not a message of this type: ")), "{message}");
}

/// Returns a recording of one message, `{}`, on `topic`.
fn record_encoded(topic: &str, encoding: &str) -> Vec<u8> {
    let mut writer = options(None).create(Cursor::new(Vec::new())).expect("in memory");
    let schema = Some(Arc::new(mcap::Schema {
        id: 1,
        name: TYPE.to_owned(),
        encoding: "jsonschema".to_owned(),
        data: Cow::Borrowed(b"{}"),
    }));
    let channel = mcap::Channel {
        id: 1,
        topic: topic.to_owned(),
        schema,
        message_encoding: encoding.to_owned(),
        metadata: BTreeMap::new(),
    };
    let data = Cow::Borrowed(b"{}".as_slice());
    let message =
        mcap::Message { channel: Arc::new(channel), sequence: 0, log_time: 0, publish_time: 0, data };
    writer.write(&message).expect("in memory");
    writer.finish().expect("in memory");
    writer.into_inner().into_inner()
}

#[test]
fn encodings_other_than_cdr_are_rejected() {
    assert_eq!(
        error(&record_encoded("/psec", "json"), None),
        "r.mcap: /psec, message 0, log time 0 s: the message encoding is \"json\", must be \"cdr\""
    );
}

#[test]
fn errors_with_encodings_and_topics_have_one_line() {
    let long = "a\nb\u{1b}[2J\u{2028}c\u{202e}d\u{2066}e\u{200f}f\u{61c}".repeat(10_000);
    fn entry<'a>(topic: &'a str, kind: &'a str) -> Entry<'a> {
        (topic, kind, 1, trajectory(0.5, false))
    }
    let other = format!("/b{long}");
    let several = record(&[entry(&long, TYPE), entry(&other, TYPE)], options(None));
    let foreign = record(&[entry(&long, "std_msgs/msg/Empty")], options(None));
    let errors = [
        error(&record_encoded("/psec", &long), None),
        error(&record_encoded(&long, "json"), None),
        error(&several, None),
        error(&several, Some("/psec")),
        error(&several, Some(&format!("{long}c"))),
        error(&foreign, None),
    ];
    for error in errors {
        assert!(error.starts_with("r.mcap: ") && error.len() < 2_000, "{} bytes", error.len());
        assert!(
            !error
                .contains(|c: char| c.is_control() || "\u{2028}\u{202e}\u{2066}\u{200f}\u{61c}".contains(c)),
            "{error:?}"
        );
    }
}

#[test]
fn an_error_of_differing_schemas_has_one_line() {
    let error = error(include_bytes!("../../../../fuzz/seeds/psec_mcap/schemas_that_differ"), None);
    assert!(error.starts_with("r.mcap: not a complete MCAP recording: Schema"), "{error}");
    assert!(!error.contains(char::is_control), "{error:?}");
}

#[test]
fn a_damaged_chunk_is_rejected() {
    let mut bytes =
        record(&[("/psec", TYPE, 1, trajectory(0.5, false))], options(Some(mcap::Compression::Lz4)));
    // Bytes of the LZ4 frame in the first chunk, after its header.
    let frame = bytes.windows(4).position(|w| w == [0x04, 0x22, 0x4d, 0x18]).expect("an LZ4 frame");
    bytes[frame + 12..frame + 40].fill(0xff);
    let error = error(&bytes, None);
    assert!(error.starts_with("r.mcap: not a complete MCAP recording: "), "{error}");
}

#[test]
fn truncated_files_and_other_formats_are_rejected() {
    let bytes = record(&[("/psec", TYPE, 1, trajectory(0.5, false))], options(None));
    for length in [0, 5, 40, bytes.len() / 2, bytes.len() - 1] {
        assert_eq!(
            error(&bytes[..length], None),
            "r.mcap: not a complete MCAP recording: the file ends in the middle of a record (`mcap recover` repairs \
             the file)",
            "{length}"
        );
    }
    assert_eq!(
        error(b"time,x\n0,0\n0.006,0\n", None),
        "r.mcap: not a complete MCAP recording: the MCAP magic bytes are missing at the start or the end"
    );
    let message =
        McapTrajectories::open("no/such.mcap".as_ref(), None).expect_err("must be rejected").to_string();
    assert!(message.starts_with("no/such.mcap: "), "{message}");
}

/// Inserts a record after the magic bytes and the header record.
fn with_record(bytes: &[u8], opcode: u8, body: &[u8]) -> Vec<u8> {
    const MAGIC: usize = 8;
    let length = u64::from_le_bytes(bytes[MAGIC + 1..MAGIC + 9].try_into().expect("eight bytes"));
    let (before, behind) = bytes.split_at(MAGIC + 9 + length as usize);
    [before, &[opcode], &(body.len() as u64).to_le_bytes(), body, behind].concat()
}

/// The reader of the `mcap` crate panics: it slices from byte 32 to 28.
#[test]
fn a_too_short_attachment_is_ignored() {
    let good = record(
        &[("/psec", TYPE, 1, trajectory(0.5, false))],
        options(None).calculate_data_section_crc(false),
    );
    // Two times, two empty texts, a length; the checksum is missing.
    let bytes = with_record(&good, 9, &[0; 8 + 8 + 4 + 4 + 8]);
    let found: Vec<_> = open(&bytes, None).expect("a recording").map(|found| found.is_ok()).collect();
    assert_eq!(found, [true]);
}

/// The reader of the `mcap` crate allocates memory for an unchecked length.
#[test]
fn a_string_with_a_length_of_gibibytes_allocates_no_memory() {
    let good = record(
        &[("/psec", TYPE, 1, trajectory(0.5, false))],
        options(None).calculate_data_section_crc(false),
    );
    let length = u32::MAX.to_le_bytes();
    let schema = [&[9, 0][..], &length, b"name"].concat();
    let channel = [&[9, 0, 0, 0, 2, 0, 0, 0][..], b"/a", &[0; 4], &length].concat();
    for (opcode, body) in [(3, schema), (4, channel), (6, [&[0; 28][..], &length, b"zstd"].concat())] {
        let bytes = with_record(&good, opcode, &body);
        let used = allocation_counter::measure(|| {
            let text = error(&bytes, None);
            assert!(text.starts_with("r.mcap: not a complete MCAP recording: "), "{text}");
        });
        // Buffers of readers.
        assert!(used.bytes_max < 10 << 20, "{} bytes for opcode {opcode}", used.bytes_max);
    }
}

/// The reader of the `mcap` crate allocated memory for the whole record at once.
#[test]
fn a_record_with_a_large_length_allocates_no_memory_in_advance() {
    let good = record(&[("/psec", TYPE, 1, trajectory(0.5, false))], options(None));
    let bytes = [&good[..8], &[3], &(200_u64 << 20).to_le_bytes(), &[0; 1000]].concat();
    let used = allocation_counter::measure(|| {
        let text = error(&bytes, None);
        assert!(text.contains("the file ends in the middle of a record"), "{text}");
    });
    assert!(used.bytes_max < 10 << 20, "{} bytes", used.bytes_max);
}

/// Reads a damaged recording: no panic, and nothing after the first error.
fn read_damaged(bytes: &[u8]) {
    if let Ok(trajectories) = open(bytes, None) {
        let mut found: Vec<_> = trajectories.take(100).collect();
        let last = found.pop();
        assert!(found.iter().all(Result::is_ok), "an error is the last: {found:?} {last:?}");
    }
}

fn sample_recording(kind: u8) -> Vec<u8> {
    let entries: Vec<Entry<'_>> = (0..6)
        .map(|k| match k % 3 {
            0 => ("/other", "std_msgs/msg/Empty", k, vec![0, 1, 0, 0]),
            _ => ("/psec", TYPE, 7 * k % 5, trajectory(k as f64, k % 2 == 1)),
        })
        .collect();
    let options = match kind {
        0 | 1 => options(None),
        2 => options(Some(Compression::Lz4)),
        3 => options(None).use_chunks(false),
        // Default of rosbag2.
        _ => options(None).calculate_chunk_crcs(false),
    };
    let recording = record(&entries, options);
    if kind == 1 { with_zstd(&recording) } else { recording }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_recordings_cause_no_panic(
        kind in 0_u8..5,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        keep in prop_oneof![Just(1.0), 0.0_f64..1.0],
    ) {
        let mut bytes = sample_recording(kind);
        for (index, value) in flips {
            let index = index.index(bytes.len());
            bytes[index] = value;
        }
        bytes.truncate((bytes.len() as f64 * keep) as usize);
        read_damaged(&bytes);
    }
}

#[test]
fn damage_of_any_byte_causes_no_panic() {
    for kind in [0, 1, 3, 4] {
        let good = sample_recording(kind);
        for index in 0..good.len() {
            for value in [0x00, 0x7f, 0xff] {
                let mut bytes = good.clone();
                bytes[index] = value;
                read_damaged(&bytes);
            }
        }
    }
}

#[test]
fn written_setpoints_are_read_back() {
    let folder = TestFolder::new("psec_mcap");
    let path = folder.0.join("p.mcap");
    let joints = ["x".to_owned(), "c".to_owned()];
    let mut out = virtual_axes_io::files::psec_writer(&path, &joints).expect("can be written");
    let rows: Vec<[f64; 2]> = (0..1000).map(|k| [f64::from(k).sin(), 1.0 / f64::from(k + 1)]).collect();
    for (k, row) in rows.iter().enumerate() {
        out.row(k as i64 * 6_000_000, row).expect("can be written");
    }
    out.finish().expect("can be written");
    let mut read = McapTrajectories::open(&path, None).expect("good");
    assert_eq!((read.topic(), read.remaining()), ("/psec", 1));
    let (log_time, request) = read.next().expect("one").expect("good");
    assert_eq!((log_time, request.start(), request.joints()), (0, Start::Now, &joints[..]));
    for (k, row) in rows.iter().enumerate() {
        let (time, found) = request.point(k).expect("a point");
        assert_eq!((time, found.positions), (k as i64 * 6_000_000, &row[..]));
    }
    assert_eq!(request.points(), rows.len());
    assert!(read.next().is_none());
}

#[test]
fn times_out_of_the_range_of_a_recording_are_rejected() {
    let joints = ["x".to_owned()];
    let mut trace = TraceMcapWriter::new(Vec::new(), &joints).expect("in memory");
    let error = trace.row(-1, &[AxisSample::default()]).expect_err("before the epoch");
    assert_eq!(error.to_string(), "the time is -1 ns, must not be before the Unix epoch (0 ns)");
    let mut psec = PsecMcapWriter::new(Vec::new(), &joints).expect("in memory");
    let error = psec.row(i64::MAX, &[0.0]).expect_err("32 bits");
    assert_eq!(
        error.to_string(),
        "the time is 9223372036.854776 s, must be within ±2147483647 s, the range of a message"
    );
}

#[test]
fn a_trace_contains_the_records_that_rosbag2_and_viewers_require() {
    let joints = ["x".to_owned()];
    let mut trace = TraceMcapWriter::new(Vec::new(), &joints).expect("in memory");
    for k in 0..3 {
        trace
            .row(k * 125_000, &[AxisSample { controller: "cascade", ..AxisSample::default() }])
            .expect("in memory");
    }
    let bytes = trace.finish().expect("in memory");
    let summary = mcap::Summary::read(&bytes).expect("complete").expect("a summary");
    let stats = summary.stats.as_ref().expect("statistics for rosbag2");
    assert_eq!((stats.message_count, stats.message_start_time, stats.message_end_time), (9, 0, 250_000));
    // rosbag2 reads in log time order with the message indexes.
    assert!(summary.chunk_indexes.iter().all(|index| !index.message_index_offsets.is_empty()));
    let mut topics: Vec<_> = summary
        .channels
        .values()
        .map(|channel| {
            assert_eq!(channel.message_encoding, "cdr");
            assert!(channel.metadata["offered_qos_profiles"].starts_with("- history: keep_last\n"));
            let schema = channel.schema.as_ref().expect("a definition");
            assert_eq!(schema.encoding, "ros2msg");
            (channel.topic.as_str(), schema.name.as_str())
        })
        .collect();
    topics.sort_unstable();
    assert_eq!(
        topics,
        [
            ("/joint_states", "sensor_msgs/msg/JointState"),
            ("/virtual_axes/drive_states", "virtual_axes/msg/DriveStates"),
            ("/virtual_axes/motor_currents", "virtual_axes/msg/MotorCurrents"),
        ]
    );
    let mut records = mcap::read::LinearReader::new(&bytes).expect("MCAP");
    let Some(Ok(mcap::records::Record::Header(header))) = records.next() else { panic!("a header") };
    assert_eq!(header.profile, "ros2");
}
