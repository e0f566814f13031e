//! Conditioning of recordings of simulated drives: all are accepted, and a current lag is estimated correctly
//! or not at all.

use virtual_axes_core::config::LimitsConfig;
use virtual_axes_identify::recording::{Conditioning, RawRecording, condition};
use virtual_axes_verification::fixtures::machines::{AXES, TSP, machine, parameters};

/// Tick of the default machine, s.
const TICK: f64 = 125e-6;
/// Speeds of the moves in both directions, relative to Vmax.
const SPEEDS: [f64; 5] = [0.02, 0.05, 0.1, 0.3, 0.7];
/// Acceleration relative to Amax.
const ACCELERATION: f64 = 0.6;
/// Position cycles of rest between two moves, and of averaging of the trapezoids to limit the jerk.
const REST: usize = 50;
const AVERAGED: usize = 9;

/// Returns the velocities of the setpoint, one per position cycle.
fn velocities(limits: &LimitsConfig) -> Vec<f64> {
    let mut trapezoids = vec![0.0; REST];
    for speed in SPEEDS {
        for v in [speed * limits.velocity, -speed * limits.velocity] {
            let ramp = (v.abs() / (ACCELERATION * limits.acceleration) / TSP).ceil() as usize;
            let hold = ((0.2 / v.abs()).clamp(0.2, 1.0) / TSP) as usize;
            let rising = (0..ramp).map(|n| v * n as f64 / ramp as f64);
            trapezoids.extend(rising.clone());
            trapezoids.extend(vec![v; hold]);
            trapezoids.extend(rising.rev());
            trapezoids.extend(vec![0.0; REST]);
        }
    }
    trapezoids.windows(AVERAGED).map(|window| window.iter().sum::<f64>() / AVERAGED as f64).collect()
}

/// Returns PSEC, position, velocity and current of axis `index` at every tick.
fn ticks(index: usize, limits: &LimitsConfig, changes: &[(&str, f64)]) -> Vec<[f64; 4]> {
    let mut machine = machine(changes);
    let (mut psec, mut ticks) = (vec![0.0; AXES], Vec::new());
    for velocity in velocities(limits) {
        psec[index] += velocity * TSP;
        machine.advance_with(&psec, &psec, |machine| {
            let s = machine.axes()[index].sample();
            ticks.push([s.psec, s.position, s.velocity, s.current]);
        });
    }
    ticks
}

#[test]
fn lags_of_simulated_drives_are_estimated_correctly_or_not_at_all() {
    for (index, name) in ["x", "y", "z", "a", "c"].into_iter().enumerate() {
        for feedforward in [1.0, 0.0] {
            let key = format!("{name}.feedforward.velocity");
            let changes = [(key.as_str(), feedforward)];
            let config = parameters(&changes).machine_config().expect("valid");
            let axis = &config.axes()[index];
            let ticks = ticks(index, axis.limits(), &changes);
            // Encoder of 1 µm or 1 mdeg.
            let quantum = if index < 3 { 1e-6 } else { 1e-3_f64.to_radians() };
            for (step, late) in [(2, 0), (8, 0), (16, 0), (48, 0), (2, 24), (8, 24), (16, 24), (48, 24)] {
                let sampled = |channel: usize, late: usize| -> Vec<f64> {
                    (0..ticks.len()).step_by(step).map(|n| ticks[n.saturating_sub(late)][channel]).collect()
                };
                let position: Vec<f64> =
                    sampled(1, 0).iter().map(|x| (x / quantum).round() * quantum).collect();
                // 0.05 A of repeatable noise.
                let noise = |n: usize| 0.05 * ((n * 7919 % 1013) as f64 / 506.0 - 1.0);
                let raw = RawRecording {
                    name: format!("{name}, feedforward {feedforward}, step {step}, late by {late}"),
                    time: (0..position.len()).map(|n| (n * step) as f64 * TICK).collect(),
                    psec: Some(sampled(0, 0)),
                    position: Some(position),
                    velocity: Some(sampled(2, 0)),
                    current: Some(sampled(3, late).iter().enumerate().map(|(n, i)| i + noise(n)).collect()),
                    ..RawRecording::default()
                };
                let (signals, _) = condition(&raw, axis, &config.periods(), &Conditioning::default())
                    .unwrap_or_else(|fault| panic!("{fault}"));
                assert_eq!(signals.spans.len(), 1, "{}", raw.name);
                let (found, lag) = (signals.current_lag, late as f64 * TICK);
                let right = (found - lag).abs() < 0.3e-3;
                // The inertia of the linear axes is large enough to show 3 ms, except when sampled every 6
                // ms.
                let told = late == 0 || (index < 3 && step < 48);
                assert!(right || !told && found == 0.0, "{}: {found} s", raw.name);
            }
        }
    }
}
