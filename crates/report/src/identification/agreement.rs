//! Sections of the comparison of measured and simulated signals (Prévost figs. 6 and 7).

use std::ops::Range;

use super::super::chart::{Band, Chart, ChartAxis, ChartSeries, Panel, SeriesStyle};
use super::super::document::Section;
use super::super::table::{Table, TableColumn};
use super::super::text::number;
use super::super::unit::DisplayUnit;
use super::format::{columns, digits, format_r_squared, optional, with_unit};
use super::recordings::{bands, over_time, single_recording};
use super::{IdentificationPage, Step, ValidationRecording};
use virtual_axes_core::units::{MILLIMETER, seconds};
use virtual_axes_identify::identify::summary::RecordingSummary;
use virtual_axes_identify::identify::{
    Agreement, Experiment, ExperimentComparison, IdentificationInput, ResidualStatistics, SegmentKind,
    SimulatedExperiment,
};

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

pub(super) fn section(page: &IdentificationPage) -> Section {
    let mut section = page.step("Measured and simulated", Step::Agreement);
    let pairs: Vec<(&IdentificationInput, &Agreement)> =
        page.inputs.iter().zip(&page.identification.agreements).collect();
    section.paragraphs.push(
        "Simulation of the identified axis in closed loop with the recorded setpoints (Prévost fig. 6). \
         Deviations are simulated minus measured."
            .to_owned(),
    );
    fill(page, &mut section, &pairs);
    section
}

/// Creates the section of a validation recording.
pub(super) fn validation_section(
    page: &IdentificationPage,
    check: &ValidationRecording,
    recording: &RecordingSummary,
) -> Section {
    let mut section = single_recording(recording, check.findings);
    section.heading = format!("Validation on {}", check.input.signals.name);
    section.paragraphs.push("This recording was not used for the identification.".to_owned());
    fill(page, &mut section, &[(&check.input, check.agreement)]);
    section
}

fn fill(page: &IdentificationPage, section: &mut Section, pairs: &[(&IdentificationInput, &Agreement)]) {
    for (input, agreement) in pairs {
        if agreement.experiments.is_empty() {
            let name = &input.signals.name;
            section.paragraphs.push(match &agreement.inverse {
                Some(_) => format!(
                    "{name} has no PSEC that begins at rest: its current is compared with inverse dynamics. \
                     At rest, static friction allows any current within ±i0."
                ),
                None => format!(
                    "{name} has neither PSEC that begins at rest nor a current: no comparison is possible."
                ),
            });
        }
    }
    let rows: Vec<Vec<String>> = pairs.iter().flat_map(|(input, a)| rows(page, input, a)).collect();
    if !rows.is_empty() {
        section.tables.push(table(page, rows));
    }
    let baselines: Vec<Vec<String>> =
        pairs.iter().filter_map(|(input, a)| baseline_row(page, input, a)).collect();
    if !baselines.is_empty() {
        let unit = page.error_unit();
        section.tables.push(Table {
            caption: "Position from simple predictions and from the model, RMS".to_owned(),
            columns: vec![
                TableColumn::new("recording", ""),
                TableColumn::new("PSEC", unit.symbol),
                TableColumn::new("best constant lag", "ms"),
                TableColumn::new("PSEC delayed by it", unit.symbol),
                TableColumn::new("identified model", unit.symbol),
            ],
            rows: baselines,
        });
    }
    let inverse: Vec<Vec<String>> = pairs.iter().filter_map(|(input, a)| inverse_row(input, a)).collect();
    if !inverse.is_empty() {
        section.paragraphs.push(
            "Inverse dynamics is the current that is required for the recorded motion (Prévost eqs. 1 and \
             3), without a simulation. It does not contain oscillations between two samples or above the \
             cut-off frequency of the filter."
                .to_owned(),
        );
        let heads = [("recording", ""), ("largest", "A"), ("RMS", "A"), ("R²", "")];
        section.tables.push(Table {
            caption: "Current by inverse dynamics minus measured".to_owned(),
            columns: columns(heads),
            rows: inverse,
        });
    }
    for (input, agreement) in pairs {
        let count = agreement.experiments.len();
        for (i, (experiment, simulated)) in agreement.experiments.iter().zip(&agreement.simulated).enumerate()
        {
            let name = name(input, experiment, i, count);
            let run = Run { page, input, agreement, experiment, simulated };
            section.charts.extend(run.charts(&name));
        }
        if agreement.experiments.is_empty() {
            section.charts.extend(inverse_chart(page, input, agreement));
        }
    }
}

/// Returns the name of a part of a recording, numbered if there are several parts.
fn name(input: &IdentificationInput, experiment: &Experiment, i: usize, count: usize) -> String {
    let (name, mode) = (&input.signals.name, experiment.mode.name());
    let part = if count > 1 { format!(", part {}", i + 1) } else { String::new() };
    format!("{name}{part}, feedforward {mode}")
}

fn rows(page: &IdentificationPage, input: &IdentificationInput, agreement: &Agreement) -> Vec<Vec<String>> {
    let (error, velocity) = (page.error_unit(), page.velocity_unit());
    let count = agreement.experiments.len();
    let pairs = agreement.experiments.iter().zip(&agreement.comparisons).enumerate();
    pairs
        .map(|(i, (experiment, comparison))| {
            let ExperimentComparison {
                constant_velocity,
                elsewhere,
                velocity: v,
                current,
                current_r_squared,
            } = comparison;
            let mut row = vec![name(input, experiment, i, count)];
            let mut put = |deviation: &Option<ResidualStatistics>, unit: &DisplayUnit| {
                row.push(optional(deviation.map(|d| d.max), unit, 3));
                row.push(optional(deviation.map(|d| d.rms), unit, 3));
            };
            put(constant_velocity, &error);
            put(elsewhere, &error);
            put(v, &velocity);
            put(current, &DisplayUnit::AMPERE);
            row.push(current_r_squared.map_or_else(String::new, format_r_squared));
            row
        })
        .collect()
}

fn table(page: &IdentificationPage, rows: Vec<Vec<String>>) -> Table {
    let (error, velocity) = (page.error_unit().symbol, page.velocity_unit().symbol);
    let heads = [
        ("part", ""),
        ("position at constant velocity: largest", error),
        ("RMS", error),
        ("elsewhere: largest", error),
        ("RMS", error),
        ("velocity: largest", velocity),
        ("RMS", velocity),
        ("current: largest", "A"),
        ("RMS", "A"),
        ("R² of the current", ""),
    ];
    Table { caption: "Simulated minus measured".to_owned(), columns: columns(heads), rows }
}

fn baseline_row(
    page: &IdentificationPage,
    input: &IdentificationInput,
    agreement: &Agreement,
) -> Option<Vec<String>> {
    let baseline = agreement.baseline?;
    let of = |value: f64| digits(value / page.error_unit().size, 4);
    Some(vec![
        input.signals.name.clone(),
        of(baseline.command),
        number(baseline.lag * 1e3, 2),
        of(baseline.delayed),
        of(baseline.model),
    ])
}

fn inverse_row(input: &IdentificationInput, agreement: &Agreement) -> Option<Vec<String>> {
    let inverse = agreement.inverse.as_ref()?;
    let of = |value: f64| optional(Some(value), &DisplayUnit::AMPERE, 3);
    Some(vec![
        input.signals.name.clone(),
        of(inverse.current.max),
        of(inverse.current.rms),
        format_r_squared(inverse.r_squared),
    ])
}

/// A part of a recording with its simulation.
struct Run<'a> {
    page: &'a IdentificationPage<'a>,
    input: &'a IdentificationInput<'a>,
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
        let tsp = seconds(page.periods.position);
        let following = |position: &[f64], i: usize| e.psec_at(i, tsp) - at(position, i);
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
        let bands = bands(self.input.signals, &self.agreement.segments).into_iter().filter_map(clipped);
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
fn inverse_chart(
    page: &IdentificationPage,
    input: &IdentificationInput,
    agreement: &Agreement,
) -> Option<Chart> {
    let (signals, inverse) = (input.signals, agreement.inverse.as_ref()?);
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
            format!("{}: current by inverse dynamics", signals.name),
            ChartAxis::new("Time", DisplayUnit::SECOND),
            panels,
        )
    })
}
