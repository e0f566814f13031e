//! Equivalent inertia at the accelerating instants.

use super::super::chart::{Band, Chart, ChartAxis, Guide, Panel, Series, SeriesStyle};
use super::super::document::Section;
use super::super::scale::Extent;
use super::super::unit::Unit;
use super::words::{counted, digits, percent};
use super::{IdentificationPage, Step};
use crate::identify::Inertia;

/// What is shown on either side of the mean, standard deviations of single instants.
const SHOWN: f64 = 6.0;
/// Room beyond a guide, part of the range.
const MARGIN: f64 = 0.06;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = page.identification;
    let mut section = page.step("Equivalent inertia", Step::Inertia);
    let value = with_unit(page, page.axis().motor.inertia);
    let Some(inertia) = &found.inertia else {
        section.paragraphs.push(if found.refinement.is_some() {
            format!("Eq. 5 asks for accelerations with their currents; the closed loop alone told {value}.")
        } else {
            "The inertia was not identified; what the machine file says is kept.".to_owned()
        });
        return section;
    };
    section.paragraphs.push(format!(
        "Jeq = (Kt i − C_friction − C_gravity) / (dω/dt) (Prévost eq. 5) at {} of {} gives {} ± {}, the mean without \
         outliers; single instants spread by {}.",
        counted(inertia.instants.len(), "instant"),
        counted(inertia.accelerations, "acceleration"),
        with_unit(page, inertia.value),
        digits(inertia.error, 2),
        digits(inertia.spread, 2),
    ));
    if found.refinement.is_some() {
        section.paragraphs.push(format!("The refinement on the closed loop gives {value}."));
    }
    if let Some(replayed) = found.replayed_inertia {
        let off = replayed / page.axis().motor.inertia - 1.0;
        section.paragraphs.push(format!(
            "On the simulation of the axis as it was found, sampled as the recordings are, eq. 5 gives {}: it is off \
             by {} % there, where the truth is known. So far the method itself misses, since the current swings \
             between two samples and the filter carries accelerations on; as far as both values of eq. 5 differ, the \
             recorded axis is not the simulated one.",
            with_unit(page, replayed),
            percent(off)
        ));
    }
    section.charts.push(chart(page, inertia));
    section
}

fn with_unit(page: &IdentificationPage, inertia: f64) -> String {
    format!("{}\u{a0}{}", digits(inertia, 4), page.inertia_unit().symbol)
}

fn chart(page: &IdentificationPage, inertia: &Inertia) -> Chart {
    let found = page.identification;
    // Instants are numbered by the recordings that have a current.
    let has_current = |signals: &crate::recording::Signals| signals.spans.iter().any(|s| s.current.is_some());
    let names = page.inputs.iter().map(|input| input.signals).filter(|signals| has_current(signals));
    let series: Vec<Series> = names
        .enumerate()
        .map(|(number, signals)| {
            let of_it = inertia.instants.iter().filter(|instant| instant.0 == number);
            let points = of_it.map(|(_, time, value)| [*time, *value]).collect();
            Series::new(signals.name.clone(), SeriesStyle::Points(number), points)
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    let mut lines = vec![Guide::new(inertia.value, format!("eq. 5: {}", with_unit(page, inertia.value)))];
    if found.refinement.is_some() {
        let refined = page.axis().motor.inertia;
        lines.push(Guide::new(refined, format!("refined: {}", with_unit(page, refined))));
    }
    let extent = |values: &mut dyn Iterator<Item = f64>| Extent::of(values);
    let values = || inertia.instants.iter().map(|instant| instant.2);
    let near = |value: &f64| (value - inertia.value).abs() <= SHOWN * inertia.spread;
    let shown =
        Extent::join(extent(&mut values().filter(near)), extent(&mut lines.iter().map(|line| line.at)));
    let mut y = ChartAxis::new("Equivalent inertia", page.inertia_unit());
    if let Some(shown) = shown.filter(|shown| shown.span() > 0.0) {
        let room = MARGIN * shown.span();
        y = y.within(shown.min - room, shown.max + room);
    }
    let (from, to) = (inertia.value - inertia.spread, inertia.value + inertia.spread);
    let panel = Panel { bands: vec![Band::interval("± spread", from, to)], lines, ..Panel::new(y, series) };
    Chart::new("Equivalent inertia", ChartAxis::new("Time in the recording", Unit::SECOND), vec![panel])
}
