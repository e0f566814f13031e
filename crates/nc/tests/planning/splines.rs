//! Splines: distance from the programmed curve, limits and cycle time.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use virtual_axes_nc::motion::{PathControl, ProgramStep};
use virtual_axes_nc::plan::{FeedPlanError, PlanOptions};

use crate::limits::{Outcome, plan, plan_with};
use crate::programs::{Program, blend};

/// Largest distance from a curve that is followed without tolerance, m: as on arcs.
const DEVIATION: f64 = 0.5e-6;

/// Returns an approach along X, and a quarter circle of the radius as a rational spline of order 3 or as an arc.
fn quarter_circle(radius: f64, feed: f64, control: PathControl, is_spline: bool) -> Program {
    let mut program = Program::new(feed, control);
    program.line(0.0, -0.01, 0.0);
    program.line(radius, -0.01, 0.0).line(radius, 0.0, 0.0);
    match is_spline {
        true => program.nurbs(3, &[([radius, radius], FRAC_1_SQRT_2), ([0.0, radius], 1.0)]),
        false => program.arc([0.0, 0.0], FRAC_PI_2, 0.0),
    };
    program
}

/// Returns the largest distance of the setpoints of the last motion from the circle, m, beyond the knots that blend the
/// line before it within `tolerance`: two distances h with h² κ / 6 of the tolerance.
fn distance(outcome: &Outcome, radius: f64, tolerance: f64) -> f64 {
    let from = (0.3 * radius).max(2.0 * (6.0 * tolerance * radius).sqrt());
    let points = outcome.setpoints.iter().map(|setpoint| setpoint.psec()).filter(|psec| psec[1] > from);
    points.map(|psec| (psec[0].hypot(psec[1]) - radius).abs()).fold(0.0, f64::max)
}

#[test]
fn a_quarter_circle_is_followed_as_an_arc() {
    for radius in [0.002, 0.03, 0.25] {
        let controls =
            [PathControl::ExactStop, PathControl::ExactPath, blend(1e-7), blend(1e-6), blend(5e-5)];
        for (control, allowed) in controls.into_iter().zip([DEVIATION, DEVIATION, 1e-7, DEVIATION, DEVIATION])
        {
            let [spline, arc] =
                [true, false].map(|is_spline| plan(&quarter_circle(radius, 0.05, control, is_spline)));
            spline.audit.assert_kept();
            let tolerance = match control {
                PathControl::Blend(blend) => blend.tolerance.unwrap(),
                _ => 0.0,
            };
            let found = distance(&spline, radius, tolerance);
            assert!(found <= allowed, "{radius} m, {control:?}: {found} m");
            let ratio = spline.path_time / arc.path_time;
            assert!((ratio - 1.0).abs() < 0.02, "{radius} m, {control:?}: {ratio} times the time of the arc");
        }
    }
}

#[test]
fn a_cubic_stays_on_its_bernstein_polynomial() {
    let control = [[0.0, 0.0], [0.08, 0.02], [-0.03, 0.06], [0.05, 0.08]];
    let mut program = Program::new(0.08, PathControl::ExactStop);
    program.nurbs(4, &control[1..].iter().map(|point| (*point, 1.0)).collect::<Vec<_>>());
    let outcome = plan(&program);
    outcome.audit.assert_kept();
    let curve = |t: f64| {
        let s = 1.0 - t;
        let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
        [0, 1].map(|k| weights.iter().zip(control).map(|(weight, point)| weight * point[k]).sum::<f64>())
    };
    // Chords of 10 000 parts differ from the curve by less than 1 nm.
    let points: Vec<[f64; 2]> = (0..=10_000).map(|i| curve(f64::from(i) / 10_000.0)).collect();
    let to_chord = |p: &[f64], pair: &[[f64; 2]]| {
        let step = [0, 1].map(|k| pair[1][k] - pair[0][k]);
        let from = [0, 1].map(|k| p[k] - pair[0][k]);
        let along =
            ((from[0] * step[0] + from[1] * step[1]) / step[0].hypot(step[1]).powi(2)).clamp(0.0, 1.0);
        (from[0] - along * step[0]).hypot(from[1] - along * step[1])
    };
    for setpoint in outcome.setpoints.iter().step_by(7) {
        let psec = setpoint.psec();
        let nearest = points.windows(2).map(|pair| to_chord(psec, pair)).fold(f64::INFINITY, f64::min);
        assert!(nearest <= DEVIATION + 1e-9, "{nearest} m at {psec:?}");
    }
    let last = outcome.setpoints.last().unwrap().psec();
    assert!((last[0] - 0.05).abs() < 1e-12 && (last[1] - 0.08).abs() < 1e-12, "{last:?}");
}

#[test]
fn order_two_is_a_sequence_of_lines() {
    let points = [[0.02, 0.0], [0.02, 0.03], [-0.01, 0.03]];
    for control in [PathControl::ExactStop, blend(2e-5)] {
        let mut spline = Program::new(0.1, control);
        spline.nurbs(2, &points.map(|point| (point, 1.0)));
        let mut lines = Program::new(0.1, control);
        points.iter().for_each(|point| _ = lines.line(point[0], point[1], 0.0));
        let [spline, lines] = [plan(&spline), plan(&lines)];
        assert_eq!(spline.setpoints.len(), lines.setpoints.len());
        for (a, b) in spline.setpoints.iter().zip(&lines.setpoints) {
            assert_eq!(a.psec(), b.psec());
        }
    }
}

#[test]
fn a_spline_that_needs_too_many_points_is_rejected() {
    let mut program = Program::new(0.1, PathControl::ExactStop);
    let far: Vec<_> = (1..9000).map(|i| ([1e3 * f64::from(i % 7), 1e3 * f64::from(i % 5)], 1.0)).collect();
    program.nurbs(4, &far);
    let Some(ProgramStep::Motion(motion)) = program.steps.last() else { panic!("no motion") };
    let error = plan_with(&program, PlanOptions::default(), |_| 1.0).err().expect("no error");
    assert!(matches!(error, FeedPlanError::SplineTooLong { line, .. } if line == motion.line), "{error}");
}
