//! Poles of closed loops with known solutions, and rejection of unstable loops.

use crate::design_common::{TSP, axes, gpc_controller, model, models, relative, times};
use nalgebra::Complex;
use proptest::prelude::*;
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{
    DesignError, PredictionModel, check_stable, margins, p_controller, poles, require_stable,
};

/// Checks that each expected pole has a distinct computed pole within the tolerance.
#[track_caller]
fn assert_poles(found: &[Complex<f64>], wanted: &[Complex<f64>], tolerance: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?}, expected {wanted:?}");
    let mut left = found.to_vec();
    for pole in wanted {
        let nearest =
            (0..left.len()).min_by(|&i, &j| (left[i] - pole).norm().total_cmp(&(left[j] - pole).norm()));
        let nearest = left.swap_remove(nearest.expect("as many"));
        assert!((nearest - pole).norm() <= tolerance, "{pole} is not in {found:?}");
    }
}

#[test]
fn poles_of_an_integrator_with_dead_time() {
    // z^(d+1) − z^d + K: at K = dᵈ/(d+1)^(d+1) two poles meet at d/(d+1); for d = 1 all poles are known.
    let plant = model(&[1.0, -1.0], &[0.0, 0.0, 1.0]);
    let loop_with =
        |gain| poles(&plant, &p_controller(gain, 0.0, TSP).expect("a controller")).expect("poles");
    let root = (0.25_f64 - 0.16).sqrt();
    assert_poles(&loop_with(0.16), &[(0.5 + root).into(), (0.5 - root).into()], 1e-14);
    let pair = Complex::new(0.5, (0.5_f64 - 0.25).sqrt());
    assert_poles(&loop_with(0.5), &[pair, pair.conj()], 1e-14);
    assert_poles(&loop_with(0.25), &[0.5.into(), 0.5.into()], 1e-7);
}

#[test]
fn poles_are_sorted_by_modulus_with_adjacent_pairs() {
    // A = (1 − 0.3q⁻¹)(1 − 1.2q⁻¹ + 0.72q⁻²)(1 + 0.9q⁻¹) and a negligible controller gain.
    let a = times(&times(&[1.0, -0.3], &[1.0, -1.2, 0.72]), &[1.0, 0.9]);
    let found = poles(&model(&a, &[0.0, 1e-13]), &p_controller(1e-3, 0.0, TSP).expect("a controller"))
        .expect("poles");
    let wanted = [(-0.9).into(), Complex::new(0.6, 0.6), Complex::new(0.6, -0.6), 0.3.into()];
    for (f, w) in found.iter().zip(wanted) {
        assert!((f - w).norm() < 1e-12, "{found:?}");
    }
}

#[test]
fn delays_add_poles_at_zero() {
    let plant = model(&[1.0, -0.5, 0.0, 0.0], &[0.0, 0.2]);
    assert_poles(
        &poles(&plant, &p_controller(1.0, 0.0, TSP).expect("a controller")).expect("poles"),
        &[0.3.into(), 0.0.into(), 0.0.into()],
        1e-15,
    );
}

#[test]
fn unstable_loop_is_rejected_unless_allowed() {
    let plant = model(&[1.0, -1.0], &[0.0, 0.0, 1.0]);
    let rst = p_controller(1.25, 0.0, TSP).expect("a controller");
    // z² − z + 1.25 = 0
    match require_stable(&plant, rst.clone(), false) {
        Err(DesignError::Unstable { re, im, modulus }) => {
            assert!((re - 0.5).abs() < 1e-12 && (im - 1.0).abs() < 1e-12, "{re} {im}");
            assert!((modulus - 1.25_f64.sqrt()).abs() < 1e-12, "{modulus}");
        }
        other => panic!("{other:?}"),
    }
    let message = check_stable(&plant, &rst).expect_err("unstable").to_string();
    assert_eq!(
        message,
        "the closed loop is unstable: its pole 0.500000 + 1.000000j has the modulus 1.118033989; it must be below 1 − 10⁻⁶"
    );
    assert_eq!(require_stable(&plant, rst.clone(), true), Ok(rst));
}

#[test]
fn pole_on_the_unit_circle_is_unstable() {
    let plant = model(&[1.0, -1.0], &[0.0, 1.0]);
    // Poles at 1 − 10⁻⁹ and at −1.
    let slow = Rst::new(&[1e-9], &[1.0], &[1e-9], 0).expect("a controller");
    assert!(matches!(check_stable(&plant, &slow), Err(DesignError::Unstable { .. })));
    let ringing = Rst::new(&[2.0], &[1.0], &[2.0], 0).expect("a controller");
    assert!(matches!(check_stable(&plant, &ringing), Err(DesignError::Unstable { re: -1.0, .. })));
}

#[test]
fn the_preset_is_stable_on_every_axis() {
    for (name, model) in axes() {
        let rst = gpc_controller(&model, relative(1, 14, 12, 0.005));
        let found = poles(&model, &rst).expect("poles");
        let order = (model.a().len() + rst.s().len()).max(model.b().len() + rst.r().len()) - 2;
        assert_eq!(found.len(), order, "{name}");
        assert!(found[0].norm() < 0.95, "{name}: {found:?}");
        check_stable(&model, &rst).expect("stable");
    }
}

/// Returns true if θ decays after an impulse, by running the loop.
fn settles(model: &PredictionModel, rst: &Rst) -> bool {
    let (mut angles, mut speeds) = (vec![0.0; 4000], vec![0.0; 4000]);
    for k in 100..4000 {
        let back = |signal: &[f64], polynomial: &[f64], from: usize| -> f64 {
            polynomial.iter().enumerate().skip(from).map(|(lag, c)| c * signal[k - lag]).sum()
        };
        let impulse = if k == 100 { 1.0 } else { 0.0 };
        angles[k] = impulse + back(&speeds, model.b(), 1) - back(&angles, model.a(), 1);
        speeds[k] = -back(&angles, rst.r(), 0) - back(&speeds, rst.s(), 1);
    }
    angles[3900..].iter().all(|angle| angle.abs() < 1e-3)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn stable_loops_settle(model in models(), gain in 1e-3..3.0_f64) {
        let rst = p_controller(gain, 0.0, TSP).expect("a controller");
        let largest = poles(&model, &rst).expect("poles")[0].norm();
        // Close to the circle a run of some seconds is not conclusive.
        prop_assume!((largest - 1.0).abs() > 5e-3);
        prop_assert_eq!(settles(&model, &rst), largest < 1.0);
        prop_assert_eq!(check_stable(&model, &rst).is_ok(), largest < 1.0);
        prop_assert_eq!(margins(&model, &rst).is_ok(), largest < 1.0);
    }
}
