//! Result of an identification.

use super::delays::DelayFit;
use super::experiment::CurrentLogging;
use super::feedforward::FeedforwardFit;
use super::feedforward_mode::FeedforwardMode;
use super::friction::FrictionFit;
use super::gravity::{GravityFit, SteadyMeasurements};
use super::inertia::InertiaFit;
use super::presliding::PreslidingFit;
use super::refine::{RefinedParameter, Refinement};
use super::transmission::{ConfidenceInterval, TransmissionFit};
use super::validate::Agreement;
use crate::recording::Finding;
use virtual_axes_core::config::{AxisConfig, Periods};

/// Result of an identification.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// Axis parameters before the identification.
    pub initial: AxisConfig,
    /// Identified axis parameters.
    pub(crate) axis: AxisConfig,
    /// Mean currents at constant velocity and at rest.
    pub steady: SteadyMeasurements,
    /// Identified gravity.
    pub gravity: Option<GravityFit>,
    /// Identified friction.
    pub friction: Option<FrictionFit>,
    /// Inertia by Prévost eq. 5.
    pub inertia: Option<InertiaFit>,
    /// Inertia by eq. 5 from the simulation of the identified axis, sampled like the recordings.
    ///
    /// If it agrees with the inertia by eq. 5 from the recordings, but both differ from the identified
    /// inertia, the current varies between the samples.
    pub replayed_inertia: Option<f64>,
    /// Presliding of the friction, from reversals.
    pub presliding: Option<PreslidingFit>,
    /// Stiffness σ0 of the presliding at the axis, N/m or N·m/rad, below which the recordings exclude it; none if the
    /// presliding was identified or not searched for.
    pub excluded_presliding: Option<f64>,
    /// Elastic transmission, from recordings with both encoders.
    pub transmission: Option<TransmissionFit>,
    /// VFFW and TFFW by regression.
    pub feedforward: FeedforwardFit,
    /// Identified delays α, β, γ.
    pub delays: Vec<DelayFit>,
    /// Closed-loop refinement.
    pub refinement: Option<Refinement>,
    /// Agreement of the identified axis with each recording.
    pub agreements: Vec<Agreement>,
    /// Periods, if the recordings require another position cycle than that of the machine file.
    pub periods: Option<Periods>,
    /// Active feedforward of each recording, if it was given, recorded or found by the closed loop of any program.
    pub active_feedforward: Vec<FeedforwardMode>,
    /// Torque constant, N·m/A (force constant, N/A), from recorded torque and current, with its standard error.
    pub torque_constant: Option<(f64, f64)>,
    /// Logging of the current; none if it was not identified.
    pub current_logging: Option<CurrentLogging>,
    /// Findings.
    pub findings: Vec<Finding>,
}

impl Identification {
    /// Returns the inertia of motor and load, kg or kg·m² at the axis, if the recordings with both encoders tell it and the
    /// others do not.
    pub(super) fn inertia_of_both_encoders(&self) -> Option<ConfidenceInterval> {
        let is_known = self.inertia.is_some() || self.refined(RefinedParameter::Inertia).is_some();
        let masses = self.transmission.as_ref()?.masses.as_ref()?;
        (!is_known).then_some(masses.total)
    }

    /// Returns the logging of the current, a mean if it was not identified.
    pub(super) fn current_logging(&self) -> CurrentLogging {
        self.current_logging.unwrap_or(CurrentLogging::MEAN)
    }

    /// Returns the identified axis parameters.
    pub fn axis(&self) -> &AxisConfig {
        &self.axis
    }
}
