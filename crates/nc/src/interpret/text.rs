//! Compact text of a line: comments and blanks removed, letters in lower case.

use virtual_axes_core::encoding::decode;
use virtual_axes_core::text::escaped;

use super::dialect::Dialect;
use super::error::Outcome;
use super::okuma;

/// Words of macros that Fanuc abbreviates.
const WORDS_OF_MACROS: [&str; 17] = [
    "while", "goto", "then", "end", "xor", "and", "sin", "asin", "cos", "acos", "tan", "atan", "sqrt", "abs",
    "fix", "fup", "round",
];

/// Line of a program without comments and blanks.
#[derive(Debug, Default)]
pub(super) struct LineText {
    /// Text as read.
    pub raw: Vec<u8>,
    /// Compact text; ASCII, lower case, without the line number.
    pub text: Vec<u8>,
    /// Message to the operator, from a comment (MSG, …).
    pub message: Option<String>,
    /// Line number N, if it is an integer.
    pub number: Option<u32>,
    /// True if the line begins with a slash.
    pub is_optional: bool,
}

impl LineText {
    /// Computes the other fields from `raw`.
    ///
    /// # Errors
    ///
    /// In LinuxCNC a comment without end or within a comment, and in all dialects a character that is no ASCII.
    pub(super) fn compact(&mut self, dialect: Dialect) -> Outcome<()> {
        let is_strict = dialect == Dialect::LinuxCnc;
        self.number = None;
        self.text.clear();
        self.message = None;
        self.is_optional = false;
        if is_message(&self.raw) {
            return Ok(());
        }
        let mut rest = self.raw.iter().copied().enumerate();
        while let Some((index, byte)) = rest.next() {
            match byte {
                // Blanks end the names and expressions of Okuma.
                b' ' | b'\t' if dialect == Dialect::Okuma => {
                    if !matches!(self.text.last(), None | Some(b' ')) {
                        self.text.push(b' ');
                    }
                }
                b' ' | b'\t' => {}
                // Control characters of serial lines.
                0..b' ' | 0x7f => {}
                b';' => break,
                b'(' => {
                    let comment = match is_strict {
                        true => comment(&self.raw[index + 1..])?,
                        false => any_comment(&self.raw[index + 1..]),
                    };
                    if is_statement(comment) {
                        let text = decode(comment);
                        return Err(format!(
                            "({}): a statement of Fagor, whose controls are not supported",
                            escaped(&text)
                        ));
                    }
                    self.message = message(comment).or(self.message.take());
                    rest.nth(comment.len());
                }
                b'/' if self.is_before_words() && !self.is_optional => {
                    self.is_optional = true;
                    // Number of the switch, 1 to 9.
                    if let [b'1'..=b'9', next, ..] = self.raw[index + 1..]
                        && !next.is_ascii_digit()
                    {
                        rest.next();
                    }
                }
                b'\'' if dialect == Dialect::Mach3 => break,
                // Commands that grbl takes out of the stream of characters.
                b'?' | b'!' | b'~' if dialect == Dialect::Grbl && !self.text.is_empty() => {}
                // Checksum of a host.
                b'*' if dialect == Dialect::Marlin => break,
                b':' if matches!(dialect, Dialect::Fanuc | Dialect::Haas) && self.text.is_empty() => {
                    self.text.push(b'o')
                }
                b'!'..=b'~' => self.text.push(byte.to_ascii_lowercase()),
                _ => {
                    return Err(format!(
                        "invalid character {} outside of a comment",
                        shown(&self.raw, index)
                    ));
                }
            }
        }
        if dialect == Dialect::Okuma {
            self.number = okuma::translate(&mut self.text)?;
            return Ok(());
        }
        self.remove_number()?;
        if dialect == Dialect::Fanuc {
            self.expand_words_of_macros();
        }
        Ok(())
    }

    /// Completes the words of macros that Fanuc abbreviates to two letters and more, as in `WH[#1LT3]DO1`.
    fn expand_words_of_macros(&mut self) {
        let mut at = 0;
        while let Some(start) = self.text[at..].iter().position(u8::is_ascii_alphabetic) {
            let start = at + start;
            let letters = self.text[start..].iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
            at = start + letters;
            if letters < 2 {
                continue;
            }
            // An address may stand before a function: `XCO[#1]`.
            for begin in [start, start + 1] {
                let part = &self.text[begin..at];
                let next = self.text.get(at).copied().unwrap_or_default();
                let is_part = |word: &&&str| {
                    let takes_number = matches!(**word, "goto" | "then" | "end" | "xor" | "and");
                    let may_follow =
                        next == b'[' || (takes_number && (next == b'#' || next.is_ascii_digit()));
                    may_follow && part.len() > 1 && word.as_bytes().starts_with(part)
                };
                if let Some(word) = WORDS_OF_MACROS.iter().find(is_part) {
                    self.text.splice(begin..at, word.bytes());
                    at = begin + word.len();
                    break;
                }
            }
        }
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
        self.number = str::from_utf8(&self.text[1..end]).ok().and_then(|digits| digits.parse().ok());
        self.text.drain(..end);
        Ok(())
    }

    /// Returns true if the text so far is at most a line number.
    fn is_before_words(&self) -> bool {
        match self.text.trim_ascii_end().split_first() {
            None => true,
            Some((b'n', digits)) => digits.iter().all(u8::is_ascii_digit),
            Some(_) => false,
        }
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

/// Returns the text of the comment that begins `rest`, which may contain comments and ends with the line at the latest.
fn any_comment(rest: &[u8]) -> &[u8] {
    let mut depth = 0_u32;
    for (index, byte) in rest.iter().enumerate() {
        match byte {
            b'(' => depth += 1,
            b')' if depth == 0 => return &rest[..index],
            b')' => depth -= 1,
            _ => {}
        }
    }
    // Without its end for all inner ones, the first closing parenthesis ends it.
    match rest.iter().position(|byte| *byte == b')') {
        Some(end) if depth > 0 => &rest[..end],
        _ => rest,
    }
}

/// Returns the message of a comment `MSG, …`.
fn message(comment: &[u8]) -> Option<String> {
    let comment = decode(comment);
    let (key, text) = comment.split_once(',')?;
    key.trim().eq_ignore_ascii_case("msg").then(|| escaped(text.trim()))
}

/// Returns true for a line `MSG "text"` of Estlcam and EdingCNC.
fn is_message(line: &[u8]) -> bool {
    let (key, text) = line.trim_ascii_start().split_at_checked(3).unwrap_or_default();
    key.eq_ignore_ascii_case(b"msg") && text.trim_ascii_start().starts_with(b"\"")
}

/// Returns true for a comment that is a statement of Fagor: `RPT N10,N20`, `CALL 5`, `PCALL 6,P0=3`.
fn is_statement(comment: &[u8]) -> bool {
    let rest = ["RPT N", "CALL ", "PCALL "].into_iter().find_map(|word| {
        let (start, rest) = comment.split_at_checked(word.len())?;
        start.eq_ignore_ascii_case(word.as_bytes()).then_some(rest)
    });
    rest.is_some_and(|rest| {
        !rest.is_empty() && rest.iter().all(|byte| byte.is_ascii_digit() || b"NP,=-. ".contains(byte))
    })
}

/// Returns the character at a byte of the line, for a message.
fn shown(raw: &[u8], index: usize) -> String {
    let text = String::from_utf8_lossy(&raw[index..]);
    format!("{:?}", text.chars().next().unwrap_or_default())
}
