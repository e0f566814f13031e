//! Motor and control loops against closed forms and independently computed matrices, to 1e-9 relative.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use virtual_axes_core::config::MotorConfig;
use virtual_axes_core::control::{Pi, PiState};
use virtual_axes_core::drive::{Motor, MotorState, Plant};
use virtual_axes_verification::fixtures::machines::{friction_of_x, machine, parameters};

const TICK: f64 = 125e-6;
const RELATIVE: f64 = 1e-9;

/// Motor of the default X axis, from its data sheet.
const MOTOR: MotorConfig = MotorConfig {
    inertia: 0.028,
    torque_constant: 2.64,
    emf_constant: 0.88,
    resistance: 0.46,
    inductance: 8.5e-3,
    max_current: 54.0,
    max_voltage: 245.0,
    max_speed: 209.0,
};

/// Closed-form solution of x' = A x + b for x = [i, ω], with θ = ∫ω.
struct ClosedForm {
    a: Matrix2<f64>,
    rest: Vector2<f64>,
    start: Vector2<f64>,
    b: Vector2<f64>,
}

impl ClosedForm {
    fn new(m: &MotorConfig, voltage: f64, torque: f64, current: f64, speed: f64) -> Self {
        let a = Matrix2::new(
            -m.resistance / m.inductance,
            -m.emf_constant / m.inductance,
            m.torque_constant / m.inertia,
            0.0,
        );
        let b = Vector2::new(voltage / m.inductance, torque / m.inertia);
        let rest = -a.try_inverse().expect("a steady state") * b;
        ClosedForm { a, rest, start: Vector2::new(current, speed), b }
    }

    /// Returns [i, ω] at time t: e^{At} of a 2×2 matrix by Cayley–Hamilton, A = μ ± jν or μ ± ν.
    fn at(&self, t: f64) -> Vector2<f64> {
        let mu = self.a.trace() / 2.0;
        let discriminant = mu * mu - self.a.determinant();
        let (cosine, sine) = if discriminant < 0.0 {
            let nu = (-discriminant).sqrt();
            ((nu * t).cos(), (nu * t).sin() / nu)
        } else {
            let nu = discriminant.sqrt();
            ((nu * t).cosh(), (nu * t).sinh() / nu)
        };
        let shifted = self.a - Matrix2::identity() * mu;
        let exponential = (Matrix2::identity() * cosine + shifted * sine) * (mu * t).exp();
        self.rest + exponential * (self.start - self.rest)
    }

    /// Returns θ at time t from θ(0) = 0: A ∫x = x(t) − x(0) − b t.
    fn angle(&self, t: f64) -> f64 {
        let integral = self.a.try_inverse().expect("invertible") * (self.at(t) - self.start - self.b * t);
        integral[1]
    }
}

#[track_caller]
fn assert_state(n: usize, s: &MotorState, exact: &ClosedForm, scale: (f64, f64, f64)) {
    let t = n as f64 * TICK;
    let x = exact.at(t);
    for (signal, value, wanted, scale) in [
        ("i", s.current, x[0], scale.0),
        ("ω", s.speed, x[1], scale.1),
        ("θ", s.angle, exact.angle(t), scale.2),
    ] {
        let error = (value - wanted).abs();
        assert!(error <= RELATIVE * scale, "tick {n}: {signal} = {value}, wanted {wanted}");
    }
}

#[test]
fn motor_at_constant_voltage() {
    let motor = Motor::new(&MOTOR, TICK).expect("can be discretized");
    let (voltage, torque) = (60.0, -3.0);
    let exact = ClosedForm::new(&MOTOR, voltage, torque, 0.0, 0.0);
    let mut s = MotorState::default();
    for n in 1..=4000 {
        s = motor.step(&s, voltage, torque);
        assert_state(n, &s, &exact, (exact.rest[0].abs(), exact.rest[1].abs(), exact.rest[1].abs() * 0.1));
    }
}

#[test]
fn decay_under_constant_friction_until_standstill() {
    let friction_current = 1.2;
    let friction = [friction_current, 0.0, 0.0, 0.0, friction_current];
    let config = parameters(&friction_of_x(friction)).machine_config().expect("valid");
    let plant = Plant::new(&config.axes()[0], TICK).expect("can be discretized");

    let speed = 1.5;
    let exact = ClosedForm::new(&MOTOR, 0.0, -2.64 * friction_current, 0.0, speed);
    let mut s = MotorState { current: 0.0, speed, angle: 0.0 };
    let mut moving = 0;
    // The solution holds as long as ω > 0 at the end of the step.
    while exact.at((moving + 1) as f64 * TICK)[1] > 0.0 {
        plant.step(&mut s, 0.0, 0.0);
        moving += 1;
        assert_state(moving, &s, &exact, (1.0, speed, speed * 0.01));
        assert!(moving < 100_000, "the motor does not stop");
    }
    assert!(moving > 50, "the motor stops too early");
    plant.step(&mut s, 0.0, 0.0);
    assert_eq!(s.speed, 0.0, "the tick in which the speed would reverse must end at standstill");
}

/// Computes e^A by a Taylor series with scaling and squaring, independent of the library.
fn exponential<const N: usize>(a: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    const HALVINGS: i32 = 10;
    let a = a * 0.5f64.powi(HALVINGS);
    let mut term = SMatrix::<f64, N, N>::identity();
    let mut sum = term;
    for k in 1..20 {
        term = term * a / f64::from(k);
        sum += term;
    }
    (0..HALVINGS).fold(sum, |m, _| m * m)
}

// Indices in the state of the linear cascade.
const I: usize = 0;
const W: usize = 1;
const TH: usize = 2;
const IV: usize = 3; // integral of the velocity PI
const II: usize = 4; // integral of the current PI
const U: usize = 5; // voltage, held
const IS: usize = 6; // current setpoint, held
const WS: usize = 7; // velocity setpoint, held
const REF: usize = 8; // setpoint of the outermost loop
const N: usize = 9;
type State = SVector<f64, N>;
type Map = SMatrix<f64, N, N>;

/// Returns the map of the plant over one tick: held voltage, no friction, no gravity.
fn plant_map() -> Map {
    let mut a = Map::zeros();
    a[(I, I)] = -MOTOR.resistance / MOTOR.inductance;
    a[(I, W)] = -MOTOR.emf_constant / MOTOR.inductance;
    a[(I, U)] = 1.0 / MOTOR.inductance;
    a[(W, I)] = MOTOR.torque_constant / MOTOR.inertia;
    a[(TH, W)] = 1.0;
    exponential(a * TICK)
}

/// Returns the map of a PI controller: J ← J + g·e, y ← (K·e + J)/scale; e = Σ sign·signal.
fn pi_map(
    gain: f64,
    step_gain: f64,
    scale: f64,
    integral: usize,
    output: usize,
    error: &[(usize, f64)],
) -> Map {
    let mut m = Map::identity();
    m[(output, output)] = 0.0;
    m[(output, integral)] = 1.0 / scale;
    for &(from, sign) in error {
        m[(integral, from)] += step_gain * sign;
        m[(output, from)] += (gain + step_gain) * sign / scale;
    }
    m
}

const KI: f64 = 13.0;
const TI: f64 = 2e-3;
const KV: f64 = 5.0;
const TV: f64 = 4e-3;
const TSV: f64 = 250e-6;

fn current_map() -> Map {
    pi_map(KI, KI * TICK / TI, 1.0, II, U, &[(IS, 1.0), (I, -1.0)])
}

fn velocity_map() -> Map {
    pi_map(KV, KV * TSV / TV, MOTOR.torque_constant, IV, IS, &[(WS, 1.0), (W, -1.0)])
}

#[test]
fn current_loop_step() {
    let motor = Motor::new(&MOTOR, TICK).expect("can be discretized");
    let config = virtual_axes_core::config::PiConfig { gain: KI, integral_time: TI };
    let pi = Pi::new(&config, TICK, 1.0, MOTOR.max_voltage);
    let (mut s, mut pi_state) = (MotorState::default(), PiState::default());
    let mut x = State::zeros();
    x[IS] = 5.0;
    let tick = plant_map() * current_map();
    for n in 0..2000 {
        let voltage = pi.update(&mut pi_state, 5.0 - s.current);
        s = motor.step(&s, voltage, 0.0);
        x = tick * x;
        assert!((s.current - x[I]).abs() <= RELATIVE * 5.0, "tick {n}: i = {}, wanted {}", s.current, x[I]);
        assert!((s.speed - x[W]).abs() <= RELATIVE * x[W].abs().max(1.0), "tick {n}: ω = {}", s.speed);
    }
}

/// Compares the response of the cascade to a step of the position setpoint with the linear maps at every tick.
fn cascade_step(kp: f64, periods: usize, step: f64) {
    let zero = 0.0;
    let mut m = machine(&[
        ("x.friction.a", zero),
        ("x.friction.c", zero),
        ("x.friction.i0", zero),
        ("x.feedforward.velocity", zero),
        ("x.feedforward.torque_kg_m2", zero),
        ("x.delays.alpha_ms", zero),
    ]);
    let ratio = 0.020 / std::f64::consts::TAU;
    let position = {
        let mut map = Map::identity();
        map[(WS, WS)] = 0.0;
        map[(WS, REF)] = kp;
        map[(WS, TH)] = -kp;
        map
    };
    let (plant, current, velocity) = (plant_map(), current_map(), velocity_map());
    let mut x = State::zeros();
    x[REF] = step / ratio;
    let scale = [0.0; 3];
    let mut scale = scale;
    for _ in 0..periods {
        x = position * x;
        let mut tick = 0;
        m.advance_with(&[step, 0.0, 0.0, 0.0, 0.0], &[], |m| {
            if tick % 2 == 0 {
                x = velocity * x;
            }
            x = current * x;
            tick += 1;
            let s = m.axis(0).sample();
            assert!(!s.saturated, "the step is too large for a linear comparison");
            let pairs = [(s.current, x[I]), (s.velocity, x[W] * ratio), (s.position, x[TH] * ratio)];
            for (k, (value, wanted)) in pairs.into_iter().enumerate() {
                scale[k] = f64::max(scale[k], wanted.abs());
                assert!(
                    (value - wanted).abs() <= RELATIVE * scale[k],
                    "signal {k}: {value}, wanted {wanted}"
                );
            }
            x = plant * x;
        });
    }
    assert!(x[TH] * ratio > 0.01 * step, "the axis did not move");
}

#[test]
fn velocity_loop_step_within_one_position_cycle() {
    // The position loop executes once, at the start: a step of Ω* for the velocity loop.
    cascade_step(25.0, 1, 1e-3);
}

#[test]
fn position_loop_step() {
    cascade_step(25.0, 80, 1e-3);
}
