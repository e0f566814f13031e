//! Text of a part program: a file below the folder of the parameter `program_folder`, or the text of a goal.
//!
//! Peers choose the path. Every rejection of a path is the same text, so that it tells nothing about other files.

use std::fs::{self, File, OpenOptions};
use std::io::{BufReader, Cursor};
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Component, Path, PathBuf};
use std::time::Duration;

use virtual_axes_core::text::{BuiltinFiles, builtin_names, builtin_text, shortened};
use virtual_axes_nc::builtin::ProgramReader;

/// Largest file, bytes.
const MAX_FILE: u64 = 1 << 32;
/// Longest time to open a file.
const OPEN_TIMEOUT: Duration = Duration::from_secs(5);
/// Name of a program without a file in messages.
const TEXT_NAME: &str = "program";
/// Rejection of a path, whatever its reason.
const NOT_PERMITTED: &str = "is not a regular file of at most 4 GiB below program_folder that the node can read (links out of it are not followed)";

/// Source of a part program, with its name in messages.
pub struct ProgramText {
    /// Name in messages: the path, or `program`.
    pub name: String,
    /// Reader of the text.
    pub reader: ProgramReader,
    /// Folders of a file.
    pub folders: Option<ProgramFolders>,
}

/// Folders of a program file, without links in their paths.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramFolders {
    /// Folder of the file.
    pub own: PathBuf,
    /// Folder of the parameter `program_folder`.
    pub root: PathBuf,
}

impl ProgramText {
    /// Creates the source of a text.
    pub fn from_text(text: String) -> Self {
        let reader = ProgramReader::Text(Cursor::new(text));
        Self { name: TEXT_NAME.to_owned(), reader, folders: None }
    }

    /// Opens the part program `path` of `builtin`, or the file `path` below `root` if there is none, in at most 5 s.
    ///
    /// # Errors
    /// Text that begins with the path, if it is neither a built-in part program nor a regular file of at most 4 GiB below
    /// `root` that can be read.
    pub async fn open(path: String, builtin: &BuiltinFiles, root: Option<&Path>) -> Result<Self, String> {
        let name = shortened(&path);
        if let Some(text) = builtin_text(builtin, &path) {
            return Ok(Self { name, ..Self::from_text(text.to_owned()) });
        }
        let Some(root) = root.map(Path::to_owned) else {
            let names: Vec<&str> = builtin_names(builtin).collect();
            return Err(format!(
                "{name}: is not a built-in part program ({}), and no file can be run without the parameter program_folder",
                names.join(", ")
            ));
        };
        let opened = tokio::task::spawn_blocking(move || open_file(&root, &path));
        let (file, folders) = match tokio::time::timeout(OPEN_TIMEOUT, opened).await {
            Ok(Ok(opened)) => opened.map_err(|reason| format!("{name}: {reason}"))?,
            Ok(Err(error)) => return Err(format!("{name}: {error}")),
            Err(_) => return Err(format!("{name}: not opened within {} s", OPEN_TIMEOUT.as_secs())),
        };
        Ok(Self { name, reader: ProgramReader::File(BufReader::new(file)), folders: Some(folders) })
    }
}

/// Opens the file `path`, absolute or relative to `root`, below `root`.
fn open_file(root: &Path, path: &str) -> Result<(File, ProgramFolders), String> {
    let resolved =
        root.canonicalize().map_err(|error| format!("program_folder {}: {error}", root.display()))?;
    open_below(root, &resolved, Path::new(path)).ok_or_else(|| NOT_PERMITTED.to_owned())
}

fn open_below(given: &Path, root: &Path, path: &Path) -> Option<(File, ProgramFolders)> {
    let relative = match path.is_absolute() {
        true => path.strip_prefix(given).or_else(|_| path.strip_prefix(root)).ok()?,
        false => path,
    };
    if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return None;
    }
    let is_below = |path: &Path| path.starts_with(root);
    let path = root.join(relative).canonicalize().ok().filter(|path| is_below(path))?;
    // Opening a device can have an effect.
    if !path.symlink_metadata().ok()?.is_file() {
        return None;
    }
    // Without O_NONBLOCK, a named pipe would block until it has a writer.
    let flags = libc::O_NONBLOCK | libc::O_NOFOLLOW | libc::O_NOCTTY;
    let file = OpenOptions::new().read(true).custom_flags(flags).open(&path).ok()?;
    // The path may have been replaced between test and opening.
    let metadata = file.metadata().ok()?;
    let opened = fs::read_link(format!("/proc/self/fd/{}", file.as_raw_fd())).ok()?;
    let is_permitted = metadata.is_file() && metadata.len() <= MAX_FILE && is_below(&opened);
    let own = path.parent()?.to_owned();
    is_permitted.then(|| (file, ProgramFolders { own, root: root.to_owned() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn regular_files_below_the_folder_are_opened_and_all_other_paths_have_one_rejection() {
        let base = std::env::temp_dir().join(format!("virtual_axes_program_text_{}", std::process::id()));
        let (root, outside) = (base.join("programs"), base.join("outside"));
        fs::create_dir_all(root.join("sub")).expect("created");
        fs::create_dir_all(&outside).expect("created");
        for file in [root.join("a.nc"), root.join("sub/b.nc"), outside.join("secret")] {
            fs::write(file, "M2\n").expect("written");
        }
        symlink(root.join("a.nc"), root.join("inner.nc")).expect("linked");
        symlink(outside.join("secret"), root.join("out.nc")).expect("linked");
        symlink(&outside, root.join("folder")).expect("linked");
        symlink(&root, base.join("link")).expect("linked");
        symlink("/dev/zero", root.join("zero")).expect("linked");
        let absolute = root.join("a.nc").display().to_string();
        let through_link = base.join("link/sub/b.nc").display().to_string();
        for path in ["a.nc", "./sub/b.nc", "inner.nc", &absolute, &through_link] {
            assert!(open_file(&base.join("link"), path).is_ok(), "{path}");
        }
        let secret = outside.join("secret").display().to_string();
        for path in [
            "missing.nc",
            "out.nc",
            "folder/secret",
            "folder/missing",
            "sub/../a.nc",
            "../outside/secret",
            "../missing",
            "sub",
            ".",
            "",
            "zero",
            "/dev/zero",
            "/etc/passwd",
            "/etc/missing",
            &secret,
            "a.nc/b",
            "nul\0",
        ] {
            assert_eq!(open_file(&root, path).map(drop), Err(NOT_PERMITTED.to_owned()), "{path}");
        }
        assert!(open_file(&base.join("none"), "a.nc").is_err_and(|error| error.contains("program_folder")));
        fs::remove_dir_all(&base).expect("removed");
    }
}
