//! Identification of one axis: inputs, options and result.

use super::delays::DelayFit;
use super::feedforward::FeedforwardFit;
use super::feedforward_mode::FeedforwardMode;
use super::friction::{Breakaway, FrictionFit};
use super::gravity::{GravityFit, SteadyMeasurements};
use super::inertia::InertiaFit;
use super::refine::Refinement;
use super::steps::IdentificationSteps;
use super::validate::Agreement;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, Periods};

/// Recording with its known conditions.
#[derive(Debug, Clone, Copy)]
pub struct IdentificationInput<'a> {
    /// Conditioned recording.
    pub signals: &'a Signals,
    /// Active feedforward; required if the recording does not contain VFFWS and TFFWS.
    pub feedforward: Option<FeedforwardMode>,
}

/// Options of the identification.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdentificationOptions {
    /// Source of the breakaway current i0.
    pub i0: Breakaway,
    /// Parameters of the closed-loop refinement.
    pub refine: RefinementScope,
}

/// Parameters that the closed-loop refinement changes; the others keep the result of the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RefinementScope {
    /// Equivalent inertia Jeq.
    pub inertia: bool,
    /// Friction law, and i0 if it is a separate parameter.
    pub friction: bool,
    /// Gravity: W, or k and φ, if significant.
    pub gravity: bool,
    /// VFFW and TFFW, if their setpoints were not recorded.
    pub feedforward: bool,
}

impl RefinementScope {
    /// All parameters.
    pub const ALL: RefinementScope =
        RefinementScope { inertia: true, friction: true, gravity: true, feedforward: true };
    /// No refinement, only the steps of the paper.
    pub const NONE: RefinementScope =
        RefinementScope { inertia: false, friction: false, gravity: false, feedforward: false };
}

impl Default for IdentificationOptions {
    fn default() -> Self {
        IdentificationOptions { i0: Breakaway::Held, refine: RefinementScope::ALL }
    }
}

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
    /// VFFW and TFFW by regression.
    pub feedforward: FeedforwardFit,
    /// Identified delays α, β, γ.
    pub delays: Vec<DelayFit>,
    /// Closed-loop refinement.
    pub refinement: Option<Refinement>,
    /// Agreement of the identified axis with each recording.
    pub agreements: Vec<Agreement>,
    /// Findings.
    pub findings: Vec<Finding>,
}

impl Identification {
    /// Returns the identified axis parameters.
    pub fn axis(&self) -> &AxisConfig {
        &self.axis
    }
}

/// Identifies `axis` from recordings, starting from the parameters of its machine file.
pub fn identify(
    inputs: &[IdentificationInput<'_>],
    axis: &AxisConfig,
    periods: &Periods,
    options: &IdentificationOptions,
) -> Identification {
    let mut steps = IdentificationSteps::new(inputs, axis, periods, options);
    steps.fit_plant();
    steps.fit_feedforward_weights();
    steps.fit_closed_loop();
    steps.finish()
}
