//! Conversion of checked parameters in CNC units to a [`MachineConfig`] in SI units.

use std::f64::consts::TAU;

use super::check::to_ns;
use super::coupling::{GantryConfig, WorkpieceConfig};
use super::coupling_check::{
    CENTER_OF_MASS, CONTOUR_GAIN, GANTRY_AXES, GANTRY_DAMPING, GANTRY_STIFFNESS, MOMENTS, WORKPIECE_MASS,
};
use super::definition::MotorKind;
use super::error::{ConfigError, ValueSource};
use super::layout::JointVariant;
use super::machine::{
    AxisConfig, AxisKind, BacklashCompensationConfig, CurrentFilterConfig, DelaysConfig, DeviationConfig,
    FeedforwardConfig, GpcConfig, KinematicsConfig, LimitsConfig, MachineConfig, Periods, PiConfig,
    PositionControllerConfig, PositionFeedback, PositionLoopConfig, RstConfig,
};
use super::parameters::Parameters;
use super::plant::{
    FrictionConfig, GravityConfig, MotorConfig, PreslidingConfig, StribeckConfig, StructureConfig,
    TransmissionConfig,
};
use super::plant_keys::{
    PRESLIDING_ELEMENTS, attraction_suffix, backlash_suffix, compensation_suffix, gap_unit,
    presliding_suffixes, stiffness_unit, structure_suffix, transmission_suffixes,
};
use super::value::Value;
use crate::units::{
    DEGREE, METER_PER_MINUTE, MICROSECOND_NS, MILLIHENRY, MILLIMETER, MILLISECOND, MILLISECOND_NS,
    NEWTON_PER_MICROMETER, POSITION_GAIN, REVOLUTION, RPM,
};

impl Parameters {
    /// Returns the machine configuration in SI units.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Missing`] for a missing parameter, which cannot happen in a checked parameter set.
    pub fn machine_config(&self) -> Result<MachineConfig, ConfigError> {
        let period = |key, factor| Ok(to_ns(self.number(key)?, factor));
        Ok(MachineConfig {
            name: self.text("machine"),
            periods: Periods {
                position: period("periods.position_ms", MILLISECOND_NS)?,
                velocity: period("periods.velocity_us", MICROSECOND_NS)?,
                current: period("periods.current_us", MICROSECOND_NS)?,
            },
            kinematics: self.kinematics_config()?,
            axes: self
                .layout()
                .joints
                .iter()
                .map(|joint| AxisParameters { set: self, joint }.config())
                .collect::<Result<_, _>>()?,
            contour_gain: self.number(CONTOUR_GAIN)? * POSITION_GAIN,
            workpiece: self.workpiece_config()?,
            gantry: self.gantry_config()?,
        })
    }

    /// Returns the workpiece on the tables; `None` without a mass.
    fn workpiece_config(&self) -> Result<Option<WorkpieceConfig>, ConfigError> {
        let mass = self.number(WORKPIECE_MASS)?;
        let numbers = |keys: [&str; 3], unit: f64| -> Result<[f64; 3], ConfigError> {
            let [x, y, z] = keys.map(|key| self.number(key));
            Ok([x? * unit, y? * unit, z? * unit])
        };
        let (center_of_mass, moments) = (numbers(CENTER_OF_MASS, MILLIMETER)?, numbers(MOMENTS, 1.0)?);
        Ok((mass > 0.0).then_some(WorkpieceConfig { mass, center_of_mass, moments }))
    }

    /// Returns the gantry; `None` without its axes.
    fn gantry_config(&self) -> Result<Option<GantryConfig>, ConfigError> {
        let Some(Value::TextList(names)) = self.get(GANTRY_AXES) else { return Ok(None) };
        let index = |name: &String| self.layout().joints.iter().position(|joint| joint.name == *name);
        let indices: Vec<usize> = names.iter().filter_map(index).collect();
        let Ok(axes) = <[usize; 2]>::try_from(indices) else {
            return Err(self.missing(GANTRY_AXES, "two linear joints"));
        };
        Ok(Some(GantryConfig {
            axes,
            stiffness: self.number(GANTRY_STIFFNESS)? * NEWTON_PER_MICROMETER,
            damping: self.number(GANTRY_DAMPING)?,
        }))
    }

    fn kinematics_config(&self) -> Result<KinematicsConfig, ConfigError> {
        let distance = |name: &str| Ok(self.number(&format!("kinematics.{name}_mm"))? * MILLIMETER);
        Ok(KinematicsConfig {
            tool_length: distance("tool_length")?,
            pivot_a: [distance("pivot_a_y")?, distance("pivot_a_z")?],
            pivot_c: [distance("pivot_c_x")?, distance("pivot_c_y")?],
            workpiece: [distance("workpiece_x")?, distance("workpiece_y")?, distance("workpiece_z")?],
        })
    }

    pub(super) fn number(&self, key: &str) -> Result<f64, ConfigError> {
        match self.get(key) {
            Some(Value::Double(number)) => Ok(number),
            _ => Err(self.missing(key, "number")),
        }
    }

    fn missing(&self, key: &str, wanted: &str) -> ConfigError {
        ConfigError::Missing {
            at: ValueSource::named("parameters"),
            key: key.to_owned(),
            wanted: wanted.to_owned(),
        }
    }

    pub(super) fn text(&self, key: &str) -> String {
        match self.get(key) {
            Some(Value::Text(text)) => text,
            _ => String::new(),
        }
    }

    pub(super) fn flag(&self, key: &str) -> bool {
        self.get(key) == Some(Value::Bool(true))
    }
}

/// Parameters of one axis.
struct AxisParameters<'a> {
    set: &'a Parameters,
    joint: &'a JointVariant,
}

impl AxisParameters<'_> {
    fn key(&self, suffix: &str) -> String {
        format!("{}.{suffix}", self.joint.name)
    }

    fn number(&self, suffix: &str) -> Result<f64, ConfigError> {
        self.set.number(&self.key(suffix))
    }

    /// Returns the number multiplied by `factor`, its unit in SI units.
    fn scaled(&self, suffix: &str, factor: f64) -> Result<f64, ConfigError> {
        Ok(self.number(suffix)? * factor)
    }

    /// Returns the number, or 0 for a parameter that does not apply to this type of axis.
    fn or_zero(&self, suffix: &str) -> f64 {
        self.number(suffix).unwrap_or_default()
    }

    fn config(&self) -> Result<AxisConfig, ConfigError> {
        let pi = |name: &str| -> Result<PiConfig, ConfigError> {
            Ok(PiConfig {
                gain: self.number(&format!("{name}.gain"))?,
                integral_time: self.scaled(&format!("{name}.integral_time_ms"), MILLISECOND)?,
            })
        };
        let delay = |suffix| Ok(to_ns(self.number(suffix)?, MILLISECOND_NS));
        Ok(AxisConfig {
            name: self.joint.name.clone(),
            kind: self.joint.axis,
            transmission_ratio: self.transmission_ratio()?,
            transmission: self.transmission()?,
            motor: self.motor()?,
            friction: FrictionConfig {
                a: self.number("friction.a")?,
                b: self.number("friction.b")?,
                c: self.number("friction.c")?,
                d: self.number("friction.d")?,
                i0: self.number("friction.i0")?,
            },
            stribeck: StribeckConfig {
                current: self.number("friction.stribeck")?,
                velocity: match self.joint.axis {
                    AxisKind::Linear => self.number("friction.stribeck_velocity_m_min")?,
                    AxisKind::Rotary => self.number("friction.stribeck_velocity_rpm")?,
                },
                viscous: self.number("friction.viscous")?,
            },
            presliding: self.presliding()?,
            gravity: GravityConfig {
                weight: self.or_zero("gravity.weight_n"),
                tilt: self.or_zero("gravity.tilt_nm"),
                phase: self.or_zero("gravity.tilt_phase_deg") * DEGREE,
            },
            position_loop: PositionLoopConfig {
                gain: self.scaled("position_loop.gain", POSITION_GAIN)?,
                controller: self.position_controller()?,
                feedback: match self.set.text(&self.key("position_loop.feedback")).as_str() {
                    "load" => PositionFeedback::Load,
                    _ => PositionFeedback::Motor,
                },
                backlash_compensation: self.backlash_compensation()?,
                allow_unstable: self.set.flag(&self.key("position_loop.allow_unstable")),
            },
            velocity_loop: pi("velocity_loop")?,
            current_filters: [
                self.current_filter("current_filter_1")?,
                self.current_filter("current_filter_2")?,
            ],
            current_loop: pi("current_loop")?,
            feedforward: FeedforwardConfig {
                velocity: self.number("feedforward.velocity")?,
                torque: self.number(self.by_motor("feedforward.torque_kg_m2", "feedforward.torque_kg"))?,
                friction: self.number("feedforward.friction")?,
            },
            delays: DelaysConfig {
                alpha: delay("delays.alpha_ms")?,
                beta: delay("delays.beta_ms")?,
                gamma: delay("delays.gamma_ms")?,
                friction: delay("delays.friction_ms")?,
            },
            deviation: DeviationConfig {
                inertia: self.number("deviation.inertia")?,
                friction: self.number("deviation.friction")?,
                torque_constant: self.number("deviation.torque_constant")?,
            },
            limits: self.limits()?,
        })
    }

    /// Returns a filter of the current setpoint; `None` for the type none.
    fn current_filter(&self, name: &str) -> Result<Option<CurrentFilterConfig>, ConfigError> {
        let number = |key: &str| self.number(&format!("{name}.{key}"));
        Ok(match self.set.text(&self.key(&format!("{name}.type"))).as_str() {
            "low_pass" => Some(CurrentFilterConfig::LowPass {
                frequency: number("frequency_hz")?,
                damping: number("damping")?,
            }),
            "notch" => Some(CurrentFilterConfig::Notch {
                frequency: number("frequency_hz")?,
                bandwidth: number("bandwidth_hz")?,
                gain: 10_f64.powf(-number("depth_db")? / 20.0),
            }),
            _ => None,
        })
    }

    fn position_controller(&self) -> Result<PositionControllerConfig, ConfigError> {
        Ok(match self.set.text(&self.key("position_loop.controller")).as_str() {
            "gpc" => PositionControllerConfig::Gpc(GpcConfig {
                n1: self.count("position_loop.gpc.n1")?,
                n2: self.count("position_loop.gpc.n2")?,
                nu: self.count("position_loop.gpc.nu")?,
                lambda_rel: self.number("position_loop.gpc.lambda_rel")?,
                lambda: self.number("position_loop.gpc.lambda").ok(),
            }),
            "rst" => PositionControllerConfig::Rst(RstConfig {
                r: self.numbers("position_loop.rst.r")?,
                s: self.numbers("position_loop.rst.s")?,
                t: self.numbers("position_loop.rst.t")?,
                t_first: match self.set.get(&self.key("position_loop.rst.t_first")) {
                    Some(Value::Integer(exponent)) => exponent,
                    _ => 0,
                },
            }),
            _ => PositionControllerConfig::Cascade,
        })
    }

    fn numbers(&self, suffix: &str) -> Result<Vec<f64>, ConfigError> {
        let key = self.key(suffix);
        match self.set.get(&key) {
            Some(Value::DoubleList(numbers)) => Ok(numbers),
            _ => Err(self.set.missing(&key, "list of numbers, since position_loop.controller = rst")),
        }
    }

    fn count(&self, suffix: &str) -> Result<usize, ConfigError> {
        let key = self.key(suffix);
        match self.set.get(&key) {
            Some(Value::Integer(count)) => Ok(usize::try_from(count).unwrap_or(0)),
            _ => Err(self.set.missing(&key, "integer")),
        }
    }

    fn by_motor<T>(&self, rotary: T, linear: T) -> T {
        match self.joint.motor {
            MotorKind::Rotary => rotary,
            MotorKind::Linear => linear,
        }
    }

    /// Returns the transmission ratio r: axis travel (m or rad) per motor travel (rad or m).
    fn transmission_ratio(&self) -> Result<f64, ConfigError> {
        let direct = self.set.flag(&self.key("transmission.direct"));
        Ok(match self.joint.axis {
            _ if direct => 1.0,
            AxisKind::Linear => self.scaled("transmission.screw_lead_mm", MILLIMETER)? / TAU,
            AxisKind::Rotary => 1.0 / self.number("transmission.gear_ratio")?,
        })
    }

    /// Returns the elastic transmission in units of the motor; `None` without a stiffness.
    fn transmission(&self) -> Result<Option<TransmissionConfig>, ConfigError> {
        let [stiffness, damping, load_inertia] = transmission_suffixes(self.joint.axis);
        let (Ok(stiffness), ratio) = (self.number(stiffness), self.transmission_ratio()?) else {
            return Ok(None);
        };
        Ok(Some(TransmissionConfig {
            stiffness: stiffness * stiffness_unit(self.joint.axis) * ratio * ratio,
            damping: self.or_zero(damping) * ratio * ratio,
            load_inertia: self.number(load_inertia)? * ratio * ratio,
            backlash: self.scaled(backlash_suffix(self.joint.axis), gap_unit(self.joint.axis))? / ratio,
            load_friction: self.number("transmission.load_friction")?,
            structure: self.structure(ratio)?,
        }))
    }

    /// Returns the structure in units of the motor; `None` without a frequency.
    fn structure(&self, ratio: f64) -> Result<Option<StructureConfig>, ConfigError> {
        let Ok(frequency) = self.number("structure.frequency_hz") else { return Ok(None) };
        Ok(Some(StructureConfig {
            inertia: self.number(structure_suffix(self.joint.axis))? * ratio * ratio,
            frequency: frequency * TAU,
            damping_ratio: self.number("structure.damping_ratio")?,
            carries_motor: self.set.flag(&self.key("transmission.direct")),
        }))
    }

    fn backlash_compensation(&self) -> Result<BacklashCompensationConfig, ConfigError> {
        let kind = self.joint.axis;
        Ok(BacklashCompensationConfig {
            width: self.scaled(compensation_suffix(kind), gap_unit(kind))?,
            velocity: match kind {
                AxisKind::Linear => self.scaled("backlash_compensation.velocity_m_min", METER_PER_MINUTE)?,
                AxisKind::Rotary => self.scaled("backlash_compensation.velocity_rpm", RPM)?,
            },
        })
    }

    /// Returns the presliding in units of the motor; `None` without a stiffness.
    fn presliding(&self) -> Result<Option<PreslidingConfig>, ConfigError> {
        let [stiffness, damping] = presliding_suffixes(self.joint.axis);
        let (stiffness, ratio) = (self.or_zero(stiffness), self.transmission_ratio()?);
        let elements = self.count(PRESLIDING_ELEMENTS)?;
        let attraction = self.or_zero(attraction_suffix(self.joint.axis));
        Ok((stiffness > 0.0).then(|| PreslidingConfig {
            stiffness: stiffness * stiffness_unit(self.joint.axis) * ratio * ratio,
            damping: self.or_zero(damping) * ratio * ratio,
            elements,
            attraction: (attraction > 0.0).then_some(attraction * ratio),
        }))
    }

    fn motor(&self) -> Result<MotorConfig, ConfigError> {
        let inertia = self.by_motor("motor.inertia_kg_m2", "motor.mass_kg");
        let torque = self.by_motor("motor.torque_constant_nm_a", "motor.force_constant_n_a");
        let emf = self.by_motor("motor.emf_constant_v_s_rad", "motor.emf_constant_v_s_m");
        let (speed, speed_unit) =
            self.by_motor(("motor.max_speed_rpm", RPM), ("motor.max_speed_m_min", METER_PER_MINUTE));
        Ok(MotorConfig {
            inertia: self.number(inertia)?,
            torque_constant: self.number(torque)?,
            emf_constant: self.number(emf)?,
            resistance: self.number("motor.resistance_ohm")?,
            inductance: self.scaled("motor.inductance_mh", MILLIHENRY)?,
            max_current: self.number("motor.max_current_a")?,
            max_voltage: self.number("motor.max_voltage_v")?,
            max_speed: self.scaled(speed, speed_unit)?,
        })
    }

    fn limits(&self) -> Result<LimitsConfig, ConfigError> {
        // An omitted travel limit is unlimited.
        let end = |suffix, unit, none: f64| self.scaled(suffix, unit).unwrap_or(none);
        Ok(match self.joint.axis {
            AxisKind::Linear => LimitsConfig {
                velocity: self.scaled("limits.velocity_m_min", METER_PER_MINUTE)?,
                acceleration: self.number("limits.acceleration_m_s2")?,
                jerk: self.number("limits.jerk_m_s3")?,
                travel_min: end("limits.travel_min_mm", MILLIMETER, f64::NEG_INFINITY),
                travel_max: end("limits.travel_max_mm", MILLIMETER, f64::INFINITY),
            },
            AxisKind::Rotary => LimitsConfig {
                velocity: self.scaled("limits.velocity_rpm", RPM)?,
                acceleration: self.scaled("limits.acceleration_rev_s2", REVOLUTION)?,
                jerk: self.scaled("limits.jerk_rev_s3", REVOLUTION)?,
                travel_min: end("limits.travel_min_deg", DEGREE, f64::NEG_INFINITY),
                travel_max: end("limits.travel_max_deg", DEGREE, f64::INFINITY),
            },
        })
    }
}
