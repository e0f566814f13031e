//! Recordings of the node: bounded size, and readability at any moment.

use std::io::{self, Cursor, Write};
use std::sync::{Arc, Mutex};

use mcap::{McapError, MessageStream, Summary};
use proptest::prelude::*;
use virtual_axes_core::config::QosConfig;
use virtual_axes_io::files::{BoundedRecording, RecordedTopic};
use virtual_axes_io::messages::diagnostic_msgs::msg::DiagnosticArray;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;
use virtual_axes_io::messages::{MotorCurrents, Recorded};

const QOS: QosConfig = QosConfig { is_reliable: true, is_transient_local: false, depth: 10 };
/// Message record without its data, bytes.
const MESSAGE: u64 = 31;
/// Maximum overhead reserved for a message besides its record: message index entry (16 bytes), chunk header and LZ4
/// frame (52 + 128), three message indexes (3 × 15), chunk index (106) and its summary offset (26), and the counts of
/// three channels in the statistics (3 × 10).
const OVERHEAD: u64 = 16 + 52 + 128 + 3 * 15 + 106 + 26 + 3 * 10;

fn topics() -> Vec<RecordedTopic> {
    let schemas = [JointState::schema(), MotorCurrents::schema(), DiagnosticArray::schema()];
    let topic = |(index, schema)| RecordedTopic { name: format!("/topic_{index}"), schema, qos: QOS };
    schemas.into_iter().enumerate().map(topic).collect()
}

/// Returns the maximum size of compressed data without the frame of LZ4, at most: one more byte per 256 bytes.
fn stored(length: u64) -> u64 {
    length + length.div_ceil(256)
}

/// Returns the maximum size of the schemas and channels in the first chunk. Their compressed size is known only after
/// the chunk with its first message has been written.
fn unwritten_head() -> u64 {
    // Both records without the schema text; most of it is the QoS of the channel.
    const RECORDS: u64 = 400;
    let length = |topic: &RecordedTopic| RECORDS + topic.schema.text.len() as u64;
    stored(topics().iter().map(length).sum())
}

/// Returns the size of a file without messages.
fn empty() -> u64 {
    let recording = BoundedRecording::new(Vec::new(), u64::MAX, &topics()).expect("in memory");
    recording.finish().expect("in memory").len() as u64
}

/// Returns a message of `length` bytes: incompressible noise, or constant.
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

    /// The file is complete, not longer than its bound, contains all messages before the first rejected one, and the
    /// rejected message would have exceeded the bound.
    #[test]
    fn a_recording_is_complete_and_within_its_bound(steps in steps(), spare in unwritten_head() + OVERHEAD..1_500_000) {
        let bound = empty() + spare;
        let mut recording = BoundedRecording::new(Vec::new(), bound, &topics()).expect("large enough without messages");
        let mut written = Vec::new();
        let mut rejected = None;
        for (k, step) in steps.iter().enumerate() {
            let time = 1_000 * k as u64;
            let bytes = data(step.length, step.is_noise, k as u64);
            if !recording.write(step.topic, time, time + 1, &bytes).expect("in memory") {
                rejected = Some(step.length as u64);
                break;
            }
            written.push((format!("/topic_{}", step.topic), time, bytes));
            if step.is_flushed {
                recording.flush().expect("in memory");
            }
        }
        let file = recording.finish().expect("in memory");
        prop_assert!(file.len() as u64 <= bound, "{} of {bound}", file.len());
        if let Some(length) = rejected {
            let head = if written.is_empty() { unwritten_head() } else { 0 };
            let longest = file.len() as u64 + stored(MESSAGE + length) + OVERHEAD + head;
            prop_assert!(longest > bound, "{} of {bound}, {length} rejected", file.len());
        }
        let summary = Summary::read(&file).expect("complete").expect("a summary");
        prop_assert_eq!(summary.stats.expect("statistics").message_count, written.len() as u64);
        prop_assert_eq!(summary.channels.len(), 3);
        let found: Vec<_> = MessageStream::new(&file)
            .expect("complete")
            .map(|message| message.expect("complete"))
            .map(|message| (message.channel.topic.clone(), message.log_time, message.data.into_owned()))
            .collect();
        prop_assert_eq!(found, written);
    }
}

#[test]
fn chunks_with_few_topics_use_the_whole_bound() {
    let bound = empty() + 150_000;
    let mut recording =
        BoundedRecording::new(Vec::new(), bound, &topics()).expect("large enough without messages");
    let message = |k: u64| data(1_000, true, k);
    // One chunk per message, of one of three topics.
    let written = (0..).take_while(|&k| {
        let is_written = recording.write(0, k, k, &message(k)).expect("in memory");
        recording.flush().expect("in memory");
        is_written
    });
    assert!(written.count() > 100);
    let file = recording.finish().expect("in memory");
    let longest = file.len() as u64 + stored(MESSAGE + 1_000) + OVERHEAD;
    assert!(file.len() as u64 <= bound && longest > bound, "{} of {bound}", file.len());
}

/// Output of limited size with shared access to its content.
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

/// Returns the number of messages of an unfinished file, and the error at its end.
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
fn flushed_messages_of_an_unfinished_recording_are_readable() {
    let disk = Disk { bytes: Arc::default(), size: usize::MAX };
    let mut recording = BoundedRecording::new(disk.clone(), u64::MAX, &topics()).expect("in memory");
    for k in 0..100 {
        recording.write(k % 3, k as u64, k as u64, &data(200, true, k as u64)).expect("in memory");
        if k == 69 {
            recording.flush().expect("in memory");
        }
    }
    let file = disk.bytes.lock().expect("one thread").clone();
    assert_eq!(recording.complete_bytes(), file.len() as u64);
    let (count, error) = read(&file);
    assert_eq!(count, 70);
    assert!(matches!(error, McapError::UnexpectedEof), "{error}");
}

#[test]
fn complete_chunks_are_readable_after_a_full_disk() {
    let disk = Disk { bytes: Arc::default(), size: 60_000 };
    let mut recording = BoundedRecording::new(disk.clone(), u64::MAX, &topics()).expect("large enough");
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
    let complete = recording.complete_bytes() as usize;
    assert!(recording.finish().is_err());
    let file = disk.bytes.lock().expect("one thread")[..complete].to_vec();
    // Two chunks of ten messages fit, three do not.
    assert_eq!((flushed, read(&file).0), (20, 20));
}

#[test]
fn a_bound_below_the_size_of_an_empty_recording_is_rejected() {
    let error = BoundedRecording::new(Vec::new(), 1_000, &topics()).expect_err("too small").to_string();
    assert!(error.starts_with("the maximum size of a recording is 1000 bytes, must be at least "), "{error}");
}
