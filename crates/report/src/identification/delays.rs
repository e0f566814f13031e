//! α, β and γ: the deviation that each delay leaves.

use super::super::chart::{Band, Chart, ChartAxis, ChartSeries, Guide, Panel, SeriesStyle};
use super::super::document::Section;
use super::super::table::Table;
use super::super::unit::DisplayUnit;
use super::format::{columns, digits, exact};
use super::{IdentificationPage, Step};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_identify::identify::{DelayFit, DelayParameter};

/// A picture of the interval's surroundings is made where all delays span more than this times it.
const WIDE: f64 = 10.0;
/// What it shows on either side, in widths of the interval.
const SURROUNDINGS: f64 = 2.0;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let fits = &page.identification.delays;
    let mut section = page.step("Delays", Step::Delays);
    section.paragraphs.push(
        "α is sought without feedforward, β with velocity feedforward, γ with both, by least squares on simulated \
         against recorded positions (Prévost section 3.5)."
            .to_owned(),
    );
    if fits.is_empty() {
        section.paragraphs.push("No delay was identified; what the machine file says is kept.".to_owned());
        return section;
    }
    section.paragraphs.push(format!(
        "A delay acts at the instants of a loop only: α where the position comparator samples, every {} ms; β and γ \
         where the velocity loop reads the feedforward, every {} ms. All delays of an interval, without its lower and \
         with its upper end, move the axis alike: the recordings cannot tell which of them it is. A delay of the \
         machine file that lies in its interval is left.",
        ms(page.periods.position),
        ms(page.periods.velocity)
    ));
    section.tables.push(table(page, fits));
    for fit in fits {
        section.charts.push(chart(page, fit, false));
        if spread(fit) > WIDE * width(fit) {
            section.charts.push(chart(page, fit, true));
        }
    }
    section
}

fn ms(delay: Nanoseconds) -> String {
    exact(seconds(delay) * 1e3)
}

fn letter(delay: DelayParameter) -> &'static str {
    match delay {
        DelayParameter::Alpha => "α",
        DelayParameter::Beta => "β",
        DelayParameter::Gamma => "γ",
    }
}

fn width(fit: &DelayFit) -> f64 {
    seconds(fit.interval.1 - fit.interval.0)
}

/// From the shortest to the longest delay that was tried, s.
fn spread(fit: &DelayFit) -> f64 {
    let ends = fit.profile.first().zip(fit.profile.last());
    ends.map_or(0.0, |(first, last)| seconds(last.0 - first.0))
}

fn chart(page: &IdentificationPage, fit: &DelayFit, near: bool) -> Chart {
    let name = letter(fit.delay);
    let (low, high) = (seconds(fit.interval.0), seconds(fit.interval.1));
    let room = SURROUNDINGS * (high - low);
    let all: Vec<[f64; 2]> = fit.profile.iter().map(|(delay, rms)| [seconds(*delay), *rms]).collect();
    let is_shown = |x: f64| !near || (x >= low - room && x <= high + room);
    let points: Vec<[f64; 2]> = all.into_iter().filter(|point| is_shown(point[0])).collect();
    let series = vec![
        ChartSeries::new("", SeriesStyle::Measured, points.clone()),
        ChartSeries::new("tried", SeriesStyle::Points(0), points),
    ];
    let x = ChartAxis::new(format!("Delay {name}"), DisplayUnit::MILLISECOND);
    let x = if near { x.within((low - room).max(0.0), high + room) } else { x };
    let y = ChartAxis::new("RMS of the deviation", page.error_unit());
    let y = if near { y } else { y.with_zero() };
    let title = format!("Delay {name}{}", if near { ", near the interval" } else { "" });
    Chart {
        note: format!(
            "feedforward {}; of each part that acts alike the middle is tried",
            fit.delay.feedforward_mode().name()
        ),
        bands: vec![Band::interval("accepted", low, high)],
        lines: vec![Guide::new(seconds(fit.value), format!("{name} = {} ms", ms(fit.value)))],
        ..Chart::new(title, x, vec![Panel::new(y, series)])
    }
}

fn table(page: &IdentificationPage, fits: &[DelayFit]) -> Table {
    let before = &page.identification.initial.delays;
    let row = |fit: &DelayFit| {
        let old = match fit.delay {
            DelayParameter::Alpha => before.alpha,
            DelayParameter::Beta => before.beta,
            DelayParameter::Gamma => before.gamma,
        };
        let least = fit.profile.iter().map(|(_, rms)| *rms).fold(f64::INFINITY, f64::min);
        vec![
            letter(fit.delay).to_owned(),
            fit.delay.feedforward_mode().name().to_owned(),
            ms(fit.interval.0),
            ms(fit.interval.1),
            ms(fit.value),
            ms(old),
            digits(least / page.error_unit().size, 3),
            if fit.is_unchanged { "left as it was" } else { "middle of the best" }.to_owned(),
        ]
    };
    let heads = [
        ("delay", ""),
        ("feedforward", ""),
        ("above", "ms"),
        ("up to", "ms"),
        ("value", "ms"),
        ("before", "ms"),
        ("least RMS", page.error_unit().symbol),
        ("choice", ""),
    ];
    Table {
        caption: "Intervals that the data accept".to_owned(),
        columns: columns(heads),
        rows: fits.iter().map(row).collect(),
    }
}
