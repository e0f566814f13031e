//! Text output of `virtual_axes identify`.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, MILLIMETER, MILLISECOND, MILLISECOND_NS};
use virtual_axes_identify::identify::{
    Agreement, ExperimentComparison, FeedforwardRegression, FrictionFit, FrictionLaw, GravityFit,
    GravitySource, Identification, IdentifiedValue, LawFit, RefinedParameter, ResidualStatistics,
    SteadyCurrent,
};
use virtual_axes_identify::recording::{Finding, Severity};
use virtual_axes_report::{Table, TableColumn};

use crate::axis::AxisUnits;
use crate::identify_result::IdentificationResult;
use crate::recordings::ConditionedRecording;
use crate::table;

/// Cell without a value.
const NONE: &str = "–";
/// Relative difference below which the speeds of both directions share a row.
const SAME_SPEED: f64 = 0.03;

/// Returns the name of the unit of an axis's velocities, and its size in SI units.
pub fn velocity_scale(kind: AxisKind) -> (&'static str, f64) {
    match kind {
        AxisKind::Linear => ("mm/s", MILLIMETER),
        AxisKind::Rotary => ("deg/s", DEGREE),
    }
}

/// Returns the name of a severity.
pub fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Missing => "missing",
        Severity::Warning => "warning",
        Severity::Note => "note",
    }
}

/// Formats a finding with its remedy on one line.
pub fn finding(finding: &Finding) -> String {
    format!("{}: {finding}", severity(finding.severity))
}

/// Returns the active feedforward of each part of a recording.
pub fn modes(recorded: &ConditionedRecording, agreement: &Agreement) -> Vec<&'static str> {
    let mut names: Vec<&str> = agreement.experiments.iter().map(|e| e.mode.name()).collect();
    if names.is_empty() {
        names.extend(recorded.feedforward.map(|mode| mode.name()));
    }
    names.dedup();
    names
}

/// Groups friction levels by speed, each with the positive and the negative direction.
pub fn by_speed(levels: &[SteadyCurrent]) -> Vec<[Option<&SteadyCurrent>; 2]> {
    let mut sorted: Vec<&SteadyCurrent> = levels.iter().collect();
    sorted.sort_by(|a, b| a.velocity.abs().total_cmp(&b.velocity.abs()));
    let mut found: Vec<[Option<&SteadyCurrent>; 2]> = Vec::new();
    for level in sorted {
        let (side, other) = if level.velocity > 0.0 { (0, 1) } else { (1, 0) };
        let near = |other: &SteadyCurrent| {
            level.velocity.abs() - other.velocity.abs() < SAME_SPEED * other.velocity.abs()
        };
        match found.last_mut() {
            Some(pair) if pair[side].is_none() && pair[other].is_some_and(near) => pair[side] = Some(level),
            _ => {
                let mut pair = [None; 2];
                pair[side] = Some(level);
                found.push(pair);
            }
        }
    }
    found
}

fn table_of(columns: &[(&str, &str)]) -> Table {
    let columns = columns.iter().map(|&(name, unit)| TableColumn::new(name, unit)).collect();
    Table { columns, ..Table::default() }
}

/// Formats a number with `count` significant digits.
fn digits(value: f64, count: i32) -> String {
    /// Decimal exponents of numbers that are written without an exponent.
    const PLAIN: std::ops::Range<i32> = -5..7;
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    if !PLAIN.contains(&magnitude) {
        return format!("{value:.*e}", usize::try_from(count - 1).unwrap_or(0));
    }
    format!("{value:.*}", usize::try_from(count - 1 - magnitude).unwrap_or(0))
}

fn or_none(value: Option<f64>, text: impl Fn(f64) -> String) -> String {
    value.filter(|value| value.is_finite()).map_or_else(|| NONE.to_owned(), text)
}

/// Returns the result as text and tables.
pub fn text(found: &IdentificationResult) -> String {
    let mut parts = vec![
        format!("{}: {}\n", found.machine, found.axis.name()),
        table::text(&recordings(found)),
        table::aligned(&values(&found.values), &[0, 2, 5]),
    ];
    parts.extend(steps(found));
    parts.push(table::text(&agreement(found)));
    let findings: Vec<String> = found.findings.iter().map(|f| finding(f) + "\n").collect();
    parts.push(findings.concat());
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
}

/// Returns the name of a validation recording.
fn validation_name(recorded: &ConditionedRecording) -> String {
    format!("{} (validation)", recorded.signals.name)
}

fn recordings(found: &IdentificationResult) -> Table {
    let mut table = table_of(&[
        ("recording", ""),
        ("duration", "s"),
        ("samples", ""),
        ("period", "ms"),
        ("cut-off", "Hz"),
        ("current lag", "ms"),
        ("feedforward", ""),
    ]);
    let validations = found.validations.iter().map(|v| (&v.recorded, Some(&v.agreement)));
    let agreements = found.identification.agreements.iter().map(Some).chain(std::iter::repeat(None));
    let all = found.recordings.iter().zip(agreements).chain(validations);
    for (number, (recorded, agreement)) in all.enumerate() {
        let signals = &recorded.signals;
        let name =
            if number < found.recordings.len() { signals.name.clone() } else { validation_name(recorded) };
        let modes = agreement.map_or_else(Vec::new, |agreement| modes(recorded, agreement));
        table.rows.push(vec![
            name,
            format!("{:.3}", recorded.duration()),
            recorded.samples().to_string(),
            digits(signals.period / MILLISECOND, 4),
            format!("{:.1}", signals.cutoff),
            format!("{:.2}", signals.current_lag / MILLISECOND),
            if modes.is_empty() { NONE.to_owned() } else { modes.join(", ") },
        ]);
    }
    table
}

fn values(values: &[IdentifiedValue]) -> Table {
    let columns =
        [("parameter", ""), ("value", ""), ("unit", ""), ("±", ""), ("initial", ""), ("source", "")];
    let mut table = table_of(&columns);
    for value in values {
        let spread = match (value.interval, value.error) {
            (Some([low, high]), _) => format!("{low} … {high}"),
            (None, error) => or_none(error, |error| digits(error, 2)),
        };
        table.rows.push(vec![
            value.key.clone(),
            value.value.to_string(),
            value.unit.to_owned(),
            spread,
            or_none(Some(value.before), |before| before.to_string()),
            value.source.clone(),
        ]);
    }
    table
}

/// Returns the results of the steps.
fn steps(found: &IdentificationResult) -> Vec<String> {
    let identification = &found.identification;
    let mut parts = Vec::new();
    if let Some(friction) = &identification.friction {
        parts.push(self::friction(
            friction,
            &identification.steady.levels,
            AxisUnits::for_kind(found.axis.kind()),
        ));
    }
    let mut lines = String::new();
    let all = [
        identification.gravity.as_ref().map(gravity),
        inertia(identification),
        regression("VFFW", identification.feedforward.velocity.as_ref()),
        regression("TFFW", identification.feedforward.torque.as_ref()),
    ];
    for line in all.into_iter().flatten() {
        lines.push_str(&(line + "\n"));
    }
    for fit in &identification.delays {
        let ms = |delay: i64| delay as f64 / MILLISECOND_NS as f64;
        let [low, high] = [fit.interval.0, fit.interval.1].map(ms);
        let left = if fit.is_unchanged { ", unchanged" } else { "" };
        lines.push_str(&format!(
            "{}: {} ms{left}; delays above {low} and up to {high} ms give the same motion\n",
            fit.delay.name(),
            ms(fit.value),
        ));
    }
    if let Some(refinement) = &identification.refinement {
        let (_, _, scale) = table::scale(found.axis.kind());
        let unit = table::scale(found.axis.kind()).0;
        let (before, after) = refinement.position;
        lines.push_str(&format!(
            "refined in closed loop: {} parameters; position RMS {} → {} {unit}",
            refinement.parameters.len(),
            digits(before / scale, 3),
            digits(after / scale, 3)
        ));
        if let Some((before, after)) = refinement.current {
            lines.push_str(&format!(", current RMS {} → {} A", digits(before, 3), digits(after, 3)));
        }
        lines.push('\n');
    }
    parts.push(lines);
    parts
}

fn friction(friction: &FrictionFit, levels: &[SteadyCurrent], units: AxisUnits) -> String {
    let law = &friction.law;
    let speeds = by_speed(levels);
    let name = match law.law {
        FrictionLaw::DoubleExponential => "a e^(bV) + c e^(dV) (Prévost eq. 3)",
        FrictionLaw::Linear => "Coulomb level and viscous slope",
    };
    let mut text = format!("friction: {name}, {} speeds, R² {:.5}", speeds.len(), law.r_squared);
    if friction.asymmetry.is_finite() {
        text.push_str(&format!("; directions differ by up to {:.1} %", 100.0 * friction.asymmetry));
    }
    text.push('\n');
    let mut laws =
        table_of(&[("law", ""), ("a", "A"), ("b", ""), ("c", "A"), ("d", ""), ("i0", "A"), ("R²", "")]);
    let line = law.law == FrictionLaw::Linear;
    if line {
        laws = table_of(&[("law", ""), ("level", "A"), ("slope", "A per unit of V"), ("R²", "")]);
    }
    let row = |name: &str, law: &LawFit| {
        let figures: Vec<f64> = match law.line() {
            Some((level, slope)) => vec![level, slope],
            None => {
                let c = &law.config;
                vec![c.a, c.b, c.c, c.d, c.i0]
            }
        };
        let figures = figures.into_iter().map(|figure| digits(figure, 5));
        [vec![name.to_owned()], figures.collect(), vec![format!("{:.5}", law.r_squared)]].concat()
    };
    laws.rows.push(row("both directions", law));
    for (name, law) in ["positive direction", "negative direction"].iter().zip(&friction.directions) {
        laws.rows.extend(law.as_ref().map(|law| row(name, law)));
    }
    text.push_str(&table::text(&laws));
    text.push('\n');
    let mut table = table_of(&[
        ("speed", units.speed_name),
        ("friction, positive direction", "A"),
        ("±", "A"),
        ("negative direction", "A"),
        ("±", "A"),
        ("law", "A"),
    ]);
    for pair in speeds {
        let Some(speed) = mean_speed(&pair).map(|speed| speed / units.speed) else { continue };
        let mut row = vec![format!("{speed:.3}")];
        for level in pair {
            row.push(or_none(level.map(|l| l.friction), |friction| format!("{friction:.4}")));
            row.push(or_none(level.map(|l| l.error), |error| format!("{error:.4}")));
        }
        row.push(format!("{:.4}", law.at(speed)));
        table.rows.push(row);
    }
    text + &table::text(&table)
}

/// Returns the mean speed of the directions with a level, m/s or rad/s.
fn mean_speed(pair: &[Option<&SteadyCurrent>; 2]) -> Option<f64> {
    let speeds: Vec<f64> = pair.iter().flatten().map(|level| level.velocity.abs()).collect();
    (!speeds.is_empty()).then(|| speeds.iter().sum::<f64>() / speeds.len() as f64)
}

fn gravity(gravity: &GravityFit) -> String {
    let source = source(gravity.source);
    let part = |value: f64, error: f64| format!("{} ± {} A", digits(value, 4), digits(error, 2));
    let (current, error) = (&gravity.current, &gravity.error);
    let mut text = format!("gravity, from {source}: {}", part(current.constant, error.constant));
    if current.sine != 0.0 || current.cosine != 0.0 {
        text.push_str(&format!(
            ", {} · sin q, {} · cos q",
            part(current.sine, error.sine),
            part(current.cosine, error.cosine)
        ));
    }
    let model = &gravity.model;
    if model.constant == 0.0 && model.sine == 0.0 && model.cosine == 0.0 {
        text.push_str("; not significant, set to zero");
    }
    text
}

/// Returns the name of the source of the gravity.
pub fn source(source: GravitySource) -> &'static str {
    match source {
        GravitySource::Motion => "constant velocities in both directions",
        GravitySource::Rest => "standstills",
    }
}

fn inertia(identification: &Identification) -> Option<String> {
    let inertia = identification.inertia.as_ref()?;
    let mut text = format!(
        "inertia: {} ± {} by Prévost eq. 5 from {} accelerations (standard deviation of single samples {})",
        digits(inertia.value, 5),
        digits(inertia.error, 2),
        inertia.accelerations,
        digits(inertia.spread, 2)
    );
    if let Some(replayed) = identification.replayed_inertia {
        text.push_str(&format!("; {} by eq. 5 on the simulated axis", digits(replayed, 5)));
    }
    let refined = identification.refinement.as_ref().map(|refinement| refinement.parameters.iter());
    if let Some(refined) = refined.and_then(|mut all| all.find(|r| r.parameter == RefinedParameter::Inertia))
    {
        text.push_str(&format!("; refined {} ± {}", digits(refined.value, 5), digits(refined.error, 2)));
    }
    Some(text)
}

fn regression(name: &str, found: Option<&FeedforwardRegression>) -> Option<String> {
    let found = found?;
    let [low, high] = [found.delay.0, found.delay.1].map(|delay| digits(delay / MILLISECOND, 3));
    Some(format!(
        "{name}: {} ± {}, R² {:.6}, {low} … {high} ms delay after the setpoints",
        digits(found.value, 5),
        digits(found.error, 2),
        found.r_squared
    ))
}

/// Returns the largest value of a figure over the parts of a recording.
pub fn worst(agreement: &Agreement, of: impl Fn(&ExperimentComparison) -> Option<f64>) -> Option<f64> {
    agreement.comparisons.iter().filter_map(of).reduce(f64::max)
}

fn agreement(found: &IdentificationResult) -> Table {
    let (position, _, length) = table::scale(found.axis.kind());
    let (velocity, speed) = velocity_scale(found.axis.kind());
    let mut table = table_of(&[
        ("simulated − recorded", ""),
        ("at constant velocity, max", position),
        ("elsewhere, max", position),
        ("velocity, max", velocity),
        ("current, RMS", "A"),
        ("R² of the current", ""),
        ("R² by inverse dynamics", ""),
    ]);
    let identified = found.recordings.iter().zip(&found.identification.agreements);
    let identified = identified.map(|(recorded, agreement)| (recorded.signals.name.clone(), agreement));
    let validated = found.validations.iter().map(|v| (validation_name(&v.recorded), &v.agreement));
    for (name, agreement) in identified.chain(validated) {
        let max = |deviation: &Option<ResidualStatistics>| deviation.map(|d| d.max);
        let in_unit = |value: Option<f64>, unit: f64| or_none(value, |value| format!("{:.1}", value / unit));
        let inverse = agreement.inverse.as_ref();
        let simulated = agreement.comparisons.iter().filter_map(|c| c.current_r_squared).reduce(f64::min);
        let current = worst(agreement, |c| c.current.map(|d| d.rms)).or(inverse.map(|i| i.current.rms));
        table.rows.push(vec![
            name,
            in_unit(worst(agreement, |c| max(&c.constant_velocity)), length),
            in_unit(worst(agreement, |c| max(&c.elsewhere)), length),
            in_unit(worst(agreement, |c| max(&c.velocity)), speed),
            or_none(current, |current| format!("{current:.3}")),
            or_none(simulated, |r2| format!("{r2:.4}")),
            or_none(inverse.map(|i| i.r_squared), |r2| format!("{r2:.4}")),
        ]);
    }
    table
}
