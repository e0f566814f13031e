//! Transmission identified from the encoders of motor and load, and recordings that do not determine it.

use std::f64::consts::TAU;

use virtual_axes_core::config::{MachineConfig, Parameters, Value, ValueSource, parse_assignment};
use virtual_axes_core::units::seconds;
use virtual_axes_identify::identify::{
    Identification, IdentificationOptions, identify_with_transmission, update_parameters,
};
use virtual_axes_identify::recording::{Conditioning, RawRecording, condition};
use virtual_axes_verification::fixtures::recordings::{
    CurrentNoise, Disturbance, axis_index, record, true_parameters,
};

use crate::random_transmissions::identified_at_random;

/// Stiffness (N/µm), damping (N·s/m), load (kg) and backlash (µm) of X.
const TRUTH: [f64; 4] = [150.0, 15000.0, 1300.0, 9.0];
/// Share of the friction of X at the load.
const FRICTION_AT_LOAD: f64 = 0.5;
const KEYS: [&str; 4] = ["stiffness_n_um", "damping_n_s_m", "load_mass_kg", "backlash_um"];

/// Returns a machine whose X has a transmission with `values`.
fn elastic(values: [f64; 4]) -> MachineConfig {
    let source = ValueSource::named("the test");
    let texts = KEYS.iter().zip(values).map(|(key, value)| format!("x.transmission.{key}={value}"));
    let friction = [format!("x.transmission.load_friction={FRICTION_AT_LOAD}")];
    let assignments = texts.chain(friction).map(|text| parse_assignment(&text, &source).expect("good"));
    let mut parameters = true_parameters();
    parameters.set_all(assignments.collect()).expect("values in range");
    parameters.machine_config().expect("a machine")
}

/// Returns setpoints of X: two slow reversals, and a chirp up to `highest` Hz about a steady motion to and fro.
fn motion(tsp: f64, highest: f64) -> Vec<f64> {
    let mut at = 0.0;
    let next = |k: usize| {
        let t = k as f64 * tsp - 0.5;
        if t < 6.0 {
            at = 0.001 * (1.0 - (TAU * t.max(0.0) / 3.0).cos());
        } else if t < 16.0 {
            let t = t - 6.0;
            let ratio = highest / 2.0;
            let phase = TAU * 2.0 * 10.0 / ratio.ln() * (ratio.powf(t / 10.0) - 1.0);
            let steady = (10.0 * (TAU * t / 2.0).sin()).clamp(-1.0, 1.0);
            at += tsp * (t / 0.2).min(1.0) * (0.025 * steady + 0.018 * phase.sin());
        }
        at
    };
    (0..(17.0 / tsp) as usize).map(next).collect()
}

/// Records X in `motion` every 0.5 ms, with encoders of 50 and 20 nm.
fn recording(machine: &MachineConfig, highest: f64) -> RawRecording {
    let psec = motion(seconds(machine.periods().position), highest);
    let disturbance = Disturbance {
        sample_ticks: Some(4),
        resolution: 50e-9,
        motor_resolution: Some(20e-9),
        noise: CurrentNoise::OfLargest(0.005),
        ..Disturbance::default()
    };
    let mut raw = record(machine, "x", &psec, &disturbance);
    raw.psec = None;
    raw
}

/// Identifies the transmission of X of the default machine, whose inertia is 20 % off.
fn identified(raw: &RawRecording) -> (Identification, Parameters) {
    identified_from(raw, 1)
}

/// Identifies the transmission from the same recording, given `times`.
fn identified_from(raw: &RawRecording, times: usize) -> (Identification, Parameters) {
    let mut start = true_parameters();
    let source = ValueSource::named("the test");
    start.set("x.motor.inertia_kg_m2", Value::Double(0.8 * 0.028), &source).expect("in range");
    let machine = start.machine_config().expect("a machine");
    let axis = &machine.axes()[axis_index(&machine, "x")];
    let conditioning = Conditioning { current_lag: Some(0.0), ..Conditioning::default() };
    let signals = condition(raw, axis, &machine.periods(), &conditioning).expect("a recording").0;
    let options = IdentificationOptions::default();
    let found = identify_with_transmission(&[], &vec![&signals; times], axis, &machine.periods(), &options);
    (found, start)
}

fn codes(found: &Identification) -> Vec<&'static str> {
    found.findings.iter().map(|finding| finding.code).collect()
}

#[test]
fn stiffness_load_damping_and_backlash_are_within_their_intervals_and_go_to_the_machine_file() {
    let (found, start) = identified(&recording(&elastic(TRUTH), 60.0));
    let fit = found.transmission.as_ref().unwrap_or_else(|| panic!("{:?}", found.findings));
    let masses = fit.masses.as_ref().unwrap_or_else(|| panic!("{:?}", found.findings));
    let (damping, gap) = (masses.damping.expect("damping"), fit.backlash.expect("a gap"));
    let intervals = [(masses.stiffness, 1e6), (damping, 1.0), (masses.load, 1.0), (gap, 1e-6)];
    for ((interval, unit), (truth, key)) in intervals.into_iter().zip(TRUTH.into_iter().zip(KEYS)) {
        let [low, high] = interval.bounds.map(|bound| bound / unit);
        println!("{key}: {:.4} ({low:.4} … {high:.4}), true {truth}", interval.value / unit);
        assert!(low < truth && truth < high);
        // The damping is a small part of the force.
        assert!(high - low < if key == KEYS[1] { truth } else { 0.2 * truth });
    }
    let antiresonance = (150e6_f64 / 1300.0).sqrt() / TAU;
    assert!((fit.antiresonance.value / antiresonance - 1.0).abs() < 2e-3, "{:?}", fit.antiresonance);
    assert!(fit.r_squared > 0.999, "{}", fit.r_squared);
    let share = masses.load_friction.expect("a share of the friction");
    println!("load_friction: {share:?}, true {FRICTION_AT_LOAD}");
    assert!(share.bounds[0] < FRICTION_AT_LOAD && FRICTION_AT_LOAD < share.bounds[1], "{share:?}");
    assert!(share.bounds[1] - share.bounds[0] < 0.2, "{share:?}");
    // The machine file has the true inertia of motor and load, too.
    let mut machine = start.clone();
    update_parameters(&mut machine, "x", &found.values(&start, "x")).expect("values in range");
    let written = machine.machine_config().expect("a machine");
    let axis = &written.axes()[axis_index(&written, "x")];
    assert!((axis.motor.inertia / 0.028 - 1.0).abs() < 0.02, "{}", axis.motor.inertia);
    let transmission = axis.transmission.expect("an elastic axis");
    let square = axis.transmission_ratio * axis.transmission_ratio;
    assert!((transmission.stiffness / (masses.stiffness.value * square) - 1.0).abs() < 1e-3);
    assert!((transmission.load_friction - share.value).abs() < 1e-4);
    assert!((transmission.backlash * axis.transmission_ratio / gap.value - 1.0).abs() < 1e-2);
}

#[test]
fn a_closed_gap_gets_a_bound() {
    let (found, _) = identified(&recording(&elastic([150.0, 15000.0, 1300.0, 0.0]), 60.0));
    let fit = found.transmission.as_ref().unwrap_or_else(|| panic!("{:?}", found.findings));
    assert_eq!(fit.backlash, None);
    let bound = fit.excluded_backlash.expect("a bound");
    println!("no backlash above {:.2} µm", bound * 1e6);
    assert!(bound < 2e-6);
}

#[test]
fn slow_reversals_alone_do_not_tell_a_gap_from_friction() {
    let machine = elastic([150.0, 15000.0, 1300.0, 0.0]);
    let psec: Vec<f64> = motion(seconds(machine.periods().position), 60.0).into_iter().take(1080).collect();
    let disturbance =
        Disturbance { sample_ticks: Some(4), motor_resolution: Some(0.0), ..Disturbance::default() };
    let raw = RawRecording { psec: None, ..record(&machine, "x", &psec, &disturbance) };
    let (found, start) = identified(&raw);
    let fit = found.transmission.as_ref().unwrap_or_else(|| panic!("{:?}", found.findings));
    assert_eq!((fit.backlash, fit.excluded_backlash), (None, None));
    assert!(codes(&found).contains(&"gap-or-friction"), "{:?}", found.findings);
    assert!(found.values(&start, "x").iter().all(|value| !value.key.contains("backlash")));
}

#[test]
fn a_motion_far_below_the_antiresonance_does_not_tell_the_masses() {
    let (found, _) = identified(&recording(&elastic(TRUTH), 6.0));
    let masses = found.transmission.as_ref().and_then(|fit| fit.masses.as_ref());
    // An interval may be given, if it contains the truth.
    assert!(masses.is_none_or(|m| m.load.bounds[0] < 1300.0 && 1300.0 < m.load.bounds[1]), "{masses:?}");
    assert!(masses.is_some() || codes(&found).contains(&"no-load-inertia"), "{:?}", found.findings);
}

#[test]
fn swapped_encoders_and_equal_recordings_are_named() {
    let raw = recording(&elastic(TRUTH), 60.0);
    let (once, twice) = (identified(&raw).0, identified_from(&raw, 2).0);
    assert!(codes(&twice).contains(&"same-samples") && !codes(&once).contains(&"same-samples"));
    assert_eq!(twice.transmission, once.transmission);
    let swapped =
        RawRecording { position: raw.motor_position.clone(), motor_position: raw.position.clone(), ..raw };
    let (found, _) = identified(&swapped);
    assert_eq!(found.transmission, None);
    let mut texts = found.findings.iter().map(ToString::to_string);
    assert!(texts.any(|text| text.contains("motor_position is that of the motor")), "{:?}", found.findings);
}

#[test]
fn encoders_that_are_not_sampled_at_the_same_instant_are_named() {
    let raw = recording(&elastic(TRUTH), 60.0);
    assert!(!codes(&identified(&raw).0).contains(&"encoder-delay"));
    // Of a sampling period of 0.5 ms: the first row keeps its sample.
    let delayed = |channel: &[f64]| -> Vec<f64> {
        channel.iter().take(1).chain(channel).take(channel.len()).copied().collect()
    };
    let motor = raw.motor_position.clone().expect("a position of the motor");
    let cases = [
        (
            RawRecording { position: raw.position.as_deref().map(delayed), ..raw.clone() },
            "older than motor_position",
        ),
        (RawRecording { motor_position: Some(delayed(&motor)), ..raw }, "newer than motor_position"),
    ];
    for (raw, wanted) in cases {
        let (found, _) = identified(&raw);
        let texts: Vec<String> = found.findings.iter().map(ToString::to_string).collect();
        // "position is 0.59 ± 0.26 ms older than …": the interval contains a sampling period.
        let words: Vec<&str> = texts.iter().find(|t| t.contains(wanted)).expect(wanted).split(' ').collect();
        let [delay, half] = [words[2], words[4]].map(|word| word.parse::<f64>().expect(word));
        println!("{delay} ± {half} ms {wanted}");
        assert!((delay - 0.5).abs() < half && half < 0.1, "{texts:?}");
        // The rest hardly depends on it.
        let masses = found.transmission.and_then(|fit| fit.masses).unwrap_or_else(|| panic!("{texts:?}"));
        for (interval, truth) in [(masses.stiffness, 150e6), (masses.load, 1300.0)] {
            assert!((interval.value / truth - 1.0).abs() < 0.05, "{interval:?}");
        }
    }
}

#[test]
fn a_motion_that_no_spring_explains_gets_no_transmission() {
    // A vibration of the motor's encoder by 40 µm at 70 Hz.
    let mut raw = recording(&elastic(TRUTH), 60.0);
    let times = raw.time.clone();
    for (at, time) in raw.motor_position.as_mut().expect("a position of the motor").iter_mut().zip(times) {
        *at += 40e-6 * (TAU * 70.0 * time).sin();
    }
    let (found, start) = identified(&raw);
    assert_eq!(found.transmission, None);
    assert!(codes(&found).contains(&"poor-transmission"), "{:?}", found.findings);
    assert!(found.values(&start, "x").is_empty());
}

#[test]
fn one_encoder_does_not_tell_the_transmission() {
    let raw = RawRecording { motor_position: None, ..recording(&elastic(TRUTH), 60.0) };
    let (found, start) = identified(&raw);
    assert_eq!(found.transmission, None);
    assert!(codes(&found).contains(&"one-encoder"), "{:?}", found.findings);
    assert!(found.values(&start, "x").is_empty());
}

#[test]
fn a_rigid_axis_gets_no_transmission() {
    let machine = true_parameters().machine_config().expect("a machine");
    let (found, start) = identified(&recording(&machine, 60.0));
    assert_eq!(found.transmission, None);
    assert!(codes(&found).contains(&"no-wind-up"), "{:?}", found.findings);
    assert!(found.values(&start, "x").is_empty());
}

#[test]
fn a_motor_position_that_is_that_of_the_load_gets_no_transmission() {
    let mut raw = recording(&true_parameters().machine_config().expect("a machine"), 20.0);
    for scale in [0.0, 1e-15] {
        raw.motor_position =
            raw.position.as_ref().map(|load| load.iter().map(|x| x * (1.0 + scale)).collect());
        let (found, _) = identified(&raw);
        assert_eq!(found.transmission, None);
        let text = found.findings.iter().find(|f| f.code == "no-wind-up").expect("a finding").to_string();
        assert!(text.contains("motor_position equals position in all recordings"), "{text}");
    }
}

#[test]
fn without_a_current_only_the_antiresonance_and_the_backlash_are_known() {
    let raw = RawRecording { current: None, ..recording(&elastic(TRUTH), 60.0) };
    let (found, start) = identified(&raw);
    let fit = found.transmission.as_ref().unwrap_or_else(|| panic!("{:?}", found.findings));
    assert!(codes(&found).contains(&"no-load-inertia"), "{:?}", found.findings);
    assert_eq!(fit.masses, None);
    let gap = fit.backlash.expect("a gap");
    assert!(gap.bounds[0] < 9e-6 && 9e-6 < gap.bounds[1], "{gap:?}");
    // Neither is complete enough for the machine file.
    assert!(found.values(&start, "x").is_empty());
}

#[test]
fn random_axes_get_no_transmission_that_they_do_not_have() {
    let (mut inside, mut count) = (0, 0);
    for case in (6200..6230).map(identified_at_random) {
        let Some(truth) = case.truth else {
            assert_eq!(case.found, None, "{case:?}");
            continue;
        };
        let Some(fit) = &case.found else { continue };
        assert!(truth.backlash > 0.0 || fit.backlash.is_none(), "{case:?}");
        let Some(masses) = &fit.masses else { continue };
        for (interval, truth) in [(masses.stiffness, truth.stiffness), (masses.load, truth.load)] {
            count += 1;
            inside += usize::from((interval.bounds[0]..=interval.bounds[1]).contains(&truth));
        }
    }
    // 95 % intervals: fewer than four in five within them has a probability below 1e-6.
    assert!(count > 30 && 5 * inside >= 4 * count, "{inside} of {count}");
}
