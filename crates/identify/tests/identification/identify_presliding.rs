//! Presliding identified from slow reversals, and recordings that do not determine it.

use std::f64::consts::TAU;

use virtual_axes_core::config::{Parameters, Value, ValueSource};
use virtual_axes_core::units::seconds;
use virtual_axes_identify::identify::{
    Identification, IdentificationInput, IdentificationOptions, RefinementScope, identify, update_parameters,
};
use virtual_axes_identify::recording::{Conditioning, Severity, condition};
use virtual_axes_verification::fixtures::recordings::{
    CurrentNoise, Disturbance, axis_index, record, true_parameters,
};

const STIFFNESS: &str = "x.friction.presliding_stiffness_n_um";

/// Returns the machine with a presliding of X, N/µm.
fn with_stiffness(stiffness: f64) -> Parameters {
    let mut parameters = true_parameters();
    let source = ValueSource::named("the test");
    parameters.set(STIFFNESS, Value::Double(stiffness), &source).expect("a value in range");
    parameters
}

/// Identifies X from six sines of 1 mm in `period` s; the encoder has increments of `resolution` m.
fn identified(parameters: &Parameters, period: f64, resolution: f64, presliding: bool) -> Identification {
    let machine = parameters.machine_config().expect("a machine");
    let tsp = seconds(machine.periods().position);
    let sine =
        |k: usize| 0.5e-3 * (1.0 - (TAU * (k as f64 * tsp - 0.5).clamp(0.0, 6.0 * period) / period).cos());
    let psec: Vec<f64> = (0..((6.0 * period + 1.0) / tsp) as usize).map(sine).collect();
    let every = machine.periods().ticks_per_position() / 3;
    let disturbance = Disturbance {
        sample_ticks: Some(every),
        resolution,
        noise: CurrentNoise::OfLargest(0.01),
        ..Disturbance::default()
    };
    let mut raw = record(&machine, "x", &psec, &disturbance);
    // Without setpoints nothing but the plant is identified.
    raw.psec = None;
    let start = true_parameters().machine_config().expect("a machine");
    let axis = &start.axes()[axis_index(&start, "x")];
    let conditioning = Conditioning { current_lag: Some(0.0), ..Conditioning::default() };
    let signals = condition(&raw, axis, &start.periods(), &conditioning).expect("a recording").0;
    let options = IdentificationOptions { refine: RefinementScope::NONE, presliding, ..Default::default() };
    let input = IdentificationInput { signals: &signals, feedforward: None };
    identify(&[input], axis, &start.periods(), &options)
}

/// Returns the codes of the findings about presliding.
fn codes(found: &Identification) -> Vec<&'static str> {
    let of_it = ["no-presliding", "no-reversals", "no-sliding"];
    let missing = found.findings.iter().filter(|finding| finding.severity == Severity::Missing);
    missing.map(|finding| finding.code).filter(|code| of_it.contains(code)).collect()
}

#[test]
fn the_stiffness_of_slow_reversals_is_within_its_interval_and_goes_to_the_machine_file() {
    for truth in [20.0, 50.0, 100.0] {
        let found = identified(&with_stiffness(truth), 4.0, 0.1e-6, true);
        let fit = found.presliding.as_ref().unwrap_or_else(|| panic!("{:?}", found.findings));
        let [low, high] = fit.interval.map(|bound| bound / 1e6);
        println!(
            "{truth} N/µm: {:.2} ({low:.2} … {high:.2}), {} reversals",
            fit.stiffness / 1e6,
            fit.reversals
        );
        assert!(low < truth && truth < high);
        assert!((fit.stiffness / 1e6 / truth - 1.0).abs() < 0.05);
        let mut machine = true_parameters();
        update_parameters(&mut machine, "x", &found.values(&true_parameters(), "x"))
            .expect("values in range");
        let Some(Value::Double(written)) = machine.get(STIFFNESS) else { panic!("no stiffness") };
        assert!((written * 1e6 / fit.stiffness - 1.0).abs() < 1e-3, "{written}");
    }
}

#[test]
fn an_axis_without_presliding_gets_a_bound_and_no_stiffness() {
    let found = identified(&true_parameters(), 4.0, 0.1e-6, true);
    assert_eq!(found.presliding, None);
    assert_eq!(codes(&found), ["no-presliding"]);
    let excluded = found.excluded_presliding.expect("a bound") / 1e6;
    println!("excluded below {excluded:.0} N/µm");
    // The friction of 865 N changes within ten increments of 0.1 µm or more.
    assert!((50.0..866.0).contains(&excluded));
    assert!(found.values(&true_parameters(), "x").iter().all(|value| value.key != STIFFNESS));
}

#[test]
fn fast_reversals_and_coarse_encoders_give_no_stiffness() {
    for (period, resolution) in [(0.4, 0.1e-6), (4.0, 10e-6)] {
        let found = identified(&with_stiffness(50.0), period, resolution, true);
        assert_eq!(found.presliding, None, "{period} s, {resolution} m");
        assert_eq!(codes(&found).len(), 1, "{:?}", found.findings);
        // A bound never excludes the true stiffness.
        assert!(found.excluded_presliding.is_none_or(|excluded| excluded < 50e6));
    }
}

#[test]
fn presliding_is_not_searched_for_by_default() {
    let found = identified(&with_stiffness(50.0), 4.0, 0.1e-6, false);
    assert_eq!((found.presliding.as_ref(), found.excluded_presliding), (None, None));
    assert!(codes(&found).is_empty());
}
