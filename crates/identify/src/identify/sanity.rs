//! Results that must not be used: implausibly far from the machine file, or worse than a constant lag.

use super::delays::DelayParameter;
use super::identification::Identification;
use super::options::IdentificationInput;
use super::validate::Agreement;
use crate::recording::{Finding, Severity, Signals, StatedValues};
use virtual_axes_core::config::{AxisConfig, AxisKind, AxisUnits};
use virtual_axes_core::units::{MILLIMETER, MILLISECOND_NS, POSITION_GAIN, REVOLUTION, RPM, Rounded};

/// Largest factor between an identified value and that of the machine file.
const LARGEST_FACTOR: f64 = 3.0;
/// Smallest R² of the current.
const LEAST_DETERMINATION: f64 = 0.9;
/// Code of the finding of a smaller one.
const POOR_CURRENT: &str = "poor-current";
/// Recorded speed relative to the limit of the motor from which the transmission cannot be right.
const FASTEST: f64 = 1.1;
/// Position residual, µm and mdeg, that is good enough whatever a constant lag leaves.
const GOOD: f64 = 5.0;

/// Adds findings of severity invalid. Results are compared with those values of the machine file that the user has stated.
pub(super) fn report_invalid(
    inputs: &[IdentificationInput<'_>],
    stated: StatedValues,
    found: &mut Identification,
) {
    let (before, after) = (&found.initial, &found.axis);
    let milliseconds = |delay: i64| delay as f64 / MILLISECOND_NS as f64;
    let mut invalid = Vec::new();
    let changes = [
        (
            stated.inertia,
            "motor inertia",
            before.motor.inertia,
            after.motor.inertia,
            "check torque constant, lead and units of the current",
        ),
        (
            stated.gain,
            "position_loop.gain",
            before.position_loop.gain / POSITION_GAIN,
            after.position_loop.gain / POSITION_GAIN,
            "check the servo gain and its unit, (m/min)/mm",
        ),
    ];
    for (is_stated, name, given, value, remedy) in changes {
        if is_stated && is_far(given, value) {
            invalid.push(far(name, given, value, "", remedy));
        }
    }
    for fit in found.delays.iter().filter(|_| stated.delays) {
        let (given, value) = (milliseconds(fit.delay.of(&before.delays)), milliseconds(fit.value));
        let (name, remedy) =
            (fit.delay.name(), "check that the recorded setpoint is that at the position controller");
        let [low, high] = [fit.interval.0, fit.interval.1].map(milliseconds);
        if !is_far(given, value) || given == 0.0 || (low..=high).contains(&given) {
            continue;
        }
        // β and γ can be short, and a machine file often has values of another machine.
        match fit.delay {
            DelayParameter::Alpha => invalid.push(far(name, given, value, " ms", remedy)),
            _ => invalid
                .push(Finding { severity: Severity::Warning, ..far(name, given, value, " ms", remedy) }),
        }
    }
    for (input, agreement) in inputs.iter().zip(&found.agreements) {
        invalid.extend(invalid_agreement(&input.signals.name, agreement, after));
        invalid.extend(too_fast(input.signals, after).filter(|_| stated.motor_speed));
    }
    found.findings.extend(invalid);
}

/// Reports torque constant and screw lead of the initial machine that the user has not stated and no recording shows: the
/// results depend on them.
pub(super) fn report_unstated(stated: StatedValues, found: &mut Identification) {
    let axis = &found.axis;
    let ratio = axis.transmission_ratio.abs();
    let is_linear = axis.kind() == AxisKind::Linear;
    // Linear motors have no transmission.
    let is_linear_motor = is_linear && ratio == 1.0;
    let mut assumed = Vec::new();
    if !stated.torque_constant && found.torque_constant.is_none() && found.friction.is_some() {
        let (name, unit) = if is_linear_motor { ("force", "N/A") } else { ("torque", "N·m/A") };
        assumed.push(format!("{name} constant of {} {unit}", Rounded(axis.motor.torque_constant)));
    }
    let has_results = found.friction.is_some() || found.feedforward.velocity.is_some();
    if !stated.transmission && has_results && !is_linear_motor {
        assumed.push(match axis.kind() {
            AxisKind::Linear => format!("screw lead of {} mm", Rounded(ratio * REVOLUTION / MILLIMETER)),
            AxisKind::Rotary => format!("gear ratio of {}", Rounded(1.0 / ratio)),
        });
    }
    if assumed.is_empty() {
        return;
    }
    let weight = if is_linear { "weight, " } else { "" };
    found.findings.push(Finding::warning(
        "unstated-scale",
        format!(
            "the {} of the initial machine {} assumed: inertia, {weight}gain of the velocity loop and weights of a feedforward \
             recorded at the motor depend on {}",
            assumed.join(" and the "),
            if assumed.len() > 1 { "are" } else { "is" },
            if assumed.len() > 1 { "them" } else { "it" }
        ),
        "give those of the machine by --set",
    ));
}

/// Returns findings on an agreement that is no result: a position worse than a constant lag, or an unexplained current.
pub fn invalid_agreement(name: &str, agreement: &Agreement, axis: &AxisConfig) -> Vec<Finding> {
    let AxisUnits { error: unit, error_name: symbol, .. } = axis.units();
    let mut invalid = Vec::new();
    if let Some(baseline) = agreement.baseline.filter(|b| b.model > b.delayed && b.model > GOOD * unit) {
        invalid.push(Finding::invalid(
            "worse-than-lag",
            format!(
                "{name}: the simulated position deviates by {:.1} {symbol} RMS, PSEC delayed by {:.2} ms by {:.1} {symbol} only",
                baseline.model / unit,
                baseline.lag * 1e3,
                baseline.delayed / unit
            ),
            "check lead, gains and periods of the initial machine, and the active feedforward",
        ));
    }
    let inverse = agreement.inverse.as_ref().map(|inverse| inverse.r_squared);
    let best = inverse.into_iter().chain(agreement.current_r_squared()).reduce(f64::max);
    if let Some(r2) = best.filter(|r2| *r2 < LEAST_DETERMINATION) {
        let mut finding = Finding::invalid(
            POOR_CURRENT,
            format!("{name}: the model explains {} of the current", explained(r2)),
            "check that the current is that of this axis, with its sign and without a filter; record without cutting forces",
        );
        if axis.presliding.is_some() || axis.transmission.is_some() {
            // The inverse dynamics are those of a rigid axis without presliding.
            finding.severity = Severity::Warning;
        }
        invalid.push(finding);
    }
    invalid
}

/// Returns a finding if the recorded speed is beyond that of the motor: the lead of the machine file is too small.
fn too_fast(signals: &Signals, axis: &AxisConfig) -> Option<Finding> {
    let speeds = signals.spans.iter().flat_map(|span| span.velocity.iter().map(|v| v.abs()));
    let fastest = speeds.fold(0.0, f64::max) / axis.transmission_ratio.abs();
    let limit = axis.motor.max_speed;
    (fastest > FASTEST * limit).then(|| {
        Finding::invalid(
            "too-fast",
            format!(
                "{}: with the transmission of the initial machine the motor turns at {:.0} rpm, faster than its limit of {:.0} rpm",
                signals.name,
                fastest / RPM,
                limit / RPM
            ),
            "check screw lead or gear ratio, and motor.max_speed_rpm",
        )
    })
}

fn is_far(given: f64, value: f64) -> bool {
    let factor = value / given;
    !(1.0 / LARGEST_FACTOR..=LARGEST_FACTOR).contains(&factor)
}

fn far(name: &str, given: f64, value: f64, unit: &str, remedy: &str) -> Finding {
    Finding::invalid(
        "implausible",
        format!(
            "{name}: {}{unit} of the initial machine became {}{unit}, by more than a factor of {LARGEST_FACTOR}",
            Rounded(given),
            Rounded(value)
        ),
        remedy,
    )
}

/// Returns the explained part of a variance in words; a model worse than the mean explains nothing.
pub(super) fn explained(r_squared: f64) -> String {
    if r_squared > 0.0 {
        format!("{:.1} %", 100.0 * r_squared)
    } else {
        "nothing (R² is negative)".to_owned()
    }
}
