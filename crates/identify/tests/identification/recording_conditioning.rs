//! Conditioning of analytic recordings with disturbances.

use std::f64::consts::{LN_2, PI, TAU};

use proptest::prelude::*;
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_identify::recording::{
    Conditioning, ConditioningError, Finding, RawRecording, Signals, condition,
};

/// Sampling period of 1 kHz, s.
const PERIOD: f64 = 1e-3;
const SAMPLES: usize = 9000;
/// Duration of each ramp, s.
const RAMP: f64 = 0.2;
/// Duration at full speed, s.
const HOLD: f64 = 0.6;
/// Rest between two moves, s.
const REST: f64 = 0.3;
/// Speeds of the moves, m/s.
const SPEEDS: [f64; 6] = [0.05, -0.05, 0.15, -0.15, 0.3, -0.3];

/// Returns position, velocity and acceleration at time t: ramps v/2 (1 − cos πt/RAMP), mirrored at the end.
fn motion(t: f64) -> [f64; 3] {
    let length = 2.0 * RAMP + HOLD + REST;
    let mut position = 0.0;
    let mut begin = REST;
    for v in SPEEDS {
        let t = t - begin;
        if t < 0.0 {
            break;
        }
        let ramp = |t: f64| {
            let w = PI / RAMP;
            [v / 2.0 * (t - (w * t).sin() / w), v / 2.0 * (1.0 - (w * t).cos()), v / 2.0 * w * (w * t).sin()]
        };
        let travel = v * (RAMP + HOLD);
        if t < RAMP {
            let [x, speed, a] = ramp(t);
            return [position + x, speed, a];
        } else if t < RAMP + HOLD {
            return [position + v * (t - RAMP / 2.0), v, 0.0];
        } else if t < 2.0 * RAMP + HOLD {
            let [x, speed, a] = ramp(2.0 * RAMP + HOLD - t);
            return [position + travel - x, speed, -a];
        }
        position += travel;
        begin += length;
    }
    [position, 0.0, 0.0]
}

/// Returns the current, A: inertia, viscous and Coulomb friction.
fn current(t: f64) -> f64 {
    let [_, v, a] = motion(t);
    let direction = if v == 0.0 { 0.0 } else { v.signum() };
    3.4 * a + 2.0 * v + 1.2 * direction
}

/// Returns repeatable noise, uniform in −1 … 1.
fn noise(n: usize) -> f64 {
    let mixed = (n as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((mixed ^ (mixed >> 32)) % 2_000_001) as f64 / 1e6 - 1.0
}

/// Returns the motion sampled every `period`, with a position resolution of 1 µm.
fn sampled(period: f64, samples: usize) -> RawRecording {
    let time: Vec<f64> = (0..samples).map(|n| n as f64 * period).collect();
    let of = |f: &dyn Fn(f64) -> f64| Some(time.iter().map(|&t| f(t)).collect::<Vec<f64>>());
    RawRecording {
        name: "x.csv".into(),
        psec: of(&|t| motion(t)[0]),
        position: of(&|t| (motion(t - 0.009)[0] * 1e6).round() / 1e6),
        velocity: of(&|t| motion(t - 0.009)[1]),
        current: of(&|t| current(t - 0.009)),
        torque: None,
        velocity_feedforward: None,
        torque_feedforward: None,
        motor_position: None,
        time,
    }
}

fn recording() -> RawRecording {
    sampled(PERIOD, SAMPLES)
}

fn machine() -> MachineConfig {
    let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    parameters.machine_config().expect("the machine is valid")
}

fn axis(name: &str) -> AxisConfig {
    machine().axes().iter().find(|axis| axis.name() == name).expect("an axis of the machine").clone()
}

fn run_with(
    raw: &RawRecording,
    options: &Conditioning,
) -> Result<(Signals, Vec<Finding>), ConditioningError> {
    condition(raw, &axis("x"), &machine().periods(), options)
}

fn run(raw: &RawRecording) -> (Signals, Vec<Finding>) {
    run_with(raw, &Conditioning::default()).expect("the recording is good")
}

fn fault(raw: &RawRecording) -> ConditioningError {
    run_with(raw, &Conditioning::default()).expect_err("the recording is bad")
}

#[track_caller]
fn assert_rejected(raw: &RawRecording, reason: &str) {
    let fault = fault(raw).to_string();
    assert!(fault.contains(reason), "{fault}");
}

fn codes(findings: &[Finding]) -> Vec<&str> {
    findings.iter().map(|finding| finding.code).collect()
}

/// Removes the samples of `rows` from every channel.
fn remove(raw: &mut RawRecording, rows: std::ops::Range<usize>) {
    raw.time.drain(rows.clone());
    for channel in channels(raw).into_iter().flatten() {
        channel.drain(rows.clone());
    }
}

fn channels(raw: &mut RawRecording) -> [Option<&mut Vec<f64>>; 4] {
    [raw.psec.as_mut(), raw.position.as_mut(), raw.velocity.as_mut(), raw.current.as_mut()]
}

fn scale(channel: &mut Option<Vec<f64>>, factor: f64) {
    for value in channel.iter_mut().flatten() {
        *value *= factor;
    }
}

/// Asserts that every sample of the spans is the recorded motion at its time.
fn assert_in_place(signals: &Signals, tolerance: f64) {
    for span in &signals.spans {
        for (n, position) in span.position.iter().enumerate() {
            let t = span.start + n as f64 * signals.period;
            let true_position = motion(t - 0.009)[0];
            assert!((position - true_position).abs() <= tolerance, "{t} s: {position} for {true_position}");
        }
    }
}

fn samples(signals: &Signals) -> usize {
    signals.spans.iter().map(|span| span.position.len()).sum()
}

#[test]
fn a_good_recording_keeps_its_values() {
    let raw = recording();
    let (signals, findings) = run(&raw);
    assert_eq!(findings, [], "nothing is to be said");
    assert_eq!(signals.spans.len(), 1);
    assert_eq!((signals.period, signals.cutoff, signals.current_lag), (PERIOD, 100.0, 0.0));
    let span = &signals.spans[0];
    assert_eq!(Some(&span.position), raw.position.as_ref());
    assert_eq!(span.psec, raw.psec);
    assert_eq!(span.current, raw.current);
    assert_eq!(span.recorded_velocity, raw.velocity);
    assert_eq!(span.start, 0.0);
}

#[test]
fn derivatives_follow_the_analytic_motion() {
    let mut raw = recording();
    let (amplitude, w) = (0.05, TAU * 2.0);
    raw.position = Some(raw.time.iter().map(|t| amplitude * (w * t).sin()).collect());
    (raw.psec, raw.velocity, raw.current) = (None, None, None);
    for cutoff in [20.0, 100.0, 160.0] {
        let options = Conditioning { cutoff: Some(cutoff), ..Conditioning::default() };
        let (signals, _) = run_with(&raw, &options).expect("good");
        let deviation = LN_2.sqrt() / (TAU * cutoff);
        let gain = (-0.5 * (w * deviation).powi(2)).exp();
        let span = &signals.spans[0];
        for n in 200..SAMPLES - 200 {
            let t = n as f64 * PERIOD;
            let (v, a) = (gain * amplitude * w * (w * t).cos(), -gain * amplitude * w * w * (w * t).sin());
            assert!((span.velocity[n] - v).abs() < 1e-3 * amplitude * w);
            assert!((span.acceleration[n] - a).abs() < 1e-3 * amplitude * w * w);
        }
    }
}

#[test]
fn a_cutoff_out_of_range_is_rejected() {
    for cutoff in [0.0, -1.0, f64::NAN, 161.0, 0.01] {
        let options = Conditioning { cutoff: Some(cutoff), ..Conditioning::default() };
        let fault = run_with(&recording(), &options).expect_err("out of range");
        assert!(fault.to_string().contains("… 160.0 Hz"), "{fault}");
    }
    let (signals, _) = run(&sampled(0.006, 1500));
    assert!((signals.cutoff - 0.16 / 0.006).abs() < 1e-9);
}

#[test]
fn jittering_stamps_are_moved_to_the_grid() {
    for part in [0.05, 0.3, 0.45] {
        let mut raw = recording();
        let wanted = raw.clone();
        for (n, stamp) in raw.time.iter_mut().enumerate() {
            *stamp += part * PERIOD * noise(n);
        }
        let (signals, findings) = run(&raw);
        assert_eq!(codes(&findings), ["jitter"], "{part}");
        assert_eq!(signals.period, PERIOD, "{part}");
        assert_eq!(Some(&signals.spans[0].position), wanted.position.as_ref(), "{part}");
        // Median of 9000 jittering stamps.
        assert!(signals.spans[0].start.abs() < 0.05 * PERIOD);
    }
}

#[test]
fn a_clock_coarser_than_the_sampling_is_detected() {
    let mut raw = sampled(0.25e-3, 4 * SAMPLES);
    let wanted = raw.clone();
    for stamp in &mut raw.time {
        *stamp = (*stamp * 1e3 + 1e-6).floor() * 1e-3;
    }
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["jitter"]);
    assert_eq!(signals.period, 0.25e-3);
    assert_eq!(Some(&signals.spans[0].position), wanted.position.as_ref());
}

#[test]
fn a_stall_with_a_burst_is_moved_to_the_grid() {
    let mut raw = recording();
    let wanted = raw.clone();
    // After a stall 40 samples arrive 20 µs apart; another stall interrupts the burst of the third.
    for (first, count) in [(1700, 40), (4000, 15), (4013, 30)] {
        for n in first..first + count {
            raw.time[n] = raw.time[n].max(wanted.time[first + count] + (n - first) as f64 * 2e-5 - 1e-3);
        }
    }
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings)[0], "stall", "{findings:?}");
    assert!(findings[0].what.contains("at 1.699 s"), "{}", findings[0]);
    assert_eq!(signals.spans.len(), 1);
    assert_eq!(Some(&signals.spans[0].position), wanted.position.as_ref());
}

#[test]
fn frozen_values_are_dropped() {
    let mut raw = recording();
    for channel in channels(&mut raw).into_iter().flatten() {
        let held = channel[5700];
        channel[5700..5712].fill(held);
    }
    let (signals, findings) = run(&raw);
    assert!(codes(&findings).contains(&"frozen"), "{findings:?}");
    assert_eq!(signals.spans.len(), 2);
    assert_eq!(samples(&signals), SAMPLES - 11);
    assert_in_place(&signals, 0.5001e-6);
}

#[test]
fn a_slow_quantized_motion_and_a_stop_are_not_frozen() {
    let mut raw = recording();
    // 0.3 µm per sample, then a rest, then motion again.
    let slow = |n: usize| (n.min(4000) as f64 + n.max(5000) as f64) * 0.3e-6;
    raw.position = Some((0..SAMPLES).map(|n| (slow(n) * 1e6).round() / 1e6).collect());
    (raw.psec, raw.velocity, raw.current) = (None, None, None);
    let (signals, findings) = run(&raw);
    assert_eq!(findings, []);
    assert_eq!(samples(&signals), SAMPLES);
}

#[test]
fn single_increments_of_a_creeping_axis_are_not_frozen() {
    // 1 µm per sample; every 50 samples two without increment and a jump.
    let creeping = |jump: u32| {
        let mut raw = recording();
        let mut increments = 0;
        let next = |n: usize| {
            increments += match n % 50 {
                20 | 21 => 0,
                22 => jump,
                _ => 1,
            };
            f64::from(increments) * 1e-6
        };
        raw.position = Some((0..SAMPLES).map(next).collect());
        (raw.psec, raw.velocity, raw.current) = (None, None, None);
        raw
    };
    assert_eq!(run(&creeping(3)).1, []);
    assert!(codes(&run(&creeping(9)).1).contains(&"frozen"));
}

#[test]
fn long_gaps_split_the_recording_and_short_ones_are_interpolated() {
    let mut raw = recording();
    remove(&mut raw, 6000..6500);
    remove(&mut raw, 3300..3302);
    remove(&mut raw, 1000..1001);
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["gap", "bridged"]);
    assert!(findings[0].what.contains("501.0 ms"), "{}", findings[0]);
    assert_eq!(signals.spans.len(), 2);
    assert_eq!(samples(&signals), SAMPLES - 500);
    assert!((signals.spans[1].start - 6.5).abs() < 1e-12);
    assert_in_place(&signals, 2e-6);
}

#[test]
fn honest_stamps_of_a_logger_that_does_not_sample_uniformly_are_kept() {
    // Each interval is 10 or 12 ms.
    let mut time = vec![0.0];
    for n in 1..SAMPLES / 2 {
        time.push(time[n - 1] + if noise(n) < 0.0 { 0.010 } else { 0.012 });
    }
    let of = |f: &dyn Fn(f64) -> f64| Some(time.iter().map(|&t| f(t)).collect::<Vec<f64>>());
    let raw = RawRecording {
        name: "x.csv".into(),
        psec: of(&|t| motion(t)[0]),
        position: of(&|t| motion(t - 0.009)[0]),
        time,
        ..RawRecording::default()
    };
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["irregular"]);
    for span in &signals.spans {
        for (i, position) in span.position.iter().enumerate() {
            let t = span.start + i as f64 * signals.period;
            assert!((position - motion(t - 0.009)[0]).abs() < 1e-5, "{t} s: {position}");
        }
    }
}

#[test]
fn gaps_in_jittering_stamps_are_counted_correctly() {
    let mut raw = recording();
    for (n, stamp) in raw.time.iter_mut().enumerate() {
        *stamp += 0.2 * PERIOD * noise(n);
    }
    for first in [8000, 6100, 4500, 2222] {
        remove(&mut raw, first..first + 7);
    }
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["jitter", "gap"]);
    assert_eq!(signals.spans.len(), 5);
    assert_eq!(samples(&signals), SAMPLES - 28);
    // 0.1 ms at 0.3 m/s: the phase of a span is the median of its stamps.
    assert_in_place(&signals, 30e-6);
}

#[test]
fn missing_values_are_interpolated_or_split_the_recording() {
    let mut raw = recording();
    if let Some(current) = &mut raw.current {
        current[2000] = f64::NAN;
        current[5000..5010].fill(f64::NAN);
    }
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["bridged", "hole"]);
    assert_eq!(signals.spans.len(), 2);
    assert_eq!(samples(&signals), SAMPLES - 10);
    assert!(signals.spans.iter().all(|span| span.current.iter().flatten().all(|i| i.is_finite())));
}

#[test]
fn impossible_values_are_reported_and_interpolated() {
    let mut raw = recording();
    let wanted = run(&raw).0;
    raw.position.as_mut().expect("a position")[3000] = 1e200;
    raw.current.as_mut().expect("a current")[4000] = f64::NEG_INFINITY;
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["impossible-values", "impossible-values", "bridged"]);
    assert!(
        findings[0].to_string().contains("values of the position beyond ±10¹⁵, 1 in all, count as missing")
    );
    assert!((signals.spans[0].position[3000] - wanted.spans[0].position[3000]).abs() < 1e-7);
}

#[test]
fn repeated_stamps_are_dropped_and_late_stamps_sorted() {
    let mut raw = recording();
    let wanted = raw.clone();
    for channel in channels(&mut raw).into_iter().flatten() {
        channel.swap(4000, 4001);
        let again = channel[2500];
        channel.insert(2501, again);
    }
    raw.time.swap(4000, 4001);
    raw.time.insert(2501, raw.time[2500]);
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["stamps-order", "duplicate-stamps"]);
    assert_eq!(Some(&signals.spans[0].position), wanted.position.as_ref());
    assert_eq!(signals.spans[0].current, wanted.current);
}

#[test]
fn duplicate_rows_are_dropped_in_any_number() {
    let wanted = recording();
    for (every, times) in [(5, 1), (2, 1), (1, 1), (1, 3)] {
        let mut raw = wanted.clone();
        let rows =
            (0..SAMPLES).flat_map(|n| std::iter::repeat_n(n, if n % every == 0 { 1 + times } else { 1 }));
        let rows: Vec<usize> = rows.collect();
        raw.time = rows.iter().map(|&n| wanted.time[n]).collect();
        for channel in channels(&mut raw).into_iter().flatten() {
            *channel = rows.iter().map(|&n| channel[n]).collect();
        }
        let (signals, findings) = run(&raw);
        assert_eq!(codes(&findings), ["duplicate-stamps"], "{times} more of each {every}th: {findings:?}");
        assert_eq!(signals.period, run(&wanted).0.period);
        assert_eq!(Some(&signals.spans[0].position), wanted.position.as_ref());
        assert_eq!(signals.spans[0].current, wanted.current);
    }
}

#[test]
fn positions_modulo_360_degrees_are_continuous() {
    let raw = recording();
    let offset = TAU - 0.1;
    let modulo = |channel: &Option<Vec<f64>>, offset: f64| -> Option<Vec<f64>> {
        Some(channel.as_ref()?.iter().map(|value| (value + offset).rem_euclid(TAU)).collect())
    };
    let turning = RawRecording {
        psec: modulo(&raw.psec, offset),
        position: modulo(&raw.position, offset),
        current: None,
        ..raw.clone()
    };
    let options = Conditioning::default();
    let (signals, findings) =
        condition(&turning, &axis("c"), &machine().periods(), &options).expect("the recording is good");
    assert!(codes(&findings).contains(&"modulo"), "{findings:?}");
    let [span] = signals.spans.as_slice() else { panic!("{} spans", signals.spans.len()) };
    let psec = span.psec.as_ref().expect("recorded");
    for (n, (position, psec)) in span.position.iter().zip(psec).enumerate() {
        let t = span.start + n as f64 * PERIOD;
        assert!((position - offset - motion(t - 0.009)[0]).abs() <= 1e-6, "{t} s: {position} rad");
        assert!((psec - offset - motion(t)[0]).abs() <= 1e-9, "{t} s: {psec} rad");
    }
    // A setpoint on the other side of 0° at the start is no offset of a turn.
    let apart =
        RawRecording { psec: modulo(&raw.psec, TAU - 1e-4), position: modulo(&raw.position, 0.0), ..turning };
    let (signals, _) =
        condition(&apart, &axis("c"), &machine().periods(), &options).expect("the recording is good");
    let first = &signals.spans[0];
    let error = first.psec.as_ref().expect("recorded")[0] - first.position[0];
    assert!(error.abs() < 1e-3, "{error} rad");
}

#[test]
fn a_constant_velocity_column_is_no_factor() {
    let mut raw = recording();
    raw.velocity.iter_mut().flatten().for_each(|velocity| *velocity = -0.018);
    assert_rejected(&raw, "the velocity is constant at -0.018 m/s in motion; ");
}

#[test]
fn positions_in_an_unknown_unit_have_a_remedy() {
    let mut raw = recording();
    scale(&mut raw.position, 1e7);
    scale(&mut raw.psec, 1e7);
    raw.velocity = None;
    assert_rejected(
        &raw,
        "check its unit; give it by --column 'position=COLUMN[UNIT]', for example with a factor: [0.001 mm]",
    );
}

#[test]
fn two_runs_in_one_file_are_two_spans() {
    let mut raw = recording();
    let half: Vec<f64> = raw.time[..SAMPLES / 2].to_vec();
    raw.time[SAMPLES / 2..].copy_from_slice(&half);
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["clock-step", "gap"]);
    assert_eq!(signals.spans.len(), 2);
    assert_eq!(samples(&signals), SAMPLES);
}

#[test]
fn irregular_sampling_is_interpolated() {
    let mut raw = recording();
    let mut time = 0.0;
    for (n, stamp) in raw.time.iter_mut().enumerate() {
        *stamp = time;
        time += PERIOD * (1.0 + 0.4 * noise(n));
    }
    raw.position = Some(raw.time.iter().map(|t| motion(t - 0.009)[0]).collect());
    (raw.psec, raw.velocity, raw.current) = (None, None, None);
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["irregular"]);
    assert_eq!(signals.spans.len(), 1);
    // A thousandth of a period at 0.3 m/s.
    assert_in_place(&signals, 0.3e-6);
}

#[test]
fn samples_of_renewals_are_not_called_irregular() {
    // Samples every 20 ms of signals that are renewed every 6 ms have the stamps of the renewals, 18 and 24 ms apart.
    let time: Vec<f64> = (0..600).map(|n| f64::from(n) * 20e-3).collect();
    let renewal = |t: &f64| (t / 6e-3 + 1e-6).floor() * 6e-3;
    let position = time.iter().map(|t| 0.2 * (3.0 * renewal(t)).sin()).collect();
    let raw = RawRecording { time, position: Some(position), ..RawRecording::default() };
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["held-samples"]);
    assert!(signals.renewal.is_some_and(|cycle| (cycle - 6e-3).abs() < 1e-9), "{:?}", signals.renewal);
}

#[test]
fn samples_taken_at_their_stamps_are_interpolated() {
    // The sample count fits, but the position shows that the stamps are the sampling times.
    let mut raw = recording();
    for (n, stamp) in raw.time.iter_mut().enumerate() {
        *stamp += 0.3 * PERIOD * noise(n);
    }
    raw.position = Some(raw.time.iter().map(|t| (motion(t - 0.009)[0] * 1e6).round() / 1e6).collect());
    (raw.psec, raw.velocity, raw.current) = (None, None, None);
    let (signals, findings) = run(&raw);
    assert_eq!(codes(&findings), ["irregular"]);
    assert_in_place(&signals, 2e-6);
}

#[test]
fn a_current_lag_is_estimated_and_compensated() {
    for lag in [3e-3, -2e-3, 7.4e-3] {
        let mut raw = recording();
        // Noise of 2 %.
        raw.current = Some(
            raw.time.iter().enumerate().map(|(n, t)| current(t - 0.009 - lag) + 0.2 * noise(n)).collect(),
        );
        let (signals, findings) = run(&raw);
        assert_eq!(codes(&findings), ["current-lag"], "{lag}");
        assert!((signals.current_lag - lag).abs() < 0.2e-3, "{} for {lag}", signals.current_lag);
        let span = &signals.spans[0];
        let smooth = span.smooth_current.as_ref().expect("recorded");
        for n in (20..span.position.len() - 20).filter(|&n| span.velocity[n].abs() > 0.02) {
            let wanted = current(span.start + n as f64 * PERIOD - 0.009);
            assert!((smooth[n] - wanted).abs() < 0.35, "{n}: {} for {wanted}", smooth[n]);
        }
    }
}

#[test]
fn a_given_lag_is_compensated_exactly() {
    let raw = recording();
    let given = raw.current.clone().expect("recorded");
    for later in [3, 4, 7] {
        let lag = later as f64 * PERIOD;
        let options = Conditioning { current_lag: Some(lag), ..Conditioning::default() };
        let (signals, _) = run_with(&raw, &options).expect("good");
        let span = &signals.spans[0];
        assert_eq!(signals.current_lag, lag);
        assert_eq!(span.current.as_ref().expect("recorded")[..], given[later..]);
        assert_eq!(span.position.len(), SAMPLES - later);
    }
    for lag in [f64::NAN, 0.03, -0.02] {
        let options = Conditioning { current_lag: Some(lag), ..Conditioning::default() };
        let fault = run_with(&recording(), &options).expect_err("out of range");
        assert!(fault.to_string().contains("--current-lag-ms is"), "{fault}");
    }
}

#[test]
fn no_lag_is_estimated_without_lag() {
    let mut raw = recording();
    let noisy = raw.time.iter().enumerate().map(|(n, t)| current(t - 0.009) + 0.4 * noise(n));
    raw.current = Some(noisy.collect());
    let (signals, findings) = run(&raw);
    assert_eq!(findings, []);
    assert_eq!(signals.current_lag, 0.0);
    // A lag below a sampling period cannot be separated from the ripple of the drive.
    let mut slow = sampled(0.006, 1500);
    slow.current = Some(slow.time.iter().map(|t| current(t - 0.009 - 0.002)).collect());
    assert_eq!(run(&slow).0.current_lag, 0.0);
}

#[test]
fn a_recording_of_a_standstill_is_accepted() {
    let mut raw = recording();
    raw.psec = Some(vec![0.1; SAMPLES]);
    raw.position = Some((0..SAMPLES).map(|n| 0.1 + (noise(n)).round() * 1e-6).collect());
    raw.velocity = Some((0..SAMPLES).map(|n| 1e-3 * noise(n + 7)).collect());
    raw.current = Some((0..SAMPLES).map(|n| 0.3 + 0.1 * noise(n + 3)).collect());
    let (signals, findings) = run(&raw);
    assert_eq!(findings, []);
    assert_eq!(samples(&signals), SAMPLES);
}

#[test]
fn wrong_units_are_reported() {
    type Spoil = fn(&mut RawRecording);
    let cases: [(Spoil, &str); 14] = [
        (|r| r.time.iter_mut().for_each(|t| *t *= 1e3), "time=COLUMN[ms]"),
        (|r| r.time.iter_mut().for_each(|t| *t *= 1e6), "time=COLUMN[us]"),
        (|r| r.time.iter_mut().for_each(|t| *t *= 1e9), "time=COLUMN[ns]"),
        (|r| r.time.iter_mut().for_each(|t| *t *= 1e-3), "time=COLUMN[s]"),
        (|r| scale(&mut r.position, 1e3), "position=COLUMN[mm]"),
        (|r| scale(&mut r.position, 1e-3), "velocity is likely in mm/s"),
        (|r| scale(&mut r.velocity, 1e3), "velocity=COLUMN[mm/s]"),
        (|r| scale(&mut r.velocity, 60.0), "velocity=COLUMN[m/min]"),
        (|r| scale(&mut r.velocity, 6e4), "velocity=COLUMN[mm/min]"),
        (|r| scale(&mut r.velocity, -1.0), "its sign is inverted"),
        (|r| scale(&mut r.velocity, TAU / 0.02), "that of the motor in rad/s"),
        (|r| scale(&mut r.velocity, 60.0 / 0.02), "that of the motor in rpm"),
        (|r| scale(&mut r.psec, 1e3), "psec=COLUMN[mm]"),
        (|r| scale(&mut r.current, 1e3), "current=COLUMN[mA]"),
    ];
    for (spoil, wanted) in cases {
        let mut raw = recording();
        spoil(&mut raw);
        let message = fault(&raw).to_string();
        assert!(message.contains(wanted) && message.starts_with("x.csv: "), "{message} ({wanted})");
    }
}

#[test]
fn degrees_are_reported_on_a_rotary_axis() {
    let mut raw = recording();
    (raw.psec, raw.current) = (None, None);
    scale(&mut raw.velocity, 180.0 / PI);
    let message = condition(&raw, &axis("c"), &machine().periods(), &Conditioning::default())
        .expect_err("deg/s")
        .to_string();
    assert!(message.contains("velocity=COLUMN[deg/s]"), "{message}");
    // 0.3 rad/s in degrees is 17 rad/s, eight times the limit of C: only a velocity channel shows the unit.
    let mut raw = recording();
    (raw.psec, raw.current) = (None, None);
    scale(&mut raw.position, 180.0 / PI);
    let message = condition(&raw, &axis("c"), &machine().periods(), &Conditioning::default())
        .expect_err("deg")
        .to_string();
    assert!(message.contains("position=COLUMN[deg]"), "{message}");
}

#[test]
fn stamps_beyond_any_clock_are_rejected() {
    for (stamp, found) in [(1e305, "1e305"), (-2e11, "-200000000000"), (f64::INFINITY, "inf")] {
        let mut raw = recording();
        raw.time[7] = stamp;
        let message = fault(&raw).to_string();
        assert!(message.contains(&format!("a stamp is {found} s, must lie in ±1e11 s")), "{message}");
    }
    // Seconds since 1601.
    let mut raw = recording();
    raw.time.iter_mut().for_each(|time| *time += 1.3e10);
    assert!(!run(&raw).0.spans.is_empty());
}

#[test]
fn swapped_columns_are_reported() {
    let good = recording();
    let mut raw = good.clone();
    (raw.position, raw.velocity) = (good.velocity.clone(), good.position.clone());
    raw.psec = None;
    assert!(fault(&raw).to_string().contains("position and velocity are swapped"), "{}", fault(&raw));
    let mut raw = good.clone();
    (raw.position, raw.psec) = (good.psec.clone(), good.position.clone());
    (raw.velocity, raw.current) = (None, None);
    let text = fault(&raw).to_string();
    let lag = text.split_once("PSEC lags behind the position by ").and_then(|(_, lag)| lag.split_once(" ms"));
    let lag: f64 = lag.and_then(|(lag, _)| lag.parse().ok()).unwrap_or_else(|| panic!("{text}"));
    assert!((lag - 9.0).abs() < 0.2, "{text}");
    let mut raw = good.clone();
    raw.current = good.velocity.clone();
    assert_rejected(&raw, "the current is a multiple of the velocity");
    let mut raw = good.clone();
    raw.current = good.position.clone();
    assert_rejected(&raw, "the current is a multiple of the position");
    let mut raw = good.clone();
    raw.velocity = good.position.clone();
    assert!(fault(&raw).to_string().contains("the velocity column contains a position"), "{}", fault(&raw));
    let mut raw = good.clone();
    raw.psec = good.current.clone();
    scale(&mut raw.psec, 0.01);
    assert_rejected(&raw, "the position does not correlate with PSEC");
    let mut raw = good;
    raw.psec.iter_mut().flatten().for_each(|psec| *psec += 0.1);
    assert_rejected(&raw, "at rest PSEC and position differ by");
}

#[test]
fn recordings_without_content_are_rejected() {
    let good = recording();
    assert_rejected(
        &RawRecording { position: Some(vec![]), ..RawRecording::default() },
        "0 samples, at least 32",
    );
    let raw = RawRecording { position: None, ..good.clone() };
    assert_rejected(&raw, "no position was recorded");
    let raw = RawRecording { position: Some(vec![f64::NAN; SAMPLES]), ..good.clone() };
    assert_rejected(&raw, "no position was recorded");
    let raw = RawRecording { current: Some(vec![0.0; SAMPLES - 1]), ..good.clone() };
    assert_rejected(&raw, "the current has");
    let raw = RawRecording { time: vec![f64::NAN; SAMPLES], ..good.clone() };
    assert_rejected(&raw, "stamps are not finite");
    let raw = RawRecording { time: vec![4.0; SAMPLES], ..good.clone() };
    assert_rejected(&raw, "every stamp is 4 s");
    let raw = RawRecording { time: good.time.iter().rev().copied().collect(), ..good };
    assert_rejected(&raw, "stamps are earlier than the one before");
}

fn any_value() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -1.0..1.0,
        1 => any::<f64>(),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(1e308), Just(-1e308)],
    ]
}

/// Intervals of a logger, mostly regular.
fn any_interval() -> impl Strategy<Value = f64> {
    prop_oneof![20 => Just(PERIOD), 2 => 0.0..3e-3, 1 => Just(0.0), 1 => -0.05..0.5]
}

fn assert_even(signals: &Signals) {
    assert!(signals.period > 0.0 && signals.cutoff > 0.0 && !signals.spans.is_empty());
    let mut end = f64::NEG_INFINITY;
    for span in &signals.spans {
        let count = span.position.len();
        assert!(count > 0 && span.start > end, "{} after {end}", span.start);
        // The next span starts at the next sample or later, except for the jitter of its first stamps.
        end = span.start + (count as f64 - 1.0) * signals.period;
        assert!(span.velocity.len() == count && span.acceleration.len() == count);
        let optional = [
            &span.psec,
            &span.recorded_velocity,
            &span.current,
            &span.smooth_current,
            &span.torque_feedforward,
        ];
        for channel in optional.into_iter().flatten() {
            assert_eq!(channel.len(), count);
            assert!(channel.iter().all(|value| value.is_finite()));
        }
        assert!(span.position.iter().chain(&span.acceleration).all(|value| value.is_finite()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn arbitrary_recordings_never_panic(
        rows in prop::collection::vec((any_value(), any_value(), any_value(), any_value()), 0..200),
        cutoff in prop::option::of(any_value()),
        lag in prop::option::of(-0.02..0.03),
    ) {
        let raw = RawRecording {
            name: "any".into(),
            time: rows.iter().map(|row| row.0).collect(),
            position: Some(rows.iter().map(|row| row.1).collect()),
            velocity: Some(rows.iter().map(|row| row.2).collect()),
            current: Some(rows.iter().map(|row| row.3).collect()),
            ..RawRecording::default()
        };
        if let Ok((signals, _)) = run_with(&raw, &Conditioning { cutoff, current_lag: lag, ..Conditioning::default() }) {
            assert_even(&signals);
        }
    }

    #[test]
    fn disturbed_recordings_become_uniform(
        intervals in prop::collection::vec(any_interval(), 300..2000),
        spoilt in prop::collection::vec((0_usize..2000, 0_usize..4, any_value()), 0..20),
        offset in -1e3..1e9,
    ) {
        let mut raw = sampled(PERIOD, intervals.len());
        let mut time = offset;
        for (stamp, interval) in raw.time.iter_mut().zip(&intervals) {
            *stamp = time;
            time += interval;
        }
        for (row, channel, value) in spoilt {
            let row = row % intervals.len();
            if let Some(channel) = &mut channels(&mut raw)[channel] {
                channel[row] = value;
            }
        }
        if let Ok((signals, _)) = run_with(&raw, &Conditioning::default()) {
            assert_even(&signals);
        }
    }
}

#[test]
fn a_slow_recording_in_seconds_is_not_taken_for_milliseconds() {
    for (period, expected) in [(0.2, "record faster, or give"), (6.0, "the time is likely in ms")] {
        let mut raw = recording();
        raw.time = (0..raw.time.len()).map(|row| row as f64 * period).collect();
        let text = fault(&raw).to_string();
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn an_inverted_current_is_turned() {
    let mut raw = recording();
    let reference = run(&raw).0;
    scale(&mut raw.current, -1.0);
    let (turned, findings) = run(&raw);
    assert!(findings.iter().any(|finding| finding.code == "current-inverted"));
    assert_eq!(turned.spans, reference.spans);
}
