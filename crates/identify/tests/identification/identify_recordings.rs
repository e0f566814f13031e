//! Recording fixtures: each disturbance has the stated effect.

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_identify::identify::FeedforwardMode;
use virtual_axes_identify::identify::campaign::CampaignOptions;
use virtual_axes_identify::recording::RawRecording;
use virtual_axes_verification::fixtures::machines::{M_MIN, TSP, parameters};
use virtual_axes_verification::fixtures::recordings::{
    CurrentNoise, Disturbance, NoiseGenerator, machine_with_feedforward, record, record_campaign, stribeck,
};

/// Returns setpoints of X at 3 m/min in both directions, with ramps of constant acceleration and 0.2 s of
/// rest.
fn there_and_back() -> Vec<f64> {
    let (speed, ramp, cruise, rest) = (3.0 * M_MIN, 0.1, 0.6, 0.2);
    let velocity = |t: f64| {
        let leg = |t: f64| (t.min(2.0 * ramp + cruise - t) / ramp).clamp(0.0, 1.0) * speed;
        leg(t - rest) - leg(t - rest - 2.0 * ramp - cruise)
    };
    let count = ((2.0 * (2.0 * ramp + cruise) + 3.0 * rest) / TSP) as usize;
    let mut position = 0.0;
    (0..count)
        .map(|k| {
            position += velocity((k as f64 - 0.5) * TSP) * TSP;
            position
        })
        .collect()
}

fn default_machine() -> MachineConfig {
    parameters::<&str>(&[]).machine_config().expect("valid")
}

fn recorded(disturbance: &Disturbance) -> RawRecording {
    record(&default_machine(), "x", &there_and_back(), disturbance)
}

fn current(recording: &RawRecording) -> &[f64] {
    recording.current.as_deref().expect("recorded")
}

fn position(recording: &RawRecording) -> &[f64] {
    recording.position.as_deref().expect("recorded")
}

fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    (values.map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

#[test]
fn a_clean_recording_contains_the_setpoints_of_each_position_cycle() {
    let psec = there_and_back();
    let clean = recorded(&Disturbance::default());
    assert_eq!(clean.psec.as_deref(), Some(&psec[..]));
    assert!(clean.velocity.is_none());
    let length = Some(psec.len());
    assert_eq!(clean.time.len(), psec.len());
    assert_eq!(clean.velocity_feedforward.as_ref().map(Vec::len), length);
    assert_eq!(clean.torque_feedforward.as_ref().map(Vec::len), length);
    for (k, time) in clean.time.iter().enumerate() {
        assert!((time - k as f64 * TSP).abs() < 1e-12);
    }
    // α = 9 ms and Kp = 25 1/s with VFFW = 1: the position follows two periods later within micrometers.
    let lag = position(&clean).iter().skip(2).zip(&psec).map(|(position, psec)| (position - psec).abs());
    assert!(lag.fold(0.0, f64::max) < 100e-6);
}

#[test]
fn finer_sampling_adds_samples_between_position_cycles() {
    let clean = recorded(&Disturbance::default());
    let fine = recorded(&Disturbance {
        sample_ticks: Some(8),
        is_velocity_recorded: true,
        ..Disturbance::default()
    });
    // 1 ms of 6 ms.
    assert_eq!(fine.time.len(), 6 * clean.time.len());
    assert!((fine.time[1] - 0.001).abs() < 1e-15);
    let every_sixth: Vec<f64> = position(&fine).iter().copied().step_by(6).collect();
    assert_eq!(every_sixth, position(&clean));
    // The velocity is the derivative of the position, integrated by trapezoids of 1 ms.
    let velocity = fine.velocity.as_deref().expect("asked for");
    let way: f64 = velocity.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]) * 0.001).sum();
    let wanted = position(&fine).last().expect("rows") - position(&fine)[0];
    assert!((way - wanted).abs() < 2e-6, "{way} {wanted}");
}

#[test]
fn noise_and_resolution_match_their_parameters_and_repeat_with_the_seed() {
    let clean = recorded(&Disturbance::default());
    let usual = Disturbance::usual(AxisKind::Linear, 7);
    let noisy = recorded(&usual);
    assert_eq!(noisy, recorded(&usual));
    assert_ne!(noisy, recorded(&Disturbance { seed: 8, ..usual.clone() }));
    let largest = current(&clean).iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let noise = current(&noisy).iter().zip(current(&clean)).map(|(noisy, clean)| (noisy - clean) / largest);
    // 366 values: their deviation is known to 1/√(2·366) = 3.7 %; three times this is allowed.
    let sigma = deviation(noise);
    println!("σ {sigma}");
    assert!((sigma / 0.02 - 1.0).abs() < 0.11, "{sigma}");
    let of_each = Disturbance { noise: CurrentNoise::OfEach(0.02), ..usual };
    let of_each = recorded(&of_each);
    let parts = current(&of_each).iter().zip(current(&clean)).filter(|(_, clean)| **clean != 0.0);
    let sigma = deviation(parts.map(|(noisy, clean)| noisy / clean - 1.0));
    assert!((sigma / 0.02 - 1.0).abs() < 0.12, "{sigma}");
    for (rounded, exact) in position(&noisy).iter().zip(position(&clean)) {
        assert!((rounded - exact).abs() <= 0.5e-6 * (1.0 + 1e-9));
        assert!((rounded / 1e-6 - (rounded / 1e-6).round()).abs() < 1e-6);
    }
}

#[test]
fn normal_numbers_have_the_moments_of_a_normal_distribution() {
    let mut random = NoiseGenerator::new(3);
    let count = 100_000;
    let numbers: Vec<f64> = (0..count).map(|_| random.normal()).collect();
    let within = |limit: f64| numbers.iter().filter(|x| x.abs() < limit).count() as f64 / count as f64;
    let mean = numbers.iter().sum::<f64>() / count as f64;
    // Four standard errors of each.
    assert!(mean.abs() < 0.0127, "{mean}");
    assert!((deviation(numbers.iter().copied()) - 1.0).abs() < 0.009);
    for (limit, wanted) in [(1.0, 0.682_689), (2.0, 0.954_500), (3.0, 0.997_300)] {
        assert!((within(limit) - wanted).abs() < 0.006, "{limit}: {}", within(limit));
    }
}

#[test]
fn backlash_lags_by_half_its_width_in_both_directions() {
    let clean = recorded(&Disturbance::default());
    let played = recorded(&Disturbance { backlash: 2e-6, ..Disturbance::default() });
    let lags: Vec<f64> = position(&played).iter().zip(position(&clean)).map(|(p, c)| p - c).collect();
    let near = |t: f64| lags[(t / TSP) as usize];
    // In the middle of both legs.
    assert!((near(0.6) + 1e-6).abs() < 1e-15 && (near(1.4) - 1e-6).abs() < 1e-15);
    assert!(lags.iter().all(|lag| lag.abs() <= 1e-6 + 1e-15));
    assert_eq!(lags[0], 0.0);
}

#[test]
fn additional_friction_increases_the_current() {
    let clean = recorded(&Disturbance::default());
    let rough = recorded(&Disturbance { friction: Some(|v| 0.2 * v / 3.0), ..Disturbance::default() });
    // Settled at 3 m/min in both directions.
    for (time, wanted) in [(0.85, 0.2), (1.65, -0.2)] {
        let k = (time / TSP) as usize;
        let more = current(&rough)[k] - current(&clean)[k];
        assert!((more - wanted).abs() < 1e-3, "{time} s: {more} A");
    }
    assert_eq!(stribeck(0.0), 0.0);
    assert!((stribeck(-0.5) + 0.1 / std::f64::consts::E).abs() < 1e-15);
}

#[test]
fn current_lag_jitter_gaps_and_stalls_match_their_parameters() {
    let fine = |current_lag| Disturbance { sample_ticks: Some(8), current_lag, ..Disturbance::default() };
    let (clean, late) = (recorded(&fine(0.0)), recorded(&fine(0.003)));
    assert_eq!(&current(&late)[3..], &current(&clean)[..current(&clean).len() - 3]);
    assert_eq!(position(&late), position(&clean));

    let jittering = recorded(&Disturbance { jitter: 1e-3, ..Disturbance::default() });
    let steady = recorded(&Disturbance::default());
    assert_eq!(position(&jittering), position(&steady));
    let sigma = deviation(jittering.time.iter().zip(&steady.time).map(|(a, b)| a - b));
    assert!((sigma / 1e-3 - 1.0).abs() < 0.12, "{sigma}");

    let holes =
        Disturbance { gaps: vec![0.301..0.501], stalls: vec![0.801..0.899], ..Disturbance::default() };
    let holed = recorded(&holes);
    assert!(holed.time.iter().all(|t| !(0.301..0.501).contains(t) && !(0.801..0.899).contains(t)));
    // 33 samples are missing, and 16 have the stamp at the end of the stall.
    assert_eq!(steady.time.len() - holed.time.len(), 33);
    assert_eq!(holed.time.iter().filter(|t| **t == 0.899).count(), 16);
    assert_eq!(holed.current.as_ref().map(Vec::len), Some(holed.time.len()));
}

#[test]
fn parts_of_a_campaign_differ_in_feedforward() {
    let parameters = parameters::<&str>(&[]);
    let clean = Disturbance::default();
    let short = CampaignOptions { range: Some([0.0, 0.05]), max_feed: Some(3.0 * M_MIN) };
    let recordings = record_campaign(&parameters, "x", &FeedforwardMode::ALL, &short, &clean);
    let largest = |channel: &Option<Vec<f64>>| {
        channel.iter().flatten().fold(0.0_f64, |largest, value| largest.max(value.abs()))
    };
    for (part, recording) in &recordings {
        assert_eq!(recording.name, part.name());
        let velocity = largest(&recording.velocity_feedforward);
        let torque = largest(&recording.torque_feedforward);
        // 3 m/min is 0.05 m/s with a screw of 20 mm.
        let wanted = if *part == FeedforwardMode::Off { 0.0 } else { 0.05 / 0.020 * std::f64::consts::TAU };
        assert!((velocity - wanted).abs() < 1e-6, "{part:?}: {velocity}");
        assert_eq!(torque > 0.0, *part == FeedforwardMode::Both, "{part:?}: {torque}");
    }
    let off = machine_with_feedforward(&parameters, "x", FeedforwardMode::Off);
    assert_eq!(off.axes()[1], default_machine().axes()[1]);
}
