//! Control loops of an axis as linear models, for frequency responses.

use std::f64::consts::PI;

use crate::config::{AxisConfig, Periods};
use crate::control::PiState;
use crate::design::{ControlLoop, LoopResponse, StateSpace};
use crate::drive::{LoadState, MotorState, Plant};
use crate::units::seconds;

use super::prediction::{LinearInnerLoops, deviating_plant_model, prediction_model};
use super::{AxisError, design_contour_controller, design_controller};

/// Returns the linear model of a control loop of an axis: its frequency response and margins.
///
/// The plant has its deviation; the position controller is that for the nominal plant. Friction, gravity, loads,
/// limits, feedforward, setpoint delays, the fallback controller and cross-coupled control are left out.
///
/// # Errors
/// [`AxisError`] if the motor cannot be discretized or, for the position loop, if the inner loops are unstable or the
/// position controller cannot be designed.
pub fn loop_response(
    axis: &AxisConfig,
    periods: &Periods,
    control_loop: ControlLoop,
) -> Result<LoopResponse, AxisError> {
    if control_loop == ControlLoop::Position {
        let controller = design_controller(axis, &prediction_model(axis, periods)?)?;
        return Ok(LoopResponse::position(deviating_plant_model(axis, periods)?, controller));
    }
    let (motor, transmission) = (Plant::deviating_motor(axis), Plant::deviating_transmission(axis));
    let loops = LinearInnerLoops::new(axis, &motor, transmission.as_ref(), periods)?;
    let drive = LinearDrive { loops: &loops, emf_constant: motor.emf_constant };
    Ok(match control_loop {
        ControlLoop::Current => {
            let open = drive.open_current_loop();
            LoopResponse::current(open, &drive.closed_current_loop(1), seconds(periods.current))
        }
        _ => {
            let plant = drive.closed_current_loop(periods.ticks_per_velocity());
            let closed = loops.velocity_loop_transition();
            LoopResponse::velocity(loops.velocity, loops.filters, plant, closed, seconds(periods.velocity))
        }
    })
}

/// Returns the linear model of the position loop of an axis across a path, with the gain K of cross-coupled control, 1/s, in
/// addition to the position controller; otherwise as [`loop_response`].
///
/// # Errors
/// [`AxisError`] as [`loop_response`] for the position loop.
pub fn contour_response(axis: &AxisConfig, periods: &Periods, gain: f64) -> Result<LoopResponse, AxisError> {
    let controller = design_contour_controller(axis, &prediction_model(axis, periods)?, gain)?;
    Ok(LoopResponse::position(deviating_plant_model(axis, periods)?, controller))
}

/// Undamped natural frequencies of an elastic axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NaturalFrequencies {
    /// Frequency of the load against a motor at rest, at which the motor cannot be moved, Hz.
    pub antiresonance: f64,
    /// Frequency of motor and load against each other, Hz.
    pub resonance: f64,
}

/// Returns the natural frequencies of an elastic axis with its deviation; `None` for a rigid axis.
pub fn natural_frequencies(axis: &AxisConfig) -> Option<NaturalFrequencies> {
    let elastic = Plant::deviating_transmission(axis)?;
    let motor_inertia = Plant::deviating_motor(axis).inertia - elastic.load_inertia;
    let load = elastic.stiffness / elastic.load_inertia;
    let hertz = |square: f64| square.sqrt() / (2.0 * PI);
    Some(NaturalFrequencies {
        antiresonance: hertz(load),
        resonance: hertz(load + elastic.stiffness / motor_inertia),
    })
}

/// Motor, load and current controller, relative to the speed ω of the motor: states i, I − Ke ω and, for an elastic
/// axis, the wind-up and ω_load − ω.
///
/// A constant ω with the voltage Ke ω is an equilibrium, so that these states do not depend on ω.
struct LinearDrive<'a> {
    loops: &'a LinearInnerLoops,
    emf_constant: f64,
}

impl LinearDrive<'_> {
    fn states(&self) -> usize {
        if self.loops.transmission.is_elastic() { 4 } else { 2 }
    }

    /// Steps the drive by `ticks` from ω = 0; `error` returns the error of the current controller for a current.
    /// Returns the states and ω.
    fn step(&self, state: &[f64], ticks: u64, error: impl Fn(f64) -> f64) -> (Vec<f64>, f64) {
        let at = |index: usize| state.get(index).copied().unwrap_or(0.0);
        let mut motor = MotorState { current: at(0), speed: 0.0, angle: 0.0 };
        let mut controller = PiState { integral: at(1), excess: 0.0 };
        let mut load = LoadState { wind_up: at(2), speed: at(3) };
        for _ in 0..ticks {
            let voltage = self.loops.current.update(&mut controller, error(motor.current));
            (motor, load) = self.loops.transmission.step(&self.loops.motor, &motor, &load, voltage, 0.0);
        }
        let integral = controller.integral - self.emf_constant * motor.speed;
        let all = [motor.current, integral, load.wind_up, load.speed - motor.speed];
        (all[..self.states()].to_vec(), motor.speed)
    }

    /// Returns the open current loop from the error to the current.
    fn open_current_loop(&self) -> StateSpace {
        StateSpace::from_step(self.states(), |state, error| (self.step(state, 1, |_| error).0, state[0]))
    }

    /// Returns the closed current loop from i*, held for `ticks`, to the change of ω.
    fn closed_current_loop(&self, ticks: u64) -> StateSpace {
        StateSpace::from_step(self.states(), |state, setpoint| {
            self.step(state, ticks, |current| setpoint - current)
        })
    }
}
