//! Findings about the sampling of recordings: phase, coarse current, and noise of the setpoints.

use super::identify_findings::{STEPS_ONLY, clean, finding, identified, inertia_of, legs, recorded};
use virtual_axes_core::config::{Value, ValueSource};
use virtual_axes_identify::identify::{
    FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, identify,
};
use virtual_axes_identify::recording::{Conditioning, RawRecording, Severity, condition};
use virtual_axes_verification::fixtures::recordings::{
    Disturbance, axis_index, initial_parameters, machine_with_feedforward, record, true_parameters,
};

const SPEEDS: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 12.0, 16.0];

/// Returns a recording of X every `ticks` current cycles of 125 µs.
fn sampled(ticks: u64) -> RawRecording {
    recorded(&true_parameters(), &legs(&SPEEDS, true), &Disturbance { sample_ticks: Some(ticks), ..clean() })
}

/// Returns every third sample from the second one on.
fn beside(raw: &RawRecording) -> RawRecording {
    let thinned = |channel: &[f64]| channel.iter().copied().skip(1).step_by(3).collect::<Vec<f64>>();
    let of = |channel: &Option<Vec<f64>>| channel.as_deref().map(thinned);
    RawRecording {
        name: raw.name.clone(),
        time: thinned(&raw.time),
        psec: of(&raw.psec),
        position: of(&raw.position),
        velocity: of(&raw.velocity),
        current: of(&raw.current),
        ..RawRecording::default()
    }
}

fn has(found: &Identification, code: &str) -> bool {
    found.findings.iter().any(|finding| finding.code == code)
}

#[test]
fn samples_beside_the_position_cycles_take_the_joint_fit() {
    let found =
        identified(&[beside(&sampled(16))], &initial_parameters("x"), &IdentificationOptions::default());
    finding(&found, Severity::Warning, "steps-disagree");
    let model = found.agreements[0].baseline.expect("a simulation").model;
    assert!(model < 5e-6, "{model} m");
    let found = identified(&[sampled(48)], &initial_parameters("x"), &IdentificationOptions::default());
    assert!(!has(&found, "sampling-phase"), "{:?}", found.findings);
}

#[test]
fn a_current_at_a_third_of_the_position_cycle_is_reported_without_setpoints() {
    let raw = RawRecording { psec: None, ..sampled(16) };
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    let text = finding(&found, Severity::Warning, "unseen-current");
    assert!(text.contains("sample the current every millisecond"), "{text}");
    assert!(text.contains("a position cycle (of the initial machine, 6 ms)"), "{text}");
    let raw = RawRecording { psec: None, ..sampled(8) };
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    assert!(!has(&found, "unseen-current"), "{:?}", found.findings);
}

#[test]
fn a_current_every_millisecond_is_not_reported_for_a_position_cycle_of_1_ms() {
    let mut start = initial_parameters("x");
    start
        .set("periods.position_ms", Value::Double(1.0), &ValueSource::named("the test"))
        .expect("a value in range");
    let raw = RawRecording { psec: None, ..sampled(8) };
    let found = identified(&[raw], &start, &STEPS_ONLY);
    assert!(found.inertia.is_some());
    assert!(!has(&found, "unseen-current"), "{:?}", found.findings);
}

#[test]
fn setpoints_with_noise_start_at_rest() {
    for ticks in [48, 8] {
        let mut raw = sampled(ticks);
        for (i, psec) in raw.psec.iter_mut().flatten().enumerate() {
            *psec += 1e-9 * ((i * 7 % 21) as f64 - 10.0);
        }
        let found = identified(&[raw], &initial_parameters("x"), &IdentificationOptions::default());
        assert!(!has(&found, "no-setpoints"), "{:?}", found.findings);
        assert!(found.refinement.is_some());
        assert!((inertia_of(&found) / 0.028 - 1.0).abs() < 0.01, "{}", inertia_of(&found));
    }
}

#[test]
fn a_current_at_multiples_of_the_position_cycle_is_reported() {
    let found = identified(&[sampled(192)], &initial_parameters("x"), &STEPS_ONLY);
    let text = finding(&found, Severity::Warning, "unseen-current");
    assert!(text.contains("sampled every 4 position cycles of 6 ms, at one phase"), "{text}");
    let found = identified(&[sampled(160)], &initial_parameters("x"), &STEPS_ONLY);
    assert!(!has(&found, "unseen-current"), "{:?}", found.findings);
}

#[test]
fn the_gravity_that_a_production_trace_keeps_is_reported() {
    let mode = FeedforwardMode::Off;
    let machine = machine_with_feedforward(&true_parameters(), "c", mode);
    let psec: Vec<f64> = legs(&SPEEDS, true).iter().map(|position| 5.0 * position).collect();
    let raw =
        record(&machine, "c", &psec, &Disturbance { sample_ticks: Some(160), ..Disturbance::default() });
    let axis = &machine.axes()[axis_index(&machine, "c")];
    let signals = condition(&raw, axis, &machine.periods(), &Conditioning::default()).expect("a recording").0;
    let input = IdentificationInput { signals: &signals, feedforward: Some(mode) };
    let found = identify(&[input], axis, &machine.periods(), &STEPS_ONLY);
    assert!(found.inertia.is_some());
    let text = finding(&found, Severity::Note, "gravity-kept");
    assert!(
        text.contains("gravity.tilt_nm 0 and gravity.tilt_phase_deg 0 are those of the initial machine"),
        "{text}"
    );
}
