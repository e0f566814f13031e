//! Corners between long lines: distance from the path at the tolerance, and limits that are relaxed.

use virtual_axes_core::config::{Parameters, ValueSource};
use virtual_axes_nc::plan::PlanOptions;

use crate::limits::{fine_machine, plan_on};
use crate::programs::{Program, blend};

/// Returns a square of `length`, m, with a blending tolerance.
fn square(length: f64, feed: f64, tolerance: f64) -> Program {
    let mut program = Program::new(feed, blend(tolerance));
    program.line(length, 0.0, 0.0).line(length, length, 0.0).line(0.0, length, 0.0).line(0.0, 0.0, 0.0);
    program
}

/// Returns the smallest distance of `corner` from the polyline of `points`.
fn distance(corner: [f64; 2], points: &[[f64; 2]]) -> f64 {
    let to = |pair: &[[f64; 2]]| {
        let step = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let from = [corner[0] - pair[0][0], corner[1] - pair[0][1]];
        let squared = step[0] * step[0] + step[1] * step[1];
        let along = if squared > 0.0 { (from[0] * step[0] + from[1] * step[1]) / squared } else { 0.0 };
        let along = along.clamp(0.0, 1.0);
        (from[0] - along * step[0]).hypot(from[1] - along * step[1])
    };
    points.windows(2).map(to).fold(f64::INFINITY, f64::min)
}

#[test]
fn corners_are_passed_at_the_tolerance() {
    let machine = fine_machine();
    for (tolerance, feed) in [(5e-6, 2e-4), (20e-6, 1e-3), (100e-6, 5e-3), (1e-3, 0.03), (5e-3, 0.1)] {
        // The shorter side is as long as the knots of the two corners.
        let length = 18.0 * tolerance;
        let outcome =
            plan_on(&machine, &square(length, feed, tolerance), PlanOptions::default(), |_| 1.0).unwrap();
        outcome.audit.assert_kept();
        let points: Vec<_> = outcome.setpoints.iter().map(|s| [s.psec()[0], s.psec()[1]]).collect();
        for corner in [[length, 0.0], [length, length], [0.0, length]] {
            let found = distance(corner, &points);
            assert!((found - tolerance).abs() < 0.01 * tolerance, "{tolerance}: {found} at {corner:?}");
        }
    }
}

#[test]
fn corners_of_any_angle_are_passed_at_the_tolerance() {
    let machine = fine_machine();
    let leg = 0.02;
    for turn in [10.0_f64, 30.0, 60.0, 90.0, 120.0, 150.0] {
        let (sine, cosine) = turn.to_radians().sin_cos();
        for tolerance in [10e-6, 50e-6, 200e-6] {
            // Half a millimeter per second at the tolerance of 10 µm: the chords of the setpoints are far below it.
            let mut program = Program::new(50.0 * tolerance, blend(tolerance));
            program.line(leg, 0.0, 0.0).line(leg + leg * cosine, leg * sine, 0.0);
            let outcome = plan_on(&machine, &program, PlanOptions::default(), |_| 1.0).unwrap();
            outcome.audit.assert_kept();
            let points: Vec<_> = outcome.setpoints.iter().map(|s| [s.psec()[0], s.psec()[1]]).collect();
            let found = distance([leg, 0.0], &points);
            println!("turn {turn}°, P {:.0} µm: {:.2} µm", 1e6 * tolerance, 1e6 * found);
            // Two knots of a quarter of the line on either side of the corner: h |ΔT| / 6.
            let wanted = tolerance.min(0.25 * leg * 2.0 * (0.5 * turn.to_radians()).sin() / 6.0);
            assert!((found - wanted).abs() < 0.01 * wanted, "{turn}°, {tolerance}: {found} m, {wanted} m");
        }
    }
}

#[test]
fn a_wide_tolerance_is_used_as_far_as_the_lines_are_long() {
    let machine = fine_machine();
    let mut before = 0.0;
    for tolerance in [0.5e-3, 1e-3, 2e-3, 5e-3, 20e-3] {
        let outcome =
            plan_on(&machine, &square(0.1, 0.25, tolerance), PlanOptions::default(), |_| 1.0).unwrap();
        outcome.audit.assert_kept();
        let points: Vec<_> = outcome.setpoints.iter().map(|s| [s.psec()[0], s.psec()[1]]).collect();
        let found = distance([0.1, 0.0], &points);
        // Two knots of a quarter of the line on either side of each corner: h |ΔT| / 6.
        let wanted = tolerance.min(0.25 * 0.1 * 2.0_f64.sqrt() / 6.0);
        assert!(
            (found - wanted).abs() < 0.01 * wanted && found > 1.1 * before,
            "{tolerance}: {found}, {before} before"
        );
        before = found;
    }
}

#[test]
fn a_relaxed_jerk_limit_never_lengthens_the_motion() {
    // The time of trapezoids: each side of 100 mm from corner to corner is not shorter than at the feed.
    let program = square(0.1, 0.25, 10e-6);
    let mut before = f64::INFINITY;
    for jerk in [50.0, 100.0, 500.0, 1e3, 2e3, 5e3, 2e4, 1e5, 1e6, 1e7] {
        let mut parameters = Parameters::embedded_default().unwrap();
        for axis in ["x", "y"] {
            let text = format!("{axis}.limits.jerk_m_s3={jerk}");
            parameters.set_text(&text, &ValueSource::named("test")).unwrap();
        }
        let machine = parameters.machine_config().unwrap();
        let outcome = plan_on(&machine, &program, PlanOptions::default(), |_| 1.0).unwrap();
        outcome.audit.assert_kept();
        assert!(
            outcome.path_time < 1.002 * before,
            "{jerk} m/s³: {} s, {before} s before",
            outcome.path_time
        );
        before = before.min(outcome.path_time);
    }
    // Stops at the corners with the limits of the axes: 4 (s / v + v / a), with a = 2.5 m/s² of X and 3 m/s² of Y.
    let stops = 4.0 * 0.1 / 0.25 + 2.0 * 0.25 / 2.5 + 2.0 * 0.25 / 3.0;
    assert!(before < stops && before > 0.95 * stops, "{before} s, {stops} s with stops");
}
