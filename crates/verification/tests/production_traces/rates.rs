//! One axis recorded at several rates: the identification does not depend on the rate, nor on how the control logs the
//! current.

use virtual_axes_core::config::Parameters;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};
use virtual_axes_identify::identify::{
    AxisIdentification, AxisRecordings, ConditionedRecording, IdentificationOptions,
};
use virtual_axes_identify::recording::{Conditioning, RawRecording, Severity};
use virtual_axes_verification::production_traces::{
    AxisOrientation, CurrentSampling, HiddenAxis, ProductionProgram, TraceRecorder, machine_file, study,
};

/// Half width of a 95 % interval in standard errors.
const INTERVAL: f64 = 1.96;

/// Returns a hidden axis whose position cycle is 2 ms.
fn hidden(orientation: AxisOrientation) -> (HiddenAxis, u64) {
    let seeds = 7000..7100;
    let mut all = seeds.map(|seed| (HiddenAxis::draw(seed, orientation), seed));
    all.find(|(axis, _)| axis.periods.position == 2 * MILLISECOND_NS).expect("a suitable axis")
}

fn recorder(period: Nanoseconds, current_sampling: CurrentSampling) -> TraceRecorder {
    TraceRecorder {
        current_sampling,
        cutoff: 0.0,
        period,
        position_resolution: 1e-7,
        current_resolution: 1e-3,
        current_noise: 2e-3,
        gap_probability: 0.0,
        jitter: 0.0,
        is_feedforward_recorded: true,
        ..TraceRecorder::default()
    }
}

/// Identifies the axis from a recording, starting from the knowledge of a user.
fn identified(axis: &HiddenAxis, seed: u64, raw: &RawRecording) -> AxisIdentification {
    let guess = axis.guess(seed);
    let text = machine_file("Guess.", &[&guess.config], guess.periods).expect("a machine file");
    let parameters = Parameters::from_yaml(&text, "guess").expect("a machine");
    let machine = parameters.machine_config().expect("a machine");
    let of = (&machine.axes()[0], &machine.periods());
    let read = ConditionedRecording::new((raw, Vec::new()), of, &Conditioning::default(), None);
    let recordings =
        AxisRecordings { identification: vec![read.expect("plausible")], ..AxisRecordings::default() };
    let options = IdentificationOptions::default();
    AxisIdentification::new((&parameters, 0), recordings, &options, |_| Ok(())).expect("a result")
}

/// Returns inertia and weight relative to the hidden ones, with their standard errors.
fn plant(axis: &HiddenAxis, seed: u64, found: &AxisIdentification) -> [(f64, f64); 2] {
    let known = axis.guess(seed).config.motor.torque_constant / axis.config.motor.torque_constant;
    let value = |key: &str, truth: f64| {
        let key = format!("{}.{key}", axis.config.name);
        let value = found.summary.values.iter().find(|value| value.key == key).expect("a value");
        (value.value / (truth * known), value.error.expect("an error") / (truth * known))
    };
    [
        value("motor.inertia_kg_m2", axis.config.motor.inertia),
        value("gravity.weight_n", axis.config.gravity.weight),
    ]
}

fn residual(found: &AxisIdentification) -> f64 {
    found.identification.agreements[0].baseline.expect("a simulation").model
}

#[test]
fn the_result_does_not_depend_on_rate_and_sampling_of_the_current() {
    let (axis, seed) = hidden(AxisOrientation::Vertical);
    let program = axis.program(1, 12.0).expect("a program");
    let (first, later) = (CurrentSampling::Instant(0.0), CurrentSampling::Instant(0.65));
    let mean = CurrentSampling::Mean;
    for (milliseconds, sampling) in [(2, first), (4, first), (10, first), (2, later), (2, mean), (20, mean)] {
        let raw = axis.record(&program, &recorder(milliseconds * MILLISECOND_NS, sampling), seed);
        let found = identified(&axis, seed, &raw.expect("a recording"));
        let [inertia, weight] = plant(&axis, seed, &found);
        let about =
            format!("{milliseconds} ms, {sampling:?}: J {inertia:?}, W {weight:?}, {:e} m", residual(&found));
        println!("{about}");
        assert!(residual(&found) <= 5e-6, "{about}");
        assert!((inertia.0 - 1.0).abs() <= (INTERVAL * inertia.1).max(0.03), "{about}");
        assert!((inertia.0 - 1.0).abs() <= 0.1 && inertia.1 <= 0.1, "{about}");
        assert!((weight.0 - 1.0).abs() <= (INTERVAL * weight.1).max(0.03), "{about}");
        let cycle = found.identification.periods.expect("periods").position;
        assert_eq!(cycle, axis.periods.position, "{about}");
        assert!(found.summary.findings.iter().all(|f| f.severity < Severity::Invalid), "{about}");
    }
}

#[test]
fn two_moves_give_inertia_and_friction_with_wide_intervals() {
    let (axis, seed) = hidden(AxisOrientation::Vertical);
    let program = ProductionProgram::draw_rapids(3, 2, &[axis.config.limits; 3]).expect("a program");
    let raw = axis.record(&program, &recorder(2 * MILLISECOND_NS, CurrentSampling::Mean), seed);
    let found = identified(&axis, seed, &raw.expect("a recording"));
    let [inertia, weight] = plant(&axis, seed, &found);
    assert!(inertia.1 > 1e-3 && (inertia.0 - 1.0).abs() <= INTERVAL * inertia.1, "{inertia:?}");
    assert!((weight.0 - 1.0).abs() <= (INTERVAL * weight.1).max(0.03), "{weight:?}");
    assert!(residual(&found) <= 5e-6, "{} m", residual(&found));
}

#[test]
fn a_recording_without_setpoints_gives_the_plant() {
    let (axis, seed) = hidden(AxisOrientation::Vertical);
    let program = axis.program(2, 12.0).expect("a program");
    let raw = axis.record(&program, &recorder(10 * MILLISECOND_NS, CurrentSampling::Mean), seed);
    let raw = RawRecording { psec: None, ..raw.expect("a recording") };
    let found = identified(&axis, seed, &raw);
    let [inertia, weight] = plant(&axis, seed, &found);
    assert!((inertia.0 - 1.0).abs() <= 0.05, "{inertia:?}");
    assert!((weight.0 - 1.0).abs() <= 0.05, "{weight:?}");
    assert!(found.identification.delays.is_empty());
    assert!(found.summary.findings.iter().any(|finding| finding.code == "no-setpoints"));
}

#[test]
fn recorded_torque_tells_the_torque_constant() {
    let (axis, seed) = hidden(AxisOrientation::Horizontal);
    let program = axis.program(4, 8.0).expect("a program");
    let raw = axis.record(&program, &recorder(10 * MILLISECOND_NS, CurrentSampling::Mean), seed);
    let mut raw = raw.expect("a recording");
    let constant = axis.config.motor.torque_constant;
    raw.torque = raw.current.as_ref().map(|current| current.iter().map(|i| constant * i).collect());
    let found = identified(&axis, seed, &raw);
    let value = |key: &str| {
        let key = format!("{}.{key}", axis.config.name);
        found.summary.values.iter().find(|value| value.key == key).expect("a value").value
    };
    assert!((value("motor.torque_constant_nm_a") / constant - 1.0).abs() < 1e-6);
    // With the torque constant the inertia is that of the axis.
    assert!((value("motor.inertia_kg_m2") / axis.config.motor.inertia - 1.0).abs() < 0.1);
}

#[test]
fn correlations_of_the_joint_fit_are_those_of_a_covariance() {
    let (axis, seed) = hidden(AxisOrientation::Horizontal);
    let program = axis.program(5, 8.0).expect("a program");
    let raw = axis.record(&program, &recorder(10 * MILLISECOND_NS, CurrentSampling::Mean), seed);
    let found = identified(&axis, seed, &raw.expect("a recording"));
    let correlations = &found.identification.refinement.as_ref().expect("a refinement").correlations;
    let mut largest: f64 = 0.0;
    for (j, row) in correlations.iter().enumerate() {
        for (k, rho) in row.iter().enumerate() {
            assert!((rho - correlations[k][j]).abs() < 1e-9 && rho.abs() <= 1.0 + 1e-9, "{correlations:?}");
            if j == k {
                assert!((rho - 1.0).abs() < 1e-9, "{correlations:?}");
            } else {
                largest = largest.max(rho.abs());
            }
        }
    }
    // Gain and integral time of the velocity loop act alike.
    assert!(largest > 0.1, "{correlations:?}");
}

/// A trace with velocity feedforward only, whose current is logged at one instant of 6 ms cycles: before the inertia is that of
/// this ripple, torque feedforward explains the motion better.
#[test]
fn feedforward_modes_are_compared_with_the_plant_of_each() {
    let found = study(9_910_002, AxisOrientation::Horizontal, MILLISECOND_NS).expect("a study");
    let inertia = found.acceleration.expect("an inertia");
    assert!(inertia.error.abs() < 0.03 && found.invalid.is_empty(), "{found:?}");
    assert!(found.beta.expect("a delay").error.abs() < 0.5e-3, "{found:?}");
}

#[test]
fn samples_every_4_ms_of_cycles_of_6_ms_predict_an_unseen_program() {
    let found = study(100_006, AxisOrientation::Horizontal, 4 * MILLISECOND_NS).expect("a study");
    assert!(found.invalid.is_empty() && found.residuals[1].expect("a prediction") < 5e-6, "{found:?}");
    assert!(found.acceleration.expect("an inertia").is_covered, "{found:?}");
}
