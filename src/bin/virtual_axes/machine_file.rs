//! `--out`: a machine file that a command writes.

use std::io::{self, Write};
use std::path::Path;

use virtual_axes_io::files::OutputFile;

/// Refuses a name that says that it is something else; devices and pipes have no extension.
pub fn check_name(path: &Path) -> Result<(), String> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        None | Some("yaml" | "yml") => Ok(()),
        Some(_) => Err(format!("{}: a machine file is YAML: .yaml", path.display())),
    }
}

/// Writes it; it stands under its name only when it is whole.
pub fn write(path: &Path, text: &str) -> io::Result<()> {
    let mut file = OutputFile::create(path)?;
    file.write_all(text.as_bytes())?;
    file.finish()
}
