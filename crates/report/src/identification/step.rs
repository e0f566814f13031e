//! Assignment of findings to the sections of the page.

use virtual_axes_identify::identify::Refinement;
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
    /// Returns the steps of a finding by its code; `Whole` for other codes.
    pub(super) fn of(finding: &Finding, refinement: Option<&Refinement>) -> &'static [Step] {
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
            "at-bound" if refinement.is_none() => &[Step::Friction],
            "at-bound" | "not-refined" => &[Step::Refinement],
            "correlated" if refinement.is_some_and(|refinement| is_pair(finding, refinement)) => &[],
            "correlated" => match ["gravity", "friction"].map(|name| finding.what.contains(name)) {
                [true, true] => &[Step::Gravity, Step::Friction],
                [true, false] => &[Step::Gravity],
                [false, true] => &[Step::Friction],
                [false, false] => &[Step::Inertia],
            },
            "poor-current" => &[Step::Agreement],
            code if code.contains("gravity") || code.contains("static") => &[Step::Gravity],
            _ => &[Step::Whole],
        }
    }
}

/// Returns true for a finding about a pair of refined parameters, which the text of the refinement section lists.
fn is_pair(finding: &Finding, refinement: &Refinement) -> bool {
    let pairs = refinement.correlated_pairs();
    pairs.iter().any(|(a, b, _)| finding.what.starts_with(&format!("{a} and {b} ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_of_the_plant_are_notes_of_its_steps() {
        let steps = |what: &str| Step::of(&Finding::note("correlated", what), None);
        assert_eq!(steps("gravity and friction.a are strongly correlated"), [Step::Gravity, Step::Friction]);
        assert_eq!(steps("friction.a and friction.c are strongly correlated"), [Step::Friction]);
    }
}
