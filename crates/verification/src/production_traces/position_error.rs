//! Position error of an identified axis without a trace in between: both axes get the exact setpoints.

use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::{Nanoseconds, seconds};

use super::error::TraceError;
use super::hidden_axis::HiddenAxis;
use super::program::ProductionProgram;

/// Steps of the search for the best constant lag, s, and longest lag in first steps.
const LAG_STEPS: [f64; 3] = [1e-3, 1e-4, 1e-5];
const LONGEST_LAG: i32 = 60;

/// RMS difference to the position of a hidden axis, m, on one program with exact setpoints and positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionError {
    /// Difference of the identified axis.
    pub model: f64,
    /// Difference of the setpoints, delayed by the constant lag that fits best.
    pub delayed: f64,
}

impl PositionError {
    /// Simulates both axes, each with its own `periods`, and compares them at common instants.
    ///
    /// # Errors
    /// [`TraceError::Machine`] if an axis cannot be simulated.
    pub fn compute(
        hidden: &HiddenAxis,
        identified: &AxisConfig,
        periods: Periods,
        program: &ProductionProgram,
    ) -> Result<PositionError, TraceError> {
        let model = HiddenAxis { config: identified.clone(), periods, ..hidden.clone() };
        let period = least_common_multiple(hidden.periods.position, periods.position);
        let positions = |axis: &HiddenAxis| -> Result<Vec<f64>, TraceError> {
            Ok(axis.simulate(program, period)?.samples.iter().map(|sample| sample.position).collect())
        };
        let (truth, found) = (positions(hidden)?, positions(&model)?);
        let difference = rms(truth.iter().zip(&found).map(|(truth, found)| found - truth));
        let rms_at = |lag: f64| {
            let delayed = |k: usize| program.psec(hidden.joint, (k as f64 * seconds(period) - lag).max(0.0));
            rms(truth.iter().enumerate().map(|(k, truth)| delayed(k) - truth))
        };
        let mut best = (0.0, rms_at(0.0));
        for step in LAG_STEPS {
            let (center, reach) = (best.0, if step == LAG_STEPS[0] { LONGEST_LAG } else { 10 });
            for lag in (-reach..=reach).map(|k| center + f64::from(k) * step).filter(|lag| *lag >= 0.0) {
                let error = rms_at(lag);
                if error < best.1 {
                    best = (lag, error);
                }
            }
        }
        Ok(PositionError { model: difference, delayed: best.1 })
    }
}

fn rms(differences: impl Iterator<Item = f64>) -> f64 {
    let (count, squares) = differences.fold((0_usize, 0.0), |(count, sum), d| (count + 1, sum + d * d));
    (squares / count.max(1) as f64).sqrt()
}

fn least_common_multiple(a: Nanoseconds, b: Nanoseconds) -> Nanoseconds {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    a / x.max(1) * b
}
