//! Assignment of findings to the sections of the page.

use virtual_axes_identify::recording::Finding;

/// Identification step to which a finding belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    Whole,
    Gravity,
    Friction,
    Inertia,
    Presliding,
    Transmission,
    Feedforward,
    Delays,
    Refinement,
    Agreement,
}

impl Step {
    /// Returns the steps of a finding by its code; `Whole` for other codes. `refined` is true if there is a
    /// refinement.
    pub(super) fn of(finding: &Finding, refined: bool) -> &'static [Step] {
        match finding.code {
            "no-current" => &[Step::Gravity, Step::Friction, Step::Inertia],
            "few-speeds" | "one-direction" | "asymmetric-friction" | "poor-friction-law" | "no-breakaway" => {
                &[Step::Friction]
            }
            "presliding-damping" => &[Step::Presliding],
            "one-encoder"
            | "no-wind-up"
            | "poor-transmission"
            | "one-flank"
            | "gap-or-friction"
            | "no-load-inertia"
            | "same-samples"
            | "encoder-delay"
            | "load-friction"
            | "transmission-damping" => &[Step::Transmission],
            "saturated-current" | "no-acceleration" | "negative-inertia" | "unseen-current" => {
                &[Step::Inertia]
            }
            "feedforward-not-constant" | "no-torque-feedforward" => &[Step::Feedforward],
            "no-setpoints" | "not-a-cascade" => &[Step::Delays, Step::Refinement],
            "unseen-delay" => &[Step::Delays],
            "at-bound" if !refined => &[Step::Friction],
            "at-bound" | "not-refined" => &[Step::Refinement],
            // The text of the refinement section lists the pairs.
            "correlated" => &[],
            "poor-current" => &[Step::Agreement],
            code if code.contains("gravity") || code.contains("static") => &[Step::Gravity],
            _ => &[Step::Whole],
        }
    }
}
