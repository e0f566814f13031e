//! Summary of the elastic transmission.

use serde::Serialize;

use super::super::transmission::{ConfidenceInterval, TransmissionFit};
use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, MICROMETER, NEWTON_PER_MICROMETER};

/// Elastic transmission, in units at the axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransmissionSummary {
    /// Frequency of the antiresonance, Hz.
    pub antiresonance_hz: IntervalSummary,
    /// Inertia of motor and load, kg or kg·m²; none, as the next three, if the current does not tell it.
    pub total_inertia: Option<IntervalSummary>,
    /// Inertia of the load, kg or kg·m².
    pub load_inertia: Option<IntervalSummary>,
    /// Unit of the inertias.
    pub inertia_unit: &'static str,
    /// Stiffness, N/µm or N·m/rad.
    pub stiffness: Option<IntervalSummary>,
    /// Unit of the stiffness.
    pub stiffness_unit: &'static str,
    /// Damping, N·s/m or N·m·s/rad.
    pub damping: Option<IntervalSummary>,
    /// Share of the friction that acts at the load, 0 … 1; none if it is not determined.
    pub load_friction: Option<IntervalSummary>,
    /// Backlash, µm or mdeg; none if it is not seen.
    pub backlash: Option<IntervalSummary>,
    /// Backlash that is excluded, µm or mdeg; none if there is one, or if it is unknown.
    pub excluded_backlash: Option<f64>,
    /// Coefficient of determination R² of the acceleration of the load.
    pub r_squared: f64,
}

/// Value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntervalSummary {
    /// Value.
    pub value: f64,
    /// Bounds of the interval.
    pub interval: [f64; 2],
}

impl TransmissionSummary {
    /// Returns the unit of the damping.
    pub fn damping_unit(&self) -> &'static str {
        if self.inertia_unit == "kg" { "N.s/m" } else { "N.m.s/rad" }
    }

    pub(super) fn new(fit: &TransmissionFit, kind: AxisKind) -> Self {
        let (inertia_unit, stiffness_unit, stiffness, length) = match kind {
            AxisKind::Linear => ("kg", "N/um", NEWTON_PER_MICROMETER, MICROMETER),
            AxisKind::Rotary => ("kg.m2", "N.m/rad", 1.0, 1e-3 * DEGREE),
        };
        let scaled = |found: ConfidenceInterval, unit: f64| IntervalSummary {
            value: found.value / unit,
            interval: found.bounds.map(|bound| bound / unit),
        };
        let masses = fit.masses.as_ref();
        TransmissionSummary {
            antiresonance_hz: scaled(fit.antiresonance, 1.0),
            total_inertia: masses.map(|masses| scaled(masses.total, 1.0)),
            load_inertia: masses.map(|masses| scaled(masses.load, 1.0)),
            inertia_unit,
            stiffness: masses.map(|masses| scaled(masses.stiffness, stiffness)),
            stiffness_unit,
            damping: masses.and_then(|masses| masses.damping).map(|damping| scaled(damping, 1.0)),
            load_friction: masses.and_then(|masses| masses.load_friction).map(|share| scaled(share, 1.0)),
            backlash: fit.backlash.map(|gap| scaled(gap, length)),
            excluded_backlash: fit.excluded_backlash.map(|bound| bound / length),
            r_squared: fit.r_squared,
        }
    }
}
