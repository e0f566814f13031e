//! Reading and checking MCAP recordings (rosbag2, profile `ros2`).

use std::io::{self, BufReader, Read, Seek};

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, Message};
use serde::de::DeserializeOwned;

use super::cdr;
use super::error::FileError;
use super::mcap_messages::{BLOCK, Messages, has_complete_fields};
use virtual_axes_core::text::shortened;

/// Supported message encoding.
const ENCODING: &str = "cdr";
/// Maximum length of a record, bytes: hours of setpoints in one message. Bounds the memory that a damaged length
/// in a compressed chunk requests.
const MAX_RECORD_BYTES: usize = 256 << 20;
/// Record header: opcode and length, bytes.
const RECORD_HEAD: usize = 1 + 8;
/// Length of the magic bytes at the start of a file.
const MAGIC: usize = 8;

/// Completeness of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Completeness {
    /// Ends with footer and magic bytes.
    Complete,
    /// Ends after a complete record without a footer, because its writer was terminated.
    Unfinished,
}

/// Returns the type name of a message, if the recording contains its schema.
pub(super) fn type_of<'a>(message: &'a Message<'_>) -> Option<&'a str> {
    message.channel.schema.as_ref().map(|schema| schema.name.as_str())
}

/// Decodes a message.
///
/// # Errors
/// Returns the reason if the message is not CDR or not of type `T`.
pub(super) fn decode<T: DeserializeOwned>(message: &Message<'_>) -> Result<T, String> {
    let encoding = &message.channel.message_encoding;
    if encoding != ENCODING {
        let found = shortened(encoding);
        return Err(format!("the message encoding is \"{found}\", must be \"{ENCODING}\""));
    }
    cdr::decode(&message.data)
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_record_length_limit(MAX_RECORD_BYTES).with_validate_chunk_crcs(true)
}

/// Starts reading the messages from the beginning of the file.
pub(super) fn read_messages<R: Read + Seek>(
    mut input: R,
    name: &str,
) -> Result<Messages<BufReader<R>>, FileError> {
    input.rewind().map_err(|error| FileError::new(name, error))?;
    Messages::new(BufReader::with_capacity(BLOCK, input), options())
        .map_err(|error| parse_error(name, &error))
}

/// Checks the lengths of all chunks, and that records fill each uncompressed chunk, as the MCAP reader requires.
/// Returns the completeness of the file.
pub(super) fn check_chunks<R: Read + Seek>(input: &mut R, name: &str) -> Result<Completeness, FileError> {
    input.rewind().map_err(|error| match error.kind() {
        io::ErrorKind::NotSeekable => FileError::new(
            name,
            "an MCAP recording is read more than once and must be a regular file, not a pipe",
        ),
        _ => FileError::new(name, error),
    })?;
    let mut input = BufReader::with_capacity(BLOCK, input);
    let mut reader = LinearReader::new_with_options(options().with_emit_chunks(true));
    let (mut found, mut whole) = (0, MAGIC);
    while let Some(event) = reader.next_event() {
        let event = match event {
            // A file with magic bytes only is damaged, not unfinished.
            Err(McapError::UnexpectedEof) if found == whole && whole > MAGIC => {
                return Ok(Completeness::Unfinished);
            }
            event => event.map_err(|error| parse_error(name, &error))?,
        };
        if let LinearReadEvent::Record { data, .. } = &event {
            whole += RECORD_HEAD + data.len();
        }
        match event {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = loop {
                    match input.read(reader.insert(wanted.min(BLOCK))) {
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        read => break read.map_err(|error| FileError::new(name, error))?,
                    }
                };
                found += read;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: op::CHUNK, data } => {
                if !has_complete_fields(op::CHUNK, data) {
                    return Err(parse_error(name, &McapError::UnexpectedEoc));
                }
                let record =
                    mcap::parse_record(op::CHUNK, data).map_err(|error| parse_error(name, &error))?;
                if let Record::Chunk { header, data } = record
                    && header.compression.is_empty()
                    && !is_complete_records(&data)
                {
                    return Err(parse_error(name, &McapError::UnexpectedEoc));
                }
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(Completeness::Complete)
}

/// Returns the error for an unfinished recording.
pub(super) fn unfinished_error(name: &str) -> FileError {
    damaged(
        name,
        "the end of the file is missing, its writer was terminated (`mcap recover` repairs the file)",
    )
}

/// Returns true if `records` consists of complete records only.
fn is_complete_records(mut records: &[u8]) -> bool {
    while !records.is_empty() {
        let Some((head, rest)) = records.split_first_chunk::<RECORD_HEAD>() else { return false };
        let [_, length @ ..] = head;
        let Some(rest) = usize::try_from(u64::from_le_bytes(*length)).ok().and_then(|l| rest.get(l..)) else {
            return false;
        };
        records = rest;
    }
    true
}

/// Returns the error for a file that is not MCAP, incomplete or damaged.
pub(super) fn damaged(name: &str, reason: &str) -> FileError {
    FileError::new(name, format_args!("not a complete MCAP recording: {reason}"))
}

/// Converts an error of the MCAP parser.
pub(super) fn parse_error(name: &str, error: &McapError) -> FileError {
    let reason = match error {
        McapError::Io(error) if error.raw_os_error().is_some() => return FileError::new(name, error),
        McapError::Io(error) => {
            format!("a chunk cannot be decompressed: {}", shortened(&error.to_string()))
        }
        McapError::UnexpectedEof => {
            "the file ends in the middle of a record (`mcap recover` repairs the file)".to_owned()
        }
        McapError::Parse(error) => {
            format!("a record cannot be parsed: {}", shortened(&error.to_string()))
        }
        McapError::BadMagic => "the MCAP magic bytes are missing at the start or the end".to_owned(),
        error => shortened(&error.to_string()),
    };
    damaged(name, &reason)
}
