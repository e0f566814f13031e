//! Contents of the page of an identification, and formatting of numbers and units in its text.

use virtual_axes_core::config::{AxisConfig, AxisKind, Periods};
use virtual_axes_identify::identify::AxisIdentification;
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::recording::{Finding, Severity};

use super::step::Step;
use crate::text::{NONE, digits, number};
use crate::{DisplayUnit, Notice, NoticeLevel, Section};

/// Contents of the page of an identification.
#[derive(Debug, Clone, Copy)]
pub struct IdentificationPage<'a> {
    /// Identification with its recordings.
    pub found: &'a AxisIdentification,
    /// Periods of the position, velocity and current loops before the identification.
    pub periods: Periods,
}

impl IdentificationPage<'_> {
    /// Creates the section of a step with its findings.
    pub(super) fn step(&self, heading: &str, step: Step) -> Section {
        let found = &self.found.identification;
        let about = |finding: &&Finding| Step::of(finding, found.refinement.as_ref()).contains(&step);
        let notices = found.findings.iter().filter(about).map(|finding| self.notice(finding)).collect();
        Section { notices, ..Section::new(heading) }
    }

    /// Converts a finding with its remedy to a notice; the paths of the recordings are among the facts.
    pub(super) fn notice(&self, finding: &Finding) -> Notice {
        let level = match finding.severity {
            Severity::Note => NoticeLevel::Note,
            Severity::Warning => NoticeLevel::Warning,
            Severity::Missing | Severity::Invalid => NoticeLevel::Missing,
        };
        let summary = &self.found.summary;
        let shorten = |text: String, path: &str| text.replace(path, file_name(summary, path));
        Notice::new(level, names(summary).fold(finding.to_string(), shorten))
    }

    /// Returns the file name of a recording, or its path if another recording has the same file name.
    pub(super) fn file_name<'a>(&self, recording: &'a str) -> &'a str {
        file_name(&self.found.summary, recording)
    }

    /// Returns the periods with the identified position cycle.
    pub(super) fn periods(&self) -> Periods {
        self.found.identification.periods.unwrap_or(self.periods)
    }

    pub(super) fn axis(&self) -> &AxisConfig {
        self.found.identification.axis()
    }

    pub(super) fn kind(&self) -> AxisKind {
        self.axis().kind()
    }

    pub(super) fn has_linear_motor(&self) -> bool {
        self.kind() == AxisKind::Linear && self.axis().transmission_ratio == 1.0
    }

    pub(super) fn position_unit(&self) -> DisplayUnit {
        DisplayUnit::position(self.kind())
    }

    pub(super) fn error_unit(&self) -> DisplayUnit {
        DisplayUnit::error(self.kind())
    }

    pub(super) fn velocity_unit(&self) -> DisplayUnit {
        DisplayUnit::velocity(self.kind())
    }

    pub(super) fn inertia_unit(&self) -> DisplayUnit {
        let value = self.axis().motor.inertia.abs();
        DisplayUnit::new(if self.has_linear_motor() { "kg" } else { "kg·m²" }, 1.0, 1e-3 * value)
    }

    pub(super) fn exponent_unit(&self) -> &'static str {
        exponent_unit(self.axis().units().speed_name)
    }
}

/// Returns the unit of the exponents b and d of a friction law over a speed.
pub(super) fn exponent_unit(speed_unit: &str) -> &'static str {
    if speed_unit == "rpm" { "min/rev" } else { "min/m" }
}

/// Returns the file name of a recording, or its path if another recording has the same file name.
pub(super) fn file_name<'a>(found: &IdentificationSummary, recording: &'a str) -> &'a str {
    let last = |path: &'a str| path.rsplit(['/', '\\']).next().unwrap_or(path);
    let name = last(recording);
    let is_other = |path: &str| path != recording && path.rsplit(['/', '\\']).next() == Some(name);
    if names(found).any(is_other) { recording } else { name }
}

/// Returns the paths of all recordings.
fn names(found: &IdentificationSummary) -> impl Iterator<Item = &str> {
    let own = found.recordings.iter().chain(&found.transmission_recordings);
    own.chain(found.validation.iter().map(|v| &v.recording)).map(|recording| recording.name.as_str())
}

/// Formats a value in SI units in `unit`, with `count` significant digits and the symbol.
pub(super) fn with_unit(value: f64, unit: &DisplayUnit, count: i32) -> String {
    format!("{}\u{a0}{}", digits(value / unit.size, count), unit.symbol).trim_end().to_owned()
}

/// Formats a ratio in percent, with one decimal.
pub(super) fn percent(part: f64) -> String {
    if part.is_finite() { number(100.0 * part, 1) } else { NONE.to_owned() }
}

/// Formats R² with four decimals, or up to six if needed to distinguish it from 1.
pub(super) fn format_r_squared(r2: f64) -> String {
    /// Maximum number of decimals.
    const DECIMALS: usize = 6;
    if !r2.is_finite() {
        return NONE.to_owned();
    }
    let decimals = (4..DECIMALS).find(|d| number(r2, *d) != number(1.0, *d)).unwrap_or(DECIMALS);
    number(r2, decimals)
}

/// Formats a count such as "one recording", "3 recordings".
pub(super) fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("one {what}") } else { format!("{} {what}s", number(count as f64, 0)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn r_squared_near_one_is_distinguished_from_one() {
        assert_eq!(format_r_squared(0.995), "0.9950");
        assert_eq!(format_r_squared(0.999_987), "0.99999");
        assert_eq!(format_r_squared(1.0), "1.000000");
    }
}
