//! Programs of controls and systems that are not supported, by their words.

use std::io::{BufRead, Seek, SeekFrom};

use virtual_axes_core::encoding::TextEncoding;

use super::encoding::{LINE_BYTES, SEARCHED_BYTES, read_line};
use super::line_code::code_of;

/// First word of another control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ForeignWord {
    /// Name of the program's format.
    pub format: &'static str,
    /// Source line, from 1.
    pub line: usize,
}

impl ForeignWord {
    /// Searches the first MiB of a program and returns to its start.
    pub(super) fn of<R: BufRead + Seek>(source: &mut R) -> Option<Self> {
        let encoding = TextEncoding::of(source.fill_buf().unwrap_or_default());
        let (mut bytes, mut line, mut found) = (0, Vec::new(), None);
        for number in 1.. {
            let read = read_line(encoding, source, LINE_BYTES, &mut line).unwrap_or(0);
            bytes += read;
            if read == 0 || bytes > SEARCHED_BYTES || found.is_some() {
                break;
            }
            let text = String::from_utf8_lossy(&line).trim().to_ascii_uppercase();
            found = foreign_word(&text).map(|format| Self { format, line: number });
        }
        source.seek(SeekFrom::Start(0)).ok()?;
        found
    }
}

/// Text with places that a program fills.
pub(super) const TEMPLATE: &str = "a template with {…}";

/// Returns the format of a line in upper case, by words that only one control has.
fn foreign_word(line: &str) -> Option<&'static str> {
    let number =
        line.strip_prefix('N').map(|rest| rest.trim_start_matches(|digit: char| digit.is_ascii_digit()));
    let words = number.filter(|rest| rest.starts_with(' ')).unwrap_or(line).trim_start();
    let starts = |known: &[&str]| known.iter().any(|word| words.starts_with(word));
    if words.starts_with("(PGM,") && words.contains("NAME=") {
        return Some("a program of Acramatic");
    }
    if starts(&[
        "$IF ", "$IF[", "$ENDIF", "$FOR ", "$WHILE ", "$SWITCH ", "#VAR", "#ENDVAR", "#TRAFO", "#CS ", "#HSC",
    ]) {
        return Some("a program of ISG (TwinCAT CNC)");
    }
    if ["RAPID X", "RAPID Y", "RAPID Z"].into_iter().any(|word| words.starts_with(word)) {
        return Some("a conversational program of Anilam");
    }
    let code = code_of(words);
    let is_condition = code.starts_with("IF[") && code.ends_with("]THEN");
    if starts(&["GOSUB "]) || code == "ENDSUB" || is_condition {
        return Some("a program of EdingCNC with SUB, IF or WHILE");
    }
    if ["{$", "{{", "{%"].into_iter().any(|brace| code.contains(brace)) {
        return Some(TEMPLATE);
    }
    let has_braces = code.match_indices('{').any(|(at, _)| {
        let mut before = code[..at].chars().rev();
        before.next().is_some_and(|letter| letter.is_ascii_uppercase())
            && before.next().is_none_or(|letter| !letter.is_ascii_alphabetic())
    });
    let is_statement =
        ["WHILEITERATIONS", "SETVAR.", "SETGLOBAL."].into_iter().any(|word| code.starts_with(word));
    (has_braces || is_statement).then_some("a program of RepRapFirmware with expressions or conditions")
}

/// Returns the name of the format of a program that begins with `%PM`, if its first line in upper case has the number of a
/// program of Philips, from N9000 on.
pub(super) fn philips_format(line: &str) -> Option<&'static str> {
    let number = line.strip_prefix("N9").unwrap_or_default();
    let has_number = number.bytes().take_while(u8::is_ascii_digit).count() >= 3;
    has_number.then_some("a program of Philips (Heidenhain) controls 532 and 3000")
}

/// Returns the name of the format that a line in upper case shows, if it is no G code of a supported dialect.
pub(super) fn foreign_format(line: &str) -> Option<&'static str> {
    const APT: [&str; 8] =
        ["PARTNO", "TOOL PATH/", "MULTAX/", "LOADTL/", "CUTTER/", "GOTO/", "MACHIN/", "TLDATA/"];
    let text = line.trim_start_matches(|letter: char| letter.is_ascii_digit() || letter == ' ');
    if ["BEGIN PGM", "BLK FORM", "TOOL CALL", "CYCL DEF"].iter().any(|word| text.starts_with(word)) {
        return Some("a conversational program of Heidenhain (Klartext)");
    }
    if APT.iter().any(|word| text.starts_with(word)) {
        return Some("a cutter location file (APT, CLS)");
    }
    let is_iso =
        line.starts_with('%') && line.ends_with('*') && (line.contains(" G71") || line.contains(" G70"));
    is_iso.then_some("a program of Heidenhain in DIN/ISO")
}
