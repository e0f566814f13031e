//! Machine file in the resources of the archive.

use std::path::{Path, PathBuf};

/// Path of the machine file below the resources of the archive.
pub const MACHINE_FILE: &str = "machine.yaml";
/// Largest machine file, bytes.
const MAX_BYTES: u64 = 4 << 20;

/// Returns the text of the machine file below `fmuResourceLocation`.
///
/// # Errors
/// A location that is no file URI, or a file that cannot be read.
pub(crate) fn machine_file(location: &str) -> Result<String, String> {
    let file = folder(location)?.join(MACHINE_FILE);
    read(&file).map_err(|error| format!("{}: {error}", file.display()))
}

fn read(file: &Path) -> std::io::Result<String> {
    use std::io::Read;
    let mut text = String::new();
    std::fs::File::open(file)?.take(MAX_BYTES).read_to_string(&mut text)?;
    Ok(text)
}

/// Returns the folder of a URI: `file:///path`, `file://localhost/path` or `file:/path`.
fn folder(location: &str) -> Result<PathBuf, String> {
    let invalid = || format!("fmuResourceLocation is {location:?}; it must be a URI file:///FOLDER");
    let rest = location.strip_prefix("file:").ok_or_else(invalid)?;
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.strip_prefix("localhost").unwrap_or(rest),
        None => rest,
    };
    if !path.starts_with('/') {
        return Err(invalid());
    }
    let path = percent_decoded(path).ok_or_else(invalid)?;
    // A drive letter of Windows follows the slash: /C:/folder.
    let is_drive = path.as_bytes().get(2) == Some(&b':');
    Ok(PathBuf::from(if is_drive { &path[1..] } else { &path }))
}

/// Returns the text with its escapes, `%20`, replaced; none for an invalid escape.
fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        rest = tail;
        if first == b'%' {
            let (digits, tail) = rest.split_at_checked(2)?;
            let digit = |byte: u8| char::from(byte).to_digit(16);
            bytes.push((digit(digits[0])? * 16 + digit(digits[1])?) as u8);
            rest = tail;
        } else {
            bytes.push(first);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forms_of_file_uris_name_the_same_folder() {
        for uri in ["file:///tmp/a%20b", "file:/tmp/a b", "file://localhost/tmp/a%20b"] {
            assert_eq!(folder(uri), Ok(PathBuf::from("/tmp/a b")), "{uri}");
        }
        assert_eq!(folder("file:///C:/a"), Ok(PathBuf::from("C:/a")));
    }

    #[test]
    fn other_locations_are_rejected_with_their_text() {
        for uri in
            ["", "/tmp", "http://host/a", "file://host/a", "file:///a%2", "file:///a%zz", "file:///%ff"]
        {
            let error = folder(uri).expect_err("no folder");
            assert!(error.contains(uri) && error.contains("file:///FOLDER"), "{error}");
        }
    }
}
