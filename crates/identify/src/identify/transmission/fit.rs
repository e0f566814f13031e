//! Identified values of a transmission, with their intervals.

use virtual_axes_core::config::{AxisConfig, TransmissionConfig};

/// Largest half of a 95 % interval, relative to the value.
const UNCERTAIN: f64 = 0.5;
/// Largest half of the 95 % interval of the share of friction at the load.
const UNCERTAIN_SHARE: f64 = 0.25;
/// Standard errors of a 95 % interval.
pub(super) const INTERVAL: f64 = 1.96;

/// Value with the bounds of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConfidenceInterval {
    /// Value.
    pub value: f64,
    /// Bounds.
    pub bounds: [f64; 2],
}

impl ConfidenceInterval {
    /// Creates an interval that is symmetric about the value.
    pub(super) fn about(value: f64, half: f64) -> Self {
        ConfidenceInterval { value, bounds: [value - half, value + half] }
    }

    /// Returns the standard deviation of a normal distribution with the width of the interval.
    pub fn error(&self) -> f64 {
        (self.bounds[1] - self.bounds[0]) / (2.0 * INTERVAL)
    }

    /// Returns the interval within 0 … 1; none if it is too wide, or outside.
    pub(super) fn as_share(self) -> Option<Self> {
        let [low, high] = self.bounds;
        let is_share = high - low <= 2.0 * UNCERTAIN_SHARE && low <= 1.0 && high >= 0.0;
        let within = |x: f64| x.clamp(0.0, 1.0);
        is_share.then(|| ConfidenceInterval { value: within(self.value), bounds: self.bounds.map(within) })
    }

    pub(super) fn is_certain(&self) -> bool {
        self.bounds[1] - self.bounds[0] <= 2.0 * UNCERTAIN * self.value
    }
}

/// Identified transmission of an axis, in SI units at the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct TransmissionFit {
    /// Frequency of the antiresonance √(k/Ml)/2π, Hz.
    pub antiresonance: ConfidenceInterval,
    /// Masses and the values that need them; none if the recordings tell the antiresonance only.
    pub masses: Option<MassesFit>,
    /// Width of the gap, m or rad; none if it is not above 0.
    pub backlash: Option<ConfidenceInterval>,
    /// Width of the gap that is excluded, m or rad; none with an identified gap, or if the width is unknown.
    pub excluded_backlash: Option<f64>,
    /// Coefficient of determination R² of the acceleration of the load.
    pub r_squared: f64,
}

/// Values of a transmission that need the inertia of the load, in SI units at the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct MassesFit {
    /// Inertia of the load Ml, kg or kg·m².
    pub load: ConfidenceInterval,
    /// Inertia of motor and load, kg or kg·m².
    pub total: ConfidenceInterval,
    /// Stiffness k, N/m or N·m/rad.
    pub stiffness: ConfidenceInterval,
    /// Damping d, N·s/m or N·m·s/rad; none if it is not above 0.
    pub damping: Option<ConfidenceInterval>,
    /// Share of the friction that acts at the load, 0 … 1; none if the recordings do not determine it.
    pub load_friction: Option<ConfidenceInterval>,
}

impl MassesFit {
    /// Returns the share of the friction at the load, 0 if its interval contains 0; none if it is not determined.
    pub(in crate::identify) fn load_friction_share(&self) -> Option<f64> {
        self.load_friction.map(|share| if share.bounds[0] > 0.0 { share.value } else { 0.0 })
    }
}

impl TransmissionFit {
    /// Sets the transmission of an axis, if the masses were identified; what is not determined is unchanged.
    pub(in crate::identify) fn apply(&self, axis: &mut AxisConfig) {
        let Some(masses) = &self.masses else { return };
        let (ratio, before) = (axis.transmission_ratio, axis.transmission);
        let square = ratio * ratio;
        let kept = |of: fn(&TransmissionConfig) -> f64| before.as_ref().map_or(0.0, of);
        let backlash = self.backlash.map(|gap| gap.value / ratio).or(self.excluded_backlash.map(|_| 0.0));
        axis.transmission = Some(TransmissionConfig {
            stiffness: masses.stiffness.value * square,
            damping: masses.damping.map_or(kept(|t| t.damping), |damping| damping.value * square),
            load_inertia: masses.load.value * square,
            backlash: backlash.unwrap_or(kept(|t| t.backlash)),
            load_friction: masses.load_friction_share().unwrap_or(kept(|t| t.load_friction)),
            structure: before.and_then(|before| before.structure),
        });
    }
}
