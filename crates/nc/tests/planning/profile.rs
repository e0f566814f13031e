//! Cycle time and feed: closed forms, micro-segments.

use std::f64::consts::TAU;

use proptest::prelude::*;
use virtual_axes_nc::motion::PathControl;

use crate::limits::{machine, plan};
use crate::programs::{Program, blend, raster};

/// Returns the shortest time from standstill to standstill over `length` with limits of speed, acceleration and jerk.
fn closed_form(length: f64, v: f64, a: f64, j: f64) -> f64 {
    // Ramp to the speed w: time t(w), length w t(w).
    let ramp = |w: f64| if w * j >= a * a { w / a + a / j } else { 2.0 * (w / j).sqrt() };
    if v * ramp(v) <= length {
        return length / v + ramp(v);
    }
    // The peak speed of the two ramps without constant speed.
    let by_jerk = (length * length * j / 4.0).cbrt();
    if by_jerk * j < a * a {
        return 2.0 * ramp(by_jerk);
    }
    let w = a / 2.0 * ((a * a / (j * j) + 4.0 * length / a).sqrt() - a / j);
    2.0 * ramp(w)
}

proptest! {
    #[test]
    fn a_straight_line_takes_the_closed_form(
        exponent in -5.0..-0.6f64, direction in -3.2..3.2f64, tilt in -1.0..1.0f64, feed in -3.0..0.0f64,
    ) {
        let length = 10f64.powf(exponent);
        let (s, c) = direction.sin_cos();
        let step = [c, s, tilt];
        let norm = step.iter().map(|x| x * x).sum::<f64>().sqrt();
        let unit = step.map(|x| x / norm);
        let mut program = Program::new(10f64.powf(feed), PathControl::ExactStop);
        program.line(length * unit[0], length * unit[1], length * unit[2]);
        let machine = machine();
        let least = |of: fn(&virtual_axes_core::config::LimitsConfig) -> f64| {
            let axes = machine.axes().iter().zip(unit);
            axes.map(|(axis, slope)| of(axis.limits()) / slope.abs()).fold(f64::INFINITY, f64::min)
        };
        let v = least(|l| l.velocity).min(program.feed);
        let expected = closed_form(length, v, least(|l| l.acceleration), least(|l| l.jerk));
        let outcome = plan(&program);
        outcome.audit.assert_kept();
        prop_assert!((outcome.path_time - expected).abs() <= 1e-9, "{} {expected}", outcome.path_time);
    }
}

/// Returns the time along lines of the given lengths and feeds in one direction with the shortest ramps between constant
/// feeds.
fn closed_form_of_feeds(parts: &[(f64, f64)], a: f64, j: f64) -> f64 {
    let feeds: Vec<f64> = [0.0].into_iter().chain(parts.iter().map(|part| part.1)).chain([0.0]).collect();
    let change = |pair: &[f64]| {
        let w = (pair[1] - pair[0]).abs();
        if w * j >= a * a { w / a + a / j } else { 2.0 * (w / j).sqrt() }
    };
    let mut time: f64 = parts.iter().map(|(length, feed)| length / feed).sum();
    // A ramp is on the side of the larger feed.
    for pair in feeds.windows(2) {
        let ramp = change(pair);
        time += ramp - 0.5 * (pair[0] + pair[1]) * ramp / pair[0].max(pair[1]);
    }
    time
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// A change of the feed costs no more than its ramp, on the side of the larger feed.
    #[test]
    fn feeds_change_at_their_places(
        feeds in prop::collection::vec(-2.8..-0.7f64, 2..5), tolerance in -6.0..-3.0f64, short in 0..3_usize,
    ) {
        let parts: Vec<(f64, f64)> = feeds.iter().map(|feed| 10f64.powf(*feed)).map(|feed| (0.08, feed)).collect();
        let x = *machine().axes()[0].limits();
        for control in [PathControl::ExactPath, blend(10f64.powf(tolerance))] {
            let mut program = Program::new(0.1, control);
            let mut at = 0.0;
            for (length, feed) in &parts {
                program.feed = *feed;
                // Short lines in a row are one line.
                let lines = [1, 7, 40][short];
                for i in 1..=lines {
                    program.line(at + length * f64::from(i) / f64::from(lines), 0.0, 0.0);
                }
                at += length;
            }
            let outcome = plan(&program);
            outcome.audit.assert_kept();
            let expected = closed_form_of_feeds(&parts, x.acceleration, x.jerk);
            let excess = outcome.path_time - expected;
            // A later ramp that passes below the lower feed after the change saves a little time.
            prop_assert!(excess.abs() < 0.01 * expected, "{} {expected}", outcome.path_time);
            // No setpoint is faster than the feed of its place.
            for pair in outcome.setpoints.windows(2) {
                let [from, to] = [0, 1].map(|i| pair[i].psec()[0]);
                let place = |x: f64| ((x / 0.08) as usize).min(parts.len() - 1);
                let allowed = parts[place(from)].1.max(parts[place(to)].1);
                prop_assert!((to - from) <= 0.006 * allowed * (1.0 + 1e-6) + 1e-12, "{from} {to} {allowed}");
            }
        }
    }
}

#[test]
fn exact_stops_add_up() {
    let mut program = Program::new(0.1, PathControl::ExactStop);
    program.line(0.05, 0.0, 0.0).dwell(0.25).line(0.05, 0.05, 0.0).line(0.02, 0.05, 0.0);
    let machine = machine();
    let [x, y] = [0, 1].map(|i| *machine.axes()[i].limits());
    let expected = closed_form(0.05, 0.1, x.acceleration, x.jerk)
        + closed_form(0.05, 0.1, y.acceleration, y.jerk)
        + closed_form(0.03, 0.1, x.acceleration, x.jerk)
        + 0.25;
    let outcome = plan(&program);
    outcome.audit.assert_kept();
    assert!((outcome.path_time - expected).abs() < 1e-9, "{} {expected}", outcome.path_time);
}

/// Returns the mean feed between the ramps at both ends, m/s.
fn mean_feed(program: &Program) -> f64 {
    let outcome = plan(program);
    outcome.audit.assert_kept();
    let ramp = 30;
    let inner = &outcome.setpoints[ramp..outcome.setpoints.len() - ramp];
    let covered = inner[inner.len() - 1].place.path_position - inner[0].place.path_position;
    covered / ((inner.len() - 1) as f64 * 0.006)
}

#[test]
fn micro_segments_run_at_the_programmed_feed() {
    // 20 µm segments around a helix, which the limits allow at the programmed feed.
    for rounding in [0.0, 1e-6] {
        let mut program = Program::new(0.05, blend(10e-6));
        let (radius, pitch) = (10e-3, 1e-3);
        program.at[0] = radius;
        let round = |x: f64| if rounding > 0.0 { (x / rounding).round() * rounding } else { x };
        let count = (4.0 * TAU * radius / 20e-6) as usize;
        for i in 1..=count {
            let turn = 4.0 * TAU * i as f64 / count as f64;
            program.line(round(radius * turn.cos()), round(radius * turn.sin()), round(pitch * turn / TAU));
        }
        let mean = mean_feed(&program);
        println!("rounding {rounding}: {count} segments, {mean} m/s of 0.05 m/s");
        assert!(mean >= 0.9 * 0.05, "rounding {rounding}: {mean}");
    }
}

#[test]
fn a_raster_runs_near_the_feed_that_the_limits_allow() {
    for rounding in [0.0, 1e-7, 1e-6] {
        let program = raster(4, 0.04, 20e-6, rounding, 0.05, 10e-6);
        let mean = mean_feed(&program);
        println!("rounding {rounding}: {} segments, {mean} m/s of 0.05 m/s", program.steps.len());
        // With three turns within 0.16 m.
        assert!(mean >= 0.9 * 0.05, "rounding {rounding}: {mean}");
    }
}
