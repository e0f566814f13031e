//! The page of an identification: each step with its text, its figures and its picture (Prévost figs. 4 to 6).

mod agreement;
mod delays;
mod feedforward;
mod format;
mod friction;
mod gravity;
mod inertia;
mod notices;
mod recordings;
mod refinement;
mod summary;

use virtual_axes_core::config::{AxisConfig, AxisKind, Periods};
use virtual_axes_core::units::seconds;
use virtual_axes_identify::identify::{Agreement, FeedforwardMode, Identification, IdentifiedValue, Input};
use virtual_axes_identify::recording::Finding;

use super::document::{Document, Section};
use format::exact;
use notices::Step;

/// What the page of an identification is made of.
#[derive(Debug, Clone, Copy)]
pub struct IdentificationPage<'a> {
    /// Name of the machine that the identification started from.
    pub machine: &'a str,
    /// Sampling periods of its loops.
    pub periods: Periods,
    /// The recordings, as they were given to [`identify`](virtual_axes_identify::identify::identify).
    pub inputs: &'a [Input<'a>],
    /// For each recording what reading and conditioning found; it can be shorter.
    pub findings: &'a [Vec<Finding>],
    /// What they told.
    pub identification: &'a Identification,
    /// The same as parameters, from [`Identification::values`].
    pub values: &'a [IdentifiedValue],
    /// Recordings that it was not identified from.
    pub validations: &'a [ValidationRecording<'a>],
}

/// A recording that an identified axis was validated on.
#[derive(Debug, Clone, Copy)]
pub struct ValidationRecording<'a> {
    /// The recording, as it was given to [`validate`](virtual_axes_identify::identify::validate).
    pub input: Input<'a>,
    /// What reading and conditioning found.
    pub findings: &'a [Finding],
    /// How the axis agrees with it.
    pub agreement: &'a Agreement,
}

impl IdentificationPage<'_> {
    /// The page; the same identification gives the same document.
    pub fn document(&self) -> Document {
        let mut sections = vec![
            summary::section(self),
            recordings::section(self),
            gravity::section(self),
            friction::section(self),
            inertia::section(self),
            feedforward::section(self),
            delays::section(self),
            refinement::section(self),
            agreement::section(self),
        ];
        sections.extend(self.validations.iter().map(|check| agreement::validation(self, check)));
        Document {
            title: format!("Identification of the {} axis", self.axis().name()),
            description:
                "The steps of Prévost section 3, one after the other, and a refinement on the simulated \
                          closed loop."
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
            ("machine".to_owned(), self.machine.to_owned()),
            ("axis".to_owned(), format!("{} ({kind})", self.axis().name())),
            (
                "periods of position, velocity and current loop".to_owned(),
                [position, velocity, current].map(ms).join(", "),
            ),
        ];
        let name = |what: &str, input: &Input| (what.to_owned(), input.signals.name.clone());
        facts.extend(self.inputs.iter().map(|input| name("identified from", input)));
        facts.extend(self.validations.iter().map(|check| name("validated on", &check.input)));
        facts
    }

    /// A section with what was found about its step.
    fn step(&self, heading: &str, step: Step) -> Section {
        let refined = self.identification.refinement.is_some();
        let about = |finding: &&Finding| Step::of(finding, refined).contains(&step);
        let notices = self.identification.findings.iter().filter(about).map(notices::notice).collect();
        Section { notices, ..Section::new(heading) }
    }

    /// The axis as it was found.
    fn axis(&self) -> &AxisConfig {
        self.identification.axis()
    }

    fn kind(&self) -> AxisKind {
        self.axis().kind()
    }

    /// Whether what moves is a mass: no screw turns a millimeter into radians.
    fn has_linear_motor(&self) -> bool {
        self.kind() == AxisKind::Linear && self.axis().transmission_ratio == 1.0
    }
}

/// The modes of the parts of a recording, each once, in words.
fn modes(agreement: &Agreement, input: &Input) -> String {
    let mut modes: Vec<FeedforwardMode> = agreement.experiments.iter().map(|e| e.mode).collect();
    modes.sort();
    modes.dedup();
    if modes.is_empty() {
        modes.extend(input.feedforward);
    }
    let names: Vec<&str> = modes.iter().map(|mode| mode.name()).collect();
    if names.is_empty() { "–".to_owned() } else { names.join(", ") }
}
