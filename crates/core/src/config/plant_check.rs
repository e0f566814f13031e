//! Validation of the plant parameters of an axis against each other: transmission, load and friction.

use std::f64::consts::TAU;

use super::check::{CrossChecks, DIRECT, missing};
use super::definition::MotorKind;
use super::error::{ConfigError, ValueSource};
use super::layout::JointVariant;
use super::machine::AxisKind;
use super::plant_keys::{
    PRESLIDING_ELEMENTS, attraction_suffix, backlash_suffix, compensation_suffix, presliding_suffixes,
    structure_suffix, transmission_suffixes,
};
use super::value::{Value, number_text};
use crate::units::{MILLIMETER, Rounded};

impl CrossChecks<'_> {
    pub(super) fn check_transmission(
        &self,
        joint: &JointVariant,
        origin: &ValueSource,
    ) -> Result<(), ConfigError> {
        let drive = match joint.axis {
            AxisKind::Linear => "screw_lead_mm",
            AxisKind::Rotary => "gear_ratio",
        };
        let name = &joint.name;
        let drive = format!("{name}.transmission.{drive}");
        let direct = format!("{name}.transmission.direct");
        let is_direct = self.value(&direct) == Some(Value::Bool(true));
        match (is_direct, self.entries.contains_key(&drive)) {
            (true, true) => Err(self.rejection(
                &[&drive, &direct],
                format!("be the only transmission of {name}, found {drive} and {direct} = true"),
            )),
            (false, false) => Err(missing(
                origin,
                &format!("{name}.transmission"),
                format!("expected {drive} or {direct} = true"),
            )),
            _ => Ok(()),
        }
    }

    /// Checks that stiffness and load are given together, and that the motor has an inertia of its own.
    pub(super) fn check_elasticity(
        &self,
        joint: &JointVariant,
        origin: &ValueSource,
    ) -> Result<(), ConfigError> {
        let key = |suffix: &str| format!("{}.{suffix}", joint.name);
        let [stiffness, damping, load] = transmission_suffixes(joint.axis).map(key);
        let has = |key: &String| self.entries.contains_key(key);
        let Some(load_inertia) = self.number(&load).filter(|_| has(&stiffness)) else {
            return match (has(&stiffness), has(&load)) {
                (true, false) => Err(missing(origin, &load, format!("expected it beside {stiffness}"))),
                (false, true) => Err(missing(origin, &stiffness, format!("expected it beside {load}"))),
                _ if self.number(&damping).is_some_and(|value| value > 0.0) => {
                    Err(missing(origin, &stiffness, format!("expected it beside {damping}")))
                }
                _ => Ok(()),
            };
        };
        let inertia_key = key(match joint.motor {
            MotorKind::Rotary => "motor.inertia_kg_m2",
            MotorKind::Linear => "motor.mass_kg",
        });
        let per_axis = match joint.axis {
            _ if self.value(&key(DIRECT)) == Some(Value::Bool(true)) => Some(1.0),
            AxisKind::Linear => {
                self.number(&key("transmission.screw_lead_mm")).map(|lead| lead * MILLIMETER / TAU)
            }
            AxisKind::Rotary => self.number(&key("transmission.gear_ratio")).map(|ratio| 1.0 / ratio),
        };
        let (Some(inertia), Some(ratio)) = (self.number(&inertia_key), per_axis) else { return Ok(()) };
        let most = inertia / (ratio * ratio);
        if load_inertia < most {
            return Ok(());
        }
        Err(ConfigError::NotAllowed {
            at: self.entries.get(&load).map_or(origin, |entry| &entry.source).clone(),
            key: load,
            value: number_text(load_inertia),
            allowed: format!("be below {}, which is {inertia_key} at the axis", Rounded(most)),
        })
    }

    /// Checks that backlash, friction at the load and structure have a stiffness, and no presliding beside them.
    pub(super) fn check_backlash(
        &self,
        joint: &JointVariant,
        origin: &ValueSource,
    ) -> Result<(), ConfigError> {
        let key = |suffix: &str| format!("{}.{suffix}", joint.name);
        let is_positive = |key: &String| self.number(key).is_some_and(|value| value > 0.0);
        let [stiffness, _, _] = transmission_suffixes(joint.axis).map(key);
        let [presliding, _] = presliding_suffixes(joint.axis).map(key);
        let (frequency, inertia) = (key("structure.frequency_hz"), key(structure_suffix(joint.axis)));
        let gap = [key(backlash_suffix(joint.axis)), key("transmission.load_friction")];
        let present = gap.into_iter().chain([frequency.clone(), inertia.clone()]).filter(is_positive);
        for key in present {
            if !is_positive(&stiffness) {
                return Err(missing(origin, &stiffness, format!("expected it beside {key}")));
            }
            if is_positive(&presliding) {
                return Err(self.rejection(
                    &[&key, &presliding],
                    format!("not be given together: {key} and {presliding}"),
                ));
            }
        }
        match (is_positive(&frequency), is_positive(&inertia)) {
            (true, false) => Err(missing(origin, &inertia, format!("expected it beside {frequency}"))),
            (false, true) => Err(missing(origin, &frequency, format!("expected it beside {inertia}"))),
            _ => self.check_backlash_compensation(joint),
        }
    }

    /// Checks that the position controller of a compensated backlash reads the motor.
    fn check_backlash_compensation(&self, joint: &JointVariant) -> Result<(), ConfigError> {
        let width = format!("{}.{}", joint.name, compensation_suffix(joint.axis));
        let feedback = format!("{}.position_loop.feedback", joint.name);
        let reads_load = self.value(&feedback) == Some(Value::Text("load".to_owned()));
        match self.number(&width).is_some_and(|value| value > 0.0) && reads_load {
            true => Err(self.rejection(
                &[&width, &feedback],
                format!("not be given together: a scale at the load ({feedback}) sees the backlash, {width} must be 0"),
            )),
            false => Ok(()),
        }
    }

    pub(super) fn check_friction(
        &self,
        joint: &JointVariant,
        origin: &ValueSource,
    ) -> Result<(), ConfigError> {
        let [stiffness, damping] = presliding_suffixes(joint.axis).map(|key| format!("{}.{key}", joint.name));
        let is_given = |key: &str| self.number(key).is_some_and(|value| value > 0.0);
        if is_given(&damping) && !is_given(&stiffness) {
            return Err(missing(origin, &stiffness, format!("expected it above 0 beside {damping}")));
        }
        let elements = format!("{}.{PRESLIDING_ELEMENTS}", joint.name);
        let attraction = format!("{}.{}", joint.name, attraction_suffix(joint.axis));
        let has_elements = matches!(self.value(&elements), Some(Value::Integer(count)) if count > 0);
        if has_elements && !is_given(&stiffness) {
            return Err(missing(origin, &stiffness, format!("expected it above 0 beside {elements}")));
        }
        if has_elements && is_given(&damping) {
            let reason = "the generalized Maxwell-slip model has no damping";
            return Err(self.rejection(
                &[&elements, &damping],
                format!("not be given together: {elements} and {damping}; {reason}"),
            ));
        }
        if is_given(&attraction) && !has_elements {
            return Err(missing(origin, &elements, format!("expected it above 0 beside {attraction}")));
        }
        let a_key = format!("{}.friction.a", joint.name);
        let c_key = format!("{}.friction.c", joint.name);
        match (self.number(&a_key), self.number(&c_key)) {
            (Some(a), Some(c)) if a + c < 0.0 => Err(self.rejection(
                &[&a_key, &c_key],
                format!(
                    "keep a + c ≥ 0, the friction at standstill, found a = {} and c = {}",
                    number_text(a),
                    number_text(c)
                ),
            )),
            _ => Ok(()),
        }
    }
}
