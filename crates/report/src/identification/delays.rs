//! Section of the delays α, β and γ: deviation between simulation and recording over each delay.

use virtual_axes_core::units::{MILLISECOND, Nanoseconds, Rounded, seconds};
use virtual_axes_identify::identify::{DelayFit, DelayParameter};

use super::page::IdentificationPage;
use super::step::Step;
use crate::text::digits;
use crate::{Band, Chart, ChartAxis, ChartSeries, DisplayUnit, Guide, Panel, Section, SeriesStyle, Table};

/// Ratio of the range of all tried delays to the accepted interval above which the interval has an enlarged
/// plot.
const WIDE: f64 = 10.0;
/// Margin of the enlarged plot on each side, in widths of the interval.
const ENLARGED_MARGIN: f64 = 2.0;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let fits = &page.found.identification.delays;
    let mut section = page.step("Delays", Step::Delays);
    if fits.iter().any(|fit| fit.is_joint) {
        let has_feedforward = fits.iter().any(|fit| fit.delay != DelayParameter::Alpha);
        section.paragraphs.push(
            match has_feedforward {
                true => {
                    "The delays are fitted jointly with gains and torque feedforward, by least squares of simulated minus recorded \
                     positions on the closed loop with its feedforward. The interval of α is a position cycle, in which all \
                     delays give the same motion; those of β and γ are two standard errors wide on each side."
                }
                false => {
                    "α is fitted jointly with the gains, by least squares of simulated minus recorded positions on the closed loop \
                     without feedforward. Its interval is a position cycle, in which all delays give the same motion."
                }
            }
            .to_owned(),
        );
        section.tables.push(table(page, fits));
        return section;
    }
    section.paragraphs.push(
        "α is identified without feedforward, β with velocity feedforward, γ with both, by least squares of \
         simulated minus recorded positions (Prévost section 3.5)."
            .to_owned(),
    );
    if fits.is_empty() {
        section
            .paragraphs
            .push("No delay was identified; the values of the initial machine are kept.".to_owned());
        return section;
    }
    section.paragraphs.push(format!(
        "A delay is effective in steps of a loop cycle: α in position cycles of {} ms; β and γ in velocity \
         cycles of {} ms. All delays of an interval, open below and closed above, give the same motion and \
         cannot be distinguished by the recordings. A delay of the initial machine that lies in its interval is \
         kept.",
        ms(page.periods().position),
        ms(page.periods().velocity)
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
    Rounded(seconds(delay) / MILLISECOND).to_string()
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

/// Returns the range of all tried delays, s.
fn spread(fit: &DelayFit) -> f64 {
    let ends = fit.profile.first().zip(fit.profile.last());
    ends.map_or(0.0, |(first, last)| seconds(last.0 - first.0))
}

fn chart(page: &IdentificationPage, fit: &DelayFit, near: bool) -> Chart {
    let name = letter(fit.delay);
    let (low, high) = (seconds(fit.interval.0), seconds(fit.interval.1));
    let margin = ENLARGED_MARGIN * (high - low);
    let all: Vec<[f64; 2]> = fit.profile.iter().map(|(delay, rms)| [seconds(*delay), *rms]).collect();
    let is_shown = |x: f64| !near || (x >= low - margin && x <= high + margin);
    let points: Vec<[f64; 2]> = all.into_iter().filter(|point| is_shown(point[0])).collect();
    let series = vec![
        ChartSeries::new("", SeriesStyle::Measured, points.clone()),
        ChartSeries::new("tried", SeriesStyle::Points(0), points),
    ];
    let x = ChartAxis::new(format!("Delay {name}"), DisplayUnit::MILLISECOND);
    let x = if near { x.within((low - margin).max(0.0), high + margin) } else { x };
    let y = ChartAxis::new("RMS of the deviation", page.error_unit());
    let y = if near { y } else { y.with_zero() };
    let title = format!("Delay {name}{}", if near { ", near the interval" } else { "" });
    Chart {
        note: format!(
            "feedforward {}; the middle of each interval of equal motion is tried",
            fit.delay.feedforward_mode().name()
        ),
        bands: vec![Band::interval("accepted", low, high)],
        lines: vec![Guide::new(seconds(fit.value), format!("{name} = {} ms", ms(fit.value)))],
        ..Chart::new(title, x, vec![Panel::new(y, series)])
    }
}

fn table(page: &IdentificationPage, fits: &[DelayFit]) -> Table {
    let before = &page.found.identification.initial.delays;
    let row = |fit: &DelayFit| {
        let old = match fit.delay {
            DelayParameter::Alpha => before.alpha,
            DelayParameter::Beta => before.beta,
            DelayParameter::Gamma => before.gamma,
        };
        let least = fit.profile.iter().map(|(_, rms)| *rms).fold(f64::INFINITY, f64::min);
        vec![
            letter(fit.delay).to_owned(),
            if fit.is_joint { "active" } else { fit.delay.feedforward_mode().name() }.to_owned(),
            ms(fit.interval.0),
            ms(fit.interval.1),
            ms(fit.value),
            ms(old),
            digits(least / page.error_unit().size, 3),
            match (fit.is_unchanged, fit.is_joint) {
                (true, _) => "unchanged",
                (false, true) => "least squares",
                (false, false) => "middle of the interval",
            }
            .to_owned(),
        ]
    };
    let columns = [
        ("delay", ""),
        ("feedforward", ""),
        ("above", "ms"),
        ("up to", "ms"),
        ("value", "ms"),
        ("initial", "ms"),
        ("least RMS", page.error_unit().symbol),
        ("choice", ""),
    ];
    Table { rows: fits.iter().map(row).collect(), ..Table::new("Accepted intervals", &columns) }
}
