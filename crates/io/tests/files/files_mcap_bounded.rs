//! Recordings of a node: their bound, and what can be read of them at any moment.

use std::io::{self, Cursor, Write};
use std::sync::{Arc, Mutex};

use mcap::{McapError, MessageStream, Summary};
use proptest::prelude::*;
use virtual_axes_core::config::QosConfig;
use virtual_axes_io::files::{BoundedRecording, RecordedTopic};
use virtual_axes_io::messages::Schema;

const QOS: QosConfig = QosConfig { is_reliable: true, is_transient_local: false, depth: 10 };
/// A message without its data.
const MESSAGE: u64 = 31;
/// What may be kept free for a message beside its record: its place in an index (16 bytes), the head of its chunk and
/// zstd's frame (53 + 128), three indexes of messages (3 × 15), the chunk's index (107) and its offset in the
/// summary (26), and the counts of three channels in the statistics (3 × 10).
const OVERHEAD: u64 = 16 + 53 + 128 + 3 * 15 + 107 + 26 + 3 * 10;

fn topics() -> Vec<RecordedTopic> {
    let schemas = [Schema::joint_state(), Schema::motor_currents(), Schema::diagnostic_array()];
    let topic = |(place, schema)| RecordedTopic { name: format!("/topic_{place}"), schema, qos: QOS };
    schemas.into_iter().enumerate().map(topic).collect()
}

/// What zstd makes of so many bytes at most, beside its frame: a byte more for each 256.
fn stored(length: u64) -> u64 {
    length + length.div_ceil(256)
}

/// What stands in the first chunk before its first message: schemas and channels. How much shorter compression makes
/// them is known only once the chunk has been written, which takes a message.
fn unwritten_head() -> u64 {
    // Both without the schema's text, most of it the QoS of the channel.
    const RECORDS: u64 = 400;
    let length = |topic: &RecordedTopic| RECORDS + topic.schema.text.len() as u64;
    stored(topics().iter().map(length).sum())
}

/// What stands in the file without a message.
fn empty() -> u64 {
    let recording = BoundedRecording::new(Vec::new(), u64::MAX, &topics()).expect("in memory");
    recording.finish().expect("in memory").len() as u64
}

/// A message of `length` bytes: noise that no compression makes shorter, or all the same.
fn data(length: usize, is_noise: bool, seed: u64) -> Vec<u8> {
    let mut state = 2 * seed + 1;
    let mut noise = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as u8
    };
    (0..length).map(|_| if is_noise { noise() } else { 7 }).collect()
}

#[derive(Debug, Clone)]
struct Step {
    topic: usize,
    length: usize,
    is_noise: bool,
    is_flushed: bool,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step =
        (0..3_usize, prop_oneof![0..200_usize, 0..60_000_usize], any::<bool>(), prop::bool::weighted(0.2));
    let step =
        step.prop_map(|(topic, length, is_noise, is_flushed)| Step { topic, length, is_noise, is_flushed });
    prop::collection::vec(step, 1..80)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is written, the file is whole, no longer than its bound, holds the messages up to the first that
    /// was left out, and had no room for that one. There is room for what must be there before the first one.
    #[test]
    fn a_recording_is_whole_and_within_its_bound(steps in steps(), room in unwritten_head() + OVERHEAD..1_500_000) {
        let bound = empty() + room;
        let mut recording = BoundedRecording::new(Vec::new(), bound, &topics()).expect("room for no message");
        let mut written = Vec::new();
        let mut left_out = None;
        for (k, step) in steps.iter().enumerate() {
            let time = 1_000 * k as u64;
            let bytes = data(step.length, step.is_noise, k as u64);
            if !recording.write(step.topic, time, time + 1, &bytes).expect("in memory") {
                left_out = Some(step.length as u64);
                break;
            }
            written.push((format!("/topic_{}", step.topic), time, bytes));
            if step.is_flushed {
                recording.flush().expect("in memory");
            }
        }
        let file = recording.finish().expect("in memory");
        prop_assert!(file.len() as u64 <= bound, "{} of {bound}", file.len());
        if let Some(length) = left_out {
            let head = if written.is_empty() { unwritten_head() } else { 0 };
            let longest = file.len() as u64 + stored(MESSAGE + length) + OVERHEAD + head;
            prop_assert!(longest > bound, "{} of {bound}, {length} left out", file.len());
        }
        let summary = Summary::read(&file).expect("whole").expect("a summary");
        prop_assert_eq!(summary.stats.expect("statistics").message_count, written.len() as u64);
        prop_assert_eq!(summary.channels.len(), 3);
        let found: Vec<_> = MessageStream::new(&file)
            .expect("whole")
            .map(|message| message.expect("whole"))
            .map(|message| (message.channel.topic.clone(), message.log_time, message.data.into_owned()))
            .collect();
        prop_assert_eq!(found, written);
    }
}

#[test]
fn chunks_with_few_topics_leave_no_room_unused() {
    let bound = empty() + 150_000;
    let mut recording = BoundedRecording::new(Vec::new(), bound, &topics()).expect("room for no message");
    let message = |k: u64| data(1_000, true, k);
    // Each a chunk of its own, of one of three topics.
    let written = (0..).take_while(|&k| {
        let room = recording.write(0, k, k, &message(k)).expect("in memory");
        recording.flush().expect("in memory");
        room
    });
    assert!(written.count() > 100);
    let file = recording.finish().expect("in memory");
    let longest = file.len() as u64 + stored(MESSAGE + 1_000) + OVERHEAD;
    assert!(file.len() as u64 <= bound && longest > bound, "{} of {bound}", file.len());
}

/// An output that others can look at, with so much room.
#[derive(Clone)]
struct Disk {
    bytes: Arc<Mutex<Vec<u8>>>,
    size: usize,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut held = self.bytes.lock().expect("one thread");
        let taken = bytes.len().min(self.size - held.len());
        held.extend(&bytes[..taken]);
        if taken == 0 && !bytes.is_empty() { Err(io::ErrorKind::StorageFull.into()) } else { Ok(taken) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The messages of a file that was not finished, and how reading ended.
fn read(file: &[u8]) -> (usize, McapError) {
    let mut reader = mcap::io::MessageReader::new(Cursor::new(file));
    let mut count = 0;
    loop {
        match reader.next() {
            Some(Ok(_)) => count += 1,
            Some(Err(error)) => return (count, error),
            None => panic!("the file was finished"),
        }
    }
}

#[test]
fn what_has_been_flushed_can_be_read_though_nothing_follows() {
    let disk = Disk { bytes: Arc::default(), size: usize::MAX };
    let mut recording = BoundedRecording::new(disk.clone(), u64::MAX, &topics()).expect("in memory");
    for k in 0..100 {
        recording.write(k % 3, k as u64, k as u64, &data(200, true, k as u64)).expect("in memory");
        if k == 69 {
            recording.flush().expect("in memory");
        }
    }
    let file = disk.bytes.lock().expect("one thread").clone();
    assert_eq!(recording.whole(), file.len() as u64);
    let (count, error) = read(&file);
    assert_eq!(count, 70);
    assert!(matches!(error, McapError::UnexpectedEof), "{error}");
}

#[test]
fn a_full_disk_leaves_the_chunks_before_it_readable() {
    let disk = Disk { bytes: Arc::default(), size: 60_000 };
    let mut recording = BoundedRecording::new(disk.clone(), u64::MAX, &topics()).expect("room enough");
    let mut flushed = 0;
    let error = (0..100_usize)
        .find_map(|k| {
            let written = recording.write(0, k as u64, k as u64, &data(2_000, true, k as u64));
            let written = written.and_then(|_| if k % 10 == 9 { recording.flush() } else { Ok(()) });
            if k % 10 == 9 && written.is_ok() {
                flushed = k + 1;
            }
            written.err()
        })
        .expect("it does not fit");
    assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    let whole = recording.whole() as usize;
    assert!(recording.finish().is_err());
    let file = disk.bytes.lock().expect("one thread")[..whole].to_vec();
    // Thirty do not fit, and two chunks of ten do.
    assert_eq!((flushed, read(&file).0), (20, 20));
}

#[test]
fn a_bound_that_holds_no_recording_is_refused() {
    let error = BoundedRecording::new(Vec::new(), 1_000, &topics()).expect_err("too small").to_string();
    assert!(error.starts_with("1000 bytes are too few for a recording, it needs "), "{error}");
}
