//! P, PI, PID and pole placement in RST form.

use crate::design_common::{TSP, axes, model, models};
use nalgebra::Complex;
use proptest::prelude::*;
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{
    DesignError, PidTuning, PolePlacement, check_stable, p_controller, pi_controller, pid_controller,
    pole_pair, pole_placement, poles,
};

/// Computes Ω* of a controller for these signals by its difference equation.
fn run(rst: &Rst, setpoints: &[f64], angles: &[f64]) -> Vec<f64> {
    let mut speeds: Vec<f64> = Vec::new();
    let back = |signal: &[f64], k: usize, lag: usize| k.checked_sub(lag).map_or(0.0, |i| signal[i]);
    for k in 0..setpoints.len() {
        let t =
            rst.t().iter().zip(rst.t_first()..).map(|(c, ahead)| c * back(setpoints, k, (-ahead) as usize));
        let r = rst.r().iter().enumerate().map(|(lag, c)| c * back(angles, k, lag));
        let s = rst.s().iter().enumerate().skip(1).map(|(lag, c)| c * back(&speeds, k, lag));
        let speed = t.sum::<f64>() - r.sum::<f64>() - s.sum::<f64>();
        speeds.push(speed);
    }
    speeds
}

fn signals() -> (Vec<f64>, Vec<f64>) {
    let wave = |rate: f64| (0..60).map(|k| (rate * f64::from(k)).sin() + 0.01 * f64::from(k)).collect();
    (wave(0.31), wave(0.7))
}

#[track_caller]
fn assert_run(rst: &Rst, wanted: impl Fn(&[f64], &[f64]) -> Vec<f64>) {
    let (setpoints, angles) = signals();
    let (found, wanted) = (run(rst, &setpoints, &angles), wanted(&setpoints, &angles));
    let scale = wanted.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
    for (f, w) in found.iter().zip(&wanted) {
        assert!((f - w).abs() <= 1e-12 * scale, "{f}, expected {w}");
    }
}

/// Returns the PID controller of [`PidTuning`] in state form.
fn textbook(tuning: PidTuning) -> impl Fn(&[f64], &[f64]) -> Vec<f64> {
    move |setpoints, angles| {
        let (mut integral, mut derivative, mut speeds) = (0.0, 0.0, Vec::new());
        let (mut last_setpoint, mut last_angle) = (0.0, 0.0);
        for (setpoint, angle) in setpoints.iter().zip(angles) {
            let error = setpoint - angle;
            integral += tuning.gain * TSP / tuning.integral_time * error;
            let memory = tuning.filter_time / (tuning.filter_time + TSP);
            let slope = tuning.gain * tuning.derivative_time / (tuning.filter_time + TSP);
            derivative = memory * derivative - slope * (angle - last_angle);
            let forward = tuning.velocity_feedforward * (setpoint - last_setpoint) / TSP;
            speeds.push(tuning.gain * error + integral + derivative + forward);
            (last_setpoint, last_angle) = (*setpoint, *angle);
        }
        speeds
    }
}

#[test]
fn rst_polynomials_equal_the_textbook_controllers() {
    let full = PidTuning {
        gain: 25.0,
        integral_time: 0.2,
        derivative_time: 0.01,
        filter_time: 0.005,
        velocity_feedforward: 0.9,
    };
    assert_run(&pid_controller(&full, TSP).expect("a PID"), textbook(full));
    let unfiltered = PidTuning { filter_time: 0.0, ..full };
    assert_run(&pid_controller(&unfiltered, TSP).expect("a PID"), textbook(unfiltered));
    let no_derivative = PidTuning { derivative_time: 0.0, ..full };
    let pi = pi_controller(25.0, 0.2, 0.9, TSP).expect("a PI");
    assert_run(&pi, textbook(no_derivative));
    assert_eq!(pid_controller(&no_derivative, TSP), Ok(pi));
    let proportional = PidTuning { derivative_time: 0.0, integral_time: f64::INFINITY, ..full };
    assert_run(&p_controller(25.0, 0.9, TSP).expect("a P"), textbook(proportional));
}

#[test]
fn proportional_controller_has_three_coefficients() {
    let rst = p_controller(25.0, 0.0, TSP).expect("a P");
    assert_eq!((rst.r(), rst.s(), rst.t(), rst.t_first()), (&[25.0][..], &[1.0][..], &[25.0][..], 0));
    assert!(!rst.has_integral_action());
    assert!(pi_controller(25.0, 0.1, 0.0, TSP).expect("a PI").has_integral_action());
}

#[test]
fn invalid_gains_and_times_are_rejected_by_name() {
    let good = PidTuning {
        gain: 25.0,
        integral_time: 0.2,
        derivative_time: 0.01,
        filter_time: 0.005,
        velocity_feedforward: 1.0,
    };
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let tunings = [
            ("gain", PidTuning { gain: bad, ..good }),
            ("integral_time", PidTuning { integral_time: bad, ..good }),
            ("derivative_time", PidTuning { derivative_time: bad, ..good }),
            ("filter_time", PidTuning { filter_time: bad, ..good }),
            ("velocity_feedforward", PidTuning { velocity_feedforward: bad, ..good }),
        ];
        for (wanted, tuning) in tunings {
            match pid_controller(&tuning, TSP) {
                Err(DesignError::OutOfRange { name, .. }) => assert_eq!(name, wanted),
                other => panic!("{wanted} = {bad}: {other:?}"),
            }
        }
        assert!(matches!(p_controller(25.0, 0.0, bad), Err(DesignError::OutOfRange { name: "period", .. })));
    }
    let message = pi_controller(0.0, 0.2, 0.0, TSP).expect_err("no gain").to_string();
    assert_eq!(message, "gain = 0 must be above 0 and at most 10000 s⁻¹");
}

fn placed(poles: &[Complex<f64>], integrator: bool) -> PolePlacement {
    PolePlacement { poles: poles.to_vec(), integrator, velocity_feedforward: 0.0 }
}

#[test]
fn pole_placement_of_a_first_order_lag() {
    // A = 1 − 0.8q⁻¹, B = 0.4q⁻¹, one pole at 0.5: S = 1, R = r with −0.8 + 0.4 r = −0.5.
    let lag = model(&[1.0, -0.8], &[0.0, 0.4]);
    let rst = pole_placement(&lag, &placed(&[0.5.into()], false)).expect("a controller");
    assert!((rst.r()[0] - 0.75).abs() < 1e-15 && rst.s() == [1.0], "{rst:?}");
    // With integrator, two: −1.8 + 0.4 r₀ = −0.5 − 0.2, 0.8 + 0.4 r₁ = 0.1.
    let rst = pole_placement(&lag, &placed(&[0.5.into(), 0.2.into()], true)).expect("a controller");
    assert!((rst.r()[0] - 2.75).abs() < 1e-14 && (rst.r()[1] + 1.75).abs() < 1e-14, "{rst:?}");
    assert!(rst.s() == [1.0, -1.0] && (rst.t()[0] - 1.0).abs() < 1e-14, "{rst:?}");
}

#[test]
fn every_axis_gets_the_desired_poles() {
    for (name, model) in axes() {
        for integrator in [false, true] {
            let mut wanted = pole_pair(60.0, 0.8, TSP).expect("a pair").to_vec();
            wanted.extend([0.3, 0.2].map(Complex::from));
            let rst = pole_placement(&model, &placed(&wanted, integrator)).expect("a controller");
            assert_eq!(rst.has_integral_action(), integrator, "{name}");
            let found = poles(&model, &rst).expect("poles");
            for pole in &wanted {
                let nearest = found.iter().map(|f| (f - pole).norm()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-6, "{name}: {pole} is not in {found:?}");
            }
            check_stable(&model, &rst).expect("stable");
        }
    }
}

#[test]
fn pole_pair_has_its_bandwidth_and_damping() {
    for (bandwidth, damping) in [(60.0, 0.7), (200.0, 0.05), (3.0, 0.999)] {
        let [one, other] = pole_pair(bandwidth, damping, TSP).expect("a pair");
        assert!((one - other.conj()).norm() < 1e-15 && one.im != 0.0, "{one} {other}");
        let s = one.ln() / TSP;
        assert!((s.norm() - bandwidth).abs() < 1e-9 * bandwidth, "{s}");
        assert!((-s.re / s.norm() - damping).abs() < 1e-9, "{s}");
    }
    let [slow, fast] = pole_pair(60.0, 1.25, TSP).expect("a pair");
    // s² + 150 s + 3600 = (s + 30)(s + 120)
    assert!((slow - (-30.0 * TSP).exp()).norm() < 1e-15 && (fast - (-120.0 * TSP).exp()).norm() < 1e-15);
    for (bandwidth, damping, name) in
        [(0.0, 0.7, "bandwidth"), (600.0, 0.7, "bandwidth"), (60.0, -0.1, "damping")]
    {
        match pole_pair(bandwidth, damping, TSP) {
            Err(DesignError::OutOfRange { name: found, .. }) => assert_eq!(found, name),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn poles_that_cannot_be_placed_are_rejected_by_name() {
    let lag = model(&[1.0, -0.8], &[0.0, 0.4]);
    let rejection = |model, poles: &[Complex<f64>]| {
        pole_placement(model, &placed(poles, true)).expect_err("rejected").to_string()
    };
    assert_eq!(
        rejection(&lag, &[0.1.into(), 0.2.into(), 0.3.into()]),
        "poles = 3 must be at most 2 in number, the order of this loop"
    );
    assert_eq!(
        rejection(&lag, &[1.0.into()]),
        "the desired pole 1.000000 has the modulus 1; it must be below 1 − 10⁻⁶"
    );
    assert_eq!(
        rejection(&lag, &[0.2.into(), Complex::new(0.5, 0.25)]),
        "the desired pole 0.500000 + 0.250000j must come with its conjugate 0.500000 − 0.250000j"
    );
    assert!(rejection(&lag, &[f64::NAN.into()]).contains("NaN"));
    // A = (1 − 0.8q⁻¹)(1 − 0.3q⁻¹), B = 0.4q⁻¹(1 − 0.3q⁻¹)
    let shared = model(&[1.0, -1.1, 0.24], &[0.0, 0.4, -0.12]);
    assert_eq!(
        rejection(&shared, &[0.1.into()]),
        "poles cannot be placed: A and B of the prediction model share the root 0.300000 or nearly so"
    );
    // B(1) = 0 cancels an integrator.
    let differentiating = model(&[1.0, -0.8], &[0.0, 0.4, -0.4]);
    assert!(rejection(&differentiating, &[0.1.into()]).contains("share the root 1.000000"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn pole_placement_gives_the_desired_poles(
        model in models(),
        size in 0.1..0.95_f64,
        turn in 0.0..3.0_f64,
        integrator in any::<bool>(),
    ) {
        let pole = Complex::from_polar(size, turn);
        let rst = match pole_placement(&model, &placed(&[pole, pole.conj()], integrator)) {
            Ok(rst) => rst,
            // Models of low order, and close roots of A and B.
            Err(DesignError::OutOfRange { name: "poles", .. } | DesignError::SharedRoot { .. }) => return Ok(()),
            Err(DesignError::Rst(_)) => return Ok(()),
            Err(other) => return Err(TestCaseError::fail(format!("{other}"))),
        };
        // A S + B R = 1 − 2 size cos(turn) q⁻¹ + size² q⁻², without further terms.
        let (a, b) = (model.a(), model.b());
        let scale: f64 = crate::design_common::times(a, rst.s()).iter().chain(&crate::design_common::times(b, rst.r())).map(|c| c.abs()).sum();
        let at = |p: &[f64], q: &[f64], i: usize| -> f64 {
            (0..=i).filter_map(|j| Some(p.get(j)? * q.get(i - j)?)).sum()
        };
        let wanted = [1.0, -2.0 * pole.re, pole.norm_sqr()];
        for i in 0..a.len() + rst.s().len() + b.len() + rst.r().len() {
            let found = at(a, rst.s(), i) + at(b, rst.r(), i);
            prop_assert!((found - wanted.get(i).unwrap_or(&0.0)).abs() <= 1e-8 * scale, "{i}: {found}");
        }
    }
}
