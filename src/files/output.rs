//! Output files that stand under their names only when they are whole.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file to write. It is written beside its place and takes it in [`finish`](Self::finish); dropped
/// before, it leaves nothing behind, and what stood there stays.
///
/// Links are followed. A device or a pipe is written to as it is. Each error names the file.
#[derive(Debug)]
pub struct OutputFile {
    /// As the user wrote it.
    name: String,
    target: PathBuf,
    /// Where it is written until it is whole; none for what is written in place.
    partial: Option<PathBuf>,
    file: BufWriter<File>,
}

impl OutputFile {
    /// Opens what becomes `path`.
    ///
    /// # Errors
    /// Those of the file system, with `path`.
    pub fn create(path: &Path) -> io::Result<Self> {
        let name = path.display().to_string();
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let partial = (!is_in_place(&target)).then(|| partial_name(&target));
        let mut options = File::options();
        let file = match &partial {
            None => options.write(true).open(&target),
            Some(partial) => options.write(true).create_new(true).open(partial),
        };
        let file = BufWriter::new(file.map_err(|error| named(&name, &error))?);
        Ok(OutputFile { name, target, partial, file })
    }

    /// The file's name as it was given.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hands everything over and puts the file in its place.
    ///
    /// # Errors
    /// Those of the file system, with the file's name; what stood there before stays then.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        let Some(partial) = &self.partial else { return Ok(()) };
        if let Ok(old) = fs::metadata(&self.target) {
            // What replaces a file is as readable as that was; where that cannot be, it is as new.
            let _ = fs::set_permissions(partial, old.permissions());
        }
        fs::rename(partial, &self.target).map_err(|error| named(&self.name, &error))?;
        self.partial = None;
        Ok(())
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes).map_err(|error| named(&self.name, &error))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush().map_err(|error| named(&self.name, &error))
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if let Some(partial) = &self.partial {
            // It was made here, and is of no use to anybody.
            let _ = fs::remove_file(partial);
        }
    }
}

/// Whether there is something that is written to as it is: a device, a pipe.
pub(super) fn is_in_place(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| !found.is_file())
}

/// A name beside `target` that no other process uses.
fn partial_name(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    target.with_file_name(format!(".{name}.{}.partial", std::process::id()))
}

fn named(name: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{name}: {error}"))
}
