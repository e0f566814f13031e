//! Text output of `virtual_axes identify`.

use virtual_axes_core::text::escaped;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_core::units::Rounded;
use virtual_axes_identify::identify::summary::{
    DelaySummary, FrictionSummary, GravitySummary, IdentificationSummary, InertiaSummary, IntervalSummary,
    LawSummary, PartSummary, PreslidingSummary, RefinementSummary, ResidualSummary, TransmissionSummary,
};
use virtual_axes_identify::identify::{
    FeedforwardRegression, FrictionLaw, GravityCurrent, GravitySource, IdentifiedValue, ResidualStatistics,
};
use virtual_axes_identify::recording::Severity;
use virtual_axes_report::runs::table;
use virtual_axes_report::{Table, TableColumn};

use crate::text_table;

/// Cell without a value.
const NONE: &str = "–";

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
pub fn text(found: &IdentificationSummary) -> String {
    let mut parts = vec![
        verdict(found),
        format!("{}: {}\n", escaped(&found.machine), found.axis),
        text_table::text(&recordings(found)),
        text_table::aligned(&values(&found.values), &[0, 2, 5]),
    ];
    parts.extend(steps(found));
    let agreement = agreement(found);
    if !agreement.rows.is_empty() {
        parts.push(text_table::text(&agreement));
    }
    parts.push(baselines(found));
    let findings: Vec<String> = found.findings.iter().map(|f| text_table::wrapped_line(&f.line())).collect();
    parts.push(findings.concat());
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
}

/// Returns the result in one line: number of identified parameters, position residual, warnings.
pub fn verdict(found: &IdentificationSummary) -> String {
    let count = |severity| found.findings.iter().filter(|finding| finding.severity == severity).count();
    let unit = table::scale(found.kind).0;
    let residual = found.refinement.as_ref().map_or_else(
        || "not refined".to_owned(),
        |fit| format!("position residual {} {unit} RMS", digits(fit.position_rms.after, 3)),
    );
    let invalid = if count(Severity::Invalid) > 0 { "; invalid" } else { "" };
    format!(
        "{}: {} parameters identified, {residual}, {} missing, {} warnings{invalid}\n",
        found.axis,
        found.values.len(),
        count(Severity::Missing),
        count(Severity::Warning)
    )
}

/// Returns the identified values as comma-separated values.
pub fn csv(found: &IdentificationSummary) -> String {
    text_table::csv(&values(&found.values))
}

/// Returns the name of a validation recording.
fn validation_name(name: &str) -> String {
    format!("{name} (validation)")
}

fn recordings(found: &IdentificationSummary) -> Table {
    let mut table = table_of(&[
        ("recording", ""),
        ("duration", "s"),
        ("samples", ""),
        ("period", "ms"),
        ("cut-off", "Hz"),
        ("current lag", "ms"),
        ("feedforward", ""),
    ]);
    let validations = found.validation.iter().map(|v| (validation_name(&v.recording.name), &v.recording));
    let both = found.transmission_recordings.iter();
    let all = found.recordings.iter().chain(both).map(|recording| (recording.name.clone(), recording));
    for (name, recording) in all.chain(validations) {
        table.rows.push(vec![
            name,
            format!("{:.3}", recording.duration_s),
            recording.samples.to_string(),
            digits(recording.period_ms, 4),
            format!("{:.1}", recording.cutoff_hz),
            format!("{:.2}", recording.current_lag_ms),
            recording.feedforward_names(),
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
            (Some([low, high]), _) => format!("{} … {}", Rounded(low), Rounded(high)),
            (None, error) => or_none(error, |error| digits(error, 2)),
        };
        table.rows.push(vec![
            value.key.clone(),
            if value.interval.is_some() { Rounded(value.value).to_string() } else { value.value.to_string() },
            value.unit.to_owned(),
            spread,
            or_none(Some(value.before), |before| Rounded(before).to_string()),
            value.source.clone(),
        ]);
    }
    table
}

/// Returns the results of the steps.
fn steps(found: &IdentificationSummary) -> Vec<String> {
    let friction = found.friction.as_ref().map(|friction| self::friction(friction, found.speed_unit));
    let lines = [
        found.gravity.as_ref().map(gravity),
        found.inertia.as_ref().map(inertia),
        found.presliding.as_ref().map(presliding),
        found.transmission.as_ref().map(|fit| transmission(fit, table::scale(found.kind).0)),
        found.feedforward.velocity.as_ref().map(|fit| regression("VFFW", fit)),
        found.feedforward.torque.as_ref().map(|fit| regression("TFFW", fit)),
    ];
    let lines = lines.into_iter().flatten().chain(found.delays.iter().map(delay));
    let refined = found.refinement.as_ref().map(|fit| refinement(fit, table::scale(found.kind).0));
    let lines: Vec<String> = lines.chain(refined).map(|line| text_table::wrapped_line(&line)).collect();
    friction.into_iter().chain([lines.concat()]).collect()
}

fn delay(fit: &DelaySummary) -> String {
    let [low, high] = fit.interval_ms.map(Rounded);
    let left = if fit.is_unchanged { ", unchanged" } else { "" };
    let value = Rounded(fit.value_ms);
    // Below one cycle the interval contains zero.
    if high.0 == 0.0 {
        return format!("{}: {value} ms{left}; no longer delay gives the same motion", fit.name.name());
    }
    format!(
        "{}: {value} ms{left}; delays above {low} and up to {high} ms give the same motion",
        fit.name.name()
    )
}

fn refinement(refinement: &RefinementSummary, unit: &str) -> String {
    let position = refinement.position_rms;
    let mut text = format!(
        "refined in closed loop: {} parameters; position RMS {} → {} {unit}",
        refinement.parameters.len(),
        digits(position.before, 3),
        digits(position.after, 3)
    );
    if let Some(current) = refinement.current_rms_a {
        text += &format!(", current RMS {} → {} A", digits(current.before, 3), digits(current.after, 3));
    }
    text
}

fn friction(friction: &FrictionSummary, speed_unit: &str) -> String {
    let law = &friction.law;
    let name = match law.law {
        FrictionLaw::DoubleExponential => "a e^(bV) + c e^(dV) (Prévost eq. 3)",
        FrictionLaw::Linear => "Coulomb level and viscous slope",
    };
    let from = match friction.speeds.len() {
        0 => "regression of the current".to_owned(),
        count => format!("{count} speeds"),
    };
    let mut text = format!("friction: {name}, {from}, R² {:.5}", law.r_squared);
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
    let row = |name: &str, law: &LawSummary| {
        let figures: Vec<f64> = match law.line {
            Some(line) => vec![line.level_a, line.slope_a],
            None => {
                let c = &law.coefficients;
                vec![c.a, c.b, c.c, c.d, law.i0]
            }
        };
        let figures = figures.into_iter().map(|figure| digits(figure, 5));
        [vec![name.to_owned()], figures.collect(), vec![format!("{:.5}", law.r_squared)]].concat()
    };
    laws.rows.push(row("both directions", law));
    laws.rows.extend(friction.directions.plus.as_ref().map(|law| row("positive direction", law)));
    laws.rows.extend(friction.directions.minus.as_ref().map(|law| row("negative direction", law)));
    text.push_str(&text_table::text(&laws));
    text.push('\n');
    let mut table = table_of(&[
        ("speed", speed_unit),
        ("friction, positive direction", "A"),
        ("±", "A"),
        ("negative direction", "A"),
        ("±", "A"),
        ("law", "A"),
    ]);
    for at in &friction.speeds {
        let mut row = vec![format!("{:.3}", at.speed)];
        for level in &at.directions {
            row.push(or_none(level.map(|l| l.friction), |friction| format!("{friction:.4}")));
            row.push(or_none(level.map(|l| l.error), |error| format!("{error:.4}")));
        }
        row.push(format!("{:.4}", at.law));
        table.rows.push(row);
    }
    if table.rows.is_empty() { text } else { text + &text_table::text(&table) }
}

fn gravity(gravity: &GravitySummary) -> String {
    let source = match gravity.source {
        GravitySource::Motion => "constant velocities in both directions",
        GravitySource::Rest => "standstills",
        GravitySource::Regression => "regression of the current",
    };
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
    if gravity.model == GravityCurrent::default() {
        text.push_str("; not significant, set to zero");
    }
    if let Some(rest) = &gravity.at_rest {
        let [center, half] = [rest.current.constant, rest.error.constant];
        text.push_str(&format!(
            "; standstills permit {} … {} A",
            digits(center - half, 3),
            digits(center + half, 3)
        ));
    }
    text
}

fn presliding(found: &PreslidingSummary) -> String {
    let [low, high] = found.interval.map(|bound| digits(bound, 3));
    format!(
        "presliding: stiffness {} {} (95 % interval {low} … {high}) from {} reversals",
        digits(found.stiffness, 4),
        found.stiffness_unit,
        found.reversals
    )
}

fn transmission(found: &TransmissionSummary, length: &str) -> String {
    let interval = |found: &IntervalSummary| {
        let [low, high] = found.interval.map(|bound| digits(bound, 3));
        format!("{} ({low} … {high})", digits(found.value, 4))
    };
    let mut text = format!("transmission: antiresonance {} Hz", interval(&found.antiresonance_hz));
    let named = [
        ("stiffness", &found.stiffness, found.stiffness_unit),
        ("damping", &found.damping, found.damping_unit()),
        ("load", &found.load_inertia, found.inertia_unit),
        ("motor and load", &found.total_inertia, found.inertia_unit),
        ("share of the friction at the load", &found.load_friction, ""),
        ("backlash", &found.backlash, length),
    ];
    for (name, value, unit) in named {
        if let Some(value) = value {
            text.push_str(format!("; {name} {} {unit}", interval(value)).trim_end());
        }
    }
    if let Some(bound) = found.excluded_backlash {
        text.push_str(&format!("; no backlash above {} {length}", digits(bound, 2)));
    }
    text + &format!("; R² of the acceleration {:.4}", found.r_squared)
}

fn inertia(inertia: &InertiaSummary) -> String {
    if inertia.spread.is_nan() {
        let [value, error] = [digits(inertia.eq5, 5), digits(inertia.error, 2)];
        return format!(
            "inertia: {value} ± {error} by regression of the current over {} moves",
            inertia.accelerations
        );
    }
    let mut text = format!(
        "inertia: {} ± {} by Prévost eq. 5 from {} accelerations (standard deviation of single samples {})",
        digits(inertia.eq5, 5),
        digits(inertia.error, 2),
        inertia.accelerations,
        digits(inertia.spread, 2)
    );
    if let Some(simulated) = inertia.simulated_eq5 {
        text.push_str(&format!("; {} by eq. 5 on the simulated axis", digits(simulated, 5)));
    }
    if let (Some(refined), Some(error)) = (inertia.refined, inertia.refined_error) {
        text.push_str(&format!("; refined {} ± {}", digits(refined, 5), digits(error, 2)));
    }
    text
}

fn regression(name: &str, found: &FeedforwardRegression) -> String {
    let [low, high] = [found.delay.0, found.delay.1].map(|delay| digits(delay / MILLISECOND, 3));
    format!(
        "{name}: {} ± {}, R² {:.6}, {low} … {high} ms delay after the setpoints",
        digits(found.value, 5),
        digits(found.error, 2),
        found.r_squared
    )
}

/// Returns the largest value of a figure over the parts of a recording.
fn worst(residuals: &ResidualSummary, figure: impl Fn(&PartSummary) -> Option<f64>) -> Option<f64> {
    residuals.parts.iter().filter_map(figure).reduce(f64::max)
}

/// Returns the position residuals of the model beside those of simple predictions, a line per recording.
fn baselines(found: &IdentificationSummary) -> String {
    let unit = table::scale(found.kind).0;
    let identified = found.agreement.iter().map(|a| (a.name.clone(), &a.residuals));
    let validated = found.validation.iter().map(|v| (validation_name(&v.recording.name), &v.residuals));
    let line = |(name, residuals): (String, &ResidualSummary)| {
        let baseline = residuals.baseline.as_ref()?;
        Some(text_table::wrapped_line(&format!(
            "{name}: position RMS from PSEC {} {unit}, from PSEC delayed by {:.2} ms {} {unit}, from the model {} {unit}",
            digits(baseline.command, 4),
            baseline.lag_ms,
            digits(baseline.delayed, 4),
            digits(baseline.model, 4)
        )))
    };
    identified.chain(validated).filter_map(line).collect()
}

fn agreement(found: &IdentificationSummary) -> Table {
    let position = table::scale(found.kind).0;
    let mut table = table_of(&[
        ("simulated − recorded", ""),
        ("at constant velocity, max", position),
        ("elsewhere, max", position),
        ("velocity, max", found.velocity_unit),
        ("current, RMS", "A"),
        ("R² of the current", ""),
        ("R² by inverse dynamics", ""),
    ]);
    let identified = found.agreement.iter().map(|a| (a.name.clone(), &a.residuals));
    let validated = found.validation.iter().map(|v| (validation_name(&v.recording.name), &v.residuals));
    for (name, residuals) in identified.chain(validated) {
        let max = |deviation: Option<ResidualStatistics>| deviation.map(|d| d.max);
        let largest = |value: Option<f64>| or_none(value, |value| format!("{value:.1}"));
        let inverse = residuals.inverse_dynamics.as_ref();
        let simulated = residuals.parts.iter().filter_map(|part| part.current_r_squared).reduce(f64::min);
        let current =
            worst(residuals, |part| part.current_a.map(|d| d.rms)).or(inverse.map(|i| i.current_a.rms));
        table.rows.push(vec![
            name,
            largest(worst(residuals, |part| max(part.constant_velocity))),
            largest(worst(residuals, |part| max(part.elsewhere))),
            largest(worst(residuals, |part| max(part.velocity))),
            or_none(current, |current| format!("{current:.3}")),
            or_none(simulated, |r2| format!("{r2:.4}")),
            or_none(inverse.map(|i| i.current_r_squared), |r2| format!("{r2:.4}")),
        ]);
    }
    table
}
