//! Filters of the current setpoint: responses against closed forms, bits of every SIMD width, prediction model, and a
//! notch at the resonance of an elastic axis.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::Complex;
use virtual_axes_core::config::{CurrentFilterConfig, MachineConfig};
use virtual_axes_core::control::{BiquadFilter, BiquadState};
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth, prediction_model};
use virtual_axes_verification::fixtures::machines::AXES;

use crate::bits::{assert_bits_of_every_width_and_part, bits, psec};
use crate::transmission::{ELASTIC_X, FRICTIONLESS, X, machine};

const PERIOD: f64 = 500e-6;
const FILTERED_X: [&str; 7] = [
    "x.current_filter_1.type=notch",
    "x.current_filter_1.frequency_hz=86",
    "x.current_filter_1.bandwidth_hz=60",
    "x.current_filter_1.depth_db=20",
    "x.current_filter_2.type=low_pass",
    "x.current_filter_2.frequency_hz=600",
    "x.current_filter_2.damping=0.7",
];
const LOW_PASS_Z: [&str; 3] =
    ["z.current_filter_2.type=low_pass", "z.current_filter_2.frequency_hz=300", "z.gravity.weight_n=2000"];

fn new_machine(config: &MachineConfig) -> Machine {
    Machine::new(Arc::new(MachineParameters::new(config).expect("can be discretized")))
}

/// Returns G(s) of the continuous filter.
fn continuous(filter: &CurrentFilterConfig, s: Complex<f64>) -> Complex<f64> {
    let w = TAU * filter.frequency();
    match *filter {
        CurrentFilterConfig::LowPass { damping, .. } => {
            Complex::from(w * w) / (s * s + s * (2.0 * damping * w) + w * w)
        }
        CurrentFilterConfig::Notch { frequency, bandwidth, gain } => {
            let damping = bandwidth / (2.0 * frequency);
            (s * s + s * (2.0 * damping * gain * w) + w * w) / (s * s + s * (2.0 * damping * w) + w * w)
        }
    }
}

#[test]
fn frequency_response_is_that_of_the_bilinear_transform() {
    let filters = [
        CurrentFilterConfig::LowPass { frequency: 200.0, damping: 0.7 },
        CurrentFilterConfig::LowPass { frequency: 990.0, damping: 0.3 },
        CurrentFilterConfig::LowPass { frequency: 30.0, damping: 2.0 },
        CurrentFilterConfig::Notch { frequency: 86.0, bandwidth: 60.0, gain: 0.1 },
        CurrentFilterConfig::Notch { frequency: 700.0, bandwidth: 100.0, gain: 0.0 },
    ];
    let mut worst = 0.0_f64;
    for config in &filters {
        let filter = BiquadFilter::new(Some(config), PERIOD);
        let mut state = BiquadState::default();
        let impulse: Vec<f64> =
            (0..20_000).map(|n| filter.update(&mut state, if n == 0 { 1.0 } else { 0.0 })).collect();
        for frequency in [1.0, 10.0, 50.0, 86.0, 200.0, 400.0, 700.0, 990.0, 999.0] {
            let delay = Complex::from_polar(1.0, -TAU * frequency * PERIOD);
            let found = impulse.iter().rev().fold(Complex::from(0.0), |sum, h| sum * delay + h);
            let prewarping = (PI * frequency * PERIOD).tan() / (PI * config.frequency() * PERIOD).tan();
            let s = Complex::new(0.0, TAU * config.frequency() * prewarping);
            let error = (found - continuous(config, s)).norm();
            worst = worst.max(error);
            assert!(error < 1e-9, "{config:?} at {frequency} Hz: {found}, error {error:e}");
        }
        // Prewarping: the response at its own frequency is that of the continuous filter.
        let own = continuous(config, Complex::new(0.0, TAU * config.frequency()));
        let wanted = match *config {
            CurrentFilterConfig::LowPass { damping, .. } => 1.0 / (2.0 * damping),
            CurrentFilterConfig::Notch { gain, .. } => gain,
        };
        assert!((own.norm() - wanted).abs() < 1e-12);
    }
    println!("largest error of a response {worst:.1e}");
}

/// The step response of a low-pass by partial fractions of its transfer function.
#[test]
fn step_response_is_the_sum_of_the_modes() {
    let (frequency, damping) = (150.0, 0.4);
    let filter = BiquadFilter::new(Some(&CurrentFilterConfig::LowPass { frequency, damping }), PERIOD);
    let w = TAU * frequency;
    let k = w / (w * PERIOD / 2.0).tan();
    let pole = Complex::new(-damping * w, w * (1.0 - damping * damping).sqrt());
    let discrete = (Complex::from(1.0) + pole / k) / (Complex::from(1.0) - pole / k);
    let slope = Complex::from(2.0 * k) / ((discrete + 1.0) * (discrete + 1.0));
    let residue = Complex::from(w * w) / ((pole - pole.conj()) * slope * (discrete - 1.0));
    let mut state = BiquadState::default();
    for n in 0..200 {
        let wanted = 1.0 + 2.0 * (residue * discrete.powi(n)).re;
        let found = filter.update(&mut state, 1.0);
        assert!((found - wanted).abs() < 1e-12, "cycle {n}: {found}, not {wanted}");
    }
}

#[test]
fn bits_are_those_of_every_width_and_of_every_part_of_a_cycle() {
    let config = machine(&[&ELASTIC_X[..], &FILTERED_X, &LOW_PASS_Z].concat());
    assert_bits_of_every_width_and_part(&config);
}

#[test]
fn axes_without_filters_beside_filtered_ones_keep_their_bits() {
    let plain = machine(&[]);
    let filtered = machine(&FILTERED_X);
    let beside_elastic = machine(
        &[
            &FILTERED_X[..],
            &["a.transmission.stiffness_nm_rad=2e6"],
            &["a.transmission.load_inertia_kg_m2=12"],
        ]
        .concat(),
    );
    for axis in [1, 2, 4] {
        let wanted = bits(&plain, axis, SimdWidth::Widest, &[48]);
        for config in [&filtered, &beside_elastic] {
            assert!(bits(config, axis, SimdWidth::Widest, &[48]) == wanted, "axis {axis}");
        }
    }
    assert!(bits(&filtered, X, SimdWidth::Widest, &[48]) != bits(&plain, X, SimdWidth::Widest, &[48]));
    assert!(
        bits(&filtered, X, SimdWidth::Widest, &[48]) == bits(&beside_elastic, X, SimdWidth::Widest, &[48])
    );
}

#[test]
fn an_axis_at_rest_with_filters_remains_at_rest() {
    let config = machine(&LOW_PASS_Z);
    let mut machine = new_machine(&config);
    let start = *machine.axis(2).sample();
    assert!(start.current.abs() > 0.1, "gravity needs a current: {}", start.current);
    for _ in 0..300 {
        machine.advance(&[0.0; AXES], &[]);
        let s = machine.axis(2).sample();
        assert!(s.position.abs() < 1e-12, "{}", s.position);
        assert!((s.current_setpoint / start.current_setpoint - 1.0).abs() < 1e-9, "{}", s.current_setpoint);
    }
}

/// The prediction model, iterated in the position loop of a proportional controller, against the machine.
#[test]
fn the_prediction_model_contains_the_filters() {
    let none = ["x.feedforward.velocity=0", "x.feedforward.torque_kg_m2=0", "x.delays.alpha_ms=0"];
    let drives: [&[&str]; 2] = [&[], &ELASTIC_X];
    for drive in drives {
        let config = machine(&[drive, &FRICTIONLESS, &none, &FILTERED_X].concat());
        let axis = &config.axes()[X];
        let model = prediction_model(axis, &config.periods()).expect("a model");
        let mut machine = new_machine(&config);
        let (step, ratio) = (1e-4, axis.transmission_ratio);
        let (mut angles, mut outputs) = (Vec::new(), Vec::<f64>::new());
        for k in 0..150 {
            let past = |values: &[f64], weights: &[f64]| -> f64 {
                (1..weights.len().min(k + 1)).map(|j| weights[j] * values[k - j]).sum()
            };
            let angle = past(&outputs, model.b()) - past(&angles, model.a());
            angles.push(angle);
            outputs.push(axis.position_loop.gain * (step / ratio - angle));
            machine.advance(&[step, 0.0, 0.0, 0.0, 0.0], &[]);
            let s = machine.axis(X).sample();
            let error = (s.position + s.wind_up - ratio * angle).abs();
            assert!(error < 1e-9 * step, "{drive:?}, cycle {k}: error {error:e}");
        }
    }
}

/// Returns the largest speeds of the motor of X in the first and in the last second after a small setpoint step.
fn speeds_after_step(config: &MachineConfig) -> [f64; 2] {
    let mut machine = new_machine(config);
    let mut largest = [0.0_f64; 2];
    let cycles = 1000;
    for k in 0..cycles {
        machine.advance(&[1e-6, 0.0, 0.0, 0.0, 0.0], &[]);
        let [_, speed, _] = machine.motion_at(X, 0);
        let half = usize::from(k >= cycles / 2);
        largest[half] = largest[half].max(speed.abs());
    }
    largest
}

#[test]
fn a_notch_stabilizes_the_velocity_loop_of_an_elastic_axis() {
    let drive = [
        "x.transmission.stiffness_n_um=6000",
        "x.transmission.damping_n_s_m=2000",
        "x.transmission.load_mass_kg=1200",
    ];
    let gain = ["x.velocity_loop.gain=15"];
    let plain = machine(&[&drive[..], &FRICTIONLESS, &gain].concat());
    let axis = &plain.axes()[X];
    let elastic = axis.transmission.expect("elastic");
    let (load, own) = (elastic.load_inertia, axis.motor.inertia - elastic.load_inertia);
    let resonance = (elastic.stiffness * (1.0 / load + 1.0 / own)).sqrt() / TAU;
    assert!((470.0..476.0).contains(&resonance), "{resonance}");
    let frequency = format!("x.current_filter_1.frequency_hz={resonance}");
    let notch = ["x.current_filter_1.type=notch", &frequency, "x.current_filter_1.bandwidth_hz=200"];
    let notched = machine(&[&drive[..], &FRICTIONLESS, &gain, &notch].concat());
    let low_gain = machine(&[&drive[..], &FRICTIONLESS, &["x.velocity_loop.gain=5"]].concat());
    let [unstable, stable, low] = [&plain, &notched, &low_gain].map(speeds_after_step);
    println!(
        "{resonance} Hz: {unstable:?} without notch, {stable:?} with it, {low:?} with a third of the gain"
    );
    // Without notch the vibration grows to a limit cycle at the limits of current and voltage.
    assert!(unstable[1] > 0.1, "{unstable:?}");
    assert!(stable[1] < 1e-5 * stable[0], "{stable:?}");
    assert!(low[1] < low[0], "{low:?}");
}

#[test]
fn a_state_with_filters_is_read_back_and_goes_on() {
    let config = machine(&FILTERED_X);
    let parameters = Arc::new(MachineParameters::new(&config).expect("can be discretized"));
    let mut machine = Machine::new(parameters.clone());
    let mut k = 0;
    let mut advance = |machine: &mut Machine| {
        machine.advance(&psec(k), &[]);
        k += 1;
    };
    (0..40).for_each(|_| advance(&mut machine));
    let mut read = Machine::from_state_bytes(parameters, &machine.state_bytes()).expect("it is a state");
    for k in 40..80 {
        machine.advance(&psec(k), &[]);
        read.advance(&psec(k), &[]);
        let [one, other] = [&machine, &read].map(|machine| machine.motion_at(X, 0).map(f64::to_bits));
        assert_eq!(one, other, "cycle {k}");
    }
}

#[test]
fn a_filter_set_at_run_time_starts_at_rest() {
    let plain = machine(&LOW_PASS_Z[2..]);
    let filtered = MachineParameters::new(&machine(&LOW_PASS_Z)).expect("can be discretized");
    let mut machine = new_machine(&plain);
    machine.advance(&[0.0; AXES], &[]);
    machine.update_parameters(Arc::new(filtered)).expect("the same axes");
    for _ in 0..100 {
        machine.advance(&[0.0; AXES], &[]);
        let position = machine.axis(2).sample().position;
        assert!(position.abs() < 1e-12, "{position}");
    }
}
