//! Test motions of Prévost et al. with reference values from two independent implementations.

use virtual_axes_core::units::{DEGREE, REVOLUTION, RPM};
use virtual_axes_verification::fixtures::machines::*;

const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;
const A: usize = 3;
const C: usize = 4;
const MICROMETER: f64 = 1e-6;

const NO_FEEDFORWARD: &[(&str, f64)] = &[
    ("x.feedforward.velocity", 0.0),
    ("x.feedforward.torque_kg_m2", 0.0),
    ("y.feedforward.velocity", 0.0),
    ("y.feedforward.torque_kg_m2", 0.0),
];

/// Returns mean, minimum and maximum radial deviation at constant feed, over all ticks, µm.
fn ballbar(changes: &[(&str, f64)]) -> (f64, f64, f64) {
    let trial = Ballbar::paper();
    let window = trial.window();
    let (mut sum, mut count, mut min, mut max) = (0.0, 0.0, f64::INFINITY, f64::NEG_INFINITY);
    run(
        &mut machine(changes),
        trial.duration(),
        |t| trial.psec(t),
        |t, m| {
            if window.contains(&t) {
                let d = trial.radial_deviation(m.axis(X).sample().position, m.axis(Y).sample().position);
                sum += d;
                count += 1.0;
                min = d.min(min);
                max = d.max(max);
            }
        },
    );
    (sum / count / MICROMETER, min / MICROMETER, max / MICROMETER)
}

#[test]
fn ballbar_with_feedforward_has_49_micrometers_mean_radial_deviation() {
    let (mean, min, max) = ballbar(&[]);
    assert_near("mean", mean, 49.0, 0.2);
    assert_near("min", min, 47.7, 1.0);
    assert_near("max", max, 68.6, 1.0);
}

#[test]
fn ballbar_without_feedforward_has_minus_283_micrometers_mean_radial_deviation() {
    let (mean, min, max) = ballbar(NO_FEEDFORWARD);
    assert_near("mean", mean, -283.1, 0.2);
    assert_near("min", min, -284.4, 1.0);
    assert_near("max", max, -263.5, 1.0);
}

/// Returns the maximum contour error within 0.15 s of the corner, µm.
fn corner(turn: f64) -> f64 {
    const LEG: f64 = 0.050;
    let leg = RestToRestProfile::new(LEG, 10.0 * M_MIN, 2.5, 50.0);
    let (sin, cos) = turn.sin_cos();
    let psec = |t: f64| {
        let (first, second) = (leg.at(t), leg.at(t - leg.duration()));
        [first + second * cos, second * sin, 0.0, 0.0, 0.0]
    };
    let from_leg = |x: f64, y: f64, x0: f64, (ux, uy): (f64, f64)| {
        let along = ((x - x0) * ux + y * uy).clamp(0.0, LEG);
        (x - x0 - along * ux).hypot(y - along * uy)
    };
    let corner_time = leg.duration() + 0.009;
    let mut worst: f64 = 0.0;
    run(&mut machine(&[]), 2.0 * leg.duration() + 0.3, psec, |t, m| {
        if (t - corner_time).abs() <= 0.15 {
            let (x, y) = (m.axis(X).sample().position, m.axis(Y).sample().position);
            worst = worst.max(from_leg(x, y, 0.0, (1.0, 0.0)).min(from_leg(x, y, LEG, (cos, sin))));
        }
    });
    worst / MICROMETER
}

#[test]
fn corners_are_rounded_by_the_cascade() {
    assert_near("90°", corner(90.0 * DEGREE), 146.6, 1.466);
    assert_near("45°", corner(45.0 * DEGREE), 103.7, 1.037);
}

/// Returns the maximum delay-compensated following error at position cycles (m or rad) and the peak current (A).
fn move_one(axis: usize, profile: RestToRestProfile, changes: &[(&str, f64)]) -> (f64, f64) {
    let (mut error, mut current): (f64, f64) = (0.0, 0.0);
    let psec = |t: f64| {
        let mut psec = [0.0; AXES];
        psec[axis] = profile.at(t);
        psec
    };
    let mut tick = 0;
    run(&mut machine(changes), profile.duration() + 0.5, psec, |_, m| {
        let s = m.axis(axis).sample();
        if tick % m.periods().ticks_per_position() == 0 {
            error = error.max(s.delay_compensated_following_error().abs());
        }
        current = current.max(s.current.abs());
        tick += 1;
    });
    (error, current)
}

#[track_caller]
fn assert_one_percent(what: &str, value: f64, wanted: f64) {
    assert_near(what, value, wanted, wanted / 100.0);
}

fn line(acceleration: f64) -> RestToRestProfile {
    RestToRestProfile::new(0.200, 10.0 * M_MIN, acceleration, 50.0)
}

#[test]
fn line_in_x() {
    let (error, current) = move_one(X, line(2.5), &[]);
    assert_one_percent("X error, µm", error / MICROMETER, 218.9);
    assert_one_percent("X current, A", current, 14.40);
}

#[test]
fn line_in_x_for_each_feedforward() {
    for (changes, wanted) in [
        (&[("x.feedforward.torque_kg_m2", 0.0)][..], 220.2),
        (&[("x.feedforward.torque_kg_m2", 0.028)], 202.9),
        (&[("x.feedforward.torque_kg_m2", 0.028), ("x.delays.gamma_ms", 12.0)], 198.8),
        (NO_FEEDFORWARD, 6666.7),
    ] {
        let (error, _) = move_one(X, line(2.5), changes);
        assert_one_percent(&format!("{changes:?} error, µm"), error / MICROMETER, wanted);
    }
}

#[test]
fn line_in_y() {
    let (error, current) = move_one(Y, line(2.5), &[]);
    assert_one_percent("Y error, µm", error / MICROMETER, 230.5);
    assert_one_percent("Y current, A", current, 12.40);
}

#[test]
fn line_in_z_starts_with_the_holding_current_of_the_weight() {
    assert_one_percent("Z current at rest, A", machine(&[]).axis(Z).sample().current, 0.482);
    let (error, current) = move_one(Z, line(2.1), &[]);
    assert_one_percent("Z error, µm", error / MICROMETER, 102.7);
    assert_one_percent("Z current, A", current, 11.50);
}

#[test]
fn rotations_of_a_and_c() {
    let turn = RestToRestProfile::new(90.0 * DEGREE, 10.0 * RPM, 0.83 * REVOLUTION, 50.0 * REVOLUTION);
    for (name, axis, wanted_error, wanted_current) in [("C", C, 35.4, 1.76), ("A", A, 35.0, 2.37)] {
        let (error, current) = move_one(axis, turn, &[]);
        assert_one_percent(&format!("{name} error, mdeg"), error / DEGREE * 1e3, wanted_error);
        assert_one_percent(&format!("{name} current, A"), current, wanted_current);
    }
}
