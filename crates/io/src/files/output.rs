//! Output files that stand under their names only when they are whole.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Stdout, Write};
use std::path::{Path, PathBuf};

/// The standard output by its name; it is the same stream then, not the file behind it opened anew.
const STDOUT: &str = "/dev/stdout";
/// Most links that are followed from one to the next; as many as Linux follows.
const MOST_LINKS: usize = 40;
/// Bytes that are gathered before they are handed over: few calls, within a processor's cache.
const GATHERED: usize = 1 << 18;
/// Most names that are tried for a partial file: earlier runs that were killed can have left some.
const MOST_NAMES: usize = 100;

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
    /// Opens what becomes `path`.
    ///
    /// # Errors
    /// Those of the file system, with `path`.
    pub fn create(path: &Path) -> io::Result<Self> {
        let name = path.display().to_string();
        let target = resolved(path);
        let opened = if is_stdout(path) {
            Ok((Sink::Stdout(io::stdout()), None))
        } else if is_in_place(path) {
            File::options().write(true).open(path).map(|file| (Sink::File(file), None))
        } else {
            create_beside(&target).map(|(file, partial)| (Sink::File(file), Some(partial)))
        };
        let (sink, partial) = opened.map_err(|error| named(&name, &error))?;
        Ok(OutputFile { name, target, partial, sink: BufWriter::with_capacity(GATHERED, sink) })
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
        self.sink.write(bytes).map_err(|error| named(&self.name, &error))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush().map_err(|error| named(&self.name, &error))
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

fn is_stdout(path: &Path) -> bool {
    path == Path::new(STDOUT)
}

/// Whether there is something that is written to as it is: a device, a pipe.
pub(super) fn is_in_place(path: &Path) -> bool {
    is_stdout(path) || fs::metadata(path).is_ok_and(|found| !found.is_file())
}

/// Where links from `path` lead, also to what is not there yet.
fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(next) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(next);
    }
    path
}

/// A new file beside `target`, under a name that no other run uses.
fn create_beside(target: &Path) -> io::Result<(File, PathBuf)> {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let mut tried = 0;
    loop {
        let partial = target.with_file_name(format!(".{name}.{}.{tried}.partial", std::process::id()));
        tried += 1;
        match File::options().write(true).create_new(true).open(&partial) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists && tried < MOST_NAMES => {}
            opened => return opened.map(|file| (file, partial)),
        }
    }
}

fn named(name: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{name}: {error}"))
}
