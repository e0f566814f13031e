//! Closed-loop refinement: joint nonlinear least squares on positions and currents.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use serde::{Serialize, Serializer};

use super::closed_loop::simulate_all;
use super::experiment::{Experiment, SimulatedExperiment};
use super::fit::{BoundedParameter, Effort, NonlinearFit, minimize};
use super::friction::FrictionLaw;
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig, Periods};
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::{MILLISECOND, POSITION_GAIN};

/// Number of passes; each one recomputes the weights of the channels from the residuals.
const ROUNDS: usize = 2;
/// Step of the difference quotients, relative to the scale of a parameter.
const STEP: f64 = 1e-3;
/// Correlation above which a finding names a pair of parameters.
pub const CORRELATED: f64 = 0.95;
/// Fixed exponent of a linear friction law, min/m or min/rev.
const STRAIGHT: f64 = super::friction::LINEAR_EXPONENT;

/// Parameter of the closed-loop refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefinedParameter {
    /// Equivalent inertia Jeq, kg·m² (kg).
    Inertia,
    /// Friction coefficient a, A.
    FrictionA,
    /// Friction exponent b, min/m or min/rev.
    FrictionB,
    /// Friction coefficient c, A.
    FrictionC,
    /// Friction exponent d, min/m or min/rev.
    FrictionD,
    /// Breakaway current i0 as a separate parameter, A.
    Breakaway,
    /// Coulomb level of a linear law, A.
    Coulomb,
    /// Viscous slope of a linear law, A per m/min or rev/min.
    Viscous,
    /// Weight W, N.
    Weight,
    /// Tilting torque k cos φ, N·m.
    TiltSine,
    /// Tilting torque k sin φ, N·m.
    TiltCosine,
    /// Velocity feedforward weight VFFW.
    VelocityFeedforward,
    /// Torque feedforward weight TFFW, kg·m² (kg).
    TorqueFeedforward,
    /// Position-loop gain Kp, s⁻¹.
    PositionGain,
    /// Velocity-loop gain Kv, N·m/(rad/s).
    VelocityGain,
    /// Integral time Tv of the velocity loop, s.
    VelocityIntegralTime,
}

impl fmt::Display for RefinedParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            RefinedParameter::Inertia => "inertia",
            RefinedParameter::FrictionA => "friction.a",
            RefinedParameter::FrictionB => "friction.b",
            RefinedParameter::FrictionC => "friction.c",
            RefinedParameter::FrictionD => "friction.d",
            RefinedParameter::Breakaway => "friction.i0",
            RefinedParameter::Coulomb => "Coulomb level",
            RefinedParameter::Viscous => "viscous slope",
            RefinedParameter::Weight => "gravity.weight_n",
            RefinedParameter::TiltSine => "gravity k cos φ",
            RefinedParameter::TiltCosine => "gravity k sin φ",
            RefinedParameter::VelocityFeedforward => "feedforward.velocity",
            RefinedParameter::TorqueFeedforward => "feedforward.torque",
            RefinedParameter::PositionGain => "position_loop.gain",
            RefinedParameter::VelocityGain => "velocity_loop.gain",
            RefinedParameter::VelocityIntegralTime => "velocity_loop.integral_time",
        })
    }
}

impl Serialize for RefinedParameter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl RefinedParameter {
    /// Returns the SI value of the unit that the parameter has in a machine file.
    pub fn unit_size(self) -> f64 {
        match self {
            RefinedParameter::PositionGain => POSITION_GAIN,
            RefinedParameter::VelocityIntegralTime => MILLISECOND,
            _ => 1.0,
        }
    }

    /// Returns the gravity parameters of an axis.
    pub fn of_gravity(axis: &AxisConfig) -> &'static [RefinedParameter] {
        match axis.kind() {
            AxisKind::Linear => &[RefinedParameter::Weight],
            AxisKind::Rotary => &[RefinedParameter::TiltSine, RefinedParameter::TiltCosine],
        }
    }

    /// Returns the parameters of a friction law.
    pub fn of_friction(law: FrictionLaw) -> &'static [RefinedParameter] {
        match law {
            FrictionLaw::DoubleExponential => &[
                RefinedParameter::FrictionA,
                RefinedParameter::FrictionB,
                RefinedParameter::FrictionC,
                RefinedParameter::FrictionD,
            ],
            FrictionLaw::Linear => &[RefinedParameter::Coulomb, RefinedParameter::Viscous],
        }
    }

    /// Returns the value on an axis, SI.
    pub fn get(self, axis: &AxisConfig) -> f64 {
        let (f, g) = (&axis.friction, &axis.gravity);
        match self {
            RefinedParameter::Inertia => axis.motor.inertia,
            RefinedParameter::FrictionA => f.a,
            RefinedParameter::FrictionB => f.b,
            RefinedParameter::FrictionC => f.c,
            RefinedParameter::FrictionD => f.d,
            RefinedParameter::Breakaway => f.i0,
            RefinedParameter::Coulomb => f.a + f.c,
            RefinedParameter::Viscous => (f.a - f.c) * STRAIGHT,
            RefinedParameter::Weight => g.weight,
            RefinedParameter::TiltSine => g.tilt * g.phase.cos(),
            RefinedParameter::TiltCosine => g.tilt * g.phase.sin(),
            RefinedParameter::VelocityFeedforward => axis.feedforward.velocity,
            RefinedParameter::TorqueFeedforward => axis.feedforward.torque,
            RefinedParameter::PositionGain => axis.position_loop.gain,
            RefinedParameter::VelocityGain => axis.velocity_loop.gain,
            RefinedParameter::VelocityIntegralTime => axis.velocity_loop.integral_time,
        }
    }

    /// Returns the scale of changes of the parameter, SI.
    pub(super) fn scale(self, axis: &AxisConfig) -> f64 {
        let friction = (axis.friction.a + axis.friction.c).abs().max(1e-3 * axis.motor.max_current);
        let force = axis.motor.torque_constant / axis.transmission_ratio;
        match self {
            RefinedParameter::Inertia | RefinedParameter::TorqueFeedforward => axis.motor.inertia,
            RefinedParameter::FrictionA
            | RefinedParameter::FrictionC
            | RefinedParameter::Coulomb
            | RefinedParameter::Breakaway => friction,
            RefinedParameter::FrictionB => 0.02,
            RefinedParameter::FrictionD => axis.friction.d.abs().max(0.1),
            RefinedParameter::Viscous => friction / 20.0,
            RefinedParameter::Weight | RefinedParameter::TiltSine | RefinedParameter::TiltCosine => {
                force * friction
            }
            RefinedParameter::VelocityFeedforward => 1.0,
            RefinedParameter::PositionGain
            | RefinedParameter::VelocityGain
            | RefinedParameter::VelocityIntegralTime => self.get(axis),
        }
    }

    fn bounds(self, axis: &AxisConfig) -> (f64, f64) {
        let (value, scale) = (self.get(axis), self.scale(axis));
        match self {
            RefinedParameter::Inertia => (value / 10.0, value * 10.0),
            RefinedParameter::FrictionB => (-0.05, 0.1),
            RefinedParameter::FrictionD => (-10.0, -0.05),
            RefinedParameter::Coulomb
            | RefinedParameter::Viscous
            | RefinedParameter::FrictionA
            | RefinedParameter::Breakaway => (0.0, value.abs() * 5.0 + 5.0 * scale),
            RefinedParameter::VelocityFeedforward => (0.0, 2.0),
            RefinedParameter::TorqueFeedforward => (0.0, 2.0 * scale),
            _ => (value - 10.0 * scale, value + 10.0 * scale),
        }
    }
}

/// Returns a copy of an axis with changed parameters. If `held`, i0 is set to a + c.
pub(super) fn with_parameters(
    axis: &AxisConfig,
    parameters: &[RefinedParameter],
    values: &[f64],
    held: bool,
) -> AxisConfig {
    let mut axis = axis.clone();
    let (mut line, mut tilt) = (None, None);
    let tilted =
        |axis: &AxisConfig| (RefinedParameter::TiltSine.get(axis), RefinedParameter::TiltCosine.get(axis));
    for (parameter, &value) in parameters.iter().zip(values) {
        let straight = (RefinedParameter::Coulomb.get(&axis), RefinedParameter::Viscous.get(&axis));
        match parameter {
            RefinedParameter::Inertia => axis.motor.inertia = value,
            RefinedParameter::FrictionA => axis.friction.a = value,
            RefinedParameter::FrictionB => axis.friction.b = value,
            RefinedParameter::FrictionC => axis.friction.c = value,
            RefinedParameter::FrictionD => axis.friction.d = value,
            RefinedParameter::Breakaway => axis.friction.i0 = value,
            RefinedParameter::Coulomb => line = Some((value, line.unwrap_or(straight).1)),
            RefinedParameter::Viscous => line = Some((line.unwrap_or(straight).0, value)),
            RefinedParameter::Weight => axis.gravity.weight = value,
            RefinedParameter::TiltSine => tilt = Some((value, tilt.unwrap_or(tilted(&axis)).1)),
            RefinedParameter::TiltCosine => tilt = Some((tilt.unwrap_or(tilted(&axis)).0, value)),
            RefinedParameter::VelocityFeedforward => axis.feedforward.velocity = value,
            RefinedParameter::TorqueFeedforward => axis.feedforward.torque = value,
            RefinedParameter::PositionGain => axis.position_loop.gain = value,
            RefinedParameter::VelocityGain => axis.velocity_loop.gain = value,
            RefinedParameter::VelocityIntegralTime => axis.velocity_loop.integral_time = value,
        }
    }
    if let Some((level, slope)) = line {
        axis.friction = FrictionConfig { i0: axis.friction.i0, ..super::friction::linear_law(level, slope) };
    }
    // The friction at standstill a + c is not negative; the bounds of b and d keep their order.
    axis.friction.c = axis.friction.c.max(-axis.friction.a);
    if let Some((sine, cosine)) = tilt {
        (axis.gravity.tilt, axis.gravity.phase) = (sine.hypot(cosine), cosine.atan2(sine));
    }
    if held {
        axis.friction.i0 = (axis.friction.a + axis.friction.c).max(0.0);
    }
    axis
}

/// Refined parameter with standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RefinedValue {
    /// Parameter.
    pub parameter: RefinedParameter,
    /// Value before the refinement, SI.
    pub before: f64,
    /// Refined value, SI.
    pub value: f64,
    /// Standard error, SI.
    pub error: f64,
    /// True if the value is at one of its bounds.
    #[serde(rename = "at_bound")]
    pub is_at_bound: bool,
}

/// Result of the closed-loop refinement.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// Axis with the refined parameters.
    pub(super) axis: AxisConfig,
    /// Refined parameters.
    pub parameters: Vec<RefinedValue>,
    /// Correlation matrix of the parameters.
    pub correlations: Vec<Vec<f64>>,
    /// RMS position residual before and after, m or rad.
    pub position: (f64, f64),
    /// RMS current residual before and after, A; none without currents.
    pub current: Option<(f64, f64)>,
}

impl Refinement {
    /// Returns the pairs of parameters whose correlation exceeds 0.95, with the correlation.
    pub fn correlated_pairs(&self) -> Vec<(RefinedParameter, RefinedParameter, f64)> {
        let mut found = Vec::new();
        for (j, row) in self.correlations.iter().enumerate() {
            for (k, rho) in row.iter().enumerate().take(j) {
                if rho.abs() > CORRELATED {
                    found.push((self.parameters[k].parameter, self.parameters[j].parameter, *rho));
                }
            }
        }
        found
    }
}

/// Recorded channel, if present, and simulated channel.
type Channel<'a> = (Option<&'a Vec<f64>>, &'a Vec<f64>);

/// Returns the residuals of one channel, simulated minus recorded, without missing values.
fn channel_residuals<'a>(
    experiments: &'a [Experiment],
    simulated: &'a [SimulatedExperiment],
    channel: fn(&'a Experiment, &'a SimulatedExperiment) -> Channel<'a>,
) -> impl Iterator<Item = f64> + 'a {
    experiments.iter().zip(simulated).flat_map(move |(experiment, simulated)| {
        let (recorded, simulated) = channel(experiment, simulated);
        recorded.into_iter().flatten().zip(simulated).map(|(r, s)| s - r).filter(|d| !d.is_nan())
    })
}

fn positions<'a>(e: &'a Experiment, s: &'a SimulatedExperiment) -> Channel<'a> {
    (Some(&e.position), &s.position)
}

fn currents<'a>(e: &'a Experiment, s: &'a SimulatedExperiment) -> Channel<'a> {
    (e.current.as_ref(), &s.current)
}

/// Refines `parameters` of an axis by minimizing the deviation of its simulation from the recordings.
///
/// Residuals of position and current are weighted by their RMS (maximum likelihood for normal noise of
/// unknown variance). Returns none if the axis cannot be simulated or the recordings do not determine the
/// parameters.
pub fn refine(
    axis: &AxisConfig,
    periods: &Periods,
    experiments: &[Experiment],
    parameters: &[RefinedParameter],
    held: bool,
) -> Option<Refinement> {
    let spread = |axis: &AxisConfig| {
        let simulated = simulate_all(axis, periods, experiments).ok()?;
        let position = rms(channel_residuals(experiments, &simulated, positions))?;
        Some((position, rms(channel_residuals(experiments, &simulated, currents))))
    };
    let before = spread(axis)?;
    let (mut present, mut left) = (axis.clone(), before);
    let mut minimum: Option<NonlinearFit> = None;
    for _ in 0..ROUNDS {
        let weights = (1.0 / left.0.max(f64::MIN_POSITIVE), left.1.map(|s| 1.0 / s.max(f64::MIN_POSITIVE)));
        let bounded: Vec<BoundedParameter> = parameters
            .iter()
            .map(|parameter| {
                let (low, high) = parameter.bounds(axis);
                let start = parameter.get(&present).clamp(low, high);
                BoundedParameter { start, low, high, step: STEP * parameter.scale(axis) }
            })
            .collect();
        let found = minimize(&bounded, Effort::Simulation, |values| {
            let moved = with_parameters(&present, parameters, values, held);
            let simulated = simulate_all(&moved, periods, experiments).ok()?;
            let mut residuals: Vec<f64> =
                channel_residuals(experiments, &simulated, positions).map(|d| d * weights.0).collect();
            if let Some(weight) = weights.1 {
                residuals.extend(channel_residuals(experiments, &simulated, currents).map(|d| d * weight));
            }
            residuals.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(residuals))
        })?;
        present = with_parameters(&present, parameters, &found.values, held);
        left = spread(&present)?;
        minimum = Some(found);
    }
    let minimum = minimum?;
    let refined = parameters.iter().enumerate().map(|(k, &parameter)| RefinedValue {
        parameter,
        before: parameter.get(axis),
        value: minimum.values[k],
        error: minimum.error(k),
        is_at_bound: minimum.is_at_bound[k],
    });
    let count = parameters.len();
    let correlations = DMatrix::from_fn(count, count, |j, k| minimum.correlation(j, k));
    Some(Refinement {
        parameters: refined.collect(),
        correlations: correlations.row_iter().map(|row| row.iter().copied().collect()).collect(),
        position: (before.0, left.0),
        current: before.1.zip(left.1),
        axis: present,
    })
}
