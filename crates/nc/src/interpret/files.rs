//! Subprograms in files beside the program: `drill.ngc` for `O<drill> call`, `O1234`, `1234.nc` for M98 P1234.

use std::fs;
use std::path::{Path, PathBuf};

use virtual_axes_core::text::escaped;

use super::dialect::Dialect;
use super::error::Outcome;
use super::options::InterpreterOptions;

/// Largest number of files of a folder that are considered.
const MAX_ENTRIES: usize = 10_000;
/// Largest file of a subprogram, bytes.
const MAX_FILE: u64 = 1 << 24;

/// Reads the file of a subprogram, if the folder has one: its name without folder, and its text.
///
/// # Errors
///
/// A file that cannot be read or is too large.
pub(super) fn subprogram_file(
    options: &InterpreterOptions,
    label: &str,
) -> Outcome<Option<(String, Vec<u8>)>> {
    let Some(path) = find(options, label) else { return Ok(None) };
    let failure = |error: std::io::Error| format!("O{label}: {}: {error}", path.display());
    let size = fs::metadata(&path).map_err(failure)?.len();
    if size > MAX_FILE {
        return Err(format!("O{label}: its file has {size} bytes, at most {MAX_FILE} are allowed"));
    }
    let text = fs::read(&path).map_err(failure)?;
    Ok(Some((file_name(&path), text)))
}

/// Returns the name of a file without its folder, for messages.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map(|file| escaped(&file.to_string_lossy())).unwrap_or_default()
}

/// Returns true for a regular file that the options permit as a subprogram.
pub(super) fn is_permitted(path: &Path, options: &InterpreterOptions) -> bool {
    let is_within = |root: &PathBuf| path.canonicalize().is_ok_and(|path| path.starts_with(root));
    path.is_file() && options.subprogram_root.as_ref().is_none_or(is_within)
}

fn find(options: &InterpreterOptions, label: &str) -> Option<PathBuf> {
    // The O of a name is a letter of the file: OO30.SSB, OBORE.SSB.
    let name = if options.dialect == Some(Dialect::Okuma) { &format!("o{label}") } else { label };
    let is_of = |stem: &str| is_of(stem, label) || stem.eq_ignore_ascii_case(name);
    let entries = fs::read_dir(options.subprogram_folder.as_ref()?).ok()?.take(MAX_ENTRIES);
    let mut found: Vec<_> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.file_stem().and_then(|stem| stem.to_str()).is_some_and(is_of))
        .filter(|path| is_permitted(path, options))
        .collect();
    found.sort();
    found.into_iter().next()
}

/// Returns true for a file name without extension that belongs to a label: the name, or `O` and the number with zeros.
fn is_of(stem: &str, label: &str) -> bool {
    let number = |text: &str| -> Option<u32> {
        text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok())?
    };
    match number(label) {
        Some(label) => number(stem.trim_start_matches(['O', 'o'])) == Some(label),
        None => stem.eq_ignore_ascii_case(label),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_find_their_files() {
        for (stem, label, is_found) in [
            ("drill", "drill", true),
            ("Drill", "drill", true),
            ("drill2", "drill", false),
            ("O1234", "1234", true),
            ("o0012", "12", true),
            ("12", "12", true),
            ("x12", "12", false),
        ] {
            assert_eq!(is_of(stem, label), is_found, "{stem} {label}");
        }
    }
}
