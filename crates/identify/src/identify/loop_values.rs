//! Result of the fit of a closed loop.

use nalgebra::DMatrix;
use virtual_axes_core::config::{AxisConfig, Periods};

use super::loop_parameter::LoopParameter;

/// Fitted value with an upper bound of its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LoopValue {
    pub parameter: LoopParameter,
    pub value: f64,
    pub error: f64,
}

/// Result of the fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoopFit {
    /// Axis with fitted delays, gains and weights.
    pub axis: AxisConfig,
    /// Periods with the position cycle that divides the lag.
    pub periods: Periods,
    pub values: Vec<LoopValue>,
    /// RMS position residual, m or rad.
    pub rms: f64,
    /// The same with a lag that need not be a whole number of cycles: of a control that logs actual values late.
    pub exact_rms: f64,
    pub exact_axis: AxisConfig,
    /// Correlations of the fitted values, in their order.
    pub correlations: DMatrix<f64>,
    /// RMS position residual with the gain of the machine file, if the gain was fitted.
    pub rms_with_given_gain: Option<f64>,
    /// Axes with other position cycles that explain the positions about as well.
    pub alternatives: Vec<(AxisConfig, Periods)>,
    /// VFFW and lag (s) at both ends of the valley in which the residual hardly changes.
    pub valley: Option<[(f64, f64); 2]>,
}
