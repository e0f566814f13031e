//! Findings of the identification: missing data are reported with a remedy, and parameters are identified
//! from other data where possible.

use virtual_axes_core::config::{Parameters, Value, ValueSource};
use virtual_axes_core::units::Rounded;
use virtual_axes_identify::identify::campaign::{Campaign, CampaignOptions as Limits};
use virtual_axes_identify::identify::{
    Breakaway, FeedforwardMode, FrictionLaw, Identification, IdentificationInput, IdentificationOptions,
    RefinedParameter, RefinementScope, identify,
};
use virtual_axes_identify::recording::{Conditioning, RawRecording, Severity, StatedValues, condition};
use virtual_axes_verification::fixtures::machines::RestToRestProfile;
use virtual_axes_verification::fixtures::recordings::{
    Disturbance, axis_index, initial_parameters, machine_with_feedforward, record, true_parameters,
};

const TSP: f64 = 6e-3;
/// Friction of X (model.md section 6).
const X: [f64; 4] = [1.576, 0.01965, -0.5332, -0.2801];

fn law(v: f64) -> f64 {
    X[0] * (X[1] * v).exp() + X[2] * (X[3] * v).exp()
}

/// Returns legs at each speed (m/min) from rest to rest, with the way back if `back`.
pub(crate) fn legs(speeds: &[f64], back: bool) -> Vec<f64> {
    let mut psec = vec![0.0; 100];
    for &speed in speeds {
        let v = speed / 60.0;
        let line =
            RestToRestProfile::new(1.2 * v + 0.12 * v.sqrt(), v, (0.99 * (50.0 * v).sqrt()).min(2.5), 50.0);
        let count = (line.duration() / TSP).ceil() as usize + 1;
        let rest = 80;
        let from = *psec.last().expect("it begins at rest");
        psec.extend((0..count).map(|k| from + line.at(k as f64 * TSP)));
        psec.extend(vec![*psec.last().expect("a leg"); rest]);
        if back {
            let from = *psec.last().expect("a leg");
            psec.extend((0..count).map(|k| from - line.at(k as f64 * TSP)));
            psec.extend(vec![*psec.last().expect("a leg"); rest]);
        }
    }
    psec
}

/// Records X without feedforward on the setpoints `psec`.
pub(crate) fn recorded(parameters: &Parameters, psec: &[f64], disturbance: &Disturbance) -> RawRecording {
    record(&machine_with_feedforward(parameters, "x", FeedforwardMode::Off), "x", psec, disturbance)
}

pub(crate) fn clean() -> Disturbance {
    Disturbance { resolution: 1e-6, ..Disturbance::default() }
}

fn with(mut parameters: Parameters, key: &str, value: Value) -> Parameters {
    parameters.set(key, value, &ValueSource::named("the test")).expect("a value in range");
    parameters
}

pub(crate) fn identified(
    raw: &[RawRecording],
    start: &Parameters,
    options: &IdentificationOptions,
) -> Identification {
    let machine = start.machine_config().expect("a machine");
    let axis = &machine.axes()[axis_index(&machine, "x")];
    let signals: Vec<_> = raw
        .iter()
        .map(|raw| condition(raw, axis, &machine.periods(), &Conditioning::default()).expect("a recording").0)
        .collect();
    let inputs: Vec<IdentificationInput> = signals
        .iter()
        .map(|signals| IdentificationInput { signals, feedforward: Some(FeedforwardMode::Off) })
        .collect();
    identify(&inputs, axis, &machine.periods(), options)
}

pub(crate) const STEPS_ONLY: IdentificationOptions = IdentificationOptions {
    i0: Breakaway::Held,
    refine: RefinementScope::NONE,
    presliding: false,
    stated: StatedValues::ALL,
};

/// Returns text and remedy of the only finding with this code.
pub(crate) fn finding(found: &Identification, severity: Severity, code: &str) -> String {
    let mut of_it = found.findings.iter().filter(|finding| finding.code == code);
    let finding = of_it.next().unwrap_or_else(|| panic!("no {code} in {:?}", found.findings));
    assert!(of_it.next().is_none(), "{code} is reported twice");
    assert_eq!(finding.severity, severity, "{finding}");
    finding.to_string()
}

pub(crate) fn inertia_of(found: &Identification) -> f64 {
    RefinedParameter::Inertia.get(found.axis())
}

#[test]
fn three_speeds_give_a_linear_law_and_a_finding() {
    let raw = recorded(&true_parameters(), &legs(&[4.0, 8.0, 12.0], true), &clean());
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    let text = finding(&found, Severity::Warning, "few-speeds");
    assert!(text.contains("3 speeds (4.000, 8.000, 12.000 m/min) are too few"), "{text}");
    assert!(text.contains("record at least 6 speeds"), "{text}");
    let friction = found.friction.expect("a law");
    assert_eq!(friction.law.law, FrictionLaw::Linear);
    let (level, slope) = friction.law.line().expect("a line");
    // Least squares through the law of model.md at the three speeds.
    let currents = [law(4.0), law(8.0), law(12.0)];
    let mean = currents.iter().sum::<f64>() / 3.0;
    let wanted_slope = (currents[2] - currents[0]) / 8.0;
    assert!((slope / wanted_slope - 1.0).abs() < 0.01, "{slope} against {wanted_slope}");
    assert!((level / (mean - 8.0 * wanted_slope) - 1.0).abs() < 0.01, "{level}");
    // The form of eq. 3 describes the same line.
    for v in [0.5, 4.0, 20.0] {
        assert!((friction.law.at(v) / (level + slope * v) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn six_close_speeds_do_not_give_a_law_of_four_parameters() {
    let raw = recorded(&true_parameters(), &legs(&[4.0, 5.0, 6.0, 7.0, 8.0, 9.0], true), &clean());
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    finding(&found, Severity::Warning, "few-speeds");
    assert_eq!(found.friction.map(|f| f.law.law), Some(FrictionLaw::Linear));
}

#[test]
fn one_speed_takes_the_regression() {
    let raw = recorded(&true_parameters(), &legs(&[6.0], true), &clean());
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    assert!(found.steady.levels.is_empty(), "{:?}", found.steady);
    let friction = found.friction.expect("a law");
    assert!((friction.law.at(6.0) / law(6.0) - 1.0).abs() < 0.1, "{}", friction.law.at(6.0));
    assert!(found.findings.iter().all(|finding| finding.code != "few-speeds"), "{:?}", found.findings);
}

#[test]
fn a_standstill_reports_missing_motion() {
    let raw = recorded(&true_parameters(), &[0.0; 400], &clean());
    let found = identified(&[raw], &initial_parameters("x"), &IdentificationOptions::default());
    finding(&found, Severity::Missing, "no-motion");
    assert!(found.friction.is_none() && found.inertia.is_none());
    // Parameters that are not identified keep the value of the machine file.
    assert_eq!(inertia_of(&found), 0.015);
}

#[test]
fn speeds_in_one_direction_are_reported() {
    let raw = recorded(&true_parameters(), &legs(&[1.0, 2.0, 4.0, 6.0, 8.0, 10.0], false), &clean());
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    let text = finding(&found, Severity::Warning, "one-direction");
    assert!(text.contains("record each speed in both directions"), "{text}");
}

#[test]
fn a_weight_that_one_direction_hides_is_in_the_interval_of_the_friction() {
    let heavy = with(true_parameters(), "x.gravity.weight_n", Value::Double(1500.0));
    let raw = recorded(&heavy, &legs(&[6.0], false), &clean());
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    let gravity = found.gravity.expect("a gravity");
    assert_eq!(gravity.model.constant, 0.0, "the weight is not significant");
    let friction = found.friction.expect("a law").law;
    let (value, error) = (friction.at(6.0), friction.error_at(6.0));
    assert!((value - law(6.0)).abs() <= 2.0 * error, "{value} ± {error} A, true {} A", law(6.0));
}

#[test]
fn one_direction_without_current_is_not_reported() {
    let mut raw = recorded(&true_parameters(), &legs(&[2.0, 6.0], false), &clean());
    raw.current = None;
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    finding(&found, Severity::Missing, "few-moves");
    assert!(found.findings.iter().all(|finding| finding.code != "one-direction"), "{:?}", found.findings);
}

#[test]
fn the_sign_of_a_current_in_one_direction_is_that_of_the_acceleration() {
    let mut raw = recorded(&true_parameters(), &legs(&[2.0, 6.0, 10.0], false), &clean());
    raw.current.iter_mut().flatten().for_each(|current| *current = -*current);
    let machine = initial_parameters("x").machine_config().expect("a machine");
    let axis = &machine.axes()[axis_index(&machine, "x")];
    let (_, findings) =
        condition(&raw, axis, &machine.periods(), &Conditioning::default()).expect("a recording");
    let text = &findings.iter().find(|finding| finding.code == "current-inverted").expect("a finding").what;
    assert!(text.contains("opposes the acceleration (-") && !text.contains("friction"), "{text}");
}

#[test]
fn one_move_is_singular() {
    let raw = recorded(&true_parameters(), &legs(&[6.0], false), &clean());
    let parameters = initial_parameters("x");
    let found = identified(&[raw], &parameters, &STEPS_ONLY);
    let values = found.values(&parameters, "x");
    let inertia = values.iter().find(|value| value.key == "x.motor.inertia_kg_m2").expect("an inertia");
    assert_eq!(inertia.source, "regression of the current (1 move)");
    for value in &values {
        let text = value.comment();
        assert_eq!(text.starts_with("identified"), value.is_significant, "{text}");
    }
}

#[test]
fn torque_constant_and_lead_that_nobody_stated_are_reported() {
    let raw = recorded(&true_parameters(), &legs(&[1.0, 2.0, 4.0, 6.0, 8.0, 10.0], true), &clean());
    let found = identified(std::slice::from_ref(&raw), &initial_parameters("x"), &STEPS_ONLY);
    assert!(found.findings.iter().all(|finding| finding.code != "unstated-scale"), "{:?}", found.findings);
    let stated = StatedValues { torque_constant: false, transmission: false, ..StatedValues::ALL };
    let options = IdentificationOptions { stated, ..STEPS_ONLY };
    let found = identified(&[raw], &initial_parameters("x"), &options);
    let text = finding(&found, Severity::Warning, "unstated-scale");
    let start = initial_parameters("x");
    let value = |key: &str| match start.get(key) {
        Some(Value::Double(value)) => value,
        other => panic!("{key}: {other:?}"),
    };
    let (constant, lead) = (value("x.motor.torque_constant_nm_a"), value("x.transmission.screw_lead_mm"));
    let expected = format!("the torque constant of {constant} N·m/A and the screw lead of {lead} mm");
    assert!(text.starts_with(&expected), "{text}");
}

#[test]
fn the_gear_ratio_that_nobody_stated_is_reported() {
    let sine: Vec<f64> = (0..800).map(|k| 0.5 * (1.0 - (k as f64 * TSP * 3.0).cos())).collect();
    let machine = machine_with_feedforward(&true_parameters(), "c", FeedforwardMode::Off);
    let raw = record(&machine, "c", &sine, &clean());
    let axis = &machine.axes()[axis_index(&machine, "c")];
    let signals = condition(&raw, axis, &machine.periods(), &Conditioning::default()).expect("plausible").0;
    let input = IdentificationInput { signals: &signals, feedforward: Some(FeedforwardMode::Off) };
    let stated = StatedValues { torque_constant: false, transmission: false, ..StatedValues::ALL };
    let options = IdentificationOptions { stated, ..STEPS_ONLY };
    let found = identify(&[input], axis, &machine.periods(), &options);
    let text = finding(&found, Severity::Warning, "unstated-scale");
    let ratio =
        format!("and the gear ratio of {} of the initial machine", Rounded(1.0 / axis.transmission_ratio));
    assert!(text.contains(&ratio) && !text.contains("weight, "), "{text}");
    // A constant current is no gravity of a rotary axis.
    assert!(found.gravity.is_none(), "{:?}", found.gravity);
}

#[test]
fn a_saturated_current_is_excluded_and_reported() {
    let weak = |parameters| with(parameters, "x.motor.max_current_a", Value::Double(4.0));
    let raw = recorded(&weak(true_parameters()), &legs(&[1.0, 2.0, 4.0, 8.0, 12.0, 16.0], true), &clean());
    let found = identified(&[raw], &weak(initial_parameters("x")), &STEPS_ONLY);
    let text = finding(&found, Severity::Warning, "saturated-current");
    assert!(text.contains("4.0 A") && text.contains("lower acceleration"), "{text}");
}

#[test]
fn a_recording_that_starts_in_motion_takes_the_joint_fit() {
    let whole = legs(&[1.0, 2.0, 4.0, 6.0, 8.0, 10.0], true);
    let mut raw = recorded(&true_parameters(), &whole, &clean());
    let psec = raw.psec.clone().expect("PSEC is recorded");
    // From a setpoint in motion to the last one in motion, without the rests between, which are shorter than
    // 0.1 s.
    let moving: Vec<usize> = (1..psec.len()).filter(|&k| psec[k] != psec[k - 1]).collect();
    let pick = |channel: &Option<Vec<f64>>| channel.as_ref().map(|c| moving.iter().map(|&k| c[k]).collect());
    (raw.psec, raw.position, raw.current) = (pick(&raw.psec), pick(&raw.position), pick(&raw.current));
    (raw.velocity_feedforward, raw.torque_feedforward) = (None, None);
    raw.time = (0..moving.len()).map(|k| k as f64 * TSP).collect();
    let found = identified(&[raw], &initial_parameters("x"), &IdentificationOptions::default());
    assert!(found.refinement.is_some() && !found.delays.is_empty());
    assert!(found.findings.iter().all(|finding| finding.code != "no-setpoints"), "{:?}", found.findings);
}

#[test]
fn friction_that_no_law_describes_is_reported() {
    let rough = Disturbance { friction: Some(|v| 0.6 * (2.5 * v).sin()), ..clean() };
    let raw = recorded(&true_parameters(), &legs(&[0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0], true), &rough);
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    finding(&found, Severity::Warning, "poor-friction-law");
}

#[test]
fn an_exponent_at_its_bound_is_reported() {
    // A law that is flat beyond 0.2 m/min: d would be far below its bound.
    let steep = with(
        with(true_parameters(), "x.friction.d", Value::Double(-60.0)),
        "x.friction.b",
        Value::Double(0.0),
    );
    let raw = recorded(&steep, &legs(&[0.02, 0.04, 0.06, 0.1, 0.5, 2.0, 5.0, 10.0], true), &clean());
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    let text = finding(&found, Severity::Warning, "at-bound");
    assert!(text.contains("friction.d"), "{text}");
}

#[test]
fn another_position_controller_is_reported() {
    let raw = recorded(&true_parameters(), &legs(&[1.0, 2.0, 4.0, 6.0, 8.0, 10.0], true), &clean());
    let start = with(initial_parameters("x"), "x.position_loop.controller", Value::Text("gpc".to_owned()));
    let found = identified(&[raw], &start, &IdentificationOptions::default());
    let text = finding(&found, Severity::Missing, "not-a-cascade");
    assert!(text.contains("controller=cascade"), "{text}");
    assert!(found.friction.is_some(), "the steps before do not need it");
}

#[test]
fn a_current_every_millisecond_gives_the_inertia_by_equation_5() {
    let psec = legs(&[1.0, 2.0, 4.0, 8.0, 12.0, 16.0], true);
    let raw = recorded(&true_parameters(), &psec, &Disturbance { sample_ticks: Some(8), ..clean() });
    let found = identified(&[raw], &initial_parameters("x"), &STEPS_ONLY);
    let inertia = found.inertia.expect("an inertia");
    println!("eq. 5 at 1 ms: {:.5} ± {:.5}", inertia.value, inertia.error);
    assert!((inertia.value / 0.028 - 1.0).abs() < 0.03, "{}", inertia.value);
}

#[test]
fn inertia_and_friction_are_identified_from_positions_only() {
    let psec = legs(&[0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0, 16.0], true);
    let mut raw = recorded(&true_parameters(), &psec, &clean());
    raw.current = None;
    let found = identified(&[raw], &initial_parameters("x"), &IdentificationOptions::default());
    finding(&found, Severity::Missing, "no-current");
    let inertia = inertia_of(&found);
    println!("inertia from positions {inertia:.5}");
    assert!((inertia / 0.028 - 1.0).abs() < 0.01, "{inertia}");
    let [a, b, c, d] = [
        RefinedParameter::FrictionA,
        RefinedParameter::FrictionB,
        RefinedParameter::FrictionC,
        RefinedParameter::FrictionD,
    ]
    .map(|parameter| parameter.get(found.axis()));
    for v in [0.5, 2.0, 8.0, 16.0] {
        let current = a * (b * v).exp() + c * (d * v).exp();
        println!("  {v} m/min: {current:.4} against {:.4} A", law(v));
        assert!((current / law(v) - 1.0).abs() < 0.1, "{current} at {v} m/min");
    }
}

#[test]
fn a_breakaway_above_the_law_is_identified_as_separate_parameter() {
    let sticky = with(true_parameters(), "x.friction.i0", Value::Double(1.4));
    let psec = legs(&[0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0], true);
    let raw = recorded(&sticky, &psec, &Disturbance::usual(virtual_axes_core::config::AxisKind::Linear, 5));
    let options = IdentificationOptions {
        i0: Breakaway::Freed,
        refine: RefinementScope::ALL,
        presliding: false,
        stated: StatedValues::ALL,
    };
    let found = identified(&[raw], &initial_parameters("x"), &options);
    let i0 = RefinedParameter::Breakaway.get(found.axis());
    println!("i0 {i0:.4} A");
    assert!((i0 / 1.4 - 1.0).abs() < 0.03, "{i0}");
}

#[test]
fn stalls_jitter_and_gaps_do_not_reduce_accuracy() {
    let machine = true_parameters().machine_config().expect("a machine");
    let campaign =
        Campaign::plan(&machine, 0, &[FeedforwardMode::Off], &Limits { range: None, max_feed: Some(0.2) })
            .expect("a campaign");
    let bad = Disturbance {
        sample_ticks: Some(8),
        jitter: 5e-5,
        stalls: vec![20.0..20.05, 41.0..41.2],
        gaps: vec![30.0..30.5],
        current_lag: 3e-3,
        ..Disturbance::usual(virtual_axes_core::config::AxisKind::Linear, 6)
    };
    let raw = recorded(&true_parameters(), campaign.psec(), &bad);
    let found = identified(&[raw], &initial_parameters("x"), &IdentificationOptions::default());
    let inertia = inertia_of(&found);
    println!("inertia {inertia:.5}, {} spans", found.agreements[0].experiments.len());
    assert!((inertia / 0.028 - 1.0).abs() < 0.01, "{inertia}");
    assert!(found.agreements[0].experiments.len() >= 2, "the gap parts the recording");
}

#[test]
fn parts_in_one_recording_are_split_by_their_feedforward() {
    let parameters = true_parameters();
    let machine = parameters.machine_config().expect("a machine");
    let axis = &machine.axes()[0];
    let short = legs(&[1.0, 2.0, 4.0, 6.0, 8.0, 10.0], true);
    let mut all: Option<RawRecording> = None;
    for mode in FeedforwardMode::ALL {
        let raw = record(&machine_with_feedforward(&parameters, "x", mode), "x", &short, &clean());
        all = Some(match all {
            None => raw,
            Some(mut all) => {
                let offset = all.time.last().expect("samples") + TSP;
                all.time.extend(raw.time.iter().map(|t| t + offset));
                let join = |a: &mut Option<Vec<f64>>, b: Option<Vec<f64>>| {
                    a.iter_mut().zip(b).for_each(|(a, b)| a.extend(b));
                };
                join(&mut all.psec, raw.psec);
                join(&mut all.position, raw.position);
                join(&mut all.current, raw.current);
                join(&mut all.velocity_feedforward, raw.velocity_feedforward);
                join(&mut all.torque_feedforward, raw.torque_feedforward);
                all
            }
        });
    }
    let all = all.expect("three parts");
    let (signals, _) =
        condition(&all, axis, &machine.periods(), &Conditioning::default()).expect("a recording");
    let parts = virtual_axes_identify::identify::find_experiments(
        &signals,
        0,
        axis,
        &machine.periods(),
        FeedforwardMode::Both,
    );
    let modes: Vec<FeedforwardMode> = parts.iter().map(|part| part.mode).collect();
    assert_eq!(modes, FeedforwardMode::ALL);
}

#[test]
fn only_selected_parameters_are_refined() {
    let psec = legs(&[0.5, 1.0, 2.0, 4.0, 8.0, 12.0], true);
    let raw = recorded(&true_parameters(), &psec, &clean());
    let chosen = RefinementScope { inertia: true, ..RefinementScope::NONE };
    let found = identified(
        &[raw],
        &initial_parameters("x"),
        &IdentificationOptions {
            i0: Breakaway::Held,
            refine: chosen,
            presliding: false,
            stated: StatedValues::ALL,
        },
    );
    let refinement = found.refinement.as_ref().expect("a refinement");
    let moved: Vec<RefinedParameter> =
        refinement.parameters.iter().map(|refined| refined.parameter).collect();
    assert_eq!(moved, [RefinedParameter::Inertia]);
    assert!((inertia_of(&found) / 0.028 - 1.0).abs() < 0.01);
    let law = &found.friction.as_ref().expect("a law").law.config;
    assert_eq!(RefinedParameter::FrictionA.get(found.axis()), law.a, "as the step found it");
}
