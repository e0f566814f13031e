//! Turning programs, which are no programs for the machines of this interpreter: the words that show one.

use std::io::{BufRead, Seek, SeekFrom};

use virtual_axes_core::encoding::TextEncoding;

use super::dialect::Dialect;
use super::encoding::{LINE_BYTES, SEARCHED_BYTES, read_line};
use super::line_code::{code_of, has_word};

/// Points from which a program is one for turning.
const ENOUGH: u32 = 4;
/// Canned cycles for holes.
const HOLES: [&str; 9] = ["G81", "G82", "G83", "G84", "G85", "G86", "G87", "G88", "G89"];
/// Turning cycles of Sinumerik.
const SINUMERIK: [&str; 12] = [
    "CYCLE93(",
    "CYCLE94(",
    "CYCLE95(",
    "CYCLE96(",
    "CYCLE97(",
    "CYCLE98(",
    "CYCLE930(",
    "CYCLE940(",
    "CYCLE950(",
    "CYCLE951(",
    "CYCLE952(",
    "DIAMON",
];
/// Contour cycles of LinuxCNC, by the number Q of a subprogram.
const LINUXCNC: [&str; 7] = ["G70", "G71", "G71.1", "G71.2", "G72", "G72.1", "G72.2"];

/// Word of a turning program with its source line, from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TurningWord {
    /// Word, or words, of the line.
    pub text: String,
    /// Source line, from 1.
    pub line: usize,
}

/// Evidence in the lines read so far.
#[derive(Debug, Default)]
struct Evidence {
    /// First line of each kind of evidence, and its text.
    found: [Option<(usize, &'static str)>; KINDS.len()],
    has_mill_words: bool,
    has_x: bool,
    has_z: bool,
}

/// Kinds of evidence: points and text. Of a mill, each may occur alone.
const KINDS: [(u32, &str); 14] = [
    (ENOUGH, "G71, G72 or G70 with a contour, a turning cycle"),
    (ENOUGH, "a turning cycle of Sinumerik"),
    (3, "G76 with P and Q, a threading cycle"),
    (2, "a tool with its offset, as in T0101"),
    (2, "the speed limit G50 S, G92 S or LIMS"),
    (2, "G96, constant surface speed"),
    (2, "G99 without a canned cycle, feed per revolution"),
    (2, "increments U and W beside X and Z"),
    (2, "G7 or G8, X as diameter or radius"),
    (1, "G18, the plane ZX"),
    (1, "G95, feed per revolution"),
    (2, "G33, a thread"),
    (ENOUGH, "G76, a threading cycle"),
    (ENOUGH, "the speed limit G50 S"),
];
const CONTOUR_CYCLE: usize = 0;
const NAMED_CYCLE: usize = 1;
const THREADING: usize = 2;
const TOOL: usize = 3;
const SPEED_LIMIT: usize = 4;
const SURFACE_SPEED: usize = 5;
const PER_REVOLUTION: usize = 6;
const INCREMENTS: usize = 7;
const DIAMETER: usize = 8;
// Of Sinumerik and LinuxCNC.
const PLANE: usize = 9;
const FEED_PER_REVOLUTION: usize = 10;
const THREAD: usize = 11;
const LINUXCNC_THREAD: usize = 12;
const OKUMA_LIMIT: usize = 13;

impl TurningWord {
    /// Searches the first MiB of a program and returns to its start. Programs with words Y, A, B or with canned cycles G81
    /// and on are for mills, unless they have turning cycles.
    pub(super) fn of<R: BufRead + Seek>(source: &mut R, dialect: Dialect) -> Option<Self> {
        if matches!(dialect, Dialect::Grbl | Dialect::Marlin) {
            return None;
        }
        let mut evidence = Evidence::default();
        let encoding = TextEncoding::of(source.fill_buf().unwrap_or_default());
        let (mut bytes, mut line) = (0, Vec::new());
        for number in 1.. {
            let read = read_line(encoding, source, LINE_BYTES, &mut line).unwrap_or(0);
            bytes += read;
            if read == 0 || bytes > SEARCHED_BYTES {
                break;
            }
            let code = code_of(&String::from_utf8_lossy(&line).trim().to_ascii_uppercase());
            evidence.add(&code, number, dialect);
        }
        source.seek(SeekFrom::Start(0)).ok()?;
        evidence.word()
    }
}

impl Evidence {
    fn add(&mut self, code: &str, number: usize, dialect: Dialect) {
        if dialect == Dialect::Sinumerik {
            if let Some(word) = SINUMERIK.into_iter().find(|word| has_name(code, word)) {
                self.found[NAMED_CYCLE].get_or_insert((number, word.trim_end_matches('(')));
            }
            let has = |letter: char, name: &str| has_letter(code, letter) || has_name(code, name);
            (self.has_x, self.has_z) = (self.has_x || has('X', "X="), self.has_z || has('Z', "Z="));
            self.has_mill_words |=
                has('Y', "Y=") || has('A', "A=") || has('B', "B=") || code.contains("CYCLE");
            if has_name(code, "LIMS=") {
                self.found[SPEED_LIMIT].get_or_insert((number, KINDS[SPEED_LIMIT].1));
            }
            for (kind, word) in
                [(SURFACE_SPEED, "G96"), (PLANE, "G18"), (FEED_PER_REVOLUTION, "G95"), (THREAD, "G33")]
            {
                if has_word(code, word) {
                    self.found[kind].get_or_insert((number, KINDS[kind].1));
                }
            }
            return;
        }
        // Expressions and text of macros have no words of their own.
        if code.contains(['[', '#', '=', '<']) {
            self.has_mill_words |= has_letter(code, 'Y');
            return;
        }
        let [x, y, z] = ['X', 'Y', 'Z'].map(|letter| has_letter(code, letter));
        (self.has_x, self.has_z) = (self.has_x || x, self.has_z || z);
        let cycle = HOLES.iter().any(|cycle| has_word(code, cycle));
        self.has_mill_words |= y || cycle || ['A', 'B'].iter().any(|letter| has_letter(code, *letter));
        let [p, q, r, s, u, w] = ['P', 'Q', 'R', 'S', 'U', 'W'].map(|letter| has_letter(code, letter));
        let is_contour = p && q && !x && !z && !r && !has_letter(code, 'I');
        let is_linuxcnc = dialect == Dialect::LinuxCnc;
        let tests = [
            (
                CONTOUR_CYCLE,
                is_contour && ["G70", "G71", "G72", "G73"].iter().any(|word| has_word(code, word))
                    || is_linuxcnc && q && LINUXCNC.iter().any(|word| has_word(code, word)),
            ),
            (LINUXCNC_THREAD, is_linuxcnc && p && !x && !y && has_word(code, "G76")),
            (OKUMA_LIMIT, dialect == Dialect::Okuma && s && has_word(code, "G50")),
            (THREADING, p && q && !y && has_word(code, "G76") && (x || u || !z)),
            (TOOL, is_turning_tool(code)),
            (SPEED_LIMIT, s && !x && !z && (has_word(code, "G50") || has_word(code, "G92"))),
            (SURFACE_SPEED, has_word(code, "G96")),
            (PER_REVOLUTION, has_word(code, "G99")),
            (INCREMENTS, (u || w) && (x || z) && !has_word(code, "G28")),
            (DIAMETER, is_linuxcnc && (has_word(code, "G7") || has_word(code, "G8"))),
            (PLANE, is_linuxcnc && has_word(code, "G18")),
            (FEED_PER_REVOLUTION, is_linuxcnc && has_word(code, "G95")),
            (THREAD, is_linuxcnc && has_word(code, "G33")),
        ];
        for (kind, _) in tests.into_iter().filter(|(_, is_found)| *is_found) {
            self.found[kind].get_or_insert((number, KINDS[kind].1));
        }
    }

    /// Returns the evidence with the most points, if there is enough of it.
    fn word(&self) -> Option<TurningWord> {
        let found = KINDS.iter().zip(self.found);
        let found: Vec<_> = found
            .filter_map(|((points, _), found)| found.map(|(line, text)| (*points, text, line)))
            .collect();
        let points: u32 = found.iter().map(|(points, ..)| points).sum();
        let has_cycle = found.iter().any(|(points, ..)| *points >= ENOUGH);
        let is_turning = !self.has_mill_words && self.has_x && self.has_z && points >= ENOUGH;
        if !has_cycle && !is_turning {
            return None;
        }
        let most = found.into_iter().rev().max_by_key(|(points, ..)| *points);
        most.map(|(_, text, line)| TurningWord { text: text.to_owned(), line })
    }
}

/// Returns true if a line in upper case without blanks has a word with a letter and a number.
fn has_letter(code: &str, letter: char) -> bool {
    code.match_indices(letter).any(|(at, _)| {
        code[at + 1..].starts_with(|next: char| next.is_ascii_digit() || "+-.".contains(next))
            && !code[..at].ends_with(|before: char| before.is_ascii_alphabetic())
    })
}

/// Returns true if a line has a name that is no part of another one.
fn has_name(code: &str, name: &str) -> bool {
    code.match_indices(name)
        .any(|(at, _)| !code[..at].ends_with(|before: char| before.is_ascii_alphabetic() || before == '_'))
}

/// Returns true for `T0101`: a tool with an offset of the same number, without M6.
fn is_turning_tool(code: &str) -> bool {
    !has_word(code, "M6")
        && !has_word(code, "M06")
        && code.match_indices('T').any(|(at, _)| {
            let digits: String = code[at + 1..].chars().take_while(char::is_ascii_digit).collect();
            // On Okuma, the number of the nose radius compensation stands before.
            let is_of_turret = matches!(digits.len(), 4 | 6);
            is_of_turret && {
                let [tool, offset] = [4, 2].map(|end| &digits[digits.len() - end..][..2]);
                tool == offset && tool != "00"
            }
        })
}
