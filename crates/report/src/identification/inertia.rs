//! Section of the equivalent inertia at accelerating samples.

use virtual_axes_identify::identify::{InertiaFit, RefinedParameter};
use virtual_axes_identify::recording::Signals;

use super::figures;
use super::page::{IdentificationPage, with_unit};
use super::step::Step;
use crate::extent::Extent;
use crate::text::capital;
use crate::{Band, Chart, ChartAxis, ChartSeries, DisplayUnit, Guide, Panel, Section, SeriesStyle};

/// Fraction of the smallest and of the largest values that the plot may cut off.
const OUTLIERS: f64 = 0.02;
/// Margin of the plot range, as a fraction of it.
const MARGIN: f64 = 0.06;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = &page.found.identification;
    let mut section = page.step("Equivalent inertia", Step::Inertia);
    let (Some(inertia), Some(figures)) = (&found.inertia, &page.found.summary.inertia) else {
        let refined = found.refinement.iter().flat_map(|refinement| &refinement.parameters);
        section.paragraphs.push(if refined.into_iter().any(|p| p.parameter == RefinedParameter::Inertia) {
            format!(
                "Prévost eq. 5 requires accelerations with currents, which were not recorded. The refinement \
                 in closed loop gives {}.",
                with_unit(page.axis().motor.inertia, &page.inertia_unit(), 4)
            )
        } else {
            "The inertia was not identified; the value of the initial machine is kept.".to_owned()
        });
        return section;
    };
    let sentence = format!("{}, in {}.", capital(&figures::inertia(figures)), page.inertia_unit().symbol);
    section.paragraphs.push(sentence);
    section.paragraphs.push(match (inertia.is_regression(), found.replayed_inertia) {
        (true, _) => "The current of all samples in motion is fitted by Jeq a / (Kt r), friction and gravity together; the \
                      standard error counts neighboring samples as far as they are independent, and many moves instead of samples \
                      where that is larger.",
        (false, None) => "Prévost eq. 5 is Jeq = (Kt i − C_friction − C_gravity) / (dω/dt); the value is the mean without outliers.",
        (false, Some(_)) => "Prévost eq. 5 is Jeq = (Kt i − C_friction − C_gravity) / (dω/dt); the value is the mean without \
                             outliers. Eq. 5 on the simulated axis, sampled like the recordings, shows the error of the method, \
                             because the current oscillates between two samples. The refined inertia does not have this error.",
    }.to_owned());
    if !inertia.is_regression() {
        section.charts.push(chart(page, inertia));
    }
    section
}

fn chart(page: &IdentificationPage, inertia: &InertiaFit) -> Chart {
    let (found, unit) = (&page.found.identification, page.inertia_unit());
    // Samples are numbered by the recordings that have a current.
    let has_current = |signals: &&Signals| signals.spans.iter().any(|s| s.current.is_some());
    let names = page.found.recordings.iter().map(|recorded| &recorded.signals).filter(has_current);
    let series: Vec<ChartSeries> = names
        .enumerate()
        .map(|(number, signals)| {
            let of_it = inertia.instants.iter().filter(|instant| instant.0 == number);
            let points = of_it.map(|(_, time, value)| [*time, *value]).collect();
            ChartSeries::new(page.file_name(&signals.name), SeriesStyle::Points(number), points)
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    let mut lines = vec![Guide::new(inertia.value, format!("eq. 5: {}", with_unit(inertia.value, &unit, 4)))];
    if found.refinement.is_some() {
        let refined = page.axis().motor.inertia;
        lines.push(Guide::new(refined, format!("refined: {}", with_unit(refined, &unit, 4))));
    }
    let mut values: Vec<f64> = inertia.instants.iter().map(|instant| instant.2).collect();
    values.sort_by(f64::total_cmp);
    let outliers = (OUTLIERS * values.len() as f64) as usize;
    let inner = values.get(outliers..values.len() - outliers).unwrap_or_default();
    let shown = Extent::of(inner.iter().copied().chain(lines.iter().map(|line| line.at)));
    let mut y = ChartAxis::new("Equivalent inertia", unit);
    if let Some(shown) = shown.filter(|shown| shown.span() > 0.0) {
        let room = MARGIN * shown.span();
        y = y.within(shown.min - room, shown.max + room);
    }
    let (from, to) = (inertia.value - inertia.spread, inertia.value + inertia.spread);
    let panel = Panel { bands: vec![Band::interval("± spread", from, to)], lines, ..Panel::new(y, series) };
    Chart::new(
        "Equivalent inertia",
        ChartAxis::new("Time in the recording", DisplayUnit::SECOND),
        vec![panel],
    )
}
