//! Filters of iterative learning control: closed loop, convergence condition, fixed point.

use std::f64::consts::PI;

use nalgebra::Complex;
use virtual_axes_core::config::{
    AxisConfig, DeviationConfig, FeedforwardConfig, MachineConfig, Parameters, PositionControllerConfig,
    Value, ValueSource,
};
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{
    DesignError, ImpulseResponse, LearningFilter, LearningTuning, PredictionModel,
};
use virtual_axes_core::machine::{
    closed_loop_response, design_controller, deviating_plant_model, prediction_model,
};

use crate::design_common::{TSP, at};

fn machine(controller: &str) -> MachineConfig {
    let mut parameters = Parameters::embedded_default().expect("the default machine");
    for axis in ["x", "y", "z", "a", "c"] {
        let (key, value) = (format!("{axis}.position_loop.controller"), Value::Text(controller.to_owned()));
        parameters.set(&key, value, &ValueSource::named("test")).expect("a controller");
    }
    parameters.machine_config().expect("a machine")
}

/// Closed loop B T q⁻² / (A S + B R) of the theory; α of 1.5 position cycles acts as 2.
fn closed_loop(model: &PredictionModel, rst: &Rst, x: f64) -> Complex<f64> {
    let (a, b, r, s) = (at(model.a(), x), at(model.b(), x), at(rst.r(), x), at(rst.s(), x));
    let t = at(rst.t(), -x) * Complex::from_polar(1.0, x * (rst.t_first() - 2) as f64);
    b * t / (a * s + b * r)
}

fn assert_equal(axis: &AxisConfig, config: &MachineConfig, model: &PredictionModel) {
    let rst = design_controller(axis, &prediction_model(axis, &config.periods()).expect("a model"));
    let rst = rst.expect("a controller");
    let response = closed_loop_response(axis, &config.periods()).expect("a response");
    for i in 0..=200 {
        let x = PI * f64::from(i) / 200.0;
        let (found, expected) = (response.at(x), closed_loop(model, &rst, x));
        assert!((found - expected).norm() < 1e-6, "{} at {x}: {found} and {expected}", axis.name());
    }
}

#[test]
fn the_transform_of_the_impulse_response_is_the_closed_loop_of_the_prediction_model() {
    for controller in ["gpc", "cascade"] {
        let config = machine(controller);
        for axis in config.axes() {
            let mut axis = axis.clone();
            // The feedforward of the cascade is not part of the prediction model.
            axis.feedforward = FeedforwardConfig { velocity: 0.0, torque: 0.0, ..axis.feedforward };
            let model = prediction_model(&axis, &config.periods()).expect("a model");
            assert_equal(&axis, &config, &model);
            axis.deviation = DeviationConfig { inertia: 1.3, friction: 1.0, torque_constant: 0.8 };
            let deviating = deviating_plant_model(&axis, &config.periods()).expect("a model");
            assert_equal(&axis, &config, &deviating);
        }
    }
}

#[test]
fn the_position_reaches_a_constant_setpoint_and_feedforward_follows_a_constant_velocity() {
    let config = machine("cascade");
    let axis = &config.axes()[0];
    let response = closed_loop_response(axis, &config.periods()).expect("a response");
    assert!((response.at(0.0).re - 1.0).abs() < 1e-6, "{}", response.at(0.0));
    // VFFW = 1 with β = α: the position lags by the delay alone, which the sampled feedforward makes 1.5 to 2 cycles.
    let lag: f64 = response.values().iter().zip(response.first()..).map(|(h, k)| h * k as f64).sum();
    assert!((1.4..2.6).contains(&lag), "{lag}");
}

#[test]
fn a_response_before_the_impulse_comes_from_the_preview() {
    let config = machine("gpc");
    let axis = &config.axes()[0];
    let PositionControllerConfig::Gpc(gpc) = &axis.position_loop.controller else { panic!("a GPC") };
    let response = closed_loop_response(axis, &config.periods()).expect("a response");
    // Preview N2, delay of 2 cycles, and one cycle until the position moves.
    assert_eq!(response.first(), 3 - gpc.n2 as i64);
}

#[test]
fn a_filter_sums_shifted_signals() {
    let filter = ImpulseResponse::new(-1, vec![2.0, 0.0, 3.0]);
    // y(k) = 2 x(k + 1) + 3 x(k − 1)
    assert_eq!(filter.apply(&[1.0, 10.0, 100.0, 1000.0]), [20.0, 203.0, 2030.0, 300.0]);
    let x = 0.7;
    let expected = Complex::from_polar(2.0, x) + Complex::from_polar(3.0, -x);
    assert!((filter.at(x) - expected).norm() < 1e-12);
    assert_eq!(filter.advanced(1).apply(&[1.0, 10.0, 100.0]), [203.0, 30.0, 300.0]);
}

/// Filters and closed loop of the X axis.
fn design(controller: &str, bandwidth: Option<f64>) -> (ImpulseResponse, LearningFilter) {
    let config = machine(controller);
    let response =
        closed_loop_response(&config.axes()[0], &config.periods()).expect("a response").advanced(2);
    let tuning = LearningTuning { bandwidth, ..LearningTuning::default() };
    let filter = LearningFilter::design(&response, &[], TSP, &tuning).expect("filters");
    (response, filter)
}

fn norm(signal: &[f64]) -> f64 {
    signal.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn each_iteration_contracts_by_the_reported_factor() {
    for controller in ["gpc", "cascade"] {
        for bandwidth in [None, Some(5.0), Some(60.0)] {
            let (response, filter) = design(controller, bandwidth);
            let factor = filter.nominal().factor;
            assert!(factor < 0.95, "{controller}: {factor}");
            // A motion in the middle, so that no filter reaches the ends.
            let mut programmed = vec![0.0; 8192];
            for (k, r) in programmed.iter_mut().enumerate().skip(3800).take(600) {
                *r = (1.0 - (2.0 * PI * (k as f64 - 3800.0) / 600.0).cos()) * (k as f64).sin();
            }
            let mut compensation = vec![0.0; programmed.len()];
            let (mut before, mut step) = (f64::INFINITY, f64::INFINITY);
            for _ in 0..6 {
                let commanded: Vec<f64> = programmed.iter().zip(&compensation).map(|(r, v)| r + v).collect();
                let position = response.apply(&commanded);
                let error: Vec<f64> = programmed.iter().zip(position).map(|(r, y)| r - y).collect();
                let next = filter.next_compensation(&compensation, &error);
                let change: Vec<f64> = next.iter().zip(&compensation).map(|(a, b)| a - b).collect();
                assert!(norm(&change) <= factor * step * (1.0 + 1e-9) + 1e-12, "{controller} {bandwidth:?}");
                (step, compensation) = (norm(&change), next);
                assert!(norm(&error) <= before * (1.0 + 1e-9) || before.is_infinite());
                before = norm(&error);
            }
        }
    }
}

#[test]
fn the_error_of_the_fixed_point_is_what_the_low_pass_filter_leaves() {
    let (t, filter) = design("cascade", Some(8.0));
    let signal = |f: f64, k: usize| (2.0 * PI * f * TSP * k as f64).sin();
    for frequency in [1.0, 4.0, 8.0, 20.0] {
        let programmed: Vec<f64> = (0..6000).map(|k| signal(frequency, k)).collect();
        let mut compensation = vec![0.0; programmed.len()];
        let mut error = Vec::new();
        for _ in 0..60 {
            let commanded: Vec<f64> = programmed.iter().zip(&compensation).map(|(r, v)| r + v).collect();
            error = programmed.iter().zip(t.apply(&commanded)).map(|(r, y)| r - y).collect();
            compensation = filter.next_compensation(&compensation, &error);
        }
        let x = 2.0 * PI * frequency * TSP;
        let (t, q, l) = (t.at(x), filter.low_pass().at(x), filter.learning().at(x));
        // e = (1 − Q) (1 − T) r / (1 − Q (1 − L T)): 0 for Q = 1.
        let expected = (1.0 - q) * (1.0 - t) / (1.0 - q * (1.0 - l * t));
        // In the middle, far from the ends, the error is a stationary sine.
        let found = error[2900..3100].iter().fold(0.0, |most: f64, e| most.max(e.abs()));
        assert!(
            (found - expected.norm()).abs() < 0.02 * expected.norm() + 1e-6,
            "{frequency} Hz: {found}, {expected}"
        );
    }
}

#[test]
fn the_convergence_condition_rejects_too_large_a_gain() {
    let (response, _) = design("gpc", None);
    let design = |gain, bandwidth| {
        LearningFilter::design(&response, &[], TSP, &LearningTuning { gain, bandwidth })
            .expect_err("an error")
    };
    // At frequency 0 T = 1, so that |1 − L T| = gain / 1.01 − 1.
    let error = design(2.5, Some(10.0));
    let DesignError::NotContracting { factor, frequency, .. } = error else { panic!("{error}") };
    assert!(factor >= 2.5 / 1.01 - 1.0 - 1e-6 && frequency < 15.0, "{factor} at {frequency} Hz");
    let text = error.to_string();
    assert!(text.contains("it must be below 1 at every frequency"), "{text}");
    for (gain, bandwidth, name) in
        [(0.0, None, "learning gain"), (f64::NAN, None, "learning gain"), (0.5, Some(84.0), "bandwidth")]
    {
        let error = design(gain, bandwidth).to_string();
        assert!(error.starts_with(name) && error.contains("must"), "{error}");
    }
}

#[test]
fn deviating_plants_lower_the_chosen_bandwidth_or_leave_it() {
    let config = machine("gpc");
    let response = |inertia| {
        let deviation = DeviationConfig { inertia, friction: 1.0, torque_constant: 1.0 };
        let axis = AxisConfig { deviation, ..config.axes()[0].clone() };
        closed_loop_response(&axis, &config.periods()).expect("a response").advanced(2)
    };
    let others = [response(0.7), response(1.3)];
    let design = |others: &[ImpulseResponse]| {
        LearningFilter::design(&response(1.0), others, TSP, &LearningTuning::default()).expect("filters")
    };
    let (alone, robust) = (design(&[]), design(&others));
    assert!(robust.bandwidth() <= alone.bandwidth());
    for other in &others {
        assert!(robust.contraction(other, TSP).factor <= 0.9 + 1e-3);
    }
}

#[test]
fn an_unstable_loop_is_rejected() {
    let config = machine("cascade");
    let mut axis = config.axes()[0].clone();
    axis.position_loop.gain *= 100.0;
    let error = closed_loop_response(&axis, &config.periods()).expect_err("an unstable loop").to_string();
    assert!(error.contains("settle"), "{error}");
}
