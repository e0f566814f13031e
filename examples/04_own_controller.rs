//! Closes the position loop of X by a control law of the caller, once per position cycle.
//!
//! ```text
//! cargo run --release --example 04_own_controller
//! ```
//!
//! The proportional controller and the feedforward of X are switched off; the output of the own law is the velocity
//! setpoint Ω*.

use std::error::Error;
use std::sync::Arc;

use virtual_axes_core::config::{Parameters, Value, ValueSource};
use virtual_axes_core::machine::{Machine, MachineParameters};

/// Law with proportional and integral part.
pub struct OwnLaw {
    /// Gain, 1/s.
    pub gain: f64,
    /// Integral gain, 1/s².
    pub integral_gain: f64,
    integral: f64,
}

impl OwnLaw {
    /// Creates a law at rest.
    pub fn new(gain: f64, integral_gain: f64) -> Self {
        OwnLaw { gain, integral_gain, integral: 0.0 }
    }

    /// Returns the velocity of the axis, m/s, for a following error, m.
    fn update(&mut self, error: f64, period: f64) -> f64 {
        self.integral += error * period;
        self.gain * error + self.integral_gain * self.integral
    }
}

/// Returns the following error of the law after 2 s at 6 m/min, m.
pub fn run(mut law: OwnLaw) -> Result<f64, Box<dyn Error>> {
    let mut parameters = Parameters::embedded_default()?;
    for key in ["x.position_loop.gain", "x.feedforward.velocity", "x.feedforward.torque_kg_m2"] {
        parameters.set(key, Value::Double(0.0), &ValueSource::named("example"))?;
    }
    let config = parameters.machine_config()?;
    let period = config.periods().position as f64 * 1e-9;
    let meters_per_radian = config.axes()[0].transmission_ratio;
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config)?));
    let (mut psec, mut error) = ([0.0; 5], 0.0);
    for _ in 0..334 {
        psec[0] += 0.1 * period;
        let [position, ..] = machine.motion_at_end(0);
        error = psec[0] - position;
        let velocity = law.update(error, period);
        machine.set_velocity_offset(0, velocity / meters_per_radian);
        machine.advance(&psec, &[]);
    }
    Ok(error)
}

/// Prints the following errors of two laws.
pub fn main() -> Result<(), Box<dyn Error>> {
    println!("P: {:.3} mm", run(OwnLaw::new(20.0, 0.0))? * 1e3);
    println!("PI: {:.3} mm", run(OwnLaw::new(20.0, 100.0))? * 1e3);
    Ok(())
}
