//! Section of the elastic transmission.

use super::super::document::Section;
use super::super::table::{Table, TableColumn};
use super::format::{counted, digits};
use super::{IdentificationPage, Step};
use virtual_axes_identify::identify::summary::IntervalSummary;

/// Returns the section; none without recordings of both encoders.
pub(super) fn section(page: &IdentificationPage) -> Option<Section> {
    let recordings = &page.summary.transmission_recordings;
    if recordings.is_empty() {
        return None;
    }
    let mut section = page.step("Transmission", Step::Transmission);
    let Some(found) = &page.summary.transmission else { return Some(section) };
    section.paragraphs.push(format!(
        "{} with the encoders of motor and load. The load follows Ml a = k c(δ) + d dc/dt − C − G, with the twist δ beyond the \
         gap; the motor follows F = Mm a_motor + Ml a + C + G. R² of the acceleration of the load: {:.4}.",
        counted(recordings.len(), "recording"),
        found.r_squared,
    ));
    let length = page.error_unit().symbol;
    let rows: [(&str, Option<&IntervalSummary>, &str); 7] = [
        ("antiresonance", Some(&found.antiresonance_hz), "Hz"),
        ("stiffness", found.stiffness.as_ref(), found.stiffness_unit),
        ("damping", found.damping.as_ref(), found.damping_unit()),
        ("inertia of the load", found.load_inertia.as_ref(), found.inertia_unit),
        ("inertia of motor and load", found.total_inertia.as_ref(), found.inertia_unit),
        ("share of the friction at the load", found.load_friction.as_ref(), ""),
        ("backlash", found.backlash.as_ref(), length),
    ];
    let rows = rows.into_iter().filter_map(|(name, value, unit)| {
        let IntervalSummary { value, interval: [low, high] } = value?;
        let bounds = format!("{} … {}", digits(*low, 4), digits(*high, 4));
        Some(vec![name.to_owned(), digits(*value, 4), unit.to_owned(), bounds])
    });
    let columns =
        ["quantity", "value", "unit", "95 % interval"].map(|name| TableColumn::new(name, "")).to_vec();
    section.tables.push(Table { caption: String::new(), columns, rows: rows.collect() });
    if let Some(bound) = found.excluded_backlash {
        section.paragraphs.push(format!("A backlash above {} {length} is excluded.", digits(bound, 2)));
    }
    Some(section)
}
