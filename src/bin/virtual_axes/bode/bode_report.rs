//! The report of `virtual_axes bode`: Bode plots of the loops of each axis.

use std::io;
use std::path::Path;

use nalgebra::Complex;
use virtual_axes_core::design::{FrequencyResponse, continuous_phases, magnitudes_db};
use virtual_axes_core::units::DEGREE;
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{
    Chart, ChartAxis, ChartSeries, DisplayUnit, Document, Guide, Panel, Section, SeriesStyle, Table,
};

use crate::bode::bode_output::{margins_table, natural_frequencies_table};
use crate::bode::loops::AxisLoops;
use crate::output::report::{ReportMachine, provenance};

const HERTZ: DisplayUnit = DisplayUnit::new("Hz", 1.0, 1e-3);
const DECIBEL: DisplayUnit = DisplayUnit::new("dB", 1.0, 1.0);
/// Lowest magnitude that is drawn, dB; zeros of the response are far below.
const LOWEST_MAGNITUDE: f64 = -100.0;
/// Margin above the largest magnitude if the range is limited, dB.
const MAGNITUDE_MARGIN: f64 = 5.0;

/// Writes the page atomically.
pub fn write(path: &Path, machine: &ReportMachine, axes: &[AxisLoops]) -> io::Result<()> {
    let facts = [("machine".to_owned(), machine.title.clone())];
    let document = Document {
        title: "Frequency responses of the control loops".to_owned(),
        description:
            "Linear discrete-time models of the loops, each sampled by its own cycle up to its Nyquist \
                      frequency, without friction, gravity, limits, feedforward and setpoint delays."
                .to_owned(),
        facts: facts.into_iter().chain(provenance(machine)).collect(),
        sections: axes.iter().map(section).collect(),
        ..Document::default()
    };
    let mut file = OutputFile::create(path)?;
    document.write(&mut file)?;
    file.finish()
}

fn section(axis: &AxisLoops) -> Section {
    let of_axis = std::slice::from_ref(axis);
    let frequencies = natural_frequencies_table(of_axis);
    let mut tables: Vec<Table> = vec![margins_table(of_axis)];
    tables.extend((!frequencies.rows.is_empty()).then_some(frequencies));
    let mut open = chart(axis, "Open loops", |response| &response.open);
    open.panels[0].lines = vec![Guide::new(0.0, "")];
    open.panels[1].lines = vec![Guide::new(-180.0 * DEGREE, "")];
    let closed = chart(axis, "Closed loops", |response| &response.closed);
    Section { tables, charts: vec![open, closed], ..Section::new(format!("Axis {}", axis.axis)) }
}

/// Creates a Bode plot of the loops of an axis.
fn chart(axis: &AxisLoops, title: &str, response: fn(&FrequencyResponse) -> &Vec<Complex<f64>>) -> Chart {
    let series = |values: fn(&[Complex<f64>]) -> Vec<f64>| -> Vec<ChartSeries> {
        let of_loop = axis.loops.iter().map(|one| {
            let values = values(response(&one.response));
            let (name, style) = (one.control_loop.name(), SeriesStyle::Line(one.control_loop as usize));
            ChartSeries::from_xy(name, style, &one.response.frequencies, &values)
        });
        of_loop.collect()
    };
    let magnitudes = series(magnitudes_db);
    let drawn = || magnitudes.iter().flat_map(|one| &one.points).map(|point| point[1]);
    let lowest = drawn().fold(f64::INFINITY, f64::min);
    let highest = drawn().fold(LOWEST_MAGNITUDE, f64::max);
    let mut magnitude = ChartAxis::new("Magnitude", DECIBEL);
    if lowest < LOWEST_MAGNITUDE {
        magnitude = magnitude.within(LOWEST_MAGNITUDE, highest + MAGNITUDE_MARGIN);
    }
    let phase = ChartAxis::new("Phase", DisplayUnit::DEGREE);
    let panels = vec![Panel::new(magnitude, magnitudes), Panel::new(phase, series(continuous_phases))];
    let mut chart = Chart::new(
        format!("{title} of {}", axis.axis),
        ChartAxis::new("Frequency", HERTZ).logarithmic(),
        panels,
    );
    if let Some(found) = axis.natural_frequencies {
        chart.lines = vec![Guide::new(found.antiresonance, ""), Guide::new(found.resonance, "")];
        let [low, high] = [found.antiresonance, found.resonance];
        chart.note = format!("vertical lines: antiresonance {low:.1} Hz, resonance {high:.1} Hz");
    }
    chart
}
