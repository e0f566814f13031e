//! Tuning of position controllers: the parameters that a search changes.

use std::fmt;

use virtual_axes_core::config::{Assignment, ConfigError, Parameters, Value, ValueSource};
use virtual_axes_core::design::{ControlWeight, GpcTuning};

/// Key of the gain of cross-coupled control.
pub(super) const CONTOUR_GAIN: &str = "contour_control.gain";

/// Gains of the cascade on one axis, in units of a machine file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisGains {
    /// Position gain Kp, (m/min)/mm or (1000 °/min)/°.
    pub gain: f64,
    /// Velocity feedforward weight VFFW.
    pub velocity: f64,
    /// Torque feedforward weight TFFW, kg·m² (kg).
    pub torque: f64,
}

/// Tuning of the moving axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Tuning {
    /// Present tuning of the machine.
    Present,
    /// Predictive controller, common to all axes.
    Gpc {
        /// First prediction horizon N1.
        n1: usize,
        /// Last prediction horizon N2.
        n2: usize,
        /// Control horizon Nu.
        nu: usize,
        /// Control weight λ / trace(GᵀG).
        lambda_rel: f64,
    },
    /// Gains of the cascade per joint.
    Cascade(Vec<(String, AxisGains)>),
    /// Gain of cross-coupled control, (m/min)/mm; the position controllers keep their tuning.
    ContourGain(f64),
}

impl Tuning {
    /// Returns the design of a predictive controller; none for other tunings.
    pub fn gpc(&self) -> Option<GpcTuning> {
        match *self {
            Tuning::Gpc { n1, n2, nu, lambda_rel } => {
                Some(GpcTuning { n1, n2, nu, weight: ControlWeight::Relative(lambda_rel) })
            }
            _ => None,
        }
    }

    /// Returns the full keys and values of the parameters on `joints`.
    pub fn values(&self, joints: &[String], parameters: &Parameters) -> Vec<(String, Value)> {
        let count = |value: usize| Value::Integer(i64::try_from(value).unwrap_or(i64::MAX));
        let controller = |name: &str| ("controller".to_owned(), Value::Text(name.to_owned()));
        match self {
            Tuning::Present => Vec::new(),
            Tuning::Gpc { n1, n2, nu, lambda_rel } => {
                let values = [
                    controller("gpc"),
                    ("gpc.n1".to_owned(), count(*n1)),
                    ("gpc.n2".to_owned(), count(*n2)),
                    ("gpc.nu".to_owned(), count(*nu)),
                    ("gpc.lambda_rel".to_owned(), Value::Double(*lambda_rel)),
                ];
                let of_joint = |joint: &String| {
                    let full = |(key, value)| (format!("{joint}.position_loop.{key}"), value);
                    values.clone().map(full)
                };
                joints.iter().flat_map(of_joint).collect()
            }
            Tuning::ContourGain(gain) => vec![(CONTOUR_GAIN.to_owned(), Value::Double(*gain))],
            Tuning::Cascade(axes) => axes
                .iter()
                .flat_map(|(joint, gains)| {
                    [
                        (format!("{joint}.position_loop.controller"), controller("cascade").1),
                        (format!("{joint}.position_loop.gain"), Value::Double(gains.gain)),
                        (format!("{joint}.feedforward.velocity"), Value::Double(gains.velocity)),
                        (torque_key(joint, parameters), Value::Double(gains.torque)),
                    ]
                })
                .collect(),
        }
    }

    /// Returns `parameters` with this tuning on `joints`.
    ///
    /// # Errors
    /// [`ConfigError`] if the schema rejects a value.
    pub fn apply(&self, parameters: &Parameters, joints: &[String]) -> Result<Parameters, ConfigError> {
        let source = ValueSource::named("tuning");
        let mut tuned = parameters.clone();
        if self.gpc().is_some() {
            for joint in joints {
                // An absolute λ would override λ_rel.
                tuned.unset(&format!("{joint}.position_loop.gpc.lambda"), &source)?;
            }
        }
        let values = self.values(joints, parameters).into_iter();
        let assignments = values.map(|(key, value)| Assignment { key, value, source: source.clone() });
        tuned.set_all(assignments.collect())?;
        Ok(tuned)
    }
}

/// Returns the key of TFFW, which is in kg for a linear motor.
pub(super) fn torque_key(joint: &str, parameters: &Parameters) -> String {
    let linear = format!("{joint}.feedforward.torque_kg");
    if parameters.definition(&linear).is_some() { linear } else { format!("{linear}_m2") }
}

impl fmt::Display for Tuning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Tuning::Present => f.write_str("present"),
            Tuning::ContourGain(gain) => write!(f, "{CONTOUR_GAIN} {gain}"),
            Tuning::Gpc { n1, n2, nu, lambda_rel } => {
                write!(f, "N1 {n1}, N2 {n2}, Nu {nu}, λ_rel {lambda_rel}")
            }
            Tuning::Cascade(axes) => {
                for (index, (joint, gains)) in axes.iter().enumerate() {
                    let comma = if index > 0 { "; " } else { "" };
                    let AxisGains { gain, velocity, torque } = gains;
                    write!(f, "{comma}{joint} Kp {gain}, VFFW {velocity}, TFFW {torque}")?;
                }
                Ok(())
            }
        }
    }
}

/// Rounds `value` to `digits` significant digits.
pub(super) fn round_significant(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}
