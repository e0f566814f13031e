//! Section of the equivalent inertia at accelerating samples.

use super::super::chart::{Band, Chart, ChartAxis, ChartSeries, Guide, Panel, SeriesStyle};
use super::super::document::Section;
use super::super::scale::Extent;
use super::super::unit::DisplayUnit;
use super::format::{counted, digits, percent};
use super::{IdentificationPage, Step};
use virtual_axes_identify::identify::InertiaFit;

/// Fraction of the smallest and of the largest values that the plot may cut off.
const OUTLIERS: f64 = 0.02;
/// Margin of the plot range, as a fraction of it.
const MARGIN: f64 = 0.06;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = page.identification;
    let mut section = page.step("Equivalent inertia", Step::Inertia);
    let value = with_unit(page, page.axis().motor.inertia);
    let Some(inertia) = &found.inertia else {
        section.paragraphs.push(if found.refinement.is_some() {
            format!(
                "Prévost eq. 5 requires accelerations with currents, which were not recorded. The refinement \
                 in closed loop gives {value}."
            )
        } else {
            "The inertia was not identified; the value of the machine file is kept.".to_owned()
        });
        return section;
    };
    if inertia.is_regression() {
        section.paragraphs.push(format!(
            "The current of all samples in motion ({}) is fitted by Jeq a / (Kt r), friction and gravity together. This \
             gives {} ± {}; the standard error counts moves, not samples.",
            counted(inertia.accelerations, "move"),
            with_unit(page, inertia.value),
            digits(inertia.error, 2),
        ));
        return section;
    }
    section.paragraphs.push(format!(
        "Jeq = (Kt i − C_friction − C_gravity) / (dω/dt) (Prévost eq. 5) at {} of {} gives {} ± {}, the mean \
         without outliers. The standard deviation of single samples is {}.",
        counted(inertia.instants.len(), "sample"),
        counted(inertia.accelerations, "acceleration"),
        with_unit(page, inertia.value),
        digits(inertia.error, 2),
        digits(inertia.spread, 2),
    ));
    if found.refinement.is_some() {
        section.paragraphs.push(format!("The refinement in closed loop gives {value}."));
    }
    if let Some(replayed) = found.replayed_inertia {
        let deviation = replayed / page.axis().motor.inertia - 1.0;
        section.paragraphs.push(format!(
            "Eq. 5 applied to the simulated axis, sampled like the recordings, gives {}, which deviates by \
             {} % from the simulated inertia. This is the error of the method, because the current \
             oscillates between two samples. The inertia refined in closed loop does not have this error.",
            with_unit(page, replayed),
            percent(deviation)
        ));
    }
    section.charts.push(chart(page, inertia));
    section
}

fn with_unit(page: &IdentificationPage, inertia: f64) -> String {
    format!("{}\u{a0}{}", digits(inertia, 4), page.inertia_unit().symbol)
}

fn chart(page: &IdentificationPage, inertia: &InertiaFit) -> Chart {
    let found = page.identification;
    // Samples are numbered by the recordings that have a current.
    let has_current = |signals: &virtual_axes_identify::recording::Signals| {
        signals.spans.iter().any(|s| s.current.is_some())
    };
    let names = page.inputs.iter().map(|input| input.signals).filter(|signals| has_current(signals));
    let series: Vec<ChartSeries> = names
        .enumerate()
        .map(|(number, signals)| {
            let of_it = inertia.instants.iter().filter(|instant| instant.0 == number);
            let points = of_it.map(|(_, time, value)| [*time, *value]).collect();
            ChartSeries::new(signals.name.clone(), SeriesStyle::Points(number), points)
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    let mut lines = vec![Guide::new(inertia.value, format!("eq. 5: {}", with_unit(page, inertia.value)))];
    if found.refinement.is_some() {
        let refined = page.axis().motor.inertia;
        lines.push(Guide::new(refined, format!("refined: {}", with_unit(page, refined))));
    }
    let mut values: Vec<f64> = inertia.instants.iter().map(|instant| instant.2).collect();
    values.sort_by(f64::total_cmp);
    let outliers = (OUTLIERS * values.len() as f64) as usize;
    let inner = values.get(outliers..values.len() - outliers).unwrap_or_default();
    let marked = Extent::of(lines.iter().map(|line| line.at));
    let shown = Extent::join(Extent::of(inner.iter().copied()), marked);
    let mut y = ChartAxis::new("Equivalent inertia", page.inertia_unit());
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
