//! New machine of `--new-machine`: a template of the recorded axes, with what their recordings show.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::{
    Assignment, AxisConfig, AxisKind, MachineConfig, Parameters, Periods, Value, ValueSource,
};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, REVOLUTION, RPM};
use virtual_axes_identify::identify::{
    IdentificationInput, IdentificationOptions, RefinementScope, identify,
};
use virtual_axes_identify::recording::{Conditioning, Signals, StatedValues, condition};
use virtual_axes_io::files::read_recording;

use crate::identify::recordings::RecordingArguments;
use crate::identify::selection::SelectedAxis;

/// Source of values that are neither stated nor seen in the recordings.
const TEMPLATE: &str = "template";
/// Source of values that the recordings show.
const RECORDINGS: &str = "recordings";
/// Ratio of velocity-loop gain and inertia, s⁻¹.
const VELOCITY_BANDWIDTH: f64 = 180.0;
/// Limits of motor speed and current relative to the largest recorded values.
const RESERVE: f64 = 1.5;
/// Largest back-EMF relative to the voltage limit.
const EMF_SHARE: f64 = 0.5;
/// Position cycles, s, that a sampling period can be.
const POSITION_CYCLES: std::ops::RangeInclusive<f64> = 0.5e-3..=6e-3;

/// Machine parameters of the template.
const MACHINE: &str = "    periods:
      position_ms: 2.0
      velocity_us: 125.0
      current_us: 62.5
";

/// Parameters of an axis of the template behind the type.
const AXIS: &str = "      motor:
        inertia_kg_m2: 0.01
        torque_constant_nm_a: 1.0
        emf_constant_v_s_rad: 0.3
        resistance_ohm: 0.3
        inductance_mh: 3.0
        max_current_a: 100.0
        max_voltage_v: 245.0
        max_speed_rpm: 6000.0
      friction:
        a: 0.0
        b: 0.01965
        c: 0.0
        d: -0.2801
        i0: 0.0
      position_loop:
        controller: cascade
        gain: 1.5
      velocity_loop:
        gain: 1.8
        integral_time_ms: 6.0
      current_loop:
        gain: 4.5
        integral_time_ms: 2.0
      feedforward:
        velocity: 1.0
        torque_kg_m2: 0.0
      delays:
        alpha_ms: 6.0
        beta_ms: 6.0
        gamma_ms: 6.0
";

/// Returns a machine `name` with the recorded `axes`: limits and travel from the recordings, values of `set`, all other
/// values of a template. Recordings that cannot be read do not count; their error is that of the identification.
///
/// # Errors
/// Returns an error if a name or value is invalid.
pub fn parameters(
    name: &str,
    axes: &[SelectedAxis],
    recordings: &[PathBuf],
    (set, reading): (&[String], &RecordingArguments),
) -> Result<Parameters, Box<dyn Error>> {
    let mut parameters = Parameters::from_yaml(&template(axes), TEMPLATE)?;
    parameters.set("machine", Value::Text(name.to_owned()), &ValueSource::named("--new-machine"))?;
    let source = ValueSource::named("--set");
    for text in set {
        parameters.set_text(text, &source)?;
    }
    let config = parameters.machine_config()?;
    let mut seen = Vec::new();
    for (axis, selected) in config.axes().iter().zip(axes) {
        let options = reading.with_joint(selected.joint.as_deref()).options()?;
        let conditioning =
            Conditioning { stated: stated(&parameters, axis.name()), ..Conditioning::default() };
        let signals: Vec<Signals> = recordings
            .iter()
            .filter_map(|path| {
                let (raw, _) = read_recording(path, axis, &options).ok()?;
                Some(condition(&raw, axis, &config.periods(), &conditioning).ok()?.0)
            })
            .collect();
        seen.push(signals);
    }
    let period = seen.iter().flatten().map(|signals| signals.period).reduce(f64::min);
    let mut values = Vec::new();
    if let Some(period) = period.filter(|period| POSITION_CYCLES.contains(period)) {
        // Velocity and current cycles divide a multiple of 0.5 ms.
        let cycle = (period / 0.5e-3).round() * 0.5;
        values.push(("periods.position_ms".to_owned(), cycle));
    }
    for (axis, signals) in config.axes().iter().zip(&seen).filter(|(_, signals)| !signals.is_empty()) {
        let of_axis = recorded_values(axis, signals).into_iter();
        values.extend(of_axis.map(|(key, value)| (format!("{}.{key}", axis.name()), value)));
    }
    let values = assignments(&parameters, values.into_iter(), &ValueSource::named(RECORDINGS));
    parameters.set_all(values).map_err(|error| {
        format!("{error}; the positions of a recording jump: check their unit, and remove jumps and resets of the position")
    })?;
    // Gains of the velocity loop are in proportion to the inertia, which the current alone shows.
    let config: MachineConfig = parameters.machine_config()?;
    for (axis, signals) in config.axes().iter().zip(&seen) {
        let Some(inertia) = inertia(axis, signals, &config.periods()) else { continue };
        let of_axis =
            [("motor.inertia_kg_m2", inertia), ("velocity_loop.gain", VELOCITY_BANDWIDTH * inertia)];
        let of_axis = of_axis.map(|(key, value)| (format!("{}.{key}", axis.name()), value));
        let of_axis = assignments(&parameters, of_axis.into_iter(), &ValueSource::file(TEMPLATE));
        // The identification reports an inertia out of range.
        let mut updated = parameters.clone();
        if updated.set_all(of_axis).is_ok() {
            parameters = updated;
        }
    }
    Ok(parameters)
}

/// Returns the assignments of those values that the user has not stated.
fn assignments(
    parameters: &Parameters,
    values: impl Iterator<Item = (String, f64)>,
    source: &ValueSource,
) -> Vec<Assignment> {
    let is_open = |key: &str| parameters.source(key) != Some(&ValueSource::named("--set"));
    let open = values.filter(|(key, _)| is_open(key));
    open.map(|(key, value)| Assignment { key, value: Value::Double(value), source: source.clone() }).collect()
}

/// Returns the values of an axis of a new machine that the user has stated.
pub fn stated(parameters: &Parameters, axis: &str) -> StatedValues {
    StatedValues::new(parameters, axis, |source| *source == ValueSource::named("--set"))
}

/// Returns the comment of a value that was not identified: its source.
pub fn comment(parameters: &Parameters, key: &str) -> Option<String> {
    let source = parameters.source(key)?.at_line(0);
    let text = match source.to_string().as_str() {
        RECORDINGS if key.contains(".travel_") => "largest in the recordings, with home",
        RECORDINGS if key == "periods.position_ms" => "sampling period of the recordings",
        RECORDINGS => "from the largest in the recordings",
        TEMPLATE => "template: neither stated nor identified",
        _ => return None,
    };
    Some(text.to_owned())
}

fn template(axes: &[SelectedAxis]) -> String {
    let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
    let mut text =
        format!("/**:\n  ros__parameters:\n    machine: new\n    joints: [{}]\n{MACHINE}", names.join(", "));
    for name in names {
        let own = match kind(name) {
            AxisKind::Linear => {
                "type: linear\n      transmission:\n        screw_lead_mm: 20.0\n      gravity:\n        weight_n: 0.0\n      \
                 limits:\n        velocity_m_min: 60.0\n        acceleration_m_s2: 3.0\n        jerk_m_s3: 50.0\n        \
                 travel_min_mm: -500.0\n        travel_max_mm: 500.0\n"
            }
            AxisKind::Rotary => {
                "type: rotary\n      transmission:\n        gear_ratio: 100.0\n      gravity:\n        tilt_nm: 0.0\n        \
                 tilt_phase_deg: 0.0\n      limits:\n        velocity_rpm: 50.0\n        acceleration_rev_s2: 2.0\n        \
                 jerk_rev_s3: 50.0\n        travel_min_deg: -360.0\n        travel_max_deg: 360.0\n"
            }
        };
        text += &format!("    {name}:\n      {own}{AXIS}");
    }
    text
}

/// Returns the kind of an axis by the letter of its name: A, B and C rotate.
fn kind(name: &str) -> AxisKind {
    let letter = name.rsplit('_').next().and_then(|last| last.chars().next());
    match letter.map(|letter| letter.to_ascii_lowercase()) {
        Some('a' | 'b' | 'c') => AxisKind::Rotary,
        _ => AxisKind::Linear,
    }
}

/// Returns the keys and values of an axis that its recordings show.
fn recorded_values(axis: &AxisConfig, recordings: &[Signals]) -> Vec<(&'static str, f64)> {
    let spans = || recordings.iter().flat_map(|signals| &signals.spans);
    let positions =
        || spans().flat_map(|span| span.position.iter().chain(span.psec.iter().flatten()).copied());
    let low = positions().fold(0.0, f64::min);
    let high = positions().fold(0.0, f64::max);
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let speed = largest(&mut spans().flat_map(|span| span.velocity.iter().copied()));
    let acceleration = largest(&mut spans().flat_map(|span| span.acceleration.iter().copied()));
    let current = largest(&mut spans().flat_map(|span| span.current.iter().flatten().copied()));
    let motor_speed = RESERVE * speed / axis.transmission_ratio.abs();
    let mut values = match axis.kind() {
        AxisKind::Linear => vec![
            ("limits.travel_min_mm", (low / MILLIMETER).floor()),
            ("limits.travel_max_mm", (high / MILLIMETER).ceil()),
            ("limits.velocity_m_min", rounded_up(speed / METER_PER_MINUTE)),
            ("limits.acceleration_m_s2", rounded_up(acceleration)),
            ("limits.jerk_m_s3", rounded_up(20.0 * acceleration)),
        ],
        AxisKind::Rotary => vec![
            ("limits.travel_min_deg", (low / DEGREE).floor()),
            ("limits.travel_max_deg", (high / DEGREE).ceil()),
            ("limits.velocity_rpm", rounded_up(speed / RPM)),
            ("limits.acceleration_rev_s2", rounded_up(acceleration / REVOLUTION)),
            ("limits.jerk_rev_s3", rounded_up(20.0 * acceleration / REVOLUTION)),
        ],
    };
    values.push(("motor.max_speed_rpm", rounded_up(motor_speed / RPM)));
    let emf = EMF_SHARE * axis.motor.max_voltage / motor_speed;
    if emf < axis.motor.emf_constant {
        values.push(("motor.emf_constant_v_s_rad", emf));
    }
    if current > 0.0 {
        values.push(("motor.max_current_a", rounded_up(RESERVE * current)));
    }
    values.retain(|(_, value)| value.is_finite());
    values
}

/// Rounds up to two significant digits.
fn rounded_up(value: f64) -> f64 {
    if value <= 0.0 {
        return value;
    }
    let unit = 10_f64.powf(value.log10().floor() - 1.0);
    let rounded = (value / unit).ceil() * unit;
    // Without the digits of binary rounding.
    format!("{rounded:.1e}").parse().unwrap_or(rounded)
}

/// Returns the inertia by the current alone; none without current or motion.
fn inertia(axis: &AxisConfig, recordings: &[Signals], periods: &Periods) -> Option<f64> {
    let inputs: Vec<IdentificationInput<'_>> =
        recordings.iter().map(|signals| IdentificationInput { signals, feedforward: None }).collect();
    let options = IdentificationOptions { refine: RefinementScope::NONE, ..IdentificationOptions::default() };
    let found = identify(&inputs, axis, periods, &options);
    found.inertia.as_ref()?;
    Some(found.axis().motor.inertia).filter(|inertia| *inertia > 0.0)
}
