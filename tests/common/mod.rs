//! Motions of the reference trials, sampled on the position grid, and a run that shows every tick.
#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod recordings;

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, LazyLock};

use virtual_axes::config::{Assignment, MachineConfig, Parameters, Source, Value, parse_assignment};
use virtual_axes::machine::{Machine, MachineParameters};
use virtual_axes::path::Program;
use virtual_axes::scenario::Scenario;
use virtual_axes::simulation::joints;
use virtual_axes::trial::{Figures, ProgramSource, Setpoints, Tick, Trial, trace};

/// Position period of the default machine, s.
pub const TSP: f64 = 0.006;
/// Joints of the default machine.
pub const AXES: usize = 5;
/// One metre per minute, m/s.
pub const M_MIN: f64 = 1.0 / 60.0;

/// Parameters of the default machine with some of them changed, all at once.
pub fn parameters<K: AsRef<str>>(changes: &[(K, f64)]) -> Parameters {
    static DEFAULT: LazyLock<Parameters> =
        LazyLock::new(|| Parameters::embedded_default().expect("the embedded machine is valid"));
    let mut parameters = DEFAULT.clone();
    let assignments = changes.iter().map(|(key, value)| Assignment {
        key: key.as_ref().to_owned(),
        value: Value::Double(*value),
        source: Source::named("test"),
    });
    parameters.set_all(assignments.collect()).expect("the changes are valid");
    parameters
}

/// The default machine with some parameters changed.
pub fn machine(changes: &[(&str, f64)]) -> Machine {
    let config = parameters(changes).machine_config().expect("the machine is valid");
    Machine::new(Arc::new(MachineParameters::new(&config).expect("the machine can be discretised")))
}

/// A shipped machine with what `--set` would say for every joint: `position_loop.controller=gpc`.
pub fn configured(machine: &str, of_every_joint: &[&str]) -> MachineConfig {
    configured_with(machine, of_every_joint, &[])
}

/// Likewise, and what it would say for one joint: `a.gravity.tilt_nm=0`.
pub fn configured_with(machine: &str, of_every_joint: &[&str], of_one: &[&str]) -> MachineConfig {
    let mut parameters = Parameters::builtin(machine).expect("the machine is shipped");
    let source = Source::named("test");
    let names: Vec<String> =
        parameters.machine_config().expect("valid").axes().iter().map(|a| a.name().to_owned()).collect();
    let texts = names.iter().flat_map(|name| of_every_joint.iter().map(move |text| format!("{name}.{text}")));
    let texts = texts.chain(of_one.iter().map(|text| (*text).to_owned()));
    let assignments = texts.map(|text| parse_assignment(&text, &source).expect("an assignment")).collect();
    parameters.set_all(assignments).expect("the changes are valid");
    parameters.machine_config().expect("the machine is valid")
}

/// A shipped scenario planned for a machine.
pub fn program(name: &str, machine: &MachineConfig) -> Arc<Program> {
    let scenario = Scenario::builtin(name).expect("it is shipped");
    Arc::new(scenario.program(machine, None).unwrap_or_else(|error| panic!("{error}")))
}

/// Set-points of a planned scenario.
pub fn setpoints(name: &str, program: Arc<Program>, machine: &MachineConfig) -> Setpoints<'static> {
    let limits = joints(machine, "");
    Setpoints::Grid(Box::new(ProgramSource::new(program, name, &limits, machine.periods().position)))
}

/// Runs a shipped scenario and shows every tick.
pub fn watch_scenario(name: &str, machine: &MachineConfig, mut look: impl FnMut(Tick<'_>)) -> Figures {
    let program = program(name, machine);
    let trial = Trial {
        machine,
        program: Some(Arc::clone(&program)),
        allow_nonzero_end_velocity: false,
        record: false,
    };
    let outcome = trace(&trial, setpoints(name, program, machine), |tick| {
        look(tick);
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{name}: {error}")).figures
}

/// Friction of the X axis: a, b, c, d, i0.
pub fn friction_of_x([a, b, c, d, i0]: [f64; 5]) -> [(&'static str, f64); 5] {
    [
        ("x.friction.a", a),
        ("x.friction.b", b),
        ("x.friction.c", c),
        ("x.friction.d", d),
        ("x.friction.i0", i0),
    ]
}

/// Rest-to-rest profile along a path with limited velocity, acceleration and jerk.
///
/// Seven phases; acceleration and deceleration are mirror images.
#[derive(Debug, Clone, Copy)]
pub struct Profile {
    length: f64,
    velocity: f64,
    jerk: f64,
    /// Duration of each jerk phase, of constant acceleration, and of constant velocity, s.
    t_jerk: f64,
    t_acceleration: f64,
    t_velocity: f64,
}

impl Profile {
    /// `length` at `velocity`, both reached (the trials are long enough for it).
    pub fn new(length: f64, velocity: f64, acceleration: f64, jerk: f64) -> Self {
        let t_jerk = acceleration / jerk;
        let t_acceleration = velocity / acceleration - t_jerk;
        assert!(t_acceleration >= 0.0, "the acceleration is not reached");
        let t_velocity = length / velocity - (2.0 * t_jerk + t_acceleration);
        assert!(t_velocity >= 0.0, "the velocity is not reached");
        Profile { length, velocity, jerk, t_jerk, t_acceleration, t_velocity }
    }

    fn ramp(&self) -> f64 {
        2.0 * self.t_jerk + self.t_acceleration
    }

    /// Duration, s.
    pub fn duration(&self) -> f64 {
        2.0 * self.ramp() + self.t_velocity
    }

    /// Distance covered `t` seconds into the acceleration.
    fn accelerating(&self, t: f64) -> f64 {
        let j = self.jerk;
        let first = t.min(self.t_jerk);
        let mut s = j * first.powi(3) / 6.0;
        let (mut v, a) = (j * first.powi(2) / 2.0, j * self.t_jerk);
        let second = (t - self.t_jerk).clamp(0.0, self.t_acceleration);
        s += v * second + a * second.powi(2) / 2.0;
        v += a * second;
        let third = (t - self.t_jerk - self.t_acceleration).clamp(0.0, self.t_jerk);
        s + v * third + a * third.powi(2) / 2.0 - j * third.powi(3) / 6.0
    }

    /// Distance covered at time `t`.
    pub fn at(&self, t: f64) -> f64 {
        if t <= 0.0 {
            0.0
        } else if t < self.ramp() {
            self.accelerating(t)
        } else if t < self.ramp() + self.t_velocity {
            self.accelerating(self.ramp()) + self.velocity * (t - self.ramp())
        } else if t < self.duration() {
            self.length - self.accelerating(self.duration() - t)
        } else {
            self.length
        }
    }
}

/// The ballbar trial: circle in X–Y that starts at home, with cosine ramps and two full turns.
#[derive(Debug, Clone, Copy)]
pub struct Ballbar {
    pub radius: f64,
    pub velocity: f64,
}

impl Ballbar {
    pub const REST: f64 = 0.5;
    pub const RAMP: f64 = 0.5;
    pub const TURNS: f64 = 2.0;

    /// The paper's: 150 mm at 15 m/min.
    pub fn paper() -> Self {
        Ballbar { radius: 0.150, velocity: 15.0 * M_MIN }
    }

    fn steady(&self) -> f64 {
        Self::TURNS * TAU * self.radius / self.velocity
    }

    pub fn duration(&self) -> f64 {
        2.0 * (Self::REST + Self::RAMP) + self.steady()
    }

    /// From 0.5 s after the ramp up to 0.5 s before the ramp down.
    pub fn window(&self) -> std::ops::Range<f64> {
        let up = Self::REST + Self::RAMP;
        up + 0.5..up + self.steady() - 0.5
    }

    /// Distance along the circle.
    fn path(&self, t: f64) -> f64 {
        let ramped = |t: f64| self.velocity / 2.0 * (t - Self::RAMP / PI * (PI * t / Self::RAMP).sin());
        let ramp_length = self.velocity * Self::RAMP / 2.0;
        let t = (t - Self::REST).clamp(0.0, 2.0 * Self::RAMP + self.steady());
        if t < Self::RAMP {
            ramped(t)
        } else if t < Self::RAMP + self.steady() {
            ramp_length + self.velocity * (t - Self::RAMP)
        } else {
            let left = 2.0 * Self::RAMP + self.steady() - t;
            2.0 * ramp_length + self.velocity * self.steady() - ramped(left)
        }
    }

    /// Set-points of the five axes at time `t`.
    pub fn psec(&self, t: f64) -> [f64; AXES] {
        let angle = self.path(t) / self.radius;
        [self.radius * (angle.cos() - 1.0), self.radius * angle.sin(), 0.0, 0.0, 0.0]
    }

    /// Distance of a point from the circle, positive outside.
    pub fn radial_deviation(&self, x: f64, y: f64) -> f64 {
        ((x + self.radius).powi(2) + y * y).sqrt() - self.radius
    }
}

/// A machine with which nothing has happened yet.
pub fn at_rest(config: &MachineConfig) -> Machine {
    Machine::new(Arc::new(MachineParameters::new(config).expect("the machine can be built")))
}

/// One position period of one axis whose set-points are known as far ahead as its controller reads; the
/// others stand still.
pub fn advance_axis(
    machine: &mut Machine,
    place: usize,
    k: i64,
    psec: impl Fn(i64) -> f64,
    observe: impl FnMut(&Machine),
) {
    let (axes, horizon) = (machine.axis_count(), machine.horizon());
    let mut now = vec![0.0; axes];
    let mut ahead = vec![0.0; axes * horizon];
    now[place] = psec(k);
    for (j, value) in ahead[place * horizon..][..horizon].iter_mut().enumerate() {
        *value = psec(k + 1 + j as i64);
    }
    machine.advance_with(&now, &ahead, observe);
}

/// Runs `psec(t)` for `duration` seconds and shows every tick with its time in seconds.
pub fn run(
    machine: &mut Machine,
    duration: f64,
    psec: impl Fn(f64) -> [f64; AXES],
    mut observe: impl FnMut(f64, &Machine),
) {
    machine.reset(&psec(0.0));
    let last = (duration / TSP).ceil() as u64;
    for k in 0..=last {
        machine.advance_with(&psec(k as f64 * TSP), &[], |m| observe(m.time() as f64 * 1e-9, m));
    }
}

/// Asserts that `value` lies within `tolerance` of `wanted`; shows all three, also with `--nocapture`.
#[track_caller]
pub fn assert_near(what: &str, value: f64, wanted: f64, tolerance: f64) {
    println!("{what}: {value:.4}, reference {wanted} ± {tolerance:.3}");
    assert!((value - wanted).abs() <= tolerance, "{what}: {value}, wanted {wanted} ± {tolerance}");
}
