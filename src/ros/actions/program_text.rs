//! Text of a part program: a file, or the text of a goal.

use std::fs::{File, OpenOptions};
use std::io::{BufReader, Cursor};
use std::os::unix::fs::OpenOptionsExt;
use std::time::Duration;

use virtual_axes_core::text::{BuiltinFiles, builtin_text, escaped};
use virtual_axes_nc::builtin::ProgramReader;

/// Largest file, bytes.
const MAX_FILE: u64 = 1 << 32;
/// Longest time to open a file.
const OPEN_TIMEOUT: Duration = Duration::from_secs(5);
/// Name of a program without a file in messages.
const TEXT_NAME: &str = "program";

/// Source of a part program, with its name in messages.
pub struct ProgramText {
    /// Name in messages: the path, or `program`.
    pub name: String,
    /// Reader of the text.
    pub reader: ProgramReader,
}

impl ProgramText {
    /// Creates the source of a text.
    pub fn from_text(text: String) -> Self {
        Self { name: TEXT_NAME.to_owned(), reader: ProgramReader::Text(Cursor::new(text)) }
    }

    /// Opens the part program `path` of `builtin`, or the file `path` if there is none, in at most 5 s.
    ///
    /// # Errors
    /// Text that begins with the path, if it is neither a built-in part program nor a regular file of at most 4 GiB that can
    /// be read.
    pub async fn open(path: String, builtin: &BuiltinFiles) -> Result<Self, String> {
        let name = escaped(&path).to_string();
        if let Some(text) = builtin_text(builtin, &path) {
            return Ok(Self { name, reader: ProgramReader::Text(Cursor::new(text.to_owned())) });
        }
        let opened = tokio::task::spawn_blocking(move || open_file(&path));
        let file = match tokio::time::timeout(OPEN_TIMEOUT, opened).await {
            Ok(Ok(opened)) => opened.map_err(|reason| format!("{name}: {reason}"))?,
            Ok(Err(error)) => return Err(format!("{name}: {error}")),
            Err(_) => return Err(format!("{name}: not opened within {} s", OPEN_TIMEOUT.as_secs())),
        };
        Ok(Self { name, reader: ProgramReader::File(BufReader::new(file)) })
    }
}

fn open_file(path: &str) -> Result<File, String> {
    // Without O_NONBLOCK, a named pipe would block until it has a writer.
    let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path);
    let file = file.map_err(|error| error.to_string())?;
    let metadata = file.metadata().map_err(|error| error.to_string())?;
    if !metadata.is_file() {
        return Err("is not a regular file".to_owned());
    }
    if metadata.len() > MAX_FILE {
        return Err(format!("has {} bytes; at most {MAX_FILE} are allowed", metadata.len()));
    }
    Ok(file)
}
