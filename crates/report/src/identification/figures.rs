//! Figures of an identification as tables and sentences, the same for the terminal and the page.

use virtual_axes_core::units::{MILLISECOND, Rounded};
use virtual_axes_identify::identify::summary::{
    DelaySummary, FrictionSummary, GravitySummary, IdentificationSummary, InertiaSummary, IntervalSummary,
    LawSummary, PartSummary, PreslidingSummary, RecordingSummary, RefinementSummary, ResidualSummary,
    TransmissionSummary,
};
use virtual_axes_identify::identify::{
    DelayParameter, FeedforwardRegression, FrictionLaw, GravityCurrent, GravitySource, IdentifiedValue,
    ResidualStatistics,
};
use virtual_axes_identify::recording::Severity;

use super::page::{counted, exponent_unit, file_name};
use crate::text::{NONE, digits};
use crate::{DisplayUnit, Table};

/// Returns the value as text, a dash without a finite value.
fn or_none(value: Option<f64>, text: impl Fn(f64) -> String) -> String {
    value.filter(|value| value.is_finite()).map_or_else(|| NONE.to_owned(), text)
}

/// Returns the unit of position residuals.
fn error_unit(found: &IdentificationSummary) -> &'static str {
    DisplayUnit::error(found.kind).symbol
}

/// Returns the result in one line: number of identified parameters, position residual, warnings.
pub fn verdict(found: &IdentificationSummary) -> String {
    let count = |severity| found.findings.iter().filter(|finding| finding.severity == severity).count();
    let residual = found.refinement.as_ref().map_or_else(
        || "not refined".to_owned(),
        |fit| format!("position residual {} {} RMS", digits(fit.position_rms.after, 3), error_unit(found)),
    );
    let invalid = if count(Severity::Invalid) > 0 { "; invalid" } else { "" };
    format!(
        "{}: {} identified, {residual}, {} missing, {}{invalid}",
        found.axis,
        counted(found.values.iter().filter(|value| value.is_significant).count(), "parameter"),
        count(Severity::Missing),
        counted(count(Severity::Warning), "warning")
    )
}

/// Returns the name of a validation recording.
fn validation_name(found: &IdentificationSummary, name: &str) -> String {
    format!("{} (validation)", file_name(found, name))
}

/// Lists all recordings by their use.
pub fn all_recordings(found: &IdentificationSummary) -> Table {
    let validations =
        found.validation.iter().map(|v| (validation_name(found, &v.recording.name), &v.recording));
    let own = found.recordings.iter().chain(&found.transmission_recordings);
    recordings(
        own.map(|recording| (file_name(found, &recording.name).to_owned(), recording)).chain(validations),
    )
}

/// Lists recordings under the given names.
pub fn recordings<'a>(recordings: impl Iterator<Item = (String, &'a RecordingSummary)>) -> Table {
    let mut table = Table::new(
        "Recordings",
        &[
            ("recording", ""),
            ("duration", "s"),
            ("samples", ""),
            ("period", "ms"),
            ("cut-off", "Hz"),
            ("current lag", "ms"),
            ("feedforward", ""),
        ],
    );
    table.rows.extend(recordings.map(|(name, recording)| {
        vec![
            name,
            format!("{:.3}", recording.duration_s),
            recording.samples.to_string(),
            digits(recording.period_ms, 4),
            format!("{:.1}", recording.cutoff_hz),
            format!("{:.2}", recording.current_lag_ms),
            recording.feedforward_names(),
        ]
    }));
    table
}

/// Lists the identified values.
pub fn values(values: &[IdentifiedValue]) -> Table {
    let columns =
        [("parameter", ""), ("value", ""), ("unit", ""), ("±", ""), ("initial", ""), ("source", "")];
    let mut table = Table::new("Identified values", &columns);
    table.rows.extend(values.iter().map(|value| {
        let spread = match (value.interval, value.error) {
            (Some([low, high]), _) => format!("{} … {}", Rounded(low), Rounded(high)),
            (None, error) => or_none(error, |error| digits(error, 2)),
        };
        vec![
            value.key.clone(),
            if value.interval.is_some() { Rounded(value.value).to_string() } else { value.value.to_string() },
            value.unit.to_owned(),
            spread,
            or_none(Some(value.before), |before| Rounded(before).to_string()),
            value.source.clone(),
        ]
    }));
    table
}

/// Returns the results of the steps but friction, a sentence each.
pub fn steps(found: &IdentificationSummary) -> Vec<String> {
    let unit = error_unit(found);
    [
        found.gravity.as_ref().map(gravity),
        found.inertia.as_ref().map(inertia),
        found.presliding.as_ref().map(presliding),
        found.transmission.as_ref().map(|fit| transmission(fit, unit)),
        found.feedforward.velocity.as_ref().map(|fit| regression("VFFW", fit)),
        found.feedforward.torque.as_ref().map(|fit| regression("TFFW", fit)),
    ]
    .into_iter()
    .flatten()
    .chain(found.delays.iter().map(delay))
    .chain(found.refinement.as_ref().map(|fit| refinement(fit, unit)))
    .collect()
}

fn delay(fit: &DelaySummary) -> String {
    let [low, high] = fit.interval_ms.map(Rounded);
    let left = if fit.is_unchanged { ", unchanged" } else { "" };
    let value = Rounded(fit.value_ms);
    // Below one cycle the interval contains zero.
    let is_estimate = fit.is_joint && fit.name != DelayParameter::Alpha;
    let range = match (is_estimate, high.0 == 0.0) {
        (true, _) => format!("two standard errors reach from {low} to {high} ms"),
        (false, true) => "no longer delay gives the same motion".to_owned(),
        (false, false) => format!("delays above {low} and up to {high} ms give the same motion"),
    };
    format!("{}: {value} ms{left}; {range}", fit.name.name())
}

/// Returns the residuals before and after the refinement; `unit` is that of position residuals.
pub fn refinement(refinement: &RefinementSummary, unit: &str) -> String {
    let position = refinement.position_rms;
    // A joint fit has no result before it, unless it tried the initial gain.
    let before = match position.before == position.after {
        true => String::new(),
        false => format!("{} → ", digits(position.before, 3)),
    };
    let mut text = format!(
        "refined in closed loop: {} parameters; position RMS {before}{} {unit}",
        refinement.parameters.len(),
        digits(position.after, 3)
    );
    if let Some(current) = refinement.current_rms_a {
        text += &format!(", current RMS {} → {} A", digits(current.before, 3), digits(current.after, 3));
    }
    text
}

/// Returns form and agreement of the friction law.
pub fn friction(friction: &FrictionSummary) -> String {
    let name = match friction.law.law {
        FrictionLaw::DoubleExponential => "a e^(bV) + c e^(dV) (Prévost eq. 3)",
        FrictionLaw::Linear => "Coulomb level and viscous slope",
    };
    let from = match friction.speeds.len() {
        0 => "regression of the current".to_owned(),
        count => format!("{count} speeds"),
    };
    let asymmetry = match friction.asymmetry.is_finite() {
        true => format!("; directions differ by up to {:.1} %", 100.0 * friction.asymmetry),
        false => String::new(),
    };
    format!("friction: {name}, {from}, R² {:.5}{asymmetry}", friction.law.r_squared)
}

/// Lists the friction laws of both directions and of each.
pub fn friction_laws(friction: &FrictionSummary, speed_unit: &str) -> Table {
    let line = [("law", ""), ("level", "A"), ("slope", "A per unit of V"), ("R²", "")];
    let exponent_unit = exponent_unit(speed_unit);
    let exponential = [
        ("law", ""),
        ("a", "A"),
        ("b", exponent_unit),
        ("c", "A"),
        ("d", exponent_unit),
        ("i0", "A"),
        ("R²", ""),
    ];
    let is_line = friction.law.law == FrictionLaw::Linear;
    let mut laws = Table::new("Friction laws", if is_line { &line } else { &exponential });
    let row = |name: &str, law: &LawSummary| {
        let figures = match law.line {
            Some(line) => vec![line.level_a, line.slope_a],
            None => {
                let c = &law.coefficients;
                vec![c.a, c.b, c.c, c.d, law.i0]
            }
        };
        let figures = figures.into_iter().map(|figure| digits(figure, 5));
        [vec![name.to_owned()], figures.collect(), vec![format!("{:.5}", law.r_squared)]].concat()
    };
    laws.rows.push(row("both directions", &friction.law));
    laws.rows.extend(friction.directions.plus.as_ref().map(|law| row("positive direction", law)));
    laws.rows.extend(friction.directions.minus.as_ref().map(|law| row("negative direction", law)));
    laws
}

/// Lists the friction currents at constant velocities, both directions of a speed in one row.
pub fn friction_currents(friction: &FrictionSummary, speed_unit: &str) -> Table {
    let mut table = Table::new(
        "Constant velocities",
        &[
            ("speed", speed_unit),
            ("friction, positive direction", "A"),
            ("±", "A"),
            ("negative direction", "A"),
            ("±", "A"),
            ("law", "A"),
        ],
    );
    table.rows.extend(friction.speeds.iter().map(|at| {
        let levels = at.directions.iter().flat_map(|level| {
            [level.map(|l| l.friction), level.map(|l| l.error)]
                .map(|value| or_none(value, |i| format!("{i:.4}")))
        });
        let levels: Vec<String> = levels.collect();
        [vec![format!("{:.3}", at.speed)], levels, vec![format!("{:.4}", at.law)]].concat()
    }));
    table
}

/// Returns the gravity current with its standard error, and the range that standstills permit.
pub fn gravity(gravity: &GravitySummary) -> String {
    let source = match gravity.source {
        GravitySource::Motion => "constant velocities in both directions",
        GravitySource::Rest => "standstills",
        GravitySource::Regression => "regression of the current",
    };
    let part = |value: f64, error: f64| format!("{} ± {} A", digits(value, 4), digits(error, 2));
    let (current, error) = (&gravity.current, &gravity.error);
    let mut text = format!("gravity, from {source}: {}", part(current.constant, error.constant));
    if current.sine != 0.0 || current.cosine != 0.0 {
        let [sine, cosine] = [part(current.sine, error.sine), part(current.cosine, error.cosine)];
        text += &format!(", {sine} · sin q, {cosine} · cos q");
    }
    if gravity.model == GravityCurrent::default() {
        text += "; not significant, set to zero";
    }
    if let Some(rest) = &gravity.at_rest {
        let [center, half] = [rest.current.constant, rest.error.constant];
        let [low, high] = [center - half, center + half].map(|bound| digits(bound, 3));
        text += &format!("; standstills permit {low} … {high} A");
    }
    text
}

/// Returns the presliding stiffness with its interval.
pub fn presliding(found: &PreslidingSummary) -> String {
    let [low, high] = found.interval.map(|bound| digits(bound, 3));
    format!(
        "presliding: stiffness {} {} (95 % interval {low} … {high}) from {} reversals",
        digits(found.stiffness, 4),
        found.stiffness_unit,
        found.reversals
    )
}

/// Returns the values of the transmission with their intervals; `length` is the unit of backlash.
pub fn transmission(found: &TransmissionSummary, length: &str) -> String {
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
            text += format!("; {name} {} {unit}", interval(value)).trim_end();
        }
    }
    if let Some(bound) = found.excluded_backlash {
        text += &format!("; no backlash above {} {length}", digits(bound, 2));
    }
    text + &format!("; R² of the acceleration {:.4}", found.r_squared)
}

/// Returns the inertia of each step with its standard error.
pub fn inertia(inertia: &InertiaSummary) -> String {
    let [value, error] = [digits(inertia.eq5, 5), digits(inertia.error, 2)];
    let count = inertia.accelerations;
    if inertia.spread.is_nan() {
        return format!(
            "inertia: {value} ± {error} by regression of the current over {}",
            counted(count, "move")
        );
    }
    let mut text = format!(
        "inertia: {value} ± {error} by Prévost eq. 5 from {} (standard deviation of single samples {})",
        counted(count, "acceleration"),
        digits(inertia.spread, 2)
    );
    if let Some(simulated) = inertia.simulated_eq5 {
        text += &format!("; {} by eq. 5 on the simulated axis", digits(simulated, 5));
    }
    if let (Some(refined), Some(error)) = (inertia.refined, inertia.refined_error) {
        text += &format!("; refined {} ± {}", digits(refined, 5), digits(error, 2));
    }
    text
}

/// Returns a feedforward weight with its standard error.
pub fn regression(name: &str, found: &FeedforwardRegression) -> String {
    let [low, high] = [found.delay.0, found.delay.1].map(|delay| digits(delay / MILLISECOND, 3));
    format!(
        "{name}: {} ± {}, R² {:.6}, {low} … {high} ms delay after the setpoints",
        digits(found.value, 5),
        digits(found.error, 2),
        found.r_squared
    )
}

/// Returns the residuals of the recordings and of the validation recordings, by name.
pub fn residuals(found: &IdentificationSummary) -> Vec<(String, &ResidualSummary)> {
    let identified = found.agreement.iter().map(|a| (file_name(found, &a.name).to_owned(), &a.residuals));
    let validated =
        found.validation.iter().map(|v| (validation_name(found, &v.recording.name), &v.residuals));
    identified.chain(validated).collect()
}

/// Returns the position residuals of the model beside those of simple predictions.
pub fn baseline(found: &IdentificationSummary, name: &str, residuals: &ResidualSummary) -> Option<String> {
    let (baseline, unit) = (residuals.baseline.as_ref()?, error_unit(found));
    let [command, delayed, model] =
        [baseline.command, baseline.delayed, baseline.model].map(|rms| digits(rms, 4));
    Some(format!(
        "{name}: position RMS from PSEC {command} {unit}, from PSEC delayed by {:.2} ms {delayed} {unit}, from the model \
         {model} {unit}",
        baseline.lag_ms,
    ))
}

/// Lists the largest deviations of recordings from their simulation.
pub fn agreement(found: &IdentificationSummary, residuals: &[(String, &ResidualSummary)]) -> Table {
    let position = error_unit(found);
    let mut table = Table::new(
        "Simulated minus measured",
        &[
            ("simulated − recorded", ""),
            ("at constant velocity, max", position),
            ("elsewhere, max", position),
            ("velocity, max", found.velocity_unit),
            ("current, RMS", "A"),
            ("R² of the current", ""),
            ("R² by inverse dynamics", ""),
        ],
    );
    table.rows.extend(residuals.iter().map(|(name, residuals)| {
        let worst = |figure: &dyn Fn(&PartSummary) -> Option<f64>| {
            residuals.parts.iter().filter_map(figure).reduce(f64::max)
        };
        let largest = |deviation: fn(&PartSummary) -> Option<ResidualStatistics>| {
            or_none(worst(&|part| deviation(part).map(|d| d.max)), |value| format!("{value:.1}"))
        };
        let inverse = residuals.inverse_dynamics.as_ref();
        let simulated = residuals.parts.iter().filter_map(|part| part.current_r_squared).reduce(f64::min);
        let current = worst(&|part| part.current_a.map(|d| d.rms)).or(inverse.map(|i| i.current_a.rms));
        vec![
            name.clone(),
            largest(|part| part.constant_velocity),
            largest(|part| part.elsewhere),
            largest(|part| part.velocity),
            or_none(current, |current| format!("{current:.3}")),
            or_none(simulated, |r2| format!("{r2:.4}")),
            or_none(inverse.map(|i| i.current_r_squared), |r2| format!("{r2:.4}")),
        ]
    }));
    table
}
