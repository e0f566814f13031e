//! Section of the presliding at reversals.

use super::super::chart::{Chart, ChartAxis, ChartSeries, Panel, SeriesStyle};
use super::super::document::Section;
use super::super::unit::DisplayUnit;
use super::format::{counted, digits};
use super::{IdentificationPage, Step};

/// Returns the section; none if the presliding was not identified.
pub(super) fn section(page: &IdentificationPage) -> Option<Section> {
    let fit = page.identification.presliding.as_ref()?;
    let found = page.summary.presliding.as_ref()?;
    let mut section = page.step("Presliding", Step::Presliding);
    let [low, high] = found.interval.map(|bound| digits(bound, 3));
    section.paragraphs.push(format!(
        "After a slow reversal the friction current follows g (1 − 2 exp(−σ0 u/g)) over the distance u. {} give a stiffness of \
         {} {} (95 % interval {low} … {high}); friction changes over {} {}.",
        counted(found.reversals, "reversal"),
        digits(found.stiffness, 4),
        found.stiffness_unit,
        digits(found.length, 3),
        page.error_unit().symbol,
    ));
    let points = |of: fn(&[f64; 3]) -> f64| fit.curve.iter().map(|point| [point[0], of(point)]).collect();
    let series = vec![
        ChartSeries::new("measured", SeriesStyle::Measured, points(|point| point[1])),
        ChartSeries::new("modeled", SeriesStyle::Simulated, points(|point| point[2])),
    ];
    section.charts.push(Chart::new(
        "Friction current after a reversal",
        ChartAxis::new("Distance since the reversal", page.error_unit()),
        vec![Panel::new(ChartAxis::new("Friction current", DisplayUnit::AMPERE), series)],
    ));
    Some(section)
}
