//! Bounds of the following error from the impulse responses of the linear loop.
//!
//! While no limit acts, an axis is linear in its setpoints and in the torques on its motor. With e the
//! delay-compensated following error at position cycles, Δ the difference of setpoints and d the torque on the motor,
//!
//! ```text
//! e(k) = Σⱼ h(j, k) Δ(j) + Σₙ g(k·N − n) d(n) + Σₘ q(k·M − m) c(m)
//! ```
//!
//! where n counts ticks, N per position cycle, and m velocity cycles, M per position cycle, at which friction
//! compensation adds c. h depends on k − j only, except for the first j, which lie within the preview at the start.
//! Therefore |e| ≤ ‖h‖₁ max|Δ| + ‖g‖₁ max|d| + ‖q‖₁ max|c|. The same bound holds with the second and third differences
//! of the setpoints and the once and twice summed h.

use super::linear_axis::{LinearAxis, LoopState, STATES};

/// Orders of setpoint differences with a bound: first, second, third.
pub const ORDERS: usize = 3;

/// Impulse responses of one axis over a number of position cycles.
#[derive(Debug, Clone)]
pub struct ImpulseResponses {
    /// h(j, ·) of the first setpoints; the last one, shifted, applies to all later setpoints.
    setpoint: Vec<Vec<f64>>,
    /// g by ticks since the torque, largest lag first.
    torque: Vec<f64>,
    /// q by velocity cycles since the feedforward, largest lag first.
    feedforward: Vec<f64>,
    /// Absolute sums of h, once and twice summed h, by position cycle.
    setpoint_norms: Vec<[f64; ORDERS]>,
    torque_norms: Vec<f64>,
    feedforward_norms: Vec<f64>,
    ticks: usize,
    instants: usize,
}

/// Inputs of one axis for the superposition of its impulse responses.
#[derive(Debug, Clone, Copy)]
pub struct ResponseInputs<'a> {
    /// Δ by position cycle, m or rad; the first is relative to rest.
    pub steps: &'a [f64],
    /// d by tick, N·m.
    pub torque: &'a [f64],
    /// c by velocity cycle, N·m; empty if 0.
    pub feedforward: &'a [f64],
}

impl ImpulseResponses {
    /// Computes the responses of `axis` over `periods` position cycles.
    pub fn new(axis: &LinearAxis, periods: usize) -> Self {
        let unit = |j: usize| move |k: i64| if k >= j as i64 { 1.0 } else { 0.0 };
        let setpoint = (0..=axis.preview()).map(|j| axis.errors(periods, unit(j))).collect();
        let free: Vec<Vec<f64>> = (0..STATES)
            .map(|index| {
                let mut state = [0.0; STATES];
                state[index] = 1.0;
                axis.free(state, periods)
            })
            .collect();
        // After the period of the impulse, its state decays as a free response.
        let lags = |impulses: usize, after: &dyn Fn(usize) -> LoopState| {
            let mut lags = vec![0.0; periods * impulses];
            for at in 0..impulses {
                let state = after(at);
                for k in 1..periods {
                    let value = state.iter().zip(&free).map(|(part, free)| part * free[k - 1]).sum();
                    lags[periods * impulses - (k * impulses - at)] = value;
                }
            }
            lags
        };
        let (ticks, instants) = (axis.ticks, axis.ticks / axis.velocity_ticks);
        let torque = lags(ticks, &|at| axis.after_torque(at));
        let feedforward = lags(instants, &|at| axis.after_feedforward(at));
        let mut response = ImpulseResponses {
            setpoint,
            torque_norms: norms(&torque, periods, ticks),
            feedforward_norms: norms(&feedforward, periods, instants),
            torque,
            feedforward,
            setpoint_norms: Vec::new(),
            ticks,
            instants,
        };
        let mut largest = [0.0_f64; ORDERS];
        for k in 0..periods {
            let sums = response.absolute_sums(k);
            largest.iter_mut().zip(sums).for_each(|(largest, sum)| *largest = largest.max(sum));
            response.setpoint_norms.push(largest);
        }
        response
    }

    /// Returns the number of position cycles.
    pub fn periods(&self) -> usize {
        self.setpoint_norms.len()
    }

    /// Returns h(j, k).
    fn of_setpoint(&self, j: usize, k: usize) -> f64 {
        let last = self.setpoint.len() - 1;
        let (column, shift) = (j.min(last), j.saturating_sub(last));
        if k < shift { 0.0 } else { self.setpoint[column][k - shift] }
    }

    /// Returns Σⱼ |h(j, k)| for h and for its sums from j on.
    fn absolute_sums(&self, k: usize) -> [f64; ORDERS] {
        let mut sums = [0.0; ORDERS];
        let (mut once, mut twice) = (0.0, 0.0);
        for j in (0..k + self.setpoint.len()).rev() {
            let h = self.of_setpoint(j, k);
            once += h;
            twice += once;
            sums.iter_mut()
                .zip([h, once, twice])
                .for_each(|(sum, value): (&mut f64, f64)| *sum += value.abs());
        }
        sums
    }

    /// Returns the bound of |e| up to position cycle `k` from the largest `differences` of the setpoints (first, second,
    /// third), the largest torque and the largest feedforward.
    pub fn bound(&self, k: usize, differences: [f64; ORDERS], torque: f64, feedforward: f64) -> f64 {
        let by_setpoint = self.setpoint_norms[k].iter().zip(differences).map(|(norm, most)| norm * most);
        by_setpoint.fold(f64::INFINITY, f64::min)
            + self.torque_norms[k] * torque
            + self.feedforward_norms[k] * feedforward
    }

    /// Returns e(k) by superposition.
    pub fn error(&self, k: usize, inputs: &ResponseInputs<'_>) -> f64 {
        let seen = inputs.steps.len().min(k + self.setpoint.len());
        let by_setpoint: f64 =
            inputs.steps[..seen].iter().enumerate().map(|(j, step)| step * self.of_setpoint(j, k)).sum();
        let by_torque = latest(&self.torque, inputs.torque, k * self.ticks);
        let by_feedforward = latest(&self.feedforward, inputs.feedforward, k * self.instants);
        by_setpoint + by_torque + by_feedforward
    }
}

/// Returns the absolute sums of the lags up to each position cycle.
fn norms(lags: &[f64], periods: usize, ticks: usize) -> Vec<f64> {
    let mut sum = 0.0;
    let sums: Vec<f64> = lags
        .iter()
        .rev()
        .map(|g| {
            sum += g.abs();
            sum
        })
        .collect();
    (0..periods).map(|k| if k == 0 { 0.0 } else { sums[k * ticks - 1] }).collect()
}

/// Returns the inner product of the last `count` weights and the first `count` values; 0 without values.
fn latest(weights: &[f64], values: &[f64], count: usize) -> f64 {
    /// Parallel partial sums.
    const PARTIAL_SUMS: usize = 8;
    if values.is_empty() {
        return 0.0;
    }
    let (weights, values) = (&weights[weights.len() - count..], &values[..count]);
    let mut sums = [0.0; PARTIAL_SUMS];
    let (whole, whole_values) = (weights.chunks_exact(PARTIAL_SUMS), values.chunks_exact(PARTIAL_SUMS));
    let rest: f64 = whole.remainder().iter().zip(whole_values.remainder()).map(|(w, v)| w * v).sum();
    for (w, v) in whole.zip(whole_values) {
        for lane in 0..PARTIAL_SUMS {
            sums[lane] += w[lane] * v[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}
