//! Lines of a program, with bounded memory and a bounded number of repetitions.

use std::io::{BufRead, Cursor, Seek, SeekFrom};
use std::sync::Arc;

use virtual_axes_core::encoding::TextEncoding;

use super::dialect::is_word_line;
use super::encoding::read_line;
use super::error::Outcome;
use super::foreign::{foreign_format, philips_format};
use super::limits::{MAX_IDLE_LINES, MAX_LINE};
use super::report::FileLine;

/// Largest number of files of subprograms.
const MAX_FILES: usize = 100;

/// Start of a line in the source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Place {
    /// Number of the file: 0 is the program.
    file: usize,
    /// Bytes before the line.
    offset: u64,
    /// Number of lines before the line.
    lines: usize,
}

impl Place {
    /// Start of the program.
    pub(super) const START: Self = Self { file: 0, offset: 0, lines: 0 };
}

/// Lines at the start of a file in which its head is searched.
const HEAD_LINES: usize = 200;

/// Encoding, start and format of a file by its first lines.
#[derive(Debug)]
pub(super) struct SourceHead {
    encoding: TextEncoding,
    /// Line of the first percent sign, if only a text without words stands before it.
    start: Place,
    /// Format of another control.
    pub foreign: Option<&'static str>,
}

impl SourceHead {
    /// Reads the first lines of a file, and returns to its start.
    pub(super) fn of<R: BufRead + Seek>(reader: &mut R) -> Self {
        let encoding = TextEncoding::of(reader.fill_buf().unwrap_or_default());
        let mut head = Self { encoding, start: Place::START, foreign: None };
        let (mut offset, mut line) = (0, Vec::new());
        for lines in 0..HEAD_LINES {
            let read = read_line(encoding, reader, MAX_LINE, &mut line).unwrap_or(0);
            if read == 0 {
                break;
            }
            let text = String::from_utf8_lossy(&line).trim().to_ascii_uppercase();
            head.foreign = foreign_format(&text);
            if text.starts_with('%') && !text.starts_with("%_N_") && head.foreign.is_none() {
                head.start = Place { offset, lines, ..Place::START };
                let mut is_blank = text == "%PM";
                while is_blank && read_line(encoding, reader, MAX_LINE, &mut line).is_ok_and(|read| read > 0)
                {
                    let text = String::from_utf8_lossy(&line).trim().to_ascii_uppercase();
                    is_blank = text.is_empty();
                    head.foreign = philips_format(&text);
                }
                break;
            }
            if head.foreign.is_some() || is_word_line(&text) {
                break;
            }
            offset += read as u64;
        }
        // An error of the operating system occurs again with the first line.
        let _ = reader.seek(SeekFrom::Start(0));
        head
    }
}

/// File of subprograms.
#[derive(Debug)]
struct SubprogramFile {
    name: Arc<str>,
    /// Text, and its place that is read next.
    text: Cursor<Vec<u8>>,
    encoding: TextEncoding,
}

/// Source of lines.
#[derive(Debug)]
pub(super) struct LineSource<R> {
    reader: R,
    next: Place,
    /// First line of the program, which a text without words may precede.
    start: Place,
    /// Files of subprograms.
    files: Vec<SubprogramFile>,
    encoding: TextEncoding,
    /// Line of the program that was read last, from 1.
    program_line: usize,
    /// End of the farthest line that was read, bytes.
    farthest: u64,
    /// Number of lines that jumps may repeat, in all and from now on.
    repeated_lines: u64,
    repeats_left: u64,
    /// Number of lines repeated since the last step of the program.
    idle_lines: u64,
    /// True after the first line with text.
    has_text: bool,
    /// True after an error from which reading does not continue.
    has_failed: bool,
}

impl<R: BufRead + Seek> LineSource<R> {
    pub(super) fn new(mut reader: R, repeated_lines: u64) -> Self {
        let SourceHead { encoding, start, .. } = SourceHead::of(&mut reader);
        // An error of the operating system occurs again with the first line.
        let is_there = reader.seek(SeekFrom::Start(start.offset)).is_ok();
        let start = if is_there { start } else { Place::START };
        Self {
            reader,
            next: start,
            start,
            encoding,
            files: Vec::new(),
            program_line: 1,
            farthest: 0,
            repeated_lines,
            repeats_left: repeated_lines,
            idle_lines: 0,
            has_text: false,
            has_failed: false,
        }
    }

    /// Returns the number of the line of the program that was read last, from 1: in other files, that of the call.
    pub(super) fn line(&self) -> usize {
        self.program_line
    }

    /// Returns the line that was read last of the file of a subprogram; `None` in the program.
    pub(super) fn line_of_file(&self) -> Option<FileLine> {
        let file = self.files.get(self.next.file.checked_sub(1)?)?;
        Some(FileLine { name: Arc::clone(&file.name), line: self.next.lines.max(1) })
    }

    /// Adds the text of a file, and returns its start.
    pub(super) fn add_file(&mut self, name: &str, text: Vec<u8>) -> Outcome<Place> {
        if self.files.len() >= MAX_FILES {
            return Err(format!("the program calls more than {MAX_FILES} files"));
        }
        let encoding = TextEncoding::of(&text);
        self.files.push(SubprogramFile { name: name.into(), text: Cursor::new(text), encoding });
        Ok(Place { file: self.files.len(), ..Place::START })
    }

    /// Returns the start of the next line.
    pub(super) fn place(&self) -> Place {
        self.next
    }

    /// Continues at `place`; the start of the file is the first line of the program.
    pub(super) fn jump(&mut self, place: Place) -> Outcome<()> {
        let place = if place == Place::START { self.start } else { place };
        let start = SeekFrom::Start(place.offset);
        match place.file.checked_sub(1).and_then(|index| self.files.get_mut(index)) {
            Some(file) => file.text.seek(start),
            None => self.reader.seek(start),
        }
        .map_err(|error| error.to_string())?;
        self.has_text &= place != self.start && place.offset > 0;
        self.next = place;
        if place.file == 0 {
            self.program_line = place.lines.max(1);
        }
        Ok(())
    }

    /// Continues at the first line.
    pub(super) fn rewind(&mut self) -> Outcome<()> {
        self.has_text = false;
        self.jump(Place::START)
    }

    /// Reads the next line into `line`, without its end; returns false at the end of the program.
    ///
    /// # Errors
    ///
    /// A line that is too long, too many repeated lines, or an error of the operating system.
    pub(super) fn read(&mut self, line: &mut Vec<u8>) -> Outcome<bool> {
        self.has_failed = true;
        if !self.read_raw(line)? {
            self.has_failed = false;
            return Ok(false);
        }
        if self.next.file == 0 && self.next.offset > self.farthest {
            self.farthest = self.next.offset;
            self.has_failed = false;
            return Ok(true);
        }
        self.idle_lines += 1;
        if self.idle_lines > MAX_IDLE_LINES {
            return Err(format!("endless loop: {MAX_IDLE_LINES} repeated lines without motion or event"));
        }
        if self.repeats_left == 0 {
            return Err(format!(
                "endless loop: the loops of the program repeat more than {} lines",
                self.repeated_lines
            ));
        }
        self.repeats_left -= 1;
        self.has_failed = false;
        Ok(true)
    }

    /// Returns true after an error from which reading does not continue.
    pub(super) fn has_failed(&self) -> bool {
        self.has_failed
    }

    /// Counts the repeated lines without a step from 0.
    pub(super) fn reset_idle_lines(&mut self) {
        self.idle_lines = 0;
    }

    /// Reads the next line without counting repetitions; returns false at the end of the program.
    pub(super) fn read_raw(&mut self, line: &mut Vec<u8>) -> Outcome<bool> {
        loop {
            let limit = MAX_LINE + 2;
            let read = match self.next.file.checked_sub(1).and_then(|index| self.files.get_mut(index)) {
                Some(file) => read_line(file.encoding, &mut file.text, limit, line),
                None => read_line(self.encoding, &mut self.reader, limit, line),
            }
            .map_err(|error| error.to_string())?;
            if read == 0 {
                return Ok(false);
            }
            let is_first = self.next.offset == 0;
            let Place { file, offset, lines } = self.next;
            self.next = Place { file, offset: offset + read as u64, lines: lines + 1 };
            if file == 0 {
                self.program_line = lines + 1;
            }
            if line.len() > MAX_LINE {
                return Err(format!("the line is longer than {MAX_LINE} bytes"));
            }
            if is_first && line.starts_with("\u{feff}".as_bytes()) {
                line.drain(..3);
            }
            let text = line.trim_ascii();
            // Head of a file of Okuma.
            if !self.has_text && text.starts_with(b"$") && text.ends_with(b"%") {
                self.has_text = true;
                continue;
            }
            // A percent sign encloses the program: before its first line with text, which may follow it, and alone after
            // its last. Others begin a comment. Heads %_N_ of Sinumerik are lines.
            if let Some(rest) = text.strip_prefix(b"%")
                && !rest.get(..3).is_some_and(|head| head.eq_ignore_ascii_case(b"_N_"))
            {
                if self.has_text && rest.trim_ascii().is_empty() {
                    return Ok(false);
                }
                self.has_text = true;
                continue;
            }
            self.has_text |= !is_comment(text);
            return Ok(true);
        }
    }
}

/// Returns true if a line, or its rest, has nothing but comments.
fn is_comment(text: &[u8]) -> bool {
    let text = text.trim_ascii();
    match text.first() {
        None | Some(b';') => true,
        Some(b'(') => match text.iter().position(|byte| *byte == b')') {
            Some(end) => is_comment(&text[end + 1..]),
            None => false,
        },
        Some(_) => false,
    }
}
