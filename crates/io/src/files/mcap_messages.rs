//! Iterator over the messages of an MCAP recording, robust against damaged lengths.
//!
//! Replaces [`mcap::io::MessageReader`], which allocates up to 4 GiB for an unchecked length and panics at a short
//! attachment. This reader parses only schemas, channels and messages, after checking their lengths.

use std::borrow::Cow;
use std::io::{self, Read};

use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult, Message};

use super::zstd::ZstdDecompressor;

/// Maximum number of bytes per read: buffers grow with the file content, not with a length field.
pub(super) const BLOCK: usize = 1 << 18;
/// Schema record before its strings: id, bytes.
const SCHEMA_HEAD: usize = 2;
/// Channel record before its strings: channel id and schema id, bytes.
const CHANNEL_HEAD: usize = 2 + 2;
/// Chunk record before the name of its compression: two times, length and checksum, bytes.
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4;

/// Iterator over the messages of a recording in file order, each with its channel.
pub(super) struct Messages<R> {
    source: R,
    reader: LinearReader,
    channels: ChannelAccumulator<'static>,
    is_done: bool,
}

impl<R: Read> Messages<R> {
    /// Creates an iterator that reads `source` from its current position.
    pub fn new(source: R, options: LinearReaderOptions) -> McapResult<Self> {
        let mut reader = LinearReader::new_with_options(options.with_emit_chunks(false));
        reader.add_decompressor(ZstdDecompressor::default())?;
        Ok(Messages { source, reader, channels: ChannelAccumulator::default(), is_done: false })
    }

    /// Returns the source.
    pub fn into_inner(self) -> R {
        self.source
    }

    fn read(&mut self) -> McapResult<Option<Message<'static>>> {
        while let Some(event) = self.reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let read = loop {
                        match self.source.read(self.reader.insert(wanted.min(BLOCK))) {
                            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                            read => break read?,
                        }
                    };
                    self.reader.notify_read(read);
                }
                // The summary repeats schemas and channels.
                LinearReadEvent::Record { opcode, data } => {
                    if let Some(message) = process_record(&mut self.channels, opcode, data)? {
                        return Ok(Some(message));
                    }
                }
            }
        }
        Ok(None)
    }
}

impl<R: Read> Iterator for Messages<R> {
    type Item = McapResult<Message<'static>>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        let next = self.read().transpose();
        self.is_done = !matches!(next, Some(Ok(_)));
        next
    }
}

/// Processes a record and returns its message, if it is a message record.
fn process_record(
    channels: &mut ChannelAccumulator<'static>,
    opcode: u8,
    data: &[u8],
) -> McapResult<Option<Message<'static>>> {
    if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
        return Ok(None);
    }
    if !has_complete_fields(opcode, data) {
        return Err(McapError::UnexpectedEoc);
    }
    match mcap::parse_record(opcode, data)? {
        Record::Schema { header, data } => channels.add_schema(header, Cow::Owned(data.into_owned()))?,
        Record::Channel(channel) => channels.add_channel(channel)?,
        Record::Message { header, data } => {
            let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
            return Ok(Some(Message {
                channel: channels.get(header.channel_id).ok_or(unknown)?,
                sequence: header.sequence,
                log_time: header.log_time,
                publish_time: header.publish_time,
                data: Cow::Owned(data.into_owned()),
            }));
        }
        _ => {}
    }
    Ok(None)
}

/// Returns true if the strings and maps of a schema, channel or chunk record lie within the record.
pub(super) fn has_complete_fields(opcode: u8, record: &[u8]) -> bool {
    let texts = match opcode {
        op::SCHEMA => record.get(SCHEMA_HEAD..).and_then(after_string).and_then(after_string),
        op::CHANNEL => {
            record.get(CHANNEL_HEAD..).and_then(after_string).and_then(after_string).and_then(|map| {
                let rest = after_string(map)?;
                let mut entries = map.get(size_of::<u32>()..map.len() - rest.len())?;
                while !entries.is_empty() {
                    entries = after_string(entries)?;
                }
                Some(rest)
            })
        }
        op::CHUNK => record.get(CHUNK_HEAD..).and_then(after_string),
        _ => Some(record),
    };
    texts.is_some()
}

/// Returns the bytes after a string or a map with a length prefix.
fn after_string(bytes: &[u8]) -> Option<&[u8]> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.get(usize::try_from(u32::from_le_bytes(*length)).ok()?..)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
    }

    #[test]
    fn records_with_truncated_strings_are_incomplete() {
        let map = text(&String::from_utf8([text("a"), text("bc")].concat()).expect("text"));
        let data = [4, 0, 0, 0, 1, 2, 3, 4].to_vec();
        for (opcode, record, least) in [
            (op::SCHEMA, [vec![1, 0], text("n"), text("e"), data].concat(), 2 + 5 + 5),
            (op::CHANNEL, [vec![1, 0, 1, 0], text("/t"), text("cdr"), map].concat(), 4 + 6 + 7 + 4 + 11),
            (op::CHUNK, [vec![0; 28], text("zstd"), vec![0; 8]].concat(), 28 + 8),
        ] {
            for length in 0..=record.len() {
                assert_eq!(
                    has_complete_fields(opcode, &record[..length]),
                    length >= least,
                    "{opcode} {length}"
                );
            }
        }
    }

    /// The parser of the `mcap` crate allocates memory for an unchecked length.
    #[test]
    fn a_string_with_a_length_of_gibibytes_is_rejected_without_allocation() {
        let record = [&[1, 0][..], &u32::MAX.to_le_bytes(), b"n"].concat();
        let used = allocation_counter::measure(|| {
            let processed = process_record(&mut ChannelAccumulator::default(), op::SCHEMA, &record);
            assert!(matches!(processed, Err(McapError::UnexpectedEoc)));
        });
        assert!(used.bytes_max < 10_000, "{} bytes", used.bytes_max);
    }
}
