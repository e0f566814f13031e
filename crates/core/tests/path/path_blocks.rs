//! Lines, arcs and splines compared with closed forms, an independent B-spline and difference quotients.

use std::f64::consts::{PI, TAU};

use crate::path_common::*;
use proptest::prelude::*;
use virtual_axes_core::config::AxisKind;
use virtual_axes_core::path::{Block, Frame, Path, PathError};

const HOME: [f64; 5] = [0.0; 5];

fn point(block: &Block, s: f64) -> [f64; 5] {
    let mut out = [0.0; 5];
    block.point(s, &mut out);
    out
}

fn spline(from: [f64; 5], points: &[[f64; 5]]) -> Result<Block, PathError> {
    let points: Vec<Vec<f64>> = points.iter().map(|point| point.to_vec()).collect();
    Block::spline(&from, &points, &KINDS)
}

/// Returns the B-spline basis by the Cox–de Boor recursion.
fn basis(knots: &[f64], i: usize, degree: usize, t: f64) -> f64 {
    if degree == 0 {
        let last = knots[knots.len() - 1];
        let inside = knots[i] <= t && t < knots[i + 1];
        let at_end = t == last && knots[i] < last && knots[i + 1] == last;
        return f64::from(u8::from(inside || at_end));
    }
    let part = |a: f64, b: f64| if b > a { 1.0 / (b - a) } else { 0.0 };
    (t - knots[i]) * part(knots[i], knots[i + degree]) * basis(knots, i, degree - 1, t)
        + (knots[i + degree + 1] - t)
            * part(knots[i + 1], knots[i + degree + 1])
            * basis(knots, i + 1, degree - 1, t)
}

/// Evaluates the clamped uniform cubic B-spline of `points` at t from 0 to the number of its pieces.
fn de_boor(points: &[[f64; 5]], t: f64) -> [f64; 5] {
    let pieces = points.len() - 3;
    let mut knots = vec![0.0; 3];
    knots.extend((0..=pieces).map(|i| i as f64));
    knots.extend([pieces as f64; 3]);
    let mut out = [0.0; 5];
    for (i, point) in points.iter().enumerate() {
        let weight = basis(&knots, i, 3, t);
        for (out, value) in out.iter_mut().zip(point) {
            *out += weight * value;
        }
    }
    out
}

/// Returns the length by chords, with Richardson extrapolation of n, 2n and 4n chords of each piece.
fn chord_length(points: &[[f64; 5]], indices: std::ops::Range<usize>) -> f64 {
    let pieces = points.len() - 3;
    let polygon = |n: usize| {
        let at = |i: usize| de_boor(points, i as f64 / n as f64);
        let mut sum = 0.0;
        for i in 0..n * pieces {
            let (a, b) = (at(i), at(i + 1));
            sum += indices.clone().map(|j| (b[j] - a[j]).powi(2)).sum::<f64>().sqrt();
        }
        sum
    };
    let [a, b, c] = [128, 256, 512].map(polygon);
    let (ab, bc) = (b + (b - a) / 3.0, c + (c - b) / 3.0);
    bc + (bc - ab) / 15.0
}

fn control_points() -> impl Strategy<Value = Vec<[f64; 5]>> {
    let point = prop::array::uniform5(-0.05..0.05f64);
    prop::collection::vec(point, 4..9).prop_map(|mut points| {
        // The points advance along x, so that no spline has a cusp.
        for (i, point) in points.iter_mut().enumerate() {
            point[0] += 0.15 * i as f64;
        }
        points
    })
}

/// Compares the derivatives at `s` with central differences, each of the order below.
fn assert_derivatives(block: &Block, s: f64, h: f64, tolerance: f64) {
    let (before, here, after) = (block.derivatives(s - h), block.derivatives(s), block.derivatives(s + h));
    let (a, b) = (point(block, s - h), point(block, s + h));
    for i in 0..5 {
        let found = [here.first[i], here.second[i], here.third[i]];
        let wanted = [
            (b[i] - a[i]) / (2.0 * h),
            (after.first[i] - before.first[i]) / (2.0 * h),
            (after.second[i] - before.second[i]) / (2.0 * h),
        ];
        for (order, (found, wanted)) in found.iter().zip(wanted).enumerate() {
            let scale = 30.0_f64.powi(order as i32 + 1);
            assert!((found - wanted).abs() < tolerance * scale, "{i}, order {}: {found} {wanted}", order + 1);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_parameter_is_the_arc_length(points in control_points(), a in 0.0..1.0f64, b in 0.0..1.0f64) {
        let block = spline(points[0], &points[1..]).expect("a spline");
        let wanted = chord_length(&points, 0..3);
        prop_assert!((block.length() / wanted - 1.0).abs() < 1e-10, "{} {wanted}", block.length());
        // Chords of 2000 parts between two arc lengths.
        let (low, high) = (a.min(b) * block.length(), a.max(b) * block.length());
        let polygon = |n: i32| {
            let at = |i: i32| point(&block, low + (high - low) * f64::from(i) / f64::from(n));
            (0..n).map(|i| {
                let (a, b) = (at(i), at(i + 1));
                (0..3).map(|j| (b[j] - a[j]).powi(2)).sum::<f64>().sqrt()
            }).sum::<f64>()
        };
        let (coarse, fine) = (polygon(1000), polygon(2000));
        let length = fine + (fine - coarse) / 3.0;
        prop_assert!((length - (high - low)).abs() < 1e-10 * block.length() + 1e-13);
        // Unit speed, and a second derivative normal to the direction.
        let d = block.derivatives(low);
        let dot = |a: &[f64], b: &[f64]| a[..3].iter().zip(&b[..3]).map(|(a, b)| a * b).sum::<f64>();
        prop_assert!((dot(&d.first, &d.first) - 1.0).abs() < 1e-12);
        prop_assert!(dot(&d.first, &d.second).abs() < 1e-9);
    }

    #[test]
    fn a_spline_matches_an_independent_evaluation_of_its_control_points(points in control_points()) {
        let block = spline(points[0], &points[1..]).expect("a spline");
        let pieces = points.len() - 3;
        // Each point of the independent spline lies on the block at the length of its chords.
        let n = 400;
        let mut s = 0.0;
        let mut before = points[0];
        for i in 1..=n * pieces {
            let wanted = de_boor(&points, i as f64 / n as f64);
            s += (0..3).map(|j| (wanted[j] - before[j]).powi(2)).sum::<f64>().sqrt();
            before = wanted;
            let found = point(&block, s);
            // Chords of 1/400 of a piece are shorter by less than 1e-5 of the length.
            let error = (0..5).map(|j| (found[j] - wanted[j]).abs()).fold(0.0, f64::max);
            prop_assert!(error < 2e-5, "{error}");
        }
        let last = points.len() - 1;
        prop_assert_eq!(block.start(), &points[0]);
        prop_assert_eq!(point(&block, 0.0), points[0]);
        prop_assert_eq!(point(&block, block.length()), points[last]);
        // The spline starts towards the second control point and ends coming from the last but one.
        for (s, from, to) in [(0.0, 0, 1), (block.length(), last - 1, last)] {
            let chord: Vec<f64> = (0..5).map(|j| points[to][j] - points[from][j]).collect();
            let length = (0..3).map(|j| chord[j].powi(2)).sum::<f64>().sqrt();
            let first = block.derivatives(s).first;
            for j in 0..5 {
                prop_assert!((first[j] - chord[j] / length).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn derivatives_match_differences_of_the_points(points in control_points(), part in 0.01..0.99f64) {
        let block = spline(points[0], &points[1..]).expect("a spline");
        // Third derivatives jump at knots; differences across a knot are skipped by their size.
        let s = part * block.length();
        let h = 1e-6;
        let (a, b) = (block.derivatives(s - h), block.derivatives(s + h));
        let jumps = a.third.iter().zip(&b.third).any(|(a, b)| (a - b).abs() > 1.0);
        if !jumps {
            assert_derivatives(&block, s, h, 1e-4);
        }
    }

    #[test]
    fn second_derivatives_are_continuous(points in control_points(), part in 0.0..1.0f64) {
        let block = spline(points[0], &points[1..]).expect("a spline");
        let h = 1e-9;
        let s = part * (block.length() - h);
        let (a, b) = (block.derivatives(s), block.derivatives(s + h));
        for j in 0..5 {
            // Third derivatives of these are below 10⁵.
            prop_assert!((a.first[j] - b.first[j]).abs() < 1e-6);
            prop_assert!((a.second[j] - b.second[j]).abs() < 1e-3);
        }
    }
}

#[test]
fn second_derivative_is_continuous_at_knots() {
    let points = [
        HOME,
        [0.1, 0.05, 0.0, 0.1, 0.0],
        [0.2, -0.05, 0.02, 0.2, 0.3],
        [0.3, 0.05, 0.0, 0.1, 0.2],
        [0.4, 0.0, 0.01, 0.0, 0.0],
        [0.5, 0.03, 0.0, 0.0, 0.1],
    ];
    let block = spline(HOME, &points[1..]).expect("a spline");
    let h = block.length() * 1e-5;
    for i in 1..99_998 {
        let s = f64::from(i) * h;
        let (a, b) = (block.derivatives(s), block.derivatives(s + h));
        for j in 0..5 {
            let slope = a.third[j].abs().max(b.third[j].abs());
            assert!((a.second[j] - b.second[j]).abs() <= 1.1 * slope * h + 1e-9);
        }
    }
}

#[test]
fn length_of_a_line_is_that_of_its_linear_coordinates() {
    let to = [0.03, 0.0, 0.04, 0.5, -1.0];
    let block = line(HOME, to);
    assert_eq!(block.length(), 0.05);
    assert_eq!(block.kind(), AxisKind::Linear);
    let middle = point(&block, 0.025);
    for j in 0..5 {
        assert!((middle[j] - to[j] / 2.0).abs() < 1e-16);
    }
    assert_eq!(point(&block, 0.05), to);
    assert_eq!(point(&block, 1.0), to);
    assert_eq!(point(&block, -1.0), HOME);
    let turn = line(HOME, [0.0, 0.0, 0.0, 0.3, 0.4]);
    assert_eq!((turn.length(), turn.kind()), (0.5, AxisKind::Rotary));
}

#[test]
fn an_arc_is_a_circle_with_linear_other_coordinates() {
    let (r, sweep, rise) = (0.05, -3.0 * PI, 0.02);
    let block = arc([0.01, 0.02, 0.0, 0.0, 0.0], [0.01, 0.02 - r], sweep, [9.0, 9.0, rise, 0.6, 0.0]);
    let length = (r * sweep).hypot(rise);
    assert!((block.length() / length - 1.0).abs() < 1e-15);
    for i in 0..=100 {
        let part = f64::from(i) / 100.0;
        let found = point(&block, part * length);
        let angle = PI / 2.0 + part * sweep;
        let wanted = [0.01 + r * angle.cos(), 0.02 - r + r * angle.sin(), part * rise, 0.6 * part, 0.0];
        for j in 0..5 {
            assert!((found[j] - wanted[j]).abs() < 1e-15, "{found:?} {wanted:?}");
        }
    }
    assert_derivatives(&block, 0.3 * length, 1e-6, 1e-6);
    let circle = block.circle().expect("it is one");
    assert_eq!((circle.radius, circle.plane, circle.sweep), (r, [0, 1], sweep));
}

#[test]
fn whole_turns_return_to_the_start_bit_identically() {
    let from = [0.1, 0.2, 0.3, 0.0, 0.0];
    for turns in [1.0, -1.0, 2.0, 7.0] {
        assert_eq!(arc(from, [0.037, 0.411], turns * TAU, from).end(), from);
    }
}

#[test]
fn invalid_blocks_are_rejected_with_their_values() {
    let kinds = &KINDS;
    let nan = [0.0, f64::NAN, 0.0, 0.0, 0.0];
    assert_eq!(Block::line(&HOME, &HOME, kinds), Err(PathError::ZeroLength));
    assert!(matches!(Block::line(&HOME, &nan, kinds), Err(PathError::NotFinite { coordinate: 2, .. })));
    assert!(matches!(
        Block::line(&HOME, &[1.0], kinds),
        Err(PathError::WrongSize { found: 1, wanted: 5, .. })
    ));
    let far = [1e308, -1e308, 1e308, 0.0, 0.0];
    assert!(matches!(Block::line(&HOME.map(|_| -1e308), &far, kinds), Err(PathError::NotComputable { .. })));
    let arc = |plane, center, sweep| Block::arc(&HOME, plane, center, sweep, &HOME, kinds).unwrap_err();
    assert!(matches!(arc([0, 0], [1.0, 0.0], 1.0), PathError::InvalidPlane { first: 1, second: 1, .. }));
    assert!(matches!(arc([0, 3], [1.0, 0.0], 1.0), PathError::InvalidPlane { second: 4, .. }));
    assert!(matches!(arc([0, 9], [1.0, 0.0], 1.0), PathError::InvalidPlane { second: 10, .. }));
    assert!(matches!(arc([0, 1], [0.0, 0.0], 1.0), PathError::ZeroRadius { .. }));
    assert!(matches!(arc([0, 1], [1.0, 0.0], 0.0), PathError::InvalidSweep { .. }));
    assert!(matches!(arc([0, 1], [1.0, 0.0], f64::INFINITY), PathError::InvalidSweep { .. }));
    assert!(matches!(arc([0, 1], [f64::NAN, 0.0], 1.0), PathError::NotFinite { .. }));
    let x = |x: f64| [x, 0.0, 0.0, 0.0, 0.0];
    assert!(matches!(spline(HOME, &[x(1.0), x(2.0)]), Err(PathError::TooFewPoints { found: 2, needed: 3 })));
    assert!(matches!(spline(HOME, &[HOME, x(2.0), x(3.0)]), Err(PathError::Cusp { piece: 1, pieces: 1 })));
    assert!(matches!(spline(HOME, &[x(1.0), x(2.0), x(2.0)]), Err(PathError::Cusp { .. })));
    assert!(matches!(spline(HOME, &[x(1.0), x(1.0), x(0.5)]), Err(PathError::Cusp { .. })), "turns back");
    assert_eq!(spline(HOME, &[HOME; 4]), Err(PathError::ZeroLength));
    for message in [
        arc([0, 3], [1.0, 0.0], 1.0).to_string(),
        spline(HOME, &[x(1.0), x(1.0), x(0.5)]).unwrap_err().to_string(),
    ] {
        println!("{message}");
    }
}

#[test]
fn a_path_has_no_gaps() {
    let a = [0.1, 0.0, 0.0, 0.0, 0.0];
    let b = [0.1, 1e-6, 0.0, 0.0, 0.0];
    let path = |blocks| Path::new(kinematics(&[]), Frame::Joints, blocks);
    let gap = path(vec![line(HOME, a), line(b, HOME)]).unwrap_err();
    assert_eq!(gap, PathError::Gap { block: 2, coordinate: 2, end: 0.0, start: 1e-6 });
    println!("{gap}");
    assert_eq!(path(vec![]), Err(PathError::Empty));
    let closed = path(vec![line(HOME, a), line(a, HOME)]).expect("continuous");
    assert_eq!(closed.length(), 0.2);
    assert_eq!(closed.locate(0.1), (1, 0.0));
    assert_eq!(closed.locate(1.0), (1, 0.1));
    assert_eq!(closed.locate(-1.0), (0, 0.0));
}

#[test]
fn extreme_sizes_are_accepted_or_rejected() {
    for size in [1e-300, 1e-12, 1e12, 1e150, 1e300] {
        let to = [size, size, 0.0, 0.0, 0.0];
        let block = line(HOME, to);
        assert_eq!(point(&block, block.length()), to);
        let points: Vec<Vec<f64>> = (1..6).map(|i| vec![size * f64::from(i), size, 0.0, 0.0, 0.0]).collect();
        if let Ok(block) = Block::spline(&HOME, &points, &KINDS) {
            assert!(block.length().is_finite() && block.length() > 0.0);
        }
        let _ = Block::arc(&HOME, [0, 1], [size, 0.0], 1.0, &HOME, &KINDS);
        let _ = Block::arc(&HOME, [0, 1], [1.0, 0.0], size, &HOME, &KINDS);
    }
}
