//! Cross-coupled control: feedback of the contour error, beside the position controllers of X, Y and Z.

use crate::config::{AxisConfig, MachineConfig, Periods};
use crate::control::{CONTOUR_AXES, ContourVector, Rst, contour_error};
use crate::design::{DesignError, PredictionModel, check_stable};
use crate::kinematics::AxisRole;

use super::bank::AxisBank;
use super::{Axis, AxisError, AxisParameters, MachineError, design_controller, prediction_model};

/// Cross-coupled control of X, Y and Z of one machine (Koren, Journal of Dynamic Systems, Measurement and Control
/// 102, 1980; with the contour error as a vector).
///
/// ```text
/// Ω*_axis ← Ω*_axis + K ε_axis/r
/// ```
///
/// ε is the contour error, the deviation from the path of the delayed setpoints ([`contour_error`]). The loop has the gain
/// Kp + K across the path and Kp along it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ContourControl {
    /// K, 1/s.
    gain: f64,
    /// Indices of the axes, in the order x, y, z.
    axes: Vec<usize>,
}

impl ContourControl {
    /// Creates the control of the axes of `config` at `indices`; `None` without a gain or without two of x, y and z.
    ///
    /// # Errors
    /// [`MachineError::Axis`] with [`AxisError::ContourControl`] if the gain makes the loop of an axis unstable.
    pub fn new(config: &MachineConfig, indices: &[usize]) -> Result<Option<Self>, MachineError> {
        let selected = || indices.iter().filter_map(|&index| config.axes.get(index));
        let gain = config.contour_gain;
        let axes = contour_axes(gain, selected());
        if axes.is_empty() {
            return Ok(None);
        }
        for axis in axes.iter().filter_map(|&index| selected().nth(index)) {
            require_stable_contour(axis, &config.periods, gain)
                .map_err(|source| MachineError::Axis { axis: axis.name.clone(), source })?;
        }
        Ok(Some(ContourControl { gain, axes }))
    }

    /// Returns the control of a machine whose axes come after `count` others.
    pub fn behind(&self, count: usize) -> Self {
        ContourControl { gain: self.gain, axes: self.axes.iter().map(|axis| axis + count).collect() }
    }

    /// Returns true if an axis is controlled.
    pub fn contains(&self, axis: usize) -> bool {
        self.axes.contains(&axis)
    }

    /// Sets the offsets of the velocity setpoints for the present position cycle.
    pub fn execute(&self, axes: &mut [Axis], parameters: &[AxisParameters], bank: &AxisBank) {
        let mut position: ContourVector = [0.0; CONTOUR_AXES];
        for (coordinate, &index) in position.iter_mut().zip(&self.axes) {
            *coordinate = axes[index].measured_position(&parameters[index], &bank.feedback(index));
        }
        let setpoint = |j: i64| {
            let mut point = [0.0; CONTOUR_AXES];
            for (coordinate, &index) in point.iter_mut().zip(&self.axes) {
                *coordinate = axes[index].delayed_setpoint(&parameters[index], j);
            }
            point
        };
        let error = contour_error(setpoint, position);
        for (error, &index) in error.iter().zip(&self.axes) {
            axes[index].set_contour_offset(&parameters[index], self.gain * error);
        }
    }
}

/// Returns the indices of the axes on which cross-coupled control with the gain K, 1/s, acts: the linear axes x, y and z, in
/// this order; none without a gain or with a single one of them.
pub fn contour_axes<'a>(gain: f64, axes: impl Iterator<Item = &'a AxisConfig>) -> Vec<usize> {
    let axes: Vec<&AxisConfig> = axes.collect();
    let index_of = |role: AxisRole| axes.iter().position(|axis| role.matches(&axis.name, axis.kind));
    let found: Vec<usize> = AxisRole::LINEAR.into_iter().filter_map(index_of).collect();
    if gain > 0.0 && found.len() > 1 { found } else { Vec::new() }
}

/// Checks that the position loop of `axis` is stable with the gain of cross-coupled control in addition, as across a path
/// perpendicular to the axis.
fn require_stable_contour(axis: &AxisConfig, periods: &Periods, gain: f64) -> Result<(), AxisError> {
    if axis.position_loop.allow_unstable {
        return Ok(());
    }
    let model = prediction_model(axis, periods)?;
    let sum = design_contour_controller(axis, &model, gain)?;
    check_stable(&model, &sum).map_err(|source| AxisError::ContourControl { gain, source })
}

/// Designs the controller that acts across a path perpendicular to `axis`: its position controller with the gain K of
/// cross-coupled control, 1/s, in addition. T is that of a regulator; it has no part in stability and margins.
///
/// # Errors
/// [`DesignError`] if the configuration does not give a controller.
pub fn design_contour_controller(
    axis: &AxisConfig,
    model: &PredictionModel,
    gain: f64,
) -> Result<Rst, DesignError> {
    with_contour_gain(&design_controller(axis, model)?, gain)
}

/// Returns a position controller with the gain K of cross-coupled control, 1/s, in addition; see
/// [`design_contour_controller`].
///
/// # Errors
/// [`DesignError`] if the sum is no controller.
pub fn with_contour_gain(rst: &Rst, gain: f64) -> Result<Rst, DesignError> {
    let mut r = rst.r().to_vec();
    // The controller sees the sum as its output, so that K adds to r₀ in units of s₀.
    r[0] += gain * rst.s()[0];
    let t = [r.iter().sum()];
    Ok(Rst::new(&r, rst.s(), &t, 0)?)
}
