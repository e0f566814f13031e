//! Page of an identification: text, tables and plots of each step (Prévost figs. 4 to 6).

mod agreement;
mod delays;
mod feedforward;
mod format;
mod friction;
mod gravity;
mod inertia;
mod notices;
mod presliding;
mod recordings;
mod refinement;
mod summary;
mod transmission;

use virtual_axes_core::config::{AxisConfig, AxisKind, Periods};
use virtual_axes_core::units::seconds;
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::identify::{Agreement, Identification, IdentificationInput};
use virtual_axes_identify::recording::Finding;

use super::document::{Document, Section};
use format::exact;
use notices::Step;

/// Contents of the page of an identification.
#[derive(Debug, Clone, Copy)]
pub struct IdentificationPage<'a> {
    /// Summary of the identification.
    pub summary: &'a IdentificationSummary,
    /// Sampling periods of the position, velocity and current loops.
    pub periods: Periods,
    /// Recordings, as passed to [`identify`](virtual_axes_identify::identify::identify).
    pub inputs: &'a [IdentificationInput<'a>],
    /// Findings of reading and conditioning of each recording; can be shorter than `inputs`.
    pub findings: &'a [Vec<Finding>],
    /// Result of the identification.
    pub identification: &'a Identification,
    /// Recordings for validation, which were not used for the identification, in the order of the summary.
    pub validations: &'a [ValidationRecording<'a>],
}

/// A validation recording and its comparison with the simulation of the identified axis.
#[derive(Debug, Clone, Copy)]
pub struct ValidationRecording<'a> {
    /// Recording, as passed to [`validate`](virtual_axes_identify::identify::validate).
    pub input: IdentificationInput<'a>,
    /// Findings of reading and conditioning.
    pub findings: &'a [Finding],
    /// Deviations between simulation and recording.
    pub agreement: &'a Agreement,
}

impl IdentificationPage<'_> {
    /// Creates the page. Equal identifications give equal documents.
    pub fn document(&self) -> Document {
        let mut sections = vec![
            summary::section(self),
            recordings::section(self),
            gravity::section(self),
            friction::section(self),
            inertia::section(self),
        ];
        sections.extend(presliding::section(self));
        sections.extend(transmission::section(self));
        sections.extend([
            feedforward::section(self),
            delays::section(self),
            refinement::section(self),
            agreement::section(self),
        ]);
        let validations = self.validations.iter().zip(&self.summary.validation);
        sections.extend(
            validations
                .map(|(check, summary)| agreement::validation_section(self, check, &summary.recording)),
        );
        Document {
            title: format!("Identification of the {} axis", self.axis().name()),
            description: "The steps of Prévost section 3, and a refinement in simulated closed loop."
                .to_owned(),
            facts: self.facts(),
            sections,
        }
    }

    fn facts(&self) -> Vec<(String, String)> {
        let kind = match (self.axis().kind(), self.has_linear_motor()) {
            (AxisKind::Linear, true) => "linear, with a linear motor",
            (AxisKind::Linear, false) => "linear",
            (AxisKind::Rotary, _) => "rotary",
        };
        let ms = |period| format!("{} ms", exact(seconds(period) * 1e3));
        let Periods { position, velocity, current } = self.periods;
        let mut facts = vec![
            ("machine".to_owned(), self.summary.machine.clone()),
            ("axis".to_owned(), format!("{} ({kind})", self.axis().name())),
            (
                "sampling periods of position, velocity and current loop".to_owned(),
                [position, velocity, current].map(ms).join(", "),
            ),
        ];
        let name = |what: &str, input: &IdentificationInput| (what.to_owned(), input.signals.name.clone());
        facts.extend(self.inputs.iter().map(|input| name("identified from", input)));
        facts.extend(self.validations.iter().map(|check| name("validated on", &check.input)));
        facts
    }

    /// Creates a section with the findings of its step.
    fn step(&self, heading: &str, step: Step) -> Section {
        let refined = self.identification.refinement.is_some();
        let about = |finding: &&Finding| Step::of(finding, refined).contains(&step);
        let notices = self.identification.findings.iter().filter(about).map(notices::notice).collect();
        Section { notices, ..Section::new(heading) }
    }

    /// Returns the identified axis.
    fn axis(&self) -> &AxisConfig {
        self.identification.axis()
    }

    fn kind(&self) -> AxisKind {
        self.axis().kind()
    }

    /// Returns true for a linear motor, whose inertia is a mass: the axis has no screw.
    fn has_linear_motor(&self) -> bool {
        self.kind() == AxisKind::Linear && self.axis().transmission_ratio == 1.0
    }
}
