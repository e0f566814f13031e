//! Sections of the comparison of measured and simulated signals (Prévost figs. 6 and 7).

use std::ops::Range;

use virtual_axes_core::units::MILLIMETER;
use virtual_axes_identify::identify::summary::{ResidualSummary, ValidationSummary};
use virtual_axes_identify::identify::{
    Agreement, AxisValidation, Experiment, SegmentKind, SimulatedExperiment,
};
use virtual_axes_identify::recording::Signals;

use super::figures;
use super::page::{IdentificationPage, format_r_squared, with_unit};
use super::recordings::{bands, over_time, single_recording};
use super::step::Step;
use crate::{Band, Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, Section, SeriesStyle};

/// Duration above which one move has a plot of its own, s.
const LONG: f64 = 12.0;
/// Maximum duration of the move in its own plot, s.
const LONGEST_MOVE: f64 = 6.0;
/// Smallest speed of a fast move, as a fraction of the highest speed.
const FAST: f64 = 0.7;
/// Speed at which a move begins and ends, as a fraction of the highest speed.
const MOVING: f64 = 0.005;
/// Margin of the plot around a move, as a fraction of it.
const MOVE_MARGIN: f64 = 0.2;
/// Following error above which it is plotted in the unit of positions, m or rad.
const LARGE_ERROR: f64 = MILLIMETER;

/// Recording with its deviations from the simulation.
type Compared<'a> = (&'a Signals, &'a Agreement, &'a ResidualSummary);

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = page.found;
    let mut section = page.step("Measured and simulated", Step::Agreement);
    section.paragraphs.push(
        "Simulation of the identified axis in closed loop with the recorded setpoints (Prévost fig. 6). \
         Deviations are simulated minus measured."
            .to_owned(),
    );
    let agreements = found.identification.agreements.iter().zip(&found.summary.agreement);
    let compared: Vec<Compared> = found
        .recordings
        .iter()
        .zip(agreements)
        .map(|(recorded, (agreement, summary))| (&recorded.signals, agreement, &summary.residuals))
        .collect();
    fill(page, &mut section, &compared);
    section
}

/// Creates the section of a validation recording.
pub(super) fn validation_section(
    page: &IdentificationPage,
    check: &AxisValidation,
    summary: &ValidationSummary,
) -> Section {
    let mut section = single_recording(page, &check.recorded, &summary.recording);
    section.heading = format!("Validation on {}", page.file_name(&summary.recording.name));
    section.paragraphs.push("This recording was not used for the identification.".to_owned());
    fill(page, &mut section, &[(&check.recorded.signals, &check.agreement, &summary.residuals)]);
    section
}

fn fill(page: &IdentificationPage, section: &mut Section, compared: &[Compared]) {
    for (signals, agreement, _) in
        compared.iter().filter(|(_, agreement, _)| agreement.experiments.is_empty())
    {
        let name = page.file_name(&signals.name);
        section.paragraphs.push(match &agreement.inverse {
            Some(_) => format!(
                "{name} has no PSEC that begins at rest: its current is compared with inverse dynamics. \
                 At rest, static friction allows any current within ±i0."
            ),
            None => {
                format!(
                    "{name} has neither PSEC that begins at rest nor a current: no comparison is possible."
                )
            }
        });
    }
    let found = &page.found.summary;
    let residuals: Vec<(String, &ResidualSummary)> = compared
        .iter()
        .map(|(signals, _, residuals)| (page.file_name(&signals.name).to_owned(), *residuals))
        .collect();
    if !residuals.is_empty() {
        section.tables.push(figures::agreement(found, &residuals));
    }
    if residuals.iter().any(|(_, residuals)| residuals.inverse_dynamics.is_some()) {
        section.paragraphs.push(
            "Inverse dynamics is the current that is required for the recorded motion (Prévost eqs. 1 and \
             3), without a simulation. It does not contain oscillations between two samples or above the \
             cut-off frequency of the filter."
                .to_owned(),
        );
    }
    for &(signals, agreement, _) in compared {
        let count = agreement.experiments.len();
        for (i, (experiment, simulated)) in agreement.experiments.iter().zip(&agreement.simulated).enumerate()
        {
            let name = name(page.file_name(&signals.name), experiment, i, count);
            let run = Run { page, signals, agreement, experiment, simulated };
            section.charts.extend(run.charts(&name));
        }
        if agreement.experiments.is_empty() {
            section.charts.extend(inverse_chart(page, signals, agreement));
        }
    }
}

/// Returns the name of a part of a recording, numbered if there are several parts.
fn name(recording: &str, experiment: &Experiment, i: usize, count: usize) -> String {
    let mode = experiment.mode.name();
    let part = if count > 1 { format!(", part {}", i + 1) } else { String::new() };
    format!("{recording}{part}, feedforward {mode}")
}

/// A part of a recording with its simulation.
struct Run<'a> {
    page: &'a IdentificationPage<'a>,
    signals: &'a Signals,
    agreement: &'a Agreement,
    experiment: &'a Experiment,
    simulated: &'a SimulatedExperiment,
}

impl Run<'_> {
    /// Creates the plot of the part, and a plot of a fast move if the part is long.
    fn charts(&self, name: &str) -> Vec<Chart> {
        let count = self.experiment.position.len();
        let mut charts = vec![self.chart(name.to_owned(), 0..count)];
        if count as f64 * self.experiment.period() > LONG
            && let Some(window) = self.fast_move()
        {
            charts.push(self.chart(format!("{name}: a fast move"), window));
        }
        charts
    }

    /// Returns the samples of the fast move with the longest constant velocity, with a margin.
    fn fast_move(&self) -> Option<Range<usize>> {
        let (velocity, period) = (&self.experiment.velocity, self.experiment.period());
        let top = velocity.iter().map(|v| v.abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let longest = (LONGEST_MOVE / period) as usize;
        let segments = self.agreement.segments.iter().filter(|segment| {
            segment.kind == SegmentKind::ConstantVelocity
                && segment.span == self.experiment.span
                && segment.velocity.abs() >= FAST * top
                && segment.samples.start >= self.experiment.sample
                && segment.samples.len() < longest
        });
        let inside = match segments.max_by_key(|segment| segment.samples.len()) {
            Some(segment) => segment.samples.start - self.experiment.sample,
            // Without a long constant velocity: the move with the highest speed.
            None => velocity.iter().position(|v| v.abs() >= top)?,
        };
        let direction = velocity.get(inside)?.signum();
        let is_moving = |v: &f64| *v * direction > MOVING * top;
        let before = velocity.get(..inside)?.iter().rev().take_while(|v| is_moving(v)).count();
        let after = velocity.get(inside..)?.iter().take_while(|v| is_moving(v)).count();
        let margin = (MOVE_MARGIN * (before + after) as f64) as usize;
        let begin = inside.saturating_sub((before + margin).min(longest));
        Some(begin..(inside + (after + margin).min(longest)).min(velocity.len()))
    }

    fn chart(&self, title: String, window: Range<usize>) -> Chart {
        let Run { page, experiment: e, simulated: s, .. } = self;
        let time = |i: usize| e.start + i as f64 * e.period();
        let (from, to) = (time(window.start), time(window.end));
        let series = |label: &str, style, value: &dyn Fn(usize) -> f64| {
            ChartSeries::new(label, style, window.clone().map(|i| [time(i), value(i)]).collect())
        };
        let at = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(f64::NAN);
        let both =
            |quantity: &str, unit, measured: &dyn Fn(usize) -> f64, simulated: &dyn Fn(usize) -> f64| {
                let lines = vec![
                    series("measured", SeriesStyle::Measured, measured),
                    series("simulated", SeriesStyle::Simulated, simulated),
                ];
                Panel::new(ChartAxis::new(quantity, unit), lines)
            };
        let deviation = |i: usize| at(&s.position, i) - at(&e.position, i);
        let deviation = vec![series("", SeriesStyle::Line(0), &deviation)];
        let following = |position: &[f64], i: usize| e.psec_at(i) - at(position, i);
        let largest = window.clone().map(|i| following(&e.position, i).abs()).fold(0.0, f64::max);
        let unit = if largest > LARGE_ERROR { page.position_unit() } else { page.error_unit() };
        let mut panels = vec![
            Panel::new(ChartAxis::new("Deviation", page.error_unit()), deviation),
            both("Following error", unit, &|i| following(&e.position, i), &|i| following(&s.position, i)),
            both("Velocity", page.velocity_unit(), &|i| at(&e.velocity, i), &|i| at(&s.velocity, i)),
        ];
        if let Some(current) = &e.current {
            panels.push(both("Current", DisplayUnit::AMPERE, &|i| at(current, i), &|i| at(&s.current, i)));
        }
        let clipped = |band: Band| {
            let (from, to) = (band.from.max(from), band.to.min(to));
            (from < to).then_some(Band { from, to, ..band })
        };
        let bands = bands(self.signals, &self.agreement.segments).into_iter().filter_map(clipped);
        let peak = largest_of(&panels);
        Chart {
            note: format!(
                "deviation: simulated − measured position, up to {}",
                with_unit(peak, &page.error_unit(), 3)
            ),
            bands: bands.collect(),
            ..Chart::new(title, ChartAxis::new("Time", DisplayUnit::SECOND).within(from, to), panels)
        }
    }
}

/// Returns the largest magnitude in the first panel.
fn largest_of(panels: &[Panel]) -> f64 {
    let points = panels.first().into_iter().flat_map(|panel| &panel.series).flat_map(|s| &s.points);
    points.map(|point| point[1].abs()).filter(|d| d.is_finite()).fold(0.0, f64::max)
}

/// Creates the plot of measured current and current by inverse dynamics.
fn inverse_chart(page: &IdentificationPage, signals: &Signals, agreement: &Agreement) -> Option<Chart> {
    let inverse = agreement.inverse.as_ref()?;
    let mut modeled = Vec::new();
    let mut deviation = Vec::new();
    for (number, currents) in &inverse.modeled {
        let Some(span) = signals.spans.get(*number) else { continue };
        let time = |i: usize| span.start + i as f64 * signals.period;
        modeled.extend(currents.iter().enumerate().map(|(i, current)| [time(i), *current]));
        modeled.push([span.start, f64::NAN]);
        let recorded = span.current.iter().flatten();
        let pairs = currents.iter().zip(recorded).enumerate();
        deviation.extend(pairs.map(|(i, (modeled, recorded))| [time(i), modeled - recorded]));
        deviation.push([span.start, f64::NAN]);
    }
    let measured = over_time(signals, &|span| span.current.clone());
    let velocity = over_time(signals, &|span| Some(span.velocity.clone()));
    let panels = vec![
        Panel::new(
            ChartAxis::new("Deviation", DisplayUnit::AMPERE),
            vec![ChartSeries::new("", SeriesStyle::Line(0), deviation)],
        ),
        Panel::new(
            ChartAxis::new("Current", DisplayUnit::AMPERE),
            vec![
                ChartSeries::new("measured", SeriesStyle::Measured, measured),
                ChartSeries::new("modeled", SeriesStyle::Simulated, modeled),
            ],
        ),
        Panel::new(
            ChartAxis::new("Velocity", page.velocity_unit()),
            vec![ChartSeries::new("", SeriesStyle::Measured, velocity)],
        ),
    ];
    Some(Chart {
        note: format!("R² {}", format_r_squared(inverse.r_squared)),
        bands: bands(signals, &agreement.segments),
        ..Chart::new(
            format!("{}: current by inverse dynamics", page.file_name(&signals.name)),
            ChartAxis::new("Time", DisplayUnit::SECOND),
            panels,
        )
    })
}
