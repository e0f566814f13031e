//! Output of `virtual_axes design`: text, JSON, and parameters of a machine file.

use nalgebra::Complex;
use serde_json::{Map, Value, json};
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{DesignError, Margins, PredictionModel};
use virtual_axes_core::units::{DEGREE, MILLISECOND};
use virtual_axes_report::{Table, TableColumn};

use crate::output::text_table;

/// Modulus below which a pole represents a delay; such poles are counted and not listed.
const DELAY_MODULUS: f64 = 1e-3;

/// Position controller of one axis with the properties of its closed loop.
#[derive(Debug)]
pub struct AxisDesign {
    /// Axis name.
    pub axis: String,
    /// Names and values of the design parameters.
    pub tuning: Vec<(&'static str, f64)>,
    /// Prediction model of the plant.
    pub model: PredictionModel,
    /// Controller polynomials.
    pub rst: Rst,
    /// Closed-loop poles, sorted by decreasing modulus.
    pub poles: Vec<Complex<f64>>,
    /// Stability margins, or an error with the unstable pole.
    pub margins: Result<Margins, DesignError>,
}

/// Returns the controllers and a table of the margins of all axes.
pub fn text(method: &str, designs: &[AxisDesign]) -> String {
    let mut text = verdict(designs) + "\n";
    text.extend(designs.iter().map(|design| axis_text(method, design) + "\n"));
    text.push_str(&text_table::text(&margins_table(designs)));
    text
}

/// Returns the worst margins in one line.
pub fn verdict(designs: &[AxisDesign]) -> String {
    let of = if designs.len() > 1 { " of the worst axis" } else { "" };
    match worst(designs) {
        Some(margins) => {
            let [modulus, delay] = [margins.modulus, margins.delay / MILLISECOND];
            format!("modulus margin {modulus:.3}, delay margin {delay:.2} ms{of}\n")
        }
        None => "unstable\n".to_owned(),
    }
}

/// Returns the margins of all axes as comma-separated values.
pub fn csv(designs: &[AxisDesign]) -> String {
    text_table::csv(&margins_table(designs))
}

fn axis_text(method: &str, design: &AxisDesign) -> String {
    let tuning: Vec<String> = design.tuning.iter().map(|(name, value)| format!("{name} = {value}")).collect();
    let (model, rst) = (&design.model, &design.rst);
    let order = model.a().len().max(model.b().len()) - 1;
    let mut text = format!("{}: {method}, {}\n", design.axis, tuning.join(", "));
    let period = model.period() / MILLISECOND;
    text.push_str(&format!(
        "prediction model of order {order}, period {period} ms, powers of 1/q from 0 on\n"
    ));
    let polynomial =
        |name: &str, values: &[f64]| text_table::wrapped_line(&format!("{name} = {}", list(values)));
    text.push_str(&polynomial("A", model.a()));
    text.push_str(&polynomial("B", model.b()));
    text.push_str("controller, powers of 1/q from 0 on; T: powers of q from t_first on\n");
    text.push_str(&polynomial("R", rst.r()));
    text.push_str(&polynomial("S", rst.s()));
    text.push_str(&polynomial("T", rst.t()));
    text.push_str(&format!("t_first = {}\n", rst.t_first()));
    text.push_str(&text_table::text(&poles_table(design)));
    let delays = design.poles.iter().filter(|pole| is_delay(**pole)).count();
    if delays > 0 {
        text.push_str(&format!("and {delays} poles at or near 0 (modulus below {DELAY_MODULUS})\n"));
    }
    if let Err(error) = &design.margins {
        text.push_str(&format!("no margins: {error}\n"));
    }
    text
}

fn poles_table(design: &AxisDesign) -> Table {
    let columns = [
        TableColumn::new("closed-loop pole", ""),
        TableColumn::new("modulus", ""),
        TableColumn::new("natural frequency", "rad/s"),
        TableColumn::new("damping", ""),
    ];
    let mut rows = Vec::new();
    for pole in design.poles.iter().filter(|pole| !is_delay(**pole)) {
        // A conjugate pair has one row.
        if pole.im < 0.0 {
            continue;
        }
        let (frequency, damping) = continuous(*pole, design.model.period());
        let location = match pole.im {
            0.0 => format!("{:.6}", pole.re),
            im => format!("{:.6} ± {im:.6}j", pole.re),
        };
        rows.push(vec![
            location,
            format!("{:.6}", pole.norm()),
            format!("{frequency:.2}"),
            format!("{damping:.3}"),
        ]);
    }
    Table { caption: "Poles".to_owned(), columns: columns.to_vec(), rows, ..Table::default() }
}

fn is_delay(pole: Complex<f64>) -> bool {
    pole.norm() < DELAY_MODULUS
}

/// Returns natural frequency in rad/s and damping ratio of the continuous pole s = ln(z)/Tsp.
fn continuous(pole: Complex<f64>, period: f64) -> (f64, f64) {
    let s = pole.ln() / period;
    (s.norm(), -s.re / s.norm())
}

/// Creates the table of the margins of all axes, with the worst margins if there are several axes.
fn margins_table(designs: &[AxisDesign]) -> Table {
    let columns = [
        TableColumn::new("margins of", ""),
        TableColumn::new("modulus", ""),
        TableColumn::new("phase", "°"),
        TableColumn::new("gain", "×"),
        TableColumn::new("gain downwards", "×"),
        TableColumn::new("delay", "ms"),
    ];
    let mut rows: Vec<Vec<String>> = designs
        .iter()
        .map(|design| match &design.margins {
            Ok(margins) => row(&design.axis, margins),
            Err(_) => vec![design.axis.clone(), "unstable".to_owned()],
        })
        .collect();
    if designs.len() > 1
        && let Some(worst) = worst(designs)
    {
        rows.push(row("worst", &worst));
    }
    Table { caption: "Margins".to_owned(), columns: columns.to_vec(), rows, ..Table::default() }
}

fn row(name: &str, margins: &Margins) -> Vec<String> {
    let figure = |value: f64, digits: usize| match value {
        f64::INFINITY => "none".to_owned(),
        value => format!("{value:.digits$}"),
    };
    let downwards = match margins.gain_reduction {
        0.0 => "none".to_owned(),
        factor => figure(factor, 3),
    };
    vec![
        name.to_owned(),
        figure(margins.modulus, 3),
        figure(margins.phase / DEGREE, 1),
        figure(margins.gain, 3),
        downwards,
        figure(margins.delay / MILLISECOND, 2),
    ]
}

/// Returns the smallest of each margin over the axes; `None` if an axis is unstable.
fn worst(designs: &[AxisDesign]) -> Option<Margins> {
    designs.iter().map(|design| design.margins.as_ref().ok().copied()).reduce(|a, b| {
        let (a, b) = (a?, b?);
        Some(Margins {
            modulus: a.modulus.min(b.modulus),
            phase: a.phase.min(b.phase),
            gain: a.gain.min(b.gain),
            gain_reduction: a.gain_reduction.max(b.gain_reduction),
            delay: a.delay.min(b.delay),
        })
    })?
}

/// Returns the JSON object. Keys contain units; infinite margins are null.
pub fn object(machine: &str, method: &str, designs: &[AxisDesign]) -> Value {
    let axes: Map<String, Value> = designs.iter().map(|d| (d.axis.clone(), axis(d))).collect();
    json!({
        "machine": machine,
        "method": method,
        "axes": axes,
        "worst": worst(designs).map(|worst| margins_object(&worst)),
    })
}

fn axis(design: &AxisDesign) -> Value {
    let tuning: Map<String, Value> =
        design.tuning.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
    let (model, rst) = (&design.model, &design.rst);
    let poles: Vec<Value> = design
        .poles
        .iter()
        .map(|pole| {
            let (frequency, damping) = continuous(*pole, model.period());
            json!({
                "re": pole.re,
                "im": pole.im,
                "modulus": pole.norm(),

                "natural_frequency_rad_s": frequency,
                "damping": damping,
            })
        })
        .collect();
    json!({
        "tuning": tuning,
        "model": { "period_ms": model.period() / MILLISECOND, "a": model.a(), "b_s": plain(model.b()) },
        "r_per_s": rst.r(),
        "s": rst.s(),
        "t_per_s": rst.t(),
        "t_first": rst.t_first(),
        "stable": design.margins.is_ok(),
        "poles": poles,
        "margins": design.margins.as_ref().ok().map(margins_object),
    })
}

/// Returns the margins as a JSON object.
pub fn margins_object(margins: &Margins) -> Value {
    json!({
        "modulus": margins.modulus,
        "phase_deg": margins.phase / DEGREE,
        "gain": margins.gain,
        "gain_reduction": margins.gain_reduction,
        "delay_ms": margins.delay / MILLISECOND,
    })
}

/// Returns the controllers as parameters of a machine file.
pub fn yaml(designs: &[AxisDesign]) -> String {
    let mut text = "/**:\n  ros__parameters:\n".to_owned();
    for AxisDesign { axis, rst, margins, .. } in designs {
        text.push_str(&format!("    {axis}:\n      position_loop:\n        controller: rst\n"));
        if margins.is_err() {
            text.push_str("        allow_unstable: true\n");
        }
        let (r, s, t) = (list(rst.r()), list(rst.s()), list(rst.t()));
        text.push_str(&format!(
            "        rst:\n          r: {r}\n          s: {s}\n          t: {t}\n          t_first: {}\n",
            rst.t_first()
        ));
    }
    text
}

fn list(polynomial: &[f64]) -> String {
    let numbers: Vec<String> = polynomial.iter().copied().map(number).collect();
    format!("[{}]", numbers.join(", "))
}

/// Formats a number with the fewest digits that parse to the same value, in YAML 1.1 syntax: with a decimal
/// point, and with a sign in the exponent.
fn number(value: f64) -> String {
    let text = format!("{:?}", value + 0.0);
    let Some((digits, exponent)) = text.split_once('e') else {
        return text;
    };
    let point = if digits.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{digits}{point}e{sign}{exponent}")
}

/// Replaces negative zeros.
fn plain(polynomial: &[f64]) -> Vec<f64> {
    polynomial.iter().map(|c| c + 0.0).collect()
}
