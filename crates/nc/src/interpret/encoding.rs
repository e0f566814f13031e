//! Lines of program files as found: UTF-16, ends of lines of each system, padding of serial lines and tapes.

use std::io::{self, BufRead};

use virtual_axes_core::encoding::TextEncoding;

/// Bytes at the start of a program in which the words of a dialect, of turning and of other controls are searched.
pub(super) const SEARCHED_BYTES: usize = 1 << 20;
/// Longest line in which they are searched, bytes.
pub(super) const LINE_BYTES: usize = 4096;

/// Reads a line without its end: CR, LF or both; of a longer one than `limit`, its start. Returns the number of bytes,
/// 0 at the end of the file. Control characters other than the tab are omitted.
pub(crate) fn read_line(
    encoding: TextEncoding,
    reader: &mut impl BufRead,
    limit: usize,
    line: &mut Vec<u8>,
) -> io::Result<usize> {
    line.clear();
    let read = match encoding {
        TextEncoding::Bytes => read_bytes(reader, limit, line),
        TextEncoding::Utf16 { is_big_endian } => read_utf16(reader, is_big_endian, limit, line),
    }?;
    if line.iter().any(is_padding) {
        line.retain(|byte| !is_padding(byte));
    }
    Ok(read)
}

fn is_padding(byte: &u8) -> bool {
    (*byte < b' ' && *byte != b'\t') || *byte == 0x7f
}

fn read_bytes(reader: &mut impl BufRead, limit: usize, line: &mut Vec<u8>) -> io::Result<usize> {
    let mut read = 0;
    while read < limit {
        let buffer = reader.fill_buf()?;
        if buffer.is_empty() {
            break;
        }
        let buffer = &buffer[..buffer.len().min(limit - read)];
        let Some(end) = buffer.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
            line.extend_from_slice(buffer);
            let count = buffer.len();
            reader.consume(count);
            read += count;
            continue;
        };
        line.extend_from_slice(&buffer[..end]);
        let is_return = buffer[end] == b'\r';
        reader.consume(end + 1);
        read += end + 1;
        if is_return && reader.fill_buf()?.first() == Some(&b'\n') {
            reader.consume(1);
            read += 1;
        }
        break;
    }
    Ok(read)
}

fn read_utf16(
    reader: &mut impl BufRead,
    is_big_endian: bool,
    limit: usize,
    line: &mut Vec<u8>,
) -> io::Result<usize> {
    let mut read = 0;
    while read < limit {
        let mut pair = [0; 2];
        for byte in &mut pair {
            let Some(next) = reader.fill_buf()?.first().copied() else { return Ok(read) };
            *byte = next;
            reader.consume(1);
            read += 1;
        }
        match if is_big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) } {
            0xfeff => {}
            0x0a => break,
            // Halves of characters occur in comments.
            unit => {
                let c = char::from_u32(u32::from(unit)).unwrap_or('?');
                line.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
            }
        }
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(mut bytes: &[u8]) -> Vec<String> {
        let encoding = TextEncoding::of(bytes);
        let mut line = Vec::new();
        let mut found = Vec::new();
        while read_line(encoding, &mut bytes, 100, &mut line).unwrap() > 0 {
            found.push(String::from_utf8_lossy(&line).into_owned());
        }
        found
    }

    #[test]
    fn lines_of_each_encoding_and_system_are_the_same() {
        let text = "G21\nX1 (a)\n";
        let expected = ["G21", "X1 (a)"];
        let utf16 = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<_>>();
        for bytes in [
            text.as_bytes().to_vec(),
            text.replace('\n', "\r\n").into_bytes(),
            text.replace('\n', "\r").into_bytes(),
            utf16(u16::to_le_bytes),
            [vec![0xff, 0xfe], utf16(u16::to_le_bytes)].concat(),
            [vec![0xfe, 0xff], utf16(u16::to_be_bytes)].concat(),
            [vec![0; 40], text.as_bytes().to_vec()].concat(),
        ] {
            assert_eq!(lines(&bytes), expected, "{bytes:?}");
        }
        assert_eq!(lines(b"\x7f\x7f%\nM30\n\x1a\0\0"), ["%", "M30", ""]);
    }
}
