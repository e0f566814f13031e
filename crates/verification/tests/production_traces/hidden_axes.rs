//! Parameters and simulation of hidden axes.

use virtual_axes_core::config::{FrictionConfig, MachineConfig, Parameters};
use virtual_axes_core::design::margins;
use virtual_axes_core::machine::{AxisSample, design_controller, prediction_model};
use virtual_axes_core::units::{METER_PER_MINUTE, MILLISECOND_NS, POSITION_GAIN};
use virtual_axes_verification::production_traces::{
    AxisOrientation, HiddenAxis, HiddenMachine, SimulatedAxis, machine_file, truth_file,
};

const ORIENTATIONS: [AxisOrientation; 2] = [AxisOrientation::Horizontal, AxisOrientation::Vertical];
const PERIOD: i64 = 2 * MILLISECOND_NS;

fn axes(seeds: std::ops::Range<u64>) -> impl Iterator<Item = (u64, HiddenAxis)> {
    seeds.flat_map(|seed| ORIENTATIONS.map(|orientation| (seed, HiddenAxis::draw(seed, orientation))))
}

#[test]
fn an_axis_depends_on_its_seed_and_orientation_only() {
    for (seed, axis) in axes(0..20) {
        assert_eq!(axis, HiddenAxis::draw(seed, ORIENTATIONS[axis.joint / 2]));
        assert_ne!(axis, HiddenAxis::draw(seed + 1000, ORIENTATIONS[axis.joint / 2]));
        assert_eq!(axis, HiddenMachine::draw(seed).axes[axis.joint]);
    }
}

#[test]
fn parameters_are_within_their_ranges_and_the_loops_are_stable() {
    let mut inverted = 0;
    for (seed, axis) in axes(0..100) {
        let config = &axis.config;
        let ms = |delay: i64| delay as f64 / MILLISECOND_NS as f64;
        let alpha = ms(config.delays.alpha);
        assert!((6.0..=15.0).contains(&alpha));
        assert!((2.0..=alpha).contains(&ms(config.delays.beta)));
        assert!((0.0..=alpha).contains(&ms(config.delays.gamma)));
        assert!((1.5..=3.5).contains(&(config.position_loop.gain / POSITION_GAIN)));
        assert!((0.005..=0.06).contains(&config.motor.inertia));
        assert!((22.0..=36.0).contains(&(config.limits.velocity / METER_PER_MINUTE)));
        assert!([1, 2, 6].contains(&(axis.periods.position / MILLISECOND_NS)));
        assert_eq!(config.feedforward.torque, config.motor.inertia);
        let weight = config.gravity.weight;
        assert!(if axis.joint == 2 { (3000.0..=6000.0).contains(&weight) } else { weight == 0.0 });
        assert!(config.friction.a + config.friction.c > 0.0 && config.friction.i0 > 0.0);
        inverted += u64::from(axis.is_current_inverted);

        let model = prediction_model(config, &axis.periods).expect("stable inner loops");
        let controller = design_controller(config, &model).expect("a controller");
        let margins = margins(&model, &controller).expect("a stable loop");
        assert!(margins.modulus > 0.5, "seed {seed}: {margins:?}");
    }
    assert!((70..130).contains(&inverted), "{inverted} of 200");
}

#[test]
fn a_guess_is_wrong_by_up_to_40_percent() {
    let (mut gains, mut periods) = (0, 0);
    for (seed, axis) in axes(0..100) {
        let guess = axis.guess(seed);
        let ratio = |of: fn(&HiddenAxis) -> f64, guessed: f64| guessed / of(&axis);
        let inertia = ratio(|axis| axis.config.motor.inertia, guess.config.motor.inertia);
        let torque = ratio(|axis| axis.config.motor.torque_constant, guess.config.motor.torque_constant);
        assert!((0.6..=1.4).contains(&inertia) && (0.6..=1.4).contains(&torque) && inertia != torque);
        assert!(!guess.is_period_known || guess.periods == axis.periods);
        assert_eq!(guess.is_gain_known, guess.config.position_loop.gain == axis.config.position_loop.gain);
        assert_eq!(guess.config.gravity.weight, 0.0);
        assert_eq!(guess.config.transmission_ratio, axis.config.transmission_ratio);
        gains += u64::from(guess.is_gain_known);
        periods += u64::from(guess.is_period_known);
    }
    assert!((70..130).contains(&gains) && (60..140).contains(&periods), "{gains}, {periods} of 200");
}

/// Returns the number of samples at rapid feed for 60 ms, and checks the lag of each.
fn samples_at_rapid_feed(seed: u64, axis: &HiddenAxis, simulated: &SimulatedAxis) -> usize {
    let (samples, period) = (&simulated.samples, simulated.period);
    let step = |k: usize| samples[k].psec - samples[k - 1].psec;
    let rapid = axis.config.limits.velocity * period;
    let constant = (0.06 / period).ceil() as usize;
    let is_rapid = |k: usize| (step(k).abs() - rapid).abs() < 1e-6 * rapid;
    let found: Vec<usize> =
        (constant + 1..samples.len()).filter(|&k| (k - constant..=k).all(is_rapid)).collect();
    for &k in &found {
        let lag = samples[k].following_error() / (step(k) / period);
        assert!((lag - axis.lag()).abs() < 1e-3, "seed {seed}: {lag} s, expected {} s", axis.lag());
        let beyond = axis.lag() - axis.config.delays.alpha as f64 * 1e-9;
        assert!((-1e-4..axis.periods.position as f64 * 1e-9).contains(&beyond));
    }
    found.len()
}

#[test]
fn simulations_are_finite_and_seldom_saturated_and_the_position_lags_by_alpha() {
    for (seed, axis) in axes(0..15) {
        let program = axis.program(seed, 5.0).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let simulated =
            axis.simulate(&program, PERIOD).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let samples = &simulated.samples;
        let is_finite = |s: &AxisSample| [s.position, s.velocity, s.current].iter().all(|v| v.is_finite());
        assert!(samples.iter().all(is_finite));
        let largest = |of: fn(&AxisSample) -> f64| samples.iter().fold(0.0_f64, |l, s| l.max(of(s).abs()));
        let current = largest(|s| s.current);
        let error = largest(AxisSample::delay_compensated_following_error);
        println!(
            "seed {seed} {}, Tsp {} ms: saturated {:.4}, {current:.1} of {:.1} A, {:.3} mm",
            axis.config.name,
            axis.periods.position / MILLISECOND_NS,
            simulated.saturated,
            axis.config.motor.max_current,
            error * 1e3,
        );
        assert!(simulated.saturated < 0.01, "seed {seed}: {}", simulated.saturated);
        assert!(current < axis.config.motor.max_current);
        assert!(error < 3e-3, "seed {seed}: {error} m");
        let duration = samples_at_rapid_feed(seed, &axis, &simulated) as f64 * simulated.period;
        assert!(duration > 0.03, "seed {seed}: {duration} s at rapid feed");
    }
}

/// Returns friction and weight as motor current at velocity `v` in m/s.
fn static_current(axis: &HiddenAxis, v: f64) -> f64 {
    let (config, speed) = (&axis.config, v.abs() / METER_PER_MINUTE);
    let FrictionConfig { a, b, c, d, .. } = config.friction;
    let weight = config.gravity.weight * config.transmission_ratio / config.motor.torque_constant;
    weight + v.signum() * (a * (b * speed).exp() + c * (d * speed).exp())
}

#[test]
fn the_mean_current_is_that_of_inertia_friction_and_weight() {
    for (seed, axis) in axes(0..10) {
        let program = axis.program(seed, 4.0).expect("a program");
        let simulated = axis.simulate(&program, PERIOD).expect("simulated");
        let (samples, mean, period) = (&simulated.samples, &simulated.mean_current, simulated.period);
        let (mut product, mut square) = (0.0, 0.0);
        for k in 1..samples.len() - 1 {
            if samples[k].velocity.abs() > 0.05 {
                let acceleration = (samples[k + 1].velocity - samples[k - 1].velocity) / (2.0 * period);
                let current = 0.25 * mean[k - 1] + 0.5 * mean[k] + 0.25 * mean[k + 1];
                product += acceleration * (current - static_current(&axis, samples[k].velocity));
                square += acceleration * acceleration;
            }
        }
        let motor = &axis.config.motor;
        let expected = motor.inertia / motor.torque_constant / axis.config.transmission_ratio;
        let ratio = product / square / expected;
        println!("seed {seed} {}, Tsp {period} s: {ratio:.4}", axis.config.name);
        assert!((ratio - 1.0).abs() < 0.03, "seed {seed}: {ratio}");
    }
}

#[test]
fn a_machine_file_contains_the_hidden_parameters() {
    let machine = HiddenMachine::draw(5);
    let configs: Vec<_> = machine.axes.iter().map(|axis| &axis.config).collect();
    let periods = machine.axes[0].periods;
    let text = machine_file("Test", &configs, periods).expect("in range");
    let read: MachineConfig =
        Parameters::from_yaml(&text, "hidden.yaml").expect("a machine file").machine_config().expect("valid");
    assert_eq!(read.periods(), periods);
    for (read, hidden) in read.axes().iter().zip(configs) {
        assert_eq!(read.delays, hidden.delays);
        let near = |read: f64, hidden: f64| (read - hidden).abs() <= 1e-12 * hidden.abs();
        assert!(near(read.transmission_ratio, hidden.transmission_ratio));
        assert!(near(read.velocity_loop.integral_time, hidden.velocity_loop.integral_time));
        assert!(near(read.position_loop.gain, hidden.position_loop.gain));
        assert!(
            near(read.limits.jerk, hidden.limits.jerk) && near(read.motor.max_speed, hidden.motor.max_speed)
        );
        assert_eq!((read.motor.inertia, read.friction), (hidden.motor.inertia, hidden.friction));
    }
    let truth = truth_file("Test", &machine.axes);
    assert!(truth.contains("backlash_um: 0.0") && truth.contains("motor.inertia_kg_m2: "));
}
