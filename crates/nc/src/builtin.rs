//! Opening of a part program by name or path.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use virtual_axes_core::text::{BuiltinFiles, builtin_names, builtin_text};

/// Opens the part program `name` of `builtin`, or the file `name` if there is none.
///
/// # Errors
///
/// Returns an error of the operating system if the file cannot be opened.
pub fn open_program(name: &str, builtin: &BuiltinFiles) -> io::Result<ProgramReader> {
    match builtin_text(builtin, name) {
        Some(text) => Ok(ProgramReader::Text(Cursor::new(text.to_owned()))),
        None => {
            let file = File::open(name).map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => {
                    let names: Vec<&str> = builtin_names(builtin).collect();
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

/// Returns the folder of a program, in which subprograms of other files are searched; `None` for a built-in program.
pub fn program_folder(name: &str, builtin: &BuiltinFiles) -> Option<PathBuf> {
    let path = Path::new(name);
    if builtin_text(builtin, name).is_some() || !path.is_file() {
        return None;
    }
    let folder = path.parent()?;
    Some(if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() })
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
