//! Files of production traces: recordings as CSV, and machine files of hidden axes.

use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use virtual_axes_core::config::{Assignment, AxisConfig, Parameters, Periods, Value, ValueSource};
use virtual_axes_core::units::{
    METER_PER_MINUTE, MICROSECOND_NS, MILLIHENRY, MILLIMETER, MILLISECOND, MILLISECOND_NS, Nanoseconds,
    POSITION_GAIN, RPM,
};
use virtual_axes_identify::recording::RawRecording;

/// Returns a machine file with the parameters of linear axes named x, y or z; `head` is a comment at its top.
///
/// Values are those of the axes up to the rounding of the unit conversions.
///
/// # Errors
/// An error if a name is not that of a linear axis of the default machine, or a value is out of range.
pub fn machine_file(head: &str, axes: &[&AxisConfig], periods: Periods) -> Result<String, Box<dyn Error>> {
    let mut parameters = Parameters::embedded_default()?;
    let source = ValueSource::named("hidden axis");
    let names = axes.iter().map(|axis| axis.name.clone()).collect();
    parameters.set("joints", Value::TextList(names), &source)?;
    let period =
        |key: &str, value: Nanoseconds, unit: Nanoseconds| (key.to_owned(), value as f64 / unit as f64);
    let mut values = vec![
        period("periods.position_ms", periods.position, MILLISECOND_NS),
        period("periods.velocity_us", periods.velocity, MICROSECOND_NS),
        period("periods.current_us", periods.current, MICROSECOND_NS),
    ];
    for axis in axes {
        let name = &axis.name;
        let own = axis_values(axis).into_iter().map(|(key, value)| (format!("{name}.{key}"), value));
        values.extend(own);
    }
    let assignment = |(key, value)| Assignment { key, value: Value::Double(value), source: source.clone() };
    parameters.set_all(values.into_iter().map(assignment).collect())?;
    parameters.set("machine", Value::Text("Hidden machine".to_owned()), &source)?;
    Ok(parameters.to_yaml(head, |_| None))
}

/// Returns the parameters of a linear axis with a cascade by their keys, in the units of machine files.
fn axis_values(axis: &AxisConfig) -> Vec<(&'static str, f64)> {
    let (motor, friction, limits) = (&axis.motor, &axis.friction, &axis.limits);
    let ms = |delay: Nanoseconds| delay as f64 / MILLISECOND_NS as f64;
    vec![
        ("transmission.screw_lead_mm", axis.transmission_ratio * TAU / MILLIMETER),
        ("motor.inertia_kg_m2", motor.inertia),
        ("motor.torque_constant_nm_a", motor.torque_constant),
        ("motor.emf_constant_v_s_rad", motor.emf_constant),
        ("motor.resistance_ohm", motor.resistance),
        ("motor.inductance_mh", motor.inductance / MILLIHENRY),
        ("motor.max_current_a", motor.max_current),
        ("motor.max_voltage_v", motor.max_voltage),
        ("motor.max_speed_rpm", motor.max_speed / RPM),
        ("friction.a", friction.a),
        ("friction.b", friction.b),
        ("friction.c", friction.c),
        ("friction.d", friction.d),
        ("friction.i0", friction.i0),
        ("gravity.weight_n", axis.gravity.weight),
        ("position_loop.gain", axis.position_loop.gain / POSITION_GAIN),
        ("velocity_loop.gain", axis.velocity_loop.gain),
        ("velocity_loop.integral_time_ms", axis.velocity_loop.integral_time / MILLISECOND),
        ("current_loop.gain", axis.current_loop.gain),
        ("current_loop.integral_time_ms", axis.current_loop.integral_time / MILLISECOND),
        ("feedforward.velocity", axis.feedforward.velocity),
        ("feedforward.torque_kg_m2", axis.feedforward.torque),
        ("feedforward.friction", axis.feedforward.friction),
        ("delays.alpha_ms", ms(axis.delays.alpha)),
        ("delays.beta_ms", ms(axis.delays.beta)),
        ("delays.gamma_ms", ms(axis.delays.gamma)),
        ("delays.friction_ms", ms(axis.delays.friction)),
        ("limits.velocity_m_min", limits.velocity / METER_PER_MINUTE),
        ("limits.acceleration_m_s2", limits.acceleration),
        ("limits.jerk_m_s3", limits.jerk),
        ("limits.travel_min_mm", limits.travel_min / MILLIMETER),
        ("limits.travel_max_mm", limits.travel_max / MILLIMETER),
    ]
}

/// Writes recordings with equal stamps as one CSV file: time in s, and per recording commanded position in mm, actual
/// position in mm, actual velocity in mm/s and current in A, and VFFWS in rad/s and TFFWS in N·m of the motor if recorded.
///
/// Headers contain the name of the recording in upper case: `X commanded position [mm]`. Resolutions are 1 µs, 1 nm,
/// 1 µm/s, 1 mA, 1 µrad/s and 1 µN·m. Missing values are empty.
///
/// # Errors
/// An error if the file cannot be written.
pub fn write_csv(path: &Path, recordings: &[RawRecording]) -> Result<(), Box<dyn Error>> {
    fs::write(path, csv(recordings)).map_err(|error| format!("{}: {error}", path.display()).into())
}

/// Column of a trace.
struct Column<'a> {
    header: String,
    values: Option<&'a Vec<f64>>,
    /// Unit of the column in SI units.
    unit: f64,
    decimals: usize,
}

fn csv(recordings: &[RawRecording]) -> String {
    let columns: Vec<Column<'_>> = recordings.iter().flat_map(columns).collect();
    let mut text = "Time [s]".to_owned();
    for column in &columns {
        text.push(',');
        text.push_str(&column.header);
    }
    text.push('\n');
    let time = recordings.first().map_or(&[][..], |recording| &recording.time);
    for (k, stamp) in time.iter().enumerate() {
        // Writing to a string does not fail.
        let _ = write!(text, "{stamp:.6}");
        for Column { values, unit, decimals, .. } in &columns {
            text.push(',');
            if let Some(value) = values.and_then(|values| values.get(k)).filter(|value| value.is_finite()) {
                let power = 10.0_f64.powi(*decimals as i32);
                // Adding 0 turns -0 into 0.
                let _ = write!(text, "{:.decimals$}", (value / unit * power).round() / power + 0.0);
            }
        }
        text.push('\n');
    }
    text
}

fn columns(recording: &RawRecording) -> Vec<Column<'_>> {
    let name = recording.name.to_uppercase();
    let column = |signal: &str, values, unit, decimals| Column {
        header: format!("{name} {signal}"),
        values,
        unit,
        decimals,
    };
    let mut columns = vec![
        column("commanded position [mm]", recording.psec.as_ref(), MILLIMETER, 6),
        column("actual position [mm]", recording.position.as_ref(), MILLIMETER, 6),
        column("actual velocity [mm/s]", recording.velocity.as_ref(), MILLIMETER, 3),
        column("current [A]", recording.current.as_ref(), 1.0, 3),
    ];
    let feedforward = [
        ("velocity feedforward [rad/s]", recording.velocity_feedforward.as_ref()),
        ("torque feedforward [N.m]", recording.torque_feedforward.as_ref()),
    ];
    let recorded = feedforward.into_iter().filter(|(_, values)| values.is_some());
    columns.extend(recorded.map(|(signal, values)| column(signal, values, 1.0, 6)));
    columns
}
