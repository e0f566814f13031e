//! Atomic output files: written to a temporary file and renamed when complete.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Stdout, Write};
use std::path::{Path, PathBuf};

/// Path of the standard output; writes go to the open stream, not to a newly opened file.
const STDOUT: &str = "/dev/stdout";
/// Maximum number of symbolic links followed in a row, as in Linux.
const MAX_LINKS: usize = 40;
/// Size of the write buffer, bytes: few system calls, and within the processor cache.
const BUFFER_BYTES: usize = 1 << 18;
/// Maximum number of names tried for the temporary file; terminated runs can leave some behind.
const MAX_NAMES: usize = 100;

/// Output file that is written atomically: to a temporary file in the same folder, renamed by
/// [`finish`](Self::finish). Dropping it before removes the temporary file and keeps an existing file.
///
/// Symbolic links are followed. Devices and pipes are written directly. Each error names the file.
#[derive(Debug)]
pub struct OutputFile {
    /// Name as given by the user.
    name: String,
    target: PathBuf,
    /// Temporary file; `None` if the target is written directly.
    partial: Option<PathBuf>,
    sink: BufWriter<Sink>,
}

#[derive(Debug)]
enum Sink {
    File(File),
    Stdout(Stdout),
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Sink::File(file) => file.write(bytes),
            Sink::Stdout(stdout) => stdout.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Sink::File(file) => file.flush(),
            Sink::Stdout(stdout) => stdout.flush(),
        }
    }
}

impl OutputFile {
    /// Creates the temporary file for `path`, or opens a device or pipe.
    ///
    /// # Errors
    /// Returns the errors of the file system, with `path`.
    pub fn create(path: &Path) -> io::Result<Self> {
        let name = path.display().to_string();
        let target = resolve_links(path);
        let opened = if is_stdout(path) {
            Ok((Sink::Stdout(io::stdout()), None))
        } else if is_device_or_pipe(path) {
            File::options().write(true).open(path).map(|file| (Sink::File(file), None))
        } else {
            create_temporary(&target).map(|(file, partial)| (Sink::File(file), Some(partial)))
        };
        let (sink, partial) = opened.map_err(|error| with_file_name(&name, &error))?;
        Ok(OutputFile { name, target, partial, sink: BufWriter::with_capacity(BUFFER_BYTES, sink) })
    }

    /// Returns the file name as given by the user.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Writes the buffer and renames the temporary file to its target.
    ///
    /// # Errors
    /// Returns the errors of the file system, with the file's name. An existing file is kept.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        let Some(partial) = &self.partial else { return Ok(()) };
        if let Ok(old) = fs::metadata(&self.target) {
            // Keeps the permissions of a replaced file where possible.
            let _ = fs::set_permissions(partial, old.permissions());
        }
        fs::rename(partial, &self.target).map_err(|error| with_file_name(&self.name, &error))?;
        self.partial = None;
        Ok(())
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sink.write(bytes).map_err(|error| with_file_name(&self.name, &error))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush().map_err(|error| with_file_name(&self.name, &error))
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if let Some(partial) = &self.partial {
            // An incomplete file is removed.
            let _ = fs::remove_file(partial);
        }
    }
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new(STDOUT)
}

/// Returns true for a device or a pipe, which is written directly.
pub(super) fn is_device_or_pipe(path: &Path) -> bool {
    is_stdout(path) || fs::metadata(path).is_ok_and(|found| !found.is_file())
}

/// Resolves symbolic links of `path`; the target does not need to exist.
fn resolve_links(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(next);
    }
    path
}

/// Creates a temporary file in the folder of `target`, with a name unique to this process, and removes those that killed
/// processes left. A lock on the file states that it is in use.
fn create_temporary(target: &Path) -> io::Result<(File, PathBuf)> {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    remove_abandoned(target, &name);
    let mut tried = 0;
    loop {
        let partial = target.with_file_name(format!(".{name}.{}.{tried}.partial", std::process::id()));
        tried += 1;
        match File::options().write(true).create_new(true).open(&partial) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists && tried < MAX_NAMES => {}
            opened => {
                return opened.map(|file| {
                    // Without locks, the process states that the file is in use.
                    let _ = file.try_lock();
                    (file, partial)
                });
            }
        }
    }
}

/// Removes temporary files of `target` whose processes have ended; a failure is ignored.
fn remove_abandoned(target: &Path, name: &str) {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let Some(process) = entry.file_name().to_str().and_then(|file| process_of(file, name)) else {
            continue;
        };
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        let is_free = || File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if is_file && has_ended(process) && is_free() {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Returns the process of a temporary file of the output `name`, `.NAME.PROCESS.NUMBER.partial`.
fn process_of(file: &str, name: &str) -> Option<u32> {
    let numbers = file.strip_prefix('.')?.strip_prefix(name)?.strip_prefix('.')?.strip_suffix(".partial")?;
    let (process, number) = numbers.split_once('.')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (is_number(process) && is_number(number)).then(|| process.parse().ok())?
}

/// Returns true if a process has ended, or is this one, which locks its files; false where that is unknown.
fn has_ended(process: u32) -> bool {
    process == std::process::id()
        || (Path::new("/proc/self").exists() && !Path::new(&format!("/proc/{process}")).exists())
}

fn with_file_name(name: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{name}: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_process_of_a_temporary_file_is_in_its_name() {
        assert_eq!(process_of(".a.csv.812.0.partial", "a.csv"), Some(812));
        for other in [
            "a.csv.812.0.partial",
            ".b.csv.812.0.partial",
            ".a.csv.812.partial",
            ".a.csv.8x.0.partial",
            ".a.csv.x.812.0.partial",
            ".a.csv.812.0.partial.csv",
        ] {
            assert_eq!(process_of(other, "a.csv"), None, "{other}");
        }
    }
}
