//! Identification from production traces: recordings that are sampled more coarsely than the position cycle, usually with
//! feedforward active and with few phases of constant velocity.
//!
//! 1. Inertia, friction and gravity by regression of the current over all samples in motion.
//! 2. Delays, gains and torque feedforward jointly from the positions, on the closed loop.
//! 3. Checks: results that are worse than a constant lag, or implausibly far from the machine file, are invalid.

use super::delays::{DelayFit, DelayParameter};
use super::feedforward_mode::FeedforwardMode;
use super::gravity::{GravityCurrent, GravityFit};
use super::identification::Identification;
use super::loop_fit::{LoopFit, LoopProblem};
use super::loop_parameter::LoopParameter;
use super::options::{IdentificationInput, RefinementScope};
use super::plant_regression::{PlantRegression, fit_plant_by_regression};
use super::refine::{RefinedParameter, RefinedValue, Refinement};
use super::resample::interpolation_error;
use super::setpoints::stride;
use super::validate::constant_lag;
use crate::recording::{Finding, Signals};
use virtual_axes_core::config::{AxisConfig, AxisKind, Periods, PositionControllerConfig};
use virtual_axes_core::statistics::mean;
use virtual_axes_core::units::{
    DEGREE, MICROSECOND_NS, MILLISECOND, Nanoseconds, POSITION_GAIN, Rounded, seconds,
};

/// Travel of an axis that moves, m or rad.
const SHORTEST_TRAVEL: f64 = 1e-3;
/// Standard errors of a significant gravity.
const SIGNIFICANT: f64 = 3.0;
/// Gravity relative to friction below which it is neglected.
const RELEVANT: f64 = 0.02;
/// Relative change of the gain from which that of the machine file does not fit.
const GAIN_CHANGE: f64 = 0.15;
/// Ratio of the residuals with and without feedforward from which the smaller one is certain.
const CLEAR: f64 = 1.5;
/// Standard errors of a delay within its interval.
const INTERVAL: f64 = 2.0;

/// Returns true if the recordings can be identified as production traces only: with PSEC, but at a sampling period that
/// is no integer fraction of the position cycle.
pub fn are_production_traces(
    inputs: &[IdentificationInput<'_>],
    axis: &AxisConfig,
    periods: &Periods,
) -> bool {
    let tsp = seconds(periods.position);
    let is_coarse = |signals: &Signals| stride(signals.period, tsp).is_none();
    let with_psec = |signals: &Signals| signals.spans.iter().any(|span| span.psec.is_some());
    !inputs.is_empty()
        && axis.position_loop.controller == PositionControllerConfig::Cascade
        && inputs.iter().all(|input| is_coarse(input.signals) && with_psec(input.signals))
}

/// Identifies plant and loop; `found` contains the machine file and receives the results.
pub(super) fn identify_production(
    inputs: &[IdentificationInput<'_>],
    periods: &Periods,
    scope: RefinementScope,
    found: &mut Identification,
) {
    if !inputs.iter().any(|input| moves(input.signals)) {
        found.findings.push(Finding::missing(
            "no-motion",
            "the axis does not move in these recordings",
            "record a program with moves in both directions",
        ));
        return;
    }
    report_interpolation(inputs, found);
    let signals: Vec<&Signals> = inputs.iter().map(|input| input.signals).collect();
    match fit_plant_by_regression(&signals, &found.axis) {
        Some(plant) => apply_plant(plant, found),
        None => found.findings.push(Finding::missing(
            "few-moves",
            match signals.iter().any(|signals| signals.spans.iter().any(|span| span.current.is_some())) {
                true => "no inertia, friction and gravity: the recordings have less than four moves with current",
                false => "no inertia, friction and gravity: no recording has a current; those of the machine file are used",
            },
            "record the current of a program with moves in both directions",
        )),
    }
    if scope == RefinementScope::NONE {
        return;
    }
    let given = |mode: FeedforwardMode| -> Vec<(&Signals, FeedforwardMode)> {
        inputs.iter().map(|input| (input.signals, input.feedforward.unwrap_or(mode))).collect()
    };
    let active = match found.axis.feedforward.torque != 0.0 {
        true => FeedforwardMode::Both,
        false => FeedforwardMode::Velocity,
    };
    let mut best = fit_loop(&given(active), periods, scope, &found.axis).map(|fit| (active, fit));
    let is_inferred = inputs.iter().any(|input| input.feedforward.is_none());
    if is_inferred {
        let without = fit_loop(&given(FeedforwardMode::Off), periods, scope, &found.axis);
        best = infer_feedforward(best, without.map(|fit| (FeedforwardMode::Off, fit)), found);
    }
    match best {
        Some((mode, fit)) => {
            found.inferred_feedforward = is_inferred.then_some(mode);
            apply_loop(&fit, found);
        }
        None => found.findings.push(Finding::missing(
            "no-loop",
            "no delays and gains: the closed loop cannot be simulated near the recorded motion",
            "check lead, gains and periods of the machine file; inertia, friction and gravity are those of the current alone",
        )),
    }
}

/// Fits the loop, starting from the mean constant lag.
fn fit_loop(
    recordings: &[(&Signals, FeedforwardMode)],
    periods: &Periods,
    scope: RefinementScope,
    axis: &AxisConfig,
) -> Option<LoopFit> {
    let starts = recordings.iter().filter_map(|(signals, mode)| {
        let (lag, _) = constant_lag(signals)?;
        // Without feedforward the axis lags by 1 / Kp in addition.
        let off = *mode == FeedforwardMode::Off;
        Some(if off { (lag - 1.0 / axis.position_loop.gain).max(0.0) } else { lag })
    });
    let lag = mean(&starts.collect::<Vec<f64>>())?;
    LoopProblem { recordings, fits_gain: scope.gain, given_gain: axis.position_loop.gain }
        .fit(axis, periods, lag)
}

/// Returns the fit with or without feedforward, whichever leaves the smaller residual, and reports it.
fn infer_feedforward(
    with: Option<(FeedforwardMode, LoopFit)>,
    without: Option<(FeedforwardMode, LoopFit)>,
    found: &mut Identification,
) -> Option<(FeedforwardMode, LoopFit)> {
    let (Some((mode, with)), Some((off, without))) = (with.clone(), without.clone()) else {
        return with.or(without);
    };
    let (unit, name) = position_unit(&found.axis);
    let residuals = format!(
        "{:.1} {name} RMS with feedforward, {:.1} {name} without",
        with.rms / unit,
        without.rms / unit
    );
    if with.rms.max(without.rms) < CLEAR * with.rms.min(without.rms) {
        found.findings.push(Finding::invalid(
            "feedforward-unknown",
            format!("the motion does not show whether feedforward was active: {residuals}"),
            "give --feedforward off, velocity or both",
        ));
    }
    let (mode, fit) = if with.rms <= without.rms { (mode, with) } else { (off, without) };
    found.findings.push(Finding::note(
        "feedforward-inferred",
        format!("feedforward {} is assumed: {residuals}", mode.name()),
    ));
    Some((mode, fit))
}

/// Returns true if the position covers more than some encoder increments.
fn moves(signals: &Signals) -> bool {
    let positions = signals.spans.iter().flat_map(|span| span.position.iter().copied());
    let (low, high) = positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    high - low > SHORTEST_TRAVEL
}

/// Reports the error of the interpolated setpoints.
fn report_interpolation(inputs: &[IdentificationInput<'_>], found: &mut Identification) {
    let (unit, name) = position_unit(&found.axis);
    for input in inputs {
        let psec = input.signals.spans.iter().filter_map(|span| span.psec.as_deref());
        let error = psec.map(interpolation_error).fold(0.0, f64::max);
        found.findings.push(Finding::note(
            "resampled",
            format!(
                "{}: sampled every {} ms, PSEC is interpolated at the position cycles, with an error of at most about {:.1} {name} RMS",
                input.signals.name,
                Rounded(input.signals.period / MILLISECOND),
                error / unit
            ),
        ));
    }
}

fn position_unit(axis: &AxisConfig) -> (f64, &'static str) {
    match axis.kind() {
        AxisKind::Linear => (1e-6, "µm"),
        AxisKind::Rotary => (1e-3 * DEGREE, "mdeg"),
    }
}

/// Sets inertia, friction and gravity by the regression.
fn apply_plant(plant: PlantRegression, found: &mut Identification) {
    for (a, b, rho) in &plant.collinear {
        found.findings.push(Finding::note(
            "correlated",
            format!(
                "{a} and {b} are strongly correlated ({rho:.3}): only their combination is identified well"
            ),
        ));
    }
    let axis = &mut found.axis;
    axis.motor.inertia = plant.inertia.value;
    axis.friction = plant.friction.law.config;
    let gravity = significant_gravity(plant.gravity, &plant.friction.law.config);
    if let (Some((weight, _)), AxisKind::Linear) = (gravity.weight, axis.kind()) {
        axis.gravity.weight = if gravity.model == GravityCurrent::default() { 0.0 } else { weight };
    }
    if axis.kind() == AxisKind::Rotary {
        let what = format!(
            "gravity.tilt_nm {} and gravity.tilt_phase_deg {} are those of the machine file: gravity of a rotary axis is \
             identified from a campaign only",
            Rounded(axis.gravity.tilt),
            Rounded(axis.gravity.phase / DEGREE)
        );
        found.findings.push(Finding::note("gravity-kept", what));
    }
    found.gravity = Some(gravity);
    found.inertia = Some(plant.inertia);
    found.friction = Some(plant.friction);
}

/// Sets a gravity that the data cannot tell from zero to zero.
fn significant_gravity(
    mut gravity: GravityFit,
    friction: &virtual_axes_core::config::FrictionConfig,
) -> GravityFit {
    let (value, error) = (gravity.current.constant.abs(), gravity.error.constant);
    if value < SIGNIFICANT * error || value < RELEVANT * (friction.a + friction.c).abs() {
        gravity.model = GravityCurrent::default();
    }
    gravity
}

/// Sets delays, gains and weights by the closed loop.
fn apply_loop(fit: &LoopFit, found: &mut Identification) {
    let before = found.axis.clone();
    found.axis = fit.axis.clone();
    let of = |parameter: LoopParameter| fit.values.iter().find(|value| value.parameter == parameter);
    let tsp = seconds(fit.periods.position);
    if let Some(lag) = of(LoopParameter::Lag) {
        let cycles = (lag.value / tsp).round();
        found.delays.push(delay(DelayParameter::Alpha, (cycles - 1.0) * tsp, cycles * tsp, fit));
    }
    for (parameter, which) in
        [(LoopParameter::Beta, DelayParameter::Beta), (LoopParameter::Gamma, DelayParameter::Gamma)]
    {
        if let Some(value) = of(parameter) {
            let half = INTERVAL * value.error;
            found.delays.push(delay(which, value.value - half, value.value + half, fit));
        }
    }
    let inertia = fit.axis.motor.inertia;
    let refined = [
        (LoopParameter::Gain, RefinedParameter::PositionGain, 1.0),
        (LoopParameter::Bandwidth, RefinedParameter::VelocityGain, inertia),
        (LoopParameter::IntegralTime, RefinedParameter::VelocityIntegralTime, 1.0),
        (LoopParameter::TorqueRatio, RefinedParameter::TorqueFeedforward, inertia),
    ];
    let weight = RefinedParameter::VelocityFeedforward;
    let changed = of(LoopParameter::Lag).filter(|_| weight.get(&before) != weight.get(&fit.axis));
    let changed = changed.map(|lag| RefinedValue {
        parameter: weight,
        before: weight.get(&before),
        value: weight.get(&fit.axis),
        error: lag.error * fit.axis.position_loop.gain,
        is_at_bound: false,
    });
    if let Some(value) = changed {
        found.findings.push(Finding::warning(
            "lag-between-cycles",
            format!(
                "the lag of {:.2} ms at constant velocity is no whole number of position cycles of {} ms: feedforward.velocity \
                 {:.4} in place of {} represents the rest",
                of(LoopParameter::Lag).map_or(f64::NAN, |lag| lag.value / MILLISECOND),
                Rounded(tsp / MILLISECOND),
                value.value,
                Rounded(value.before)
            ),
            "check periods.position_ms, and the weight in the machine data of the control",
        ));
    }
    let parameters: Vec<RefinedValue> = refined
        .into_iter()
        .filter_map(|(parameter, refined, scale)| {
            let value = of(parameter)?;
            Some(RefinedValue {
                parameter: refined,
                before: refined.get(&before),
                value: refined.get(&fit.axis),
                error: value.error * scale,
                is_at_bound: false,
            })
        })
        .chain(changed)
        .collect();
    let identity = |j: usize| (0..parameters.len()).map(|k| f64::from(u8::from(j == k))).collect();
    found.refinement = Some(Refinement {
        axis: fit.axis.clone(),
        correlations: (0..parameters.len()).map(identity).collect(),
        parameters,
        position: (fit.rms_with_given_gain.unwrap_or(fit.rms), fit.rms),
        current: None,
    });
    found.periods = Some(fit.periods);
    report_loop(fit, &before, found);
}

fn delay(delay: DelayParameter, low: f64, high: f64, fit: &LoopFit) -> DelayFit {
    let value = delay.of(&fit.axis.delays);
    DelayFit {
        delay,
        interval: (nanoseconds(low.max(0.0)), nanoseconds(high)),
        value,
        is_at_end: false,
        is_unchanged: false,
        is_joint: true,
        profile: vec![(value, fit.rms)],
    }
}

fn nanoseconds(time: f64) -> Nanoseconds {
    // A microsecond is less than the uncertainty of any delay.
    (time * 1e6).round() as Nanoseconds * MICROSECOND_NS
}

/// Reports the position cycle, the valley of VFFW and α, and a gain that does not fit.
fn report_loop(fit: &LoopFit, before: &AxisConfig, found: &mut Identification) {
    let tsp = seconds(fit.periods.position) / MILLISECOND;
    let is_fitted = |parameter| fit.values.iter().any(|value| value.parameter == parameter);
    found.findings.push(match is_fitted(LoopParameter::Beta) {
        true => Finding::note(
            "position-cycle",
            format!(
                "β and γ are counted with a position cycle of {} ms: a trace shows the sum of β and the cycle, so that β of \
                 a control with another cycle is shorter or longer by the difference",
                Rounded(tsp)
            ),
        ),
        false => Finding::note(
            "unseen-delay",
            "VFFW, TFFW, β and γ are unchanged: no recording with feedforward shows them",
        ),
    });
    if let Some([low, high]) = fit.valley {
        found.findings.push(Finding::note(
            "valley",
            format!(
                "VFFW and α compensate each other: from VFFW {:.4} with {:.3} ms to VFFW {:.4} with {:.3} ms the residual hardly \
                 changes; VFFW is kept at {}",
                low.0,
                low.1 / MILLISECOND,
                high.0,
                high.1 / MILLISECOND,
                Rounded(fit.axis.feedforward.velocity)
            ),
        ));
    }
    let Some(with_given) = fit.rms_with_given_gain else { return };
    let (given, gain) = (before.position_loop.gain, fit.axis.position_loop.gain);
    let (unit, name) = position_unit(&fit.axis);
    let what = format!(
        "position_loop.gain {:.3} of the machine file leaves {:.1} {name} RMS, {:.3} leaves {:.1} {name}",
        given / POSITION_GAIN,
        with_given / unit,
        gain / POSITION_GAIN,
        fit.rms / unit
    );
    found.findings.push(if (gain / given - 1.0).abs() > GAIN_CHANGE {
        Finding::warning(
            "gain-does-not-fit",
            what,
            "compare with the servo gain in the machine data of the control; --refine without gain keeps that of the file",
        )
    } else {
        Finding::note("gain-does-not-fit", what)
    });
}
