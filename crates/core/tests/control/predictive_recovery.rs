//! Predictive control beyond its linear range: at rest against friction, and with the motor at its limits.

use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, RPM, seconds};
use virtual_axes_verification::fixtures::machines::*;

const MACHINES: [&str; 2] = ["mikron_ucp710", "linear_motor_center"];
const GPC: &str = "position_loop.controller=gpc";

/// 2 µm or 1 mdeg.
fn tolerance(axis: &AxisConfig) -> f64 {
    match axis.kind() {
        AxisKind::Linear => 2e-6,
        AxisKind::Rotary => 1e-3 * DEGREE,
    }
}

fn periods_in(config: &MachineConfig, time: f64) -> i64 {
    (time / seconds(config.periods().position)).round() as i64
}

/// A line of 100 mm or 90° at a third of the axis's speed.
fn line(axis: &AxisConfig) -> RestToRestProfile {
    let limits = axis.limits();
    let (length, velocity) = match axis.kind() {
        AxisKind::Linear => (0.1, 10.0 * METER_PER_MINUTE),
        AxisKind::Rotary => (90.0 * DEGREE, 5.0 * RPM),
    };
    // Where the velocity is reached before the acceleration is, less of that.
    let acceleration = limits.acceleration.min(0.9 * (velocity * limits.jerk).sqrt());
    RestToRestProfile::new(length, velocity, acceleration, limits.jerk)
}

#[test]
fn axes_come_to_rest_after_a_move_and_stay_there() {
    let frictions = ["deviation.friction=1", "deviation.friction=0.7", "deviation.friction=1.3"];
    for name in MACHINES {
        for friction in frictions {
            for compensation in ["feedforward.friction=0", "feedforward.friction=1"] {
                let config = configured(name, &[GPC, friction, compensation]);
                for place in 0..config.axes().len() {
                    comes_to_rest(name, &config, place, friction);
                }
            }
        }
    }
}

fn comes_to_rest(name: &str, config: &MachineConfig, place: usize, friction: &str) {
    let axis = &config.axes()[place];
    let (profile, period) = (line(axis), seconds(config.periods().position));
    let start = periods_in(config, 0.1);
    let end = start + (profile.duration() / period).ceil() as i64;
    let mut machine = at_rest(config);
    let psec = |k: i64| profile.at((k - start) as f64 * period);
    let mut range = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for k in 0..end + periods_in(config, 3.0) {
        advance_axis(&mut machine, place, k, psec, |m| {
            if k >= end + periods_in(config, 2.0) {
                let s = m.axis(place).sample();
                assert!(
                    s.following_error().abs() <= tolerance(axis),
                    "{name} {} {friction}: {} off",
                    axis.name(),
                    s.following_error()
                );
                range = [
                    range[0].min(s.position),
                    range[1].max(s.position),
                    range[2].min(s.current),
                    range[3].max(s.current),
                ];
            }
        });
    }
    // A nanometer (or its like in rad) and a milliampere: hunting has micrometers and amperes.
    assert!(range[1] - range[0] < 1e-9, "{name} {} {friction} moves: {range:?}", axis.name());
    assert!(range[3] - range[2] < 1e-3, "{name} {} {friction}: current {range:?}", axis.name());
}

/// Where the axis is, relative to the setpoint, over the last of six seconds; and whether it saturated.
fn after(
    config: &MachineConfig,
    place: usize,
    psec: impl Fn(i64) -> f64,
    load: impl Fn(i64) -> f64,
) -> (f64, bool) {
    let mut machine = at_rest(config);
    let (mut worst, mut saturated) = (0.0f64, false);
    let last = periods_in(config, 6.0);
    for k in 0..last {
        machine.set_load(place, load(k));
        advance_axis(&mut machine, place, k, &psec, |m| {
            let s = m.axis(place).sample();
            saturated |= s.saturated;
            if k > last - periods_in(config, 1.0) {
                worst = worst.max(s.delay_compensated_following_error().abs());
            }
        });
    }
    (worst, saturated)
}

const TUNINGS: [&[&str]; 3] = [
    &[GPC],
    &[GPC, "position_loop.gpc.n2=8", "position_loop.gpc.nu=6", "position_loop.gpc.lambda_rel=0.001"],
    &[GPC, "position_loop.gpc.n2=8", "position_loop.gpc.nu=6", "position_loop.gpc.lambda_rel=0.01"],
];

#[test]
fn a_step_of_100_mm_is_recovered_from() {
    for name in MACHINES {
        for tuning in TUNINGS {
            let config = configured(name, tuning);
            for (place, axis) in config.axes().iter().enumerate() {
                let step = if axis.kind() == AxisKind::Linear { 0.1 } else { 1.0 };
                let (error, saturated) = after(&config, place, |k| if k < 20 { 0.0 } else { step }, |_| 0.0);
                assert!(saturated, "{name} {}: the step is too small", axis.name());
                assert!(error <= tolerance(axis), "{name} {} {tuning:?}: {error}", axis.name());
            }
        }
    }
}

#[test]
fn a_step_and_a_load_in_motion_are_recovered_from() {
    for name in MACHINES {
        for tuning in TUNINGS {
            let config = configured(name, tuning);
            for (place, axis) in config.axes().iter().enumerate() {
                let period = seconds(config.periods().position);
                let (amplitude, step) = match axis.kind() {
                    AxisKind::Linear => (0.02, 0.1),
                    AxisKind::Rotary => (0.2, 1.0),
                };
                // A setpoint that never stands still: what holds an axis at rest is no help.
                let sine = |k: i64| amplitude * (1.0 - (3.0 * k as f64 * period).cos());
                let undisturbed = after(&config, place, sine, |_| 0.0);
                assert!(!undisturbed.1, "{name} {}: the sine alone saturates", axis.name());
                let jump = periods_in(&config, 0.5);
                let stepped = after(&config, place, |k| sine(k) + if k < jump { 0.0 } else { step }, |_| 0.0);
                let load = if axis.kind() == AxisKind::Linear { 60e3 } else { 10e3 };
                let pulse = jump..jump + periods_in(&config, 0.02);
                let loaded = after(&config, place, sine, |k| if pulse.contains(&k) { load } else { 0.0 });
                for (what, (error, saturated)) in [("step", stepped), ("load", loaded)] {
                    assert!(saturated, "{name} {} {what}: it saturates nothing", axis.name());
                    // Back to the errors that friction leaves anyway.
                    assert!(
                        error <= 1.5 * undisturbed.0,
                        "{name} {} {what} {tuning:?}: {error}, undisturbed {}",
                        axis.name(),
                        undisturbed.0
                    );
                }
            }
        }
    }
}
