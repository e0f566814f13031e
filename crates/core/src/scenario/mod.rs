//! Scenarios: test motions in YAML files.
//!
//! A scenario file contains a start point, a feed and moves. [`Scenario::program`] plans its path and feed profile for
//! a machine. The test motions of Prévost et al. are built in, from `config/scenarios`.
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
use crate::path::Program;
use crate::text::nearest_name;
use crate::yaml;

pub use error::ScenarioError;

/// Built-in scenarios: name and file, in the order of the figures in Prévost et al.
const BUILTIN: &[(&str, &str)] = &[
    ("x-constant", include_str!("../../config/scenarios/x-constant.yaml")),
    ("y-constant", include_str!("../../config/scenarios/y-constant.yaml")),
    ("z-constant", include_str!("../../config/scenarios/z-constant.yaml")),
    ("a-constant", include_str!("../../config/scenarios/a-constant.yaml")),
    ("c-constant", include_str!("../../config/scenarios/c-constant.yaml")),
    ("c-two-speeds", include_str!("../../config/scenarios/c-two-speeds.yaml")),
    ("x-there-and-back", include_str!("../../config/scenarios/x-there-and-back.yaml")),
    ("contour-a", include_str!("../../config/scenarios/contour-a.yaml")),
    ("contour-b", include_str!("../../config/scenarios/contour-b.yaml")),
    ("orientation-ac", include_str!("../../config/scenarios/orientation-ac.yaml")),
    ("bspline-3d", include_str!("../../config/scenarios/bspline-3d.yaml")),
    ("ballbar", include_str!("../../config/scenarios/ballbar.yaml")),
    ("ballbar-both", include_str!("../../config/scenarios/ballbar-both.yaml")),
    ("corner-90", include_str!("../../config/scenarios/corner-90.yaml")),
    ("corner-45", include_str!("../../config/scenarios/corner-45.yaml")),
    ("five-axis", include_str!("../../config/scenarios/five-axis.yaml")),
    ("bspline-5x", include_str!("../../config/scenarios/bspline-5x.yaml")),
];
/// Maximum size of a scenario file.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Test motion read from a scenario file. [`Self::program`] checks it against a machine.
#[derive(Debug, Clone)]
pub struct Scenario {
    name: String,
    file: file::ScenarioFile,
}

impl Scenario {
    /// Returns the names of the built-in scenarios.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// Returns the built-in scenario `name`.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`].
    pub fn builtin(name: &str) -> Result<Self, ScenarioError> {
        Self::from_yaml(Self::builtin_text(name)?, name)
    }

    /// Returns the YAML text of the built-in scenario `name`.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`].
    pub fn builtin_text(name: &str) -> Result<&'static str, ScenarioError> {
        let found = BUILTIN.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text).ok_or_else(|| unknown(name, "unknown scenario"))
    }

    /// Loads the built-in scenario `name`, or the file `name` if there is none.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`] if the file cannot be read, [`ScenarioError::Syntax`] if it is not a scenario.
    pub fn load(name: &str) -> Result<Self, ScenarioError> {
        if Self::builtin_names().any(|known| known == name) {
            return Self::builtin(name);
        }
        let failed = |error: std::io::Error| unknown(name, &error.to_string());
        let length = std::fs::metadata(FilePath::new(name)).map_err(failed)?.len();
        if length > MAX_FILE_BYTES {
            return Err(unknown(
                name,
                &format!("size is {length} bytes, at most {MAX_FILE_BYTES} are allowed"),
            ));
        }
        Self::from_yaml(&std::fs::read_to_string(name).map_err(failed)?, name)
    }

    /// Parses the text of a scenario file; messages name it `name`.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`].
    pub fn from_yaml(text: &str, name: &str) -> Result<Self, ScenarioError> {
        let file = yaml::document(text)
            .map_err(|error| ScenarioError::Syntax { at: error.position(name), reason: error.reason })?;
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
    files.map(|entry| parent.join(entry.file_name()).to_string_lossy().into_owned()).collect()
}

/// Returns true if a name has the extension of a file, as no built-in name has.
pub fn is_file_name(name: &str) -> bool {
    FilePath::new(name).extension().is_some()
}

/// Returns the file beside `name` that differs only in its extension, or the most similar name among these files and
/// `builtin`.
pub fn nearest_input<'a>(name: &str, builtin: impl Iterator<Item = &'a str>) -> Option<String> {
    let files = neighbors(name);
    let stem = FilePath::new(name).file_stem();
    let same = files.iter().find(|file| FilePath::new(file).file_stem() == stem);
    same.cloned().or_else(|| nearest_name(name, builtin.map(str::to_owned).chain(files.iter().cloned())))
}

fn unknown(name: &str, reason: &str) -> ScenarioError {
    ScenarioError::Unknown {
        name: name.to_owned(),
        reason: reason.to_owned(),
        nearest: nearest_input(name, Scenario::builtin_names()),
        known: if is_file_name(name) {
            String::new()
        } else {
            Scenario::builtin_names().collect::<Vec<_>>().join(", ")
        },
    }
}
