//! Electrical energy of a motor over one tick.
//!
//! The voltage equation L di/dt = u − R i − Ke ω times (Kt/Ke) i is a balance of powers:
//!
//! ```text
//! (Kt/Ke) u i  =  (Kt/Ke) R i²  +  Kt i ω  +  d/dt ½ (Kt/Ke) L i²
//! electrical      copper loss      mechanical  magnetic energy
//! ```
//!
//! Kt/Ke is the number of phases, 3 if both constants are per phase and rms: the power of a synchronous machine with the
//! current in phase with the back EMF (Pillay and Krishnan, Modeling, simulation, and analysis of permanent-magnet motor
//! drives, IEEE Trans. Ind. Appl. 25, 1989). Iron losses and those of the inverter are not in the model.
//!
//! The voltage is held over a tick of length T, so that its input is (Kt/Ke) u ∫i dt, and the voltage equation integrated
//! is exact: R ∫i dt = u T − Ke Δθ − L Δi. The current over the tick is the polynomial of degree 4 with the values, the
//! slopes (by the voltage equation) and the integral of i; ∫i² dt of it is exact in its Legendre coefficients. Its
//! relative error is of the order (T/τ)⁵/1000 with the shortest time constant τ of the motor.

use crate::config::MotorConfig;

use super::MotorState;

/// Resistance times tick over inductance below which the integral of the current is that of the cubic polynomial: the
/// quotient of small differences by R would lose digits.
const LEAST_DAMPING: f64 = 1e-5;

/// Electrical input and copper loss over one tick, J.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TickEnergy {
    /// Electrical input, negative while the motor feeds energy back.
    pub input: f64,
    /// Copper loss.
    pub copper_loss: f64,
}

/// Energy balance of the winding of a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorEnergy {
    /// Kt/Ke; 1 for a motor without back EMF, whose mechanical work the balance does not contain.
    phases: f64,
    resistance: f64,
    inductance: f64,
    emf_constant: f64,
    /// T, s.
    tick: f64,
}

impl MotorEnergy {
    /// Creates the balance of `motor` for ticks of `tick` s.
    pub fn new(motor: &MotorConfig, tick: f64) -> Self {
        let MotorConfig { resistance, inductance, emf_constant, torque_constant, .. } = *motor;
        let phases = if emf_constant > 0.0 { torque_constant / emf_constant } else { 1.0 };
        MotorEnergy { phases, resistance, inductance, emf_constant, tick }
    }

    /// Returns the magnetic energy at a current (A), J.
    pub fn magnetic(&self, current: f64) -> f64 {
        0.5 * self.phases * self.inductance * current * current
    }

    /// Returns input and copper loss of a tick from the states at its ends, under a held `voltage`, V.
    #[inline]
    pub fn over_tick(&self, start: &MotorState, end: &MotorState, voltage: f64) -> TickEnergy {
        let slope = |s: &MotorState| {
            0.5 * self.tick * (voltage - self.resistance * s.current - self.emf_constant * s.speed)
                / self.inductance
        };
        let (d0, d1) = (slope(start), slope(end));
        let (half_sum, half_step) =
            (0.5 * (end.current + start.current), 0.5 * (end.current - start.current));
        let mean = if self.resistance * self.tick > LEAST_DAMPING * self.inductance {
            let turned = self.emf_constant * (end.angle - start.angle);
            (voltage - (turned + 2.0 * self.inductance * half_step) / self.tick) / self.resistance
        } else {
            half_sum - (d1 - d0) / 6.0
        };
        // Legendre coefficients over the tick.
        let third = 0.2 * (0.5 * (d1 + d0) - half_step);
        let first = half_step - third;
        let even = half_sum - mean;
        let fourth = (0.5 * (d1 - d0) - 3.0 * even) / 7.0;
        let second = even - fourth;
        let square = mean * mean
            + first * first / 3.0
            + second * second / 5.0
            + third * third / 7.0
            + fourth * fourth / 9.0;
        let scale = self.phases * self.tick;
        TickEnergy { input: scale * voltage * mean, copper_loss: scale * self.resistance * square }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Parameters;
    use crate::drive::Motor;

    /// Ticks of the decay i₀ e^{−R t/L} of a short-circuited motor at rest, whose copper loss is the magnetic energy, and
    /// of a motor without resistance, whose current is a straight line.
    #[test]
    fn a_decaying_and_a_rising_current_have_their_closed_forms() {
        let config = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        let motor = config.axes()[0].motor;
        let (tick, rate) = (125e-6, motor.resistance / motor.inductance);
        let energy = MotorEnergy::new(&motor, tick);
        let state = |current| MotorState { current, speed: 0.0, angle: 1.0 };
        let (i0, i1) = (10.0, 10.0 * (-rate * tick).exp());
        let TickEnergy { input, copper_loss } = energy.over_tick(&state(i0), &state(i1), 0.0);
        let stored = energy.magnetic(i0) - energy.magnetic(i1);
        assert!(input == 0.0 && (copper_loss / stored - 1.0).abs() < 1e-12, "{copper_loss} J of {stored} J");

        let lossless = MotorConfig { resistance: 0.0, ..motor };
        let energy = MotorEnergy::new(&lossless, tick);
        let (voltage, i1) = (100.0, 100.0 * tick / motor.inductance);
        let TickEnergy { input, copper_loss } = energy.over_tick(&state(0.0), &state(i1), voltage);
        assert!(copper_loss == 0.0 && (input / energy.magnetic(i1) - 1.0).abs() < 1e-14, "{input} J");
    }

    /// The balance of a free tick of a moving motor: the mechanical work is the change of its kinetic energy.
    #[test]
    fn a_tick_without_torques_is_balanced() {
        let config = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        for axis in config.axes() {
            let (motor, tick) = (axis.motor, 125e-6);
            let energy = MotorEnergy::new(&motor, tick);
            let plant = Motor::new(&motor, tick).expect("can be discretized");
            for (current, speed, voltage) in [(5.0, 30.0, 40.0), (-8.0, 100.0, -20.0), (0.5, -2.0, 200.0)] {
                let start = MotorState { current, speed, angle: 3.0 };
                let end = plant.step(&start, voltage, 0.0);
                let TickEnergy { input, copper_loss } = energy.over_tick(&start, &end, voltage);
                let kinetic = 0.5 * motor.inertia * (end.speed + start.speed) * (end.speed - start.speed);
                let magnetic = energy.magnetic(end.current) - energy.magnetic(start.current);
                let size = input.abs() + copper_loss + kinetic.abs() + magnetic.abs();
                let imbalance = input - copper_loss - kinetic - magnetic;
                assert!(imbalance.abs() < 1e-9 * size, "{}: {imbalance} J of {size} J", axis.name());
            }
        }
    }
}
