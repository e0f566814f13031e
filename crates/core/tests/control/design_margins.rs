//! Stability margins against closed forms, a fine grid, and the poles of loops at the stability limit.

use std::f64::consts::PI;
use std::time::Instant;

use crate::design_common::{
    TSP, axes, delayed, gpc_controller, model, models, open_loop, relative, scaled_gain,
};
use proptest::prelude::*;
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{
    DesignError, Margins, PredictionModel, check_stable, gpc, margins, p_controller, poles,
};

#[track_caller]
fn assert_close(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance * wanted.abs(), "{found}, expected {wanted}");
}

fn margins_of(model: &PredictionModel, rst: &Rst) -> Margins {
    margins(model, rst).expect("a stable loop")
}

#[test]
fn margins_of_an_integrator_with_proportional_control() {
    // L = K q⁻¹/(1 − q⁻¹), K = Kp Tsp: L(e^{jx}) = K e^{−jx/2}/(2j sin x/2).
    for loop_gain in [0.001, 0.1, 0.3, 1.0, 1.2, 1.9] {
        let integrator = model(&[1.0, -1.0], &[0.0, TSP]);
        let found = margins_of(&integrator, &p_controller(loop_gain / TSP, 0.0, TSP).expect("a controller"));
        // |L| = 1 at 2 sin x/2 = K, where the phase is −π/2 − x/2; real and negative at π only.
        let crossover = 2.0 * (loop_gain / 2.0).asin();
        assert_close(found.phase, (PI - crossover) / 2.0, 1e-9);
        assert_close(found.delay, (PI - crossover) / 2.0 / crossover * TSP, 1e-9);
        assert_close(found.gain, 2.0 / loop_gain, 1e-12);
        assert_eq!(found.gain_reduction, 0.0);
        // |1 + L|² = 1 + K(K − 2)/(4 sin² x/2), which is smallest at π for K < 2.
        assert_close(found.modulus, 1.0 - loop_gain / 2.0, 1e-9);
    }
}

#[test]
fn margins_of_a_lag_without_crossover() {
    // L = K q⁻¹ (1 − a)/(1 − a q⁻¹): from K at 0 to −K (1 − a)/(1 + a) at π, |L| < 1 for K < 1.
    let (pole, gain) = (0.8, 0.5);
    let lag = model(&[1.0, -pole], &[0.0, 1.0 - pole]);
    let found = margins_of(&lag, &p_controller(gain, 0.0, TSP).expect("a controller"));
    assert_eq!((found.phase, found.delay), (f64::INFINITY, f64::INFINITY));
    assert_close(found.gain, (1.0 + pole) / (1.0 - pole) / gain, 1e-12);
    // |1 + L|² is a quotient of two linear functions of cos x, which is monotonic.
    assert_close(found.modulus, (1.0 - gain * (1.0 - pole) / (1.0 + pole)).min(1.0 + gain), 1e-12);
}

#[test]
fn unstable_plant_has_a_gain_reduction_margin() {
    // Pole at 1.2 by b = 1: the loop's pole is 1.2 − k, stable for 0.2 < k < 2.2.
    let runaway = model(&[1.0, -1.2], &[0.0, 1.0]);
    let found = margins_of(&runaway, &p_controller(1.0, 0.0, TSP).expect("a controller"));
    assert_close(found.gain_reduction, 0.2, 1e-12);
    assert_close(found.gain, 2.2, 1e-12);
}

/// Returns the smallest modulus margin and the smallest delay margin (s) of the named axes.
fn worst(n2: usize, nu: usize, lambda: f64, names: &[&str]) -> (f64, f64) {
    let axes = axes().into_iter().filter(|(name, _)| names.contains(&name.as_str()));
    let found =
        axes.map(|(_, model)| margins_of(&model, &gpc_controller(&model, relative(1, n2, nu, lambda))));
    found.fold((f64::INFINITY, f64::INFINITY), |(m, d), f| (m.min(f.modulus), d.min(f.delay)))
}

#[test]
fn margins_of_the_preset_on_every_axis() {
    let (modulus, delay) = worst(14, 12, 0.005, &["x", "y", "z", "a", "c"]);
    assert!(modulus >= 0.59 && delay >= 7.2e-3, "{modulus}, {delay} s");
}

#[test]
fn margins_of_the_ballbar_tunings() {
    // The axes of the circle; A and C have 0.335.
    let (modulus, _) = worst(8, 6, 1e-3, &["x", "y"]);
    assert!((modulus - 0.34).abs() <= 0.005, "{modulus}");
    // The model page truncates its digits.
    let (modulus, delay) = worst(8, 6, 1e-2, &["x", "y", "z", "a", "c"]);
    assert!((0.49..0.50).contains(&modulus) && (4.4e-3..4.5e-3).contains(&delay), "{modulus}, {delay} s");
}

#[test]
fn loop_at_its_delay_margin_has_poles_on_the_unit_circle() {
    // The delay margin decreases with the gain: at the gain at which the poles become unstable with n cycles of delay,
    // the margin is n cycles.
    for (name, axis) in axes() {
        let rst = gpc_controller(&axis, relative(1, 14, 12, 0.005));
        for periods in 1..=3 {
            let late = delayed(&axis, periods);
            let unstable = |factor| check_stable(&late, &scaled_gain(&rst, factor)).is_err();
            let (mut low, mut high) = (1e-3, 1.6);
            assert!(!unstable(low) && unstable(high), "{name}, {periods}");
            for _ in 0..50 {
                let middle = (low + high) / 2.0;
                *(if unstable(middle) { &mut high } else { &mut low }) = middle;
            }
            let found = margins_of(&axis, &scaled_gain(&rst, low)).delay;
            // Poles count as unstable from 1e-6 inside the circle on.
            assert_close(found, periods as f64 * TSP, 1e-4);
        }
    }
}

#[test]
fn margins_resolve_a_narrow_resonance_of_the_controller() {
    // S has a pair 1e-5 inside the circle, R one 6e-5 inside it: |L| is 0.2, but 1.2 over a few 1e-5 rad.
    let turn = PI / 3.0;
    let pair = |depth: f64| [1.0, -2.0 * (1.0 - depth) * turn.cos(), (1.0 - depth) * (1.0 - depth)];
    let r = pair(6e-5).map(|c| 0.2 * c);
    let rst = Rst::new(&r, &pair(1e-5), &[r.iter().sum()], 0).expect("a controller");
    let direct = model(&[1.0], &[0.0, 0.0, 1.0]);
    let found = margins_of(&direct, &rst);
    let fine = || (-200_000..=200_000).map(|i| turn + f64::from(i) * 1e-9);
    let modulus = fine().map(|x| (open_loop(&direct, &rst, x) + 1.0).norm()).fold(f64::INFINITY, f64::min);
    assert!(modulus < 0.5, "{modulus}");
    assert_close(found.modulus, modulus, 1e-6);
    let delays = fine().filter(|x| open_loop(&direct, &rst, *x).norm() > 1.0).map(|x| {
        let ahead = (-open_loop(&direct, &rst, x)).arg().rem_euclid(2.0 * PI);
        ahead / x * TSP
    });
    assert_close(found.delay, delays.fold(f64::INFINITY, f64::min), 1e-4);
}

#[test]
fn unstable_loop_is_reported_with_its_pole() {
    let integrator = model(&[1.0, -1.0], &[0.0, 1.0]);
    let result = margins(&integrator, &p_controller(2.5, 0.0, TSP).expect("a controller"));
    assert_eq!(result, Err(DesignError::Unstable { re: -1.5, im: 0.0, modulus: 1.5 }));
}

#[test]
fn a_thousand_loops_take_less_than_a_second() {
    let axes = axes();
    let rst = gpc_controller(&axes[0].1, relative(1, 14, 12, 0.005));
    let start = Instant::now();
    for _ in 0..1000 {
        std::hint::black_box(margins_of(&axes[0].1, &rst));
    }
    let took = start.elapsed();
    assert!(took.as_secs_f64() < 1.0, "{took:?}");
}

/// Computes modulus, phase and delay margin by brute force: |1 + L| on a fine grid, crossovers by bisection.
fn brute_force(model: &PredictionModel, rst: &Rst) -> [f64; 3] {
    const POINTS: usize = 20_000;
    let [mut modulus, mut phase, mut delay] = [f64::INFINITY; 3];
    // Half of the points are spaced logarithmically, for slow loops.
    let mut angles: Vec<f64> = (1..=POINTS).map(|i| PI * i as f64 / POINTS as f64).collect();
    angles.extend((0..POINTS).map(|i| 1e-7 * (PI / 1e-7).powf(i as f64 / POINTS as f64)));
    angles.sort_by(f64::total_cmp);
    let above_unity = |x: f64| open_loop(model, rst, x).norm() > 1.0;
    let mut before: Option<(f64, bool)> = None;
    for x in angles {
        let l = open_loop(model, rst, x);
        modulus = modulus.min((l + 1.0).norm());
        let here = l.norm() > 1.0;
        if let Some((mut low, side)) = before
            && side != here
        {
            let mut high = x;
            while high - low > 1e-14 * high {
                let middle = (low + high) / 2.0;
                *(if above_unity(middle) == side { &mut low } else { &mut high }) = middle;
            }
            let ahead = (-open_loop(model, rst, high)).arg().rem_euclid(2.0 * PI);
            phase = phase.min(ahead).min(2.0 * PI - ahead);
            delay = delay.min(ahead / high * TSP);
        }
        before = Some((x, here));
    }
    [modulus, phase, delay]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn margins_equal_those_of_a_fine_grid(model in models(), n2 in 3_usize..15, lambda in 1e-3..1.0_f64) {
        let Ok(rst) = gpc(&model, &relative(1, n2, n2.min(4), lambda)) else {
            return Ok(());
        };
        let Ok(found) = margins(&model, &rst) else {
            return Ok(());
        };
        let wanted = brute_force(&model, &rst);
        for (found, wanted) in [found.modulus, found.phase, found.delay].into_iter().zip(wanted) {
            let near = found == wanted || (found - wanted).abs() <= 1e-4 * wanted;
            prop_assert!(near, "{found}, expected {wanted}");
        }
    }

    #[test]
    fn loop_is_stable_up_to_its_gain_margins(
        model in models(),
        n2 in 3_usize..15,
        lambda in 1e-3..1.0_f64,
        shares in prop::collection::vec(0.0..1.0_f64, 8),
    ) {
        let Ok(rst) = gpc(&model, &relative(1, n2, n2.min(4), lambda)) else {
            return Ok(());
        };
        let Ok(found) = margins(&model, &rst) else {
            return Ok(());
        };
        // Slow poles count as stable here.
        let stable = |factor| poles(&model, &scaled_gain(&rst, factor)).expect("poles")[0].norm() < 1.0;
        // Factors beyond the search range are not checked.
        let (up, down) = (found.gain.min(1e4), found.gain_reduction.max(1e-2));
        for share in shares {
            prop_assert!(stable(1.0 + share * (up * 0.9999 - 1.0)), "{found:?}");
            prop_assert!(stable(1.0 - share * (1.0 - down * 1.0001)), "{found:?}");
        }
        prop_assert!(up < found.gain || !stable(up * 1.0001), "{found:?}");
        prop_assert!(down > found.gain_reduction || !stable(down * 0.9999), "{found:?}");
    }
}
