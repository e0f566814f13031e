//! Findings as notices, each where it belongs.

use super::super::document::{Notice, NoticeLevel};
use virtual_axes_identify::recording::{Finding, Severity};

/// To what a finding belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    Whole,
    Gravity,
    Friction,
    Inertia,
    Feedforward,
    Delays,
    Refinement,
    Agreement,
}

impl Step {
    /// By the finding's code; what is not known is of the whole. `refined`: whether there is a refinement.
    pub(super) fn of(finding: &Finding, refined: bool) -> &'static [Step] {
        match finding.code {
            "no-current" => &[Step::Gravity, Step::Friction, Step::Inertia],
            "few-speeds" | "one-direction" | "asymmetric-friction" | "poor-friction-law" | "no-breakaway" => {
                &[Step::Friction]
            }
            "saturated-current" | "no-acceleration" | "negative-inertia" | "unseen-current" => {
                &[Step::Inertia]
            }
            "feedforward-not-constant" | "no-torque-feedforward" => &[Step::Feedforward],
            "no-setpoints" | "not-a-cascade" => &[Step::Delays, Step::Refinement],
            "unseen-delay" => &[Step::Delays],
            "at-bound" if !refined => &[Step::Friction],
            "at-bound" | "not-refined" => &[Step::Refinement],
            // The text of the refinement names the pairs.
            "correlated" => &[],
            "poor-current" => &[Step::Agreement],
            code if code.contains("gravity") || code.contains("static") => &[Step::Gravity],
            _ => &[Step::Whole],
        }
    }
}

/// A finding with its remedy.
pub(super) fn notice(finding: &Finding) -> Notice {
    let level = match finding.severity {
        Severity::Note => NoticeLevel::Note,
        Severity::Warning => NoticeLevel::Warning,
        Severity::Missing => NoticeLevel::Missing,
    };
    Notice::new(level, finding.to_string())
}
