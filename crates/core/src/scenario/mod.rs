//! Scenarios: trials described in data files.
//!
//! A scenario is a YAML file with a start, a feed and moves; [`Scenario::program`] makes it a path
//! with a law of time on a given machine. Those of the paper are shipped in `config/scenarios`.
//!
//! ```yaml
//! description: There and back, with a corner
//! feed_m_min: 10           # of every move that has none; feed_rpm for rotary moves
//! rest_s: 0.5              # at rest before the first and after the last move
//! moves:
//!   - line: {x_mm: 60}     # joints that are not named stay where they are
//!   - arc: {center: {x_mm: 60, y_mm: 15}, angle_deg: 180}
//!   - line: {x_mm: 0}
//!     feed_m_min: 5
//! ```

mod build;
mod coordinates;
mod error;
mod file;

use std::path::Path as FilePath;

use serde_saphyr::{NonFiniteFloatPolicy, options};

use crate::config::{MachineConfig, breaks_line};
use crate::path::Program;

pub use error::ScenarioError;

/// Shipped scenarios: name and file, in the order of the paper's figures.
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
/// Longest part of what the YAML reader says, characters: it quotes keys of any length.
const LONGEST_MESSAGE: usize = 500;
/// Largest scenario file that is read.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// A trial, as it stands in its file; what depends on a machine is checked by [`Self::program`].
#[derive(Debug, Clone)]
pub struct Scenario {
    name: String,
    file: file::File,
}

impl Scenario {
    /// Names of the shipped scenarios.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// A shipped scenario by its name.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`].
    pub fn builtin(name: &str) -> Result<Self, ScenarioError> {
        Self::from_yaml(Self::builtin_text(name)?, name)
    }

    /// The file of a shipped scenario.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`].
    pub fn builtin_text(name: &str) -> Result<&'static str, ScenarioError> {
        let found = BUILTIN.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text).ok_or_else(|| unknown(name, "no such scenario"))
    }

    /// A shipped scenario if `name` is one, otherwise the file `name`.
    ///
    /// # Errors
    /// [`ScenarioError`] if it cannot be read or is no scenario.
    pub fn load(name: &str) -> Result<Self, ScenarioError> {
        if Self::builtin_names().any(|known| known == name) {
            return Self::builtin(name);
        }
        let failed = |error: std::io::Error| unknown(name, &error.to_string());
        let length = std::fs::metadata(FilePath::new(name)).map_err(failed)?.len();
        if length > MAX_FILE_BYTES {
            return Err(unknown(name, &format!("{length} bytes are more than {MAX_FILE_BYTES}")));
        }
        Self::from_yaml(&std::fs::read_to_string(name).map_err(failed)?, name)
    }

    /// The text of a scenario file; `name` is for messages.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`].
    pub fn from_yaml(text: &str, name: &str) -> Result<Self, ScenarioError> {
        let options = options! {
            strict_booleans: true,
            // Let through, to be refused together with the key.
            non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
            with_snippet: false,
        };
        let file = serde_saphyr::from_str_with_options(text, options).map_err(|error| {
            let line = error.location().map(|location| format!(":{}", location.line()));
            let text = error.without_snippet().to_string();
            // The position stands before the message.
            let message = text.rsplit_once(" at line ").map_or(text.as_str(), |(message, _)| message);
            ScenarioError::Syntax {
                at: format!("{name}{}", line.unwrap_or_default()),
                message: message.chars().take(LONGEST_MESSAGE).collect::<String>().replace(breaks_line, " "),
            }
        })?;
        Ok(Scenario { name: name.to_owned(), file })
    }

    /// Name, or path of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it is.
    pub fn description(&self) -> &str {
        &self.file.description
    }

    /// Where it comes from.
    pub fn source(&self) -> Option<&str> {
        self.file.source.as_deref()
    }

    /// Path and law of time on `machine`. `feed` (m/min, or rpm for a scenario of rotary moves)
    /// takes the place of the scenario's feed.
    ///
    /// # Errors
    /// [`ScenarioError`] naming file, line, key and value, or the move and the limit.
    pub fn program(&self, machine: &MachineConfig, feed: Option<f64>) -> Result<Program, ScenarioError> {
        build::program(&self.name, &self.file, machine, feed)
    }
}

fn unknown(name: &str, reason: &str) -> ScenarioError {
    ScenarioError::Unknown {
        name: name.to_owned(),
        reason: reason.to_owned(),
        known: Scenario::builtin_names().collect::<Vec<_>>().join(", "),
    }
}
