//! Refinement beyond the paper: parameters by joint least squares on the whole closed loop.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use super::closed_loop::{Experiment, Simulated, simulate_all};
use super::fit::{Bounded, Effort, Minimum, minimize};
use super::friction::FrictionLaw;
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig, Periods};

/// Rounds in which the weights of the channels are taken anew from what is left.
const ROUNDS: usize = 2;
/// Step of the difference quotients, part of a parameter's scale.
const STEP: f64 = 1e-3;
/// Parameters correlated more than this are named.
pub const CORRELATED: f64 = 0.95;
/// Friction written as a straight line keeps its exponents, min/m or min/rev.
const STRAIGHT: f64 = super::friction::STRAIGHT;

/// A parameter that can be refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// Jeq, kg·m² (kg).
    Inertia,
    /// a of the friction law, A.
    FrictionA,
    /// b, min/m or min/rev.
    FrictionB,
    /// c, A.
    FrictionC,
    /// d, min/m or min/rev.
    FrictionD,
    /// i0 where it is not a + c, A.
    Breakaway,
    /// Coulomb level of a straight law, A.
    Coulomb,
    /// Slope of a straight law, A per m/min or rev/min.
    Viscous,
    /// W, N.
    Weight,
    /// k cos φ, N·m.
    TiltSine,
    /// k sin φ, N·m.
    TiltCosine,
    /// VFFW.
    VelocityFeedforward,
    /// TFFW, kg·m² (kg).
    TorqueFeedforward,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Parameter::Inertia => "inertia",
            Parameter::FrictionA => "friction.a",
            Parameter::FrictionB => "friction.b",
            Parameter::FrictionC => "friction.c",
            Parameter::FrictionD => "friction.d",
            Parameter::Breakaway => "friction.i0",
            Parameter::Coulomb => "Coulomb level",
            Parameter::Viscous => "viscous slope",
            Parameter::Weight => "gravity.weight_n",
            Parameter::TiltSine => "gravity k cos φ",
            Parameter::TiltCosine => "gravity k sin φ",
            Parameter::VelocityFeedforward => "feedforward.velocity",
            Parameter::TorqueFeedforward => "feedforward.torque",
        })
    }
}

impl Parameter {
    /// Those of gravity that an axis has.
    pub fn of_gravity(axis: &AxisConfig) -> &'static [Parameter] {
        match axis.kind() {
            AxisKind::Linear => &[Parameter::Weight],
            AxisKind::Rotary => &[Parameter::TiltSine, Parameter::TiltCosine],
        }
    }

    /// Those of a friction law.
    pub fn of_friction(law: FrictionLaw) -> &'static [Parameter] {
        match law {
            FrictionLaw::DoubleExponential => {
                &[Parameter::FrictionA, Parameter::FrictionB, Parameter::FrictionC, Parameter::FrictionD]
            }
            FrictionLaw::Linear => &[Parameter::Coulomb, Parameter::Viscous],
        }
    }

    /// Its value on an axis.
    pub fn get(self, axis: &AxisConfig) -> f64 {
        let (f, g) = (&axis.friction, &axis.gravity);
        match self {
            Parameter::Inertia => axis.motor.inertia,
            Parameter::FrictionA => f.a,
            Parameter::FrictionB => f.b,
            Parameter::FrictionC => f.c,
            Parameter::FrictionD => f.d,
            Parameter::Breakaway => f.i0,
            Parameter::Coulomb => f.a + f.c,
            Parameter::Viscous => (f.a - f.c) * STRAIGHT,
            Parameter::Weight => g.weight,
            Parameter::TiltSine => g.tilt * g.phase.cos(),
            Parameter::TiltCosine => g.tilt * g.phase.sin(),
            Parameter::VelocityFeedforward => axis.feedforward.velocity,
            Parameter::TorqueFeedforward => axis.feedforward.torque,
        }
    }

    /// What its changes are measured by.
    pub(super) fn scale(self, axis: &AxisConfig) -> f64 {
        let friction = (axis.friction.a + axis.friction.c).abs().max(1e-3 * axis.motor.max_current);
        let force = axis.motor.torque_constant / axis.transmission_ratio;
        match self {
            Parameter::Inertia | Parameter::TorqueFeedforward => axis.motor.inertia,
            Parameter::FrictionA | Parameter::FrictionC | Parameter::Coulomb | Parameter::Breakaway => {
                friction
            }
            Parameter::FrictionB => 0.02,
            Parameter::FrictionD => axis.friction.d.abs().max(0.1),
            Parameter::Viscous => friction / 20.0,
            Parameter::Weight | Parameter::TiltSine | Parameter::TiltCosine => force * friction,
            Parameter::VelocityFeedforward => 1.0,
        }
    }

    fn bounds(self, axis: &AxisConfig) -> (f64, f64) {
        let (value, scale) = (self.get(axis), self.scale(axis));
        match self {
            Parameter::Inertia => (value / 10.0, value * 10.0),
            Parameter::FrictionB => (-0.05, 0.1),
            Parameter::FrictionD => (-10.0, -0.05),
            Parameter::Coulomb | Parameter::Viscous | Parameter::FrictionA | Parameter::Breakaway => {
                (0.0, value.abs() * 5.0 + 5.0 * scale)
            }
            Parameter::VelocityFeedforward => (0.0, 2.0),
            Parameter::TorqueFeedforward => (0.0, 2.0 * scale),
            _ => (value - 10.0 * scale, value + 10.0 * scale),
        }
    }
}

/// An axis with other values of some parameters; i0 goes with a + c where it is held.
pub(super) fn with(axis: &AxisConfig, parameters: &[Parameter], values: &[f64], held: bool) -> AxisConfig {
    let mut axis = axis.clone();
    let (mut line, mut tilt) = (None, None);
    let tilted = |axis: &AxisConfig| (Parameter::TiltSine.get(axis), Parameter::TiltCosine.get(axis));
    for (parameter, &value) in parameters.iter().zip(values) {
        let straight = (Parameter::Coulomb.get(&axis), Parameter::Viscous.get(&axis));
        match parameter {
            Parameter::Inertia => axis.motor.inertia = value,
            Parameter::FrictionA => axis.friction.a = value,
            Parameter::FrictionB => axis.friction.b = value,
            Parameter::FrictionC => axis.friction.c = value,
            Parameter::FrictionD => axis.friction.d = value,
            Parameter::Breakaway => axis.friction.i0 = value,
            Parameter::Coulomb => line = Some((value, line.unwrap_or(straight).1)),
            Parameter::Viscous => line = Some((line.unwrap_or(straight).0, value)),
            Parameter::Weight => axis.gravity.weight = value,
            Parameter::TiltSine => tilt = Some((value, tilt.unwrap_or(tilted(&axis)).1)),
            Parameter::TiltCosine => tilt = Some((tilt.unwrap_or(tilted(&axis)).0, value)),
            Parameter::VelocityFeedforward => axis.feedforward.velocity = value,
            Parameter::TorqueFeedforward => axis.feedforward.torque = value,
        }
    }
    if let Some((level, slope)) = line {
        axis.friction =
            FrictionConfig { i0: axis.friction.i0, ..super::friction::straight_law(level, slope) };
    }
    if let Some((sine, cosine)) = tilt {
        (axis.gravity.tilt, axis.gravity.phase) = (sine.hypot(cosine), cosine.atan2(sine));
    }
    if held {
        axis.friction.i0 = (axis.friction.a + axis.friction.c).max(0.0);
    }
    axis
}

/// A refined parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined {
    /// Which one.
    pub parameter: Parameter,
    /// Value before, SI.
    pub before: f64,
    /// Value now, SI.
    pub value: f64,
    /// Standard error, SI.
    pub error: f64,
    /// Whether it ended at one of its bounds.
    pub at_bound: bool,
}

/// What the refinement came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// The axis with the refined parameters.
    pub(super) axis: AxisConfig,
    /// Each parameter.
    pub parameters: Vec<Refined>,
    /// Coefficients of correlation, a row and a column for each parameter.
    pub correlations: Vec<Vec<f64>>,
    /// RMS of the deviations of position before and after, m or rad.
    pub position: (f64, f64),
    /// RMS of the deviations of current before and after, A; none without currents.
    pub current: Option<(f64, f64)>,
}

impl Refinement {
    /// Pairs of parameters that the recordings can hardly tell apart, with their correlation.
    pub fn correlated(&self) -> Vec<(Parameter, Parameter, f64)> {
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

/// A channel as it was recorded, if it was, and as it is simulated.
type Channel<'a> = (Option<&'a Vec<f64>>, &'a Vec<f64>);

/// Deviations of one channel, simulated minus recorded; recorded values that are missing are left out.
fn differences<'a>(
    experiments: &'a [Experiment],
    simulated: &'a [Simulated],
    channel: fn(&'a Experiment, &'a Simulated) -> Channel<'a>,
) -> impl Iterator<Item = f64> + 'a {
    experiments.iter().zip(simulated).flat_map(move |(experiment, simulated)| {
        let (recorded, simulated) = channel(experiment, simulated);
        recorded.into_iter().flatten().zip(simulated).map(|(r, s)| s - r).filter(|d| !d.is_nan())
    })
}

fn positions<'a>(e: &'a Experiment, s: &'a Simulated) -> Channel<'a> {
    (Some(&e.position), &s.position)
}

fn currents<'a>(e: &'a Experiment, s: &'a Simulated) -> Channel<'a> {
    (e.current.as_ref(), &s.current)
}

fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, squares) = values.fold((0_usize, 0.0), |(n, sum), d| (n + 1, sum + d * d));
    (count > 0).then(|| (squares / count as f64).sqrt())
}

/// Moves `parameters` of an axis so that its simulation comes closest to what was recorded.
///
/// Deviations of position and current are weighted by what is left of them (maximum likelihood of normal
/// noise of unknown size). None if the axis cannot be simulated or the recordings do not determine the
/// parameters.
pub fn refine(
    axis: &AxisConfig,
    periods: &Periods,
    experiments: &[Experiment],
    parameters: &[Parameter],
    held: bool,
) -> Option<Refinement> {
    let spread = |axis: &AxisConfig| {
        let simulated = simulate_all(axis, periods, experiments).ok()?;
        let position = rms(differences(experiments, &simulated, positions))?;
        Some((position, rms(differences(experiments, &simulated, currents))))
    };
    let before = spread(axis)?;
    let (mut present, mut left) = (axis.clone(), before);
    let mut minimum: Option<Minimum> = None;
    for _ in 0..ROUNDS {
        let weights = (1.0 / left.0.max(f64::MIN_POSITIVE), left.1.map(|s| 1.0 / s.max(f64::MIN_POSITIVE)));
        let bounded: Vec<Bounded> = parameters
            .iter()
            .map(|parameter| {
                let (low, high) = parameter.bounds(axis);
                let start = parameter.get(&present).clamp(low, high);
                Bounded { start, low, high, step: STEP * parameter.scale(axis) }
            })
            .collect();
        let found = minimize(&bounded, Effort::Simulation, |values| {
            let moved = with(&present, parameters, values, held);
            let simulated = simulate_all(&moved, periods, experiments).ok()?;
            let mut residuals: Vec<f64> =
                differences(experiments, &simulated, positions).map(|d| d * weights.0).collect();
            if let Some(weight) = weights.1 {
                residuals.extend(differences(experiments, &simulated, currents).map(|d| d * weight));
            }
            residuals.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(residuals))
        })?;
        present = with(&present, parameters, &found.values, held);
        left = spread(&present)?;
        minimum = Some(found);
    }
    let minimum = minimum?;
    let refined = parameters.iter().enumerate().map(|(k, &parameter)| Refined {
        parameter,
        before: parameter.get(axis),
        value: minimum.values[k],
        error: minimum.error(k),
        at_bound: minimum.at_bound[k],
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
