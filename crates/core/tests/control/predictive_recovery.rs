//! Fallback controller of predictive control: standstill with friction, and recovery from saturation (anti-windup).

use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, RPM, seconds};
use virtual_axes_verification::fixtures::machines::*;

const MACHINES: [&str; 2] = ["mikron_ucp710", "linear_motor_center"];
const GPC: &str = "position_loop.controller=gpc";

/// Returns the position tolerance: 2 µm or 1 mdeg.
fn tolerance(axis: &AxisConfig) -> f64 {
    match axis.kind() {
        AxisKind::Linear => 2e-6,
        AxisKind::Rotary => 1e-3 * DEGREE,
    }
}

fn periods_in(config: &MachineConfig, time: f64) -> i64 {
    (time / seconds(config.periods().position)).round() as i64
}

/// Returns a move of 100 mm or 90° at a third of the speed limit.
fn line(axis: &AxisConfig) -> RestToRestProfile {
    let limits = axis.limits();
    let (length, velocity) = match axis.kind() {
        AxisKind::Linear => (0.1, 10.0 * METER_PER_MINUTE),
        AxisKind::Rotary => (90.0 * DEGREE, 5.0 * RPM),
    };
    // Lower acceleration if the velocity is reached before it.
    let acceleration = limits.acceleration.min(0.9 * (velocity * limits.jerk).sqrt());
    RestToRestProfile::new(length, velocity, acceleration, limits.jerk)
}

#[test]
fn axes_come_to_rest_after_a_move_without_limit_cycle() {
    let frictions = ["deviation.friction=1", "deviation.friction=0.7", "deviation.friction=1.3"];
    for name in MACHINES {
        for friction in frictions {
            for compensation in ["feedforward.friction=0", "feedforward.friction=1"] {
                let config = configured(name, &[GPC, friction, compensation]);
                for index in 0..config.axes().len() {
                    comes_to_rest(name, &config, index, friction);
                }
            }
        }
    }
}

fn comes_to_rest(name: &str, config: &MachineConfig, index: usize, friction: &str) {
    let axis = &config.axes()[index];
    let (profile, period) = (line(axis), seconds(config.periods().position));
    let start = periods_in(config, 0.1);
    let end = start + (profile.duration() / period).ceil() as i64;
    let mut machine = at_rest(config);
    let psec = |k: i64| profile.at((k - start) as f64 * period);
    let mut range = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for k in 0..end + periods_in(config, 3.0) {
        advance_axis(&mut machine, index, k, psec, |m| {
            if k >= end + periods_in(config, 2.0) {
                let s = m.axis(index).sample();
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
    // 1 nm (or 1 nrad) and 1 mA: a limit cycle has micrometers and amperes.
    assert!(range[1] - range[0] < 1e-9, "{name} {} {friction} moves: {range:?}", axis.name());
    assert!(range[3] - range[2] < 1e-3, "{name} {} {friction}: current {range:?}", axis.name());
}

/// Simulates six seconds; returns the largest delay-compensated following error of the last one, and true if the axis
/// saturated.
fn final_error(
    config: &MachineConfig,
    index: usize,
    psec: impl Fn(i64) -> f64,
    load: impl Fn(i64) -> f64,
) -> (f64, bool) {
    let mut machine = at_rest(config);
    let (mut worst, mut saturated) = (0.0f64, false);
    let last = periods_in(config, 6.0);
    for k in 0..last {
        machine.set_load(index, load(k));
        advance_axis(&mut machine, index, k, &psec, |m| {
            let s = m.axis(index).sample();
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
fn gpc_recovers_from_a_step_of_100_mm() {
    for name in MACHINES {
        for tuning in TUNINGS {
            let config = configured(name, tuning);
            for (index, axis) in config.axes().iter().enumerate() {
                let step = if axis.kind() == AxisKind::Linear { 0.1 } else { 1.0 };
                let (error, saturated) =
                    final_error(&config, index, |k| if k < 20 { 0.0 } else { step }, |_| 0.0);
                assert!(saturated, "{name} {}: the step is too small", axis.name());
                assert!(error <= tolerance(axis), "{name} {} {tuning:?}: {error}", axis.name());
            }
        }
    }
}

#[test]
fn gpc_recovers_from_a_step_and_a_load_in_motion() {
    for name in MACHINES {
        for tuning in TUNINGS {
            let config = configured(name, tuning);
            for (index, axis) in config.axes().iter().enumerate() {
                let period = seconds(config.periods().position);
                let (amplitude, step) = match axis.kind() {
                    AxisKind::Linear => (0.02, 0.1),
                    AxisKind::Rotary => (0.2, 1.0),
                };
                // A setpoint that never stops, so that the standstill fallback stays inactive.
                let sine = |k: i64| amplitude * (1.0 - (3.0 * k as f64 * period).cos());
                let undisturbed = final_error(&config, index, sine, |_| 0.0);
                assert!(!undisturbed.1, "{name} {}: the sine alone saturates", axis.name());
                let jump = periods_in(&config, 0.5);
                let stepped =
                    final_error(&config, index, |k| sine(k) + if k < jump { 0.0 } else { step }, |_| 0.0);
                let load = if axis.kind() == AxisKind::Linear { 60e3 } else { 10e3 };
                let pulse = jump..jump + periods_in(&config, 0.02);
                let loaded =
                    final_error(&config, index, sine, |k| if pulse.contains(&k) { load } else { 0.0 });
                for (disturbance, (error, saturated)) in [("step", stepped), ("load", loaded)] {
                    assert!(saturated, "{name} {} {disturbance}: no saturation", axis.name());
                    // Back to the errors caused by friction.
                    assert!(
                        error <= 1.5 * undisturbed.0,
                        "{name} {} {disturbance} {tuning:?}: {error}, undisturbed {}",
                        axis.name(),
                        undisturbed.0
                    );
                }
            }
        }
    }
}
