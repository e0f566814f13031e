//! Channels of a recording and their units.

use std::fmt;

use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::{DEGREE, INCH, METER_PER_MINUTE, MILLIMETER, MILLISECOND, MINUTE, RPM};

virtual_axes_core::named_values! {
    /// Channels of a recording of an axis, as in [`RawRecording`](virtual_axes_identify::recording::RawRecording), with
    /// the names in column mappings. Only time and position are required.
    pub enum Channel {
        /// Time stamp.
        Time = "time",
        /// Position setpoint at the entrance of the controller.
        Psec = "psec",
        /// Actual position.
        Position = "position",
        /// Actual velocity of the axis.
        Velocity = "velocity",
        /// Motor current.
        Current = "current",
        /// Motor torque, beside the current.
        Torque = "torque",
        /// Velocity feedforward (VFFWS).
        VelocityFeedforward = "velocity_feedforward",
        /// Torque feedforward (TFFWS).
        TorqueFeedforward = "torque_feedforward",
        /// Position of the motor at the axis, beside that of the load.
        MotorPosition = "motor_position",
        /// Position of the motor at the axis minus that of the load.
        WindUp = "wind_up",
    }
}

impl Channel {
    /// Returns true if every recording must have the channel.
    pub(super) fn is_required(self) -> bool {
        matches!(self, Channel::Time | Channel::Position)
    }

    /// Returns the symbols of the units of the channel for all types of axes.
    pub(super) const fn symbols(self) -> &'static [&'static str] {
        match self {
            Channel::Time => &["s", "ms", "us", "ns"],
            Channel::Psec | Channel::Position | Channel::MotorPosition | Channel::WindUp => {
                &["m", "mm", "um", "in", "rad", "deg", "mdeg"]
            }
            Channel::Velocity => {
                &["m/s", "mm/s", "m/min", "mm/min", "in/s", "in/min", "rad/s", "deg/s", "deg/min", "rpm"]
            }
            Channel::VelocityFeedforward => {
                &["rad/s", "rpm", "m/s", "mm/s", "m/min", "mm/min", "in/s", "in/min"]
            }
            Channel::Current => &["A", "mA", "N.m", "N"],
            Channel::Torque => &["N.m", "N"],
            Channel::TorqueFeedforward => &["N.m", "N", "A", "mA"],
        }
    }

    /// Returns the SI units of the channel for linear and rotary axes, for messages.
    pub(super) const fn si_units(self) -> &'static str {
        match self {
            Channel::Time => "s",
            Channel::Psec | Channel::Position | Channel::MotorPosition | Channel::WindUp => "m or rad",
            Channel::Velocity => "m/s or rad/s",
            Channel::Current => "A",
            Channel::VelocityFeedforward => "rad/s of the motor",
            Channel::Torque | Channel::TorqueFeedforward => "N.m",
        }
    }

    /// Returns the allowed units for `axis` with their factors to SI; the SI unit comes first.
    pub(super) fn units(self, axis: &AxisConfig) -> Vec<(&'static str, f64)> {
        let linear = axis.kind == AxisKind::Linear;
        let ratio = axis.transmission_ratio;
        let constant = axis.motor.torque_constant;
        // A transmission ratio of 1 m/rad is a linear motor.
        let linear_motor = linear && ratio == 1.0;
        let speeds = || if linear { LINEAR_SPEEDS.to_vec() } else { ANGULAR_SPEEDS.to_vec() };
        // Motor torque: N·m at the shaft, or N on the axis.
        let mut torques = Vec::new();
        if !linear_motor {
            torques.push(("N.m", 1.0));
        }
        if linear {
            torques.push(("N", ratio));
        }
        let scaled = |units: &[(&'static str, f64)], by: f64| -> Vec<(&'static str, f64)> {
            units.iter().map(|(symbol, factor)| (*symbol, factor * by)).collect()
        };
        match self {
            Channel::Time => vec![("s", 1.0), ("ms", MILLISECOND), ("us", MICRO), ("ns", NANO)],
            Channel::Psec | Channel::Position | Channel::MotorPosition | Channel::WindUp => match linear {
                true => vec![("m", 1.0), ("mm", MILLIMETER), ("um", MICRO), ("in", INCH)],
                false => vec![("rad", 1.0), ("deg", DEGREE), ("mdeg", DEGREE * MILLI)],
            },
            Channel::Velocity => speeds(),
            Channel::Current => [CURRENTS.to_vec(), scaled(&torques, 1.0 / constant)].concat(),
            Channel::VelocityFeedforward if linear_motor => speeds(),
            Channel::VelocityFeedforward => {
                let mut units = vec![("rad/s", 1.0), ("rpm", RPM)];
                if linear {
                    units.extend(scaled(&LINEAR_SPEEDS, 1.0 / ratio));
                }
                units
            }
            Channel::Torque => torques,
            Channel::TorqueFeedforward => [torques, scaled(&CURRENTS, constant)].concat(),
        }
    }
}

/// SI prefix m.
const MILLI: f64 = 1e-3;
/// SI prefix µ.
const MICRO: f64 = 1e-6;
/// SI prefix n.
const NANO: f64 = 1e-9;

/// Units of the velocity of a linear axis, with factors to m/s.
const LINEAR_SPEEDS: [(&str, f64); 6] = [
    ("m/s", 1.0),
    ("mm/s", MILLIMETER),
    ("m/min", METER_PER_MINUTE),
    ("mm/min", MILLIMETER / MINUTE),
    ("in/s", INCH),
    ("in/min", INCH / MINUTE),
];
/// Units of the velocity of a rotary axis, with factors to rad/s.
const ANGULAR_SPEEDS: [(&str, f64); 4] =
    [("rad/s", 1.0), ("deg/s", DEGREE), ("deg/min", DEGREE / MINUTE), ("rpm", RPM)];
/// Units of the current, with factors to A.
const CURRENTS: [(&str, f64); 2] = [("A", 1.0), ("mA", MILLI)];

/// Symbols of all units except N.m.
const SYMBOLS: [&str; 24] = [
    "s", "ms", "us", "ns", "m", "mm", "um", "in", "rad", "deg", "mdeg", "m/s", "mm/s", "m/min", "mm/min",
    "in/s", "in/min", "rad/s", "deg/s", "deg/min", "rpm", "A", "mA", "N",
];
/// Alternative spellings of symbols.
const SPELLINGS: [(&str, &str); 12] = [
    ("N.m", "N.m"),
    ("Nm", "N.m"),
    ("N·m", "N.m"),
    ("µs", "us"),
    ("μs", "us"),
    ("µm", "um"),
    ("μm", "um"),
    ("°", "deg"),
    ("°/s", "deg/s"),
    ("°/min", "deg/min"),
    ("rev/min", "rpm"),
    ("1/min", "rpm"),
];

/// Spellings of symbols in headers, in addition to [`SPELLINGS`].
const HEADER_SPELLINGS: [(&str, &str); 20] = [
    ("sec", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("usec", "us"),
    ("inch", "in"),
    ("inches", "in"),
    ("inch/min", "in/min"),
    ("ipm", "in/min"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("Grad", "deg"),
    ("U/min", "rpm"),
    ("r/min", "rpm"),
    ("min-1", "rpm"),
    ("min^-1", "rpm"),
    ("RPM", "rpm"),
    ("Ampere", "A"),
    ("amps", "A"),
    ("N m", "N.m"),
    ("N*m", "N.m"),
];

/// Unit of a column: `factor` times the unit `symbol`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unit {
    pub factor: f64,
    pub symbol: &'static str,
}

impl Unit {
    /// Parses the text between the brackets: an optional factor and a symbol.
    ///
    /// # Errors
    /// Returns the reason if the factor or the symbol is invalid.
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let (factor, symbol) = match text.split_once(char::is_whitespace) {
            Some((factor, symbol)) => (Some(factor), symbol.trim()),
            None => (None, text),
        };
        let factor = match factor {
            None => 1.0,
            Some(factor) => factor
                .parse()
                .ok()
                .filter(|factor: &f64| factor.is_finite() && *factor != 0.0)
                .ok_or_else(|| {
                format!("the factor is \"{}\", must be a finite number other than 0", shortened(factor))
            })?,
        };
        let known = SYMBOLS.iter().map(|symbol| (*symbol, *symbol)).chain(SPELLINGS);
        match known.clone().find(|(spelling, _)| *spelling == symbol) {
            Some((_, symbol)) => Ok(Unit { factor, symbol }),
            None => Err(format!(
                "unknown unit \"{}\"; known are {}, N.m, each with an optional factor: [0.1 um]",
                shortened(symbol),
                SYMBOLS.join(", ")
            )),
        }
    }
}

impl Unit {
    /// Returns the unit of a header: the text between its brackets, or its last words joined by `/`.
    pub fn from_header(text: &str) -> Option<Self> {
        let text = text.trim();
        let spelling = HEADER_SPELLINGS.into_iter().find(|(spelling, _)| *spelling == text);
        match spelling {
            Some((_, symbol)) => Some(Unit { factor: 1.0, symbol }),
            None => Unit::parse(text).ok(),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.factor != 1.0 {
            write!(f, "{} ", self.factor)?;
        }
        f.write_str(self.symbol)
    }
}
