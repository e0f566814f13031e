//! Dialects of G code, and their detection from the content of a program.

use std::collections::HashSet;
use std::fmt;
use std::io::{BufRead, Seek, SeekFrom};
use std::path::Path;
use std::str::FromStr;

use virtual_axes_core::encoding::TextEncoding;

use super::encoding::{LINE_BYTES, SEARCHED_BYTES, read_line};
use super::foreign::foreign_format;
use super::line_code::{code_of, has_word};

/// Points from which a dialect is detected.
const ENOUGH: u32 = 3;

/// Dialect of part programs: the control for which a program was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Dialect {
    /// LinuxCNC: RS-274/NGC with O-words and named parameters.
    #[default]
    LinuxCnc,
    /// Fanuc: ISO code with custom macro B.
    Fanuc,
    /// Haas: as Fanuc, with codes of its own.
    Haas,
    /// Sinumerik: native programs of Siemens.
    Sinumerik,
    /// grbl: hobby routers and lasers.
    Grbl,
    /// Mach3 and Mach4.
    Mach3,
    /// Okuma: milling programs of OSP controls.
    Okuma,
    /// Marlin and other firmware of printers that mill: RepRapFirmware, Smoothieware.
    Marlin,
}

impl Dialect {
    /// All dialects.
    pub const ALL: [Self; 8] = [
        Self::LinuxCnc,
        Self::Fanuc,
        Self::Haas,
        Self::Sinumerik,
        Self::Grbl,
        Self::Mach3,
        Self::Okuma,
        Self::Marlin,
    ];

    /// Returns the name, as in `--dialect`.
    pub fn name(self) -> &'static str {
        match self {
            Self::LinuxCnc => "linuxcnc",
            Self::Fanuc => "fanuc",
            Self::Haas => "haas",
            Self::Sinumerik => "sinumerik",
            Self::Grbl => "grbl",
            Self::Mach3 => "mach3",
            Self::Okuma => "okuma",
            Self::Marlin => "marlin",
        }
    }

    /// Returns the bit of the dialect in sets.
    pub(super) fn bit(self) -> u8 {
        1 << self as u8
    }

    /// Returns true for Fanuc and Haas, with macro B, and for Okuma, whose lines are translated to it.
    pub(super) fn has_macro_b(self) -> bool {
        matches!(self, Self::Fanuc | Self::Haas | Self::Okuma)
    }

    /// Returns true for firmware of small machines: grbl and Marlin.
    pub(super) fn is_firmware(self) -> bool {
        matches!(self, Self::Grbl | Self::Marlin)
    }

    /// Returns the dialect of files with an extension that only one control has.
    fn of_extension(extension: &str) -> Option<Self> {
        match extension.to_ascii_lowercase().as_str() {
            "mpf" | "spf" => Some(Self::Sinumerik),
            "min" | "ssb" | "lib" => Some(Self::Okuma),
            "eia" => Some(Self::Fanuc),
            _ => None,
        }
    }
}

impl fmt::Display for Dialect {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Dialect {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|dialect| dialect.name().eq_ignore_ascii_case(text));
        found.ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            format!("{text}: not a dialect; must be one of {known}")
        })
    }
}

/// Dialect that was detected, and the text that decided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DetectedDialect {
    /// Dialect; LinuxCNC without evidence.
    pub dialect: Dialect,
    /// Text that decided, with its source line from 1; `None` without evidence.
    pub evidence: Option<(String, usize)>,
}

impl DetectedDialect {
    /// Returns the note on a dialect that was detected and is not the default one: line and text.
    pub fn note(&self) -> Option<(usize, String)> {
        let (text, line) = self.evidence.as_ref().filter(|_| self.dialect != Dialect::LinuxCnc)?;
        Some((*line, format!("dialect {}, detected from {text}; --dialect sets another", self.dialect)))
    }

    /// Detects the dialect from the first MiB of a program and the extension of its file `name`, and returns to its start.
    /// A source that cannot be read has no evidence.
    pub fn of<R: BufRead + Seek>(source: &mut R, name: &str) -> Self {
        let mut scores: [Score; Dialect::ALL.len()] = Default::default();
        let extension = Path::new(name).extension().and_then(|extension| extension.to_str());
        if let Some(extension) = extension
            && let Some(dialect) = Dialect::of_extension(extension)
        {
            // Programs of Okuma have words that alone would be those of Sinumerik.
            let points = if dialect == Dialect::Okuma { 4 * ENOUGH } else { ENOUGH };
            scores[dialect as usize].add(points, &format!("the extension {extension}"), 1);
        }
        // A comment in a file of LinuxCNC may be on the control for which it was before.
        let has_comments = !extension.is_some_and(|extension| extension.eq_ignore_ascii_case("ngc"));
        let (mut bytes, mut line) = (0, Vec::new());
        let encoding = TextEncoding::of(source.fill_buf().unwrap_or_default());
        for number in 1.. {
            let read = read_line(encoding, source, LINE_BYTES, &mut line).unwrap_or(0);
            bytes += read;
            if read == 0 || bytes > SEARCHED_BYTES {
                break;
            }
            let text = String::from_utf8_lossy(&line).trim().to_ascii_uppercase();
            if foreign_format(&text).is_some() {
                scores = Default::default();
                break;
            }
            add_evidence(&text, number, has_comments, &mut scores);
        }
        if source.seek(SeekFrom::Start(0)).is_err() {
            scores = Default::default();
        }
        let best = Dialect::ALL.into_iter().zip(scores).rev().max_by_key(|(_, score)| score.points);
        match best {
            Some((dialect, Score { points, text, .. })) if points >= ENOUGH => {
                Self { dialect, evidence: text }
            }
            _ => Self { dialect: Dialect::LinuxCnc, evidence: None },
        }
    }
}

/// Returns true for a text of which at least half of the lines are words of G code, and one is at all.
/// Programs of other controls, whose format an error names, are such a text too.
pub fn is_g_code(head: &[u8]) -> bool {
    let encoding = TextEncoding::of(head);
    let (mut rest, mut line) = (head, Vec::new());
    let (mut words, mut others) = (0, 0);
    while read_line(encoding, &mut rest, LINE_BYTES, &mut line).is_ok_and(|read| read > 0) {
        let line = String::from_utf8_lossy(&line).trim().to_ascii_uppercase();
        if foreign_format(&line).is_some() {
            return true;
        }
        let code = code_of(&line);
        if code.is_empty() || code.starts_with('%') {
            continue;
        }
        *(if is_word_line(&line) { &mut words } else { &mut others }) += 1;
    }
    words > 0 && words >= others
}

/// Returns true for a line in upper case that begins with a word of G code.
pub(super) fn is_word_line(line: &str) -> bool {
    let code = code_of(line);
    let mut letters = code.trim_start_matches('/').chars();
    letters.next().is_some_and(|letter| "GMNXYZTFSO#:".contains(letter))
        && letters.next().is_some_and(|next| next.is_ascii_digit() || "+-.<[=".contains(next))
}

/// Evidence for one dialect.
#[derive(Debug, Clone, Default)]
struct Score {
    points: u32,
    /// Rules that have counted, by their indices.
    rules: HashSet<usize>,
    /// Points of the text.
    strongest: u32,
    text: Option<(String, usize)>,
}

impl Score {
    /// Adds the points of a text in a line.
    fn add(&mut self, points: u32, text: &str, line: usize) {
        self.points += points;
        if points > self.strongest {
            (self.strongest, self.text) = (points, Some((text.to_owned(), line)));
        }
    }
}

pub(super) const LINUXCNC: u8 = 1 << Dialect::LinuxCnc as u8;
pub(super) const FANUC: u8 = 1 << Dialect::Fanuc as u8;
pub(super) const HAAS: u8 = 1 << Dialect::Haas as u8;
const SINUMERIK: u8 = 1 << Dialect::Sinumerik as u8;
pub(super) const GRBL: u8 = 1 << Dialect::Grbl as u8;
pub(super) const MACH3: u8 = 1 << Dialect::Mach3 as u8;
pub(super) const OKUMA: u8 = 1 << Dialect::Okuma as u8;
pub(super) const MARLIN: u8 = 1 << Dialect::Marlin as u8;

/// Bits of all dialects.
pub(super) const ALL: u8 = u8::MAX;

/// Part of a line that a rule requires.
#[derive(Debug, Clone, Copy)]
enum Pattern {
    /// Word with its number: `G187`, not `G18` or `G187.1`.
    Word(&'static str),
    /// Text in the line without blanks and comments.
    Code(&'static str),
    /// Text at the start of the line without blanks and comments.
    Start(&'static str),
    /// Text in a comment of one of the first lines.
    Comment(&'static str),
    /// Comment after two slashes.
    Slashes,
    /// Number of a program or subprogram alone.
    ProgramNumber,
    /// O-word with a keyword or a name.
    OWord,
    /// Assignment to a name or address: `X=`, `R1=`.
    Assignment,
    /// Head `$NAME.MIN%` of a file.
    Head,
    /// Word with another letter in the line: `G15` with H, which is not that of G43 or G44.
    Pair(&'static str, char),
    /// Condition that a line follows: `IF [VC1 EQ 1] N10`.
    ConditionalLine,
    /// Common variable: `VC1`, `VC[1]`.
    CommonVariable,
    /// Command of grbl: `$H`, `$$`, `$10=3`.
    Command,
    /// M code from 200 on, which LinuxCNC lacks.
    HighAuxiliary,
    /// G28 with letters alone: `G28 X Y`.
    Homing,
}

use Pattern::{
    Assignment, Code, Command, Comment, CommonVariable, ConditionalLine, Head, HighAuxiliary, Homing, OWord,
    Pair, ProgramNumber, Slashes, Start, Word,
};

/// Evidence: dialects as bits, points, and the text.
const RULES: &[(u8, u32, Pattern)] = &[
    (LINUXCNC, 8, OWord),
    (LINUXCNC, 6, Code("#<")),
    (LINUXCNC, 4, Word("G33.1")),
    (LINUXCNC, 3, Word("G61.1")),
    (LINUXCNC, 3, Word("G43.1")),
    (LINUXCNC, 3, Word("G5.2")),
    (LINUXCNC, 3, Code("G64P")),
    (LINUXCNC, 6, Comment("LINUXCNC")),
    (LINUXCNC, 6, Comment("EMC2")),
    (LINUXCNC, 6, Comment("PATHPILOT")),
    (LINUXCNC | MACH3, 2, Word("G91.1")),
    (LINUXCNC | MACH3, 2, Word("G59.1")),
    (FANUC | HAAS, 3, ProgramNumber),
    (FANUC | HAAS, 4, Code("IF[")),
    (FANUC | HAAS, 4, Code("WHILE[")),
    (FANUC | HAAS, 4, Code("GOTO")),
    (FANUC | HAAS, 4, Code("G4X")),
    (FANUC | HAAS, 4, Code("G04X")),
    (FANUC | HAAS, 4, Code("G4U")),
    (FANUC | HAAS, 4, Code("G04U")),
    (FANUC | HAAS, 3, Word("G65")),
    (FANUC | HAAS, 3, Word("G66")),
    (FANUC | HAAS, 3, Word("G54.1")),
    (FANUC | HAAS, 3, Code("#3006=")),
    (FANUC | HAAS, 3, Code("#3000=")),
    (FANUC | HAAS, 3, Code("DPRNT[")),
    (FANUC | HAAS, 3, Word("G68.2")),
    (FANUC | HAAS | MACH3, 3, Word("G15")),
    (FANUC | HAAS | MACH3, 3, Word("G16")),
    (FANUC | HAAS | MACH3, 3, Word("G51")),
    (FANUC | HAAS | MACH3, 3, Word("G68")),
    (FANUC | HAAS | MACH3, 3, Word("G69")),
    (FANUC, 3, Code("G05.1Q")),
    (FANUC, 3, Code("G5.1Q")),
    (FANUC, 3, Word("G05P10000")),
    (FANUC, 1, Word("G43.4")),
    (FANUC, 1, Word("G43.5")),
    (FANUC, 3, Word("G53.1")),
    // First line of posts for PathPilot.
    (LINUXCNC, 6, Code("G64G50G17")),
    // Units in the first line of posts of NX.
    (FANUC, 3, Code("G90G70")),
    (FANUC, 3, Code("G90G71")),
    (FANUC, 6, Comment("FANUC")),
    (FANUC, 6, Comment("MAZAK")),
    (FANUC, 6, Comment("BROTHER")),
    (FANUC, 6, Comment("HURCO")),
    (FANUC, 6, Comment("INTERCON")),
    (HAAS, 6, Comment("HAAS")),
    (HAAS, 4, Word("G187")),
    (HAAS, 4, Word("G154")),
    (HAAS, 4, Word("G150")),
    (HAAS | MACH3, 3, Pair("G12", 'I')),
    (HAAS | MACH3, 3, Pair("G13", 'I')),
    (HAAS, 4, Word("G101")),
    (HAAS, 4, Word("G268")),
    (HAAS, 4, Code("G70I")),
    (HAAS, 4, Code("G71I")),
    (HAAS, 4, Code("G72I")),
    (HAAS, 4, Code("G47P")),
    (HAAS, 4, Word("G234")),
    (HAAS, 4, Word("G254")),
    (HAAS, 3, Word("G103")),
    (HAAS, 4, Word("M97")),
    (HAAS, 4, Word("G129")),
    (SINUMERIK, 8, Start("%_N_")),
    (SINUMERIK, 6, Assignment),
    (SINUMERIK, 6, Code("CYCLE")),
    (SINUMERIK, 6, Code("MCALL")),
    (SINUMERIK, 6, Code("TRAORI")),
    (SINUMERIK, 6, Code("TRAFOOF")),
    (SINUMERIK, 6, Code("SUPA")),
    (SINUMERIK, 6, Code("STOPRE")),
    (SINUMERIK, 6, Code("WORKPIECE(")),
    (SINUMERIK, 6, Code("DEFREAL")),
    (SINUMERIK, 6, Code("DEFINT")),
    (SINUMERIK, 6, Code("$P_")),
    (SINUMERIK, 6, Code("$TC_")),
    (SINUMERIK, 6, Code("$AC_")),
    (SINUMERIK, 6, Code("GOTOF")),
    (SINUMERIK, 6, Code("GOTOB")),
    (SINUMERIK, 6, Code("MSG(")),
    (SINUMERIK, 4, Start("TRANS")),
    (SINUMERIK, 4, Code("ATRANS")),
    (SINUMERIK, 4, Code("AROT")),
    (SINUMERIK, 4, Word("G641")),
    (SINUMERIK, 4, Word("G642")),
    (SINUMERIK, 4, Word("G645")),
    (SINUMERIK, 3, Word("G500")),
    (SINUMERIK, 6, Word("G710")),
    (SINUMERIK, 6, Word("G700")),
    (SINUMERIK, 3, Word("G153")),
    (SINUMERIK, 3, Word("G601")),
    (SINUMERIK, 2, Word("M17")),
    (SINUMERIK, 4, Code("G4F")),
    (SINUMERIK, 6, Code("FFWON")),
    (SINUMERIK, 6, Code("COMPCAD")),
    (SINUMERIK, 6, Code("ORIWKS")),
    (SINUMERIK, 6, Code("POCKET")),
    (SINUMERIK, 6, Code("HOLES")),
    // Steps of ShopMill.
    (SINUMERIK, 12, Start("E_HEAD(")),
    (SINUMERIK, 12, Start("F_HEAD(")),
    (SINUMERIK, 6, Code("F_ROUGH(")),
    (SINUMERIK, 6, Comment("SINUMERIK")),
    (SINUMERIK, 6, Comment("SIEMENS")),
    (GRBL, 6, Command),
    (GRBL, 6, Comment("GRBL")),
    (GRBL, 6, Comment("FLUIDNC")),
    (MARLIN, 6, Comment("MARLIN")),
    (MARLIN, 6, Comment("REPRAP")),
    (MARLIN, 6, Comment("SMOOTHIEWARE")),
    (MARLIN, 6, Comment("HEADER_TYPE:")),
    (MARLIN, 3, Code("M117")),
    (MARLIN, 3, HighAuxiliary),
    (MARLIN, 3, Homing),
    (MARLIN, 3, Code("G4S")),
    (MARLIN, 3, Code("G04S")),
    // With S: machine builders have M codes of these numbers.
    (MARLIN, 3, Code("M104S")),
    (MARLIN, 3, Code("M106S")),
    (MARLIN, 3, Code("M140S")),
    // Units and arc centers in a line, as posts of Vectric write them.
    (MACH3, 6, Code("G70G91.1")),
    (MACH3, 6, Code("G71G91.1")),
    (MACH3, 6, Slashes),
    (MACH3, 6, Comment("MACH3")),
    (MACH3, 6, Comment("MACH2")),
    (MACH3, 6, Comment("MACH4")),
    (MACH3, 6, Comment("UCCNC")),
    (OKUMA, 12, Head),
    (OKUMA, 8, Pair("G15", 'H')),
    (OKUMA, 6, Pair("G16", 'H')),
    (OKUMA, 4, Pair("G56", 'H')),
    (OKUMA, 4, Pair("G116", 'T')),
    (OKUMA, 4, Pair("G111", 'T')),
    (OKUMA, 16, ConditionalLine),
    (OKUMA, 16, CommonVariable),
    (OKUMA, 6, Code("NCYL")),
    (OKUMA, 6, Code("VTLCN")),
    (OKUMA, 6, Start("MODIN")),
    (OKUMA, 12, Start("CALLO")),
    (OKUMA, 4, Start("RTS")),
    (OKUMA, 6, Comment("OKUMA")),
];

/// Lines at the start of a program whose comments are evidence.
const COMMENT_LINES: usize = 60;

/// Adds the evidence of a line in upper case; `has_comments` if comments count.
fn add_evidence(line: &str, number: usize, has_comments: bool, scores: &mut [Score; Dialect::ALL.len()]) {
    let mut code = code_of(line);
    // Texts for the operator.
    if let Some(message) = ["M117", "M118", "M0"].into_iter().find(|message| code.starts_with(message)) {
        code.truncate(message.len());
    } else if code.starts_with('%') && !code.starts_with("%_N_") {
        code.truncate(1);
    }
    for (index, (dialects, points, pattern)) in RULES.iter().enumerate() {
        if !has_comments && matches!(pattern, Comment(_)) && *dialects != LINUXCNC {
            continue;
        }
        let Some(text) = pattern.text_in(line, &code, number) else { continue };
        for (dialect, score) in Dialect::ALL.into_iter().zip(scores.iter_mut()) {
            if dialects & (1 << dialect as u8) != 0 && score.rules.insert(index) {
                score.add(*points, text, number);
            }
        }
    }
}

impl Pattern {
    /// Returns the text that satisfies the pattern.
    fn text_in(self, line: &str, code: &str, number: usize) -> Option<&'static str> {
        let found = |is_found: bool, text| is_found.then_some(text);
        match self {
            Word(word) => found(has_word(code, word), word),
            Code(text) => found(code.contains(text), text),
            Start(text) => found(code.starts_with(text), text),
            Comment(text) => {
                let is_comment = |at: usize| line[..at].contains(['(', ';']);
                found(number <= COMMENT_LINES && line.find(text).is_some_and(is_comment), text)
            }
            Slashes => found(line.trim_start().starts_with("//"), "a comment after //"),
            ProgramNumber => found(is_program_number(code), "the program number O"),
            OWord => found(is_o_word(code), "an O-word"),
            Assignment => found(has_assignment(code), "an assignment with ="),
            Head => found(code.starts_with('$') && code.ends_with('%'), "the head $"),
            Pair(word, letter) => {
                let is_tool_length = has_word(code, "G43") || has_word(code, "G44");
                found(has_word(code, word) && code.contains(letter) && !is_tool_length, word)
            }
            ConditionalLine => found(has_conditional_line(code), "IF with a line"),
            CommonVariable => found(has_common_variable(code), "a variable VC"),
            Command => found(is_command(code), "a command $"),
            Homing => found(is_homing(code), "G28 with letters alone"),
            HighAuxiliary => found(has_high_auxiliary(code), "an M code from 200 on"),
        }
    }
}

fn is_program_number(code: &str) -> bool {
    let rest = code.strip_prefix(['O', ':']).unwrap_or_default();
    let after = rest.trim_start_matches(|letter: char| letter.is_ascii_digit());
    after.len() < rest.len() && (after.is_empty() || after.starts_with(['(', 'G', 'N', 'M', 'T']))
}

fn is_o_word(code: &str) -> bool {
    let Some(rest) = code.strip_prefix('O') else { return false };
    let keyword = rest.trim_start_matches(|letter: char| letter.is_ascii_digit());
    let is_keyword = ["SUB", "ENDSUB", "CALL", "IF", "WHILE", "DO", "REPEAT", "RETURN"]
        .into_iter()
        .any(|word| keyword.starts_with(word));
    rest.starts_with('<') || (keyword.len() < rest.len() && is_keyword)
}

/// Returns true for `IF[VC1EQ1]N10`: the name of a line follows the condition, which has no parameters of other controls.
fn has_conditional_line(code: &str) -> bool {
    let Some((before, condition)) = code.split_once("IF[") else { return false };
    let mut depth = 1_u32;
    let end = condition.find(|letter| {
        depth = match letter {
            '[' => depth + 1,
            ']' => depth - 1,
            _ => depth,
        };
        depth == 0
    });
    let is_followed = end.is_some_and(|end| condition[end + 1..].starts_with('N'));
    is_followed && !before.starts_with('O') && !code.contains('#')
}

/// Returns true for `VC1` and `VC[1]`.
fn has_common_variable(code: &str) -> bool {
    code.match_indices("VC").any(|(at, _)| {
        code[at + 2..].starts_with(|next: char| next.is_ascii_digit() || next == '[')
            && !code[..at].ends_with(|before: char| before.is_ascii_alphabetic() || before == '_')
    })
}

/// Returns true for a command of grbl: `$$`, `$H`, `$J=…`, `$10=3`.
fn is_command(code: &str) -> bool {
    let Some(command) = code.strip_prefix('$') else { return false };
    let is_name = ["$", "#", "I", "G", "N", "C", "H", "X", "SLP", "HX", "HY", "HZ"].contains(&command);
    let setting = command.split_once('=').map(|(setting, _)| setting);
    is_name || setting.is_some_and(|name| name == "J" || name.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Returns true for `G28 X Y`, as firmware for printers and routers has it.
fn is_homing(code: &str) -> bool {
    let axes = code.strip_prefix("G28").unwrap_or_default();
    !axes.is_empty() && axes.bytes().all(|axis| b"XYZ".contains(&axis))
}

/// Returns true for a line that begins with an M code from 200 on; M428 to M430 are those of LinuxCNC.
fn has_high_auxiliary(code: &str) -> bool {
    let Some(rest) = code.strip_prefix('M') else { return false };
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    rest[..digits].parse().is_ok_and(|number: u32| number >= 200 && !(428..=430).contains(&number))
}

fn has_assignment(code: &str) -> bool {
    code.match_indices('=').any(|(at, _)| {
        let before = &code[..at];
        let is_part = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
        let name = &before[before.trim_end_matches(is_part).len()..];
        let sign = before[..before.len() - name.len()].chars().next_back();
        name.starts_with(|letter: char| letter.is_ascii_alphabetic())
            && !matches!(sign, Some('#' | '$' | '<' | '['))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detected(text: &str) -> (&'static str, Option<usize>) {
        let found = DetectedDialect::of(&mut std::io::Cursor::new(text), "part.nc");
        (found.dialect.name(), found.evidence.map(|(_, line)| line))
    }

    #[test]
    fn dialects_are_detected_by_their_words() {
        for (text, expected) in [
            ("G21 G90\nG1 X1 F100\nM2\n", ("linuxcnc", None)),
            ("G21\no<pocket> call [3]\n", ("linuxcnc", Some(2))),
            ("#<depth>=3\n", ("linuxcnc", Some(1))),
            ("%\nO1000 (PART)\nG28 G91 Z0\nM30\n%\n", ("fanuc", Some(2))),
            ("%\nO1000\nG187 P1\nM30\n%\n", ("haas", Some(3))),
            ("G90\n#101=#101+1\nIF [#101 LT 5] GOTO 10\n", ("fanuc", Some(3))),
            ("; part\nN10 G0 X=R1 Y=20\n", ("sinumerik", Some(2))),
            ("N10 G54 D1\nN20 TRAORI\n", ("sinumerik", Some(2))),
            ("G43.4 H1\nG0 A40\nG4 P0.4\n", ("linuxcnc", None)),
            ("G90 G54 G64 G50 G17 G40 G80 G94 G91.1 G49\nM201 (SDC 0)\n", ("linuxcnc", Some(1))),
            ("%\nN10 G40 G17 G90 G71\nN20 G91 G28 Z0.0\nN30 T01 M06\n", ("fanuc", Some(2))),
            ("$H\nG21\nG0 X1\n", ("grbl", Some(1))),
            ("$I ; build\n$10=3\nG0 X1\n", ("grbl", Some(1))),
            ("G21\nM2000;custom\nG0 X1\n", ("marlin", Some(2))),
            ("G68 X0 Y0 R30\nG0 X1\n", ("fanuc", Some(1))),
            ("(post: Mach3)\nG68 A0 B0 R30\n", ("mach3", Some(1))),
            ("M117 Pocket, holes\nG28 X Y\n", ("marlin", Some(1))),
            ("% pocket\nG0 Z3\nG28 Z\n", ("marlin", Some(3))),
            ("%\nO1\nG13 I0.25 F10.\n", ("haas", Some(2))),
            ("M428\nG0 X1\n", ("linuxcnc", None)),
            ("G21\nM3 P100\nG4 S2\nG0 X1\n", ("marlin", Some(3))),
            (";FLAVOR:Marlin\nG0 X1\n", ("marlin", Some(1))),
            ("G21\nM106 S255\nG0 X1\n", ("marlin", Some(2))),
            ("O1\nG0 X1.\nM106\nM107\nM84\nM201\n", ("fanuc", Some(1))),
            ("CALL OBORE PX=1\nG0 X1\n", ("okuma", Some(1))),
            ("1 BEGIN PGM A MM\n2 FN 0: Q1=5\n", ("linuxcnc", None)),
            ("(post: grbl)\nG0 X1\n", ("grbl", Some(1))),
            ("(Mach3 mill)\nG0 X1\n", ("mach3", Some(1))),
            ("N10G00G21G17G90G40G49G80\nN20G71G91.1\nN30T1M06\n", ("mach3", Some(2))),
            ("G20\nG70 G91.1\n", ("mach3", Some(2))),
            ("G20\nG91.1\n", ("linuxcnc", None)),
            ("%\n//DATE=01-02-24 TIME=11:53\nG70\nG0 X1\n", ("mach3", Some(2))),
            ("$PART.MIN%\nG0 X1\n", ("okuma", Some(1))),
            ("O1001\nG15 H1\nG56 Z10. H1\n", ("okuma", Some(2))),
            ("G56 G43 H3 G0 X10\nM2\n", ("linuxcnc", None)),
            ("IF [VC1 EQ 2] N10\nX=VC2\n", ("okuma", Some(1))),
            ("N5 IF [VTLCN EQ 2] NEXT\n", ("okuma", Some(1))),
            ("o100 if [exists[#<p>] NE 1.]\n", ("linuxcnc", Some(1))),
            ("M17\nG15\nG0 X1\n", ("fanuc", Some(2))),
            ("#100=ACOS[0.5]\n#101=[#100*2]\nG0 X#101\n", ("linuxcnc", None)),
        ] {
            assert_eq!(detected(text), expected, "{text:?}");
        }
    }

    #[test]
    fn an_extension_is_evidence() {
        for (name, text, expected) in [
            ("PART.MPF", "G90 G0 X1\nM30\n", "sinumerik"),
            ("/jobs/part.eia", "G90 G0 X1\nM30\n", "fanuc"),
            ("PART.MIN", "G90 G0 X1\nM30\n", "okuma"),
            ("G116-NEW.LIB", "G0 X1\nRTS\n", "okuma"),
            ("PART.MIN", "G90 G0 X1\nSB=1500 M13\nM30\n", "okuma"),
            ("part.eia", "(HAAS VF-2)\nG90 G0 X1\nM30\n", "haas"),
            ("part.nc", "G90 G0 X1\nM30\n", "linuxcnc"),
        ] {
            let found = DetectedDialect::of(&mut std::io::Cursor::new(text), name);
            assert_eq!(found.dialect.name(), expected, "{name}");
        }
    }

    #[test]
    fn names_of_dialects_are_read_without_regard_to_case() {
        assert_eq!("Haas".parse(), Ok(Dialect::Haas));
        let error = "heidenhain".parse::<Dialect>().unwrap_err();
        assert_eq!(
            error,
            "heidenhain: not a dialect; must be one of linuxcnc, fanuc, haas, sinumerik, grbl, mach3, okuma, marlin"
        );
    }
}
