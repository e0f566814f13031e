//! Page of an identification: text, tables and plots of each step (Prévost figs. 4 to 6).

mod agreement;
mod delays;
mod feedforward;
pub mod figures;
mod friction;
mod friction_points;
mod gravity;
mod inertia;
mod page;
mod recordings;
mod refinement;
mod step;
mod verdict;

use virtual_axes_core::config::{AxisKind, Periods};
use virtual_axes_core::units::{MILLISECOND, Rounded, seconds};
use virtual_axes_identify::recording::Severity;

use crate::text::capital;
use crate::{Chart, ChartAxis, ChartSeries, DisplayUnit, Document, Panel, Section, SeriesStyle};
pub use page::IdentificationPage;
use page::counted;
use step::Step;

/// Creates one page of one or several axes of a machine; `machine_file` is a sentence about the machine file.
///
/// The results of all axes come first. Equal identifications give equal documents.
pub fn identification_document(pages: &[IdentificationPage], machine_file: Option<&str>) -> Document {
    let verdicts = pages.iter().map(|page| (page, verdict::section(page, machine_file)));
    let details =
        pages.iter().flat_map(|page| page.sections().into_iter().map(move |section| (page, section)));
    let named = |(page, section): (&IdentificationPage, Section)| match pages.len() {
        1 => section,
        _ => Section { heading: format!("{}: {}", page.axis().name(), section.heading), ..section },
    };
    let names: Vec<&str> = pages.iter().map(|page| page.axis().name()).collect();
    let title = match names.as_slice() {
        [name] => format!("Identification of the {name} axis"),
        names => format!("Identification of the axes {}", names.join(", ")),
    };
    let mut facts = Vec::new();
    for fact in pages.iter().flat_map(IdentificationPage::facts) {
        if !facts.contains(&fact) {
            facts.push(fact);
        }
    }
    Document {
        title,
        description: "Identification by Prévost section 3 and in simulated closed loop.".to_owned(),
        facts,
        sections: verdicts.chain(details).map(named).collect(),
        ..Document::default()
    }
}

impl IdentificationPage<'_> {
    /// Creates the page of one axis.
    pub fn document(&self) -> Document {
        identification_document(std::slice::from_ref(self), None)
    }

    /// Creates the sections behind the result.
    fn sections(&self) -> Vec<Section> {
        let mut sections = vec![
            self.values(),
            recordings::section(self),
            gravity::section(self),
            friction::section(self),
            inertia::section(self),
        ];
        sections.extend(self.presliding());
        sections.extend(self.transmission());
        sections.extend([
            feedforward::section(self),
            delays::section(self),
            refinement::section(self),
            agreement::section(self),
        ]);
        let validations = self.found.validations.iter().zip(&self.found.summary.validation);
        sections
            .extend(validations.map(|(check, summary)| agreement::validation_section(self, check, summary)));
        sections
    }

    fn facts(&self) -> Vec<(String, String)> {
        let kind = match (self.axis().kind(), self.has_linear_motor()) {
            (AxisKind::Linear, true) => "linear, with a linear motor",
            (AxisKind::Linear, false) => "linear",
            (AxisKind::Rotary, _) => "rotary",
        };
        let ms = |period| format!("{} ms", Rounded(seconds(period) / MILLISECOND));
        let Periods { position, velocity, current } = self.periods();
        let summary = &self.found.summary;
        let mut facts = vec![
            ("machine".to_owned(), summary.machine.clone()),
            ("axis".to_owned(), format!("{} ({kind})", self.axis().name())),
            (
                "sampling periods of position, velocity and current loop".to_owned(),
                [position, velocity, current].map(ms).join(", "),
            ),
        ];
        facts.extend(summary.recordings.iter().map(|r| ("identified from".to_owned(), r.name.clone())));
        facts
            .extend(summary.validation.iter().map(|v| ("validated on".to_owned(), v.recording.name.clone())));
        facts
    }

    /// Creates the section with all identified values and general findings.
    fn values(&self) -> Section {
        let found = &self.found.identification;
        let refinement = found.refinement.as_ref();
        let mut general: Vec<_> = found
            .findings
            .iter()
            // The first section has the reasons of an invalid result.
            .filter(|f| f.severity < Severity::Invalid)
            .filter(|f| f.severity > Severity::Note || Step::of(f, refinement).contains(&Step::Whole))
            .collect();
        // Missing results come first.
        general.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        let values = &self.found.summary.values;
        let identified = values.iter().filter(|value| value.is_significant).count();
        let count = capital(&counted(identified, "parameter"));
        let text = if values.is_empty() {
            "No parameter was identified from the recordings.".to_owned()
        } else {
            format!(
                "{count} identified from the recordings. ± is the standard error. The value of a delay lies in an interval, \
                 which the section on delays explains."
            )
        };
        Section {
            paragraphs: vec![text],
            notices: general.into_iter().map(|finding| self.notice(finding)).collect(),
            tables: vec![figures::values(values)],
            ..Section::new("Identified parameters")
        }
    }

    /// Creates the section of the presliding; none if it was not identified.
    fn presliding(&self) -> Option<Section> {
        let fit = self.found.identification.presliding.as_ref()?;
        let found = self.found.summary.presliding.as_ref()?;
        let mut section = self.step("Presliding", Step::Presliding);
        section.paragraphs.push(format!(
            "After a slow reversal the friction current follows g (1 − 2 exp(−σ0 u/g)) over the distance u; here it changes over \
             {:.3} {}. {}.",
            found.length,
            self.error_unit().symbol,
            capital(&figures::presliding(found)),
        ));
        let points = |of: fn(&[f64; 3]) -> f64| fit.curve.iter().map(|point| [point[0], of(point)]).collect();
        let series = vec![
            ChartSeries::new("measured", SeriesStyle::Measured, points(|point| point[1])),
            ChartSeries::new("modeled", SeriesStyle::Simulated, points(|point| point[2])),
        ];
        section.charts.push(Chart::new(
            "Friction current after a reversal",
            ChartAxis::new("Distance since the reversal", self.error_unit()),
            vec![Panel::new(ChartAxis::new("Friction current", DisplayUnit::AMPERE), series)],
        ));
        Some(section)
    }

    /// Creates the section of the elastic transmission; none without recordings of both encoders.
    fn transmission(&self) -> Option<Section> {
        let recordings = &self.found.summary.transmission_recordings;
        if recordings.is_empty() {
            return None;
        }
        let mut section = self.step("Transmission", Step::Transmission);
        if let Some(found) = &self.found.summary.transmission {
            section.paragraphs.push(format!(
                "{} with the encoders of motor and load. The load follows Ml a = k c(δ) + d dc/dt − C − G, with the twist δ beyond \
                 the gap; the motor follows F = Mm a_motor + Ml a + C + G. {}.",
                capital(&counted(recordings.len(), "recording")),
                capital(&figures::transmission(found, self.error_unit().symbol)),
            ));
        }
        Some(section)
    }
}
