//! MCAP recordings (rosbag2, profile `ros2`) as files: reading them whole, and what can be wrong with them.

use std::io::{self, BufReader, Read, Seek};
use std::marker::PhantomData;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, Message};
use serde::de::{DeserializeOwned, DeserializeSeed};

use super::mcap_messages::{Messages, is_whole};
use super::cdr;
use virtual_axes_core::text::shortened;

/// The encoding of messages that is read.
const ENCODING: &str = "cdr";
/// Longest record, bytes: hours of setpoints in one message. In a compressed chunk a damaged length asks for
/// no more memory.
const LONGEST_RECORD: usize = 256 << 20;
/// Opcode and length before a record.
const RECORD_HEAD: usize = 1 + 8;
/// Bytes that are asked of a file at once: room is made for what is there, not for what a length says.
pub(super) const BLOCK: usize = 1 << 18;
/// What a file begins with, bytes.
const MAGIC: usize = 8;

/// How a recording ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    /// As MCAP does.
    Whole,
    /// Behind a whole record, but not with the last: its writer was killed.
    Unfinished,
}

/// Why a file is not an MCAP recording that can be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum McapFault {
    /// It cannot be opened or read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// The file.
        at: String,
        /// What the operating system says.
        reason: String,
    },
    /// It is not MCAP, or not whole.
    #[error("{at}: not a whole MCAP recording: {reason}")]
    Damaged {
        /// The file.
        at: String,
        /// What the reader says.
        reason: String,
    },
}

/// The name of a message's type, if the recording says it.
pub(super) fn type_of<'a>(message: &'a Message<'_>) -> Option<&'a str> {
    message.channel.schema.as_ref().map(|schema| schema.name.as_str())
}

/// A message as a value.
///
/// # Errors
/// A sentence that says what is wrong.
pub(super) fn decode<T: DeserializeOwned>(message: &Message<'_>) -> Result<T, String> {
    decode_with(PhantomData::<T>, message)
}

/// What `seed` makes of a message.
///
/// # Errors
/// A sentence that says what is wrong.
pub(super) fn decode_with<'a, S: DeserializeSeed<'a>>(
    seed: S,
    message: &'a Message<'_>,
) -> Result<S::Value, String> {
    let encoding = &message.channel.message_encoding;
    if encoding != ENCODING {
        let found = shortened(encoding);
        return Err(format!("its encoding is \"{found}\", must be \"{ENCODING}\""));
    }
    cdr::decode(seed, &message.data)
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_record_length_limit(LONGEST_RECORD).with_validate_chunk_crcs(true)
}

/// From the beginning.
pub(super) fn start<R: Read + Seek>(mut input: R, name: &str) -> Result<Messages<BufReader<R>>, McapFault> {
    input.rewind().map_err(|error| unreadable(name, &error))?;
    Ok(Messages::new(BufReader::with_capacity(BLOCK, input), options()))
}

/// Checks that each chunk is as long as it says, and that its records fill it if it is not compressed, which the
/// reader relies upon; says how the file ends.
pub(super) fn check_chunks<R: Read + Seek>(input: &mut R, name: &str) -> Result<Ending, McapFault> {
    input.rewind().map_err(|error| match error.kind() {
        io::ErrorKind::NotSeekable => McapFault::Unreadable {
            at: name.to_owned(),
            reason: "a recording is read more than once: it must be a file, not a pipe".to_owned(),
        },
        _ => unreadable(name, &error),
    })?;
    let mut input = BufReader::with_capacity(BLOCK, input);
    let mut reader = LinearReader::new_with_options(options().with_emit_chunks(true));
    let (mut found, mut whole) = (0, MAGIC);
    while let Some(event) = reader.next_event() {
        let event = match event {
            // A file of nothing but its beginning holds nothing to go on with.
            Err(McapError::UnexpectedEof) if found == whole && whole > MAGIC => {
                return Ok(Ending::Unfinished);
            }
            event => event.map_err(|error| damaged(name, &error))?,
        };
        if let LinearReadEvent::Record { data, .. } = &event {
            whole += RECORD_HEAD + data.len();
        }
        match event {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = loop {
                    match input.read(reader.insert(wanted.min(BLOCK))) {
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        read => break read.map_err(|error| unreadable(name, &error))?,
                    }
                };
                found += read;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: op::CHUNK, data } => {
                if !is_whole(op::CHUNK, data) {
                    return Err(damaged(name, &McapError::UnexpectedEoc));
                }
                let record = mcap::parse_record(op::CHUNK, data).map_err(|error| damaged(name, &error))?;
                if let Record::Chunk { header, data } = record
                    && header.compression.is_empty()
                    && !is_filled(&data)
                {
                    return Err(damaged(name, &McapError::UnexpectedEoc));
                }
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(Ending::Whole)
}

/// A recording that was not finished, where only a whole one will do.
pub(super) fn unfinished(name: &str) -> McapFault {
    let reason = "it has no end, its writer was killed (`mcap recover` makes what there is whole)".to_owned();
    McapFault::Damaged { at: name.to_owned(), reason }
}

/// Whether `records` are whole records and nothing else.
fn is_filled(mut records: &[u8]) -> bool {
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

pub(super) fn unreadable(name: &str, error: &io::Error) -> McapFault {
    McapFault::Unreadable { at: name.to_owned(), reason: error.to_string() }
}

/// What the reader says, with what stands behind it.
pub(super) fn damaged(name: &str, error: &McapError) -> McapFault {
    let reason = match error {
        McapError::Io(error) if error.raw_os_error().is_some() => return unreadable(name, error),
        McapError::Io(error) => {
            format!("what is compressed cannot be read: {}", shortened(&error.to_string()))
        }
        McapError::UnexpectedEof => {
            "it ends in the middle of a record (`mcap recover` saves what there is)".to_owned()
        }
        McapError::Parse(error) => {
            format!("a record cannot be read: {}", shortened(&error.to_string()))
        }
        McapError::BadMagic => "it does not begin and end as MCAP does".to_owned(),
        error => shortened(&error.to_string()),
    };
    McapFault::Damaged { at: name.to_owned(), reason }
}
