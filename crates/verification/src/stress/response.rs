//! What bounds the error of an axis: the impulse responses of its linear loop, and their absolute sums.
//!
//! As long as no limit acts, an axis is linear in its setpoints and in the torques that it meets. With e the
//! synchronized tracking error at position instants, Δ the difference of setpoints and d the torque on the motor,
//!
//! ```text
//! e(k) = Σⱼ h(j, k) Δ(j) + Σₙ g(k·N − n) d(n) + Σₘ q(k·M − m) c(m)
//! ```
//!
//! where n counts ticks, N to a position period, and m instants of the velocity loop, M to a period, at which a
//! friction compensation adds c. h depends on k − j alone but for the first j, whose motion the controller cannot see
//! before the beginning. So |e| ≤ ‖h‖₁ max|Δ| + ‖g‖₁ max|d| + ‖q‖₁ max|c|, and likewise with the second and third
//! differences of the setpoints and the once and twice summed h.

use super::linear::{LinearAxis, STATES, State};

/// Differences of the setpoints that there is a bound by.
pub const ORDERS: usize = 3;

/// Responses of one axis over a number of position periods.
#[derive(Debug, Clone)]
pub struct Response {
    /// h(j, ·) of the first setpoints; the last one of these holds for all that follow, shifted.
    setpoint: Vec<Vec<f64>>,
    /// g, the largest lag first: ticks since the torque.
    torque: Vec<f64>,
    /// q, the largest lag first: instants of the velocity loop.
    feedforward: Vec<f64>,
    /// Absolute sums of h, once and twice summed h, by the instant.
    setpoint_norms: Vec<[f64; ORDERS]>,
    torque_norms: Vec<f64>,
    feedforward_norms: Vec<f64>,
    ticks: usize,
    instants: usize,
}

/// What an axis was given, to be weighed with its responses.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// Δ by the position instant, m or rad; the first is from rest.
    pub steps: &'a [f64],
    /// d by the tick, N·m.
    pub torque: &'a [f64],
    /// c by the instant of the velocity loop, N·m; none if it is nothing.
    pub feedforward: &'a [f64],
}

impl Response {
    /// Those of `axis` over `periods` position periods.
    pub fn new(axis: &LinearAxis, periods: usize) -> Self {
        let unit = |j: usize| move |k: i64| if k >= j as i64 { 1.0 } else { 0.0 };
        let setpoint = (0..=axis.ahead()).map(|j| axis.errors(periods, unit(j))).collect();
        let free: Vec<Vec<f64>> = (0..STATES)
            .map(|place| {
                let mut state = [0.0; STATES];
                state[place] = 1.0;
                axis.free(state, periods)
            })
            .collect();
        // What an impulse leaves behind at the end of its period goes on by itself.
        let lags = |impulses: usize, after: &dyn Fn(usize) -> State| {
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
        let mut response = Response {
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

    /// Position periods that they reach.
    pub fn periods(&self) -> usize {
        self.setpoint_norms.len()
    }

    /// h(j, k).
    fn of_setpoint(&self, j: usize, k: usize) -> f64 {
        let last = self.setpoint.len() - 1;
        let (column, shift) = (j.min(last), j.saturating_sub(last));
        if k < shift { 0.0 } else { self.setpoint[column][k - shift] }
    }

    /// Σⱼ |h(j, k)|, and of the sums of h from j on.
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

    /// What bounds |e| up to instant `k`, from the largest `differences` of the setpoints (first, second, third),
    /// the largest torque and the largest feedforward.
    pub fn bound(&self, k: usize, differences: [f64; ORDERS], torque: f64, feedforward: f64) -> f64 {
        let by_setpoint = self.setpoint_norms[k].iter().zip(differences).map(|(norm, most)| norm * most);
        by_setpoint.fold(f64::INFINITY, f64::min)
            + self.torque_norms[k] * torque
            + self.feedforward_norms[k] * feedforward
    }

    /// e(k).
    pub fn error(&self, k: usize, inputs: &Inputs<'_>) -> f64 {
        let seen = inputs.steps.len().min(k + self.setpoint.len());
        let by_setpoint: f64 =
            inputs.steps[..seen].iter().enumerate().map(|(j, step)| step * self.of_setpoint(j, k)).sum();
        let by_torque = latest(&self.torque, inputs.torque, k * self.ticks);
        let by_feedforward = latest(&self.feedforward, inputs.feedforward, k * self.instants);
        by_setpoint + by_torque + by_feedforward
    }
}

/// Absolute sums of the lags up to each position instant.
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

/// The last `count` weights with the first `count` values; no values are nothing.
fn latest(weights: &[f64], values: &[f64], count: usize) -> f64 {
    /// Sums that go on side by side.
    const LANES: usize = 8;
    if values.is_empty() {
        return 0.0;
    }
    let (weights, values) = (&weights[weights.len() - count..], &values[..count]);
    let mut sums = [0.0; LANES];
    let (whole, whole_values) = (weights.chunks_exact(LANES), values.chunks_exact(LANES));
    let rest: f64 = whole.remainder().iter().zip(whole_values.remainder()).map(|(w, v)| w * v).sum();
    for (w, v) in whole.zip(whole_values) {
        for lane in 0..LANES {
            sums[lane] += w[lane] * v[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}
