//! What feedforward acts while an axis is recorded.

use virtual_axes_core::config::{Assignment, AxisConfig, Parameters, Source, Value};

/// What feedforward an axis was recorded with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FeedforwardMode {
    /// None.
    Off,
    /// Velocity feedforward.
    Velocity,
    /// Velocity and torque feedforward.
    Both,
}

impl FeedforwardMode {
    /// All of them, in the order in which they are recorded.
    pub const ALL: [FeedforwardMode; 3] =
        [FeedforwardMode::Off, FeedforwardMode::Velocity, FeedforwardMode::Both];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            FeedforwardMode::Off => "off",
            FeedforwardMode::Velocity => "velocity",
            FeedforwardMode::Both => "both",
        }
    }

    /// An axis with this much of its feedforward; friction is never compensated.
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

    /// What to set on `axis` before it is recorded so: the feedforward, as `parameters` have it or 0, and the
    /// cascade if the axis has another controller. Friction is never compensated.
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
            Some(Assignment { key, value, source: Source::named("campaign") })
        };
        parameters.iter().filter_map(of_key).collect()
    }
}
