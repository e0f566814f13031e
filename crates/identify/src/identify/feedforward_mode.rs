//! Feedforward mode of a recording.

use serde::Serialize;
use virtual_axes_core::config::{Assignment, AxisConfig, Parameters, Value, ValueSource};

/// Feedforward that was active during a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FeedforwardMode {
    /// No feedforward.
    Off,
    /// Velocity feedforward.
    Velocity,
    /// Velocity and torque feedforward.
    Both,
}

impl FeedforwardMode {
    /// All modes in recording order.
    pub const ALL: [FeedforwardMode; 3] =
        [FeedforwardMode::Off, FeedforwardMode::Velocity, FeedforwardMode::Both];

    /// Returns the name used on the command line.
    pub fn name(self) -> &'static str {
        match self {
            FeedforwardMode::Off => "off",
            FeedforwardMode::Velocity => "velocity",
            FeedforwardMode::Both => "both",
        }
    }

    /// Returns a copy of an axis with this feedforward mode; friction compensation is off.
    pub(super) fn of(self, axis: &AxisConfig) -> AxisConfig {
        let mut axis = axis.clone();
        axis.feedforward.friction = 0.0;
        if self == FeedforwardMode::Off {
            axis.feedforward.velocity = 0.0;
        }
        if self != FeedforwardMode::Both {
            axis.feedforward.torque = 0.0;
        }
        axis
    }

    /// Returns the assignments that prepare `axis` for a recording in this mode: feedforward weights of
    /// `parameters` or 0, cascade controller, friction compensation off.
    pub fn assignments(self, parameters: &Parameters, axis: &str) -> Vec<Assignment> {
        let of_key = |(key, value): (String, Value)| {
            let name = key.strip_prefix(axis)?.strip_prefix('.')?;
            let value = match name.strip_prefix("feedforward.") {
                Some("velocity") if self != FeedforwardMode::Off => value,
                Some(torque) if torque.starts_with("torque_") && self == FeedforwardMode::Both => value,
                Some(_) => Value::Double(0.0),
                None if name == "position_loop.controller" && value != Value::Text("cascade".to_owned()) => {
                    Value::Text("cascade".to_owned())
                }
                None => return None,
            };
            Some(Assignment { key, value, source: ValueSource::named("campaign") })
        };
        parameters.iter().filter_map(of_key).collect()
    }
}
