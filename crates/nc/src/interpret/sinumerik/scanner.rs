//! Text of one block: comments, block number, skip level, names, numbers and strings.

use super::super::error::Outcome;
use super::super::limits::MAX_NAME;

/// Largest number of digits that a number has in a word, and largest exponent (EX).
const MAX_DIGITS: usize = 64;

/// Block of a program without its comments, in upper case.
#[derive(Debug, Default)]
pub(super) struct BlockText {
    /// Line as read.
    pub raw: Vec<u8>,
    /// Text without comment, block number and skip level; ASCII but for strings.
    pub text: Vec<u8>,
    /// Block number N.
    pub number: Option<u64>,
    /// Skip level of a leading slash, 0 to 9.
    pub skip_level: Option<u8>,
}

impl BlockText {
    /// Computes the other fields from `raw`.
    pub(super) fn read(&mut self) -> Outcome<()> {
        self.text.clear();
        (self.number, self.skip_level) = (None, None);
        let mut in_string = false;
        let mut invalid = None;
        for (index, &byte) in self.raw.iter().enumerate() {
            match byte {
                b'"' => in_string = !in_string,
                b';' if !in_string => break,
                // Quotes may be missing in a message, which ends with the line.
                b' '..=b'~' | b'\t' => {}
                _ if in_string => {}
                _ => invalid = invalid.or(Some(index)),
            }
            self.text.push(if in_string { byte } else { byte.to_ascii_uppercase() });
        }
        self.read_start()?;
        match invalid {
            Some(index) if !self.text.is_empty() => {
                let text = String::from_utf8_lossy(&self.raw[index..]);
                let found = text.chars().next().unwrap_or_default();
                Err(format!("invalid character {found:?} outside of a comment: put the comment behind ;"))
            }
            _ => Ok(()),
        }
    }

    /// Removes skip level and block number, and a text in parentheses alone in the block.
    fn read_start(&mut self) -> Outcome<()> {
        let mut at = blanks(&self.text, 0);
        if self.text.get(at) == Some(&b'/') {
            at += 1;
            self.skip_level = Some(0);
            if let Some(digit @ b'0'..=b'9') = self.text.get(at) {
                self.skip_level = Some(digit - b'0');
                at += 1;
            }
            at = blanks(&self.text, at);
        }
        if matches!(self.text.get(at), Some(b'N' | b':')) {
            let digits = blanks(&self.text, at + 1);
            let end = digits + self.text[digits..].iter().take_while(|byte| byte.is_ascii_digit()).count();
            // A name may begin with N.
            let is_number = end > digits && self.text.get(end).is_none_or(|byte| *byte != b'_');
            if is_number {
                let text = String::from_utf8_lossy(&self.text[digits..end]);
                self.number =
                    Some(text.parse().map_err(|_| format!("N{text}: the block number is too large"))?);
                at = blanks(&self.text, end);
            }
        }
        // Post-processors write a remark in parentheses, which the control does not know.
        if self.text.get(at) == Some(&b'(') {
            at = self.text.len();
        }
        self.text.drain(..at);
        self.text.truncate(self.text.trim_ascii_end().len());
        Ok(())
    }
}

/// Returns the index of the first byte from `at` on that is no blank.
fn blanks(text: &[u8], at: usize) -> usize {
    at + text.iter().skip(at).take_while(|byte| matches!(byte, b' ' | b'\t')).count()
}

/// BlockScanner of a block.
#[derive(Debug, Clone)]
pub(super) struct BlockScanner<'a> {
    text: &'a [u8],
    at: usize,
    /// Nesting of values.
    pub depth: usize,
}

impl<'a> BlockScanner<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0, depth: 0 }
    }

    /// Returns the next byte that is no blank, and skips the blanks in front of it.
    pub(super) fn peek(&mut self) -> Option<u8> {
        self.at = blanks(self.text, self.at);
        self.text.get(self.at).copied()
    }

    /// Skips `symbol` if the text continues with it.
    pub(super) fn skip(&mut self, symbol: &str) -> bool {
        self.peek();
        let found = self.text[self.at..].starts_with(symbol.as_bytes());
        if found {
            self.at += symbol.len();
        }
        found
    }

    /// Skips one `=` that does not begin `==`.
    pub(super) fn skip_assignment(&mut self) -> bool {
        self.peek();
        let rest = &self.text[self.at..];
        let found = rest.first() == Some(&b'=') && rest.get(1) != Some(&b'=');
        if found {
            self.at += 1;
        }
        found
    }

    /// Requires `symbol`.
    pub(super) fn require(&mut self, symbol: &str) -> Outcome<()> {
        if self.skip(symbol) { Ok(()) } else { Err(format!("{}: {symbol} is required", self.rest())) }
    }

    /// Returns the text that is left, for a message.
    pub(super) fn rest(&self) -> String {
        let rest = self.text.get(self.at..).unwrap_or_default().trim_ascii();
        match rest {
            [] => "end of the block".to_owned(),
            rest => String::from_utf8_lossy(&rest[..rest.len().min(40)]).into_owned(),
        }
    }

    /// Skips the rest of the block and returns it.
    pub(super) fn take_rest(&mut self) -> &'a [u8] {
        let rest = &self.text[self.at..];
        self.at = self.text.len();
        rest
    }

    /// Returns the name that follows, without skipping it: letters, digits and underscores, or `""`.
    pub(super) fn peek_name(&mut self) -> &'a str {
        self.peek();
        let rest = &self.text[self.at..];
        let length = match rest.first() {
            Some(b'A'..=b'Z' | b'a'..=b'z' | b'_') => {
                rest.iter().take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'_').count()
            }
            Some(b'$') => {
                1 + rest[1..].iter().take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'_').count()
            }
            _ => 0,
        };
        std::str::from_utf8(&rest[..length]).unwrap_or_default()
    }

    /// Skips a name, and returns it.
    pub(super) fn name(&mut self) -> Outcome<&'a str> {
        let name = self.peek_name();
        if name.is_empty() {
            return Err(format!("{}: a name is required", self.rest()));
        }
        if name.len() > MAX_NAME {
            return Err(format!("{}…: the name has more than {MAX_NAME} characters", &name[..20]));
        }
        self.at += name.len();
        Ok(name)
    }

    /// Skips `word` if it is the name that follows.
    pub(super) fn skip_name(&mut self, word: &str) -> bool {
        let found = self.peek_name() == word;
        if found {
            self.at += word.len();
        }
        found
    }

    /// Skips `count` bytes.
    pub(super) fn advance(&mut self, count: usize) {
        self.at = (self.at + count).min(self.text.len());
    }

    /// Returns true if a number or its sign follows.
    pub(super) fn has_number(&mut self) -> bool {
        matches!(self.peek(), Some(b'0'..=b'9' | b'.' | b'+' | b'-'))
    }

    /// Skips a number without sign, and returns it: `10`, `1.5`, `.5`, `5.`, `1.5EX-3`, `'HFF'`, `'B101'`.
    pub(super) fn number(&mut self) -> Outcome<f64> {
        self.peek();
        if self.skip("'") {
            return self.binary_number();
        }
        let rest = &self.text[self.at..];
        let is_digit = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
        let mut length = rest.iter().take_while(|byte| is_digit(byte)).count();
        let mut text = String::from_utf8_lossy(&rest[..length.min(MAX_DIGITS)]).into_owned();
        if rest[length..].starts_with(b"EX") {
            let exponent = &rest[length + 2..];
            let sign = usize::from(matches!(exponent.first(), Some(b'+' | b'-')));
            let digits = exponent[sign..].iter().take_while(|byte| byte.is_ascii_digit()).count();
            if (1..=3).contains(&digits) {
                text.push('E');
                text.push_str(&String::from_utf8_lossy(&exponent[..sign + digits]));
                length += 2 + sign + digits;
            }
        }
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        let value = value.ok_or_else(|| format!("{}: a number is required", self.rest()))?;
        self.at += length;
        Ok(value)
    }

    fn binary_number(&mut self) -> Outcome<f64> {
        let rest = &self.text[self.at..];
        let end = rest.iter().position(|byte| *byte == b'\'');
        let text = String::from_utf8_lossy(&rest[..end.unwrap_or(0)]).into_owned();
        let value = match text.split_at_checked(1) {
            Some(("H", digits)) => u32::from_str_radix(digits, 16).ok(),
            Some(("B", digits)) => u32::from_str_radix(digits, 2).ok(),
            Some((_, "")) => text.bytes().next().map(u32::from),
            _ => None,
        };
        let value = value.ok_or_else(|| format!("'{text}': 'Hhex' or 'Bbinary' is required"))?;
        self.at += text.len() + 1;
        Ok(f64::from(value))
    }

    /// Skips a string in quotes, and returns it.
    pub(super) fn string(&mut self) -> Outcome<String> {
        self.require("\"")?;
        let rest = &self.text[self.at..];
        let end = rest.iter().position(|byte| *byte == b'"');
        let end = end.ok_or("a string without closing quote")?;
        self.at += end + 1;
        Ok(String::from_utf8_lossy(&rest[..end]).into_owned())
    }

    /// Skips what stands between parentheses, the opening one being skipped already.
    pub(super) fn skip_parentheses(&mut self) -> Outcome<()> {
        let mut depth = 1_usize;
        let mut in_string = false;
        while let Some(byte) = self.text.get(self.at) {
            self.at += 1;
            match byte {
                b'"' => in_string = !in_string,
                b'(' if !in_string => depth += 1,
                b')' if !in_string => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                return Ok(());
            }
        }
        Err("a parenthesis is not closed".to_owned())
    }
}
