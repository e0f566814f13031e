//! What recordings tell about an axis.

use super::delays::DelayFit;
use super::feedforward::FeedforwardFit;
use super::friction::{Breakaway, Friction};
use super::gravity::{Gravity, Steady};
use super::inertia::Inertia;
use super::mode::FeedforwardMode;
use super::refine::Refinement;
use super::steps::Steps;
use super::validate::Agreement;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, Periods};

/// A recording and what is known about it.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// The recording.
    pub signals: &'a Signals,
    /// The feedforward that acted; needed where the recording does not show VFFWS and TFFWS.
    pub feedforward: Option<FeedforwardMode>,
}

/// What is to be done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Where i0 comes from.
    pub i0: Breakaway,
    /// What the refinement on the closed loop moves.
    pub refine: Refine,
}

/// What the refinement on the closed loop moves; what is left out stays as the steps found it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refine {
    /// Jeq.
    pub inertia: bool,
    /// The friction law, and i0 where it is freed.
    pub friction: bool,
    /// W, or k and φ, where there is a gravity.
    pub gravity: bool,
    /// VFFW and TFFW, where their setpoints were not recorded.
    pub feedforward: bool,
}

impl Refine {
    /// All of it.
    pub const ALL: Refine = Refine { inertia: true, friction: true, gravity: true, feedforward: true };
    /// Nothing: only the steps of the paper.
    pub const NONE: Refine = Refine { inertia: false, friction: false, gravity: false, feedforward: false };
}

impl Default for Options {
    fn default() -> Self {
        Options { i0: Breakaway::Held, refine: Refine::ALL }
    }
}

/// What the recordings tell about an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The axis as it was taken for.
    pub before: AxisConfig,
    /// The axis as it was found.
    pub(crate) axis: AxisConfig,
    /// Currents of steady motion and of standstills.
    pub steady: Steady,
    /// Gravity.
    pub gravity: Option<Gravity>,
    /// Friction.
    pub friction: Option<Friction>,
    /// Inertia by eq. 5.
    pub inertia: Option<Inertia>,
    /// What eq. 5 gives on the simulation of the axis as it was found, sampled as the recordings are: where this
    /// agrees with the recorded one and neither with the axis, the current swings between two samples.
    pub replayed_inertia: Option<f64>,
    /// VFFW and TFFW.
    pub feedforward: FeedforwardFit,
    /// α, β, γ.
    pub delays: Vec<DelayFit>,
    /// Parameters refined on the closed loop.
    pub refinement: Option<Refinement>,
    /// How the axis as it was found agrees with each recording.
    pub agreements: Vec<Agreement>,
    /// What must be said.
    pub findings: Vec<Finding>,
}

impl Identification {
    /// The axis as it was found.
    pub fn axis(&self) -> &AxisConfig {
        &self.axis
    }
}

/// Identifies `axis` from recordings of it, starting from what its machine file says.
pub fn identify(
    inputs: &[Input<'_>],
    axis: &AxisConfig,
    periods: &Periods,
    options: &Options,
) -> Identification {
    let mut steps = Steps::new(inputs, axis, periods, options);
    steps.steady_steps();
    steps.feedforward();
    steps.closed_loop();
    steps.finish()
}
