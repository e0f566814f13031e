//! Identification of hidden axes from production traces.

use virtual_axes_core::config::Periods;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_identify::identify::{
    Agreement, FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, RefinementScope,
    identify, validate,
};
use virtual_axes_identify::recording::{Conditioning, PsecShift, RawRecording, Severity, Signals, condition};
use virtual_axes_verification::production_traces::{AxisGuess, AxisOrientation, HiddenAxis, TraceRecorder};

const ORIENTATIONS: [AxisOrientation; 2] = [AxisOrientation::Horizontal, AxisOrientation::Vertical];
/// Duration of a program, s.
const DURATION: f64 = 15.0;

/// Errors of the values identified from one trace, checked with an unseen program.
#[derive(Debug)]
struct StudyFigures {
    orientation: AxisOrientation,
    /// Relative error of Jeq / Kt, and its standard error.
    inertia: [f64; 2],
    /// Error of α beyond its interval, position cycles of the hidden axis.
    alpha: f64,
    /// Error of β, s; none if the machine file has another position cycle.
    beta: Option<f64>,
    /// Error of W / Kt: relative (absolute in A without weight), and in standard errors.
    weight: [f64; 2],
    /// RMS position residual of the unseen program, m.
    unseen: f64,
    /// R² of the current of the unseen program, by inverse dynamics.
    r_squared: f64,
    /// True if no result is invalid.
    is_valid: bool,
    has_backlash: bool,
}

/// Identifies the axes of some seeds, with backlash, m, and Stribeck friction, A.
fn studied(seeds: std::ops::Range<u64>, backlash: f64, stribeck: f64) -> Vec<StudyFigures> {
    let all = seeds.flat_map(|seed| ORIENTATIONS.map(|orientation| (seed, orientation)));
    all.map(|(seed, orientation)| {
        let hidden = HiddenAxis { backlash, stribeck, ..HiddenAxis::draw(seed, orientation) };
        study(&hidden, seed, orientation)
    })
    .collect()
}

fn study(hidden: &HiddenAxis, seed: u64, orientation: AxisOrientation) -> StudyFigures {
    let guess = hidden.guess(seed);
    let signals = |number: u64| {
        let program = hidden.program(number, DURATION).expect("a program");
        let raw = hidden.record(&program, &TraceRecorder::default(), 7 * seed + 1).expect("a recording");
        conditioned(&raw, &guess, &Conditioning::default())
    };
    let (seen, unseen) = (signals(2 * seed + 1), signals(2 * seed + 2));
    let found = identified(&seen, &guess, RefinementScope::ALL);
    let input = IdentificationInput { signals: &unseen, feedforward: Some(FeedforwardMode::Both) };
    let agreement =
        validate(&input, found.axis(), &found.periods.unwrap_or(guess.periods)).expect("simulated");
    let (truth, kt) = (&hidden.config, guess.config.motor.torque_constant);
    let inertia = found.inertia.as_ref().expect("an inertia");
    let true_inertia = truth.motor.inertia / truth.motor.torque_constant * kt;
    let inertia = [inertia.value / true_inertia - 1.0, inertia.error / true_inertia];
    let gravity = found.gravity.as_ref().expect("a gravity");
    let holding = truth.gravity.weight / truth.motor.torque_constant * truth.transmission_ratio;
    let off = gravity.current.constant - holding;
    let alpha = found.delays.iter().find(|fit| fit.delay.name() == "alpha").expect("a delay");
    // A motion shows β + Tsp, and several position cycles explain it alike.
    let shown = |delay: Nanoseconds, periods: &Periods| seconds(delay + periods.position);
    let beta = shown(found.axis().delays.beta, &found.periods.unwrap_or(guess.periods))
        - shown(truth.delays.beta, &hidden.periods);
    StudyFigures {
        orientation,
        inertia,
        alpha: (hidden.lag() - seconds(alpha.interval.1)).abs() / seconds(hidden.periods.position),
        beta: guess.is_period_known.then_some(beta),
        weight: [if holding == 0.0 { off } else { off / holding }, off / gravity.error.constant],
        unseen: agreement.baseline.expect("a simulation").model,
        r_squared: agreement.inverse.expect("a current").r_squared,
        is_valid: found.findings.iter().all(|finding| finding.severity != Severity::Invalid),
        has_backlash: found.findings.iter().any(|finding| finding.code == "backlash"),
    }
}

#[test]
fn axes_are_identified_and_an_unseen_program_is_predicted() {
    for found in studied(6000..6003, 0.0, 0.0) {
        // A current that is logged once in each position cycle leaves a wide interval, which contains the truth.
        let [off, error] = found.inertia;
        assert!(off.abs() <= 0.03 || off.abs() <= 2.0 * error && error <= 0.03, "{found:?}");
        assert!(found.alpha <= 1.0, "{found:?}");
        assert!(found.beta.is_none_or(|error| error.abs() <= 1.5e-3), "{found:?}");
        // Without weight the first figure is a current.
        let is_close = found.orientation == AxisOrientation::Vertical && found.weight[0].abs() <= 0.03;
        assert!(is_close || found.weight[1].abs() <= 3.0, "{found:?}");
        assert!(found.unseen <= 12e-6, "{found:?}");
        assert!(found.r_squared >= 0.98, "{found:?}");
        assert!(found.is_valid && !found.has_backlash, "{found:?}");
    }
}

#[test]
fn backlash_is_found_and_the_prediction_remains_close() {
    let all = studied(6000..6002, 5e-6, 0.1);
    for found in &all {
        assert!(found.unseen <= 20e-6 && found.is_valid, "{found:?}");
    }
    assert!(2 * all.iter().filter(|found| found.has_backlash).count() >= all.len());
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
fn a_position_that_is_logged_after_the_setpoint_is_represented() {
    // The encoder is read 0.12 ms behind the stamp: less than a position cycle, but 30 µm at 15 m/min.
    let axis = HiddenAxis::draw(6002, AxisOrientation::Horizontal);
    let guess = axis.guess(6002);
    let recorder = TraceRecorder { period: 2_000_000, cutoff: 0.0, ..TraceRecorder::ideal() };
    let raw = recorded(&axis, &recorder, 1);
    let position = raw.position.as_ref().expect("recorded");
    let next = position.iter().skip(1).chain(position.last());
    let later: Vec<f64> = position.iter().zip(next).map(|(a, b)| a + 0.06 * (b - a)).collect();
    let raw = RawRecording { position: Some(later), velocity: None, ..raw };
    let signals = conditioned(&raw, &guess, &Conditioning::default());
    let found = identified(&signals, &guess, RefinementScope::ALL);
    assert!(residual(&found) <= 3e-6, "{} m", residual(&found));
    let gain = found.axis().position_loop.gain / axis.config.position_loop.gain;
    assert!((gain - 1.0).abs() <= 0.03, "{gain}");
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
