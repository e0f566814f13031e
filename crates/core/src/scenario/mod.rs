//! Scenarios: test motions in YAML files.
//!
//! A scenario file contains a start point, a feed and moves. [`Scenario::program`] plans its path and feed profile for
//! a machine. `virtual_axes_builtin::SCENARIOS` has the test motions of Prévost et al.
//!
//! ```yaml
//! description: Line, half circle and return line
//! feed_m_min: 10           # default feed of the moves; feed_rpm for rotary moves
//! rest_s: 0.5              # rest before the first and after the last move
//! moves:
//!   - line: {x_mm: 60}     # other joints keep their positions
//!   - arc: {center: {x_mm: 60, y_mm: 15}, angle_deg: 180}
//!   - line: {x_mm: 0}
//!     feed_m_min: 5
//! ```

mod build;
mod coordinates;
mod error;
mod file;

use std::path::Path as FilePath;

use crate::config::MachineConfig;
use crate::encoding::decode_text;
use crate::path::Program;
use crate::text::{BuiltinFiles, builtin_names, builtin_text, escaped, nearest_name};
use crate::yaml;

pub use error::ScenarioError;

/// Maximum size of a scenario file.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Test motion read from a scenario file. [`Self::program`] checks it against a machine.
#[derive(Debug, Clone)]
pub struct Scenario {
    name: String,
    file: file::ScenarioFile,
}

impl Scenario {
    /// Returns the YAML text of the scenario `name` of `builtin`.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`].
    pub fn builtin_text(name: &str, builtin: &BuiltinFiles) -> Result<&'static str, ScenarioError> {
        builtin_text(builtin, name).ok_or_else(|| unknown(name, builtin, "unknown scenario"))
    }

    /// Loads the scenario `name` of `builtin`, or the file `name` if there is none.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`] if the file cannot be read, [`ScenarioError::Invalid`] if it is not a scenario.
    pub fn load(name: &str, builtin: &BuiltinFiles) -> Result<Self, ScenarioError> {
        if let Some(text) = builtin_text(builtin, name) {
            return Self::from_yaml(text, name);
        }
        let failed = |error: std::io::Error| unknown(name, builtin, &error.to_string());
        let length = std::fs::metadata(FilePath::new(name)).map_err(failed)?.len();
        if length > MAX_FILE_BYTES {
            return Err(unknown(
                name,
                builtin,
                &format!("size is {length} bytes, at most {MAX_FILE_BYTES} are allowed"),
            ));
        }
        let text = decode_text(&std::fs::read(name).map_err(failed)?);
        Self::from_yaml(&text.map_err(|reason| unknown(name, builtin, &reason))?, name)
    }

    /// Parses the text of a scenario file; messages name it `name`.
    ///
    /// # Errors
    /// [`ScenarioError::Invalid`].
    pub fn from_yaml(text: &str, name: &str) -> Result<Self, ScenarioError> {
        let file = yaml::document(text)
            .map_err(|error| ScenarioError::Invalid { at: error.position(name), reason: error.reason })?;
        Ok(Scenario { name: name.to_owned(), file })
    }

    /// Returns the name of a built-in scenario, or the path of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the description.
    pub fn description(&self) -> &str {
        &self.file.description
    }

    /// Returns the reference of the scenario, such as a figure of a paper.
    pub fn source(&self) -> Option<&str> {
        self.file.source.as_deref()
    }

    /// Returns a note on each limit that exceeds that of every axis of `machine`, which keep their own.
    pub fn notes_on_limits(&self, machine: &MachineConfig) -> Vec<String> {
        self.file.limits.iter().flat_map(|limits| build::notes_on_limits(&limits.value, machine)).collect()
    }

    /// Plans path and feed profile on `machine`. `feed` replaces the default feed of the scenario, in m/min, or in rpm
    /// for rotary moves.
    ///
    /// # Errors
    /// [`ScenarioError`] with file, line, key and value, or with the move and the limit.
    pub fn program(&self, machine: &MachineConfig, feed: Option<f64>) -> Result<Program, ScenarioError> {
        build::program(&self.name, &self.file, machine, feed)
    }
}

/// Returns the paths of the files in the directory of `name`, at most 1000, as `name` states the directory.
fn neighbors(name: &str) -> Vec<String> {
    const MOST: usize = 1000;
    let path = FilePath::new(name);
    let parent = path.parent().unwrap_or(FilePath::new(""));
    let directory = if parent.as_os_str().is_empty() { FilePath::new(".") } else { parent };
    let Ok(entries) = std::fs::read_dir(directory) else { return Vec::new() };
    let files =
        entries.take(MOST).flatten().filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
    files.map(|entry| escaped(&parent.join(entry.file_name()).to_string_lossy())).collect()
}

/// Returns true if a name has the extension of a file, as no built-in name has.
pub fn is_file_name(name: &str) -> bool {
    FilePath::new(name).extension().is_some()
}

/// Returns the file beside `name` that differs only in its extension, or the most similar name among these files and
/// `builtin`.
pub fn nearest_input<'a>(name: &str, builtin: impl Iterator<Item = &'a str>) -> Option<String> {
    let mut files = neighbors(name);
    // A name can have been escaped for a message.
    files.retain(|file| file != name && escaped(file) != escaped(name));
    let stem = FilePath::new(name).file_stem();
    let same = files.iter().find(|file| FilePath::new(file).file_stem() == stem);
    same.cloned().or_else(|| nearest_name(name, builtin.map(str::to_owned).chain(files.iter().cloned())))
}

fn unknown(name: &str, builtin: &BuiltinFiles, reason: &str) -> ScenarioError {
    ScenarioError::Unknown {
        name: name.to_owned(),
        reason: reason.to_owned(),
        nearest: nearest_input(name, builtin_names(builtin)),
        known: if is_file_name(name) {
            String::new()
        } else {
            builtin_names(builtin).collect::<Vec<_>>().join(", ")
        },
    }
}
