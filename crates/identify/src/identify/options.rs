//! Inputs and options of an identification.

use super::feedforward_mode::FeedforwardMode;
use super::friction::Breakaway;
use crate::recording::{Signals, StatedValues};

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
    /// True if the presliding is identified from reversals.
    pub presliding: bool,
    /// Values of the axis that the user has stated, against which the result is checked.
    pub stated: StatedValues,
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
    /// Position-loop gain Kp, from recordings that are coarser than the position cycle.
    pub gain: bool,
    /// Position cycle, where the recordings do not show it.
    pub position_cycle: bool,
}

impl RefinementScope {
    /// All parameters.
    pub const ALL: RefinementScope = RefinementScope {
        inertia: true,
        friction: true,
        gravity: true,
        feedforward: true,
        gain: true,
        position_cycle: true,
    };
    /// No refinement, only the steps of the paper.
    pub const NONE: RefinementScope = RefinementScope {
        inertia: false,
        friction: false,
        gravity: false,
        feedforward: false,
        gain: false,
        position_cycle: false,
    };
}

impl Default for IdentificationOptions {
    fn default() -> Self {
        IdentificationOptions {
            i0: Breakaway::Held,
            refine: RefinementScope::ALL,
            presliding: false,
            stated: StatedValues::ALL,
        }
    }
}
