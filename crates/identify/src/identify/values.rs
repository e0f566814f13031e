//! Identified values as parameters of a machine file.

mod transmission;

use serde::Serialize;

use super::delays::DelayParameter;
use super::friction::{FrictionLaw, LawFit};
use super::gravity::{GravityCurrent, GravitySource};
use super::identification::Identification;
use super::refine::{RefinedParameter, RefinedValue};
use virtual_axes_core::config::{Assignment, ConfigError, Parameters, Value, ValueSource};
use virtual_axes_core::units::{DEGREE, MILLISECOND_NS, NEWTON_PER_MICROMETER};

/// Digits of a value beyond the first digit of its standard error.
const GUARD_DIGITS: i32 = 2;
/// Standard errors of the half interval that contains 95 % of the values.
const INTERVAL: f64 = 1.96;
/// Digits of a value without standard error.
const MOST_DIGITS: i32 = 9;

/// Identified parameter of the machine file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IdentifiedValue {
    /// Full key, such as `x.motor.inertia_kg_m2`.
    pub key: String,
    /// Value in the unit of the machine file.
    pub value: f64,
    /// Unit; can be empty.
    pub unit: &'static str,
    /// Value before the identification.
    pub before: f64,
    /// Standard error in the unit of the machine file.
    #[serde(rename = "standard_error")]
    pub error: Option<f64>,
    /// Interval of equivalent delays: above the first and up to the second value.
    pub interval: Option<[f64; 2]>,
    /// True if the 95 % interval is narrower than the value.
    #[serde(rename = "significant")]
    pub is_significant: bool,
    /// Identification steps and equations that determine the value.
    pub source: String,
}

impl IdentifiedValue {
    /// Returns the comment behind the value in a machine file.
    pub fn comment(&self) -> String {
        let mut text = String::from(if self.is_significant { "identified: " } else { "estimated: " });
        match (self.interval, self.error) {
            (Some([low, high]), _) => text += &format!("{} … {} {}, ", number(low), number(high), self.unit),
            (None, Some(error)) => text += format!("± {error:.1e} {}", self.unit).trim_end(),
            (None, None) => {}
        }
        if self.interval.is_none() && self.error.is_some() {
            text += ", ";
        }
        text + &self.source
    }
}

/// Returns a count with its noun, such as "1 move", "3 moves".
fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Rounds a value to the digits that its standard error permits.
fn rounded(value: f64, error: Option<f64>) -> f64 {
    let magnitude = |x: f64| x.abs().log10().floor() as i32;
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let most = magnitude(value) - MOST_DIGITS + 1;
    let last = match error.filter(|e| *e > 0.0 && e.is_finite()) {
        Some(error) => (magnitude(error) - GUARD_DIGITS).max(most),
        None => most,
    };
    format!("{value:.*}", usize::try_from(-last).unwrap_or(0)).parse().unwrap_or(value)
}

impl Identification {
    /// Returns the identified parameters of `joint` in the order of a machine file.
    ///
    /// `parameters` is the machine before the identification; it defines the keys and units of the axis.
    /// Parameters that the data do not determine are omitted.
    pub fn values(&self, parameters: &Parameters, joint: &str) -> Vec<IdentifiedValue> {
        let mut out = Vec::new();
        let mut put = |keys: &[&str],
                       value: f64,
                       error: Option<f64>,
                       interval: Option<[f64; 2]>,
                       source: String| {
            let known = keys.iter().map(|key| format!("{joint}.{key}"));
            let Some((key, definition)) =
                known.into_iter().find_map(|key| parameters.definition(&key).map(|d| (key.clone(), d)))
            else {
                return;
            };
            let before = match parameters.get(&key) {
                Some(Value::Double(value)) => value,
                _ => f64::NAN,
            };
            // Half of the 95 % interval.
            let half =
                interval.map_or(error.map(|error| INTERVAL * error), |[low, high]| Some((high - low) / 2.0));
            // A value of 0 is stated as such, and an angle has no size.
            let is_significant =
                value == 0.0 || key.ends_with("phase_deg") || half.is_none_or(|half| half <= value.abs());
            // Without the sign of −0.
            let value = 0.0 + if interval.is_some() { value } else { rounded(value, error) };
            let source = if is_significant {
                source
            } else {
                format!("{source}; not identified: interval wider than the value")
            };
            let unit = definition.unit;
            out.push(IdentifiedValue { key, value, unit, before, error, interval, is_significant, source });
        };
        self.push_plant(&mut put);
        self.push_control(&mut put);
        self.push_position_cycle(parameters, &mut out);
        out
    }

    fn push_plant(&self, put: &mut ValueSink<'_>) {
        let axis = &self.axis;
        if let Some((value, error)) = self.torque_constant {
            let keys = ["motor.torque_constant_nm_a", "motor.force_constant_n_a"];
            put(&keys, value, Some(error), None, "recorded torque and current".to_owned());
            let keys = ["motor.emf_constant_v_s_rad", "motor.emf_constant_v_s_m"];
            put(
                &keys,
                axis.motor.emf_constant,
                None,
                None,
                "in proportion to the torque constant".to_owned(),
            );
        }
        if let Some((error, source)) =
            self.error_and_source(RefinedParameter::Inertia, self.inertia.as_ref().map(|i| i.error), || {
                match &self.inertia {
                    Some(found) if found.is_regression() => {
                        format!("regression of the current ({})", counted(found.accelerations, "move"))
                    }
                    Some(found) => {
                        format!("Prévost eq. 5 ({})", counted(found.accelerations, "acceleration"))
                    }
                    None => "positions".to_owned(),
                }
            })
        {
            put(&["motor.inertia_kg_m2", "motor.mass_kg"], axis.motor.inertia, error, None, source);
        } else if let Some(total) = self.inertia_of_both_encoders() {
            let error = total.error() * axis.transmission_ratio.powi(2);
            let source = "motion of motor and load".to_owned();
            put(&["motor.inertia_kg_m2", "motor.mass_kg"], axis.motor.inertia, Some(error), None, source);
        }
        self.push_friction(put);
        self.push_presliding(put);
        self.push_transmission(put);
        self.push_gravity(put);
    }

    fn push_friction(&self, put: &mut ValueSink<'_>) {
        let (law, fit) = (&self.axis.friction, self.friction.as_ref().map(|friction| &friction.law));
        let straight = fit.is_some_and(|fit| fit.law == FrictionLaw::Linear);
        let parameters = [
            RefinedParameter::FrictionA,
            RefinedParameter::FrictionB,
            RefinedParameter::FrictionC,
            RefinedParameter::FrictionD,
        ];
        let refined =
            self.refined(if straight { RefinedParameter::Coulomb } else { RefinedParameter::FrictionA });
        if fit.is_none() && refined.is_none() {
            return;
        }
        let line = (RefinedParameter::Coulomb.get(&self.axis), RefinedParameter::Viscous.get(&self.axis));
        let what = |fit: &LawFit| match fit.law {
            FrictionLaw::Linear => {
                let unit = self.axis.units().speed_name;
                format!("line {:.4} A + {:.5} A/({unit}) · V in the form of Prévost eq. 3", line.0, line.1)
            }
            FrictionLaw::DoubleExponential => format!("Prévost eq. 3, R² {:.4}", fit.r_squared),
        };
        let source = match (fit, refined) {
            (Some(fit), Some(_)) => format!("{}; refined on the closed loop", what(fit)),
            (Some(fit), None) => what(fit),
            (None, _) => "refined on the closed loop".to_owned(),
        };
        let values = [law.a, law.b, law.c, law.d];
        for (k, key) in ["friction.a", "friction.b", "friction.c", "friction.d"].iter().enumerate() {
            let error = self.refined(parameters[k]).map(|r| r.error).or(fit.map(|fit| fit.errors[k]));
            // The terms of a linear law nearly cancel, so they keep all digits.
            put(&[key], values[k], error.filter(|e| e.is_finite() && !straight), None, source.clone());
        }
        let (source, error) = match self.refined(RefinedParameter::Breakaway) {
            Some(refined) => ("refined on the closed loop", Some(refined.error)),
            None => ("i0 = a + c, assumed", self.error_of_sum().or(fit.map(|fit| fit.error_at(0.0)))),
        };
        put(&["friction.i0"], law.i0, error, None, source.to_owned());
    }

    fn push_presliding(&self, put: &mut ValueSink<'_>) {
        let Some(fit) = &self.presliding else { return };
        let source = format!("{} reversals", fit.reversals);
        for (key, unit) in [
            ("friction.presliding_stiffness_n_um", NEWTON_PER_MICROMETER),
            ("friction.presliding_stiffness_nm_rad", 1.0),
        ] {
            put(&[key], fit.stiffness / unit, Some(fit.error() / unit), None, source.clone());
        }
        // Elements have no damping.
        let has_elements = self.initial.presliding.is_some_and(|presliding| presliding.elements > 0);
        if let Some((value, error)) = fit.damping.filter(|_| !has_elements) {
            let keys = ["friction.presliding_damping_n_s_m", "friction.presliding_damping_nm_s_rad"];
            put(&keys, value, Some(error), None, source);
        }
    }

    /// Returns the standard error of a + c from the refinement.
    fn error_of_sum(&self) -> Option<f64> {
        let refinement = self.refinement.as_ref()?;
        let index = |parameter| refinement.parameters.iter().position(|p| p.parameter == parameter);
        if let Some(level) = index(RefinedParameter::Coulomb) {
            return Some(refinement.parameters[level].error);
        }
        let (a, c) = (index(RefinedParameter::FrictionA)?, index(RefinedParameter::FrictionC)?);
        let (x, y) = (refinement.parameters[a].error, refinement.parameters[c].error);
        let rho = refinement.correlations.get(a)?.get(c)?;
        Some((x * x + y * y + 2.0 * rho * x * y).max(0.0).sqrt())
    }

    fn push_gravity(&self, put: &mut ValueSink<'_>) {
        let Some(gravity) = &self.gravity else { return };
        let nothing = if gravity.model == GravityCurrent::default() { ": not significant" } else { "" };
        let source = || match gravity.source {
            GravitySource::Regression => format!("regression of the current{nothing}"),
            GravitySource::Motion => format!("constant velocities in both directions{nothing}"),
            GravitySource::Rest => format!("standstills{nothing}"),
        };
        if let Some((weight, error)) = gravity.weight
            && let Some((refined, source)) =
                self.error_and_source(RefinedParameter::Weight, Some(error), source)
        {
            // A weight that the data cannot tell from zero is an interval.
            let is_zero =
                gravity.source == GravitySource::Regression && gravity.model == GravityCurrent::default();
            let interval = is_zero.then(|| {
                let half = INTERVAL * error;
                [(weight - half).min(0.0), (weight + half).max(0.0)]
            });
            put(&["gravity.weight_n"], self.axis.gravity.weight, refined, interval, source);
        }
        let refined = self.errors_of_tilt();
        let source = || match refined {
            Some(_) => format!("{}; refined on the closed loop", source()),
            None => source(),
        };
        if let Some((_, error)) = gravity.tilt {
            let error = refined.map_or(error, |errors| errors[0]);
            put(&["gravity.tilt_nm"], self.axis.gravity.tilt, Some(error), None, source());
        }
        if let Some((_, error)) = gravity.phase {
            let error = refined.map_or(error, |errors| errors[1]) / DEGREE;
            put(&["gravity.tilt_phase_deg"], self.axis.gravity.phase / DEGREE, Some(error), None, source());
        }
    }

    /// Returns the standard errors of the tilting torque k, N·m, and its phase φ, rad, from those of k cos φ and k sin φ in
    /// the refinement.
    fn errors_of_tilt(&self) -> Option<[f64; 2]> {
        let refinement = self.refinement.as_ref()?;
        let index = |parameter| refinement.parameters.iter().position(|p| p.parameter == parameter);
        let (s, c) = (index(RefinedParameter::TiltSine)?, index(RefinedParameter::TiltCosine)?);
        let (x, y) = (refinement.parameters[s].error, refinement.parameters[c].error);
        let covariance = refinement.correlations.get(s)?.get(c)? * x * y;
        let (sin, cos) = self.axis.gravity.phase.sin_cos();
        let along = (cos * x).powi(2) + (sin * y).powi(2) + 2.0 * sin * cos * covariance;
        let across = (sin * x).powi(2) + (cos * y).powi(2) - 2.0 * sin * cos * covariance;
        let [along, across] = [along, across].map(|square| square.max(0.0).sqrt());
        Some([along, across / self.axis.gravity.tilt.abs()])
    }

    fn push_control(&self, put: &mut ValueSink<'_>) {
        let weights = &self.axis.feedforward;
        let regression = |found: &Option<super::feedforward::FeedforwardRegression>, equation: u32| {
            found.as_ref().map(|r| (r.error, format!("Prévost eq. {equation}, R² {:.6}", r.r_squared)))
        };
        let velocity = regression(&self.feedforward.velocity, 6);
        if let Some((error, source)) = self.error_and_source(
            RefinedParameter::VelocityFeedforward,
            velocity.as_ref().map(|v| v.0),
            || velocity.as_ref().map_or_else(String::new, |v| v.1.clone()),
        ) {
            put(&["feedforward.velocity"], weights.velocity, error, None, source);
        }
        let torque = regression(&self.feedforward.torque, 7);
        if let Some((error, source)) =
            self.error_and_source(RefinedParameter::TorqueFeedforward, torque.as_ref().map(|t| t.0), || {
                torque.as_ref().map_or_else(String::new, |t| t.1.clone())
            })
        {
            put(&["feedforward.torque_kg_m2", "feedforward.torque_kg"], weights.torque, error, None, source);
        }
        if self.feedforward.is_torque_zero {
            let keys = ["feedforward.torque_kg_m2", "feedforward.torque_kg"];
            put(&keys, 0.0, None, None, "TFFWS is always 0".to_owned());
        }
        for (parameter, keys) in [
            (RefinedParameter::PositionGain, ["position_loop.gain"; 1]),
            (RefinedParameter::VelocityGain, ["velocity_loop.gain"]),
            (RefinedParameter::VelocityIntegralTime, ["velocity_loop.integral_time_ms"]),
        ] {
            let unit = parameter.unit_size();
            if let Some(found) = self.refined(parameter) {
                let source = "jointly from positions".to_owned();
                put(&keys, found.value / unit, Some(found.error / unit), None, source);
            }
        }
        let ms = |delay: i64| delay as f64 / MILLISECOND_NS as f64;
        for fit in &self.delays {
            let left = if fit.is_unchanged { "; unchanged" } else { "" };
            let source = match fit.is_joint {
                // β is fitted with feedforward only.
                true if self.delays.iter().any(|fit| fit.delay == DelayParameter::Beta) => {
                    "jointly from positions, with feedforward".to_owned()
                }
                true => "jointly from positions, without feedforward".to_owned(),
                false => format!("feedforward {}{left}", fit.delay.feedforward_mode().name()),
            };
            let key = match fit.delay {
                DelayParameter::Alpha => "delays.alpha_ms",
                DelayParameter::Beta => "delays.beta_ms",
                DelayParameter::Gamma => "delays.gamma_ms",
            };
            let interval = Some([ms(fit.interval.0), ms(fit.interval.1)]);
            put(&[key], ms(fit.delay.of(&self.axis.delays)), None, interval, source);
        }
    }

    /// Adds the position cycle if it differs from that of the machine file.
    fn push_position_cycle(&self, parameters: &Parameters, out: &mut Vec<IdentifiedValue>) {
        let key = "periods.position_ms";
        let (Some(periods), Some(Value::Double(before))) = (self.periods, parameters.get(key)) else {
            return;
        };
        let value = periods.position as f64 / MILLISECOND_NS as f64;
        if value != before {
            let source = "the recorded setpoints and the least residual".to_owned();
            out.push(IdentifiedValue {
                key: key.to_owned(),
                value,
                unit: "ms",
                before,
                error: None,
                interval: None,
                is_significant: true,
                source,
            });
        }
    }

    pub(super) fn refined(&self, parameter: RefinedParameter) -> Option<&RefinedValue> {
        self.refinement.as_ref()?.parameters.iter().find(|refined| refined.parameter == parameter)
    }

    /// Returns standard error and source of a parameter from the refinement or its step; none if it was not
    /// identified.
    fn error_and_source(
        &self,
        parameter: RefinedParameter,
        step: Option<f64>,
        source: impl FnOnce() -> String,
    ) -> Option<(Option<f64>, String)> {
        match (self.refined(parameter), step) {
            (Some(refined), None) => Some((Some(refined.error), "refined on the closed loop".to_owned())),
            (Some(refined), Some(_)) => {
                Some((Some(refined.error), format!("{}; refined on the closed loop", source())))
            }
            (None, Some(error)) => Some((Some(error), source())),
            (None, None) => None,
        }
    }
}

/// Sink of a parameter: alternative keys, value, standard error, interval, source.
type ValueSink<'a> = dyn FnMut(&[&str], f64, Option<f64>, Option<[f64; 2]>, String) + 'a;

/// Sets identified values in a machine.
///
/// # Errors
/// [`ConfigError`] if a value is outside the range of the schema.
pub fn update_parameters(
    parameters: &mut Parameters,
    joint: &str,
    values: &[IdentifiedValue],
) -> Result<(), ConfigError> {
    let source = ValueSource::named("identification");
    let mut assignments: Vec<Assignment> = values
        .iter()
        .map(|v| Assignment { key: v.key.clone(), value: Value::Double(v.value), source: source.clone() })
        .collect();
    // The identified values describe the plant itself, so the deviation factors become 1.
    for factor in ["inertia", "friction", "torque_constant"] {
        let key = format!("{joint}.deviation.{factor}");
        if parameters.source(&key).is_some() {
            assignments.push(Assignment { key, value: Value::Double(1.0), source: source.clone() });
        }
    }
    parameters.set_all(assignments)
}
