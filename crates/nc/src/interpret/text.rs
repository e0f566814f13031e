//! Compact text of a line: comments and blanks removed, letters in lower case.

use virtual_axes_core::text::escaped;

use super::error::Outcome;

/// Line of a program without comments and blanks.
#[derive(Debug, Default)]
pub(super) struct LineText {
    /// Text as read.
    pub raw: Vec<u8>,
    /// Compact text; ASCII, lower case, without the line number.
    pub text: Vec<u8>,
    /// Message to the operator, from a comment (MSG, …).
    pub message: Option<String>,
    /// True if the line begins with a slash.
    pub is_optional: bool,
}

impl LineText {
    /// Computes the other fields from `raw`.
    pub(super) fn compact(&mut self) -> Outcome<()> {
        self.text.clear();
        self.message = None;
        self.is_optional = false;
        let mut rest = self.raw.iter().copied().enumerate();
        while let Some((index, byte)) = rest.next() {
            match byte {
                b' ' | b'\t' => {}
                b';' => break,
                b'(' => {
                    let comment = comment(&self.raw[index + 1..])?;
                    self.message = message(comment).or(self.message.take());
                    rest.nth(comment.len());
                }
                b'/' if self.text.is_empty() && !self.is_optional => self.is_optional = true,
                b'!'..=b'~' => self.text.push(byte.to_ascii_lowercase()),
                _ => {
                    return Err(format!(
                        "invalid character {} outside of a comment",
                        shown(&self.raw, index)
                    ));
                }
            }
        }
        self.remove_number()
    }

    /// Removes the line number N.
    fn remove_number(&mut self) -> Outcome<()> {
        if self.text.first() != Some(&b'n') {
            return Ok(());
        }
        let end = self.text.iter().skip(1).position(|byte| !byte.is_ascii_digit() && *byte != b'.');
        let end = end.map_or(self.text.len(), |end| end + 1);
        if end < 2 {
            return Err("word N: a line number of digits is required".to_owned());
        }
        self.text.drain(..end);
        Ok(())
    }
}

/// Returns the text of the comment that begins `rest`, without its closing parenthesis.
fn comment(rest: &[u8]) -> Outcome<&[u8]> {
    match rest.iter().position(|byte| matches!(byte, b'(' | b')')) {
        Some(end) if rest[end] == b')' => Ok(&rest[..end]),
        Some(_) => Err("comment within a comment: remove the inner parenthesis".to_owned()),
        None => Err("comment without closing parenthesis".to_owned()),
    }
}

/// Returns the message of a comment `MSG, …`.
fn message(comment: &[u8]) -> Option<String> {
    let comment = String::from_utf8_lossy(comment);
    let (key, text) = comment.split_once(',')?;
    key.trim().eq_ignore_ascii_case("msg").then(|| escaped(text.trim()))
}

/// Returns the character at a byte of the line, for a message.
fn shown(raw: &[u8], index: usize) -> String {
    let text = String::from_utf8_lossy(&raw[index..]);
    format!("{:?}", text.chars().next().unwrap_or_default())
}
