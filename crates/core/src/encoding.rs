//! Decoding of text files: UTF-8, UTF-16 and Windows-1252, with and without a byte order mark.

use std::io::{self, ErrorKind, Read};

/// Mark at the start of a text.
const BYTE_ORDER_MARK: char = '\u{feff}';
/// Number of bytes that determine the encoding.
const HEAD_BYTES: usize = 4;
/// Number of bytes that are read at once.
const BLOCK_BYTES: usize = 1 << 16;

/// Encoding of a text file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TextEncoding {
    /// UTF-8; bytes that are not UTF-8 are characters of Windows-1252.
    #[default]
    Bytes,
    /// UTF-16.
    Utf16 {
        /// True if the high byte of a character comes first.
        is_big_endian: bool,
    },
}

impl TextEncoding {
    /// Returns the encoding of a file with these first bytes: by its mark, or by the zeros of ASCII characters.
    pub fn of(head: &[u8]) -> Self {
        match head {
            [0xff, 0xfe, ..] => Self::Utf16 { is_big_endian: false },
            [0xfe, 0xff, ..] => Self::Utf16 { is_big_endian: true },
            [1..=255, 0, 1..=255, 0, ..] => Self::Utf16 { is_big_endian: false },
            [0, 1..=255, 0, 1..=255, ..] => Self::Utf16 { is_big_endian: true },
            _ => Self::Bytes,
        }
    }

    /// Appends the complete characters of `bytes` to `text`, all of them at the end of a file, and returns the number of
    /// bytes that they have.
    fn decode(self, bytes: &[u8], is_end: bool, text: &mut String) -> usize {
        match self {
            Self::Bytes => decode_bytes(bytes, is_end, text),
            Self::Utf16 { is_big_endian } => decode_utf16(bytes, is_big_endian, is_end, text),
        }
    }
}

fn decode_bytes(bytes: &[u8], is_end: bool, text: &mut String) -> usize {
    if let Ok(valid) = str::from_utf8(bytes) {
        text.push_str(valid);
        return bytes.len();
    }
    let mut decoded = 0;
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        decoded += chunk.valid().len();
        let invalid = chunk.invalid();
        let is_last = decoded + invalid.len() == bytes.len();
        if is_last && !is_end && str::from_utf8(invalid).is_err_and(|error| error.error_len().is_none()) {
            break;
        }
        text.extend(invalid.iter().map(|byte| windows_1252(*byte)));
        decoded += invalid.len();
    }
    decoded
}

fn decode_utf16(bytes: &[u8], is_big_endian: bool, is_end: bool, text: &mut String) -> usize {
    let unit = |pair: &[u8]| {
        let pair = [pair[0], pair[1]];
        if is_big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
    };
    let mut units: Vec<u16> = bytes.chunks_exact(2).map(unit).collect();
    // The second half of a character follows.
    let is_cut = !is_end && units.last().is_some_and(|unit| (0xd800..0xdc00).contains(unit));
    units.truncate(units.len() - usize::from(is_cut));
    let decoded = 2 * units.len();
    text.extend(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)));
    if is_end { bytes.len() } else { decoded }
}

/// Returns a character of Windows-1252, as <https://encoding.spec.whatwg.org/#windows-1252> defines it.
fn windows_1252(byte: u8) -> char {
    const C1: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
        '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
    ];
    byte.checked_sub(0x80).and_then(|index| C1.get(usize::from(index))).copied().unwrap_or(char::from(byte))
}

/// Returns the text of a file, without its byte order mark.
pub fn decode(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len());
    TextEncoding::of(bytes).decode(bytes, true, &mut text);
    if text.starts_with(BYTE_ORDER_MARK) {
        text.remove(0);
    }
    text
}

/// Returns the text of a file, without its byte order mark; rejects a binary file.
///
/// # Errors
/// Returns an error if the text contains zeros.
pub fn decode_text(bytes: &[u8]) -> Result<String, String> {
    let text = decode(bytes);
    match text.contains('\0') {
        true => Err("the file is binary, must be text".to_owned()),
        false => Ok(text),
    }
}

/// Reader that converts a text file of any [`TextEncoding`] to UTF-8 without byte order mark.
///
/// ```
/// use std::io::Read;
///
/// use virtual_axes_core::encoding::TextReader;
///
/// let mut text = String::new();
/// TextReader::new(b"error [\xb5m]".as_slice()).read_to_string(&mut text)?;
/// assert_eq!(text, "error [µm]");
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct TextReader<R> {
    input: R,
    /// Encoding, if it is known.
    encoding: Option<TextEncoding>,
    /// Bytes that are not decoded.
    bytes: Vec<u8>,
    /// Decoded text, of which the first `taken` bytes are read.
    text: String,
    taken: usize,
    is_end: bool,
}

impl<R: Read> TextReader<R> {
    /// Creates the reader of a file from its first byte on.
    pub fn new(input: R) -> Self {
        Self { input, encoding: None, bytes: Vec::new(), text: String::new(), taken: 0, is_end: false }
    }

    /// Reads and decodes the next bytes.
    fn fill(&mut self) -> io::Result<()> {
        let kept = self.bytes.len();
        self.bytes.resize(kept + BLOCK_BYTES, 0);
        let read = self.input.read(&mut self.bytes[kept..]);
        self.bytes.truncate(kept + *read.as_ref().unwrap_or(&0));
        match read {
            Ok(count) => self.is_end = count == 0,
            Err(error) if error.kind() == ErrorKind::Interrupted => return Ok(()),
            Err(error) => return Err(error),
        }
        if self.encoding.is_none() && self.bytes.len() < HEAD_BYTES && !self.is_end {
            return Ok(());
        }
        let is_start = self.encoding.is_none();
        let encoding = *self.encoding.get_or_insert_with(|| TextEncoding::of(&self.bytes));
        self.text.clear();
        let decoded = encoding.decode(&self.bytes, self.is_end, &mut self.text);
        self.bytes.drain(..decoded);
        let has_mark = is_start && self.text.starts_with(BYTE_ORDER_MARK);
        self.taken = if has_mark { BYTE_ORDER_MARK.len_utf8() } else { 0 };
        Ok(())
    }
}

impl<R: Read> Read for TextReader<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.text.len() && !self.is_end {
            self.fill()?;
        }
        let rest = &self.text.as_bytes()[self.taken..];
        let count = rest.len().min(into.len());
        into[..count].copy_from_slice(&rest[..count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reader that returns a few bytes per call.
    struct ShortReads<'a>(&'a [u8], usize);

    impl Read for ShortReads<'_> {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(into.len());
            into[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    fn read(bytes: &[u8], step: usize) -> String {
        let mut text = String::new();
        TextReader::new(ShortReads(bytes, step)).read_to_string(&mut text).expect("text");
        text
    }

    #[test]
    fn a_text_is_the_same_in_each_encoding() {
        let text = "Länge [µm]; Winkel [°]\r\n1;2\n";
        let utf16 = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<_>>();
        let windows: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin")).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            ["\u{feff}".as_bytes(), text.as_bytes()].concat(),
            windows,
            [vec![0xff, 0xfe], utf16(u16::to_le_bytes)].concat(),
            [vec![0xfe, 0xff], utf16(u16::to_be_bytes)].concat(),
        ] {
            assert_eq!(decode(&bytes), text, "{bytes:?}");
            for step in [1, 2, 3, 1000] {
                assert_eq!(read(&bytes, step), text, "{step} {bytes:?}");
            }
        }
        let ascii: Vec<u8> = "time,x".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(decode(&ascii), "time,x");
        assert_eq!(decode(b"\x80 \x93a\x94 \x8e"), "€ “a” Ž");
    }

    #[test]
    fn a_binary_file_is_no_text() {
        assert!(decode_text(b"\x89PNG\r\n\x1a\n\0\0\0").is_err());
        assert_eq!(decode_text(b"\xff\xfea\0").as_deref(), Ok("a"));
    }

    proptest! {
        #[test]
        fn the_text_does_not_depend_on_the_sizes_of_reads(
            bytes in prop::collection::vec(any::<u8>(), 0..40), step in 1usize..6
        ) {
            prop_assert_eq!(read(&bytes, step), decode(&bytes));
        }

        #[test]
        fn utf_8_is_itself_and_utf_16_is_decoded(text in "[a-zµ°\u{10ffff}\n]{0,20}", step in 1usize..6) {
            prop_assert_eq!(read(text.as_bytes(), step), text.clone());
            let units = "\u{feff}".encode_utf16().chain(text.encode_utf16());
            let bytes: Vec<u8> = units.flat_map(u16::to_be_bytes).collect();
            prop_assert_eq!(read(&bytes, step), text);
        }
    }
}
