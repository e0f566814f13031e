//! Setpoints from recordings, and traces as recordings.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::Arc;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use proptest::prelude::*;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::trajectory::Start;
use virtual_axes_io::files::{PsecMcapOut, RecordingError, TraceMcap, Trajectories};
use virtual_axes_verification::fixtures::folder::TestFolder;

const TYPE: &str = "trajectory_msgs/msg/JointTrajectory";

/// A trajectory of `x` with one point at 1 s, in CDR by hand.
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
    // Behind the header of 4 bytes, f64 stand at multiples of 8.
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

/// A message: topic, type, log time, data.
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
    WriteOptions::new().compression(compression).chunk_size(Some(200)).compression_threads(0)
}

fn open(bytes: &[u8], topic: Option<&str>) -> Result<Trajectories<Cursor<Vec<u8>>>, RecordingError> {
    Trajectories::new(Cursor::new(bytes.to_vec()), "r.mcap", topic)
}

/// Log times and first positions.
fn read(bytes: &[u8], topic: Option<&str>) -> Result<Vec<(i64, f64)>, RecordingError> {
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
    read(bytes, topic).expect_err("must be refused").to_string()
}

#[test]
fn trajectories_come_in_the_order_of_their_log_times() {
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
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let bytes = record(&entries, options(compression));
        assert_eq!(read(&bytes, None).as_deref(), Ok(&wanted[..]), "{compression:?}");
        assert_eq!(read(&bytes, Some("/psec")).as_deref(), Ok(&wanted[..]));
    }
    let unchunked = record(&entries, options(None).use_chunks(false));
    assert_eq!(read(&unchunked, None).as_deref(), Ok(&wanted[..]));
    let trajectories = open(&unchunked, None).expect("good");
    assert_eq!((trajectories.topic(), trajectories.remaining()), ("/psec", 8));
}

#[test]
fn the_topic_is_named_where_there_are_several() {
    let entry = |topic| (topic, TYPE, 1, trajectory(0.5, false));
    let two = record(&[entry("/mill/psec"), entry("/lathe/psec")], options(None));
    assert_eq!(
        error(&two, None),
        "r.mcap: several topics carry trajectories, /lathe/psec, /mill/psec: name one"
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
        "r.mcap: there is no message trajectory_msgs/msg/JointTrajectory; it holds no message at all"
    );
}

#[test]
fn a_bad_message_is_told_with_its_topic_number_and_log_time() {
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
    assert!(message.starts_with(&format!("{at}it is not a message of this type: ")), "{message}");
}

/// A recording of one message, `{}`, on `topic`.
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
fn another_encoding_is_refused() {
    assert_eq!(
        error(&record_encoded("/psec", "json"), None),
        "r.mcap: /psec, message 0, log time 0 s: its encoding is \"json\", must be \"cdr\""
    );
}

#[test]
fn a_refusal_names_an_encoding_and_topics_in_one_line() {
    let long = "a\nb\u{1b}[2J\u{2028}c\u{202e}d\u{2066}e\u{200f}f\u{61c}".repeat(10_000);
    fn entry<'a>(topic: &'a str, kind: &'a str) -> Entry<'a> {
        (topic, kind, 1, trajectory(0.5, false))
    }
    let other = format!("/b{long}");
    let several = record(&[entry(&long, TYPE), entry(&other, TYPE)], options(None));
    let foreign = record(&[entry(&long, "std_msgs/msg/Empty")], options(None));
    let refusals = [
        error(&record_encoded("/psec", &long), None),
        error(&record_encoded(&long, "json"), None),
        error(&several, None),
        error(&several, Some("/psec")),
        error(&several, Some(&format!("{long}c"))),
        error(&foreign, None),
    ];
    for refusal in refusals {
        assert!(refusal.starts_with("r.mcap: ") && refusal.len() < 2_000, "{} bytes", refusal.len());
        assert!(
            !refusal
                .contains(|c: char| c.is_control() || "\u{2028}\u{202e}\u{2066}\u{200f}\u{61c}".contains(c)),
            "{refusal:?}"
        );
    }
}

#[test]
fn a_refusal_names_schemas_that_differ_in_one_line() {
    let refusal = error(include_bytes!("../../../../fuzz/seeds/psec_mcap/schemas_that_differ"), None);
    assert!(refusal.starts_with("r.mcap: not a whole MCAP recording: Schema"), "{refusal}");
    assert!(!refusal.contains(char::is_control), "{refusal:?}");
}

#[test]
fn a_file_whose_chunk_is_damaged_is_said_not_to_be_whole() {
    let mut bytes =
        record(&[("/psec", TYPE, 1, trajectory(0.5, false))], options(Some(mcap::Compression::Lz4)));
    // Of the frame in the first chunk, behind its heads.
    let frame = bytes.windows(4).position(|w| w == [0x04, 0x22, 0x4d, 0x18]).expect("an LZ4 frame");
    bytes[frame + 12..frame + 40].fill(0xff);
    let refusal = error(&bytes, None);
    assert!(refusal.starts_with("r.mcap: not a whole MCAP recording: "), "{refusal}");
}

#[test]
fn a_file_that_is_cut_off_or_no_recording_is_said() {
    let bytes = record(&[("/psec", TYPE, 1, trajectory(0.5, false))], options(None));
    for length in [0, 5, 40, bytes.len() / 2, bytes.len() - 1] {
        assert_eq!(
            error(&bytes[..length], None),
            "r.mcap: not a whole MCAP recording: it ends in the middle of a record (`mcap recover` saves what there \
             is)",
            "{length}"
        );
    }
    assert_eq!(
        error(b"time,x\n0,0\n0.006,0\n", None),
        "r.mcap: not a whole MCAP recording: it does not begin and end as MCAP does"
    );
    let message = Trajectories::open("no/such.mcap".as_ref(), None).expect_err("must be refused").to_string();
    assert!(message.starts_with("no/such.mcap: "), "{message}");
}

/// `bytes` with a record put in behind the magic and the header record.
fn with_record(bytes: &[u8], opcode: u8, body: &[u8]) -> Vec<u8> {
    const MAGIC: usize = 8;
    let length = u64::from_le_bytes(bytes[MAGIC + 1..MAGIC + 9].try_into().expect("eight bytes"));
    let (before, behind) = bytes.split_at(MAGIC + 9 + length as usize);
    [before, &[opcode], &(body.len() as u64).to_le_bytes(), body, behind].concat()
}

/// The reader of the `mcap` crate slices it from byte 32 to 28.
#[test]
fn an_attachment_that_is_too_short_is_passed_over() {
    let good = record(
        &[("/psec", TYPE, 1, trajectory(0.5, false))],
        options(None).calculate_data_section_crc(false),
    );
    // Two times, two empty texts, a length; the checksum is missing.
    let bytes = with_record(&good, 9, &[0; 8 + 8 + 4 + 4 + 8]);
    let found: Vec<_> = open(&bytes, None).expect("a recording").map(|found| found.is_ok()).collect();
    assert_eq!(found, [true]);
}

/// The reader of the `mcap` crate makes room for as much before it looks.
#[test]
fn a_text_that_says_it_is_gibibytes_long_takes_no_memory() {
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
            assert!(text.starts_with("r.mcap: not a whole MCAP recording: "), "{text}");
        });
        // Buffers of readers.
        assert!(used.bytes_max < 10 << 20, "{} bytes for opcode {opcode}", used.bytes_max);
    }
}

/// The reader of the `mcap` crate made room for all of it at once.
#[test]
fn a_record_that_says_it_is_long_takes_no_memory_before_it_is_there() {
    let good = record(&[("/psec", TYPE, 1, trajectory(0.5, false))], options(None));
    let bytes = [&good[..8], &[3], &(200_u64 << 20).to_le_bytes(), &[0; 1000]].concat();
    let used = allocation_counter::measure(|| {
        let text = error(&bytes, None);
        assert!(text.contains("it ends in the middle of a record"), "{text}");
    });
    assert!(used.bytes_max < 10 << 20, "{} bytes", used.bytes_max);
}

/// A damaged recording gives what it gives, or one error; it never panics nor takes memory without bound.
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
        0 => options(None),
        1 => options(Some(Compression::Zstd)),
        2 => options(Some(Compression::Lz4)),
        3 => options(None).use_chunks(false),
        // As rosbag2 does by default.
        _ => options(None).calculate_chunk_crcs(false),
    };
    record(&entries, options)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_recordings_do_no_harm(
        kind in 0_u8..5,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        keep in prop_oneof![Just(1.0), 0.0_f64..1.0],
    ) {
        let mut bytes = sample_recording(kind);
        for (place, value) in flips {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        bytes.truncate((bytes.len() as f64 * keep) as usize);
        read_damaged(&bytes);
    }
}

#[test]
fn each_byte_may_be_damaged() {
    for kind in [0, 3, 4] {
        let good = sample_recording(kind);
        for place in 0..good.len() {
            for value in [0x00, 0x7f, 0xff] {
                let mut bytes = good.clone();
                bytes[place] = value;
                read_damaged(&bytes);
            }
        }
    }
}

#[test]
fn set_points_that_are_written_are_read_back() {
    let folder = TestFolder::new("psec_mcap");
    let path = folder.0.join("p.mcap");
    let joints = ["x".to_owned(), "c".to_owned()];
    let mut out = virtual_axes_io::files::psec_writer(&path, &joints).expect("can be written");
    let rows: Vec<[f64; 2]> = (0..1000).map(|k| [f64::from(k).sin(), 1.0 / f64::from(k + 1)]).collect();
    for (k, row) in rows.iter().enumerate() {
        out.row(k as i64 * 6_000_000, row).expect("can be written");
    }
    out.finish().expect("can be written");
    let mut read = Trajectories::open(&path, None).expect("good");
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
fn times_that_a_recording_cannot_say_are_refused() {
    let joints = ["x".to_owned()];
    let mut trace = TraceMcap::new(Vec::new(), &joints).expect("in memory");
    let error = trace.row(-1, &[AxisSample::default()]).expect_err("before the epoch");
    assert_eq!(error.to_string(), "-1 ns: a recording has no times before the Unix epoch");
    let mut psec = PsecMcapOut::new(Vec::new(), &joints).expect("in memory");
    let error = psec.row(i64::MAX, &[0.0]).expect_err("32 bits");
    assert_eq!(
        error.to_string(),
        "9223372036.854776 s is beyond the seconds that a message has, ±2147483647"
    );
}

#[test]
fn a_trace_has_what_rosbag2_and_viewers_need() {
    let joints = ["x".to_owned()];
    let mut trace = TraceMcap::new(Vec::new(), &joints).expect("in memory");
    for k in 0..3 {
        trace
            .row(k * 125_000, &[AxisSample { controller: "cascade", ..AxisSample::default() }])
            .expect("in memory");
    }
    let bytes = trace.finish().expect("in memory");
    let summary = mcap::Summary::read(&bytes).expect("whole").expect("there is one");
    let stats = summary.stats.as_ref().expect("rosbag2 takes counts from it");
    assert_eq!((stats.message_count, stats.message_start_time, stats.message_end_time), (9, 0, 250_000));
    // rosbag2 reads in the order of log times by the indexes of messages.
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
