//! Frequency responses and margins of the current, velocity and position loop.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix, DVector};

use super::margins::{
    LoopMargins, LoopTransfer, OpenLoop, delay, largest_magnitude, loop_margins, position_loop_margins,
};
use super::poles::is_stable_pole;
use super::polynomial::{matrix_eigenvalues, product, sum, value};
use super::{DesignError, PredictionModel};
use crate::control::{CurrentFilters, Pi, Rst};

/// Lowest frequency of a sampled response, Hz.
const FIRST_FREQUENCY: f64 = 0.1;
/// Frequencies of a sampled response per decade.
const POINTS_PER_DECADE: f64 = 200.0;
/// Decades of a sampled response at least, below the Nyquist frequency.
const LEAST_DECADES: f64 = 2.0;
/// Distance of a pole from the unit circle below which a sampled response is refined near it.
const REFINEMENT_DEPTH: f64 = 0.1;
/// Offsets of the refined frequencies from the angle of the pole, relative to its distance from the unit circle.
const REFINEMENT: [f64; 7] = [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0];
/// Relative excess over the static magnitude from which a maximum counts as a peak.
const LEAST_PEAK: f64 = 1e-6;
/// Lowest and highest phase of the first value of a sampled response, rad: that of two integrators is near −π.
const FIRST_PHASE: f64 = -1.5 * PI;

crate::named_values! {
    /// Control loop of an axis, from the innermost to the outermost.
    pub enum ControlLoop {
        /// Current loop, sampled every Tsi: from the current setpoint to the current.
        Current = "current",
        /// Velocity loop, sampled every Tsv: from the velocity setpoint to the speed of the motor.
        Velocity = "velocity",
        /// Position loop, sampled every Tsp: from the delayed position setpoint to the position of the encoder.
        Position = "position",
    }
}

/// Linear sampled system `x(k + 1) = A x(k) + b u(k)`, `y(k) = c x(k) + d u(k)`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StateSpace {
    transition: DMatrix<f64>,
    input: DVector<f64>,
    output: DVector<f64>,
    feedthrough: f64,
}

impl StateSpace {
    /// Creates a system of `states` states from a linear function of state and input that returns the next state and
    /// the output.
    pub fn from_step(states: usize, step: impl Fn(&[f64], f64) -> (Vec<f64>, f64)) -> Self {
        let unit = |k: usize| Vec::from_iter((0..states).map(|row| if row == k { 1.0 } else { 0.0 }));
        let columns: Vec<(Vec<f64>, f64)> = (0..states).map(|k| step(&unit(k), 0.0)).collect();
        let (input, feedthrough) = step(&vec![0.0; states], 1.0);
        StateSpace {
            transition: DMatrix::from_fn(states, states, |row, column| columns[column].0[row]),
            input: DVector::from_vec(input),
            output: DVector::from_fn(states, |column, _| columns[column].1),
            feedthrough,
        }
    }

    /// Returns the transfer function at `z`; `None` at a pole.
    fn at(&self, z: Complex<f64>) -> Option<Complex<f64>> {
        let size = self.input.len();
        let identity = DMatrix::from_diagonal_element(size, size, z);
        let complex = |value: f64| Complex::new(value, 0.0);
        let state = (identity - self.transition.map(complex)).lu().solve(&self.input.map(complex))?;
        Some(state.iter().zip(&self.output).map(|(x, c)| x * *c).sum::<Complex<f64>>() + self.feedthrough)
    }

    /// Computes the poles; without convergence the list is empty.
    fn poles(&self) -> Vec<Complex<f64>> {
        matrix_eigenvalues(self.transition.clone()).unwrap_or_default()
    }
}

/// Linear model of a control loop: its frequency response and margins.
///
/// The loop is sampled by its own cycle; the loops inside it and the plant are lifted exactly from current cycles to
/// that cycle. Friction, gravity, loads, limits, anti-windup and the fallback controller are not linear and are left
/// out.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopResponse {
    transfer: Transfer,
    period: f64,
    /// Poles of the closed loop; empty for the position loop.
    closed_poles: Vec<Complex<f64>>,
}

#[derive(Debug, Clone, PartialEq)]
enum Transfer {
    /// Current controller and plant, from the error to the current.
    Current(StateSpace),
    /// Velocity controller, filters of the current setpoint, and plant from the current setpoint to the change of speed
    /// over one velocity cycle.
    Velocity { controller: Pi, filters: CurrentFilters, plant: StateSpace },
    /// Plant with inner loops, and position controller.
    Position { model: PredictionModel, controller: Rst },
}

impl LoopResponse {
    /// Creates the current loop from the open loop, sampled every `period` s, and the poles of the closed loop.
    pub(crate) fn current(open: StateSpace, closed: &StateSpace, period: f64) -> Self {
        LoopResponse { transfer: Transfer::Current(open), period, closed_poles: closed.poles() }
    }

    /// Creates the velocity loop, sampled every `period` s; `plant` returns the change of speed over a velocity cycle
    /// and does not depend on the speed. `closed` is the transition matrix of the closed loop.
    pub(crate) fn velocity(
        controller: Pi,
        filters: CurrentFilters,
        plant: StateSpace,
        closed: DMatrix<f64>,
        period: f64,
    ) -> Self {
        let closed_poles = matrix_eigenvalues(closed).unwrap_or_default();
        LoopResponse { transfer: Transfer::Velocity { controller, filters, plant }, period, closed_poles }
    }

    /// Creates the position loop of a prediction model and a controller.
    pub fn position(model: PredictionModel, controller: Rst) -> Self {
        let period = model.period();
        LoopResponse { transfer: Transfer::Position { model, controller }, period, closed_poles: Vec::new() }
    }

    /// Returns the cycle of the loop, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Returns the Nyquist frequency, Hz.
    pub fn nyquist_frequency(&self) -> f64 {
        0.5 / self.period
    }

    /// Returns the open loop L at a frequency in Hz: from the error to the controlled value.
    pub fn open(&self, frequency: f64) -> Complex<f64> {
        self.at(self.angle(frequency))
    }

    /// Returns the closed loop at a frequency in Hz, from the setpoint to the controlled value: L/(1 + L) of the
    /// current and velocity loop, B T/(A S + B R) of the position loop without feedforward and delays.
    pub fn closed(&self, frequency: f64) -> Complex<f64> {
        self.closed_at(self.angle(frequency))
    }

    /// Returns the sensitivity 1/(1 + L) at a frequency in Hz.
    pub fn sensitivity(&self, frequency: f64) -> Complex<f64> {
        (self.open(frequency) + 1.0).inv()
    }

    /// Computes stability margins with their frequencies.
    ///
    /// # Errors
    /// [`DesignError::Unstable`] with the pole of largest modulus, since an unstable loop has no margins;
    /// [`DesignError::NoPoles`] if the poles cannot be computed.
    pub fn margins(&self) -> Result<LoopMargins, DesignError> {
        if let Transfer::Position { model, controller } = &self.transfer {
            return position_loop_margins(model, controller);
        }
        let largest = self.closed_poles.iter().max_by(|a, b| a.norm().total_cmp(&b.norm()));
        match largest {
            None => Err(DesignError::NoPoles),
            Some(pole) if !is_stable_pole(*pole) => {
                Err(DesignError::Unstable { re: pole.re, im: pole.im.abs(), modulus: pole.norm() })
            }
            Some(_) => Ok(loop_margins(self)),
        }
    }

    /// Returns frequency in Hz and magnitude of the resonance peak of the closed loop; `None` if the magnitude does not
    /// exceed that at frequency 0.
    pub fn resonance_peak(&self) -> Option<(f64, f64)> {
        let mut near_circle = self.poles_near_circle();
        near_circle.extend(&self.closed_poles);
        let (angle, peak) = largest_magnitude(&near_circle, |angle| self.closed_at(angle));
        let static_gain = match (self.static_gain(), &self.transfer) {
            (Some(gain), Transfer::Current(_)) => (gain / (1.0 + gain)).abs(),
            _ => 1.0,
        };
        (peak > static_gain * (1.0 + LEAST_PEAK)).then(|| (angle / (2.0 * PI * self.period), peak))
    }

    /// Samples the response from 0.1 Hz to the Nyquist frequency, at 200 frequencies per decade and near resonances.
    pub fn sample(&self) -> FrequencyResponse {
        let nyquist = self.nyquist_frequency();
        let first = FIRST_FREQUENCY.min(nyquist / 10_f64.powf(LEAST_DECADES));
        let count = ((nyquist / first).log10() * POINTS_PER_DECADE).ceil();
        let at = |i: usize| first * (nyquist / first).powf(i as f64 / count);
        let mut frequencies: Vec<f64> = (0..count as usize).map(at).collect();
        for pole in self.poles_near_circle() {
            let depth = (1.0 - pole.norm()).abs();
            if depth < REFINEMENT_DEPTH && pole.im > 0.0 {
                let near = REFINEMENT.map(|offset| pole.arg() + offset * depth);
                frequencies.extend(near.map(|angle| angle / (2.0 * PI * self.period)));
            }
        }
        frequencies.retain(|frequency| (first..nyquist).contains(frequency));
        frequencies.push(nyquist);
        frequencies.sort_by(f64::total_cmp);
        frequencies.dedup();
        self.sample_at(frequencies)
    }

    /// Samples the response at `frequencies`, Hz.
    pub fn sample_at(&self, frequencies: Vec<f64>) -> FrequencyResponse {
        FrequencyResponse {
            open: frequencies.iter().map(|frequency| self.open(*frequency)).collect(),
            closed: frequencies.iter().map(|frequency| self.closed(*frequency)).collect(),
            frequencies,
        }
    }

    /// Returns the angle per sample of a frequency in Hz, rad; exactly π at the Nyquist frequency.
    fn angle(&self, frequency: f64) -> f64 {
        if frequency == self.nyquist_frequency() { PI } else { 2.0 * PI * frequency * self.period }
    }

    fn closed_at(&self, angle: f64) -> Complex<f64> {
        let Transfer::Position { model, controller } = &self.transfer else {
            let l = self.at(angle);
            // Neither form overflows near a pole of L or divides by a zero of L.
            return if l.norm() < 1.0 { l / (l + 1.0) } else { (l.inv() + 1.0).inv() };
        };
        let delay = delay(angle);
        let characteristic = sum(&product(model.a(), controller.s()), &product(model.b(), controller.r()));
        let preview = value(controller.t(), delay.inv()) * delay.powi(-controller.t_first() as i32);
        value(model.b(), delay) * preview / value(&characteristic, delay)
    }
}

/// Returns z − 1 at a frequency in rad per sample, without cancellation.
fn increment(angle: f64) -> Complex<f64> {
    let half = (angle / 2.0).sin();
    Complex::new(-2.0 * half * half, if angle == PI { 0.0 } else { angle.sin() })
}

impl LoopTransfer for LoopResponse {
    fn at(&self, angle: f64) -> Complex<f64> {
        let l = match &self.transfer {
            Transfer::Current(open) => open.at(delay(angle).inv()),
            Transfer::Velocity { controller, filters, plant } => {
                let (delay, increment) = (delay(angle), increment(angle));
                let filtered = controller.transfer(increment) * filters.transfer(delay);
                plant.at(delay.inv()).map(|change| filtered * change / increment)
            }
            Transfer::Position { model, controller } => {
                return OpenLoop { model, rst: controller }.at(angle);
            }
        };
        l.filter(|l| l.is_finite()).unwrap_or_else(|| f64::MAX.sqrt().into())
    }

    fn static_gain(&self) -> Option<f64> {
        match &self.transfer {
            Transfer::Current(open) => Some(open.at(1.0.into())?.re),
            Transfer::Velocity { .. } => None,
            Transfer::Position { model, controller } => OpenLoop { model, rst: controller }.static_gain(),
        }
    }

    fn period(&self) -> f64 {
        self.period
    }

    fn poles_near_circle(&self) -> Vec<Complex<f64>> {
        match &self.transfer {
            Transfer::Current(open) => open.poles(),
            Transfer::Velocity { filters, plant, .. } => {
                plant.poles().into_iter().chain(filters.poles()).collect()
            }
            Transfer::Position { model, controller } => {
                OpenLoop { model, rst: controller }.poles_near_circle()
            }
        }
    }
}

/// Sampled frequency response of a loop.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// Frequencies, Hz, in rising order.
    pub frequencies: Vec<f64>,
    /// Open loop L.
    pub open: Vec<Complex<f64>>,
    /// Closed loop, from the setpoint to the controlled value.
    pub closed: Vec<Complex<f64>>,
}

/// Computes magnitudes in dB.
pub fn magnitudes_db(response: &[Complex<f64>]) -> Vec<f64> {
    response.iter().map(|value| 20.0 * value.norm().log10()).collect()
}

/// Computes continuous phases in rad; the first one is from −3π/2 to π/2, and successive ones differ by at most π.
pub fn continuous_phases(response: &[Complex<f64>]) -> Vec<f64> {
    let mut previous = None;
    let phase = |value: &Complex<f64>| {
        let lowest = previous.map_or(FIRST_PHASE, |phase: f64| phase - PI);
        let phase = lowest + (value.arg() - lowest).rem_euclid(2.0 * PI);
        previous = Some(phase);
        phase
    };
    response.iter().map(phase).collect()
}
