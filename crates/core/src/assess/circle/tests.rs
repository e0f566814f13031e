//! Circularity compared with closed forms and with a fit to all points.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix3, Vector3};

use super::*;

const CENTER: [f64; 2] = [-0.15, 0.02];
const R: f64 = 0.15;
/// Width of a bin, rad: a tenth of a degree, as documented.
const WIDTH: f64 = TAU / 3600.0;
/// Rounding of distances of 0.15 m, m.
const ROUNDING: f64 = 1e-15;

/// Points of `turns` turns with a radius about a displaced center, by the angle about that center.
fn points(turns: f64, offset: [f64; 2], radius: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    const PER_TURN: f64 = 20_000.0;
    let count = (turns.abs() * PER_TURN).ceil() as u32;
    let point = |k: u32| {
        let angle = turns.signum() * TAU * f64::from(k) / PER_TURN;
        let (sin, cos) = angle.sin_cos();
        let r = radius(angle);
        [CENTER[0] + offset[0] + r * cos, CENTER[1] + offset[1] + r * sin]
    };
    (0..count).map(point).collect()
}

fn assessor(points: &[[f64; 2]]) -> CircleAssessor {
    let mut assessor = CircleAssessor::new(CENTER, R);
    for [x, y] in points {
        assessor.push(*x, *y);
    }
    assessor
}

fn report(points: &[[f64; 2]]) -> (CircleReport, FullCircle) {
    let report = assessor(points).report().expect("points");
    (report, report.full.expect("a full circle"))
}

#[track_caller]
fn assert_near(what: &str, value: f64, wanted: f64, tolerance: f64) {
    assert!((value - wanted).abs() <= tolerance, "{what}: {value:e}, wanted {wanted:e} ± {tolerance:e}");
}

/// The circle that minimizes the sum of (d − ρ)², by Gauss and Newton, and the range of d about it.
fn geometric_fit(points: &[[f64; 2]]) -> (f64, f64) {
    let mut circle = Vector3::new(CENTER[0], CENTER[1], R);
    for _ in 0..20 {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for [x, y] in points {
            let (dx, dy) = (x - circle.x, y - circle.y);
            let d = dx.hypot(dy);
            let row = Vector3::new(dx / d, dy / d, 1.0);
            normal += row * row.transpose();
            right += row * (d - circle.z);
        }
        circle += normal.lu().solve(&right).expect("a full circle");
    }
    let distances = points.iter().map(|[x, y]| (x - circle.x).hypot(y - circle.y));
    (circle.z - R, distances.fold(Range::EMPTY, Range::with).width())
}

#[test]
fn a_perfect_circle_has_no_deviation() {
    let (report, full) = report(&points(1.0, [0.0; 2], |_| R));
    for value in [report.mean, report.min, report.max, full.radius_deviation] {
        assert_near("deviation", value, 0.0, ROUNDING);
    }
    assert_near("G", full.circular_deviation, 0.0, ROUNDING);
}

#[test]
fn a_wrong_radius_is_radial_and_not_circular_deviation() {
    for d in [50e-6, -283e-6] {
        let (report, full) = report(&points(-1.0, [0.0; 2], |_| R + d));
        for value in [report.mean, report.min, report.max, full.radius_deviation] {
            assert_near("deviation", value, d, ROUNDING);
        }
        assert_near("G", full.circular_deviation, 0.0, ROUNDING);
    }
}

/// r = √(R² + 2 R e cos θ + e²): from −e to e, on average e²/(4 R) + e⁴/(64 R³) + ….
#[test]
fn a_displaced_circle_has_radial_deviation_of_its_offset_and_no_circular_deviation() {
    for e in [1e-6, 1e-3] {
        let offset = [0.6 * e, -0.8 * e];
        let (report, full) = report(&points(1.0, offset, |_| R));
        assert_near("mean", report.mean, e.powi(2) / (4.0 * R) + e.powi(4) / (64.0 * R.powi(3)), ROUNDING);
        // The nearest point is within half a step of the extreme, where the cosine is flat.
        assert_near("Fmin", report.min, -e, 1e-7 * e + ROUNDING);
        assert_near("Fmax", report.max, e, 1e-7 * e + ROUNDING);
        assert_near("G", full.circular_deviation, 0.0, ROUNDING);
        assert_near("x", full.center[0], offset[0], ROUNDING);
        assert_near("y", full.center[1], offset[1], ROUNDING);
        assert_near("radius", full.radius_deviation, 0.0, ROUNDING);
    }
}

#[test]
fn a_partly_repeated_turn_does_not_shift_the_center() {
    let (_, full) = report(&points(1.37, [3e-4, 4e-4], |_| R + 1e-4));
    assert_near("x", full.center[0], 3e-4, ROUNDING);
    assert_near("y", full.center[1], 4e-4, ROUNDING);
    assert_near("radius", full.radius_deviation, 1e-4, ROUNDING);
    assert_near("G", full.circular_deviation, 0.0, ROUNDING);
}

/// Points of an ellipse with half axes R + h and R − h, parametrized by its eccentric angle. It is rotated
/// so that its vertices lie in the middle of a bin: at the edge of a bin the bins cause no error.
fn ellipse(h: f64, offset: [f64; 2]) -> Vec<[f64; 2]> {
    let (sin_turn, cos_turn) = (50.5 * WIDTH).sin_cos();
    let point = |k: u32| {
        let (sin, cos) = (TAU * f64::from(k) / 20_000.0).sin_cos();
        let (x, y) = ((R + h) * cos, (R - h) * sin);
        [
            CENTER[0] + offset[0] + cos_turn * x - sin_turn * y,
            CENTER[1] + offset[1] + sin_turn * x + cos_turn * y,
        ]
    };
    (0..20_000).map(point).collect()
}

#[test]
fn an_ellipse_has_the_difference_of_its_half_axes_as_circular_deviation() {
    let h = 20e-6;
    let (report, full) = report(&ellipse(h, [0.0; 2]));
    assert_near("Fmin", report.min, -h, ROUNDING);
    assert_near("Fmax", report.max, h, ROUNDING);
    assert_near("G", full.circular_deviation, 2.0 * h, ROUNDING);
    // To second order r = √((R² + h²) + 2 R h cos 2θ) is R + h²/(2 R) − h²/(4 R) on average.
    assert_near("radius", full.radius_deviation, h * h / (4.0 * R), 1e-13);
}

#[test]
fn a_displaced_ellipse_has_the_same_circular_deviation_within_the_width_of_a_bin() {
    let (h, e) = (20e-6_f64, 50e-6_f64);
    for angle in [0.0, 0.5, 1.0, 2.0, 4.0_f64] {
        let offset = [e * angle.cos(), e * angle.sin()];
        let (_, full) = report(&ellipse(h, offset));
        let lost = 2.0 * h - full.circular_deviation;
        // For a smooth path the error of a bin is quadratic: a deviation h cos 2φ is 2 h w² lower one bin
        // aside.
        assert!((-ROUNDING..=2.0 * (2.0 * h * WIDTH.powi(2))).contains(&lost), "{lost:e}");
        assert_near("x", full.center[0], offset[0], 1e-12);
    }
}

/// Points with reversal spikes at the quadrants on a displaced circle of a wrong radius.
fn with_spikes(offset: [f64; 2]) -> Vec<[f64; 2]> {
    points(1.8, offset, |angle| {
        let after = angle.rem_euclid(TAU / 4.0);
        R + 49e-6 + 20e-6 * (after / 0.01) * (1.0 - after / 0.01).exp() + 3e-6 * (3.0 * angle).sin()
    })
}

#[test]
fn spikes_agree_with_a_fit_to_all_points() {
    for offset in [[0.0, 0.0], [10e-6, 0.0], [-20e-6, 30e-6]] {
        let points = with_spikes(offset);
        let (_, full) = report(&points);
        let (radius, range) = geometric_fit(&points);
        let e = full.center[0].hypot(full.center[1]);
        // Spikes of a few degrees separate both kinds of center by far less than f²/R.
        let form = 1e-10;
        assert_near("radius", full.radius_deviation, radius, 1e-11);
        let lost = range - full.circular_deviation;
        assert!((-form..=2.0 * e * WIDTH + form).contains(&lost), "{lost:e} at {e:e}");
    }
}

#[test]
fn both_directions_with_different_radii() {
    let (d1, d2) = (50e-6, 30e-6);
    // The number of points differs, which has no effect.
    let clockwise = assessor(&points(-2.0, [0.0; 2], |_| R + d1));
    let counterclockwise = assessor(&points(1.0, [0.0; 2], |_| R - d2));
    let both = bidirectional(&clockwise, &counterclockwise).expect("two circles");
    assert_near("G(b)", both.circular_deviation, d1 + d2, ROUNDING);
    // The mean is exact to the third order of the deviation: d³/R² is 5e-12 m.
    assert_near("D", both.mean_radial_deviation, (d1 - d2) / 2.0, 5e-12);
}

/// Circles displaced by e and −e: each is round, both lie between R − e and R + e.
#[test]
fn both_directions_with_displaced_centers() {
    let e = 40e-6;
    let clockwise = assessor(&points(-1.0, [e, 0.0], |_| R));
    let counterclockwise = assessor(&points(1.0, [-e, 0.0], |_| R));
    let both = bidirectional(&clockwise, &counterclockwise).expect("two circles");
    assert_near("G(b)", both.circular_deviation, 2.0 * e, ROUNDING);
    assert_near("D", both.mean_radial_deviation, e * e / (4.0 * R), 5e-12);
    for path in [clockwise, counterclockwise] {
        let full = path.report().and_then(|report| report.full).expect("a circle");
        assert_near("G", full.circular_deviation, 0.0, ROUNDING);
    }
}

#[test]
fn an_arc_has_only_radial_deviations() {
    let arc = assessor(&points(0.9, [0.0; 2], |_| R + 1e-5));
    let report = arc.report().expect("points");
    assert_near("mean", report.mean, 1e-5, ROUNDING);
    assert_eq!(report.full, None);
    let circle = assessor(&points(1.0, [0.0; 2], |_| R));
    assert_eq!(bidirectional(&arc, &circle), None);
    assert_eq!(bidirectional(&circle, &arc), None);
}

#[test]
fn different_circles_are_not_compared() {
    let circle = assessor(&points(1.0, [0.0; 2], |_| R));
    let mut other = CircleAssessor::new(CENTER, R + 1e-3);
    for [x, y] in points(-1.0, [0.0; 2], |_| R) {
        other.push(x, y);
    }
    assert_eq!(bidirectional(&circle, &other), None);
}

#[test]
fn a_circle_without_points_has_no_report() {
    assert_eq!(CircleAssessor::new(CENTER, R).report(), None);
}

#[test]
fn push_returns_the_radial_deviation() {
    let mut assessor = CircleAssessor::new([0.0; 2], 5.0);
    assert_eq!(assessor.push(3.0, 4.0), 0.0);
    assert_eq!(assessor.push(-6.0, -8.0), 5.0);
    assert_eq!(assessor.push(-4.0, 0.0), -1.0);
    let report = assessor.report().expect("points");
    assert_near("mean", report.mean, 4.0 / 3.0, ROUNDING);
    assert_eq!((report.min, report.max), (-1.0, 5.0));
}

#[test]
fn reversal_spikes_are_those_of_the_four_quadrants() {
    // Spikes of 12, −5, 7 and 3 µm, 8 degrees wide, behind the reversals, on a circle that is 20 µm too large.
    let heights = [12e-6, -5e-6, 7e-6, 3e-6];
    let spike = |angle: f64| {
        let quadrant = (angle / FRAC_PI_2).floor();
        let after = (angle - quadrant * FRAC_PI_2) / 8f64.to_radians();
        if after < 1.0 { heights[quadrant as usize % 4] * (PI * after).sin().powi(2) } else { 0.0 }
    };
    let found = report(&points(2.0, [0.0; 2], |angle| R + 20e-6 + spike(angle)));
    let mean = found.0.mean;
    for (spike, height) in found.1.reversal_spikes.into_iter().zip(heights) {
        assert_near("spike", spike, 20e-6 + height - mean, 1e-9);
    }
}

#[test]
fn a_series_of_points_has_the_report_of_single_points() {
    for (turns, steps, off) in [(2.0, 20_000, 3e-5), (-1.5, 500, 2e-3), (0.3, 7, 0.0)] {
        let (center, radius) = ([0.02, -0.01], 0.15);
        let mut single = CircleAssessor::new(center, radius);
        let mut series = single.clone();
        let at = |i: usize| {
            let angle = turns * TAU * i as f64 / steps as f64;
            let r = radius + off * (7.0 * angle).sin();
            [center[0] + r * angle.cos(), center[1] + r * angle.sin()]
        };
        let points: Vec<[f64; 2]> = (0..steps).map(at).collect();
        points.iter().for_each(|[x, y]| _ = single.push(*x, *y));
        // Series of whole vectors, of other lengths, and single points in between.
        let mut rest = &points[..];
        for length in [48, 13, 8, 1].into_iter().cycle() {
            let (part, after) = rest.split_at(length.min(rest.len()));
            match part {
                [] => break,
                [[x, y]] => _ = series.push(*x, *y),
                _ => {
                    let column = |i: usize| part.iter().map(|point| point[i]).collect::<Vec<_>>();
                    series.push_all(&column(0), &column(1));
                }
            }
            rest = after;
        }
        assert_eq!(series.report(), single.report(), "{turns} turns");
    }
}
