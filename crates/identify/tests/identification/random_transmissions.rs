//! Random axes with or without an elastic transmission, identified from recordings with both encoders.

use std::f64::consts::TAU;

use virtual_axes_core::config::{AxisKind, MachineConfig, Parameters, ValueSource, parse_assignment};
use virtual_axes_core::units::{DEGREE, NEWTON_PER_MICROMETER, seconds};
use virtual_axes_identify::identify::{IdentificationOptions, TransmissionFit, identify_with_transmission};
use virtual_axes_identify::recording::{Conditioning, condition};
use virtual_axes_verification::fixtures::machines::set;
use virtual_axes_verification::fixtures::recordings::{CurrentNoise, Disturbance, axis_index, record};
use virtual_axes_verification::random::RandomSource;

/// Random stream of a seed.
const STREAM: u64 = 500;
/// Axes of the default machine.
const AXES: [&str; 4] = ["x", "y", "z", "c"];

/// True values of a transmission, in SI units at the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueTransmission {
    /// Frequency of the antiresonance, Hz.
    pub antiresonance: f64,
    /// Inertia of the load, kg or kg·m².
    pub load: f64,
    /// Stiffness, N/m or N·m/rad.
    pub stiffness: f64,
    /// Damping, N·s/m or N·m·s/rad.
    pub damping: f64,
    /// Width of the gap, m or rad.
    pub backlash: f64,
    /// Share of the friction at the load.
    pub load_friction: f64,
}

/// Result of one random axis.
#[derive(Debug, Clone, PartialEq)]
pub struct TransmissionCase {
    /// Seed, axis and conditions.
    pub name: String,
    /// True values; none for a rigid axis.
    pub truth: Option<TrueTransmission>,
    /// Identified transmission.
    pub found: Option<TransmissionFit>,
    /// Codes and texts of the findings.
    pub findings: Vec<(&'static str, String)>,
}

/// Axis with hidden values.
struct Hidden {
    axis: &'static str,
    machine: MachineConfig,
    guess: MachineConfig,
    truth: Option<TrueTransmission>,
}

fn hidden(random: &mut RandomSource) -> Hidden {
    let axis = AXES[random.below(AXES.len())];
    let mut machine = Parameters::embedded_default().expect("the default machine");
    let config = machine.machine_config().expect("the default machine");
    let known = config.axes()[axis_index(&config, axis)].clone();
    let factor = random.between(0.6, 1.6);
    for (key, value) in [("friction.a", known.friction.a), ("friction.c", known.friction.c)] {
        set(&mut machine, axis, key, value * factor);
    }
    let mut guess = machine.clone();
    let guess_factor = random.between(0.7, 1.4);
    for (key, value) in [("friction.a", known.friction.a), ("friction.c", known.friction.c)] {
        set(&mut guess, axis, key, value * factor * guess_factor);
    }
    set(&mut guess, axis, "motor.inertia_kg_m2", known.motor.inertia * random.between(0.7, 1.4));
    let total = known.motor.inertia / known.transmission_ratio.powi(2);
    let load = total * random.between(0.25, 0.85);
    let antiresonance = random.log_between(20.0, 90.0);
    let stiffness = load * (TAU * antiresonance).powi(2);
    let damping = 2.0 * random.between(0.01, 0.1) * (stiffness * load).sqrt();
    let is_linear = known.kind() == AxisKind::Linear;
    let unit = if is_linear { 1e-6 } else { 1e-3 * DEGREE };
    let has_gap = random.chance(0.5);
    let backlash = if has_gap { unit * random.log_between(2.0, 60.0) } else { 0.0 };
    let load_friction = if random.chance(0.5) { random.unit() } else { 0.0 };
    let truth = random.chance(0.85).then_some(TrueTransmission {
        antiresonance,
        load,
        stiffness,
        damping,
        backlash,
        load_friction,
    });
    if truth.is_some() {
        let (keys, per_unit, width) = match is_linear {
            true => (
                [
                    "transmission.stiffness_n_um",
                    "transmission.damping_n_s_m",
                    "transmission.load_mass_kg",
                    "transmission.backlash_um",
                ],
                NEWTON_PER_MICROMETER,
                1e-6,
            ),
            false => (
                [
                    "transmission.stiffness_nm_rad",
                    "transmission.damping_nm_s_rad",
                    "transmission.load_inertia_kg_m2",
                    "transmission.backlash_deg",
                ],
                1.0,
                DEGREE,
            ),
        };
        let values = [stiffness / per_unit, damping, load, backlash / width];
        let texts = keys.iter().zip(values).chain([(&"transmission.load_friction", load_friction)]);
        let source = ValueSource::named("the study");
        let assignments = texts
            .map(|(key, value)| parse_assignment(&format!("{axis}.{key}={value:e}"), &source))
            .collect::<Result<Vec<_>, _>>();
        machine.set_all(assignments.expect("assignments")).expect("values in range");
    }
    let machine = machine.machine_config().expect("a machine");
    Hidden { axis, machine, guess: guess.machine_config().expect("a machine"), truth }
}

/// Returns setpoints: slow reversals, then a chirp of constant velocity amplitude about a steady motion to and fro.
fn motion(random: &mut RandomSource, kind: AxisKind, tsp: f64) -> (String, Vec<f64>) {
    let unit = match kind {
        AxisKind::Linear => 1.0,
        AxisKind::Rotary => 4.0,
    };
    let speed = unit * random.between(0.015, 0.04);
    let share = random.between(0.5, 0.9);
    let (low, high) = (random.between(1.0, 4.0), random.between(40.0, 80.0));
    let length = random.between(6.0, 16.0);
    let (slow, period) = (unit * random.log_between(1e-3, 4e-3), random.between(2.0, 4.0));
    let rounds = 2.0;
    let reversals = rounds * period;
    // Steady motion that reverses each second within 0.1 s.
    let steady = |t: f64| speed * (10.0 * (TAU * t / 2.0).sin()).clamp(-1.0, 1.0);
    let velocity = |t: f64| {
        let phase = TAU * low * length / (high / low).ln() * ((high / low).powf(t / length) - 1.0);
        let fade = (t / 0.2).min((length - t) / 0.2).clamp(0.0, 1.0);
        fade * (steady(t) + share * speed * phase.sin())
    };
    let count = ((reversals + length + 2.0) / tsp) as usize;
    let (mut at, mut psec) = (0.0, Vec::new());
    for k in 0..count {
        let t = k as f64 * tsp - 0.5;
        if t < reversals {
            at = slow / 2.0 * (1.0 - (TAU * t.max(0.0) / period).cos());
        } else if t < reversals + length {
            at += tsp * velocity(t - reversals);
        }
        psec.push(at);
    }
    (format!("chirp {low:.0} … {high:.0} Hz, {length:.0} s"), psec)
}

/// Identifies the axis of a seed.
///
/// Masses, stiffness, damping, backlash, friction and its place, encoders, noise, sampling period and motion are random;
/// half of the axes have no backlash, 15 % are rigid. The machine file has another inertia and friction.
pub fn identified_at_random(seed: u64) -> TransmissionCase {
    let mut random = RandomSource::new(seed, STREAM);
    let hidden = hidden(&mut random);
    let kind = hidden.machine.axes()[axis_index(&hidden.machine, hidden.axis)].kind();
    let (program, psec) = motion(&mut random, kind, seconds(hidden.machine.periods().position));
    let unit = if kind == AxisKind::Linear { 1e-6 } else { 1e-3 * DEGREE };
    let increments = [0, 1].map(|_| random.log_between(0.005, 0.5));
    let noise = random.between(0.001, 0.02);
    let ticks = [2, 4, 8, 16][random.below(4)];
    let disturbance = Disturbance {
        sample_ticks: Some(ticks),
        resolution: increments[0] * unit,
        motor_resolution: Some(increments[1] * unit),
        noise: CurrentNoise::OfLargest(noise),
        seed,
        ..Disturbance::default()
    };
    let mut raw = record(&hidden.machine, hidden.axis, &psec, &disturbance);
    // Nothing but the plant is identified.
    raw.psec = None;
    let start = &hidden.guess.axes()[axis_index(&hidden.guess, hidden.axis)];
    let periods = hidden.guess.periods();
    let conditioning = Conditioning { current_lag: Some(0.0), ..Conditioning::default() };
    let milliseconds = 1e3 * ticks as f64 * seconds(periods.current);
    let name = format!(
        "{seed} {} {program}, {milliseconds} ms, increments {:.3} and {:.3}, noise {:.1} %",
        hidden.axis,
        increments[0],
        increments[1],
        100.0 * noise
    );
    let mut case = TransmissionCase { name, truth: hidden.truth, found: None, findings: Vec::new() };
    match condition(&raw, start, &periods, &conditioning) {
        Ok((signals, _)) => {
            let options = IdentificationOptions::default();
            let found = identify_with_transmission(&[], &[&signals], start, &periods, &options);
            case.findings = found.findings.into_iter().map(|f| (f.code, f.what)).collect();
            case.found = found.transmission;
        }
        Err(error) => case.findings.push(("conditioning", error.to_string())),
    }
    case
}
