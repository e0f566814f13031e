//! Machine files and truth files of hidden axes.

use std::f64::consts::TAU;
use std::fmt::Write;

use virtual_axes_core::config::{Assignment, AxisConfig, Parameters, Periods, Value, ValueSource};
use virtual_axes_core::units::{
    METER_PER_MINUTE, MICROSECOND_NS, MILLIHENRY, MILLIMETER, MILLISECOND, MILLISECOND_NS, Nanoseconds,
    POSITION_GAIN, RPM,
};

use super::error::TraceError;
use super::hidden_axis::HiddenAxis;

/// Returns a machine file with the parameters of linear axes named x, y or z; `head` is a comment at its top.
///
/// Values are those of the axes up to the rounding of the unit conversions.
///
/// # Errors
/// [`TraceError::Config`] if a name is not that of a linear axis of the default machine, or a value is out of range.
pub fn machine_file(head: &str, axes: &[&AxisConfig], periods: Periods) -> Result<String, TraceError> {
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

/// Returns YAML with the hidden parameters of axes and control, in the units of machine files: `periods` and `axes`.
/// Each axis has its joint index, sign of the recorded current, lag at constant velocity, backlash, Stribeck friction,
/// and `parameters` by their keys in machine files.
///
/// `head` is a comment at its top.
pub fn truth_file(head: &str, axes: &[HiddenAxis]) -> String {
    let mut text: String = head.lines().map(|line| format!("# {line}\n")).collect();
    let mut line = |indent: usize, key: &str, value: &str| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{:indent$}{}", "", format!("{key}: {value}").trim_end());
    };
    if let Some(axis) = axes.first() {
        let Periods { position, velocity, current } = axis.periods;
        line(0, "periods", "");
        line(2, "position_ms", &number(position as f64 / MILLISECOND_NS as f64));
        line(2, "velocity_us", &number(velocity as f64 / MICROSECOND_NS as f64));
        line(2, "current_us", &number(current as f64 / MICROSECOND_NS as f64));
    }
    line(0, "axes", if axes.is_empty() { "{}" } else { "" });
    for axis in axes {
        // YAML 1.1 readers read y as true.
        line(2, &format!("\"{}\"", axis.config.name), "");
        line(4, "joint", &axis.joint.to_string());
        line(4, "current_inverted", &axis.is_current_inverted.to_string());
        line(4, "lag_ms", &number(axis.lag() / MILLISECOND));
        line(4, "backlash_um", &number(axis.backlash / 1e-6));
        line(4, "stribeck_a", &number(axis.stribeck));
        line(4, "parameters", "");
        for (key, value) in axis_values(&axis.config) {
            line(6, key, &number(value));
        }
    }
    text
}

/// Returns a number that YAML readers read as a float.
fn number(value: f64) -> String {
    format!("{value:?}")
}
