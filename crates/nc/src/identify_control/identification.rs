//! Identified profile of a control.

use super::control_estimate::ControlEstimate;

/// Identified parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlValue {
    /// Key of the parameter.
    pub key: String,
    /// Value, in the unit of the parameter.
    pub value: f64,
    /// Half width of its interval of 95 %.
    pub half_width: f64,
    /// Unit.
    pub unit: &'static str,
    /// Number of motions that show it.
    pub count: usize,
}

/// Profile of a control.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ControlIdentification {
    /// Numbers.
    pub values: Vec<ControlValue>,
    /// Choices: key, value and reason.
    pub choices: Vec<(String, String, String)>,
    /// Properties that the program cannot show, each with the remedy.
    pub not_shown: Vec<String>,
    /// Time from the first to the last motion in the log, s.
    pub motion_time: f64,
    /// Number of motions of the program.
    pub motions: usize,
    /// Causes for which values can be wrong.
    pub warnings: Vec<String>,
}

impl ControlValue {
    /// Returns the magnitude to which relative uncertainties apply: that of the acceleration which remains beside a corner.
    pub(super) fn magnitude(&self) -> f64 {
        if self.key == "control.kink_fraction" { 1.0 - self.value } else { self.value }
    }

    /// Returns true if the interval excludes values without meaning. A wait can be 0.
    pub(super) fn is_identified(&self) -> bool {
        self.half_width < self.magnitude() || (self.key == "control.wait_ms" && self.half_width.is_finite())
    }
}

impl ControlIdentification {
    pub(super) fn push(
        &mut self,
        key: impl Into<String>,
        estimate: ControlEstimate,
        factor: f64,
        unit: &'static str,
    ) {
        self.values.push(ControlValue {
            key: key.into(),
            value: estimate.value / factor,
            half_width: estimate.half_width / factor,
            unit,
            count: estimate.count,
        });
    }
}
