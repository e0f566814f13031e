//! Identification of hidden axes from production traces.

use virtual_axes_identify::identify::{
    Agreement, FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, RefinementScope,
    identify,
};
use virtual_axes_identify::recording::{Conditioning, PsecShift, RawRecording, Signals, condition};
use virtual_axes_verification::production_traces::{
    AxisGuess, AxisOrientation, HiddenAxis, StudyFigures, TraceRecorder, TraceStudy,
};

const ORIENTATIONS: [AxisOrientation; 2] = [AxisOrientation::Horizontal, AxisOrientation::Vertical];
/// Duration of a program, s.
const DURATION: f64 = 15.0;

/// Returns orientation and figures of the axes of some seeds.
fn studied(
    seeds: std::ops::Range<u64>,
    backlash: f64,
    stribeck: f64,
) -> Vec<(AxisOrientation, String, StudyFigures)> {
    let mut study = TraceStudy::new(DURATION, backlash, stribeck);
    let all = seeds.flat_map(|seed| ORIENTATIONS.map(|orientation| (seed, orientation)));
    all.map(|(seed, orientation)| {
        let case = study.add(seed, orientation);
        println!("{case}");
        let figures = case.figures.clone().unwrap_or_else(|reason| panic!("{}: {reason}", case.name));
        (orientation, case.to_string(), figures)
    })
    .collect()
}

#[test]
fn axes_are_identified_and_an_unseen_program_is_predicted() {
    for (orientation, case, found) in studied(6000..6003, 0.0, 0.0) {
        assert!(found.inertia[0].abs() <= 0.03, "{case}");
        assert!(found.alpha <= 1.0, "{case}");
        assert!(!found.is_period_known || found.beta[0].abs() <= 1.5e-3, "{case}");
        // Without weight the first figure is a current.
        let is_close = orientation == AxisOrientation::Vertical && found.weight[0].abs() <= 0.03;
        assert!(is_close || found.weight[1].abs() <= 3.0, "{case}");
        assert!(found.unseen[0] <= 12e-6, "{case}");
        assert!(found.r_squared >= 0.98, "{case}");
        assert!(found.invalid.is_empty() && !found.has_backlash, "{case}");
    }
}

#[test]
fn backlash_is_found_and_the_prediction_remains_close() {
    let all = studied(6000..6002, 5e-6, 0.1);
    for (_, case, found) in &all {
        assert!(found.unseen[0] <= 20e-6, "{case}");
        assert!(found.invalid.is_empty(), "{case}");
    }
    assert!(2 * all.iter().filter(|(_, _, found)| found.has_backlash).count() >= all.len());
}

fn recorded(axis: &HiddenAxis, recorder: &TraceRecorder, program: u64) -> RawRecording {
    let program = axis.program(program, DURATION).expect("a program");
    axis.record(&program, recorder, 1).expect("a recording")
}

fn conditioned(raw: &RawRecording, guess: &AxisGuess, options: &Conditioning) -> Signals {
    condition(raw, &guess.config, &guess.periods, options).expect("plausible").0
}

fn identified(signals: &Signals, guess: &AxisGuess, refine: RefinementScope) -> Identification {
    let input = IdentificationInput { signals, feedforward: Some(FeedforwardMode::Both) };
    let options = IdentificationOptions { refine, ..IdentificationOptions::default() };
    identify(&[input], &guess.config, &guess.periods, &options)
}

/// Returns the RMS difference between simulated and recorded position, m.
fn residual(found: &Identification) -> f64 {
    let model = |agreement: &Agreement| agreement.baseline.map(|baseline| baseline.model);
    found.agreements.first().and_then(model).expect("a simulation")
}

#[test]
fn two_programs_of_one_axis_agree() {
    let axis = HiddenAxis::draw(6004, AxisOrientation::Vertical);
    let guess = axis.guess(6004);
    let [first, second] = [1, 2].map(|program| {
        let signals = conditioned(
            &recorded(&axis, &TraceRecorder::default(), program),
            &guess,
            &Conditioning::default(),
        );
        let found = identified(&signals, &guess, RefinementScope::NONE);
        let inertia = found.inertia.expect("an inertia");
        let gravity = found.gravity.expect("a gravity");
        [(inertia.value, inertia.error), (gravity.current.constant, gravity.error.constant)]
    });
    for ((a, a_error), (b, b_error)) in first.into_iter().zip(second) {
        let deviation = (a - b).abs() / a_error.hypot(b_error);
        assert!(deviation > 0.0 && deviation <= 3.0, "{a} ± {a_error}, {b} ± {b_error}");
    }
}

#[test]
fn a_filter_that_psec_has_not_passed_is_simulated() {
    let axis = HiddenAxis::draw(6005, AxisOrientation::Horizontal);
    let guess = axis.guess(6005);
    let filtered = TraceRecorder { gap_probability: 0.0, ..TraceRecorder::default() };
    let unfiltered = TraceRecorder { cutoff: 0.0, ..filtered.clone() };
    let raw = RawRecording { psec: recorded(&axis, &unfiltered, 1).psec, ..recorded(&axis, &filtered, 1) };
    let [without, with] = [None, Some(filtered.cutoff)].map(|trace_filter| {
        let signals = conditioned(&raw, &guess, &Conditioning { trace_filter, ..Conditioning::default() });
        identified(&signals, &guess, RefinementScope { gain: false, ..RefinementScope::ALL })
    });
    let (without_rms, with_rms) = (residual(&without), residual(&with));
    // Without it the delay of the filter is no whole number of position cycles.
    let between = |found: &Identification| found.findings.iter().any(|f| f.code == "lag-between-cycles");
    assert!(between(&without) && !between(&with), "{with_rms} m, without {without_rms} m");
    assert!(with_rms <= 12e-6, "{with_rms} m");
    // The filter delays by √2 / (2π · cutoff), which must not be counted as α.
    let alpha = |found: &Identification| found.axis().delays.alpha as f64 * 1e-9;
    let cycle = axis.periods.position as f64 * 1e-9;
    assert!((alpha(&with) - axis.lag()).abs() <= cycle, "{} s, {} s", alpha(&with), axis.lag());
}

#[test]
fn a_delayed_psec_is_moved_forward() {
    const DELAY: f64 = 0.1;
    let axis = HiddenAxis::draw(6005, AxisOrientation::Horizontal);
    let guess = axis.guess(6005);
    let ideal = TraceRecorder::ideal();
    let mut raw = recorded(&axis, &ideal, 1);
    let samples = (DELAY / (ideal.period as f64 * 1e-9)).round() as usize;
    let psec = raw.psec.as_mut().expect("recorded");
    let first = psec[0];
    psec.truncate(psec.len() - samples);
    psec.splice(0..0, std::iter::repeat_n(first, samples));
    let with = |psec_shift| {
        let options = Conditioning { psec_shift, ..Conditioning::default() };
        condition(&raw, &guess.config, &guess.periods, &options)
    };
    assert!(with(PsecShift::None).expect_err("PSEC lags").to_string().contains("PSEC"));
    // The position lags by less than PSEC.
    let lead = DELAY - axis.lag();
    for (shift, tolerance) in [(PsecShift::Auto, 1e-3), (PsecShift::By(lead), 0.0051e-3)] {
        let (_, findings) = with(shift).expect("moved");
        let found = findings.iter().find(|finding| finding.code == "psec-shifted").expect("a finding");
        let text = found.what.strip_prefix("x: PSEC is moved forward by ").expect("a time");
        let by: f64 = text.split(' ').next().and_then(|text| text.parse().ok()).expect("a time");
        assert!((1e-3 * by - lead).abs() <= tolerance, "{shift:?}: {by} ms, wanted {lead} s");
    }
}

#[test]
fn a_lag_between_two_position_cycles_is_represented() {
    let axis = HiddenAxis::draw(6001, AxisOrientation::Vertical);
    let guess = axis.guess(6001);
    // All position cycles are whole milliseconds.
    let options = Conditioning { psec_shift: PsecShift::By(0.4e-3), ..Conditioning::default() };
    let signals = conditioned(&recorded(&axis, &TraceRecorder::default(), 1), &guess, &options);
    let found = identified(&signals, &guess, RefinementScope::ALL);
    assert!(residual(&found) <= 12e-6, "{} m", residual(&found));
    assert!(found.findings.iter().any(|finding| finding.code == "lag-between-cycles"));
}

#[test]
fn a_position_cycle_that_is_longer_than_the_motion_allows_is_replaced() {
    // β + Tsp of the hidden axis is less than the position cycle of the machine file, which divides the lag.
    let millisecond = 1_000_000;
    let is_suitable = |seed: &u64| {
        let axis = HiddenAxis::draw(*seed, AxisOrientation::Horizontal);
        let (guess, lag) = (axis.guess(*seed), (axis.lag() * 1e3).round() as i64);
        let file = guess.periods.position;
        let seen = axis.config.delays.beta + axis.periods.position;
        !guess.is_period_known
            && axis.periods.position < file
            && seen < file - millisecond
            && lag % (file / millisecond) == 0
    };
    let seed = (6000..7000).find(is_suitable).expect("a suitable axis");
    let axis = HiddenAxis::draw(seed, AxisOrientation::Horizontal);
    let guess = axis.guess(seed);
    let signals =
        conditioned(&recorded(&axis, &TraceRecorder::default(), 1), &guess, &Conditioning::default());
    let found = identified(&signals, &guess, RefinementScope::ALL);
    let periods = found.periods.expect("periods");
    assert!(periods.position < guess.periods.position, "seed {seed}: {periods:?}");
    assert!(residual(&found) <= 3e-6, "seed {seed}: {} m", residual(&found));
}

#[test]
fn the_sign_of_the_current_is_found_also_from_moves_that_are_shorter_than_the_filter() {
    // The first two have hardly any samples in motion that the filter leaves apart from standstill.
    let others = (6100..6115).map(|seed| (seed, 2 * seed + 1));
    for (seed, program) in [(5096, 10_193), (5022, 10_046)].into_iter().chain(others) {
        let axis = HiddenAxis::draw(seed, AxisOrientation::Horizontal);
        let guess = axis.guess(seed);
        let program = axis.program(program, 20.0).expect("a program");
        let raw = axis.record(&program, &TraceRecorder::default(), 7 * seed + 1).expect("a recording");
        let (_, findings) =
            condition(&raw, &guess.config, &guess.periods, &Conditioning::default()).expect("plausible");
        let is_inverted = findings.iter().any(|finding| finding.code == "current-inverted");
        assert_eq!(is_inverted, axis.is_current_inverted, "seed {seed}");
    }
}
