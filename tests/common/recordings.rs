//! Recordings of an axis as an oscilloscope makes them, from a simulation with known parameters.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use virtual_axes::config::{AxisKind, MachineConfig, Parameters, Source, Value};
use virtual_axes::identify::FeedforwardMode;
use virtual_axes::identify::campaign::{Campaign, Options};
use virtual_axes::machine::{AxisSample, Machine};
use virtual_axes::recording::RawRecording;
use virtual_axes::units::{DEGREE, METRE_PER_MINUTE, MILLIMETRE, RPM, seconds};

/// Noise of the recorded current, normally distributed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CurrentNoise {
    None,
    /// Standard deviation as part of the largest current of the recording.
    OfLargest(f64),
    /// Standard deviation as part of each value.
    OfEach(f64),
}

/// What friction the plant has that the law has not: a current, A, as a function of the velocity in m/min or
/// rev/min.
pub type ExtraFriction = fn(f64) -> f64;

/// How a recording differs from what the simulation knows. `default()` differs in nothing.
#[derive(Debug, Clone)]
pub struct Disturbance {
    /// Ticks between two samples; none: those of a position period.
    pub every: Option<u64>,
    /// Resolution of the recorded position, m or rad; 0: none.
    pub resolution: f64,
    pub noise: CurrentNoise,
    /// Of every random number.
    pub seed: u64,
    /// Width of the play between motor and recorded position, m or rad.
    pub backlash: f64,
    /// Follows the velocity once per position period.
    pub friction: Option<ExtraFriction>,
    /// How much later than the motion the recorded current is, s.
    pub current_lag: f64,
    /// Standard deviation of the stamps, s.
    pub jitter: f64,
    /// Between which times nothing is recorded, s.
    pub gaps: Vec<Range<f64>>,
    /// Between which times the logger stands still: what is sampled there is stamped when it goes on, s.
    pub stalls: Vec<Range<f64>>,
    /// Whether the velocity is recorded, too.
    pub velocity: bool,
}

impl Default for Disturbance {
    fn default() -> Self {
        Disturbance {
            every: None,
            resolution: 0.0,
            noise: CurrentNoise::None,
            seed: 1,
            backlash: 0.0,
            friction: None,
            current_lag: 0.0,
            jitter: 0.0,
            gaps: Vec::new(),
            stalls: Vec::new(),
            velocity: false,
        }
    }
}

impl Disturbance {
    /// An encoder of 1 µm or 1 mdeg, and 2 % of the largest current as noise.
    pub fn usual(kind: AxisKind, seed: u64) -> Self {
        let resolution = match kind {
            AxisKind::Linear => 1e-3 * MILLIMETRE,
            AxisKind::Rotary => 1e-3 * DEGREE,
        };
        Disturbance { resolution, noise: CurrentNoise::OfLargest(0.02), seed, ..Disturbance::default() }
    }
}

/// A bump of 0.1 A towards standstill, gone within a few m/min: the Stribeck effect that the law leaves out.
pub fn stribeck(velocity: f64) -> f64 {
    if velocity == 0.0 { 0.0 } else { 0.1 * (-velocity.abs() / 0.5).exp() * velocity.signum() }
}

/// Place of an axis.
pub fn place(machine: &MachineConfig, axis: &str) -> usize {
    machine.axes().iter().position(|known| known.name() == axis).expect("the machine has that axis")
}

/// The machine while `part` of a campaign is run: all other parameters as they are.
pub fn feedforward(parameters: &Parameters, axis: &str, part: FeedforwardMode) -> MachineConfig {
    let mut parameters = parameters.clone();
    parameters.set_all(part.assignments(&parameters, axis)).expect("the changes are valid");
    parameters.machine_config().expect("the machine is valid")
}

/// One recording for each part of the campaign of an axis, each from rest, named after its part.
pub fn record_campaign(
    parameters: &Parameters,
    axis: &str,
    parts: &[FeedforwardMode],
    options: &Options,
    disturbance: &Disturbance,
) -> Vec<(FeedforwardMode, RawRecording)> {
    let record_part = |(i, &part): (usize, &FeedforwardMode)| {
        let machine = feedforward(parameters, axis, part);
        let campaign = Campaign::plan(&machine, place(&machine, axis), &[part], options).expect("planned");
        let disturbance = Disturbance { seed: disturbance.seed + i as u64, ..disturbance.clone() };
        let mut recording = record(&machine, axis, campaign.psec(), &disturbance);
        recording.name = part.name().to_owned();
        (part, recording)
    };
    parts.iter().enumerate().map(record_part).collect()
}

/// Runs the set-points `psec` (m or rad, one per position period) of one axis from rest at the first of them, the
/// others standing at home, and records what `~/drive_states` and `~/motor_currents` tell.
pub fn record(machine: &MachineConfig, axis: &str, psec: &[f64], disturbance: &Disturbance) -> RawRecording {
    let place = place(machine, axis);
    let kind = machine.axes()[place].kind();
    let seen = simulate(machine, place, psec, disturbance);
    let tick = seconds(machine.periods().current);
    let every = disturbance.every.unwrap_or(machine.periods().ticks_per_position());
    let rows: Vec<(u64, &AxisSample)> =
        seen.samples.iter().enumerate().map(|(i, sample)| (i as u64 * every, sample)).collect();
    let kept = |tick_count: u64| {
        let time = tick_count as f64 * tick;
        disturbance.gaps.iter().all(|gap| !gap.contains(&time))
    };
    let rows: Vec<_> = rows.into_iter().filter(|(ticks, _)| kept(*ticks)).collect();

    let mut random = Random::new(disturbance.seed);
    let lag = (disturbance.current_lag / tick).round() as u64;
    let current: Vec<f64> =
        rows.iter().map(|(ticks, _)| seen.current[ticks.saturating_sub(lag) as usize]).collect();
    let largest = current.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let current = current.iter().map(|value| match disturbance.noise {
        CurrentNoise::None => *value,
        CurrentNoise::OfLargest(part) => value + part * largest * random.normal(),
        CurrentNoise::OfEach(part) => value * (1.0 + part * random.normal()),
    });
    let current = current.collect();

    let mut table = rows.first().map_or(0.0, |(_, sample)| sample.position);
    let half = 0.5 * disturbance.backlash;
    let position = rows.iter().map(|(_, sample)| {
        // The table is dragged along by whichever flank it touches.
        table = table.clamp(sample.position - half, sample.position + half);
        let step = disturbance.resolution;
        if step > 0.0 { (table / step).round() * step } else { table }
    });
    let position = position.collect();

    let stamp = |ticks: u64| {
        let time = ticks as f64 * tick;
        let stall = disturbance.stalls.iter().find(|stall| stall.contains(&time));
        stall.map_or(time, |stall| stall.end)
    };
    let time = rows.iter().map(|(ticks, _)| stamp(*ticks) + disturbance.jitter * random.normal()).collect();
    let channel = |of: fn(&AxisSample) -> f64| Some(rows.iter().map(|(_, sample)| of(sample)).collect());
    RawRecording {
        name: format!("{axis} ({kind:?})"),
        time,
        psec: channel(|sample| sample.psec),
        position: Some(position),
        velocity: if disturbance.velocity { channel(|sample| sample.velocity) } else { None },
        current: Some(current),
        velocity_feedforward: channel(|sample| sample.velocity_feedforward),
        torque_feedforward: channel(|sample| sample.torque_feedforward),
    }
}

/// What the simulation shows.
struct Seen {
    /// Every so many ticks.
    samples: Vec<AxisSample>,
    /// At every tick, A.
    current: Vec<f64>,
}

fn simulate(machine: &MachineConfig, place: usize, psec: &[f64], disturbance: &Disturbance) -> Seen {
    let every = disturbance.every.unwrap_or(machine.periods().ticks_per_position());
    let unit = match machine.axes()[place].kind() {
        AxisKind::Linear => METRE_PER_MINUTE,
        AxisKind::Rotary => RPM,
    };
    let mut axes: Machine = super::at_rest(machine);
    let mut start = vec![0.0; axes.axis_count()];
    start[place] = psec.first().copied().unwrap_or(0.0);
    axes.reset(&start);
    let mut seen = Seen { samples: Vec::new(), current: Vec::new() };
    let last = psec.len() as i64 - 1;
    for k in 0..=last {
        if let Some(friction) = disturbance.friction {
            let sample = axes.axis(place).sample();
            // Kt / r, as the axis itself shows it.
            let force = if sample.current == 0.0 { 0.0 } else { sample.effort / sample.current };
            let load = -force * friction(sample.velocity / unit);
            axes.set_load(place, load);
        }
        super::advance_axis(
            &mut axes,
            place,
            k,
            |k| psec[k.clamp(0, last) as usize],
            |m| {
                let sample = m.axis(place).sample();
                seen.current.push(sample.current);
                if m.tick().is_multiple_of(every) {
                    seen.samples.push(*sample);
                }
            },
        );
    }
    seen
}

/// Random numbers that a seed repeats.
pub struct Random(TestRng);

impl Random {
    pub fn new(seed: u64) -> Self {
        let bytes: Vec<u8> = seed.to_le_bytes().iter().copied().cycle().take(32).collect();
        Random(TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
    }

    /// Above 0 and at most 1: 53 bits of the generator.
    pub fn uniform(&mut self) -> f64 {
        ((self.0.next_u64() >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    /// Of mean 0 and standard deviation 1, after Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (TAU * self.uniform() - PI).cos()
    }
}

/// The machine that recordings are made with (model.md section 6).
pub fn truth() -> Parameters {
    Parameters::embedded_default().expect("the default machine")
}

/// What an identification of `axis` starts from: the same machine with another plant, friction, feedforward and
/// other delays.
pub fn ignorant(axis: &str) -> Parameters {
    let mut parameters = truth();
    let rotary = ["a", "c"].contains(&axis);
    let mut wrong = vec![
        ("motor.inertia_kg_m2", if rotary { 0.002 } else { 0.015 }),
        ("friction.a", 1.0),
        ("friction.b", 0.01),
        ("friction.c", -0.1),
        ("friction.d", -1.0),
        ("friction.i0", 0.9),
        ("feedforward.velocity", 0.9),
        ("feedforward.torque_kg_m2", 0.001),
        ("delays.alpha_ms", 20.0),
        ("delays.beta_ms", 3.0),
        ("delays.gamma_ms", 1.0),
    ];
    match axis {
        "z" => wrong.push(("gravity.weight_n", 100.0)),
        "a" => wrong.extend([("gravity.tilt_nm", 5.0), ("gravity.tilt_phase_deg", 30.0)]),
        _ => {}
    }
    for (key, value) in wrong {
        let key = format!("{axis}.{key}");
        parameters.set(&key, Value::Double(value), &Source::named("the test")).expect("a value in range");
    }
    parameters
}
