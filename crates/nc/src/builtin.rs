//! Built-in part programs, and the opening of a part program by name or path.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};

/// Part program that is built in, from `config/programs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuiltinProgram {
    /// Name.
    pub name: &'static str,
    /// Description: the motion and its purpose.
    pub description: &'static str,
    /// Text in G code.
    pub text: &'static str,
}

/// Built-in part programs.
pub const BUILTIN_PROGRAMS: [BuiltinProgram; 4] = [
    BuiltinProgram {
        name: "circle-diamond-square",
        description: "part program: outlines of a contouring test piece in the manner of ISO 10791-7",
        text: include_str!("../config/programs/circle-diamond-square.nc"),
    },
    BuiltinProgram {
        name: "s-path-five-axis",
        description: "part program: S-shaped five-axis path with tool center point control",
        text: include_str!("../config/programs/s-path-five-axis.nc"),
    },
    BuiltinProgram {
        name: "pocket",
        description: "part program: rectangular pocket with a helix, rounded corners, a subroutine and loops",
        text: include_str!("../config/programs/pocket.nc"),
    },
    BuiltinProgram {
        name: "finishing-raster",
        description: "part program: finishing raster of short lines on a curved surface",
        text: include_str!("../config/programs/finishing-raster.nc"),
    },
];

impl BuiltinProgram {
    /// Returns the built-in part program `name`; `None` if there is none.
    pub fn find(name: &str) -> Option<&'static Self> {
        BUILTIN_PROGRAMS.iter().find(|program| program.name == name)
    }

    /// Returns the names of the built-in part programs.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN_PROGRAMS.iter().map(|program| program.name)
    }

    /// Returns a reader of the text.
    pub fn reader(&self) -> ProgramReader {
        ProgramReader::Text(Cursor::new(self.text.to_owned()))
    }
}

/// Opens the built-in part program `name`, or the file `name` if there is none.
///
/// # Errors
///
/// Returns an error of the operating system if the file cannot be opened.
pub fn open_program(name: &str) -> io::Result<ProgramReader> {
    match BuiltinProgram::find(name) {
        Some(program) => Ok(program.reader()),
        None => {
            let file = File::open(name).map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => {
                    let names: Vec<&str> = BuiltinProgram::names().collect();
                    io::Error::new(
                        error.kind(),
                        format!("{error}; built-in part programs are {}", names.join(", ")),
                    )
                }
                _ => error,
            })?;
            Ok(ProgramReader::File(BufReader::new(file)))
        }
    }
}

/// Reader of a part program.
#[derive(Debug)]
pub enum ProgramReader {
    /// File.
    File(BufReader<File>),
    /// Text.
    Text(Cursor<String>),
}

impl Read for ProgramReader {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::File(reader) => reader.read(buffer),
            Self::Text(reader) => reader.read(buffer),
        }
    }
}

impl BufRead for ProgramReader {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        match self {
            Self::File(reader) => reader.fill_buf(),
            Self::Text(reader) => reader.fill_buf(),
        }
    }

    fn consume(&mut self, amount: usize) {
        match self {
            Self::File(reader) => reader.consume(amount),
            Self::Text(reader) => reader.consume(amount),
        }
    }
}

impl Seek for ProgramReader {
    fn seek(&mut self, position: SeekFrom) -> std::io::Result<u64> {
        match self {
            Self::File(reader) => reader.seek(position),
            Self::Text(reader) => reader.seek(position),
        }
    }
}
