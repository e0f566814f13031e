//! The messages of an MCAP recording, one after the other.
//!
//! As [`mcap::io::MessageReader`], but only the records that messages need are parsed, and not before their
//! lengths have been looked at: that one makes room for what a length says before it looks whether it is
//! there, up to 4 GiB, and ends the program at an attachment that is too short.

use std::borrow::Cow;
use std::io::{self, Read};

use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult, Message};

use super::mcap_in::BLOCK;

/// Number of a schema, in its record before the texts.
const SCHEMA_HEAD: usize = 2;
/// Numbers of a channel and its schema, likewise.
const CHANNEL_HEAD: usize = 2 + 2;
/// Two times, length and checksum of a chunk, before the name of its compression.
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4;

/// The messages of a recording in the order of the file, each with its channel.
pub(super) struct Messages<R> {
    source: R,
    reader: LinearReader,
    channels: ChannelAccumulator<'static>,
    is_done: bool,
}

impl<R: Read> Messages<R> {
    /// Those of `source`, which is read from where it stands.
    pub fn new(source: R, options: LinearReaderOptions) -> Self {
        let reader = LinearReader::new_with_options(options.with_emit_chunks(false));
        Messages { source, reader, channels: ChannelAccumulator::default(), is_done: false }
    }

    /// What it reads from.
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
                // The summary says schemas and channels once more, which does no harm.
                LinearReadEvent::Record { opcode, data } => {
                    if let Some(message) = take(&mut self.channels, opcode, data)? {
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

/// Takes a record in; the message, if it is one.
fn take(
    channels: &mut ChannelAccumulator<'static>,
    opcode: u8,
    data: &[u8],
) -> McapResult<Option<Message<'static>>> {
    if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
        return Ok(None);
    }
    if !is_whole(opcode, data) {
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

/// Whether the texts in a schema, a channel or a chunk are as long as they say.
pub(super) fn is_whole(opcode: u8, record: &[u8]) -> bool {
    let texts = match opcode {
        op::SCHEMA => record.get(SCHEMA_HEAD..).and_then(behind_text).and_then(behind_text),
        op::CHANNEL => {
            record.get(CHANNEL_HEAD..).and_then(behind_text).and_then(behind_text).and_then(|map| {
                let rest = behind_text(map)?;
                let mut entries = map.get(size_of::<u32>()..map.len() - rest.len())?;
                while !entries.is_empty() {
                    entries = behind_text(entries)?;
                }
                Some(rest)
            })
        }
        op::CHUNK => record.get(CHUNK_HEAD..).and_then(behind_text),
        _ => Some(record),
    };
    texts.is_some()
}

/// What follows a text, or a map, which begin with their length in bytes.
fn behind_text(bytes: &[u8]) -> Option<&[u8]> {
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
    fn records_are_whole_as_long_as_every_text_in_them_is() {
        let map = text(&String::from_utf8([text("a"), text("bc")].concat()).expect("text"));
        let data = [4, 0, 0, 0, 1, 2, 3, 4].to_vec();
        for (opcode, record, least) in [
            (op::SCHEMA, [vec![1, 0], text("n"), text("e"), data].concat(), 2 + 5 + 5),
            (op::CHANNEL, [vec![1, 0, 1, 0], text("/t"), text("cdr"), map].concat(), 4 + 6 + 7 + 4 + 11),
            (op::CHUNK, [vec![0; 28], text("zstd"), vec![0; 8]].concat(), 28 + 8),
        ] {
            for length in 0..=record.len() {
                assert_eq!(is_whole(opcode, &record[..length]), length >= least, "{opcode} {length}");
            }
        }
    }

    /// Its length in the file stands before any of its bytes, and memory was taken for it.
    #[test]
    fn a_text_that_says_it_is_gibibytes_long_is_refused_before_it_is_made_room_for() {
        let record = [&[1, 0][..], &u32::MAX.to_le_bytes(), b"n"].concat();
        let used = allocation_counter::measure(|| {
            let taken = take(&mut ChannelAccumulator::default(), op::SCHEMA, &record);
            assert!(matches!(taken, Err(McapError::UnexpectedEoc)));
        });
        assert!(used.bytes_max < 10_000, "{} bytes", used.bytes_max);
    }
}
