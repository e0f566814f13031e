//! Setpoints of a control, from recorded positions and the drives of a machine.
//!
//! The drives are simulated with estimated setpoints, and the estimate is changed by iterative learning until the simulated
//! positions are those recorded. The simulation contains the friction of the axes; at standstill it hides a few µm.

use std::sync::Arc;

use virtual_axes_core::config::{AxisConfig, MachineConfig, Periods};
use virtual_axes_core::design::{LearningFilter, LearningTuning};
use virtual_axes_core::machine::{Machine, MachineParameters, closed_loop_response};
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::{Rounded, seconds};

use super::log::{ControlLog, LogAccuracy};
use super::track::weight;
use crate::motion::AXIS_LETTERS;

/// Number of iterations: with a gain of 1 each leaves a hundredth of the error.
const ITERATIONS: usize = 3;
/// Relative change of the inertia for the derivative of the setpoints.
const INERTIA_STEP: f64 = 0.05;
/// Largest factor on the inertia.
const MOST_CHANGE: f64 = 2.0;
/// Times before and behind a sample, s, and distance, m or rad, within which setpoints count as the end of a motion.
const QUIET: [f64; 2] = [0.016, 0.06];
const NEAR: f64 = 3e-5;
/// Smallest deviation of the estimated setpoints, m, and multiple of their RMS deviation at the ends of motions.
const DEVIATION: f64 = 3e-6;
const OF_RESTS: f64 = 3.0;
/// Sum of squares that drives other than those of the machine leave in the ramps, s².
const DRIVE_SQUARES: f64 = 2e-5;
/// Time over which a speed is taken, s.
const WINDOW: f64 = 0.02;
/// Bandwidth of the learning as a part of the Nyquist frequency.
const BANDWIDTH: f64 = 0.5;

impl ControlLog {
    /// Returns the setpoints with which the drives of a machine move along the positions of this log.
    ///
    /// The sampling period of the log takes the place of the position cycle of the machine.
    ///
    /// # Errors
    ///
    /// Returns an error if the drives cannot be simulated at the sampling period of the log, or are unstable.
    pub fn setpoints_of(&self, machine: &MachineConfig) -> Result<Self, String> {
        let mut log = self.clone();
        let periods = Periods { position: (1e9 * self.period).round() as i64, ..machine.periods() };
        if periods.position <= 0 || periods.position % periods.velocity != 0 {
            return Err(format!(
                "the sampling period, {} ms, is not a multiple of the velocity cycle of the drives, {} ms; set \
                 periods.velocity_us and periods.current_us, or resample the positions",
                Rounded(1e3 * self.period),
                Rounded(1e3 * seconds(periods.velocity))
            ));
        }
        let mut deviation = DEVIATION.max(4.0 * self.accuracy.resolution);
        for (index, letter) in AXIS_LETTERS.iter().enumerate().filter(|(index, _)| self.has_axis[*index]) {
            let axis =
                machine.axes().iter().find(|axis| axis.name().eq_ignore_ascii_case(&letter.to_string()));
            let Some(axis) = axis else { continue };
            let positions: Vec<f64> = self.positions.iter().map(|position| position[index]).collect();
            let (setpoints, of_rests) = learned(axis, periods, &positions)
                .map_err(|error| format!("axis {}: {error}", axis.name()))?;
            for (position, setpoint) in log.positions.iter_mut().zip(setpoints) {
                position[index] = setpoint;
            }
            deviation = deviation.max(OF_RESTS * weight(index) * of_rests);
        }
        log.accuracy = LogAccuracy {
            resolution: deviation,
            window: ((WINDOW / self.period).ceil() as usize).max(2),
            smoothing: self.period,
            drive_squares: DRIVE_SQUARES,
        };
        Ok(log)
    }
}

/// Returns the setpoints of an axis for its positions, with the inertia that lets them rest after motions, and their RMS
/// deviation there.
///
/// The setpoints of a control end a motion in a finite time. Estimated with another inertia, they approach the end as slowly as
/// the position loop.
fn learned(axis: &AxisConfig, periods: Periods, positions: &[f64]) -> Result<(Vec<f64>, f64), String> {
    let with = |factor: f64| {
        let mut axis = axis.clone();
        axis.deviation.inertia *= factor;
        setpoints(&axis, periods, positions)
    };
    let [before, behind] = QUIET.map(|time| (time / seconds(periods.position)).ceil() as usize);
    let (nominal, moved) = (with(1.0)?, with(1.0 + INERTIA_STEP)?);
    let is_end = |k: &usize| {
        let rest = nominal[k + behind];
        nominal[k - before..k + behind].iter().all(|setpoint| (setpoint - rest).abs() < NEAR)
    };
    let ends: Vec<usize> = (before..nominal.len().saturating_sub(behind)).filter(is_end).collect();
    let away = |setpoints: &[f64], k: usize| setpoints[k] - setpoints[k + behind];
    let [mut product, mut square] = [0.0; 2];
    for &k in &ends {
        let slope = away(&moved, k) - away(&nominal, k);
        product += slope * away(&nominal, k);
        square += slope * slope;
    }
    if square == 0.0 {
        return Ok((nominal, 0.0));
    }
    let change = INERTIA_STEP * product / square;
    let found = with((1.0 - change).clamp(MOST_CHANGE.recip(), MOST_CHANGE))?;
    let deviation = rms(ends.iter().map(|&k| away(&found, k))).unwrap_or(0.0);
    Ok((found, deviation))
}

/// Returns the setpoints with which a simulated axis moves along positions.
fn setpoints(axis: &AxisConfig, periods: Periods, positions: &[f64]) -> Result<Vec<f64>, String> {
    let response = closed_loop_response(axis, &periods).map_err(|error| error.to_string())?;
    let period = seconds(periods.position);
    let bandwidth = BANDWIDTH * 0.5 / period;
    let tuning = LearningTuning { gain: 1.0, bandwidth: Some(bandwidth) };
    let filter =
        LearningFilter::design(&response, &[], period, &tuning).map_err(|error| error.to_string())?;
    let machine = MachineConfig::from_axis(axis.clone(), periods);
    let parameters = MachineParameters::new(&machine).map(Arc::new).map_err(|error| error.to_string())?;
    let moment = response.values().iter().zip(response.first()..).map(|(value, k)| value * k as f64);
    let delay = moment.sum::<f64>().round().max(0.0) as usize;
    let last = positions.len().saturating_sub(1);
    let start: Vec<f64> = (0..positions.len()).map(|k| positions[(k + delay).min(last)]).collect();
    let mut compensation = vec![0.0; positions.len()];
    let sum = |compensation: &[f64]| -> Vec<f64> {
        start.iter().zip(compensation).map(|(start, change)| start + change).collect()
    };
    for _ in 0..ITERATIONS {
        let simulated = simulated(&parameters, &sum(&compensation));
        let errors: Vec<f64> =
            positions.iter().zip(simulated).map(|(recorded, own)| recorded - own).collect();
        compensation = filter.next_compensation(&compensation, &errors);
    }
    Ok(sum(&compensation))
}

/// Returns the positions of an axis that starts at rest at its first setpoint.
fn simulated(parameters: &Arc<MachineParameters>, setpoints: &[f64]) -> Vec<f64> {
    let mut machine = Machine::new(Arc::clone(parameters));
    machine.reset(&setpoints[..1.min(setpoints.len())]);
    let preview = machine.preview_length();
    let mut padded = setpoints.to_vec();
    padded.resize(setpoints.len() + preview, setpoints.last().copied().unwrap_or(0.0));
    let cycle = |k: usize| {
        machine.advance(&padded[k..=k], &padded[k + 1..=k + preview]);
        machine.axis(0).sample().position
    };
    (0..setpoints.len()).map(cycle).collect()
}

#[cfg(test)]
mod tests {
    use virtual_axes_builtin::MACHINES;
    use virtual_axes_core::config::Parameters;

    use super::super::ramp::distance;
    use super::*;

    /// Returns the RMS of the differences, m.
    fn difference(a: &[f64], b: &[f64]) -> f64 {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        (sum / a.len() as f64).sqrt()
    }

    #[test]
    fn setpoints_are_those_of_axes_with_another_inertia() {
        let machine = Parameters::load("vmc", MACHINES).unwrap().machine_config().unwrap();
        let periods = Periods { position: 1_000_000, ..machine.periods() };
        let axis = &machine.axes()[0];
        // Out and back at 0.2 m/s, with 4 m/s² and a moving average over 30 ms.
        let moved = |time: f64| 0.2e-3 * distance(time, &[50.0, 30.0]);
        let starts = [(100.0, 1.0), (500.0, -1.0), (900.0, -1.0), (1300.0, 1.0)];
        let at = |k: u32| {
            let sum: f64 = starts.iter().map(|(start, sign)| sign * moved(f64::from(k) - start)).sum();
            sum - 0.3
        };
        let expected: Vec<f64> = (0..1700).map(at).collect();
        let mut heavy = axis.clone();
        heavy.deviation.inertia = 1.1;
        let parameters = MachineParameters::new(&MachineConfig::from_axis(heavy, periods)).unwrap();
        let encoder = |position: f64| 1e-7 * (1e7 * position).round();
        let positions: Vec<f64> =
            simulated(&Arc::new(parameters), &expected).into_iter().map(encoder).collect();
        let found = difference(&learned(axis, periods, &positions).unwrap().0, &expected);
        let nominal = difference(&setpoints(axis, periods, &positions).unwrap(), &expected);
        assert!(found < 1e-6, "{found}");
        // The motion shows the inertia.
        assert!(found < 0.5 * nominal, "{found} {nominal}");
    }
}
