//! Backlash that the model does not have, from the position residual in both directions.

use super::experiment::{Experiment, SimulatedExperiment};
use super::validate::Agreement;
use virtual_axes_core::units::MILLIMETER;

/// Speed above which the axis has a direction, m/s or rad/s.
const SLOWEST: f64 = 2.0 * MILLIMETER;
/// Standard errors of a significant difference.
const SIGNIFICANT: f64 = 4.0;
/// Fewest moves in each direction.
const FEWEST_MOVES: usize = 4;

/// Returns the difference of the residual between the directions, m or rad: the recorded position stays behind the
/// simulated one by half of it on each side. None if it is not significant.
pub(super) fn lost_motion(agreement: &Agreement) -> Option<f64> {
    let mut means = [Vec::new(), Vec::new()];
    for (experiment, simulated) in agreement.experiments.iter().zip(&agreement.simulated) {
        collect_moves(experiment, simulated, &mut means);
    }
    let [forward, backward] = means.map(|values| mean_and_error(&values));
    let ((forward, forward_error), (backward, backward_error)) = (forward?, backward?);
    let (difference, error) = (forward - backward, forward_error.hypot(backward_error));
    (difference > SIGNIFICANT * error).then_some(difference)
}

/// Adds the mean residual of each move to those of its direction.
fn collect_moves(experiment: &Experiment, simulated: &SimulatedExperiment, means: &mut [Vec<f64>; 2]) {
    let (mut direction, mut sum, mut count) = (0.0, 0.0, 0.0);
    let samples = simulated.position.iter().zip(&experiment.position).zip(&simulated.velocity);
    for ((simulated, recorded), velocity) in samples.chain([((&0.0, &0.0), &0.0)]) {
        let now = if velocity.abs() > SLOWEST { velocity.signum() } else { 0.0 };
        if now != direction {
            if count > 0.0 {
                means[usize::from(direction < 0.0)].push(sum / count);
            }
            (sum, count) = (0.0, 0.0);
        }
        direction = now;
        if now != 0.0 {
            sum += simulated - recorded;
            count += 1.0;
        }
    }
}

fn mean_and_error(values: &[f64]) -> Option<(f64, f64)> {
    if values.len() < FEWEST_MOVES {
        return None;
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Some((mean, (variance / count).sqrt()))
}
