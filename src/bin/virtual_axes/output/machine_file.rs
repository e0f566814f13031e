//! The `--out` option: a machine file as output.

use std::io::{self, Write};
use std::path::Path;

use virtual_axes_io::files::OutputFile;

/// Rejects a file name with an extension other than `.yaml` or `.yml`. Devices and pipes have no extension.
pub fn check_name(path: &Path) -> Result<(), String> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        None | Some("yaml" | "yml") => Ok(()),
        Some(_) => {
            Err(format!("{}: a machine file is YAML; its extension must be .yaml or .yml", path.display()))
        }
    }
}

/// Writes the file atomically.
pub fn write(path: &Path, text: &str) -> io::Result<()> {
    let mut file = OutputFile::create(path)?;
    file.write_all(text.as_bytes())?;
    file.finish()
}
