//! Frequency responses of the control loops against simulations with sines and impulses, closed forms, and loops at the
//! stability limit.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Complex;
use virtual_axes_core::config::{
    AxisConfig, CurrentFilterConfig, LimitsConfig, MachineConfig, Periods, PositionFeedback,
};
use virtual_axes_core::control::{CurrentFilterState, CurrentFilters, Pi, PiState};
use virtual_axes_core::design::{
    ControlLoop, DesignError, LoopResponse, continuous_phases, magnitudes_db, margins,
};
use virtual_axes_core::drive::{LoadState, Motor, MotorState, Transmission};
use virtual_axes_core::machine::{
    Machine, MachineParameters, closed_loop_response, design_controller, loop_response, natural_frequencies,
    prediction_model,
};
use virtual_axes_core::units::seconds;
use virtual_axes_verification::fixtures::machines::configured_with;

/// X with a table of 1200 kg behind 200 N/µm, weakly damped.
const ELASTIC: [&str; 3] = [
    "x.transmission.stiffness_n_um=200",
    "x.transmission.damping_n_s_m=15000",
    "x.transmission.load_mass_kg=1200",
];
/// Filters of the current setpoint.
const FILTERS: [&str; 5] = [
    "x.current_filter_1.type=notch",
    "x.current_filter_1.frequency_hz=86",
    "x.current_filter_1.bandwidth_hz=40",
    "x.current_filter_2.type=low_pass",
    "x.current_filter_2.frequency_hz=700",
];

fn x_axis(changes: &[&str]) -> (AxisConfig, Periods) {
    let config = configured_with("mikron_ucp710", &[], changes);
    (config.axes()[0].clone(), config.periods())
}

#[track_caller]
fn response(axis: &AxisConfig, periods: &Periods, control_loop: ControlLoop) -> LoopResponse {
    loop_response(axis, periods, control_loop).expect("a linear model")
}

#[track_caller]
fn assert_near(found: Complex<f64>, wanted: Complex<f64>, tolerance: f64) {
    assert!((found - wanted).norm() <= tolerance * wanted.norm(), "{found}, expected {wanted}");
}

/// Returns output over input of a sampled system under a sine of whole `cycles` in `count` samples, after as many to
/// settle.
fn sine_response(cycles: usize, count: usize, mut step: impl FnMut(f64) -> f64) -> Complex<f64> {
    let angle = 2.0 * PI * cycles as f64 / count as f64;
    let mut sum = Complex::new(0.0, 0.0);
    for k in 0..2 * count {
        let output = step((angle * k as f64).cos());
        if k >= count {
            sum += Complex::from_polar(output, -angle * k as f64);
        }
    }
    sum * 2.0 / count as f64
}

/// Steps the closed current or velocity loop of the axis, built from the parts of the library as the simulation runs
/// them, without lifting; `step` maps a setpoint to the controlled value at the start of the cycle.
fn simulated(
    axis: &AxisConfig,
    periods: &Periods,
    control_loop: ControlLoop,
) -> impl FnMut(f64) -> f64 + use<> {
    let tick = seconds(periods.current);
    let (motor, transmission) = match &axis.transmission {
        Some(elastic) => Transmission::new(&axis.motor, elastic, tick).expect("can be discretized"),
        None => (Motor::new(&axis.motor, tick).expect("can be discretized"), Transmission::rigid()),
    };
    let scale = 1.0 / axis.motor.torque_constant;
    let velocity = Pi::new(&axis.velocity_loop, seconds(periods.velocity), scale, f64::INFINITY);
    let filters = CurrentFilters::new(&axis.current_filters, seconds(periods.velocity));
    let current = Pi::new(&axis.current_loop, tick, 1.0, f64::INFINITY);
    let ticks = if control_loop == ControlLoop::Current { 1 } else { periods.ticks_per_velocity() };
    let mut states = (PiState::default(), CurrentFilterState::default(), PiState::default());
    let (mut s, mut load) = (MotorState::default(), LoadState::default());
    move |setpoint| {
        let (velocity_state, filter_state, current_state) = &mut states;
        let (output, current_setpoint) = match control_loop {
            ControlLoop::Current => (s.current, setpoint),
            _ => {
                let filter = |value| filters.update(filter_state, value);
                (s.speed, velocity.update_with_filter(velocity_state, setpoint - s.speed, 0.0, filter))
            }
        };
        for _ in 0..ticks {
            let voltage = current.update(current_state, current_setpoint - s.current);
            (s, load) = transmission.step(&motor, &s, &load, voltage, 0.0);
        }
        output
    }
}

#[test]
fn inner_loops_respond_as_a_simulated_sine() {
    let all = [&ELASTIC[..], &FILTERS[..]].concat();
    for changes in [&[][..], &ELASTIC, &FILTERS, &all] {
        let (axis, periods) = x_axis(changes);
        for control_loop in [ControlLoop::Current, ControlLoop::Velocity] {
            let model = response(&axis, &periods, control_loop);
            let count = 40_000;
            for cycles in [37, 401, 3001, 15_001] {
                let found = model.closed(cycles as f64 / count as f64 / model.period());
                let wanted = sine_response(cycles, count, simulated(&axis, &periods, control_loop));
                assert_near(found, wanted, 1e-6);
            }
        }
    }
}

#[test]
fn velocity_loop_responds_as_the_machine() {
    // One position cycle per velocity cycle, and practically no position loop.
    let (mut axis, periods) = x_axis(&["x.friction.a=0", "x.friction.c=0", "x.friction.i0=0"]);
    let model = response(&axis, &periods, ControlLoop::Velocity);
    axis.position_loop.gain = 1e-9;
    let amplitude = 0.1;
    let ratio = amplitude * axis.transmission_ratio;
    axis.limits = LimitsConfig { travel_min: -1e9, travel_max: 1e9, ..axis.limits };
    let machine = MachineConfig::from_axis(axis, Periods { position: periods.velocity, ..periods });
    let parameters = Arc::new(MachineParameters::new(&machine).expect("a machine"));
    let count = 20_000;
    for cycles in [20, 301, 2501] {
        let mut machine = Machine::new(Arc::clone(&parameters));
        let wanted = sine_response(cycles, count, |setpoint| {
            machine.set_velocity_offset(0, amplitude * setpoint);
            machine.advance(&[0.0], &[]);
            machine.axis(0).sample().velocity / ratio
        });
        assert_near(model.closed(cycles as f64 / count as f64 / model.period()), wanted, 1e-5);
    }
}

#[test]
fn position_loop_responds_as_the_machine_to_an_impulse() {
    let load = "x.position_loop.feedback=load";
    for changes in [&[][..], &ELASTIC, &["x.position_loop.controller=gpc"], &[&ELASTIC[..], &[load]].concat()]
    {
        let (mut axis, periods) = x_axis(changes);
        (axis.feedforward.velocity, axis.feedforward.torque) = (0.0, 0.0);
        axis.delays.alpha = 0;
        let impulse = closed_loop_response(&axis, &periods).expect("a response");
        let model = response(&axis, &periods, ControlLoop::Position);
        for frequency in [0.1, 1.0, 5.0, 12.0, 30.0, 70.0, model.nyquist_frequency()] {
            let angle = 2.0 * PI * frequency * model.period();
            let values = impulse.values().iter().zip(impulse.first()..);
            let wanted: Complex<f64> = values.map(|(h, k)| Complex::from_polar(*h, -angle * k as f64)).sum();
            // The position of an elastic axis is that of the load, which differs with an encoder at the motor.
            if axis.transmission.is_none() || axis.position_loop.feedback == PositionFeedback::Load {
                assert_near(model.closed(frequency), wanted, 1e-5);
            } else if frequency <= 1.0 {
                assert_near(model.closed(frequency), wanted, 1e-3);
            }
        }
    }
}

#[test]
fn current_loop_of_a_winding_has_its_closed_form() {
    // Without back-EMF: C(z) (1 − a)/R/(z − a) with a = e^{−R T/L} and C(z) = K (1 + T/Ti z/(z − 1)).
    let (mut axis, periods) = x_axis(&[]);
    axis.motor.emf_constant = 0.0;
    let model = response(&axis, &periods, ControlLoop::Current);
    let period = seconds(periods.current);
    let decay = (-axis.motor.resistance * period / axis.motor.inductance).exp();
    let open = |frequency: f64| {
        let z = Complex::from_polar(1.0, 2.0 * PI * frequency * period);
        let integral = period / axis.current_loop.integral_time;
        let controller = (z / (z - 1.0) * integral + 1.0) * axis.current_loop.gain;
        controller * ((1.0 - decay) / axis.motor.resistance) / (z - decay)
    };
    for frequency in [1.0, 30.0, 200.0, 1000.0, 3999.0] {
        assert_near(model.open(frequency), open(frequency), 1e-9);
        let wanted = open(frequency) / (open(frequency) + 1.0);
        assert_near(model.closed(frequency), wanted, 1e-9);
        assert_near(model.sensitivity(frequency), (open(frequency) + 1.0).inv(), 1e-9);
    }
    let found = model.margins().expect("a stable loop");
    let crossover = found.gain_crossover.expect("a crossover");
    assert!((open(crossover).norm() - 1.0).abs() < 1e-9, "{crossover}");
    let phase = (-open(crossover)).arg();
    assert!((found.margins.phase - phase).abs() < 1e-9, "{} instead of {phase}", found.margins.phase);
}

#[test]
fn resonances_are_those_of_two_masses() {
    let (axis, periods) = x_axis(&[&ELASTIC[..2], &["x.transmission.load_mass_kg=1200"]].concat());
    let modes = natural_frequencies(&axis).expect("an elastic axis");
    // 200 N/µm on 1200 kg, alone and against the mass of motor and screw; the inertia is at the motor.
    let total = axis.motor.inertia / axis.transmission_ratio.powi(2);
    let hertz = |square: f64| square.sqrt() / (2.0 * PI);
    let (load, motor) = (2e8 / 1200.0, 2e8 / (total - 1200.0));
    assert!((modes.antiresonance / hertz(load) - 1.0).abs() < 1e-9, "{modes:?}");
    assert!((modes.resonance / hertz(load + motor) - 1.0).abs() < 1e-9, "{modes:?}");
    assert_eq!(natural_frequencies(&x_axis(&[]).0), None);
    // The open velocity loop has a minimum and a maximum there.
    let mut light = axis.clone();
    light.transmission.as_mut().expect("elastic").damping *= 0.02;
    let sampled = response(&light, &periods, ControlLoop::Velocity).sample();
    let magnitude = magnitudes_db(&sampled.open);
    let near = |wanted: f64| {
        let inside = move |f: &f64| (f / wanted - 1.0).abs() < 0.15;
        let pairs = sampled.frequencies.iter().zip(&magnitude).filter(move |(f, _)| inside(f));
        pairs.map(|(f, m)| (*f, *m)).collect::<Vec<_>>()
    };
    let by_magnitude = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
    let (low, high) = (near(modes.antiresonance), near(modes.resonance));
    let (dip, _) = low.iter().min_by(by_magnitude).expect("frequencies");
    let (peak, _) = high.iter().max_by(by_magnitude).expect("frequencies");
    assert!((dip / modes.antiresonance - 1.0).abs() < 0.01, "{dip} Hz, {modes:?}");
    assert!((peak / modes.resonance - 1.0).abs() < 0.03, "{peak} Hz, {modes:?}");
}

#[test]
fn a_notch_multiplies_the_open_velocity_loop() {
    let (mut axis, periods) = x_axis(&ELASTIC);
    let plain = response(&axis, &periods, ControlLoop::Velocity);
    let (center, bandwidth, gain) = (86.0, 40.0, 0.1);
    axis.current_filters[0] = Some(CurrentFilterConfig::Notch { frequency: center, bandwidth, gain });
    let filtered = response(&axis, &periods, ControlLoop::Velocity);
    assert_near(filtered.open(center) / plain.open(center), gain.into(), 1e-9);
    for frequency in [1.0, 40.0, 80.0, 100.0, 900.0] {
        // Bilinear transformation with prewarping at the center.
        let warped = |f: f64| (PI * f * plain.period()).tan();
        let ratio = warped(frequency) / warped(center);
        let width = bandwidth / center * ratio;
        let wanted =
            Complex::new(1.0 - ratio * ratio, width * gain) / Complex::new(1.0 - ratio * ratio, width);
        assert_near(filtered.open(frequency) / plain.open(frequency), wanted, 1e-9);
    }
}

#[test]
fn margins_of_the_position_loop_are_those_of_its_controller() {
    for changes in [&[][..], &["x.position_loop.controller=gpc"], &ELASTIC] {
        let (axis, periods) = x_axis(changes);
        let model = prediction_model(&axis, &periods).expect("a model");
        let controller = design_controller(&axis, &model).expect("a controller");
        let loop_model = response(&axis, &periods, ControlLoop::Position);
        let found = loop_model.margins().expect("a stable loop");
        assert_eq!(found.margins, margins(&model, &controller).expect("a stable loop"));
        let crossover = found.gain_crossover.expect("a crossover");
        assert!((loop_model.open(crossover).norm() - 1.0).abs() < 1e-9, "{crossover} Hz");
        let l = loop_model.open(found.phase_crossover.expect("a crossover"));
        assert_near(l, (-1.0 / found.margins.gain).into(), 1e-6);
    }
}

#[test]
fn velocity_loop_is_stable_up_to_its_gain_margin() {
    let elastic_with_notch = [&ELASTIC[..], &FILTERS[..3]].concat();
    let second = ["x.current_filter_2.type=low_pass", "x.current_filter_2.frequency_hz=700"];
    for changes in [&[][..], &ELASTIC, &FILTERS, &FILTERS[..3], &second, &elastic_with_notch] {
        let (axis, periods) = x_axis(changes);
        let found = response(&axis, &periods, ControlLoop::Velocity).margins().expect("a stable loop");
        let gain = found.margins.gain;
        assert!(gain.is_finite() && gain > 1.0, "{found:?}");
        for (factor, is_stable) in [(0.999, true), (1.001, false)] {
            let mut scaled = axis.clone();
            scaled.velocity_loop.gain *= gain * factor;
            let result = response(&scaled, &periods, ControlLoop::Velocity).margins();
            assert_eq!(result.is_ok(), is_stable, "{factor} × {gain}: {result:?}");
            if let Err(error) = result {
                assert!(matches!(error, DesignError::Unstable { .. }), "{error}");
            }
        }
    }
}

#[test]
fn resonance_peak_is_the_largest_closed_response() {
    for control_loop in ControlLoop::ALL {
        let (axis, periods) = x_axis(&ELASTIC);
        let model = response(&axis, &periods, control_loop);
        let Some((frequency, peak)) = model.resonance_peak() else {
            let fine = (1..=20_000).map(|k| model.nyquist_frequency() * f64::from(k) / 20_000.0);
            assert!(fine.map(|f| model.closed(f).norm()).all(|m| m <= 1.0 + 1e-5), "{control_loop:?}");
            continue;
        };
        let fine = (1..=20_000).map(|k| model.nyquist_frequency() * f64::from(k) / 20_000.0);
        let largest = fine.map(|f| model.closed(f).norm()).fold(0.0, f64::max);
        assert!((peak / largest - 1.0).abs() < 1e-4, "{control_loop:?}: {peak} at {frequency} Hz, {largest}");
    }
}

#[test]
fn closed_loop_is_0_at_a_zero_of_the_open_loop() {
    // A low-pass filter has a double zero at the Nyquist frequency.
    let (axis, periods) = x_axis(&["x.current_filter_1.type=low_pass"]);
    let model = response(&axis, &periods, ControlLoop::Velocity);
    let nyquist = model.nyquist_frequency();
    assert_eq!((model.open(nyquist).norm(), model.closed(nyquist).norm()), (0.0, 0.0));
    assert!(model.margins().is_ok_and(|found| found.margins.modulus > 0.3));
}

#[test]
fn phases_are_continuous() {
    let values: Vec<Complex<f64>> =
        (0..100).map(|k| Complex::from_polar(1.0, -3.0 - 0.2 * f64::from(k))).collect();
    for (k, phase) in continuous_phases(&values).into_iter().enumerate() {
        assert!((phase + 3.0 + 0.2 * k as f64).abs() < 1e-9, "{k}: {phase}");
    }
    let sampled = response(&x_axis(&[]).0, &x_axis(&[]).1, ControlLoop::Position).sample();
    let last = sampled.frequencies[sampled.frequencies.len() - 1];
    assert!((last - 0.5 / 0.006).abs() < 1e-9 && sampled.frequencies[0] == 0.1, "{last}");
    assert!(sampled.frequencies.windows(2).all(|pair| pair[0] < pair[1]));
}
