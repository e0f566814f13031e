//! Output of `virtual_axes bode`: tables, JSON and comma-separated values.

use serde_json::{Map, Value, json};
use virtual_axes_core::design::{continuous_phases, magnitudes_db};
use virtual_axes_core::units::{DEGREE, MILLISECOND};
use virtual_axes_report::{Table, TableColumn};

use crate::bode::loops::{AnalyzedLoop, AxisLoops};
use crate::design::design_output::margins_object;
use crate::output::text_table;

/// Text of a margin or frequency that does not exist.
const NONE: &str = "none";

/// Returns the verdict and the tables.
pub fn text(axes: &[AxisLoops]) -> String {
    let mut text = verdict(axes) + "\n" + &text_table::aligned(&margins_table(axes), &[0, 1]);
    let frequencies = natural_frequencies_table(axes);
    if !frequencies.rows.is_empty() {
        text.push_str(&format!("\n{}", text_table::text(&frequencies)));
    }
    for (axis, one) in loops(axes) {
        if let Err(error) = &one.margins {
            text.push_str(&format!("\nno margins of {}: {error}\n", loop_name(axis, one)));
        }
    }
    text
}

/// Returns the smallest modulus margin in one line.
pub fn verdict(axes: &[AxisLoops]) -> String {
    let unstable: Vec<String> =
        loops(axes).filter(|(_, one)| one.margins.is_err()).map(|(axis, one)| loop_name(axis, one)).collect();
    if !unstable.is_empty() {
        return format!("unstable: {}\n", unstable.join(", "));
    }
    let moduli =
        loops(axes).filter_map(|(axis, one)| Some((one.margins.as_ref().ok()?.margins.modulus, axis, one)));
    match moduli.min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((modulus, axis, one)) => {
            format!("smallest modulus margin {modulus:.3}: {}\n", loop_name(axis, one))
        }
        None => String::new(),
    }
}

fn loops(axes: &[AxisLoops]) -> impl Iterator<Item = (&AxisLoops, &AnalyzedLoop)> {
    axes.iter().flat_map(|axis| axis.loops.iter().map(move |one| (axis, one)))
}

fn loop_name(axis: &AxisLoops, one: &AnalyzedLoop) -> String {
    format!("{} loop of {}", one.control_loop.name(), axis.axis)
}

/// Returns the margins of all loops as a table.
pub fn margins_table(axes: &[AxisLoops]) -> Table {
    let columns = [
        ("axis", ""),
        ("loop", ""),
        ("modulus", ""),
        ("phase", "°"),
        ("at", "Hz"),
        ("gain", "×"),
        ("at", "Hz"),
        ("delay", "ms"),
        ("peak", "dB"),
        ("at", "Hz"),
    ];
    let columns = columns.map(|(name, unit)| TableColumn::new(name, unit)).to_vec();
    let rows = loops(axes).map(|(axis, one)| row(axis, one)).collect();
    Table { caption: "Margins".to_owned(), columns, rows, ..Table::default() }
}

fn row(axis: &AxisLoops, one: &AnalyzedLoop) -> Vec<String> {
    let names = vec![axis.axis.clone(), one.control_loop.name().to_owned()];
    let Ok(found) = &one.margins else {
        return [names, vec!["unstable".to_owned()]].concat();
    };
    let figure = |value: f64, digits: usize| match value.is_finite() {
        true => format!("{value:.digits$}"),
        false => NONE.to_owned(),
    };
    let frequency = |value: Option<f64>| value.map_or_else(|| NONE.to_owned(), |hertz| format!("{hertz:.1}"));
    let margins = &found.margins;
    let peak =
        one.peak.map_or_else(|| NONE.to_owned(), |(_, magnitude)| format!("{:.2}", decibel(magnitude)));
    let figures = vec![
        figure(margins.modulus, 3),
        figure(margins.phase / DEGREE, 1),
        frequency(found.gain_crossover),
        figure(margins.gain, 3),
        frequency(found.phase_crossover),
        figure(margins.delay / MILLISECOND, 3),
        peak,
        frequency(one.peak.map(|(hertz, _)| hertz)),
    ];
    [names, figures].concat()
}

/// Returns the natural frequencies of the elastic axes as a table.
pub fn natural_frequencies_table(axes: &[AxisLoops]) -> Table {
    let columns = [
        TableColumn::new("elastic axis", ""),
        TableColumn::new("antiresonance", "Hz"),
        TableColumn::new("resonance", "Hz"),
    ];
    let row = |axis: &AxisLoops| {
        let found = axis.natural_frequencies?;
        Some(vec![
            axis.axis.clone(),
            format!("{:.1}", found.antiresonance),
            format!("{:.1}", found.resonance),
        ])
    };
    let rows = axes.iter().filter_map(row).collect();
    Table {
        caption: "Natural frequencies without damping".to_owned(),
        columns: columns.to_vec(),
        rows,
        ..Table::default()
    }
}

fn decibel(magnitude: f64) -> f64 {
    20.0 * magnitude.log10()
}

/// Returns the JSON object. Keys contain units; infinite margins are null.
pub fn object(machine: &str, axes: &[AxisLoops]) -> Value {
    let axis = |axis: &AxisLoops| {
        let loops: Map<String, Value> =
            axis.loops.iter().map(|one| (one.control_loop.name().to_owned(), loop_object(one))).collect();
        json!({
            "antiresonance_hz": axis.natural_frequencies.map(|found| found.antiresonance),
            "resonance_hz": axis.natural_frequencies.map(|found| found.resonance),
            "loops": loops,
        })
    };
    let axes: Map<String, Value> = axes.iter().map(|one| (one.axis.clone(), axis(one))).collect();
    json!({ "machine": machine, "axes": axes })
}

fn loop_object(one: &AnalyzedLoop) -> Value {
    let found = one.margins.as_ref().ok();
    json!({
        "cycle_ms": one.period / MILLISECOND,
        "stable": found.is_some(),
        "margins": found.map(|found| margins_object(&found.margins)),
        "gain_crossover_hz": found.and_then(|found| found.gain_crossover),
        "phase_crossover_hz": found.and_then(|found| found.phase_crossover),
        "peak_db": one.peak.map(|(_, magnitude)| decibel(magnitude)),
        "peak_hz": one.peak.map(|(hertz, _)| hertz),
    })
}

/// Returns the frequency responses of all loops, a row per axis, loop and frequency.
pub fn csv(axes: &[AxisLoops]) -> String {
    let mut text = "frequency_hz,axis,loop,open_db,open_deg,closed_db,closed_deg\n".to_owned();
    for (axis, one) in loops(axes) {
        let response = &one.response;
        let [open, closed] = [&response.open, &response.closed];
        let [open_db, closed_db] = [open, closed].map(|values| magnitudes_db(values));
        let [open_phase, closed_phase] = [open, closed].map(|values| continuous_phases(values));
        for (k, frequency) in response.frequencies.iter().enumerate() {
            let row = [
                frequency.to_string(),
                axis.axis.clone(),
                one.control_loop.name().to_owned(),
                open_db[k].to_string(),
                (open_phase[k] / DEGREE).to_string(),
                closed_db[k].to_string(),
                (closed_phase[k] / DEGREE).to_string(),
            ];
            text.push_str(&text_table::csv_row(&row));
        }
    }
    text
}
