//! Reader that counts the lines it delivers.

use std::io::{self, BufRead, Read};

/// Buffered reader with the number of the current line.
#[derive(Debug)]
pub(super) struct LineCounter<R> {
    input: R,
    line: u64,
}

impl<R> LineCounter<R> {
    pub fn new(input: R) -> Self {
        LineCounter { input, line: 1 }
    }

    /// Returns the number of the line, from 1, of the next byte.
    pub fn line(&self) -> u64 {
        self.line
    }
}

impl<R: BufRead> Read for LineCounter<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(buffer.len());
        if let (Some(target), Some(source)) = (buffer.get_mut(..count), available.get(..count)) {
            target.copy_from_slice(source);
        }
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for LineCounter<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.input.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        // The buffer is not empty if bytes are consumed.
        if amount > 0
            && let Ok(buffer) = self.input.fill_buf()
        {
            let consumed = buffer.get(..amount).unwrap_or(buffer);
            self.line += memchr::memchr_iter(b'\n', consumed).count() as u64;
        }
        self.input.consume(amount);
    }
}
